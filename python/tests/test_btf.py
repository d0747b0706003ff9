"""The Python module: `python -m unittest` here, with `btf` and numpy installed; `cargo xtask python` does it."""

import ast
import inspect
import os
import tempfile
import threading
import time
import unittest
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import btf
import numpy as np
from refusals import Refusing

ASSET = Path(__file__).resolve().parents[2] / "viewer" / "src" / "scene" / "builtin" / "weave.spmm"


def directions(rng, shape):
    """Unit vectors in front of the surface, not quite down to the horizon."""
    z, phi = rng.uniform(0.2, 1.0, shape), rng.uniform(0.0, 2.0 * np.pi, shape)
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], -1)


class Module(Refusing):
    @classmethod
    def setUpClass(cls):
        cls.asset = btf.open(ASSET)
        cls.rng = np.random.default_rng(5)

    def places(self, shape):
        rng = self.rng
        return rng.uniform(-2.0, 3.0, shape + (2,)), directions(rng, shape), directions(rng, shape)

class Opening(Module):
    def test_meta_holds_the_description_and_the_size(self):
        meta = self.asset.meta
        self.assertEqual((meta["width"], meta["height"], meta["layers"]), (64, 64, 1))
        self.assertGreaterEqual(meta["levels"], 1)
        self.assertEqual(meta["components"], 4)
        self.assertEqual(meta["sides"], [("front", "front")])
        self.assertEqual((meta["size_mm"], meta["seamless"]), ((4.0, 4.0), (False, False)))
        # A dict of one's own.
        meta["width"] = 3
        self.assertEqual(self.asset.meta["width"], 64)
        self.assertIn("64 x 64 texels", repr(self.asset))
        self.assertRegex(btf.__version__, r"^\d+\.\d+\.\d+")

    def test_an_asset_without_heights_says_so(self):
        self.assertIsNone(self.asset.heights())

    def test_a_saved_asset_is_the_same_file(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "copy.spmm"
            self.asset.save(path)
            self.assertEqual(path.read_bytes(), ASSET.read_bytes())
            self.assertEqual(self.asset.nbytes, ASSET.stat().st_size)
            self.refused(OSError, "no/such", self.asset.save, Path(folder) / "no" / "such" / "copy.spmm")

    def test_all_levels_are_there_where_they_are_asked_for(self):
        whole = btf.open(str(ASSET), levels="all", threads=2)
        self.assertEqual(whole.meta["levels"], 7)
        place = ([0.3, 0.4], [0.0, 0.0, 1.0], [0.0, 0.6, 0.8])
        np.testing.assert_array_equal(whole.eval(*place), self.asset.eval(*place))
        # The coarsest level is one texel: the same everywhere, and the mean of the finest one's.
        uv = (np.stack(np.meshgrid(np.arange(64), np.arange(64)), -1) + 0.5) / 64
        coarse, fine = (whole.eval(uv, *place[1:], level=level) for level in (6, 0))
        self.assertEqual(len(np.unique(coarse.reshape(-1, 3), axis=0)), 1)
        np.testing.assert_allclose(coarse[0, 0], fine.mean((0, 1)), rtol=0.15)
        # Planted difference: a texel for the mean of all.
        self.assertGreater(np.abs(fine[40, 20] / fine.mean((0, 1)) - 1).max(), 0.3)

    def test_refuses_files_that_are_no_assets(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "a.spmm")
            self.refused(FileNotFoundError, "a.spmm cannot be read", btf.open, path)
            good = ASSET.read_bytes()
            flipped = bytearray(good)
            flipped[-40] ^= 1
            for data, words in [
                (b"PNG and more" * 40, "not an SPMM asset"),
                (good[:-7], "cut off"),
                (good[:3], "too short"),
                (bytes(flipped), "damaged"),
            ]:
                Path(path).write_bytes(data)
                self.refused(ValueError, words, btf.open, path)
                self.refused(ValueError, "a.spmm: ", btf.open, path)
        self.refused(ValueError, "levels is 'some'", btf.open, ASSET, levels="some")


class Arrays(Module):
    def test_shapes_are_broadcast_as_numpy_does(self):
        uv, wi, wo = self.places((4, 5))
        whole = self.asset.eval(uv, wi, wo)
        self.assertEqual((whole.shape, whole.dtype), ((4, 5, 3), np.float32))
        one_by_one = [[self.asset.eval(uv[i, j], wi[i, j], wo[i, j]) for j in range(5)] for i in range(4)]
        np.testing.assert_array_equal(whole, one_by_one)
        # One eye for a row, one light for a column, one place for all; and views that are not contiguous.
        wide = self.asset.eval(uv[0, 0], wi[:, :1], wo[:1])
        same = [[self.asset.eval(uv[0, 0], wi[i, 0], wo[0, j]) for j in range(5)] for i in range(4)]
        np.testing.assert_array_equal(wide, same)
        np.testing.assert_array_equal(self.asset.eval(uv[::-1, ::2], wi[::-1, ::2], wo[::-1, ::2]), whole[::-1, ::2])
        # Planted difference: axes taken for each other.
        swapped = self.asset.eval(uv.transpose(1, 0, 2), wi.transpose(1, 0, 2), wo.transpose(1, 0, 2))
        self.assertFalse(np.array_equal(swapped.reshape(4, 5, 3), whole))
        self.assertEqual(self.asset.pdf(uv, wi[0], wo[:, :1]).shape, (4, 5))
        self.assertEqual(self.asset.pdf(uv[0, 0], wi[0, 0], wo[0, 0]).shape, ())
        drawn = self.asset.sample(uv, wo[0], [0.1, 0.2, 0.3])
        self.assertEqual([x.shape for x in drawn], [(4, 5, 3), (4, 5), (4, 5, 3)])
        self.assertEqual(self.asset.eval(np.empty((0, 2)), wi[0, 0], wo[0, 0]).shape, (0, 3))

    def test_single_and_double_precision_and_lists_mean_the_same(self):
        uv, wi, wo = (x.astype(np.float32) for x in self.places((50,)))
        single = self.asset.eval(uv, wi, wo)
        np.testing.assert_array_equal(self.asset.eval(*(x.astype(np.float64) for x in (uv, wi, wo))), single)
        np.testing.assert_array_equal(self.asset.eval(uv.tolist(), wi.tolist(), wo.tolist()), single)
        np.testing.assert_array_equal(
            self.asset.eval(uv[0], [0, 0, 1], [0, 0, 1]), self.asset.eval(uv[0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]))

    def test_refuses_shapes_and_types_that_do_not_fit(self):
        uv, wi, wo = self.places((4,))
        call = self.asset.eval
        self.refused(ValueError, "uv has the shape (4, 3): its last axis must have 2", call, wi, wi, wo)
        self.refused(ValueError, "wi has the shape (): its last axis must have 3", call, uv, 1.0, wo)
        self.refused(ValueError, "do not broadcast: uv (4, 2), wi (4, 3), wo (3, 3)", call, uv, wi, wo[:3])
        self.refused(ValueError, "wo is an array of complex128", call, uv, wi, wo * 1j)
        self.refused(ValueError, "uv is an array of <U", call, [["a", "b"]], wi, wo)
        self.refused(ValueError, "at has the shape (4, 2)", self.asset.sample, uv, wo, uv)
        # Much from little: these two arrays take a few bytes.
        rows = np.broadcast_to(uv[0].astype(np.float32), (1 << 30, 1, 2))
        columns = np.broadcast_to(wi[0].astype(np.float32), (1, 1 << 30, 3))
        self.refused(MemoryError, "no memory for the shape (1073741824, 1073741824)", call, rows, columns, wo[0])

    def test_black_where_the_asset_says_nothing(self):
        uv, wi, wo = self.places((3,))
        wi[0, 2] *= -1.0
        wi[1] *= 1.5
        wo[2, 0] = np.nan
        np.testing.assert_array_equal(self.asset.eval(uv, wi, wo), np.zeros((3, 3)))
        np.testing.assert_array_equal(self.asset.pdf(uv, wi, wo), np.zeros(3))
        np.testing.assert_array_equal(self.asset.sample(uv, -wo, [0.5, 0.5, 0.5])[1], np.zeros(3))


class Options(Module):
    def test_every_keyword_changes_what_it_names_and_nothing_at_its_default(self):
        uv, wi, wo = self.places((400,))
        plain = self.asset.eval(uv, wi, wo)
        same = self.asset.eval(uv, wi, wo, components=4, lobes=1000, interpolation="fast", heights="relief", level=0)
        np.testing.assert_array_equal(same, plain)
        for keywords in [{"components": 0}, {"components": 2}, {"interpolation": "exact"}]:
            other = self.asset.eval(uv, wi, wo, **keywords)
            self.assertFalse(np.array_equal(other, plain), keywords)
            self.assertLess(np.abs(other - plain).mean(), 0.2 * plain.mean(), keywords)

    def test_refuses_keywords_out_of_their_range(self):
        place = ([0.5, 0.5], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0])
        for call in (self.asset.eval, self.asset.pdf):
            self.refused(ValueError, "interpolation is 'cubic'", call, *place, interpolation="cubic")
            self.refused(ValueError, "level 40 was asked for", call, *place, level=40)
            self.refused(OverflowError, "", call, *place, components=-1)
            self.refused(TypeError, "frames", call, *place, frames=1)


class Samples(Module):
    def test_samples_have_the_density_that_is_told_and_sum_up_to_the_whole(self):
        uv, wo = np.array([0.3, 0.6]), np.array([0.6, 0.0, 0.8])
        wi, density, value = self.asset.sample(uv, wo, self.rng.random((40000, 3)))
        drawn = density > 0
        self.assertGreater(drawn.mean(), 0.5)
        np.testing.assert_allclose(np.linalg.norm(wi[drawn], axis=1), 1.0, atol=1e-5)
        np.testing.assert_allclose(self.asset.pdf(uv, wi[drawn], wo), density[drawn], rtol=1e-4)
        np.testing.assert_array_equal(self.asset.eval(uv, wi[drawn], wo), value[drawn])
        self.assertTrue((wi[~drawn] == 0).all() and (value[~drawn] == 0).all())
        side = 400
        z, phi = np.meshgrid((np.arange(side) + 0.5) / side, (np.arange(side) + 0.5) / side * 2 * np.pi)
        r = np.sqrt(1 - z * z)
        around = np.stack([r * np.cos(phi), r * np.sin(phi), z], -1)
        whole = self.asset.eval(uv, around, wo).mean((0, 1)) * 2
        total = self.asset.pdf(uv, around, wo).mean() * 2 * np.pi
        estimate = (value[drawn] / density[drawn, None]).sum(0) / len(drawn) / np.pi
        np.testing.assert_allclose(estimate, whole, rtol=0.02)
        np.testing.assert_allclose(total, drawn.mean(), rtol=0.02)
        # Planted difference: the densities of other directions.
        wrong = (value[drawn] / np.roll(density[drawn], 1)[:, None]).sum(0) / len(drawn) / np.pi
        self.assertGreater(np.abs(wrong / whole - 1).max(), 0.05)


class Between(Module):
    def test_the_mean_of_drawn_texels_is_their_interpolation(self):
        uv, wi, wo = self.places(())
        steps = (np.arange(64) + 0.5) / 64
        at = np.stack(np.meshgrid(steps, steps), -1)
        between = self.asset.uv_between(uv, at)
        self.assertEqual((between.shape, between.dtype), ((64, 64, 2), np.float32))
        mean = self.asset.eval(between, wi, wo).mean((0, 1))
        # Bilinear, by numpy: texels' middles are at halves, v is up.
        place = np.array([uv[0], 1.0 - uv[1]]) * 64 - 0.5
        low = np.floor(place)
        part = place - low
        expected = 0.0
        for dx, dy in [(0, 0), (1, 0), (0, 1), (1, 1)]:
            weight = (part[0] if dx else 1 - part[0]) * (part[1] if dy else 1 - part[1])
            middle = (low + [dx, dy] + 0.5) / 64
            expected = expected + weight * self.asset.eval([middle[0], 1.0 - middle[1]], wi, wo)
        np.testing.assert_allclose(mean, expected, rtol=0.02)
        # Planted difference: the nearest texel, which 0.5 twice gives.
        nearest = self.asset.eval(self.asset.uv_between(uv, [0.5, 0.5]), wi, wo)
        np.testing.assert_array_equal(nearest, self.asset.eval(uv, wi, wo))
        self.assertGreater(np.abs(nearest - mean).max(), 1e-4)
        self.refused(ValueError, "level 9 was asked for", self.asset.uv_between, uv, [0.5, 0.5], level=9)


class Stubs(unittest.TestCase):
    STUB = Path(btf.__file__).with_name("__init__.pyi")

    def differences(self, text):
        """Functions of the stub whose parameters or defaults are not the module's, and those that are missing there."""
        public = lambda owner: {name for name in vars(owner) if not name.startswith("_")}  # noqa: E731
        wanted = {name: getattr(btf, name) for name in ("open", "fit", "compare")}
        for owner in (btf.Asset, btf.Capture):
            wanted.update({f"{owner.__name__}.{name}": getattr(owner, name) for name in public(owner)})
        wanted["Capture.__init__"] = btf.Capture
        found = {}
        tree = ast.parse(text)
        owners = [("", tree)] + [(f"{one.name}.", one) for one in tree.body if isinstance(one, ast.ClassDef)]
        for prefix, owner in owners:
            for node in owner.body:
                if isinstance(node, ast.FunctionDef):
                    required = [(one.arg, inspect.Parameter.empty) for one in node.args.args]
                    optional = zip(node.args.kwonlyargs, node.args.kw_defaults)
                    defaults = [(one.arg, ast.literal_eval(default)) for one, default in optional]
                    found[prefix + node.name] = required + defaults
        differ = set(wanted) ^ set(found)
        for name in set(wanted) & set(found):
            if callable(wanted[name]):
                parameters = inspect.signature(wanted[name]).parameters.values()
                # That of a class has no self.
                told = [one for one in found[name] if name != "Capture.__init__" or one[0] != "self"]
                differ |= set() if [(one.name, one.default) for one in parameters] == told else {name}
        return differ

    def test_the_stub_says_what_the_module_takes(self):
        text = self.STUB.read_text()
        self.assertEqual(self.differences(text), set())
        # Planted differences: another default, another order, a function that is not there.
        other = text.replace("level: int = 0", "level: int = 1")
        with_level = ("eval", "eval_bands", "pdf", "sample", "uv_between")
        self.assertEqual(self.differences(other), {f"Asset.{name}" for name in with_level})
        swapped = text.replace("wo: ArrayLike,\n        at: ArrayLike", "at: ArrayLike,\n        wo: ArrayLike")
        self.assertEqual(self.differences(swapped), {"Asset.sample"})
        self.assertEqual(self.differences(text + "\ndef close() -> None: ...\n"), {"close"})
        self.assertTrue((Path(btf.__file__).parent / "py.typed").exists())


class Threads(Module):
    def test_one_asset_is_read_by_many_threads(self):
        parts = [self.places((3000,)) for _ in range(4)]
        alone = [self.asset.eval(*part) for part in parts]
        with ThreadPoolExecutor(4) as pool:
            together = list(pool.map(lambda part: self.asset.eval(*part), parts))
        for a, b in zip(alone, together):
            np.testing.assert_array_equal(a, b)

    def test_others_run_while_it_evaluates(self):
        places = self.places((1000,))
        start = time.perf_counter()
        self.asset.eval(*places)
        # About a second of work.
        repeats = int(np.clip(1.0 / (time.perf_counter() - start), 10, 5000))
        uv, wi, wo = (np.tile(x, (repeats, 1)) for x in places)
        start = time.perf_counter()
        worker = threading.Thread(target=self.asset.eval, args=(uv, wi, wo))
        worker.start()
        ticks = 0
        while worker.is_alive():
            time.sleep(0.002)
            ticks += 1
        took = time.perf_counter() - start
        # With the lock held there would be one or two.
        self.assertGreater(ticks, 20, f"{took:.2f} s")


if __name__ == "__main__":
    unittest.main()

"""Captures of arrays and folders, `btf.fit` and `btf.compare`."""

import os
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import zlib
from pathlib import Path

import btf
import numpy as np
from refusals import Refusing

SIZE = 12


def ring(theta_deg, count):
    phi = 2.0 * np.pi * np.arange(count) / count
    theta = np.radians(theta_deg)
    return [[np.sin(theta) * np.cos(p), np.sin(theta) * np.sin(p), np.cos(theta)] for p in phi]


#: Not in the order of angles, which is that of files.
DIRECTIONS = np.array(ring(60.0, 6) + ring(0.0, 1) + ring(30.0, 5))


def reflected(wi, wo):
    """A material of stripes, (lights, rows, columns, 3) for a view: diffuse, with a Phong lobe. No code of ours."""
    columns = np.arange(SIZE)
    colour = np.where((columns // 3 % 2 == 0)[None, :, None], [0.6, 0.3, 0.1], [0.1, 0.3, 0.5])
    mirrored = np.array([-wo[0], -wo[1], wo[2]])
    gloss = 0.4 * np.maximum(wi @ mirrored, 0.0) ** 12
    value = colour[None] * np.ones((len(wi), SIZE, 1, 1)) + gloss[:, None, None, None]
    return value * np.maximum(wi[:, 2], 0.0)[:, None, None, None]


def grey_png(width, height, code):
    """A picture of one grey, 8 bits, three channels."""

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    rows = (b"\0" + bytes([code]) * (3 * width)) * height
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def images():
    return np.stack([reflected(DIRECTIONS, wo) for wo in DIRECTIONS]).astype(np.float32)


class Arrays(Refusing):
    @classmethod
    def setUpClass(cls):
        cls.capture = btf.Capture(images(), DIRECTIONS, DIRECTIONS, size_mm=(6.0, 3.0), name="stripes")

    def test_images_come_back_with_their_directions(self):
        capture = self.capture
        self.assertEqual((capture.shape, capture.size_mm, capture.name), ((SIZE, SIZE), (6.0, 3.0), "stripes"))
        self.assertIn("12 views", repr(capture))
        for view in range(12):
            for light in (0, 7, 11):
                expected = reflected(capture.lights[light : light + 1], capture.views[view])[0]
                np.testing.assert_allclose(capture.image(view, light), expected, atol=2e-6)
        self.refused(IndexError, "12 views", capture.image, 12, 0)

    def test_pairs_without_an_image_are_named(self):
        self.assertEqual(self.capture.missing, [])
        with tempfile.TemporaryDirectory() as folder:
            names = [f"tl{light:03} pl000 tv{view:03} pv000.png" for view in (0, 30) for light in (0, 45)]
            for name in names[:2] + names[3:]:
                (Path(folder) / name).write_bytes(grey_png(4, 3, 128))
            self.refused(ValueError, "missing", btf.Capture.open, folder)
            (Path(folder) / "capture.toml").write_text("incomplete = true\n")
            capture = btf.Capture.open(folder)
            self.assertEqual((capture.missing, capture.shape), ([(1, 0)], (3, 4)))
            self.refused(ValueError, "view theta 30", capture.image, 1, 0)
            self.assertAlmostEqual(float(capture.image(1, 1)[2, 3, 0]), 0.2158, places=3)

    def test_a_fit_has_the_values_and_measures_itself(self):
        heard = []
        asset = btf.fit(self.capture, progress=lambda *told: heard.append(told))
        figures = asset.meta["error"]
        self.assertGreater(figures["psnr_db"], 40.0)
        self.assertEqual(asset.meta["size_mm"], (6.0, 3.0))
        self.assertIn("measure", {stage for stage, _, _ in heard})
        self.assertTrue(all(0 <= done <= total for _, done, total in heard))
        u = (np.arange(SIZE) + 0.5) / SIZE
        uv = np.stack(np.meshgrid(u, 1.0 - u), -1)
        values = asset.eval(uv, DIRECTIONS[9], DIRECTIONS[2])
        np.testing.assert_allclose(values, reflected(DIRECTIONS[9:10], DIRECTIONS[2])[0], atol=0.02)
        compared = btf.compare(asset, self.capture)
        self.assertAlmostEqual(compared["psnr_db"], figures["psnr_db"], places=2)
        # Fewer parts are worse, and another capture is another material.
        self.assertLess(btf.compare(asset, self.capture, components=0, lobes=0)["psnr_db"], figures["psnr_db"] - 3.0)
        other = btf.Capture(0.8 * images(), DIRECTIONS, DIRECTIONS)
        self.assertLess(btf.compare(asset, other)["psnr_db"], 30.0)

    def test_a_fit_is_the_programs_whatever_the_threads_and_the_order(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "stripes.spmm"
            one = btf.fit(self.capture, bytes="8kB", output=path, threads=1)
            self.assertLessEqual(one.nbytes, 8000)
            order = np.random.default_rng(1).permutation(12)
            mixed = btf.Capture(images()[order][:, order], DIRECTIONS[order], DIRECTIONS[order], size_mm=(6.0, 3.0), name="stripes")
            btf.fit(mixed, bytes=8000.0, output=Path(folder) / "mixed.spmm", threads=2)
            self.assertEqual(path.read_bytes(), (Path(folder) / "mixed.spmm").read_bytes())
            one.save(Path(folder) / "saved.spmm")
            self.assertEqual(path.read_bytes(), (Path(folder) / "saved.spmm").read_bytes())
            # Opened from the file, and measured by its path.
            self.assertEqual(btf.compare(path, self.capture), btf.compare(btf.open(path), self.capture))

    def test_priors_predict_the_pairs_without_an_image(self):
        with tempfile.TemporaryDirectory() as folder:
            few, prior = Path(folder) / "few", Path(folder) / "stripes.spmm"
            few.mkdir()
            (few / "capture.toml").write_text("incomplete = true\n")
            angles = [(theta, phi) for theta in (0, 30, 60) for phi in ((0,) if theta == 0 else (0, 90, 180, 270))]
            for number, (theta, phi) in enumerate(angles):
                for step in (0, 1, 4):
                    light = angles[(number + step) % len(angles)]
                    name = f"tl{light[0]:03} pl{light[1]:03} tv{theta:03} pv{phi:03}.png"
                    (few / name).write_bytes(grey_png(SIZE, SIZE, 60 + 7 * number + 5 * step))
            capture = btf.Capture.open(few)
            self.assertEqual(len(capture.missing), 54)
            btf.fit(self.capture, bytes="8kB", output=prior)
            made = {}
            for name, priors in (("own", [prior]), ("none", []), ("again", [str(prior)])):
                made[name] = btf.fit(capture, bytes="8kB", output=Path(folder) / f"{name}.spmm", priors=priors)
            read = {name: (Path(folder) / f"{name}.spmm").read_bytes() for name in made}
            self.assertEqual(read["own"], read["again"])
            self.assertNotEqual(read["own"], read["none"])
            self.refused(OSError, "gone.spmm", btf.fit, capture, priors=[Path(folder) / "gone.spmm"])

    def test_what_does_not_fit_is_one_sentence(self):
        good, directions = images(), DIRECTIONS
        make = btf.Capture
        self.refused(ValueError, "five axes", make, good[0], directions, directions)
        self.refused(ValueError, "12 views and 12 lights", make, good, directions[:5], directions)
        self.refused(ValueError, "lights[0] is no unit vector", make, good, 2.0 * directions, directions)
        self.refused(ValueError, "comes twice", make, good, directions[[0] * 12], directions)
        self.refused(ValueError, "last axis must have 3", make, good[..., :2], directions, directions)
        self.refused(ValueError, "is not a side", make, good, directions, directions, side="top")
        bad = good.copy()
        bad[3, 4, 5, 6, 1] = np.nan
        self.refused(ValueError, "NaN", btf.fit, make(bad, directions, directions))
        self.refused(ValueError, "error is 'l2'", btf.fit, self.capture, error="l2")
        self.refused(ValueError, "bytes", btf.fit, self.capture, bytes="much")
        self.refused(ValueError, "gpu", btf.fit, self.capture, gpu="")
        self.refused(ValueError, "no such adapter", btf.fit, self.capture, gpu="no such adapter")
        self.refused(TypeError, "a path or a btf.Capture", btf.fit, 7)
        self.refused(ValueError, "empty", btf.fit, [])
        with tempfile.TemporaryDirectory() as folder:
            self.refused(ValueError, folder, btf.fit, folder)
            self.refused(OSError, "none", btf.fit, Path(folder) / "none")
            self.refused(OSError, "no-such", btf.fit, self.capture, output=Path(folder) / "no-such" / "a.spmm")
            self.refused(ValueError, "is a folder", btf.fit, self.capture, output=folder)
            zipped = Path(folder) / "wool.zip"
            zipped.write_bytes(b"PK\x05\x06" + bytes(18))
            self.refused(ValueError, "", btf.fit, zipped, output=zipped)
            self.assertEqual(zipped.stat().st_size, 22)
            zipped.unlink()
            self.assertEqual(os.listdir(folder), [])


class Ending(unittest.TestCase):
    def test_what_progress_raises_ends_the_fit(self):
        capture = btf.Capture(images(), DIRECTIONS, DIRECTIONS)
        with tempfile.TemporaryDirectory() as folder:

            called = []

            def stop(stage, done, total):
                called.append(stage)
                raise RuntimeError("enough")

            with self.assertRaisesRegex(RuntimeError, "enough"):
                btf.fit(capture, output=Path(folder) / "a.spmm", progress=stop)
            self.assertEqual((len(called), os.listdir(folder)), (1, []))

    def test_control_c_ends_the_fit(self):
        script = (
            "import btf, signal, test_fit, sys\n"
            # Programs that a shell starts in the background ignore it.
            "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
            "c = btf.Capture(test_fit.images(), test_fit.DIRECTIONS, test_fit.DIRECTIONS)\n"
            "def told(*_):\n"
            "    print('fits', flush=True)\n"
            "try:\n"
            "    while True: btf.fit(c, progress=told)\n"
            "except KeyboardInterrupt: print('interrupted')\n"
        )
        child = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
        self.assertEqual(child.stdout.readline(), "fits\n")
        child.send_signal(signal.SIGINT)
        self.assertTrue(child.communicate(timeout=60)[0].endswith("interrupted\n"))

    def test_others_run_while_it_fits(self):
        capture, ticks = btf.Capture(images(), DIRECTIONS, DIRECTIONS), 0
        worker = threading.Thread(target=btf.fit, args=(capture,))
        worker.start()
        while worker.is_alive():
            time.sleep(0.002)
            ticks += 1
        self.assertGreater(ticks, 5)


if __name__ == "__main__":
    unittest.main()

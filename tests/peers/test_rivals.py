"""Self-check of the rivals: `python -m unittest` in this folder; needs numpy only (the neural ones torch as well)."""

import json
import math
import tempfile
import unittest
from pathlib import Path

import numpy as np

from rival import (capture, clusters, codes, coordinates, domain, envelope, holdout, plus, predicted, published,
                   sides, strong, transformed, tucker)

try:
    import torch
    from rival import neural, neural_model
except ImportError:
    torch = None

VIEWS, LIGHTS, SIDE = 9, 10, 32


def toy(noise=0.0, groups=4, seed=3):
    """A capture of clustered texels: every group has a mean and two smooth components of its own."""
    rng = np.random.default_rng(seed)
    angle_v, angle_l = np.linspace(0, 1, VIEWS), np.linspace(0, 1, LIGHTS)

    def smooth():
        waves = [rng.normal() * np.outer(np.cos(i * angle_v + rng.normal()), np.cos(j * angle_l + rng.normal()))
                 for i in range(3) for j in range(3)]
        return (sum(waves)[:, :, None] * rng.uniform(0.5, 1, 3)).reshape(-1)

    label = (np.arange(SIDE * SIDE) // SIDE // (SIDE // groups)).astype(int)
    values = np.empty((SIDE * SIDE, VIEWS * LIGHTS * 3))
    for group in range(groups):
        at = np.flatnonzero(label == group)
        base = np.stack([smooth(), smooth()])
        values[at] = 128 + 12 * smooth() + 12 * rng.normal(size=(len(at), 2)) @ base
    values += noise * rng.normal(size=values.shape)
    directions = lambda n: np.stack([np.linspace(0, 75, n), 137.0 * np.arange(n) % 360], 1)
    return capture.Capture("toy", np.clip(np.rint(values), 0, 255).astype(np.uint8), SIDE, SIDE, directions(VIEWS),
                           directions(LIGHTS), "srgb")


class Errors(unittest.TestCase):
    def test_psnr_of_a_planted_difference(self):
        codes = np.full((10, 10), 100, np.uint8)
        decoded = codes.astype(np.float32)
        self.assertEqual(domain.psnr_db(domain.squared_error(decoded.copy(), codes), 100), 99.0)
        decoded[3, 4] += 5
        error = domain.squared_error(decoded, codes)
        self.assertEqual(error, 25.0)
        self.assertAlmostEqual(domain.psnr_db(error, 100), 10 * math.log10(255**2 / 0.25), places=9)

    def test_every_domain_gives_back_every_code(self):
        codes = np.arange(256, dtype=np.uint8)[None]
        for kind in ("gamma", "linear", "log"):
            for transfer in ("srgb", "gamma:2.2"):
                there = domain.Domain(kind, transfer)
                back = there.codes(there.forward(codes).copy())
                np.testing.assert_array_equal(back[0], np.arange(256), f"{kind} {transfer}")

    def test_decoded_values_are_clipped(self):
        there = domain.Domain("gamma")
        np.testing.assert_array_equal(there.codes(np.array([[-3.0, 260.0, 7.4]], np.float32))[0], [0, 255, 7])


class Envelope(unittest.TestCase):
    POINTS = [{"codec": "strong", "bytes": b, "psnr_db": d} for b, d in ((100, 20.0), (1000, 30.0), (10000, 40.0))]

    def test_interpolates_in_the_logarithm_of_bytes(self):
        line = envelope.front(self.POINTS)
        self.assertAlmostEqual(envelope.at(line, math.sqrt(100 * 1000)), 25.0)
        self.assertIsNone(envelope.at(line, 99))
        self.assertEqual(envelope.at(line, 1e9), 40.0)
        self.assertAlmostEqual(envelope.bytes_at(line, 35.0), math.sqrt(1000 * 10000))
        self.assertIsNone(envelope.bytes_at(line, 41))

    def test_beaten_points_change_nothing_and_better_ones_do(self):
        line = envelope.front(self.POINTS)
        self.assertEqual(envelope.front(self.POINTS + [{"bytes": 2000, "psnr_db": 29.0}]), line)
        self.assertNotEqual(envelope.front(self.POINTS + [{"bytes": 900, "psnr_db": 31.0}]), line)

    def test_the_hull_lies_above_the_front(self):
        points = self.POINTS[:1] + [{"bytes": 1000, "psnr_db": 26.0}] + self.POINTS[2:]
        self.assertAlmostEqual(envelope.at(envelope.hull(points), 1000), 30.0)
        self.assertAlmostEqual(envelope.at(envelope.front(points), 1000), 26.0)

    def test_samples_and_bounds_do_not_count(self):
        extra = [{"codec": "strong", "bytes": 500, "psnr_db": 50.0, "decoded": "4096 texels"},
                 {"codec": "av1", "bytes": 500, "psnr_db": 50.0, "decoded": "all texels"},
                 {"codec": "strong+", "bytes": 500, "psnr_db": 50.0, "decoded": "all texels"}]
        self.assertEqual(envelope.of_codecs(self.POINTS + extra), self.POINTS)

    def test_the_summary_names_the_published_reference(self):
        points = self.POINTS + [{"codec": "local pca", "clusters": 32, "components": 8, "bytes": 80000, "psnr_db": 35.0}]
        told = envelope.summary({"points": points})["local_pca_32x8"]
        self.assertAlmostEqual(told["rival_bytes_at_its_psnr"], math.sqrt(1000 * 10000))


class Bytes(unittest.TestCase):
    def test_published_sizes_of_a_whole_bonn_capture(self):
        texels, width = 65536, 81 * 81 * 3
        self.assertEqual(published.fmf_bytes(texels, width, 8), 8 * (65536 + 19683) * 2)
        # 32 clusters of a mean and 8 components, 8 halves and 5 bits a texel.
        self.assertEqual(published.lpca_bytes(texels, width, 32, 8), 32 * 9 * 19683 * 2 + 65536 * 16 + 65536 * 5 // 8)

    def test_strong_sizes_count_every_array(self):
        factors = tucker.Factors(np.zeros((81, 24), np.float32), np.zeros((81, 16), np.float32))
        core = 24 * 16 * 3
        stored = {"factors": 2 * 81 * (24 + 16), "mean": 2 * core, "bases": 32 * (1 + 3) * (core + 2 * 16),
                  "scales": 32 * 3 * 2, "ids": 65536 * 5 // 8, "codes": 65536 * 3}
        self.assertEqual(strong.bytes_of(65536, 32, 3, factors), sum(stored.values()))
        self.assertEqual([strong.id_bits(k) for k in (1, 2, 16, 17, 32, 256)], [0, 1, 4, 5, 5, 8])


class Tucker(unittest.TestCase):
    def tensors(self):
        rng = np.random.default_rng(5)
        view, light = rng.normal(size=(VIEWS, 4)), rng.normal(size=(LIGHTS, 3))
        return np.einsum("nabc,va,lb->nvlc", rng.normal(size=(20, 4, 3, 3)), view, light).reshape(20, -1).astype(np.float32)

    def test_round_trip_at_the_true_ranks(self):
        tensors = self.tensors()
        factors = tucker.factors_of(tensors, (VIEWS, LIGHTS, 3), 4, 3)
        np.testing.assert_allclose(factors.expand(factors.cores(tensors)), tensors, atol=2e-4)

    def test_a_rank_too_few_loses_energy(self):
        tensors = self.tensors()
        factors = tucker.factors_of(tensors, (VIEWS, LIGHTS, 3), 3, 3)
        lost = factors.expand(factors.cores(tensors)) - tensors
        self.assertGreater(np.sum(lost**2), 1e-3 * np.sum(tensors**2))

    def test_eight_bit_cores_stay_within_half_a_step_of_their_row(self):
        cores = np.random.default_rng(1).normal(size=(5, 7, 12)).astype(np.float32) * 10.0 ** np.arange(-1, 6)[:, None]
        step = np.abs(cores).max(-1, keepdims=True) / 127
        error = np.abs(tucker.quantise_cores(cores) - cores)
        self.assertTrue(np.all(error <= 0.51 * step))
        self.assertTrue(np.any(tucker.quantise_cores(cores, bits=4) != tucker.quantise_cores(cores)))


class Codecs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.data = toy(noise=1.0)
        cls.gamma = domain.Domain("gamma")
        cls.frame = coordinates.measure(cls.data, cls.gamma, 40, subset=512)

    def encoded(self, k, c, view_rank=6, light_rank=6):
        strength = np.sqrt(np.sum(self.frame.points.astype(np.float64) ** 2, 0)).astype(np.float32)
        space = strong.space_of(self.frame, (self.frame.basis * strength).T, view_rank, light_rank)
        labels = np.arange(self.data.texels) % k
        return strong.encode(self.data, self.gamma, self.frame, space, k, c, labels)

    def test_coordinates_hold_the_energy(self):
        values = self.data.values.astype(np.float64)
        self.assertAlmostEqual(self.frame.energy / np.sum(values**2), 1, places=5)
        rebuilt = self.frame.points @ self.frame.basis.T
        self.assertAlmostEqual(np.sum((rebuilt - values) ** 2) / self.frame.outside, 1, delta=0.02)

    def test_local_pca_beats_one_cluster_and_finds_the_groups(self):
        one = clusters.local_pca(self.frame.points, 1, 2)
        four = clusters.local_pca(self.frame.points, 4, 2)
        self.assertLess(four.error, 0.2 * one.error)
        for group in four.labels.reshape(4, -1):
            self.assertGreater(np.bincount(group).max(), 0.85 * len(group))

    def test_strong_is_decoded_from_what_is_stored(self):
        encoded, (error, count) = self.encoded(4, 2)
        decoded = self.gamma.codes(strong.decode(encoded, np.arange(self.data.texels)))
        self.assertAlmostEqual(domain.squared_error(decoded, self.data.values), error, delta=1e-4 * error)
        self.assertEqual(count, self.data.values.size)
        # Noise of standard deviation 1 and rounding: nothing else is left.
        self.assertGreater(domain.psnr_db(error, count), 45.5)

    def test_a_damaged_code_is_noticed(self):
        encoded, (error, _) = self.encoded(4, 2)
        encoded.codes[5] = -encoded.codes[5]
        decoded = self.gamma.codes(strong.decode(encoded, np.arange(self.data.texels)))
        self.assertGreater(domain.squared_error(decoded, self.data.values), 1.001 * error)

    def test_strong_beats_published_at_fewer_bytes_here(self):
        _, (error, count) = self.encoded(4, 2)
        linear = domain.Domain("linear")
        frame = coordinates.measure(self.data, linear, 40, subset=512)
        fmf = published.fmf_points(self.data, linear, frame, components=(2, 8))
        self.assertGreater(domain.psnr_db(error, count), fmf[0]["psnr_db"] + 3)
        self.assertGreater(fmf[1]["psnr_db"], fmf[0]["psnr_db"])
        local = published.lpca_points(self.data, linear, frame, clusters=(4,), components=(2,), log=lambda *_: None)
        self.assertGreater(local[0]["psnr_db"], fmf[0]["psnr_db"] + 3)

    def test_the_search_estimates_what_the_encoder_reaches(self):
        data = toy(noise=5.0)
        frame = coordinates.measure(data, self.gamma, 40, subset=512)
        spaces = strong.spaces_of(frame, log=lambda *_: None)
        found, chosen = strong.search(frame, spaces, data.texels, 20000, clusters=(1, 4), log=lambda *_: None)
        best = strong.best_at(found, [20000])[0]
        point, _ = strong.measure(data, self.gamma, frame, spaces, best, chosen)
        self.assertAlmostEqual(point["psnr_db"], best.psnr_db, delta=0.3)
        self.assertEqual(point["bytes"], best.bytes)


class Codes(unittest.TestCase):
    """Every plan against the real coder. The decoder sees bytes only, so a context that looks at later numbers fails."""

    @staticmethod
    def numbers(shape, scale=1.0, seed=2):
        rng = np.random.default_rng(seed)
        lively = scale * np.exp(0.6 * rng.normal(size=shape[:2]))[(...,) + (None,) * (len(shape) - 2)]
        return np.rint(rng.laplace(size=shape) * lively).astype(np.int64)

    def plans(self, side=10):
        rng = np.random.default_rng(4)
        labels, kept = rng.integers(0, 3, (side, side)), np.array([[1, 1, 1], [1, 1, 0], [1, 0, 0]], bool)
        local = self.numbers((side, side, 3)) * kept[labels]
        blocks = self.numbers((2, 2, 2, 4, 4), 2)
        blocks[..., 3, 3] = 0
        rows, cores = self.numbers((9, 12)), self.numbers((3, 4, 5, 3), 30)
        # As large as the first core of a smooth material.
        cores[0, 0, 0, 0] = 1234567
        return {
            "local": (lambda: predicted.LocalPlan(labels, kept), local),
            "blocks": (lambda: transformed.BlocksPlan(blocks.shape, transformed.ends_of(blocks), 32), blocks),
            "rows": (lambda: sides.RowsPlan(12, [(0, 4), (4, 4), (4, 9)]), rows),
            "cores": (lambda: sides.CoresPlan(3), cores),
        }

    def test_a_decoder_reads_what_a_real_coder_wrote(self):
        for name, (plan, numbers) in self.plans().items():
            data = codes.encode(plan(), numbers)
            np.testing.assert_array_equal(codes.decode(plan(), data, numbers.shape), numbers, name)
            damaged = bytes([data[0] ^ 64]) + data[1:]
            self.assertFalse(np.array_equal(codes.decode(plan(), damaged, numbers.shape), numbers), name)

    def test_real_bytes_are_the_estimated_ones(self):
        for name, (plan, numbers) in self.plans(side=44).items():
            estimate, real = codes.bits_of(plan(), numbers) / 8, len(codes.encode(plan(), numbers))
            self.assertAlmostEqual(real, estimate, delta=0.005 * estimate + 4, msg=name)
            # A planted difference: smaller numbers take less.
            self.assertLess(codes.bits_of(plan(), numbers // 2) / 8, 0.95 * estimate, name)

    def test_contexts_save_bits(self):
        told = lambda n: codes.bits_of(predicted.LocalPlan(np.zeros((44, 44), int), np.ones((1, 3), bool)), n)
        bands = 4 * (np.arange(44) // 11)[None, :, None]
        smooth = np.rint(bands * np.random.default_rng(1).normal(size=(44, 44, 3))).astype(np.int64)
        mixed = smooth.reshape(-1, 3)[np.random.default_rng(2).permutation(44 * 44)].reshape(smooth.shape)
        self.assertLess(told(smooth), 0.95 * told(mixed))

    def test_labels_cost_by_what_came_before(self):
        rng = np.random.default_rng(1)
        noise = rng.integers(0, 8, (40, 40))
        self.assertAlmostEqual(predicted.label_bits(noise, 8).sum() / noise.size, 3, delta=0.25)
        halves = np.repeat(np.arange(40)[None] // 20, 40, 0)
        self.assertLess(predicted.label_bits(halves, 8).sum(), 250)
        changed = noise.copy()
        changed[30:] = 0
        np.testing.assert_array_equal(predicted.label_bits(changed, 8)[:30], predicted.label_bits(noise, 8)[:30])
        self.assertNotEqual(predicted.label_bits(changed, 8)[30], predicted.label_bits(noise, 8)[30])


class Plus(unittest.TestCase):
    def test_cosines_are_orthonormal_and_turn_back(self):
        planes = np.random.default_rng(3).normal(size=(2, 16, 16)).astype(np.float32)
        blocks = transformed.blocks_of(planes, 8)
        self.assertAlmostEqual(np.sum(blocks**2) / np.sum(planes**2), 1, places=5)
        np.testing.assert_allclose(transformed.planes_of(blocks), planes, atol=1e-5)
        # A constant plane is all in the first frequency.
        constant = transformed.blocks_of(np.ones((1, 16, 16), np.float32), 8)
        self.assertAlmostEqual(float(np.abs(constant).sum() - np.abs(constant[..., 0, 0]).sum()), 0, places=4)

    def test_rounding_towards_zero_where_bits_cost_more(self):
        ratio = np.array([0.4, 0.55, 0.55, -0.9, 3.2])
        np.testing.assert_array_equal(plus.rounded(ratio, np.array([3, 3, 0.01, 0.01, 1])), [0, 1, 0, -1, 3])

    def local(self, step):
        rng = np.random.default_rng(8)
        labels = rng.integers(0, 2, (16, 16))
        bases = np.stack([np.linalg.qr(rng.normal(size=(6, 6)))[0][:4] for _ in range(2)]).astype(np.float32)
        means = rng.normal(size=(2, 6)).astype(np.float32)
        ramp = np.linspace(-20, 20, 16)
        values = np.add.outer(ramp, ramp)[:, :, None] * np.linspace(1, 2, 6)
        targets = np.einsum("yxq,yxcq->yxc", values - means[labels], bases[labels]).astype(np.float32)
        arguments = labels, means, bases, np.ones((2, 4), bool), step
        return targets, arguments, *predicted.predicted(targets, *arguments)

    def test_predicted_coefficients_are_decoded_from_numbers_alone(self):
        targets, arguments, numbers, decoded = self.local(0.5)
        np.testing.assert_array_equal(predicted.decoded_of(numbers, *arguments), decoded)
        self.assertLess(np.abs(decoded - targets).max(), 0.5)
        changed = numbers.copy()
        changed[7, 7, 0] += 1
        self.assertGreater(np.abs(predicted.decoded_of(changed, *arguments) - decoded).max(), 0.4)

    def test_prediction_crosses_clusters(self):
        # A ramp over texels of two clusters whose bases differ: what is left is far smaller than what is told.
        targets, _, numbers, _ = self.local(0.5)
        self.assertLess(np.abs(numbers[8:]).mean(), 0.15 * np.abs(targets[8:] / 0.5).mean())

    def test_shared_bases_are_told_within_a_step(self):
        rng = np.random.default_rng(5)
        scaled = rng.normal(size=(6, VIEWS * LIGHTS * 3)).astype(np.float32) * 40
        live, told, bits, ranks = sides.shared_bases(scaled, (VIEWS, LIGHTS, 3))
        self.assertEqual((list(live), ranks), (list(range(6)), (VIEWS, LIGHTS)))
        # Full ranks: rounding of cores (1/12) and of factor matrices, and not less.
        self.assertTrue(0.05 < np.mean((told - scaled) ** 2) < 0.3)
        self.assertGreater(bits, scaled.size * 5)

    @classmethod
    def setUpClass(cls):
        cls.data, cls.gamma = toy(noise=2.0), domain.Domain("gamma")
        cls.frame = coordinates.measure(cls.data, cls.gamma, 60, subset=512)
        cls.step = 6 * math.sqrt(cls.data.values.shape[1])
        cls.labels = clusters.local_pca(cls.frame.points, 4, 2).labels
        cls.forms = {"local": dict(labels=cls.labels), "global": dict(labels=None, block=8)}

    def test_both_forms_decode_to_what_they_estimate(self):
        for name, form in self.forms.items():
            for rounds in (1, 2):
                coded = plus.encode(self.frame, SIDE, step=self.step / 4, rounds=rounds, **form)
                point = plus.measured(self.data, self.gamma, coded)
                self.assertAlmostEqual(point["psnr_db"], point["estimated_psnr_db"], delta=0.15, msg=name)
                self.assertAlmostEqual(sum(point["bytes_of"].values()), point["bytes"], delta=4)
            coded.coefficients[100:110] += 400
            self.assertLess(plus.measured(self.data, self.gamma, coded)["psnr_db"], point["psnr_db"] - 0.5, name)

    def test_a_finer_step_costs_bytes_and_gives_quality(self):
        for name, form in self.forms.items():
            coarse, fine = (plus.encode(self.frame, SIDE, step=s, **form).record for s in (self.step, self.step / 4))
            self.assertGreater(fine["bytes"], coarse["bytes"], name)
            self.assertGreater(fine["psnr_db"], coarse["psnr_db"] + 3, name)

    def test_strong_plus_beats_strong_at_fewer_bytes(self):
        space = strong.space_of(self.frame, (self.frame.basis * 1.0).T, 6, 6)
        encoded, (error, count) = strong.encode(self.data, self.gamma, self.frame, space, 4, 2, self.labels)
        coded = plus.encode(self.frame, SIDE, self.labels, self.step / 6)
        self.assertLess(coded.record["bytes"], 0.8 * encoded.bytes)
        self.assertGreater(coded.record["psnr_db"], domain.psnr_db(error, count) - 0.2)

    def test_labels_by_rate_are_smoother_and_cost_less(self):
        noisy = self.labels.copy()
        noisy[::7] = (noisy[::7] + 1) % 4
        better = plus.labels_by_rate(self.frame.points, noisy, 4, self.step / 4, SIDE)
        changes = lambda labels: np.mean(labels.reshape(SIDE, SIDE)[:, 1:] != labels.reshape(SIDE, SIDE)[:, :-1])
        self.assertLess(changes(better), changes(noisy))
        before, after = (plus.encode(self.frame, SIDE, labels, self.step / 4).record for labels in (noisy, better))
        self.assertLess(after["bytes"], before["bytes"])
        self.assertGreater(after["psnr_db"], before["psnr_db"])

    def test_the_search_lands_below_its_size(self):
        points = plus.sweep(self.data, self.gamma, self.frame, (3000, 6000), log=lambda *_: None,
                            clusters=(1, 4), sides=(8,))
        self.assertEqual([p["target"] for p in points], [3000, 6000])
        for point in points:
            self.assertTrue(0.7 * point["target"] < point["bytes"] <= point["target"], point)


class OffGrid(unittest.TestCase):
    def test_errors_are_those_of_the_decoder(self):
        try:
            from rival import offgrid
            import scipy.spatial  # noqa: F401
        except ImportError:
            self.skipTest("scipy is missing")
        data, gamma = toy(), domain.Domain("gamma")

        def measured(change):
            def groups(columns):
                yield np.arange(data.texels), lambda part: data.values[part][:, columns].astype(np.float32) + change
            return offgrid.measure(data, data, gamma, groups, {"bytes": 7})

        exact, off = measured(0), measured(3)
        # At the measured directions every interpolation gives the values themselves.
        self.assertEqual(set(exact["psnr_db_by"].values()), {99.0})
        self.assertEqual((exact["bytes"], exact["psnr_db_uncompressed"]), (7, 99.0))
        self.assertAlmostEqual(off["psnr_db_by"]["gamma"], 20 * math.log10(255 / 3), delta=0.2)
        self.assertEqual(off["psnr_db_uncompressed"], 99.0)


class LeftOut(unittest.TestCase):
    def test_pairs_are_those_that_rust_holds_back(self):
        # Printed by rand 0.8 and rand_xoshiro 0.6 for 6,561 and 4,096 pairs.
        for count, seed, first in ((6561, 0, [395, 4321, 863, 4010, 3223, 3369, 3750, 6168]),
                                   (4096, 7, [2750, 1672, 2048, 1919, 1801, 1643, 1914, 3392])):
            self.assertEqual(holdout.held_pairs(count, 8 / count, seed), sorted(first))
        self.assertNotEqual(holdout.held_pairs(6561, 8 / 6561, 1), holdout.held_pairs(6561, 8 / 6561, 0))
        self.assertEqual(len(holdout.held_pairs(6561, 0.2, 1)), 1312)

    def test_a_list_of_pairs_is_read(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "held.json"
            path.write_text(json.dumps([[1, 2], [0, 3]]), encoding="utf-8")
            self.assertEqual(holdout.read_pairs(path, 10), [3, 12])

    def test_masked_values_are_the_three_channels_of_a_pair(self):
        np.testing.assert_array_equal(holdout.values_of_pairs([0, 7]), [0, 1, 2, 21, 22, 23])


@unittest.skipIf(torch is None, "torch is not installed: the neural rivals are not checked (requirements-neural.txt)")
class Neural(unittest.TestCase):
    HELD = [3, 17, 55]
    SMALL = {"latents": 4, "hidden": 8, "direction": 32}

    @classmethod
    def setUpClass(cls):
        torch.set_num_threads(1)
        cls.data = toy(noise=1.0)
        cls.found = neural.components(cls.data, np.setdiff1d(np.arange(VIEWS * LIGHTS), cls.HELD), 1, rank=12)
        cls.models, cls.curves = {}, {}
        for kind, more in (("neural", {}), ("neumip", {"layers": 3, "offset": 3})):
            shape = neural_model.Shape(SIDE, SIDE, **cls.SMALL, **more)
            cls.models[kind], cls.curves[kind] = neural.train(
                cls.data, shape, 9, cls.HELD, found=cls.found, texels=256, views=6, lights=6, log=lambda *_: None,
                steps_at_most=120, fit_steps=200)

    def each_kind(self):
        return [(model, neural.serialise(model)) for model in self.models.values()]

    def test_training_lowers_the_error(self):
        for kind, curve in self.curves.items():
            self.assertGreater(curve[-1][1], curve[0][1] + 1, kind)

    def test_what_is_serialised_is_what_is_measured(self):
        for model, data in self.each_kind():
            one = neural.deserialise(data)
            every = np.arange(self.data.texels)
            decoded = one.decode(every, self.data.views_deg, self.data.lights_deg)
            codes = decoded.round().clamp(0, 255).reshape(len(every), -1).numpy()
            db = domain.psnr_db(domain.squared_error(codes, self.data.values), codes.size)
            self.assertAlmostEqual(neural.error_of(one, self.data), db, delta=1e-3)
            for table, read in zip(model.tables, one.tables):
                np.testing.assert_array_equal(table.codes(), read.values.numpy())

    def test_wrong_latents_are_noticed(self):
        for _, data in self.each_kind():
            model = neural.deserialise(data)
            db = neural.error_of(model, self.data)
            model.tables[0].values = model.tables[0].values.roll(SIDE * SIDE // 2, 0)
            self.assertLess(neural.error_of(model, self.data), db - 1)

    def test_damaged_bytes_are_refused(self):
        for _, data in self.each_kind():
            with self.assertRaises(ValueError):
                neural.deserialise(data + b"x")
            with self.assertRaises(ValueError):
                neural.deserialise(b"x" + data[1:])

    def test_bytes_are_those_that_are_written(self):
        for kind in self.models:
            with tempfile.TemporaryDirectory() as folder:
                point = neural.measure(self.data, kind, 3, held=self.HELD, other=self.data, found=self.found,
                                       log=lambda *_: None, keep=Path(folder), steps_at_most=20, **self.SMALL)
                written = next(Path(folder).iterdir()).read_bytes()
            self.assertEqual(point["bytes"], len(written))
            self.assertEqual(point["psnr_db"], neural.error_of(neural.deserialise(written), self.data))
            # The other capture is the same one here: the network's own error is that of the measured pairs, and so is
            # that of the neighbours, which are the directions themselves.
            for db in point["psnr_db_random_by"].values():
                self.assertAlmostEqual(db, point["psnr_db"], delta=0.01)
            self.assertEqual(point["decoded"], "all texels")

    def test_held_back_pairs_do_not_matter_to_the_training(self):
        values = self.data.values.copy()
        values[:, holdout.values_of_pairs(self.HELD)] = 255
        changed = capture.Capture("changed", values, SIDE, SIDE, self.data.views_deg, self.data.lights_deg, "srgb")
        shape = neural_model.Shape(SIDE, SIDE, **self.SMALL)
        told = []
        for data in (self.data, changed):
            found = neural.components(data, np.setdiff1d(np.arange(VIEWS * LIGHTS), self.HELD), 1, rank=12)
            model, _ = neural.train(data, shape, 3, self.HELD, found=found, texels=256, views=6, lights=6, fit_steps=30,
                                    log=lambda *_: None, steps_at_most=10)
            told.append(neural.serialise(model))
        self.assertEqual(told[0], told[1])

    def test_errors_of_some_pairs_are_of_those_pairs(self):
        model = neural.deserialise(neural.serialise(self.models["neural"]))
        views, lights, _ = self.data.shape
        whole = neural.error_of(model, self.data)
        self.assertAlmostEqual(neural.error_of(model, self.data, range(views * lights)), whole, delta=0.01)
        self.assertNotAlmostEqual(neural.error_of(model, self.data, self.HELD), whole, delta=0.01)

    def test_queries_decode_what_the_grid_decodes(self):
        for _, data in self.each_kind():
            model = neural.deserialise(data)
            view, light = (torch.tensor(neural_model.vectors(d).astype(np.float32))
                           for d in (self.data.views_deg, self.data.lights_deg))
            grid = model.decode(np.arange(40, 50), self.data.views_deg, self.data.lights_deg)
            single = model.query(torch.arange(40, 50), view[2].expand(10, 3), light[5].expand(10, 3))
            np.testing.assert_allclose(single, grid[:, 2, 5], atol=1.0)


if __name__ == "__main__":
    unittest.main()

"""Self-check of the rivals: `python -m unittest` in this folder; needs numpy only."""

import json
import math
import tempfile
import unittest
from pathlib import Path

import numpy as np

from rival import capture, clusters, coordinates, domain, entropy, envelope, holdout, plus, published, strong, tucker

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

    def test_entropy_coding_is_no_larger_than_raw_and_shrinks_what_repeats(self):
        noise = np.random.default_rng(1).integers(0, 256, (64, 64))
        self.assertLessEqual(entropy.plane_bytes(noise), 64 * 64 + 1)
        self.assertLess(entropy.plane_bytes(np.zeros((64, 64))), 100)
        self.assertLess(plus.symbols_bytes(np.eye(64, dtype=np.int64)), 300)


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


if __name__ == "__main__":
    unittest.main()

"""Self-check of the materials: `python -m unittest` in this folder, numpy only, about twelve seconds of one core."""

import os

for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import sys
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np

import capture
import dyes
import layered
import porous
from fibres import Fibres
from make import KINDS, photographs
from tracing import grid_places, points_at, read_periodic, read_trilinear, sample_offsets, slope

SIZE = 24
SAMPLES = 4
PLACES = {}


def material(kind, seed=1, bounce=True):
    """Returns a small material, made once."""
    key = kind, seed, bounce
    if key not in PLACES:
        PLACES[key] = KINDS[kind](SIZE, seed, bounce)
    return PLACES[key]


def image(made, view_deg, light_deg):
    """Returns the linear image of one pair."""
    view, light = capture.unit_vector(*view_deg), capture.unit_vector(*light_deg)
    return next(photographs(made, [view], [light], SAMPLES))[2]


def psnr_db(first, second):
    """Compares two linear images as 8-bit files."""
    error = capture.srgb_bytes(first).astype(float) - capture.srgb_bytes(second)
    return 10 * np.log10(255**2 / max(np.mean(error**2), 1e-9))


class Directions(unittest.TestCase):
    def test_ubo81_has_the_rings_of_bonn(self):
        rings = capture.ubo81_deg()
        self.assertEqual(rings.shape, (81, 2))
        self.assertEqual([int((rings[:, 0] == t).sum()) for t in (0, 15, 30, 45, 60, 75)], [1, 6, 12, 18, 20, 24])
        self.assertIn([60, 18], rings.tolist())

    def test_random_directions_are_even_over_the_solid_angle(self):
        drawn = capture.random_deg(20000, np.random.default_rng(5))
        lowest = np.cos(np.radians(capture.RANDOM_MAX_THETA_DEG))
        self.assertLessEqual(drawn[:, 0].max(), capture.RANDOM_MAX_THETA_DEG)
        self.assertAlmostEqual(np.cos(np.radians(drawn[:, 0])).mean(), (1 + lowest) / 2, delta=0.01)
        self.assertAlmostEqual(drawn[:, 1].mean(), 180, delta=3)

    def test_angles_have_three_digits_before_the_point(self):
        angles = [capture.angle(a) for a in (0, 15, 345, 7.25, 61.1)]
        self.assertEqual(angles, ["000", "015", "345", "007.25", "061.10"])

    def test_srgb_is_the_curve(self):
        self.assertEqual(capture.srgb_bytes(np.array([0, 0.0031308, 0.2140411, 1, 7])).tolist(), [0, 10, 127, 255, 255])

    def test_exr_holds_the_halves(self):
        values = np.arange(24, dtype=np.float32).reshape(2, 4, 3)
        encoded = capture.exr_bytes(values)
        lines = [np.frombuffer(encoded[-24 - 32 * back:][:24], "<f2").reshape(3, 4) for back in (1, 0)]
        np.testing.assert_array_equal(np.stack(lines).transpose(0, 2, 1)[:, :, ::-1], values)

    def test_exr_sorts_bands_by_their_names(self):
        encoded = capture.exr_bytes(np.array([[[0.25, 0.5]]], np.float32), ("950nm", "1050nm"))
        self.assertLess(encoded.index(b"1050nm\0"), encoded.index(b"950nm\0"))
        self.assertEqual(np.frombuffer(encoded[-4:], "<f2").tolist(), [0.5, 0.25])


class Dyes(unittest.TestCase):
    def test_dyed_cotton_reflects_no_more_than_cotton_and_takes_its_dye_s_light(self):
        nm = np.linspace(400, 700, 31)
        plain, blue = dyes.dyed(nm), dyes.dyed(nm, (dyes.INDIGO, 3.0))
        self.assertTrue(np.all((plain < 1) & (blue > 0) & (blue <= plain)))
        # Between its two bands of absorption.
        self.assertEqual(nm[(blue / plain).argmin()], 640)
        # Kubelka and Munk by hand: k = 1 gives 2 - sqrt 3.
        strength = (1 - dyes.cotton(510.0)) / dyes.absorbed(dyes.MADDER, 510.0)
        self.assertAlmostEqual(float(dyes.dyed(np.array([510.0]), (dyes.MADDER, strength))[0]), 2 - 3**0.5, places=6)

    def test_a_band_of_cloth_is_what_one_channel_of_its_albedos_gives(self):
        albedos = dyes.of_cloth(np.linspace(400, 700, 5))
        bands = image(Fibres(SIZE, 1, albedos=albedos), (30, 60), (45, 0))
        one = image(Fibres(SIZE, 1, albedos=[albedo[3:4] for albedo in albedos]), (30, 60), (45, 0))
        np.testing.assert_allclose(bands[:, :, 3:4], one, rtol=1e-5)
        self.assertGreater(np.abs(bands[:, :, 2:3] - one).max(), 0.01)


class Optics(unittest.TestCase):
    def test_no_material_returns_more_than_it_gets(self):
        # A white sky seen in the material is the mean of X over the solid angle, times 2.
        views = [capture.unit_vector(0, 0), capture.unit_vector(60, 40)]
        for kind in KINDS:
            made = material(kind)
            # Highlights of metal are narrow.
            rings, turns = (24, 24) if kind == "metal" else (4, 3)
            lights = [capture.unit_vector(np.degrees(np.arccos((n + 0.5) / rings)), 360 * (k + 0.37 * n) / turns)
                      for n in range(rings) for k in range(turns)]
            sky = np.zeros((2, 3))
            for view, _, x in photographs(made, views, lights, 1):
                sky[view] += 2 * x.mean(axis=(0, 1)) / len(lights)
            self.assertTrue((sky > 0.01).all(), (kind, sky))
            # The clear surface adds its Fresnel reflectance, a bounce its share of the light that comes back.
            self.assertTrue((sky < np.minimum(made.largest_albedo + 0.12, 0.98)).all(), (kind, sky))

    def test_light_and_eye_can_be_exchanged(self):
        # The tile's mean of X / cos(light) is reciprocal where rays and shadows agree about the geometry.
        for kind, bound in (("fibres", 0.06), ("layered", 0.05), ("porous", 0.05)):
            # Voxels and shadow maps go with the texels: too coarse for bubbles and fibres in small images.
            made = KINDS[kind](64, 1, bounce=False)
            for one, other in (((60, 20), (15, 200)), ((70, 250), (40, 190))):
                there = image(made, one, other).mean() / np.cos(np.radians(other[0]))
                back = image(made, other, one).mean() / np.cos(np.radians(one[0]))
                self.assertLess(abs(there / back - 1), bound, (kind, one, other, there, back))

    def test_snell_and_fresnel(self):
        below = layered.refracted(capture.unit_vector(60, 30))
        self.assertAlmostEqual(np.hypot(below[0], below[1]) * layered.INDEX, np.sin(np.radians(60)), places=6)
        self.assertAlmostEqual(layered.fresnel(1.0), 0.04, places=6)
        brewster = np.cos(np.arctan(layered.INDEX))
        across = ((brewster - layered.INDEX * np.sin(np.arctan(layered.INDEX))) / 1) ** 2
        self.assertAlmostEqual(layered.fresnel(brewster), 0.5 * across / (brewster + layered.INDEX * np.sin(
            np.arctan(layered.INDEX))) ** 2, places=6)

    def test_resin_over_white_gives_back_all_light(self):
        # Without absorption a white flat base returns what enters; the sum over the sky of both terms is 1.
        cosines = (np.arange(400) + 0.5) / 400
        entered = 1 - layered.fresnel(cosines)
        view = np.cos(np.radians(30))
        inside = (1 - layered.fresnel(view)) / layered.INDEX**2 / (1 - layered.INNER_REFLECTANCE)
        whole = 2 * np.mean(entered * cosines * inside) + layered.fresnel(view)
        self.assertAlmostEqual(whole, 1.0, delta=0.01)

    def test_walls_of_a_closed_cave_bring_all_light(self):
        # In a closed cave of which every wall gives back 1, every ray brings 1.
        made = porous.Porous.__new__(porous.Porous)
        made.side, made.layers, made.pitch, made.top = 48, 40, 1 / 48, 0.02
        made.blend = np.zeros((21, 24, 24), np.float32)
        layer, row, column = np.ogrid[:40, :48, :48]
        distance = np.sqrt((layer - 20) ** 2 + (row - 24) ** 2 + (column - 24) ** 2) - 14
        made.solid = np.clip(distance, -3, 3).astype(np.float32)
        made.find_walls()
        normals = np.random.default_rng(3).normal(size=(500, 3)).astype(np.float32)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        centre = np.array([24.5 / 48, 1 - 24.5 / 48, 0.02 - 20 / 48], np.float32)
        walls = made.bounced_from(centre - normals * np.float32(14 / 48), normals, 4)
        self.assertGreater(np.mean(walls < len(made.wall_albedo)), 0.985)
        # Seen from any point of a sphere, its inside is lit evenly: the mean height of what is met is the centre's.
        met = made.wall_lifted[walls[walls < len(made.wall_albedo)]]
        np.testing.assert_allclose(met.mean(axis=0), centre, atol=0.02)

    def test_eye_at_the_lamp_sees_no_shadow(self):
        for kind, least in (("fibres", 0.88), ("layered", 0.94), ("porous", 0.94)):
            made = material(kind)
            for angles in ((0, 0), (45, 70)):
                w = capture.unit_vector(*angles)
                seen, lamp = made.see(w, sample_offsets(SAMPLES)), made.illuminate(w)
                lit = lamp["map"].lit_share(seen["lifted"], 0.5 / lamp["map"].side)
                self.assertGreater(lit.mean(), least, (kind, angles))


class Geometry(unittest.TestCase):
    """The tracers against slow ones, ray by ray."""

    def agreement(self, kind, direction, along):
        """Returns the share of rays of which the tracer's height is that of a slow search along the slopes `along`."""
        made = material(kind)
        offset = (0.2, -0.1)
        chosen = np.random.default_rng(2).choice(SIZE**2, 60 if kind == "fibres" else 250, replace=False)
        x, y = (axis.ravel()[chosen] for axis in grid_places(SIZE, offset))
        if kind == "fibres":
            fast = made.trace(direction, SIZE, offset)[0][chosen]
            slow = np.full(len(chosen), made.floor)
            whole = np.arange(-1, 2)
            for shift_x in whole:
                for shift_y in whole:
                    for ray in range(len(chosen)):
                        z = self.cylinders(made, x[ray] + shift_x, y[ray] + shift_y, direction, along)
                        slow[ray] = max(slow[ray], z)
            return np.mean(np.abs(fast - slow) < 1e-3)
        top, bottom = (made.top, -porous.DEPTH) if kind == "porous" else (layered.HIGHEST, layered.LOWEST)
        z = np.linspace(top, bottom, 3000)
        places = [x[:, None] + z * along[0], y[:, None] + z * along[1], np.broadcast_to(z, (len(x), len(z)))]
        places = np.stack(places, axis=-1)
        flat = places.reshape(-1, 3).astype(np.float32)
        if kind == "porous":
            fast = made.trace(direction, SIZE, offset).ravel()[chosen]
            inside = read_trilinear(made.solid, made.top, made.pitch, flat) > 0
        else:
            fast = made.trace(direction, SIZE, offset).ravel()[chosen]
            inside = read_periodic(made.heights, flat[:, 0], flat[:, 1]) > flat[:, 2]
            for level, height in enumerate(layered.FLAKE_HEIGHTS):
                side = made.flake_maps.shape[1]
                px, py = x + height * along[0], y + height * along[1]
                row, column = np.floor((1 - py) * side).astype(int) % side, np.floor(px * side).astype(int) % side
                here = made.flake_maps[level][row, column]
                fast = np.where((here > 0) & (np.abs(fast - height) < 1e-6), np.nan, fast)
        inside = inside.reshape(len(x), -1)
        slow = np.where(inside.any(axis=1), z[inside.argmax(axis=1)], z[-1])
        known = ~np.isnan(fast)
        return np.mean(np.abs(fast - slow)[known] < 0.3 / SIZE)

    @staticmethod
    def cylinders(made, x, y, direction, along):
        """Returns the highest meeting of one ray with all cylinders, by distances between two lines."""
        ray = np.array([along[0], along[1], 1.0])
        ray /= np.linalg.norm(ray)
        axis = (made.end - made.start).astype(np.float64)
        length = np.linalg.norm(axis, axis=1)
        axis /= length[:, None]
        across = np.cross(axis, ray)
        sine = np.linalg.norm(across, axis=1)
        to_start = made.start - np.array([x, y, 0.0])
        apart = np.abs((to_start * across).sum(axis=1)) / sine
        slant = axis @ ray
        foot = ((to_start @ ray) - slant * (to_start * axis).sum(axis=1)) / sine**2
        deep = np.sqrt(np.maximum(made.radius**2 - apart**2, 0)) / sine
        t = foot + deep
        place = (slant * t - (to_start * axis).sum(axis=1)) / length
        met = (apart < made.radius) & (place > -0.06) & (place < 1.06)
        return (t * ray[2])[met].max(initial=-9)

    def test_rays_meet_what_a_slow_search_meets(self):
        direction = capture.unit_vector(50, 35)
        for kind, least in (("fibres", 0.97), ("layered", 0.95), ("porous", 0.93)):
            seen_along = layered.refracted(direction) if kind == "layered" else direction
            share = self.agreement(kind, seen_along, slope(seen_along))
            self.assertGreater(share, least, kind)

    def test_a_mirrored_parallax_is_rejected(self):
        direction = capture.unit_vector(50, 35)
        for kind in ("layered", "porous"):
            seen_along = layered.refracted(direction) if kind == "layered" else direction
            wrong = (-slope(seen_along)[0], -slope(seen_along)[1])
            self.assertLess(self.agreement(kind, seen_along, wrong), 0.7, kind)

    def test_points_below_the_plane_move_towards_the_eye(self):
        # A point at height z below 0 is seen through the place that lies -z tan(theta) nearer to the eye.
        points = points_at(8, (0, 0), capture.unit_vector(45, 90), np.full(64, -0.125))
        x, y = grid_places(8, (0, 0))
        np.testing.assert_allclose(points[:, 0], x.ravel(), atol=1e-6)
        np.testing.assert_allclose(points[:, 1], y.ravel() - 0.125, atol=1e-6)


class Tiles(unittest.TestCase):
    def test_tiles_have_no_seam(self):
        for kind in KINDS:
            for view_deg, light_deg in (((0, 0), (45, 30)), ((60, 110), (30, 250))):
                x = np.sqrt(image(material(kind), view_deg, light_deg))
                for axis in (0, 1):
                    step = np.abs(x - np.roll(x, 1, axis=axis)).mean(axis=(1 - axis, 2))
                    self.assertLess(step[0], step[1:].mean() + 4 * step[1:].std(), (kind, axis))

    def test_fibres_close_over_the_tile(self):
        for start, end, *_ in material("fibres").chains:
            gap = end[-1] - start[0]
            np.testing.assert_allclose(gap - np.round(gap * [1, 1, 0]), 0, atol=1e-9)

    def test_equal_seeds_give_equal_images(self):
        for kind in KINDS:
            first = image(KINDS[kind](SIZE, 1), (30, 60), (45, 0))
            np.testing.assert_array_equal(first, image(KINDS[kind](SIZE, 1), (30, 60), (45, 0)))
            self.assertLess(psnr_db(first, image(KINDS[kind](SIZE, 2), (30, 60), (45, 0))), 30)

    def test_planted_differences_are_rejected(self):
        for kind in KINDS:
            made = material(kind)
            truth = image(made, (60, 30), (45, 120))
            self.assertGreater(psnr_db(truth, image(made, (60, 30), (45, 120))), 90)
            wrong = {"light's azimuth mirrored": image(made, (60, 30), (45, 240)),
                     "eye's azimuth turned": image(made, (60, 210), (45, 120)),
                     "eye and light exchanged": image(made, (45, 120), (60, 30)),
                     "rows upside down": truth[::-1],
                     "one texel aside": np.roll(truth, 1, axis=1)}
            if made.bounce:
                wrong["cosine twice"] = truth * np.cos(np.radians(45))
            for what, other in wrong.items():
                self.assertLess(psnr_db(truth, other), 32, (kind, what))


if __name__ == "__main__":
    unittest.main()

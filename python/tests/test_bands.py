"""Captures and assets in spectral bands."""

import unittest

import btf
import numpy as np
from refusals import Refusing

NM = np.linspace(420.0, 900.0, 13)


def unit(theta_deg, phi_deg):
    theta, phi = np.radians(theta_deg), np.radians(phi_deg)
    return [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]


DIRECTIONS = np.array([unit(0, 0), unit(30, 0), unit(30, 120), unit(30, 240), unit(60, 60), unit(60, 180)], np.float32)


def leaf_images():
    """Leaves of two pigments, brighter towards the normal: (views, lights, rows, columns, bands)."""
    green = 0.08 + 0.1 * np.exp(-(((NM - 550) / 40) ** 2)) + 0.4 / (1 + np.exp(-(NM - 715) / 12))
    yellow = 0.5 / (1 + np.exp(-(NM - 530) / 20))
    share = np.linspace(0, 1, 8)[None, :, None] * np.linspace(0.5, 1, 6)[:, None, None]
    texels = (1 - share) * green + share * yellow
    light = DIRECTIONS[:, 2]
    view = 0.7 + 0.3 * DIRECTIONS[:, 2]
    return (view[:, None, None, None, None] * light[None, :, None, None, None] * texels).astype(np.float32)


class Bands(Refusing):
    @classmethod
    def setUpClass(cls):
        cls.images = leaf_images()
        cls.capture = btf.Capture(cls.images, DIRECTIONS, DIRECTIONS, wavelengths_nm=NM, name="leaf")
        cls.asset = btf.fit(cls.capture, clusters=2, threads=1)

    def test_a_capture_gives_its_bands_and_colours(self):
        np.testing.assert_allclose(self.capture.wavelengths_nm, NM)
        order = [int(np.argmin(np.abs(DIRECTIONS - d).sum(1))) for d in self.capture.lights]
        np.testing.assert_allclose(self.capture.image_bands(0, 3), self.images[order[0], order[3]], rtol=1e-6)
        self.assertEqual(self.capture.image(0, 3).shape, (6, 8, 3))

    def test_an_asset_gives_back_what_was_photographed_in_every_band(self):
        np.testing.assert_allclose(self.asset.wavelengths_nm, NM, rtol=1e-6)
        uv = np.array([[(c + 0.5) / 8, 1 - (r + 0.5) / 6] for r in range(6) for c in range(8)], np.float32)
        told = self.asset.eval_bands(uv, DIRECTIONS[1], DIRECTIONS[2]).reshape(6, 8, 13)
        np.testing.assert_allclose(told, self.images[2, 1], atol=0.01)
        # Planted difference: another light.
        self.assertGreater(np.abs(told - self.images[2, 4]).max(), 0.05)
        self.assertGreater(self.asset.meta["error"]["psnr_db"], 40.0)

    def test_light_changes_colours_and_white_stays_white(self):
        place = [0.9, 0.5], DIRECTIONS[0], DIRECTIONS[0]
        day, lamp = self.asset.eval(*place), self.asset.under("A").eval(*place)
        self.assertGreater(np.abs(day - lamp).max(), 0.01)
        np.testing.assert_allclose(self.asset.under("D65").eval(*place), day, atol=5e-3)

    def test_what_has_no_bands_is_told(self):
        rgb = btf.fit(self.capture, clusters=2, colours=True, threads=1)
        self.assertEqual(rgb.wavelengths_nm.size, 0)
        self.refused(ValueError, "no bands", rgb.eval_bands, [0.5, 0.5], DIRECTIONS[0], DIRECTIONS[0])
        self.refused(ValueError, "no bands", rgb.under, "A")
        self.refused(ValueError, "nowhere.csv", self.asset.under, "nowhere.csv")
        self.refused(ValueError, "do not ascend", btf.Capture, self.images, DIRECTIONS, DIRECTIONS, wavelengths_nm=NM[::-1])


if __name__ == "__main__":
    unittest.main()

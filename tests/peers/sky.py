"""What Mitsuba 3's emitter `sunsky` (3.7 or newer), the model of Hosek and Wilkie, makes of a clear sky: Rust tables for
viewer/src/light/sky.rs, and the plain sums that docs/reference/model.md shows.

    python tests/peers/sky.py > table.rs

It needs mitsuba and numpy, and the CIE tables of capture/src/colour/cie.rs, which it reads from there. Turbidity 3, albedo 0.15, sun
at 10, 30 and 60 degrees. Luminance in cd/m^2 from 400 to 700 nm every 10 nm.
"""

import pathlib
import re

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_spectral")

TURBIDITY, ALBEDO = 3.0, 0.15
SUNS_DEG = (10, 30, 60)
ELEVATIONS_DEG = (5, 15, 30, 45, 60, 75, 90)
AZIMUTHS_DEG = (0, 45, 90, 135, 180)
WAVELENGTHS_NM = np.arange(400.0, 701.0, 10.0)
SUN_RADIUS_DEG = 0.5358 / 2


def luminosity():
    """CIE 1931 y at WAVELENGTHS_NM, times 683 lm/W and the step."""
    text = (pathlib.Path(__file__).parents[2] / "capture/src/colour/cie.rs").read_text()
    numbers = re.search(r"pub static Y: .*?= \[(.*?)\];", text, re.S).group(1)
    y = np.array([float(x) for x in numbers.split(",") if x.strip()])
    return 683.0 * 10.0 * np.interp(WAVELENGTHS_NM, 380.0 + 5.0 * np.arange(len(y)), y)


def direction(elevation_deg, azimuth_deg):
    elevation, azimuth = np.radians(elevation_deg), np.radians(azimuth_deg)
    return [np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)]


def emitter(sun_deg, **scales):
    albedo = {"type": "spectrum", "value": ALBEDO}
    return mi.load_dict({"type": "sunsky", "turbidity": TURBIDITY, "albedo": albedo, "sun_direction": direction(sun_deg, 0), **scales})


def luminance(light, towards, weights):
    si = mi.SurfaceInteraction3f()
    si.wi = [-float(x) for x in towards]
    lanes = len(si.wavelengths)
    values = []
    for first in range(0, len(WAVELENGTHS_NM), lanes):
        part = list(WAVELENGTHS_NM[first:first + lanes])
        si.wavelengths = part + [550.0] * (lanes - len(part))
        values += list(light.eval(si))[:len(part)]
    return float(np.dot(values, weights))


def illuminances(sun_deg, weights):
    """Of the sun on a surface that faces it, of the sky on the level; lux."""
    sun, sky = emitter(sun_deg, sky_scale=0.0), emitter(sun_deg, sun_scale=0.0)
    # Rings of equal solid angle: the disc is darker towards its limb.
    rings = 16
    disc = 0.0
    for ring in range(rings):
        apart = SUN_RADIUS_DEG * np.sqrt((ring + 0.5) / rings)
        disc += luminance(sun, direction(sun_deg + apart, 0), weights) / 2 + luminance(sun, direction(sun_deg - apart, 0), weights) / 2
    disc *= 2 * np.pi * (1 - np.cos(np.radians(SUN_RADIUS_DEG))) / rings
    level, rows, columns = 0.0, 24, 36
    for row in range(rows):
        sine = np.sqrt((row + 0.5) / rows)
        for column in range(columns):
            level += luminance(sky, direction(np.degrees(np.arcsin(sine)), (column + 0.5) * 180 / columns), weights)
    return disc, level * np.pi / (rows * columns)


def main():
    weights = luminosity()
    print(f"// Mitsuba {mi.__version__}, sunsky, turbidity {TURBIDITY}, albedo {ALBEDO}.")
    for sun_deg in SUNS_DEG:
        sky = emitter(sun_deg, sun_scale=0.0)
        sun_lux, sky_lux = illuminances(sun_deg, weights)
        rows = []
        for elevation in ELEVATIONS_DEG:
            row = [luminance(sky, direction(elevation, azimuth), weights) for azimuth in AZIMUTHS_DEG]
            rows.append("        [" + ", ".join(f"{x:.0f}.0" for x in row) + "],")
        print(f"Reference {{\n    sun_deg: {sun_deg}.0,\n    sun_lux: {sun_lux:.0f}.0,\n    sky_lux: {sky_lux:.0f}.0,\n    luminance: [")
        print("\n".join(rows) + "\n    ],\n},")


main()

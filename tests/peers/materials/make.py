#!/usr/bin/env python3
"""Photographs a synthetic material whose geometry and optics share nothing with the toolkit.

    python tests/peers/materials/make.py fibres|layered|metal|porous OUT [--size 96] [--directions ubo81|random:12] [--seed 1]
    python tests/peers/materials/make.py fibres OUT --bands 31

OUT becomes a capture in the Bonn layout. The same arguments give the same bytes.
"""
import os

for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import argparse
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np

import capture
import dyes
from fibres import Fibres
from layered import Layered
from metal import Metal
from porous import Porous
from tracing import sample_offsets

KINDS = {"fibres": Fibres, "layered": Layered, "metal": Metal, "porous": Porous}


def photographs(material, views, lights, samples):
    """Yields (view, light, image): indices and linear X `[row, column, channel]`, lights outermost."""
    offsets = sample_offsets(samples)
    seen = [material.see(view, offsets) for view in views]
    side = material.size
    for light_index, light in enumerate(lights):
        lamp = material.illuminate(light)
        for view_index, view in enumerate(views):
            values = material.shade(seen[view_index], lamp, view)
            yield view_index, light_index, values.reshape(samples, side, side, -1).mean(axis=0)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kind", choices=sorted(KINDS))
    parser.add_argument("out", help="folder to make; must not exist or be empty")
    parser.add_argument("--size", type=int, default=96, help="width and height of the images in texels (16 to 512)")
    parser.add_argument("--directions", default="ubo81", help="ubo81, or random:N for N views and N other lights")
    parser.add_argument("--seed", type=int, default=1, help="seed of the material and of random directions")
    parser.add_argument("--samples", type=int, default=8, help="samples of a texel")
    parser.add_argument("--format", choices=("png", "exr"), default="png", help="8-bit sRGB, or linear half floats")
    parser.add_argument("--intensity", type=float, default=1.0, help="factor of all values: 40 makes most of them brighter than white")
    parser.add_argument("--bands", type=int, default=0, help="bands from 400 to 700 nm in place of colours, 4 to 64, as exr; fibres only")
    options = parser.parse_args()
    if not 16 <= options.size <= 512:
        parser.error("--size must be 16 to 512")
    if options.samples < 1:
        parser.error("--samples must be at least 1")
    if options.bands and (options.kind != "fibres" or not 4 <= options.bands <= 64):
        parser.error("--bands takes 4 to 64, for fibres")
    wavelengths_nm = np.linspace(400.0, 700.0, options.bands) if options.bands else None
    start = time.time()
    views_deg, lights_deg = capture.sets_of(options.directions, options.seed)
    image_format = "exr" if options.bands else options.format
    writer = capture.Writer(options.out, views_deg, lights_deg, image_format, wavelengths_nm)
    if options.bands:
        material = Fibres(options.size, options.seed, albedos=dyes.of_cloth(wavelengths_nm))
    else:
        material = KINDS[options.kind](options.size, options.seed)
    views = [capture.unit_vector(*angles) for angles in views_deg]
    lights = [capture.unit_vector(*angles) for angles in lights_deg]
    clipped, values = 0, 0
    for view, light, image in photographs(material, views, lights, options.samples):
        image = options.intensity * image
        writer.write_image(view, light, image)
        clipped += int((image > 1).sum())
        values += image.size
    writer.write_description(options.kind, f"tests/peers/materials/make.py {options.kind}: seed {options.seed}, "
                             f"{options.samples} samples a texel, intensity {options.intensity:g}, synthetic")
    print(f"{options.out}: {len(views) * len(lights)} images in {time.time() - start:.0f} s, "
          f"{100 * clipped / values:.3f} % of the values above 1")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Halve the images of a capture folder N times: each texel the mean of the linear values of those that it covers.

    halve_capture.py CAPTURE OUT_DIR N

For png images of gamma-encoded sRGB values with sides that are multiples of 2^N; capture.toml is copied. What an asset's levels
are measured against (docs/results/results.md, "Levels"). Needs numpy and pillow.
"""
import shutil
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image

CODES = np.arange(256) / 255.0
LINEAR = np.where(CODES <= 0.04045, CODES / 12.92, ((CODES + 0.055) / 1.055) ** 2.4)


def halve(source, target, times, path):
    image = LINEAR[np.asarray(Image.open(path))[..., :3]]
    cell = 2**times
    rows, columns = image.shape[0] // cell, image.shape[1] // cell
    mean = image.reshape(rows, cell, columns, cell, 3).mean((1, 3))
    encoded = np.where(mean <= 0.0031308, mean * 12.92, 1.055 * mean ** (1 / 2.4) - 0.055)
    out = target / path.relative_to(source)
    out.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.round(encoded * 255).astype(np.uint8)).save(out, compress_level=1)


def main():
    source, target, times = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    images = sorted(source.rglob("*.png"))
    if not images:
        sys.exit(f"{source} has no png images; write it with btf-fit expand --format png")
    target.mkdir(parents=True)
    shutil.copy(source / "capture.toml", target)
    with ProcessPoolExecutor() as pool:
        list(pool.map(partial(halve, source, target, times), images, chunksize=64))


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""How different two pictures look: the mean of FLIP [andersson2020], 0 for the same to 1, at 67 pixels per degree.

    flip.py REFERENCE.png TEST.png [BACKGROUND.png]

With a picture of the background alone, the mean is over the pixels that differ from it in the reference, which the
object covers. Needs numpy, pillow and flip-evaluator (BSD-3-Clause): `pip install numpy pillow flip-evaluator`.
"""
import sys

import flip_evaluator
import numpy as np
from PIL import Image


def picture(path):
    return np.asarray(Image.open(path).convert("RGB"), dtype=np.float32) / 255.0


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    reference, test, *background = (picture(path) for path in sys.argv[1:])
    if any(other.shape != reference.shape for other in (test, *background)):
        sys.exit("error: the pictures differ in size, render them with the same --size")
    errors, _, _ = flip_evaluator.evaluate(reference, test, "LDR", applyMagma=False)
    covered = np.ones(reference.shape[:2], bool)
    for plain in background:
        covered = (np.abs(reference - plain) > 1.5 / 255.0).any(-1)
    if not covered.any():
        sys.exit("error: the reference shows the background alone")
    print(f"{errors.squeeze()[covered].mean():.4f} over {covered.sum()} pixels")


if __name__ == "__main__":
    main()

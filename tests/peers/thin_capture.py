"""Makes a capture of fewer images: links those of a share of the pairs, drawn by a seed, or of the pairs of a list.

    python3 tests/peers/thin_capture.py CAPTURE OUT --share 0.05 [--seed 1]
    python3 tests/peers/thin_capture.py CAPTURE OUT --list LIST.csv

CAPTURE has Bonn's layout. LIST.csv is what `btf-fit propose-directions` writes. OUT gets `incomplete = true`, and as many of
CAPTURE's directions as its images have.
"""

import argparse
import csv
import os
import random
import re
from pathlib import Path


def angles(name):
    """Returns (theta_v, phi_v, theta_l, phi_l) of an image's name, None for another file."""
    found = dict(re.findall(r"(tl|pl|tv|pv)(\d+(?:\.\d+)?)", name))
    return tuple(float(found[key]) for key in ("tv", "pv", "tl", "pl")) if len(found) == 4 else None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("capture", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--share", type=float)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--list", type=Path)
    options = parser.parse_args()
    if (options.share is None) == (options.list is None):
        parser.error("give --share or --list")

    images = {}
    for path in sorted(options.capture.rglob("*")):
        if path.is_file() and angles(path.name):
            images[angles(path.name)] = path
    if options.list:
        with open(options.list, newline="") as text:
            rows = [tuple(float(row[key]) for key in ("theta_v", "phi_v", "theta_l", "phi_l")) for row in csv.DictReader(text)]
        kept = [images[row] for row in rows]
    else:
        pairs = sorted(images)
        kept = [images[pair] for pair in random.Random(options.seed).sample(pairs, round(options.share * len(pairs)))]
    options.out.mkdir(parents=True)
    for path in kept:
        target = options.out / path.relative_to(options.capture)
        target.parent.mkdir(exist_ok=True)
        os.link(path, target)
    manifest = options.capture / "capture.toml"
    text = manifest.read_text() if manifest.exists() else ""
    # At the top, before any table.
    (options.out / "capture.toml").write_text(f"incomplete = true\n{text}")
    print(f"{options.out}: {len(kept)} of {len(images)} images")


main()

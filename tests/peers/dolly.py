#!/usr/bin/env python3
"""How much a picture changes from frame to frame while the camera moves back by 0.2 % a frame.

    dolly.py BTF_VIEW ASSET.spmm X,Y,Z

An asset repeated 8 x 8 times on a plane, seen from X, Y, Z on: one sample a pixel with levels, one with levels that are
interpolated, one of the finest texels, and as reference 32 frames of the finest texels. Root mean squares over the pixels
that the plane covers, in 8-bit codes. Needs numpy and pillow.
"""
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

FRAMES = 6
STEP = 1.002
SCENE = """[camera]
eye = {eye}
target = [0.0, 0.0, 0.0]
fov_deg = 24.0
[[material]]
name = "m"
asset = "{asset}"
uv_scale = [8.0, 8.0]
[[object]]
mesh = "plane"
material = "m"
[[light]]
position = [2.0, 4.0, 3.0]
intensity = [40.0, 40.0, 40.0]
"""


def frames(folder, view, asset, eye, *options):
    pictures = []
    for i in range(FRAMES):
        moved = [round(x * STEP**i, 5) for x in eye]
        (folder / "scene.toml").write_text(SCENE.format(eye=moved, asset=asset))
        out = folder / "picture.png"
        command = [view, "--scene", folder / "scene.toml", "--headless", "--out", out, "--size", "160x160"]
        subprocess.run([*command, "--backend", "cpu", "--quiet", *options], check=True)
        pictures.append(np.asarray(Image.open(out))[..., :3].astype(float))
    return np.array(pictures)


def main():
    view, asset, eye = sys.argv[1], Path(sys.argv[2]).resolve(), [float(x) for x in sys.argv[3].split(",")]
    with tempfile.TemporaryDirectory() as folder:
        shown = lambda *options: frames(Path(folder), view, asset, eye, *options)
        levels, linear, finest = shown(), shown("--filter", "linear"), shown("--no-levels")
        reference = shown("--no-levels", "--frames", "32")
    # Where the plane is in all frames, without its edge.
    covered = (np.abs(reference - reference[0][0, 0]).max(-1) > 3).all(0)
    covered[:3] = covered[-3:] = covered[:, :3] = covered[:, -3:] = False
    rms = lambda x: np.sqrt((x[:, covered] ** 2).mean())
    rows = {"levels": levels, "levels, linear": linear, "finest": finest, "reference": reference}
    for name, pictures in rows.items():
        change, error = rms(np.diff(pictures, axis=0)), rms(pictures - reference)
        print(f"{name}: {change:.2f} codes from frame to frame, {error:.2f} from the reference, {covered.sum()} pixels")


if __name__ == "__main__":
    main()

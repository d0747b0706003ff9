#!/usr/bin/env python3
"""The noise of pictures that draw point lights, and the time to a picture of a given noise.

    light_noise.py BTF_VIEW... [--backend cpu] [--size 96x96] [--samples 1,4,16] [--only "room, 1024"]

Diffuse scenes under many lights, drawn by each of the programs in turn: a sphere and a plane with the lights of --lights
around them, then a plane and a room with lamps of uneven power all over. The error is the root mean square over the
pixels, over their mean, of one frame against the same frame of all lights; the time is that of a frame. A row ends with
the time in which frames of that error would be averaged to 30 dB, an error of 3.2 %. Needs numpy and OpenEXR.
"""
import argparse
import json
import random
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import OpenEXR

GOAL = 10 ** (-30 / 20)
PLAIN = """background = [0, 0, 0]
[camera]
eye = {eye}
target = [0.0, 0.0, 0.0]
fov_deg = {fov}
[[material]]
name = "m"
diffuse = [0.5, 0.5, 0.5]
[[object]]
mesh = "{mesh}"
material = "m"
"""


def lamps(count, low, high):
    """Lamps at random places of a box, every seventh ten times as bright."""
    draw = random.Random(count)
    place = lambda: [round(draw.uniform(*ends), 4) for ends in zip(low, high)]
    power = lambda i: round((10 if i % 7 == 0 else 1) / count, 7)
    light = lambda i: f"[[light]]\nposition = {place()}\nintensity = {[power(i)] * 3}\n"
    return "".join(light(i) for i in range(count))


def scenes():
    for count in (64, 1024, 4096):
        yield f"sphere, {count} around", PLAIN.format(eye=[0, 1, 4], fov=30, mesh="sphere"), ["--lights", count]
        yield f"plane, {count} around", PLAIN.format(eye=[0, -2, 4], fov=25, mesh="plane"), ["--lights", count]
    for count in (64, 1024, 4096):
        plane = PLAIN.format(eye=[0, -2, 4], fov=25, mesh="plane") + lamps(count, [-1, -1, 0.05], [1, 1, 0.3])
        yield f"plane, {count} near", plane, []
        room = PLAIN.format(eye=[0, 0, 3.9], fov=38, mesh="cornell") + lamps(count, [-0.95] * 3, [0.95] * 3)
        yield f"room, {count} within", room, []


def frame(program, folder, options, frames):
    picture, report = folder / "picture.exr", folder / "report.json"
    command = [program, "--scene", folder / "scene.toml", "--headless", "--out", picture, "--quiet", "--json", report]
    subprocess.run([*map(str, command), "--frames", str(frames), *map(str, options)], check=True)
    channels = OpenEXR.File(str(picture)).channels()
    pixels = next(iter(channels.values())).pixels
    return (pixels[..., 1] if pixels.ndim == 3 else channels["G"].pixels).astype(float), json.loads(report.read_text())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", nargs="+")
    parser.add_argument("--backend", default="cpu")
    parser.add_argument("--size", default="96x96")
    parser.add_argument("--samples", default="1,4,16")
    parser.add_argument("--only", default="")
    asked = parser.parse_args()
    common = ["--size", asked.size, "--backend", asked.backend]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for title, scene, options in scenes():
            if asked.only not in title:
                continue
            (folder / "scene.toml").write_text(scene)
            exact, _ = frame(asked.programs[0], folder, [*common, *options, "--light-samples", 4096], 1)
            for samples in map(int, asked.samples.split(",")):
                row = [f"{title}, {samples} samples:"]
                for program in asked.programs:
                    own = [*common, *options, "--light-samples", samples]
                    drawn, _ = frame(program, folder, own, 1)
                    _, report = frame(program, folder, own, 24)
                    error = np.sqrt(((drawn - exact) ** 2).mean()) / exact.mean()
                    ms = report["frame_ms"]
                    row.append(f"{100 * error:.2f} %, {ms:.1f} ms, {ms * max((error / GOAL) ** 2, 1):.0f} ms to 30 dB")
                print("  ".join(row), flush=True)


main()

#!/usr/bin/env python3
"""Draws the pictures of docs/results/leaf-live.md.

    leaf_pictures.py FOLDER canopy|contents|deficiencies|fitted|directions [FRAMES]

Calls btf-synth, btf-fit and btf-view, which must be on the path, and decodes on the CPU. FOLDER is made, and what lies in it
is used again. FRAMES are samples a pixel, 64 if not given: fewer are a preview. `fitted` prints FLIP, too; `directions`, after
it, what the fitted leaf has of the live one's light. Needs numpy, pillow and, for `fitted`, flip-evaluator.
"""
import math
import subprocess
import sys
from pathlib import Path

import numpy
from PIL import Image, ImageDraw, ImageFont

AFTERNOON = "2026-06-21T14:30+02:00"
# Contents of [miao, Fig. 2]: chlorophyll, carotenoids (ug/cm2), brown pigment.
CONTENTS = {"a": (40, 5, 0), "b": (25, 5, 0), "c": (10, 20, 0), "d": (0, 5, 0), "f, caption": (0, 5, 0.2), "f, text": (0, 0, 0)}
SEVERITIES = (0.0, 0.3, 0.6, 0.8, 1.0)
REPEATS = (1, 3, 9)
# Polar angle and azimuth of light and eye, degrees.
DIRECTIONS = ((0, 0, 10, 0), (30, 180, 30, 0), (30, 90, 30, 0), (60, 90, 30, 0), (60, 180, 30, 0), (60, 180, 60, 0), (75, 180, 60, 0),
              (80, 180, 60, 0), (85, 180, 60, 0), (60, 0, 70, 0), (60, 90, 80, 0), (120, 180, 30, 0), (150, 180, 75, 0))


def run(*command):
    subprocess.run([str(x) for x in command], check=True)


def scene(path, eye, target, fov_deg, exposure_ev, date_time, rest):
    path.write_text(f"""exposure_ev = {exposure_ev}
[camera]
eye = {eye}
target = {target}
fov_deg = {fov_deg}
[daylight]
date_time = "{date_time}"
place = "52.5,13.4"
{rest}""")


def draw(path, size, frames, *options):
    out = path.with_suffix(".png")
    run("btf-view", "--scene", path, "--headless", "--backend", "cpu", "--size", size, "--frames", frames, "--out", out, *options)
    return Image.open(out).convert("RGB")


def tile(out, columns, pictures):
    """Pictures by label, in rows of `columns`, with a palette."""
    width, height = next(iter(pictures.values())).size
    sheet = Image.new("RGB", (columns * width, -(-len(pictures) // columns) * height))
    pen = ImageDraw.Draw(sheet)
    for i, (label, picture) in enumerate(pictures.items()):
        x, y = i % columns * width, i // columns * height
        sheet.paste(picture, (x, y))
        pen.text((x + 8, y + 6), label, "white", ImageFont.load_default(15), stroke_width=2, stroke_fill="black")
    sheet.quantize(256).save(out, optimize=True)


def grid(path, rows, columns, point):
    """An OBJ of rows x columns squares at `point(u, v)`."""
    with path.open("w") as file:
        for form, of in (("v {:.5f} {:.5f} {:.5f}\n", point), ("vt {:.5f} {:.5f}\n", lambda u, v: (u, v))):
            for i in range(rows + 1):
                file.writelines(form.format(*of(j / columns, i / rows)) for j in range(columns + 1))
        for i in range(rows):
            for j in range(columns):
                a = i * (columns + 1) + j + 1
                b = a + columns + 1
                file.write(f"f {a}/{a} {a + 1}/{a + 1} {b + 1}/{b + 1}\nf {a}/{a} {b + 1}/{b + 1} {b}/{b}\n")


def blade(u, v):
    """Of a leaf 0.6 m long and 0.11 m wide that rises at 55 degrees and leans over to 15."""
    steps = 200
    angles = [math.radians(55 - 40 * v * (k + 0.5) / steps) for k in range(steps)]
    up, back = (0.6 * v / steps * sum(map(f, angles)) for f in (math.sin, math.cos))
    side = 2 * u - 1
    half = 0.055 * min(1, 0.75 + 1.5 * v) * max(1 - v, 0.004) ** 0.5
    fold = (0.3 * half + 0.006 * math.sin(14 * v + side)) * abs(side)
    angle = math.radians(55 - 40 * v)
    return 0.95 * half * side, up + fold * math.cos(angle), fold * math.sin(angle) - back


def canopy(folder, frames):
    """8.6 million triangles, in sun, in sky and in both [miao, Fig. 4]."""
    if not (folder / "canopy.glb").exists():
        run("btf-synth", "plants", folder / "canopy.glb", "--triangles", "8.6e6", "--ground")
    path, moment = folder / "canopy.toml", "2026-06-21T16:30+02:00"
    scene(path, [5.5, 2.3, 2.2], [-3.0, 1.1, -1.2], 44.0, 0.7, moment, '[[object]]\nmesh = "canopy.glb"\n')
    parts = {}
    for part in ("sky", "sun", "both"):
        light = ("--daylight", moment, "--place", "52.5,13.4", "--daylight-parts", part)
        parts[part] = draw(path, "768x432" if part == "both" else "384x216", frames, *light)
    parts["both"].quantize(256).save(folder / "leaf-canopy.png", optimize=True)
    parts["both"] = parts["both"].resize((384, 216), Image.Resampling.LANCZOS)
    tile(folder / "leaf-fig4.png", 3, parts)


def contents(folder, frames):
    """Maize of [miao, Fig. 2]."""
    pictures = {}
    for i, (label, (chlorophyll, carotenoid, brown)) in enumerate(CONTENTS.items()):
        leaf, plants = folder / f"contents-{i}.toml", folder / f"stand-{i}.glb"
        leaf.write_text(f"[contents]\nchlorophyll_ug_per_cm2 = {chlorophyll}\ncarotenoid_ug_per_cm2 = {carotenoid}\n"
                        f'brown = {brown}\nstructure = 1.5\n[look]\nspecies = "maize"\n')
        if not plants.exists():
            options = "--rows 2 --columns 4 --ground --stage 0.75".split()
            run("btf-synth", "plants", plants, "--leaf", leaf, *options)
        path = folder / f"stand-{i}.toml"
        scene(path, [0.7, 1.75, 3.7], [0.0, 1.02, 0.0], 34.0, 0.3, AFTERNOON, f'[[object]]\nmesh = "{plants.name}"\n')
        pictures[label] = draw(path, "300x320", frames)
    tile(folder / "leaf-fig2.png", 3, pictures)


def deficiencies(folder, frames):
    """Blades of [miao, Fig. 3]."""
    grid(folder / "blade.obj", 60, 12, blade)
    pictures = {}
    for lack in ("nitrogen", "magnesium"):
        rest = ""
        for i, severity in enumerate(SEVERITIES):
            name = f"{lack}-{severity}"
            if not (folder / f"{name}.toml").exists():
                options = f"--species maize --deficiency {lack} --severity {severity} --size 512 --directions random:1".split()
                run("btf-synth", "leaf", folder / name, *options, "--export-textures", folder / f"{name}-textures",
                    "--write-leaf", folder / f"{name}.toml")
            rest += (f'[[material]]\nname = "{name}"\nleaf = "{name}.toml"\n'
                     f'[[object]]\nmesh = "blade.obj"\nmaterial = "{name}"\ntranslate = [{0.2 * i - 0.4:.1f}, 0.0, 0.0]\n')
        path = folder / f"{lack}.toml"
        scene(path, [0.0, 1.57, 0.73], [0.0, 0.17, -0.25], 21.0, 0.3, AFTERNOON, rest)
        pictures[f"{lack}: " + ", ".join(f"{x:g}" for x in SEVERITIES)] = draw(path, "420x260", frames)
    tile(folder / "leaf-fig3.png", 2, pictures)


def fitted(folder, frames):
    """A live leaf above the asset that is fitted to its captures, on a bent sheet that both repeat ever more often."""
    leaf, asset = folder / "leaf.toml", folder / "leaf.spmm"
    if not asset.exists():
        sides = {"front": (), "back": ("--side", "abaxial")}
        maize = ("--species", "maize", "--export-textures", folder / "leaf-textures", "--write-leaf", leaf)
        run("btf-synth", "leaf", folder / "two", "--size", "128", "--directions", "random:2", *maize)
        captures = []
        for side, options in sides.items():
            for light in ((), ("--transmission",)):
                captures.append(folder / "-".join([side, *(x.strip("-") for x in light)]))
                run("btf-synth", "leaf", captures[-1], "--size", "128", "--leaf", leaf, *options, *light)
        run("btf-fit", "fit", *captures, "-o", asset, "--bytes", "2MB")
    grid(folder / "sheet.obj", 48, 48, lambda u, v: (
        u - 0.5, 0.14 * math.sin(2 * math.pi * (0.9 * u + 0.35 * v)) + 0.22 * (1 - v) ** 2, 0.5 - v))
    pictures = {}
    flip = Path(__file__).with_name("flip.py")
    view = ([0.3, 0.95, 1.2], [0.0, 0.09, 0.0], 23.0, 0.0, "2026-06-21T15:00+02:00")
    scene(folder / "nothing.toml", *view, '[[object]]\nmesh = "sheet.obj"\ntranslate = [0.0, -1000.0, 0.0]\n')
    draw(folder / "nothing.toml", "256x256", 1)
    for kind, shown in (("live", 'leaf = "leaf.toml"'), ("fitted", 'asset = "leaf.spmm"')):
        for n in REPEATS:
            path = folder / f"{kind}-{n}.toml"
            material = f'[[material]]\nname = "m"\n{shown}\nuv_scale = [{n}.0, {n}.0]\n'
            scene(path, *view, f'{material}[[object]]\nmesh = "sheet.obj"\nmaterial = "m"\n')
            pictures[f"{kind}, {n}"] = draw(path, "256x256", frames)
    tile(folder / "leaf-fitted.png", 3, pictures)
    for n in REPEATS:
        print(f"{n}: FLIP", end=" ", flush=True)
        run(sys.executable, flip, *(folder / f"{name}.png" for name in (f"live-{n}", f"fitted-{n}", "nothing")))


def directions(folder, frames):
    """Linear red, green and blue of a flat live leaf, and of the fitted one over them, by directions."""
    def unit(polar, azimuth):
        polar, azimuth = math.radians(polar), math.radians(azimuth)
        return numpy.array([math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), math.cos(polar)])

    def mean(shown, light, eye):
        path = folder / "direction.toml"
        path.write_text(f"""exposure_ev = 1.0
[camera]
eye = {(6 * eye).tolist()}
target = [0.0, 0.0, 0.0]
fov_deg = 12.0
[[material]]
name = "m"
{shown}
[[object]]
mesh = "plane"
material = "m"
[[light]]
position = {(100 * light).tolist()}
intensity = [31416.0, 31416.0, 31416.0]
""")
        codes = numpy.asarray(draw(path, "96x96", frames, "--quiet")) / 255
        linear = numpy.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)
        return linear[24:72, 24:72].mean((0, 1)) / 2

    print("| light | eye | live | fitted / live |\n|---|---|---|---|")
    for light, light_turn, eye, eye_turn in DIRECTIONS:
        at = unit(light, light_turn), unit(eye, eye_turn)
        live, asset = mean('leaf = "leaf.toml"', *at), mean('asset = "leaf.spmm"', *at)
        print(f"| {light}, {light_turn} | {eye}, {eye_turn} |", *(f"{x:.4f}" for x in live), "|", *(f"{x:.2f}" for x in asset / live), "|")


PICTURES = {f.__name__: f for f in (canopy, contents, deficiencies, fitted, directions)}


def main():
    if len(sys.argv) not in (3, 4) or sys.argv[2] not in PICTURES:
        sys.exit(__doc__)
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    PICTURES[sys.argv[2]](folder, int(sys.argv[3]) if len(sys.argv) == 4 else 64)


if __name__ == "__main__":
    main()

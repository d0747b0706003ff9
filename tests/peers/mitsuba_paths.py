"""Traces paths between two planes that carry a packed asset, under a picture of light, with Mitsuba 3 and `btf.mitsuba`.

In (JSON on stdin): {"asset": path, "uv_scale": x, "size": [width, height], "depth": rays of a path at most,
"samples": of each pixel, "camera": {"eye", "target", "up", "fov_deg"}, "environment": [rows][columns][3] radiance from the top
left, the middle towards -z and +x to its right, "pictures": [[turned, path], ...]: whether the environment is turned by 90
degrees}.

The floor is the plane 2 x 2 in z = 0, facing +z; the wall the same, turned by -90 degrees about x and moved by y = 1, z = 1, so that
it faces -y. Pictures are written as float32, rows from the top.

Out (JSON on stdout): {"version", "furnace": mean radiance of a sphere in surroundings of radiance 1 whose asset, fitted here to an
array, reflects all light}.
"""

import json
import sys
import tempfile
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
import btf.mitsuba  # noqa: E402, registers the BSDF of the variant

QUAD = """v -1 -1 0
v 1 -1 0
v 1 1 0
v -1 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0 1
f 1/1/1 2/2/1 3/3/1
f 1/1/1 3/3/1 4/4/1
"""


def sensor_of(camera, size):
    to_world = mi.ScalarTransform4f().look_at(camera["eye"], camera["target"], camera["up"])
    film = {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"}}
    return {"type": "perspective", "fov": camera["fov_deg"], "fov_axis": "smaller", "to_world": to_world, "film": film,
            "sampler": {"type": "independent"}}


def scene_of(query, turned, folder):
    # Meshes: two of Mitsuba's rectangles in a scene are not met by any ray of the variants of LLVM (3.7.1).
    quad = folder / "quad.obj"
    quad.write_text(QUAD)
    plane = {"type": "obj", "filename": str(quad), "flip_tex_coords": False}
    transform = mi.ScalarTransform4f
    bsdf = {"type": "btf", "filename": query["asset"], "uv_scale": query["uv_scale"]}
    # The middle of Mitsuba's pictures lies towards +z.
    turn = transform().rotate([0, 1, 0], 180.0 + (90.0 if turned else 0.0))
    picture = mi.Bitmap(np.array(query["environment"], np.float32))
    return mi.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": query["depth"] + 1, "rr_depth": 1000},
        "sensor": sensor_of(query["camera"], query["size"]),
        "sky": {"type": "envmap", "bitmap": picture, "to_world": turn},
        "floor": {**plane, "bsdf": bsdf},
        "wall": {**plane, "bsdf": bsdf,
                 "to_world": transform().translate([0, 1, 1]) @ transform().rotate([1, 0, 0], 90.0)},
    })


def white_asset(path):
    """Fits an asset to a white Lambertian surface."""
    angles = [(0.0, 1), (20.0, 6), (40.0, 8), (60.0, 10), (75.0, 12), (89.0, 12)]
    theta = np.radians([angle for angle, count in angles for _ in range(count)])
    phi = np.concatenate([2.0 * np.pi * np.arange(count) / count for _, count in angles])
    directions = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    images = np.broadcast_to(directions[None, :, 2, None, None, None], (len(theta), len(theta), 8, 8, 3))
    btf.fit(btf.Capture(images, directions, directions), output=path, error="linear")


def furnace(folder):
    """A sphere that reflects all light cannot be told from its surroundings."""
    white = folder / "white.spmm"
    white_asset(white)
    camera = {"eye": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0], "fov_deg": 20}
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 3},
        "sensor": sensor_of(camera, [32, 32]),
        "sky": {"type": "constant", "radiance": 1.0},
        "ball": {"type": "sphere", "bsdf": {"type": "btf", "filename": str(white)}},
    })
    # Without its rim, where eyes are lower than those of the asset.
    return float(np.mean(np.array(mi.render(scene, spp=256))[8:24, 8:24]))


def main():
    query = json.load(sys.stdin)
    with tempfile.TemporaryDirectory() as folder:
        for turned, path in query["pictures"]:
            scene = scene_of(query, turned, Path(folder))
            picture = np.array(mi.render(scene, spp=query["samples"]))[..., :3]
            picture.astype(np.float32).tofile(path)
        json.dump({"version": mi.__version__, "furnace": furnace(Path(folder))}, sys.stdout)


main()

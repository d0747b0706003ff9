"""Traces paths between two planes that carry a packed asset, under a picture of light, with Mitsuba 3 and `btf.mitsuba`.

In (JSON on stdin): {"asset": path, "uv_scale": x, "size": [width, height], "depth": rays of a path at most,
"samples": of each pixel, "camera": {"eye", "target", "up", "fov_deg"}, "environment": [rows][columns][3] radiance from the top
left, the middle towards -z and +x to its right, "pictures": [[turned, path], ...]: whether the environment is turned by 90
degrees}.

The floor is the plane 2 x 2 in z = 0, facing +z; the wall the same, turned by -90 degrees about x and moved by y = 1, z = 1, so that
it faces -y. Pictures are written as float32, rows from the top.

Out (JSON on stdout): {"absent": a sentence} where there is no LLVM, else {"version", "furnace": mean radiance of a sphere in surroundings of radiance 1 whose asset, fitted here to an
array, reflects all light}.
"""

import json
import sys
import tempfile
from pathlib import Path

import mitsuba as mi
import numpy as np

try:
    mi.set_variant("llvm_ad_rgb")
except ImportError as error:
    json.dump({"absent": f"Mitsuba finds no LLVM: {str(error).splitlines()[0]}"}, sys.stdout)
    sys.exit()
import btf.mitsuba  # noqa: E402, registers the BSDF of the variant

#: A plane of 2 x 2 that its texture covers once.
QUAD = Path(__file__).with_name("quad.obj")


def sensor_of(camera, size):
    to_world = mi.ScalarTransform4f().look_at(camera["eye"], camera["target"], camera["up"])
    film = {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"}}
    return {"type": "perspective", "fov": camera["fov_deg"], "fov_axis": "smaller", "to_world": to_world, "film": film,
            "sampler": {"type": "independent"}}


def scene_of(query, turned):
    # Meshes: two of Mitsuba's rectangles in a scene are not met by any ray of the variants of LLVM (3.7.1).
    plane = {"type": "obj", "filename": str(QUAD), "flip_tex_coords": False}
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


def check_widths(asset):
    """One place under many lights, many places under one, and another variant."""
    bsdf = mi.load_dict({"type": "btf", "filename": asset, "filter": "stochastic"})
    si, context = mi.SurfaceInteraction3f(), mi.BSDFContext()
    si.uv, si.wi = [0.3, 0.6], mi.Vector3f(0.6, 0.0, 0.8)
    lights = mi.warp.square_to_cosine_hemisphere(mi.Point2f(mi.Float([0.1, 0.5, 0.9]), mi.Float([0.2, 0.7, 0.4])))
    many = np.array(bsdf.eval(context, si, lights)).reshape(3, -1)
    alone = [np.array(bsdf.eval(context, si, mi.Vector3f(*np.array(lights)[:, i].tolist()))).ravel() for i in range(3)]
    assert many.shape == (3, 3) and np.array_equal(many, np.stack(alone, 1)), (many, alone)
    drawn, weight = bsdf.sample(context, si, 0.3, mi.Point2f(mi.Float([0.1, 0.6]), mi.Float([0.2, 0.8])))
    assert np.array(drawn.pdf).shape == (2,) and np.array(weight).shape == (3, 2)
    try:
        mi.load_dict({"type": "btf", "filename": asset, "filter": "cubic"})
    except Exception as error:  # Mitsuba wraps it.
        assert "take 'nearest' or 'stochastic'" in str(error), error
    mi.set_variant("scalar_rgb")
    btf.mitsuba.register()
    scalar = mi.load_dict({"type": "btf", "filename": asset, "filter": "stochastic"})
    si, context = mi.SurfaceInteraction3f(), mi.BSDFContext()
    si.uv, si.wi = [0.3, 0.6], [0.6, 0.0, 0.8]
    value = np.array(scalar.eval(context, si, np.array(lights)[:, 1].tolist()))
    assert np.allclose(value, many[:, 1], rtol=1e-5), (value, many[:, 1])
    mi.set_variant("scalar_spectral")
    try:
        btf.mitsuba.register()
    except ValueError as error:
        assert "red, green and blue" in str(error)
    else:
        raise AssertionError("a spectral variant was taken")


def main():
    query = json.load(sys.stdin)
    for turned, path in query["pictures"]:
        picture = np.array(mi.render(scene_of(query, turned), spp=query["samples"]))[..., :3]
        picture.astype(np.float32).tofile(path)
    with tempfile.TemporaryDirectory() as folder:
        answer = {"version": mi.__version__, "furnace": furnace(Path(folder))}
    check_widths(query["asset"])
    json.dump(answer, sys.stdout)


main()

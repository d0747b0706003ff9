"""Renders a plane that carries a packed asset with Mitsuba 3 (`scalar_rgb`) and `btf.mitsuba`.

In (JSON on stdin): {"asset": path, "uv_scale": x, "size": [width, height],
"camera": {"eye", "target", "up", "fov_deg"}, "light": {"position", "intensity"}, "pictures": [[flip_v, path], ...],
"eyes": [[x, y, z], ...]}.

Each picture is written to its path: float32, rows from the top, red, green and blue of each pixel, one ray through the
pixel's middle. fov_deg is that of the shorter side; the plane is 2 x 2, faces +z, and its texture lies on it `uv_scale`
times.

Out (JSON on stdout): {"version", "furnace": [[sampled, integrated, density], ...]}: for each eye the green part of what
is reflected of an even surrounding, by the plugin's `sample` and by its `eval` over all directions of the front, and
the largest relative difference of the density that `sample` tells from that of `pdf`.
"""

import json
import sys

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
import btf.mitsuba  # noqa: E402, F401, registers the BSDF of the variant

DRAWS, SIDE = 6000, 80


def scene_of(query, flip_v):
    camera, light = query["camera"], query["light"]
    width, height = query["size"]
    to_world = mi.ScalarTransform4f().look_at(camera["eye"], camera["target"], camera["up"])
    film = {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}}
    intensity = {"type": "rgb", "value": light["intensity"]}
    bsdf = {"type": "btf", "filename": query["asset"], "uv_scale": query["uv_scale"], "flip_v": flip_v}
    return mi.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 2},
        "sensor": {"type": "perspective", "fov": camera["fov_deg"], "fov_axis": "smaller", "to_world": to_world,
                   "film": film, "sampler": {"type": "independent"}},
        "light": {"type": "point", "position": light["position"], "intensity": intensity},
        "plane": {"type": "rectangle", "bsdf": bsdf},
    })


def picture(query, flip_v):
    """Mitsuba's integrator along the rays of its camera through the pixels' middles."""
    scene = scene_of(query, flip_v)
    sensor, integrator = scene.sensors()[0], scene.integrator()
    sampler = sensor.sampler()
    sampler.seed(0)
    width, height = query["size"]
    pixels = np.zeros((height, width, 3), np.float32)
    for y in range(height):
        for x in range(width):
            ray, weight = sensor.sample_ray_differential(0.0, 0.5, [(x + 0.5) / width, (y + 0.5) / height], [0.5, 0.5])
            radiance = integrator.sample(scene, sampler, ray)[0]
            pixels[y, x] = [float(radiance[i]) * float(weight[i]) for i in range(3)]
    return pixels


def furnace(query, eye):
    bsdf = mi.load_dict({"type": "btf", "filename": query["asset"]})
    context, si = mi.BSDFContext(), mi.SurfaceInteraction3f()
    si.n, si.sh_frame, si.uv, si.wi = [0, 0, 1], mi.Frame3f([0, 0, 1]), [0.3, 0.6], eye
    rng = np.random.default_rng(1)
    sampled, density = 0.0, 0.0
    for choice, x, y in rng.random((DRAWS, 3)):
        drawn, weight = bsdf.sample(context, si, choice, [x, y])
        if drawn.pdf > 0:
            sampled += weight[1]
            density = max(density, abs(bsdf.pdf(context, si, drawn.wo) / drawn.pdf - 1.0))
    integrated = 0.0
    for i in range(SIDE):
        for j in range(SIDE):
            light = mi.warp.square_to_uniform_hemisphere([(i + 0.5) / SIDE, (j + 0.5) / SIDE])
            integrated += bsdf.eval(context, si, light)[1]
    return [sampled / DRAWS, integrated * 2.0 * np.pi / SIDE**2, density]


def main():
    query = json.load(sys.stdin)
    for flip_v, path in query["pictures"]:
        picture(query, flip_v).tofile(path)
    json.dump({"version": mi.__version__, "furnace": [furnace(query, eye) for eye in query["eyes"]]}, sys.stdout)


main()

"""What Mitsuba 3 sees of triangles along rays: JSON on stdin, JSON on stdout.

In:  {"positions": [[[x, y, z] * 3], ...], "reflectance": [...], "transmittance": [...] of each triangle,
      "lights": [[x, y, z], ...], "rays": [[[x, y, z] origin, [x, y, z] direction], ...]}
Out: {"version": "...", "free": [1 or 0 for each ray], "light": [[value of each light] for each ray]}

A ray that meets nothing is free. A value is reflectance (on the light's side) or transmittance times |cosine| at the light, 0
in shadow: direct light of leaves that scatter evenly, 1 for a white surface lit along its normal. Positions are in
single precision, rays in double where Mitsuba was built for that.
"""

import json
import math
import sys

import mitsuba as mi

# Rays alone are asked for, which every build has one by one: in double precision where it can.
mi.set_variant(next(v for v in ("scalar_mono_double", "scalar_rgb") if v in mi.variants()))

# How far a shadow's ray begins off the surface.
LIFT = 1e-5


def scene_of(positions):
    mesh = mi.Mesh("model", vertex_count=3 * len(positions), face_count=len(positions))
    params = mi.traverse(mesh)
    params["vertex_positions"] = [x for triangle in positions for corner in triangle for x in corner]
    params["faces"] = list(range(3 * len(positions)))
    params.update()
    return mi.load_dict({"type": "scene", "model": mesh})


def normal_of(triangle):
    a, b, c = triangle
    u, v = ([q[i] - a[i] for i in range(3)] for q in (b, c))
    n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    length = math.sqrt(sum(x * x for x in n)) or 1.0
    return [x / length for x in n]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def value(query, scene, origin, direction, hit, light):
    triangle = int(hit.prim_index)
    normal = normal_of(query["positions"][triangle])
    seen, shone = -dot(normal, direction), dot(normal, light)
    share = query["reflectance" if seen * shone > 0.0 else "transmittance"][triangle]
    at = [o + float(hit.t) * d + math.copysign(LIFT, shone) * n for o, d, n in zip(origin, direction, normal)]
    # The mesh covers the unit cube; directional light comes from beyond it.
    if share == 0.0 or scene.ray_test(mi.Ray3f(at, light)):
        return 0.0
    return share * abs(shone)


def main():
    query = json.load(sys.stdin)
    scene = scene_of(query["positions"])
    free, light = [], []
    for origin, direction in query["rays"]:
        hit = scene.ray_intersect_preliminary(mi.Ray3f(origin, direction))
        met = hit.is_valid()
        free.append(0 if met else 1)
        light.append([value(query, scene, origin, direction, hit, l) if met else 0.0 for l in query["lights"]])
    # A NaN is no JSON: it fails here rather than in the reader.
    json.dump({"version": mi.__version__, "free": free, "light": light}, sys.stdout, allow_nan=False)


if __name__ == "__main__":
    main()

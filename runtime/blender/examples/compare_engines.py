"""Draws a folded cloth that shows an asset, by the engine BTF and by Cycles: the pictures of docs/guide/blender.md.

python compare_engines.py ASSET.spmm OUT.png [WIDTH]

It runs in Blender's Python module (pip install bpy) with the extension installed, or as
`blender --background --python compare_engines.py -- ASSET.spmm OUT.png`. Left half: BTF; right half: Cycles with the
textures that are fitted to the asset, which takes minutes the first time.
"""

import math
import os
import sys
import tempfile

import bpy
import numpy as np

sys.path.append(os.path.dirname(os.path.abspath(__file__)))
from pictures import look_from, rendered, write_png  # noqa: E402

#: Width and depth of the cloth in metres, and quads along each.
SIDE_M, QUADS = 0.14, 200
SAMPLES = 64


def folded_cloth():
    """Makes the mesh: folds that run across and fan out. u and v are metres along the cloth, not along the floor."""
    s = np.linspace(-0.5, 0.5, QUADS + 1)
    x, y = np.meshgrid(s, s)
    fan = 1.0 + 0.5 * (y + 0.5)
    height = 0.055 * np.cos(2.0 * np.pi * 2.2 * x * fan + 1.2 * np.sin(2.5 * y)) * np.exp(-2.0 * (y - 0.1) ** 2)
    places = SIDE_M * np.stack([x, y, height], -1)
    across = np.linalg.norm(np.diff(places, axis=1), axis=-1)
    along = np.linalg.norm(np.diff(places, axis=0), axis=-1)
    u = np.concatenate([np.zeros((QUADS + 1, 1)), np.cumsum(across, axis=1)], axis=1)
    v = np.concatenate([np.zeros((1, QUADS + 1)), np.cumsum(along, axis=0)], axis=0)
    number = np.arange((QUADS + 1) ** 2).reshape(QUADS + 1, QUADS + 1)
    quads = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], -1).reshape(-1, 4)
    mesh = bpy.data.meshes.new("cloth")
    mesh.from_pydata(places.reshape(-1, 3).tolist(), [], quads.tolist())
    uvs = np.stack([u, v], -1).reshape(-1, 2)[quads.ravel()] / SIDE_M
    mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", uvs.astype(np.float32).ravel())
    mesh.shade_smooth()
    obj = bpy.data.objects.new("cloth", mesh)
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    return obj


def place(data, at, towards=(0.0, 0.0, 0.0)):
    obj = bpy.data.objects.new(data.name, data)
    look_from(obj, at, towards)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def light_and_camera(scene):
    sun = bpy.data.lights.new("sun", "SUN")
    sun.energy, sun.angle = 4.5, math.radians(1.0)
    place(sun, (-1.0, -0.35, 0.9))
    lamp = bpy.data.lights.new("lamp", "POINT")
    lamp.energy, lamp.shadow_soft_size = 0.6, 0.0
    place(lamp, (0.2, 0.25, 0.2))
    camera = bpy.data.cameras.new("camera")
    camera.lens, camera.clip_start = 85.0, 0.001
    scene.camera = place(camera, (0.03, -0.24, 0.17), (0.0, 0.004, 0.0))
    background = scene.world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value, background.inputs["Strength"].default_value = (1.0, 1.0, 1.0, 1.0), 0.12


def main(asset, out, width):
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("world")
    folded_cloth()
    bpy.ops.btf.import_asset(filepath=os.path.abspath(asset), fallback="OPENPBR")
    light_and_camera(scene)
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, width * 5 // 8, 100
    scene.view_settings.view_transform, scene.render.image_settings.color_depth = "Standard", "8"
    scene.btf.samples, scene.cycles.samples, scene.cycles.device = SAMPLES, SAMPLES, "CPU"
    # Light straight from lamps and sky, as the engine BTF draws it.
    scene.cycles.max_bounces, scene.cycles.use_denoising = 0, False
    with tempfile.TemporaryDirectory() as folder:
        btf, cycles = (rendered(scene, engine, folder) for engine in ("BTF", "CYCLES"))
    btf[:, width // 2 :] = cycles[:, width // 2 :]
    write_png(btf, out)


if __name__ == "__main__":
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    main(arguments[0], arguments[1], int(arguments[2]) if len(arguments) > 2 else 960)

"""Draws an exported OpenUSD file with Cycles beside the asset drawn by the engine BTF: the picture of docs/guide/materialx-usd.md.

python usd_beside_asset.py FILE.usdz ASSET.spmm OUT.png [WIDTH]

It runs in Blender's Python module (pip install bpy) with the extension installed. Blender's own importer reads the file, so the
right half is its UsdPreviewSurface. Both halves are the plane of the asset's physical size, under a low lamp.
"""

import math
import os
import sys
import tempfile

import bpy
import numpy as np
from mathutils import Matrix

sys.path.append(os.path.dirname(os.path.abspath(__file__)))
from pictures import look_from, rendered, write_png  # noqa: E402

SAMPLES = 32


def new_scene(size_m, width):
    """Makes a dark scene with a camera above and a lamp beside a plane of `size_m` metres in the plane z = 0."""
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("world")
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.02
    light = bpy.data.lights.new("lamp", "POINT")
    light.energy, light.shadow_soft_size = 300.0 * size_m**2, 0.0
    lamp = bpy.data.objects.new("lamp", light)
    look_from(lamp, (-1.2 * size_m, 0.9 * size_m, 1.3 * size_m))
    camera = bpy.data.cameras.new("camera")
    camera.clip_start, camera.lens = 1e-4, 70.0
    eye = bpy.data.objects.new("camera", camera)
    look_from(eye, (0.0, -1.1 * size_m, 1.5 * size_m))
    for obj in (lamp, eye):
        scene.collection.objects.link(obj)
    scene.camera = eye
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, width, 100
    scene.view_settings.view_transform = "Standard"
    scene.cycles.samples, scene.cycles.device, scene.btf.samples = SAMPLES, "CPU", SAMPLES
    scene.cycles.max_bounces, scene.cycles.use_denoising = 0, False
    return scene


def main(usd, asset, out, width):
    import btf

    size_m = btf.open(asset).meta["size_mm"][0] / 1000.0
    with tempfile.TemporaryDirectory() as folder:
        scene = new_scene(size_m, width)
        bpy.ops.btf.import_asset(filepath=os.path.abspath(asset), fallback="COLOUR")
        left = rendered(scene, "BTF", folder)
        scene = new_scene(size_m, width)
        bpy.ops.wm.usd_import(filepath=os.path.abspath(usd), import_textures_mode="IMPORT_PACK")
        bpy.context.view_layer.update()
        # The file's plane stands, with y up.
        for obj in scene.objects:
            if obj.type == "MESH":
                obj.matrix_world = Matrix.Rotation(math.radians(-90.0), 4, "X") @ obj.matrix_world
        right = rendered(scene, "CYCLES", folder)
    write_png(np.concatenate([left, right], axis=1), out)


if __name__ == "__main__":
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    main(*arguments[:3], int(arguments[3]) if len(arguments) > 3 else 360)

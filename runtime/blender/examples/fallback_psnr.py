"""Measures the Principled material of assets against the assets: the figures of docs/guide/blender.md.

python fallback_psnr.py ASSET.spmm...

It runs in Blender's Python module (pip install bpy) with the extension installed. Cycles bakes each material at the texels
of a plane under a sun, as seen from far away, for random pairs of directions more than 15 degrees above the surface.
"""

import math
import os
import sys

import bpy
import numpy as np

sys.path.append(os.path.dirname(os.path.abspath(__file__)))
from pictures import look_from  # noqa: E402

#: Cosine of the lowest direction's angle with the normal.
LOWEST = math.sin(math.radians(15.0))
#: Distance of the camera, widths of the plane.
FAR = 1e4


def direction(rng):
    """Draws a direction, all of the same solid angle as likely."""
    z, angle = rng.uniform(LOWEST, 1.0), rng.uniform(0.0, 2.0 * np.pi)
    radius = math.sqrt(1.0 - z * z)
    return np.array([radius * math.cos(angle), radius * math.sin(angle), z])


def codes(linear):
    """Returns 8-bit sRGB codes."""
    x = np.clip(linear, 0.0, 1.0)
    return np.round(255.0 * np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1.0 / 2.4) - 0.055))


def psnr_db(path, obj, pairs=24):
    """Returns the PSNR of the material of a plane against the asset at `path`, all texels, 8-bit sRGB, dB."""
    import btf

    asset, scene = btf.open(path), bpy.context.scene
    width, height = asset.meta["width"], asset.meta["height"]
    nodes = obj.active_material.node_tree.nodes
    target = bpy.data.images.new("target", width, height, float_buffer=True, is_data=True)
    node = nodes.new("ShaderNodeTexImage")
    node.image, nodes.active = target, node
    for image in nodes:
        if image.bl_idname == "ShaderNodeTexImage":
            image.interpolation = "Closest"
    obj.active_material.btf.repeats = (1.0, 1.0)
    scene.render.engine, scene.cycles.samples, scene.cycles.device = "CYCLES", 1, "CPU"
    scene.render.bake.view_from, scene.render.bake.margin = "ACTIVE_CAMERA", 0
    scene.render.bake.use_pass_indirect = False
    light = bpy.data.lights.new("sun", "SUN")
    # A white surface that faces it has radiance 1.
    light.energy, light.angle = math.pi, 0.0
    sun, camera = bpy.data.objects.new("sun", light), bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
    scene.collection.objects.link(sun)
    scene.collection.objects.link(camera)
    scene.camera = camera
    bpy.ops.object.select_all(action="DESELECT")
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    uv = np.stack(np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height), -1)
    rng, squares, count = np.random.default_rng(3), 0.0, 0
    for _ in range(pairs):
        wi, wo = direction(rng), direction(rng)
        look_from(sun, wi)
        look_from(camera, FAR * max(obj.dimensions) * wo)
        bpy.ops.object.bake(type="COMBINED")
        pixels = np.empty(width * height * 4, np.float32)
        target.pixels.foreach_get(pixels)
        difference = codes(pixels.reshape(height, width, 4)[..., :3]) - codes(asset.eval(uv, wi, wo))
        squares, count = squares + float(np.sum(difference**2)), count + difference.size
    bpy.data.objects.remove(sun)
    bpy.data.objects.remove(camera)
    nodes.remove(node)
    return 10.0 * math.log10(255.0**2 * count / max(squares, 1e-9))


def main(paths):
    for path in paths:
        path = os.path.abspath(path)
        bpy.ops.wm.read_homefile(use_empty=True)
        bpy.context.scene.world = bpy.data.worlds.new("world")
        bpy.context.scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
        bpy.ops.btf.import_asset(filepath=path, fallback="OPENPBR")
        print(f"{path}: Principled {psnr_db(path, bpy.context.scene.objects[0]):.2f} dB")


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:])

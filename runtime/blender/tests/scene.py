"""What the tests of the add-on share: the installed extension, an empty scene, and pictures as arrays.

`cargo xtask blender` runs the tests with the variables BTF_BLENDER_EXTENSION (the .zip file), BTF_VIEW, BTF_FIT and
BTF_SYNTH (the programs); BLENDER_USER_RESOURCES is a folder of their own.
"""

import importlib
import os
import sys
import tempfile
import unittest
from pathlib import Path

import bpy
import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1] / "examples"))
from pictures import look_from  # noqa: E402

ADDON = "bl_ext.user_default.btf_materials"
ASSET = str(Path(__file__).resolve().parents[3] / "viewer" / "src" / "scene" / "builtin" / "weave.spmm")
VIEW, FIT, SYNTH = (os.environ[name] for name in ("BTF_VIEW", "BTF_FIT", "BTF_SYNTH"))


def install():
    """Installs the extension as a user does."""
    bpy.ops.extensions.package_install_files(
        filepath=os.environ["BTF_BLENDER_EXTENSION"], repo="user_default", enable_on_install=True
    )


def name_programs():
    """Names the programs in the add-on's preferences, unless the extension has its own."""
    preferences = bpy.context.preferences.addons[ADDON].preferences
    packed = "BTF_BLENDER_PACKED" in os.environ
    preferences.btf_view, preferences.btf_fit = ("", "") if packed else (VIEW, FIT)


# At once: the module `btf` comes with the extension.
install()


def part(name):
    """Returns a module of the add-on."""
    return importlib.import_module(f"{ADDON}.{name}")


class Scene(unittest.TestCase):
    """An empty, dark scene of 96 x 64 pixels with a camera."""

    def setUp(self):
        name_programs()
        self.folder = Path(self.enterContext(tempfile.TemporaryDirectory()))
        bpy.ops.wm.read_homefile(use_empty=True)
        self.scene = bpy.context.scene
        render = self.scene.render
        render.engine, render.use_border, render.use_crop_to_border = "BTF", False, False
        render.resolution_x, render.resolution_y, render.resolution_percentage = 96, 64, 100
        render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
        render.image_settings.exr_codec = "NONE"
        self.scene.btf.samples, self.scene.btf.mode, self.scene.btf.backend = 1, "DIRECT", "cpu"
        self.set_world((0.0, 0.0, 0.0), 0.0)
        self.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        self.scene.collection.objects.link(self.camera)
        self.scene.camera = self.camera
        look_from(self.camera, (4.0, -3.0, 2.0))

    def set_world(self, colour, strength):
        """Gives the world one colour. Returns its Background node."""
        world = self.scene.world or bpy.data.worlds.new("world")
        self.scene.world = world
        world.node_tree.nodes.clear()
        background = world.node_tree.nodes.new("ShaderNodeBackground")
        output = world.node_tree.nodes.new("ShaderNodeOutputWorld")
        world.node_tree.links.new(background.outputs[0], output.inputs["Surface"])
        background.inputs["Color"].default_value = (*colour, 1.0)
        background.inputs["Strength"].default_value = strength
        return background

    def sphere(self):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24)
        bpy.ops.object.shade_smooth()
        obj = bpy.context.active_object
        obj.rotation_euler, obj.scale = (0.3, 0.2, 0.5), (1.0, 0.7, 1.2)
        return obj

    def lamp(self, kind="POINT", place=(3.0, -2.0, 4.0), energy=500.0):
        light = bpy.data.lights.new("lamp", kind)
        light.energy = energy
        if kind == "SUN":
            light.angle = 0.0
        else:
            light.shadow_soft_size = 0.0
        obj = bpy.data.objects.new("lamp", light)
        self.scene.collection.objects.link(obj)
        look_from(obj, place)
        return obj

    def asset_material(self, repeats):
        """Makes a material of the built-in weave for the engine alone."""
        material = part("import_asset").make_material(ASSET, {})
        material.btf.repeats = repeats
        return material

    def diffuse_material(self):
        material = bpy.data.materials.new("diffuse")
        shader = material.node_tree.nodes["Principled BSDF"]
        shader.inputs["Base Color"].default_value = (0.8, 0.4, 0.2, 1.0)
        shader.inputs["Specular IOR Level"].default_value = 0.0
        shader.inputs["Roughness"].default_value = 1.0
        return material

    def rendered(self, engine="BTF", samples=1):
        """Returns the picture of an engine, (rows, columns, 3) linear, rows upwards."""
        scene = self.scene
        scene.render.engine, scene.btf.samples, scene.cycles.samples = engine, samples, samples
        scene.cycles.device, scene.cycles.max_bounces, scene.cycles.use_denoising = "CPU", 0, False
        scene.cycles.pixel_filter_type = "BOX"
        scene.render.filepath = str(self.folder / f"{engine}.exr")
        bpy.ops.render.render(write_still=True)
        return read_picture(scene.render.filepath)


def read_picture(path):
    """Reads an .exr file as it is, rows upwards."""
    image = bpy.data.images.load(str(path), check_existing=False)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(image.size[1], image.size[0], 4)[..., :3].copy()
    bpy.data.images.remove(image)
    return pixels


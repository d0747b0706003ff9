"""What the examples share: cameras and lamps that look at the origin, and pictures as arrays."""

import os

import bpy
import numpy as np
from mathutils import Vector


def look_from(obj, place, towards=(0.0, 0.0, 0.0)):
    """Moves a camera or a lamp to a place, from which it looks at a point."""
    obj.location, obj.rotation_mode = place, "QUATERNION"
    obj.rotation_quaternion = (Vector(place) - Vector(towards)).to_track_quat("Z", "Y")


def rendered(scene, engine, folder):
    """Returns the picture of an engine as it is shown, (rows, columns, 4), rows upwards."""
    scene.render.engine = engine
    scene.render.filepath = os.path.join(folder, f"{engine}.png")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath, check_existing=False)
    pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], 4)


def write_png(pixels, path):
    """Writes a picture, with a white line in its middle."""
    height, width = pixels.shape[:2]
    pixels[:, width // 2 - 1 : width // 2 + 1] = 1.0
    image = bpy.data.images.new("both", width, height)
    image.pixels.foreach_set(np.ascontiguousarray(pixels).ravel())
    image.filepath_raw, image.file_format = os.path.abspath(path), "PNG"
    image.save()

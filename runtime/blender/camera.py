"""A view of Blender's as a camera of `btf-view`, which looks along the middle of its picture.

What is seen off that middle (lens shift, a border, a view that was moved) is cut out of a larger picture.
"""

import math
from dataclasses import dataclass

import bpy
from mathutils import Vector

from .axes import y_up

#: Field of view that stands for none, of views without perspective, degrees.
_FLAT_FOV_DEG = 0.25


class CameraError(Exception):
    """One sentence that says which camera cannot be drawn."""


@dataclass
class View:
    """A picture that is asked for, and the part of it that is wanted."""

    #: `camera` of a request: eye, target, up, fov_deg.
    camera: dict
    #: Width and height of the whole picture.
    size: tuple
    #: Of the wanted part, from the lower left corner: x, y, width, height.
    part: tuple


def of_projection(projection, world_from_view, size, middle, border=(0.0, 0.0, 1.0, 1.0)):
    """Returns the view of an OpenGL projection matrix for a picture of `size` pixels.

    middle: a point in the midst of what is seen, where views without perspective have their scale.
    border: left, bottom, right, top of the wanted part, as shares of the picture.
    The part is right to a quarter of a pixel, and exactly where lens and border are in the middle.
    Raises CameraError for pixels that are no squares.
    """
    width, height = size
    flat = abs(projection[3][3] - 1.0) < 1e-6
    # Where the picture's edges lie, at distance 1 or in units of the scene.
    edges = []
    for axis in (0, 1):
        scale = projection[axis][axis]
        offset = -projection[axis][3] if flat else projection[axis][2]
        edges.append(((offset - 1.0) / scale, (offset + 1.0) / scale))
    (left, right), (bottom, top) = edges
    pixel = (right - left) / width
    if abs((top - bottom) / height - pixel) > 1e-3 * pixel:
        raise CameraError("pixels that are no squares cannot be drawn: set the aspect of the output to 1")
    first = [math.floor(border[0] * width + 0.5), math.floor(border[1] * height + 0.5)]
    last = [math.floor(border[2] * width + 0.5), math.floor(border[3] * height + 0.5)]
    wanted = [max(last[axis] - first[axis], 1) for axis in (0, 1)]
    place = world_from_view.copy()
    if flat:
        # The eye moves instead, so nothing lies off the middle.
        centre = [low + (first[axis] + 0.5 * wanted[axis]) * pixel for axis, low in enumerate((left, bottom))]
        distance = 0.5 * pixel * min(wanted) / math.tan(math.radians(0.5 * _FLAT_FOV_DEG))
        depth = (place.inverted() @ Vector(middle)).z
        target = place @ Vector((*centre, depth))
        eye = place @ Vector((*centre, depth + distance))
        return View(_camera(eye, target, place, _FLAT_FOV_DEG), tuple(wanted), (0, 0, *wanted))
    whole, part = [], []
    for axis, low in enumerate((left, bottom)):
        count, offset = _around_axis(-low / pixel - first[axis], wanted[axis])
        whole.append(count)
        part.append(offset)
    fov = 2.0 * math.degrees(math.atan(0.5 * pixel * min(whole)))
    target = place @ Vector((0.0, 0.0, -1.0))
    return View(_camera(place.translation, target, place, fov), tuple(whole), (*part, *wanted))


def _around_axis(axis, wanted):
    """Of a row of `wanted` pixels, with the optical axis `axis` pixels from its start, returns how many there must be
    with the axis in the middle, and where the row starts among them."""
    least = max(math.ceil(2.0 * max(axis, wanted - axis) - 1e-3), 1)
    # One more shifts the pixels by half.
    candidates = [(count, round(0.5 * count - axis)) for count in (least, least + 1, least + 2)]
    good = [(count, start) for count, start in candidates if start >= 0 and start + wanted <= count]
    return min(good, key=lambda found: (round(abs(0.5 * found[0] - axis - found[1]), 3), found[0]))


def _camera(eye, target, place, fov_deg):
    up = place.to_3x3() @ Vector((0.0, 1.0, 0.0))
    return {"eye": y_up(eye), "target": y_up(target), "up": y_up(up), "fov_deg": fov_deg}


def has_surface(obj):
    """Tells whether an evaluated object is drawn. What curves and text are made of comes as a mesh beside them."""
    return obj.type == "META" or isinstance(obj.data, bpy.types.Mesh)


def middle_of(depsgraph):
    """Returns the middle of the boxes around all surfaces."""
    low, high = Vector((math.inf,) * 3), Vector((-math.inf,) * 3)
    for instance in depsgraph.object_instances:
        if not has_surface(instance.object):
            continue
        for corner in instance.object.bound_box:
            place = instance.matrix_world @ Vector(corner)
            low, high = Vector(map(min, low, place)), Vector(map(max, high, place))
    return 0.5 * (low + high) if low.x <= high.x else Vector()


def of_render(depsgraph):
    """Returns the view of the scene's camera for the final picture.

    Raises CameraError without a camera and for panoramas.
    """
    scene = depsgraph.scene
    render = scene.render
    camera = scene.camera
    if camera is None:
        raise CameraError("the scene has no camera: add one")
    if camera.data.type == "PANO":
        raise CameraError(f"{camera.name} is a panorama, which cannot be drawn: make it perspective or orthographic")
    scale = render.resolution_percentage / 100.0
    size = (max(int(render.resolution_x * scale), 1), max(int(render.resolution_y * scale), 1))
    camera = camera.evaluated_get(depsgraph)
    projection = camera.calc_matrix_camera(
        depsgraph, x=size[0], y=size[1], scale_x=render.pixel_aspect_x, scale_y=render.pixel_aspect_y
    )
    border = (0.0, 0.0, 1.0, 1.0)
    if render.use_border:
        border = (render.border_min_x, render.border_min_y, render.border_max_x, render.border_max_y)
    return of_projection(projection, camera.matrix_world.normalized(), size, middle_of(depsgraph), border)

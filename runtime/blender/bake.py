"""Bake here: evaluates an asset for the active camera and the lamps into an image over the object's UV map.

Shadows are those of rays through the scene; light from the world is not in it.
"""

import bpy
import numpy as np
from mathutils import Vector

from . import asset_file, lights, mesh_arrays
from .asset_file import AssetError
from .axes import Y_UP
from .mesh_arrays import unit

#: Pixels by which the image goes on beyond the edges of its islands.
_MARGIN = 4
#: Distance from the surface at which shadow rays begin, shares of the object's size.
_LIFT = 1e-4
#: Suns are as far as this.
_FAR = 1e6


class _Texels:
    """Places of the surface that an image shows, in the world."""

    def __init__(self, arrays, matrix, repeats, size):
        normal_matrix = np.array(matrix.to_3x3().inverted_safe().transposed())
        turn = np.array(matrix)
        positions = arrays.positions.astype(np.float64) @ turn[:3, :3].T + turn[:3, 3]
        normals = unit(arrays.normals.astype(np.float64) @ normal_matrix.T)
        tangents, bitangents = mesh_arrays.tangents(positions, normals, arrays.uvs, arrays.triangles)
        rows, columns, triangles, weights = _covered(arrays.uvs[arrays.triangles].astype(np.float64), size)
        self.rows, self.columns = rows, columns

        def between(values):
            return np.einsum("pk,pkc->pc", weights, values[arrays.triangles[triangles]])

        self.positions, self.uvs = between(positions), between(arrays.uvs.astype(np.float64)) * np.asarray(repeats)
        self.normals = unit(between(normals))
        along = between(tangents)
        self.tangents = unit(along - self.normals * np.sum(along * self.normals, axis=1, keepdims=True))
        across = np.cross(self.normals, self.tangents)
        sign = np.sign(np.sum(across * between(bitangents), axis=1, keepdims=True))
        self.bitangents = across * np.where(sign < 0.0, -1.0, 1.0)

    def local(self, directions):
        """Returns directions of the world, (texels, 3), in the frames of the texels."""
        frames = (self.tangents, self.bitangents, self.normals)
        return np.stack([np.sum(directions * axis, axis=1) for axis in frames], -1)


def _covered(corners, size):
    """Returns the rows, columns, triangles and weights of the corners of all pixels whose middle a triangle covers."""
    found = []
    for number, triangle in enumerate(corners * size - 0.5):
        low = np.maximum(np.ceil(triangle.min(axis=0)), 0).astype(int)
        high = np.minimum(np.floor(triangle.max(axis=0)), size - 1).astype(int)
        a, b, c = triangle
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if (high < low).any() or abs(area) < 1e-12:
            continue
        x, y = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1))
        x, y = x.ravel(), y.ravel()
        second = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
        third = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
        weights = np.stack([1.0 - second - third, second, third], -1)
        inside = (weights >= -1e-9).all(axis=1)
        if inside.any():
            found.append((y[inside], x[inside], np.full(inside.sum(), number), weights[inside]))
    if not found:
        raise AssetError("the UV map lies outside the image: unwrap the object within 0 to 1")
    return [np.concatenate(parts) for parts in zip(*found)]


def _lamp_light(lamps):
    """Yields for each lamp a function of positions: directions to it, irradiance at right angles, and distances."""
    z_up = np.array(Y_UP.inverted())[:3, :3]
    for lamp in lamps["lights"]:
        place, intensity = z_up @ lamp["position"], np.asarray(lamp["intensity"])

        def from_point(positions, place=place, intensity=intensity):
            way = place - positions
            distance = np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
            return way / distance, intensity / distance**2, distance[:, 0]

        yield from_point
    if "sun" in lamps:
        towards, irradiance = z_up @ lamps["sun"]["direction"], np.asarray(lamps["sun"]["irradiance"])

        def from_sun(positions):
            count = len(positions)
            return np.tile(towards, (count, 1)), np.tile(irradiance, (count, 1)), np.full(count, _FAR)

        yield from_sun


def _is_lit(depsgraph, texels, directions, distances, lift):
    """Returns which texels nothing hides from a lamp."""
    cast, scene = depsgraph.scene.ray_cast, depsgraph
    sides = np.where(np.sum(directions * texels.normals, axis=1, keepdims=True) < 0.0, -lift, lift)
    origins = texels.positions + texels.normals * sides
    lit = np.empty(len(origins), bool)
    for number, (origin, direction, distance) in enumerate(zip(origins, directions, distances)):
        hit, *_ = cast(scene, Vector(origin), Vector(direction), distance=max(distance - 2.0 * lift, 0.0))
        lit[number] = not hit
    return lit


def bake(obj, material, depsgraph, size, shadows=True):
    """Returns the radiance of an object's surface for the scene's camera and lamps, (size, size, 4), rows upwards.

    Alpha is 1 where the UV map lies. Raises AssetError for what cannot be baked.
    """
    camera = depsgraph.scene.camera
    if camera is None:
        raise AssetError("the scene has no camera: add one")
    asset = asset_file.open_asset(asset_file.absolute_path(material.btf.path))
    evaluated = obj.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    try:
        arrays = mesh_arrays.read(mesh) if mesh is not None else None
        if arrays is None or arrays.uvs is None:
            raise AssetError(f"{obj.name} has no UV map: unwrap it")
        _keep_faces_of(arrays, evaluated, material)
        texels = _Texels(arrays, evaluated.matrix_world, material.btf.repeats, size)
    finally:
        evaluated.to_mesh_clear()
    eye = np.array(camera.evaluated_get(depsgraph).matrix_world.translation)
    wo = texels.local(unit(eye - texels.positions))
    radiance = np.zeros_like(texels.positions)
    lift = _LIFT * max(max(evaluated.dimensions), 1e-6)
    lamps, _ = lights.lamps(depsgraph)
    for lamp in _lamp_light(lamps):
        directions, irradiance, distances = lamp(texels.positions)
        values = asset.eval(texels.uvs, texels.local(directions), wo)
        if shadows:
            values = values * _is_lit(depsgraph, texels, directions, distances, lift)[:, None]
        # The value holds pi and the cosine.
        radiance += values * irradiance / np.pi
    pixels = np.zeros((size, size, 4), np.float32)
    pixels[texels.rows, texels.columns, :3] = radiance
    pixels[texels.rows, texels.columns, 3] = 1.0
    return _grown(pixels)


def _keep_faces_of(arrays, obj, material):
    """Leaves out the faces that show another material."""
    slots = [slot.material for slot in obj.material_slots]
    shown = [number for number, one in enumerate(slots) if one is not None and one.original == material]
    # Numbers beyond the last slot stand for that.
    faces = np.isin(np.minimum(arrays.slots, max(len(slots) - 1, 0)), shown)
    if not faces.any():
        raise AssetError(f"no face of {obj.name} has the material {material.name}: assign it")
    arrays.triangles, arrays.slots = arrays.triangles[faces], arrays.slots[faces]


def _grown(pixels):
    """Lets islands go on by a margin, whose alpha stays 0."""
    known = pixels[..., 3] > 0.0
    for _ in range(_MARGIN):
        for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
            fresh = np.roll(known, step, axis) & ~known
            pixels[fresh, :3] = np.roll(pixels, step, axis)[fresh, :3]
            known = known | fresh
    return pixels


class BTF_OT_bake_here(bpy.types.Operator):
    """Evaluate the asset for the scene's camera and lamps into an image over the UV map"""

    bl_idname = "btf.bake_here"
    bl_label = "Bake here"
    bl_options = {"REGISTER", "UNDO"}

    size: bpy.props.IntProperty(name="Size", default=1024, min=1, max=16384, description="Pixels along u and v")
    shadows: bpy.props.BoolProperty(name="Shadows", default=True, description="Ask by rays what hides the lamps")

    @classmethod
    def poll(cls, context):
        obj = context.active_object
        return obj is not None and obj.active_material is not None and bool(obj.active_material.btf.path)

    def execute(self, context):
        obj, material = context.active_object, context.active_object.active_material
        try:
            pixels = bake(obj, material, context.evaluated_depsgraph_get(), self.size, self.shadows)
        except AssetError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        name = f"{obj.name} {material.name} baked"
        image = bpy.data.images.get(name)
        if image is None or tuple(image.size) != (self.size, self.size):
            image = bpy.data.images.new(name, self.size, self.size, alpha=True, float_buffer=True, is_data=False)
        image.pixels.foreach_set(pixels.ravel())
        image.pack()
        for area in context.screen.areas if context.screen else []:
            if area.type == "IMAGE_EDITOR":
                area.spaces.active.image = image
        self.report({"INFO"}, f"baked into the image {name}")
        return {"FINISHED"}


CLASSES = (BTF_OT_bake_here,)

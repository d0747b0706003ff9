"""How often an asset is repeated on a mesh, so that it has its physical size."""

import bpy
import numpy as np

from . import mesh_arrays


def metres_per_uv(mesh, scale, metres_per_unit):
    """Returns the lengths in metres of a unit of u and of v on a mesh, as means over its area; None without UVs.

    scale: of the object along its axes. metres_per_unit: of the scene.
    """
    arrays = mesh_arrays.read(mesh)
    if arrays is None or arrays.uvs is None:
        return None
    positions = arrays.positions * np.asarray(scale, np.float64)
    along_u, along_v, determinant, area = mesh_arrays.along_uv(positions, arrays.uvs, arrays.triangles)
    good = (np.abs(determinant) > 1e-12) & (area > 0.0)
    if not good.any():
        return None
    lengths = [np.linalg.norm(along[good], axis=1) / np.abs(determinant[good]) for along in (along_u, along_v)]
    mean = [float(np.average(length, weights=area[good])) for length in lengths]
    return [metres_per_unit * length for length in mean]


def fit_repeats(material, obj, scene):
    """Repeats a material's asset so often that it has its physical size on an object. Returns whether it could."""
    settings = material.btf
    if obj is None or obj.type != "MESH" or min(settings.size_m) <= 0.0:
        return False
    lengths = metres_per_uv(obj.data, obj.matrix_world.to_scale(), scene.unit_settings.scale_length)
    if lengths is None:
        return False
    settings.repeats = [length / size for length, size in zip(lengths, settings.size_m)]
    return True


class BTF_OT_physical_size(bpy.types.Operator):
    """Repeat the asset so often that it has its physical size on the active object"""

    bl_idname = "btf.physical_size"
    bl_label = "Physical size"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        obj = context.active_object
        return obj is not None and obj.active_material is not None and bool(obj.active_material.btf.path)

    def execute(self, context):
        if fit_repeats(context.active_object.active_material, context.active_object, context.scene):
            return {"FINISHED"}
        self.report({"ERROR"}, "the size is not known: the asset tells none, or the object is no mesh with a UV map")
        return {"CANCELLED"}


CLASSES = (BTF_OT_physical_size,)

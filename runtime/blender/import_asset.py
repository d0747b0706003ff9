"""File > Import > BTF asset: an asset as a material, on the active object or on a plane of its physical size."""

import os

import bpy
import numpy as np
from bpy_extras.io_utils import ImportHelper

from . import asset_file, fitted_textures, physical_size, principled
from .asset_file import AssetError
from .programs import ProgramError

#: Width and height of the plane for an asset that tells no size, metres.
_UNKNOWN_SIZE_M = 0.1


def _mean_colour(asset):
    """Returns the asset's mean albedo under light from the front, linear RGB."""
    rng = np.random.default_rng(1)
    uv = rng.random((4096, 2))
    # Directions to light by the cosine, whose mean is the albedo: the value holds the cosine and pi.
    angle, radius = 2.0 * np.pi * rng.random(4096), np.sqrt(rng.random(4096))
    wi = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1.0 - radius * radius)], -1)
    values = asset.eval(uv, wi, [0.0, 0.0, 1.0]) / np.maximum(wi[:, 2:], 0.05)
    return tuple(float(x) for x in np.clip(values.mean(axis=0), 0.0, 1.0))


def _height_image(asset, name, size_m):
    """Returns an image of the asset's heights in metres, packed into the .blend file; None where it has none."""
    heights = asset.heights()
    if heights is None:
        return None
    rows, columns = heights.shape
    image = bpy.data.images.new(f"{name} heights", columns, rows, float_buffer=True, is_data=True)
    pixels = np.ones((rows, columns, 4), np.float32)
    # Rows of images go upwards.
    pixels[..., :3] = heights[::-1, :, None] * (size_m[0] / columns)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def _plane(name, size_m, scene):
    """Adds a plane of a size in metres at the cursor, facing up, u along x and v along y. Returns the object."""
    width, height = (size / scene.unit_settings.scale_length for size in size_m)
    mesh = bpy.data.meshes.new(name)
    corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    mesh.from_pydata([(x * width, y * height, 0.0) for x, y in corners], [], [(0, 1, 2, 3)])
    layer = mesh.uv_layers.new(name="UVMap")
    layer.uv.foreach_set("vector", [c + 0.5 for corner in corners for c in corner])
    obj = bpy.data.objects.new(name, mesh)
    obj.location = scene.cursor.location
    scene.collection.objects.link(obj)
    return obj


def make_material(path, textures, psnr_db=0.0):
    """Makes a material of an asset. `textures` as of `fitted_textures`, or none. Returns the material.

    Raises AssetError for a file that is no whole asset.
    """
    asset = asset_file.open_asset(path)
    name = os.path.splitext(os.path.basename(path))[0]
    size_mm = asset.meta["size_mm"]
    size_m = [size / 1000.0 for size in size_mm] if size_mm else [0.0, 0.0]
    material = bpy.data.materials.new(name)
    heights = _height_image(asset, name, size_m) if size_mm else None
    principled.build(material, textures, _mean_colour(asset), heights)
    settings = material.btf
    settings.described = path
    # Relative to the .blend file, where that is the preference and the file has been saved.
    relative = bpy.context.preferences.filepaths.use_relative_paths and bpy.data.filepath
    settings.path = bpy.path.relpath(path) if relative else path
    settings.size_m, settings.psnr_db, settings.has_heights = size_m, psnr_db, heights is not None
    return material


def apply_material(material, context):
    """Gives the active mesh the material, or adds a plane of the asset's size that has it. Returns the object."""
    obj = context.active_object
    selected = obj is not None and obj.type == "MESH" and obj.select_get()
    if not selected:
        size_m = [size or _UNKNOWN_SIZE_M for size in material.btf.size_m]
        obj = _plane(material.name, size_m, context.scene)
    if obj.material_slots:
        obj.material_slots[obj.active_material_index].material = material
    else:
        obj.data.materials.append(material)
    physical_size.fit_repeats(material, obj, context.scene)
    return obj


class BTF_OT_import_asset(bpy.types.Operator, ImportHelper):
    """Import a packed asset (.spmm) as a material"""

    bl_idname = "btf.import_asset"
    bl_label = "Import BTF asset"
    bl_options = {"REGISTER", "UNDO"}

    filename_ext = ".spmm"
    filter_glob: bpy.props.StringProperty(default="*.spmm", options={"HIDDEN"})
    fallback: bpy.props.EnumProperty(
        name="Other engines",
        items=[
            ("OPENPBR", "Fitted textures", "Principled BSDF with textures fitted to the asset; the fit takes minutes"),
            ("COLOUR", "Mean colour", "One colour, at once: for scenes that are drawn by the engine BTF"),
        ],
        default="OPENPBR",
        description="What engines other than BTF draw",
    )
    folder: bpy.props.StringProperty(
        name="Textures", subtype="DIR_PATH", description="Folder of the fitted textures; empty for the asset's own"
    )

    _fit = None
    _timer = None

    def execute(self, context):
        try:
            asset = asset_file.absolute_path(self.filepath)
            asset_file.checksum_of(asset)
            if self.fallback == "COLOUR":
                return self._finish(context, asset, {}, 0.0)
            document = fitted_textures.document_beside(asset, bpy.path.abspath(self.folder))
            if fitted_textures.is_current(document, asset):
                return self._finish(context, asset, fitted_textures.textures_of(document), 0.0)
            self._asset, self._document = asset, document
            self._fit = fitted_textures.Fit(asset, document)
            if bpy.app.background or context.window is None:
                return self._end_fit(context)
        except (AssetError, ProgramError) as error:
            return self._refuse(error)
        self._timer = context.window_manager.event_timer_add(0.2, window=context.window)
        context.window_manager.modal_handler_add(self)
        context.workspace.status_text_set(f"Fitting textures to {os.path.basename(asset)}: Esc cancels")
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self._fit.cancel()
            self._stop_waiting(context)
            return {"CANCELLED"}
        if event.type != "TIMER" or self._fit.is_running():
            return {"PASS_THROUGH"}
        self._stop_waiting(context)
        try:
            return self._end_fit(context)
        except AssetError as error:
            return self._refuse(error)

    def cancel(self, context):
        """Blender ends the operator: another file is loaded, or the window is closed."""
        self._fit.cancel()
        self._stop_waiting(context)

    def _stop_waiting(self, context):
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)

    def _end_fit(self, context):
        psnr_db = self._fit.result()
        return self._finish(context, self._asset, fitted_textures.textures_of(self._document), psnr_db)

    def _finish(self, context, asset, textures, psnr_db):
        material = make_material(asset, textures, psnr_db)
        obj = apply_material(material, context)
        told = f", its fallback {psnr_db:.2f} dB from it" if psnr_db > 0.0 else ""
        self.report({"INFO"}, f"{obj.name} shows {os.path.basename(asset)}{told}")
        return {"FINISHED"}

    def _refuse(self, error):
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}


CLASSES = (BTF_OT_import_asset,)


def _menu(self, _context):
    self.layout.operator(BTF_OT_import_asset.bl_idname, text="BTF asset (.spmm)")


def register():
    bpy.types.TOPBAR_MT_file_import.append(_menu)


def unregister():
    bpy.types.TOPBAR_MT_file_import.remove(_menu)

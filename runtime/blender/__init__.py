"""Packed BTF assets (.spmm) in Blender: import as a material, bake, and the render engine "BTF".

| File | |
|---|---|
| `asset_file` | what is read of an asset without decoding it |
| `programs` | finds and runs `btf-fit` and `btf-view` |
| `fitted_textures` | the textures of an asset's OpenPBR Surface |
| `principled` | the same as nodes of a Principled BSDF |
| `physical_size` | how often an asset is repeated on a mesh |
| `material_settings` | the properties of a material that shows an asset |
| `import_asset` | File > Import > BTF asset |
| `camera`, `lights`, `mesh_file`, `scene_file` | a scene as `btf-view` takes it |
| `axes`, `mesh_arrays`, `named_files` | what these and others need |
| `viewer` | the process that draws |
| `engine`, `engine_settings` | the render engine |
| `bake` | evaluates an asset for the camera and the lights into an image |
| `panels` | the user interface |
"""

import bpy

from . import bake, engine, engine_settings, import_asset, material_settings, panels, physical_size, programs

_MODULES = (programs, material_settings, engine_settings, physical_size, import_asset, bake, engine, panels)


def register():
    """Makes the classes of all modules known to Blender."""
    for module in _MODULES:
        for cls in getattr(module, "CLASSES", ()):
            bpy.utils.register_class(cls)
        if hasattr(module, "register"):
            module.register()


def unregister():
    """Undoes what `register` did, in reverse."""
    for module in reversed(_MODULES):
        if hasattr(module, "unregister"):
            module.unregister()
        for cls in reversed(getattr(module, "CLASSES", ())):
            bpy.utils.unregister_class(cls)

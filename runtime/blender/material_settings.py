"""The properties of a material that shows an asset."""

import bpy

from . import asset_file
from .principled import HEIGHTS, MAPPING


def _describe(settings, _context):
    """Reads the size and the heights of an asset that was chosen anew. Textures stay those of the asset before."""
    try:
        path = asset_file.absolute_path(settings.path)
        if path == settings.described:
            return
        asset = asset_file.open_asset(path)
    except asset_file.AssetError:
        # It may come later; whoever draws it says that it is not there.
        settings.described, settings.size_m, settings.has_heights = "", (0.0, 0.0), False
        return
    size_mm = asset.meta["size_mm"] or (0.0, 0.0)
    settings.described, settings.size_m = path, [size / 1000.0 for size in size_mm]
    settings.has_heights, settings.psnr_db = asset.heights() is not None, 0.0


def _follow(settings, context):
    """Gives the nodes what the settings say."""
    tree = settings.id_data.node_tree
    mapping = tree.nodes.get(MAPPING) if tree else None
    if mapping is not None:
        mapping.inputs["Scale"].default_value = (*settings.repeats, 1.0)
    displacement = tree.nodes.get(HEIGHTS) if tree else None
    if displacement is not None:
        # Heights are in metres.
        metres = context.scene.unit_settings.scale_length or 1.0
        displacement.inputs["Scale"].default_value = settings.displacement / metres


class BtfMaterialSettings(bpy.types.PropertyGroup):
    """What a material shows of an asset, and how large. Saved with the .blend file."""

    path: bpy.props.StringProperty(
        name="Asset",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
        update=_describe,
        description="The packed asset (.spmm) that the material shows",
    )
    repeats: bpy.props.FloatVectorProperty(
        name="Repeats",
        size=2,
        default=(1.0, 1.0),
        description="How often the asset is repeated along a unit of u and v",
        update=_follow,
    )
    displacement: bpy.props.FloatProperty(
        name="Displacement",
        default=1.0,
        min=0.0,
        soft_max=2.0,
        description="Factor of the asset's heights, where it has any: 1 as they are",
        update=_follow,
    )
    size_m: bpy.props.FloatVectorProperty(
        name="Size", size=2, min=0.0, description="Width and height of one repetition in metres; 0 where it is not known"
    )
    has_heights: bpy.props.BoolProperty(name="Has heights")
    described: bpy.props.StringProperty(
        name="Described", options={"HIDDEN"}, description="The asset that size and heights are of"
    )
    psnr_db: bpy.props.FloatProperty(
        name="Fallback", description="PSNR of the fitted OpenPBR Surface against the asset, dB; 0 where it is not known"
    )


CLASSES = (BtfMaterialSettings,)


def register():
    bpy.types.Material.btf = bpy.props.PointerProperty(type=BtfMaterialSettings)


def unregister():
    del bpy.types.Material.btf

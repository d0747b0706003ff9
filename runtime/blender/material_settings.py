"""The properties of a material that shows an asset."""

import bpy

from .principled import HEIGHTS, MAPPING


def _follow(settings, _context):
    """Gives the nodes what the settings say."""
    tree = settings.id_data.node_tree
    mapping = tree.nodes.get(MAPPING) if tree else None
    if mapping is not None:
        mapping.inputs["Scale"].default_value = (*settings.repeats, 1.0)
    displacement = tree.nodes.get(HEIGHTS) if tree else None
    if displacement is not None:
        displacement.inputs["Scale"].default_value = settings.displacement


class BtfMaterialSettings(bpy.types.PropertyGroup):
    """What a material shows of an asset, and how large. Saved with the .blend file."""

    path: bpy.props.StringProperty(
        name="Asset",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
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
    psnr_db: bpy.props.FloatProperty(
        name="Fallback", description="PSNR of the fitted OpenPBR Surface against the asset, dB; 0 where it is not known"
    )


CLASSES = (BtfMaterialSettings,)


def register():
    bpy.types.Material.btf = bpy.props.PointerProperty(type=BtfMaterialSettings)


def unregister():
    del bpy.types.Material.btf

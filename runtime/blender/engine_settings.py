"""The settings of the render engine, saved with the scene."""

import bpy


class BtfRenderSettings(bpy.types.PropertyGroup):
    """How the engine BTF draws a scene."""

    samples: bpy.props.IntProperty(
        name="Samples", default=64, min=1, max=65536, description="Samples of a pixel in the final picture"
    )
    viewport_samples: bpy.props.IntProperty(
        name="Viewport samples", default=16, min=1, max=65536, description="Samples of a pixel in the viewport"
    )
    mode: bpy.props.EnumProperty(
        name="Light",
        items=[
            ("DIRECT", "Direct", "Light that comes straight from lamps and world"),
            ("PATH", "Path traced", "Light on any way up to the depth"),
        ],
        default="DIRECT",
        description="Which light is followed",
    )
    depth: bpy.props.IntProperty(name="Depth", default=4, min=1, max=64, description="Rays of a path at most")
    backend: bpy.props.EnumProperty(
        name="Device",
        items=[
            ("auto", "Automatic", "The graphics card, or the processor where there is none"),
            ("ray-query", "Ray queries", "The graphics card's own ray tracing"),
            ("bvh", "Compute", "The graphics card without ray tracing of its own"),
            ("cpu", "Processor", "No graphics card"),
        ],
        default="auto",
        description="What traces rays and decodes assets",
    )


CLASSES = (BtfRenderSettings,)


def register():
    bpy.types.Scene.btf = bpy.props.PointerProperty(type=BtfRenderSettings)


def unregister():
    del bpy.types.Scene.btf

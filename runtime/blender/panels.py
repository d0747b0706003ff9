"""The user interface: panels of materials and of the render engine."""

import bpy

from .engine import BtfRenderEngine


class _OfProperties:
    """A panel of the properties editor."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"


class _OfEngine(_OfProperties):
    """A panel that is there for our engine alone."""

    COMPAT_ENGINES = {BtfRenderEngine.bl_idname}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES


class BTF_PT_material(_OfProperties, bpy.types.Panel):
    """The asset of the active material."""

    bl_label = "BTF asset"
    bl_context = "material"

    @classmethod
    def poll(cls, context):
        return context.material is not None

    def draw(self, context):
        layout, settings = self.layout, context.material.btf
        layout.use_property_split = True
        layout.prop(settings, "path")
        column = layout.column()
        column.enabled = bool(settings.path)
        column.prop(settings, "repeats")
        column.operator("btf.physical_size", icon="FIXED_SIZE")
        if settings.has_heights:
            column.prop(settings, "displacement")
        if settings.psnr_db > 0.0:
            column.label(text=f"Fitted textures: {settings.psnr_db:.2f} dB from the asset")
        column.operator("btf.bake_here", icon="RENDER_STILL")


class BTF_PT_render(_OfEngine, bpy.types.Panel):
    """The settings of the engine."""

    bl_label = "BTF"
    bl_context = "render"

    def draw(self, context):
        layout, settings = self.layout, context.scene.btf
        layout.use_property_split = True
        for name in ("samples", "viewport_samples", "mode", "depth", "backend"):
            layout.prop(settings, name)


class BTF_PT_light(_OfEngine, bpy.types.Panel):
    """The light of a lamp, as the engine takes it."""

    bl_label = "Light"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        return context.light is not None and super().poll(context)

    def draw(self, context):
        layout, light = self.layout, context.light
        layout.use_property_split = True
        layout.prop(light, "type")
        if light.type not in {"POINT", "SUN"}:
            layout.label(text="The engine BTF draws points and suns", icon="INFO")
            return
        for name in ("color", "energy", "exposure"):
            layout.prop(light, name)
        if light.type == "SUN":
            layout.prop(light, "angle")


CLASSES = (BTF_PT_material, BTF_PT_render, BTF_PT_light)

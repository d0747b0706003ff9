"""The render engine "BTF": meshes go out as glTF, `btf-view` draws them, the picture comes back."""

import weakref

import bpy
import numpy as np

from . import camera, lights, programs, scene_file, viewer
from .asset_file import AssetError
from .camera import CameraError
from .programs import ProgramError
from .viewer import Cancelled, Viewer, ViewerFault
from .viewport import ViewportPictures

_FAULTS = (AssetError, CameraError, ProgramError, ViewerFault)


def _flat(world, part):
    """Returns the picture of a scene without surfaces: the world's colour."""
    pixels = np.ones((part[3], part[2], 4), np.float32)
    pixels[..., :3] = world.radiance
    return pixels


def _redraw(engine):
    """Has an engine's viewport drawn again; raises ReferenceError where it is gone."""
    alive = engine()
    if alive is None:
        raise ReferenceError
    alive.tag_redraw()


class BtfRenderEngine(bpy.types.RenderEngine):
    """Draws what a BTF was measured to look like; materials without an asset are diffuse."""

    bl_idname = "BTF"
    bl_label = "BTF"
    bl_use_preview = False
    # Material preview is Eevee's, which draws the fitted textures.
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False

    #: Of the viewport: pictures in the making, and the folder of the scene that they show.
    _pictures = None
    _folder = None


    # The final picture.

    def render(self, depsgraph):
        """Draws the scene's camera. What is wrong is reported in one sentence."""
        try:
            self._render(depsgraph)
        except Cancelled:
            pass
        except _FAULTS as error:
            self.report({"ERROR"}, str(error))

    def _render(self, depsgraph):
        settings = depsgraph.scene.btf
        view = camera.of_render(depsgraph)
        lamps, left_out = lights.lamps(depsgraph)
        with viewer.scene_folder() as folder:
            self.update_stats("BTF", "writing the scene")
            exported = scene_file.write(depsgraph, folder)
            for sentence in left_out + exported.left_out:
                self.report({"WARNING"}, sentence)
            if exported.path is None:
                pixels = _flat(exported.world, view.part)
            else:
                request = viewer.request_of(exported, view, lamps, settings, settings.samples)
                pixels = viewer.cut(self._draw(request, settings.backend), view.part)
        self._show(pixels, depsgraph.view_layer.name)

    def _draw(self, request, backend):
        process = Viewer(programs.find("btf-view"), backend)
        try:
            self.update_stats("BTF", "uploading the scene")
            return process.draw(request, self._told, self.test_break)
        finally:
            process.close()

    def _told(self, kind, value):
        if kind == "progress":
            self.update_progress(value)
            self.update_stats("BTF", f"{100.0 * value:.0f} %")
        elif kind == "note":
            self.report({"INFO"}, value)

    def _show(self, pixels, layer):
        height, width = pixels.shape[:2]
        # Places are counted from the corner of the border.
        result = self.begin_result(0, 0, width, height, layer=layer)
        result.layers[0].passes["Combined"].rect.foreach_set(pixels.reshape(-1))
        self.end_result(result)

    # The viewport.

    def view_update(self, context, depsgraph):
        """Writes the scene again, which has changed."""
        if self._pictures is None:
            # The thread must not keep the engine, with which it ends: Blender takes the object apart before a __del__ could
            # end the thread.
            engine = weakref.ref(self)
            self._pictures, self._folder = ViewportPictures(lambda: _redraw(engine)), viewer.scene_folder()
            weakref.finalize(self, self._pictures.close)
            self._exported, self._texture, self._sentence = None, None, ""
        try:
            self._exported = scene_file.write(depsgraph, self._folder.name)
            self._lamps, left_out = lights.lamps(depsgraph)
            self._middle = camera.middle_of(depsgraph)
            self._sentence = "; ".join(left_out + self._exported.left_out)
        except _FAULTS as error:
            self._exported, self._sentence = None, str(error)
        if self._exported is None or self._exported.path is None:
            self._pictures.forget()

    def view_draw(self, context, depsgraph):
        """Asks for a picture of the view, and draws the newest one that there is."""
        region = context.region
        size = (region.width, region.height)
        sentence = self._ask(context, depsgraph, size) or self._pictures.sentence or self._sentence
        self.update_stats("BTF", sentence)
        if self._pictures.picture is not None:
            self._draw_texture(depsgraph.scene, self._pictures.picture, size)

    def _ask(self, context, depsgraph, size):
        """Asks for the view of a region. Returns a sentence where that cannot be drawn."""
        if self._exported is None or self._exported.path is None:
            return ""
        region_view = context.region_data
        try:
            view = camera.of_projection(region_view.window_matrix, region_view.view_matrix.inverted(), size, self._middle)
            program = programs.find("btf-view")
        except (CameraError, ProgramError) as error:
            return str(error)
        settings = depsgraph.scene.btf
        request = viewer.request_of(self._exported, view, self._lamps, settings, 1)
        self._pictures.ask(request, view, program, settings.backend, settings.viewport_samples)
        return ""

    def _draw_texture(self, scene, picture, size):
        import gpu
        from gpu_extras.presets import draw_texture_2d

        if self._texture is None or self._texture[0] is not picture:
            height, width = picture.shape[:2]
            buffer = gpu.types.Buffer("FLOAT", width * height * 4, picture.reshape(-1))
            self._texture = (picture, gpu.types.GPUTexture((width, height), format="RGBA16F", data=buffer))
        gpu.state.blend_set("ALPHA_PREMULT")
        self.bind_display_space_shader(scene)
        draw_texture_2d(self._texture[1], (0, 0), *size)
        self.unbind_display_space_shader()
        gpu.state.blend_set("NONE")


CLASSES = (BtfRenderEngine,)

#: Panels of engines that ours has no use for, although those of Blender Render in general are shown.
_WITHOUT = {"VIEWLAYER_PT_filter", "VIEWLAYER_PT_layer_passes", "RENDER_PT_eevee_next_film"}


def _shared_panels():
    """Returns the panels of Blender that every engine has."""
    kinds = bpy.types.Panel.__subclasses__()
    shared = [kind for kind in kinds if "BLENDER_RENDER" in getattr(kind, "COMPAT_ENGINES", ())]
    return [kind for kind in shared if kind.__name__ not in _WITHOUT]


def register():
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.add(BtfRenderEngine.bl_idname)


def unregister():
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.discard(BtfRenderEngine.bl_idname)

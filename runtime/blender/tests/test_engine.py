"""The engine BTF: its pictures are those of `btf-view`, and of Cycles where a surface is diffuse."""

import json
import math
import subprocess
import threading
import unittest
from pathlib import Path

import bpy
import numpy as np
from scene import ASSET, VIEW, Scene, part, read_picture

from fallback_psnr import codes  # isort: skip
from pictures import look_from  # isort: skip


class AgainstBtfView(Scene):
    """The scene reaches `btf-view` by hands that share nothing with the add-on: Blender's own exporter, and numbers."""

    def picture_of_btf_view(self, camera, lamp, repeats):
        mesh = self.folder / "sphere.glb"
        bpy.ops.export_scene.gltf(
            filepath=str(mesh), export_materials="NONE", export_cameras=False, export_lights=False, export_yup=True
        )
        eye, place = (self.y_up(point) for point in (camera, lamp))
        # 50 mm on a film of 36 x 24 mm, whose shorter side counts.
        fov_deg = 2.0 * math.degrees(math.atan(12.0 / 50.0))
        scene = self.folder / "by_hand.toml"
        scene.write_text(
            f"background = [0, 0, 0]\n[camera]\neye = {eye}\ntarget = [0, 0, 0]\nfov_deg = {fov_deg}\n"
            f"[[material]]\nname = 'weave'\nasset = {json.dumps(ASSET)}\nuv_scale = {list(repeats)}\n"
            f"[[object]]\nmesh = {json.dumps(str(mesh))}\nmaterial = 'weave'\n"
            f"[[light]]\nposition = {place}\nintensity = {[500.0 / (4.0 * math.pi)] * 3}\n"
        )
        out = self.folder / "by_hand.exr"
        command = [VIEW, "--scene", scene, "--headless", "--out", out, "--size", "96x64", "--backend", "cpu", "--quiet"]
        subprocess.run(command, check=True)
        return read_picture(out)

    @staticmethod
    def y_up(point):
        return [point[0], point[2], -point[1]]

    def test_a_sphere_under_a_lamp_is_the_same(self):
        repeats, lamp = (8.0, 4.0), (3.0, -2.0, 4.0)
        self.sphere().data.materials.append(self.asset_material(repeats))
        self.lamp(place=lamp)
        ours = codes(self.rendered())
        expected = self.picture_of_btf_view(self.camera.location, lamp, repeats)
        difference = np.abs(ours - codes(expected))
        # Between two texels a last bit decides which is the nearest.
        share = float(np.mean(difference > 1.0))
        print(f"BTF in Blender and btf-view: {share:.4%} of the channels differ by more than 1/255")
        self.assertLess(share, 0.001)
        self.assertGreater(float(np.mean(ours > 20.0)), 0.05)
        # The comparison sees a lamp that stands a little elsewhere, and another size of the weave.
        moved = self.picture_of_btf_view(self.camera.location, (3.1, -2.0, 4.0), repeats)
        larger = self.picture_of_btf_view(self.camera.location, lamp, (7.0, 4.0))
        for other in (moved, larger):
            self.assertGreater(float(np.mean(np.abs(ours - codes(other)) > 1.0)), 0.01)


class AgainstCycles(Scene):
    """A diffuse ellipsoid, which both engines draw alike: units of light, the camera's frame and the world's axes."""

    def setUp(self):
        super().setUp()
        self.sphere().data.materials.append(self.diffuse_material())

    def difference(self, samples=64):
        """Returns the mean difference of the engines' pictures, relative to the mean of Cycles'."""
        expected, ours = self.rendered("CYCLES", samples), self.rendered("BTF", samples)
        self.assertEqual(expected.shape, ours.shape)
        self.assertGreater(float(expected.mean()), 1e-3)
        return float(np.abs(expected - ours).mean() / expected.mean())

    def test_lamps_have_cycles_power(self):
        lamp = self.lamp()
        light = lamp.data
        light.color = (1.0, 0.5, 0.3)
        self.assertLess(self.difference(), 0.006)
        light.exposure, light.use_temperature, light.temperature = 0.5, True, 3000.0
        self.assertLess(self.difference(), 0.006)
        # One percent more light is seen.
        expected = self.rendered("CYCLES", 64)
        light.energy *= 1.02
        self.assertGreater(float(np.abs(expected - self.rendered("BTF", 64)).mean() / expected.mean()), 0.015)

    def test_several_suns_and_a_world_of_one_colour(self):
        sun = self.lamp("SUN", (2.0, -1.0, 3.0), 3.0)
        sun.data.angle = 0.1
        self.lamp("SUN", (2.0, 3.0, 1.0), 2.0).data.color = (0.0, 0.0, 1.0)
        self.assertLess(self.difference(), 0.012)
        for lamp in [obj for obj in bpy.data.objects if obj.type == "LIGHT"]:
            bpy.data.objects.remove(lamp)
        self.set_world((1.0, 0.5, 0.2), 0.7)
        self.assertLess(self.difference(), 0.006)

    def test_every_frame_of_the_camera(self):
        self.lamp()
        camera, render = self.camera.data, self.scene.render
        camera.shift_x, camera.shift_y = 0.25, -0.125
        self.assertLess(self.difference(), 0.006)
        camera.shift_x, camera.shift_y, camera.sensor_fit = 0.0, 0.0, "VERTICAL"
        render.resolution_x, render.resolution_y = 64, 96
        self.assertLess(self.difference(), 0.006)
        render.use_border = True
        render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.75, 0.5, 1.0
        self.assertLess(self.difference(), 0.006)
        render.use_crop_to_border = True
        self.assertLess(self.difference(), 0.006)
        render.use_border, camera.type, camera.ortho_scale = False, "ORTHO", 4.0
        self.assertLess(self.difference(), 0.006)
        camera.ortho_scale = 4.05
        wrong = self.rendered("CYCLES", 64)
        camera.ortho_scale = 4.0
        self.assertGreater(float(np.abs(wrong - self.rendered("BTF", 64)).mean() / wrong.mean()), 0.01)

    def test_a_world_picture_lies_as_in_cycles(self):
        image = bpy.data.images.new("sky", 64, 32, float_buffer=True, is_data=True)
        image.colorspace_settings.name = "Linear Rec.709"
        pixels = np.full((32, 64, 4), 0.05, np.float32)
        pixels[18:24, 5:12, :3], pixels[6:12, 40:50, 2] = (20.0, 5.0, 1.0), 10.0
        image.pixels.foreach_set(pixels.ravel())
        image.filepath_raw, image.file_format = str(self.folder / "sky.exr"), "OPEN_EXR"
        image.save()
        background, nodes = self.set_world((0.0, 0.0, 0.0), 1.5), self.scene.world.node_tree.nodes
        links = self.scene.world.node_tree.links
        picture = nodes.new("ShaderNodeTexEnvironment")
        picture.image, picture.interpolation = bpy.data.images.load(image.filepath_raw), "Closest"
        picture.image.colorspace_settings.name = "Linear Rec.709"
        links.new(picture.outputs[0], background.inputs["Color"])
        self.assertLess(self.difference(128), 0.02)
        mapping, coordinates = nodes.new("ShaderNodeMapping"), nodes.new("ShaderNodeTexCoord")
        links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
        links.new(mapping.outputs[0], picture.inputs["Vector"])
        mapping.inputs["Rotation"].default_value[2] = math.radians(90.0)
        turned = self.rendered("BTF", 128)
        self.assertLess(self.difference(128), 0.02)
        picture.image.pack()
        self.assertTrue(np.array_equal(self.rendered("BTF", 128), turned))
        mapping.inputs["Rotation"].default_value[2] = math.radians(-90.0)
        other = self.rendered("CYCLES", 128)
        self.assertGreater(float(np.abs(other - turned).mean() / other.mean()), 0.05)

    def test_instances_and_modifiers_are_drawn(self):
        self.lamp()
        parent = bpy.context.active_object
        parent.scale = (0.3, 0.3, 0.3)
        array = parent.modifiers.new("array", "ARRAY")
        array.count, array.relative_offset_displace = 2, (1.2, 0.0, 0.0)
        collection = bpy.data.collections.new("group")
        collection.objects.link(parent)
        empty = bpy.data.objects.new("instance", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
        empty.location, empty.scale = (0.0, 0.0, 1.0), (1.0, -1.0, 1.0)
        self.scene.collection.objects.link(empty)
        self.assertLess(self.difference(), 0.008)

    def test_text_and_a_slot_that_no_face_has(self):
        self.lamp()
        body = bpy.context.active_object
        body.location.z = -1.0
        # An asset that is not there matters to faces alone that show it.
        unused = self.asset_material((1.0, 1.0))
        unused.btf.path = str(self.folder / "gone.spmm")
        body.data.materials.clear()
        body.data.materials.append(unused)
        body.data.materials.append(self.diffuse_material())
        for polygon in body.data.polygons:
            polygon.material_index = 1
        bpy.ops.object.text_add()
        text = bpy.context.active_object
        text.data.body, text.data.extrude = "BTF", 0.1
        look_from(text, self.camera.location)
        text.location = (0.0, 0.0, 0.5)
        text.data.materials.append(self.diffuse_material())
        self.assertLess(self.difference(), 0.01)

    def test_instances_of_geometry_nodes_have_their_own_mesh(self):
        self.lamp()
        owner = bpy.context.active_object
        owner.scale = (0.4, 0.4, 0.4)
        group = bpy.data.node_groups.new("cubes", "GeometryNodeTree")
        group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
        group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
        kinds = ("NodeGroupInput", "GeometryNodeMeshCube", "GeometryNodeInstanceOnPoints", "GeometryNodeMeshLine")
        into, cube, instances, line = (group.nodes.new(kind) for kind in kinds)
        dress = group.nodes.new("GeometryNodeSetMaterial")
        dress.inputs["Material"].default_value = bpy.data.materials.new("white")
        dress.inputs["Material"].default_value.node_tree.nodes["Principled BSDF"].inputs["Specular IOR Level"].default_value = 0.0
        join, out = group.nodes.new("GeometryNodeJoinGeometry"), group.nodes.new("NodeGroupOutput")
        line.inputs["Count"].default_value = 3
        line.inputs["Offset"].default_value = (0.0, 0.0, 1.5)
        group.links.new(line.outputs[0], instances.inputs["Points"])
        group.links.new(cube.outputs[0], dress.inputs["Geometry"])
        group.links.new(dress.outputs[0], instances.inputs["Instance"])
        group.links.new(into.outputs[0], join.inputs[0])
        group.links.new(instances.outputs[0], join.inputs[0])
        group.links.new(join.outputs[0], out.inputs[0])
        owner.modifiers.new("nodes", "NODES").node_group = group
        self.assertLess(self.difference(), 0.01)


class Faults(Scene):
    def refusal(self):
        """Renders and returns the one sentence that Blender reports."""
        with self.assertRaises(RuntimeError) as caught:
            bpy.ops.render.render()
        sentence = str(caught.exception).strip()
        self.assertNotIn("Traceback", sentence)
        return sentence

    def test_what_is_wrong_is_one_sentence(self):
        obj = self.sphere()
        material = self.asset_material((1.0, 1.0))
        obj.data.materials.append(material)
        obj.data.uv_layers.remove(obj.data.uv_layers[0])
        self.assertIn("has no UV map", self.refusal())
        material.btf.path = str(self.folder / "gone.spmm")
        obj.data.uv_layers.new()
        self.assertRegex(self.refusal(), "gone.spmm is not there: choose the .spmm file again")
        damaged = self.folder / "damaged.spmm"
        damaged.write_bytes(Path(ASSET).read_bytes()[:3000])
        material.btf.path = str(damaged)
        self.assertIn("damaged.spmm", self.refusal())
        self.scene.camera = None
        # Blender itself says so.
        self.assertIn("camera", self.refusal().lower())

    def test_a_dark_picture_of_the_world_is_a_dark_world(self):
        background = self.set_world((0.0, 0.0, 0.0), 0.0)
        nodes, links = self.scene.world.node_tree.nodes, self.scene.world.node_tree.links
        links.new(nodes.new("ShaderNodeTexEnvironment").outputs[0], background.inputs["Color"])
        self.sphere().data.materials.append(self.diffuse_material())
        self.assertEqual(float(self.rendered().max()), 0.0)

    def test_a_program_that_is_missing_is_named(self):
        self.sphere().data.materials.append(self.asset_material((1.0, 1.0)))
        preferences = bpy.context.preferences.addons["bl_ext.user_default.btf_materials"].preferences
        preferences.btf_view = str(self.folder / "no-such-program")
        self.assertIn("no-such-program is not there", self.refusal())

    def test_a_scene_without_surfaces_is_the_world(self):
        self.set_world((0.1, 0.2, 0.3), 1.0)
        picture = self.rendered()
        self.assertTrue(np.allclose(picture, (0.1, 0.2, 0.3), atol=1e-6))


class Viewport(Scene):
    """What the viewport does but for the drawing of the texture, which needs a window."""

    def setUp(self):
        super().setUp()
        self.sphere().data.materials.append(self.asset_material((8.0, 4.0)))
        self.lamp()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        self.exported = part("scene_file").write(depsgraph, str(self.folder))
        self.lamps, _ = part("lights").lamps(depsgraph)
        self.ready = threading.Event()
        self.pictures = part("viewport").ViewportPictures(self.ready.set)
        self.addCleanup(self.pictures.close)

    def ask(self, samples=1, scene=None):
        camera = part("camera")
        view = camera.of_render(bpy.context.evaluated_depsgraph_get())
        request = part("viewer").request_of(self.exported, view, self.lamps, self.scene.btf, 1)
        self.ready.clear()
        self.pictures.ask({**request, "scene": scene or request["scene"]}, view, part("programs").find("btf-view"), "cpu", samples)

    def wait(self, until):
        for _ in range(600):
            self.ready.wait(0.1)
            self.ready.clear()
            if until():
                return
        self.fail(f"no picture came: {self.pictures.sentence}")

    def test_the_picture_is_that_of_the_final_rendering(self):
        self.ask()
        self.wait(lambda: self.pictures.picture is not None)
        self.assertTrue(np.allclose(self.pictures.picture[..., :3], self.rendered(), atol=1e-5))
        first = self.pictures.picture
        look_from(self.camera, (3.0, 4.0, 1.0))
        bpy.context.view_layer.update()
        self.ask(samples=16)
        self.wait(lambda: self.pictures.picture is not first)
        second = self.pictures.picture
        self.assertGreater(float(np.abs(second - first).mean()), 0.01)
        # It gets more samples while nothing moves.
        self.wait(lambda: self.pictures.picture is not second)

    def test_an_object_that_moves_is_another_picture(self):
        self.ask()
        self.wait(lambda: self.pictures.picture is not None)
        first = self.pictures.picture
        bpy.context.active_object.location.x += 0.5
        depsgraph = bpy.context.evaluated_depsgraph_get()
        self.exported = part("scene_file").write(depsgraph, str(self.folder))
        self.ask()
        self.wait(lambda: self.pictures.picture is not first)
        self.assertGreater(float(np.abs(self.pictures.picture - first).mean()), 0.01)
        # However often it moves, the folder does not grow.
        for step in range(10):
            bpy.context.active_object.location.x = 0.1 * step
            part("scene_file").write(bpy.context.evaluated_depsgraph_get(), str(self.folder))
        names = [path.name for path in self.folder.iterdir()]
        self.assertEqual(sum(name.startswith("meshes_") for name in names), 4, names)
        self.pictures.forget()
        self.assertIsNone(self.pictures.picture)

    def test_a_fault_is_told_and_the_next_picture_comes(self):
        self.ask(scene=str(self.folder / "none.toml"))
        self.wait(lambda: "none.toml" in self.pictures.sentence)
        self.ask()
        self.wait(lambda: self.pictures.picture is not None and not self.pictures.sentence)
        # A process that was killed is started again.
        self.pictures._viewer._process.kill()
        self.pictures._viewer._process.wait()
        look_from(self.camera, (3.0, 4.0, 1.5))
        bpy.context.view_layer.update()
        old = self.pictures.picture
        self.ask()
        self.wait(lambda: self.pictures.picture is not old)


class Cancelling(Scene):
    def test_escape_ends_the_process(self):
        self.sphere().data.materials.append(self.asset_material((8.0, 4.0)))
        self.lamp()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        exported = part("scene_file").write(depsgraph, str(self.folder))
        viewer, view = part("viewer"), part("camera").of_render(depsgraph)
        process = viewer.Viewer(part("programs").find("btf-view"), "cpu")
        lamps, _ = part("lights").lamps(depsgraph)
        request = viewer.request_of(exported, view, lamps, self.scene.btf, 100_000)
        with self.assertRaises(viewer.Cancelled):
            process.draw(request, is_cancelled=lambda: True)
        self.assertFalse(process.is_running())


if __name__ == "__main__":
    unittest.main()

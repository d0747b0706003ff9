"""Import, the Principled fallback, physical size, displacement, bake, undo, saving and files that are missing."""

import math
import shutil
import struct
import subprocess
import tempfile
import unittest
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from scene import ASSET, FIT, SYNTH, Scene, part  # before btf, which comes with the extension

import btf  # isort: skip
import fallback_psnr  # isort: skip
from pictures import look_from  # isort: skip


def import_asset(path=ASSET, **settings):
    return bpy.ops.btf.import_asset(filepath=str(path), **{"fallback": "COLOUR", **settings})


def shows(material, path):
    return Path(bpy.path.abspath(material.btf.path)).samefile(path)


class Import(Scene):
    def test_an_asset_comes_on_a_plane_of_its_size(self):
        self.assertEqual(import_asset(), {"FINISHED"})
        obj = bpy.data.objects["weave"]
        self.assertTrue(np.allclose(obj.dimensions, (0.004, 0.004, 0.0), atol=1e-7))
        material = obj.active_material
        self.assertTrue(shows(material, ASSET))
        self.assertTrue(np.allclose(material.btf.repeats, 1.0, rtol=1e-4))
        scale = material.node_tree.nodes["BTF size"].inputs["Scale"].default_value
        self.assertTrue(np.allclose(scale, 1.0, rtol=1e-4))

    def test_on_a_mesh_it_has_its_size_where_the_uv_map_is_stretched(self):
        bpy.ops.mesh.primitive_plane_add(size=2.0)
        obj = bpy.context.active_object
        obj.scale = (3.0, 1.0, 1.0)
        bpy.context.view_layer.update()
        import_asset()
        # Six and two metres for a unit of u and v, and 4 mm an asset.
        self.assertTrue(np.allclose(obj.active_material.btf.repeats, (1500.0, 500.0), rtol=1e-4))
        obj.scale = (1.0, 1.0, 1.0)
        bpy.context.view_layer.update()
        self.assertEqual(bpy.ops.btf.physical_size(), {"FINISHED"})
        self.assertTrue(np.allclose(obj.active_material.btf.repeats, 500.0, rtol=1e-4))

    def test_an_asset_that_is_chosen_by_hand_has_its_size(self):
        material = bpy.data.materials.new("by hand")
        material.btf.path = ASSET
        self.assertTrue(np.allclose(material.btf.size_m, 0.004))
        material.btf.path = str(self.folder / "gone.spmm")
        self.assertEqual(tuple(material.btf.size_m), (0.0, 0.0))

    def test_a_name_with_a_quote_keeps_its_textures(self):
        document = self.folder / "John's & co.mtlx"
        texture = self.folder / "John's & co_base_color.png"
        texture.write_bytes(b"")
        document.write_text('<m><input value="John&apos;s &amp; co_base_color.png"/></m>')
        found = part("fitted_textures").textures_of(str(document))
        self.assertEqual(found, {"base_color": str(texture)})

    def test_undo_takes_all_of_it_back(self):
        bpy.ops.mesh.primitive_plane_add()
        bpy.ops.ed.undo_push(message="a plane")
        import_asset()
        bpy.ops.ed.undo_push(message="an asset")
        self.assertIn("weave", bpy.data.materials)
        bpy.ops.ed.undo()
        self.assertNotIn("weave", bpy.data.materials)
        self.assertIsNone(bpy.data.objects["Plane"].active_material)
        bpy.ops.ed.redo()
        self.assertTrue(shows(bpy.data.objects["Plane"].active_material, ASSET))

    def test_a_saved_file_comes_back_and_moves_with_its_asset(self):
        home = self.folder / "home"
        home.mkdir()
        asset = home / "cloth.spmm"
        shutil.copy(ASSET, asset)
        bpy.ops.wm.save_as_mainfile(filepath=str(home / "scene.blend"))
        import_asset(asset)
        self.assertEqual(bpy.data.materials["cloth"].btf.path, "//cloth.spmm")
        bpy.data.materials["cloth"].btf.repeats = (3.0, 2.0)
        self.lamp(place=(0.02, -0.01, 0.03), energy=0.05)
        look_from(self.camera, (0.004, -0.006, 0.01))
        self.camera.data.clip_start = 1e-4
        before = self.rendered()
        self.assertGreater(float(before.max()), 0.05)
        self.scene.render.filepath = ""
        bpy.ops.wm.save_mainfile()
        moved = self.folder / "moved"
        home.rename(moved)
        bpy.ops.wm.open_mainfile(filepath=str(moved / "scene.blend"))
        self.scene = bpy.context.scene
        material = bpy.data.materials["cloth"]
        self.assertEqual(tuple(material.btf.repeats), (3.0, 2.0))
        self.assertTrue(np.array_equal(self.rendered(), before))
        (moved / "cloth.spmm").unlink()
        with self.assertRaisesRegex(RuntimeError, "cloth.spmm is not there"):
            bpy.ops.render.render()

    def test_what_is_no_asset_is_refused_and_nothing_is_left(self):
        empty, cut = self.folder / "empty.spmm", self.folder / "cut.spmm"
        empty.write_bytes(b"")
        cut.write_bytes(Path(ASSET).read_bytes()[:3000])
        for path, words in (
            (empty, "is no packed asset"),
            (cut, "cut.spmm"),
            (self.folder / "gone.spmm", "is not there"),
        ):
            with self.assertRaisesRegex(RuntimeError, words):
                import_asset(path)
        self.assertEqual((len(bpy.data.materials), len(bpy.data.meshes)), (0, 0))


class Fallback(Scene):
    """The Principled material is drawn by Cycles at the texels of a plane, from the directions of the asset."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.textures = cls.enterClassContext(tempfile.TemporaryDirectory())

    def test_its_values_are_near_those_of_the_asset(self):
        asset_path = Path(self.textures) / "weave.spmm"
        shutil.copy(ASSET, asset_path)
        self.assertEqual(import_asset(asset_path, fallback="OPENPBR"), {"FINISHED"})
        obj = bpy.data.objects["weave"]
        material = obj.active_material
        told = material.btf.psnr_db
        self.assertGreater(told, 15.0)
        written = {path.name: path.stat().st_mtime_ns for path in Path(self.textures).iterdir()}
        fitted = fallback_psnr.psnr_db(ASSET, obj)
        print(f"Principled: {fitted:.2f} dB against the asset; OpenPBR as fitted: {told:.2f} dB at its own pairs")
        flat = part("import_asset").make_material(str(asset_path), {})
        obj.active_material = flat
        plain = fallback_psnr.psnr_db(ASSET, obj)
        print(f"one colour: {plain:.2f} dB")
        self.assertGreater(fitted, told - 1.5)
        self.assertGreater(fitted, plain + 1.0)
        # A second import takes the textures that are there.
        import_asset(asset_path, fallback="OPENPBR")
        again = {path.name: path.stat().st_mtime_ns for path in Path(self.textures).iterdir()}
        self.assertEqual(written, again)


class Heights(Scene):
    """An asset with heights, fitted to a capture that is made here."""

    def test_heights_displace_in_metres_and_follow_the_settings(self):
        capture, asset_path, rings = (self.folder / name for name in ("capture", "relief.spmm", "rings.txt"))
        directions = [(theta, 360.0 * i / n) for theta, n in ((0, 1), (30, 8), (60, 14), (75, 16)) for i in range(n)]
        rings.write_text("".join(f"{theta} {phi}\n" for theta, phi in directions))
        make = [SYNTH, "cloth", capture, "--size", "48", "--size-mm", "4", "--directions", rings]
        subprocess.run(make, check=True, capture_output=True)
        fit = [FIT, "fit", capture, "-o", asset_path, "--heights", "--components", "2", "--lobes", "1", "--clusters", "2"]
        subprocess.run(fit, check=True, capture_output=True)
        heights = btf.open(str(asset_path)).heights()
        self.assertEqual(heights.shape, (48, 48))
        import_asset(asset_path)
        material = bpy.data.materials["relief"]
        settings, nodes = material.btf, material.node_tree.nodes
        self.assertTrue(settings.has_heights)
        settings.displacement = 0.5
        self.assertEqual(nodes["BTF heights"].inputs["Scale"].default_value, 0.5)
        image = bpy.data.images["relief heights"]
        pixels = np.empty(48 * 48 * 4, np.float32)
        image.pixels.foreach_get(pixels)
        metres = pixels.reshape(48, 48, 4)[::-1, :, 0]
        self.assertTrue(np.allclose(metres, heights * settings.size_m[0] / 48.0, atol=1e-9))
        self.assertGreater(float(np.ptp(metres)), 1e-6)
        self.assertIsNotNone(image.packed_file)
        # The engine draws the relief, too.
        exported = part("scene_file").write(bpy.context.evaluated_depsgraph_get(), str(self.folder))
        self.assertIn("displacement = 0.5", Path(exported.path).read_text())


class Bake(Scene):
    def plane(self):
        bpy.ops.mesh.primitive_plane_add(size=2.0)
        obj = bpy.context.active_object
        obj.data.materials.append(self.asset_material((3.0, 2.0)))
        obj.rotation_euler = (0.2, -0.3, 0.4)
        bpy.context.view_layer.update()
        return obj

    def baked(self, size=32):
        self.assertEqual(bpy.ops.btf.bake_here(size=size), {"FINISHED"})
        image = next(image for image in bpy.data.images if image.name.endswith("baked"))
        pixels = np.empty(size * size * 4, np.float32)
        image.pixels.foreach_get(pixels)
        return pixels.reshape(size, size, 4)

    def expected(self, obj, size, lamp):
        """Returns what the asset gives at the middles of the pixels of a plane, by formulas of its own."""
        frame = np.array(obj.matrix_world.to_3x3())
        u = (np.arange(size) + 0.5) / size
        uv = np.stack(np.meshgrid(u, u), -1)
        places = np.concatenate([2.0 * uv - 1.0, np.zeros((size, size, 1))], -1) @ frame.T
        to_lamp, to_eye = np.array(lamp) - places, np.array(self.camera.location) - places
        distance = np.linalg.norm(to_lamp, axis=-1, keepdims=True)
        wi = to_lamp / distance @ frame
        wo = to_eye / np.linalg.norm(to_eye, axis=-1, keepdims=True) @ frame
        intensity = 500.0 / (4.0 * math.pi)
        return btf.open(ASSET).eval(uv * [3.0, 2.0], wi, wo) / math.pi * intensity / distance**2

    def test_it_is_the_asset_seen_from_the_camera(self):
        obj, lamp = self.plane(), (3.0, -2.0, 4.0)
        self.lamp(place=lamp)
        baked, expected = self.baked(), self.expected(obj, 32, lamp)
        self.assertTrue((baked[..., 3] == 1.0).all())
        # A last bit decides at the borders of texels.
        wrong = np.abs(baked[..., :3] - expected).max(axis=-1) > 1e-3
        self.assertLess(float(wrong.mean()), 0.01)
        self.assertGreater(float(expected.mean()), 0.05)
        moved = self.expected(obj, 32, (3.0, -1.8, 4.0))
        self.assertGreater(float((np.abs(baked[..., :3] - moved).max(axis=-1) > 1e-3).mean()), 0.5)

    def test_a_mirrored_plane_is_lit_from_its_front(self):
        obj, lamp = self.plane(), (3.0, -2.0, 4.0)
        obj.scale.x = -1.0
        bpy.context.view_layer.update()
        self.lamp(place=lamp)
        wrong = np.abs(self.baked()[..., :3] - self.expected(obj, 32, lamp)).max(axis=-1) > 1e-3
        self.assertLess(float(wrong.mean()), 0.01)

    def test_what_stands_in_the_light_throws_a_shadow(self):
        obj = self.plane()
        lamp = self.lamp("SUN", (0.5, -0.2, 1.0), math.pi)
        free = self.baked()
        bpy.ops.mesh.primitive_plane_add(size=0.6, location=tuple(0.5 * Vector(lamp.location)))
        bpy.context.view_layer.objects.active = obj
        shaded = self.baked()
        dark = (shaded[..., :3].max(axis=-1) == 0.0) & (free[..., :3].max(axis=-1) > 0.0)
        self.assertTrue(0.03 < float(dark.mean()) < 0.3, float(dark.mean()))
        lit = ~dark
        self.assertTrue(np.array_equal(shaded[lit], free[lit]))


class AssetFile(Scene):
    def test_the_checksum_is_that_of_the_header(self):
        low, high = struct.unpack_from("<II", Path(ASSET).read_bytes(), 48)
        self.assertEqual(part("asset_file").checksum_of(ASSET), f"{(high << 32) | low:016x}")


if __name__ == "__main__":
    unittest.main()

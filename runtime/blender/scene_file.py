"""Writes what an evaluated scene shows as files for `btf-view`: a mesh file and a scene file that gives it its materials."""

import json
import os
import struct

from . import lights, mesh_arrays, named_files
from .asset_file import AssetError, absolute_path
from .camera import has_surface
from .mesh_file import MeshFile

_NO_MATERIAL = (0.8, 0.8, 0.8)
#: Scenes of which a picture may still be in the making.
_KEPT = 4


class Exported:
    """The files, and what was left out."""

    def __init__(self, path, world, left_out):
        #: Path of the scene file; None where the scene has no surface.
        self.path = path
        self.world = world
        #: Sentences about what is not drawn as in Blender.
        self.left_out = left_out


def _diffuse_colour(material):
    """Returns the colour of a material that shows no asset, linear RGB: it is drawn as a diffuse surface."""
    if material is None:
        return _NO_MATERIAL
    tree = material.node_tree
    nodes = tree.nodes if tree else []
    shader = next((node for node in nodes if node.bl_idname == "ShaderNodeBsdfPrincipled"), None)
    if shader is not None and not shader.inputs["Base Color"].is_linked:
        return tuple(shader.inputs["Base Color"].default_value[:3])
    return tuple(material.diffuse_color[:3])


class _Materials:
    """Materials of the scene, numbered as in the mesh file."""

    def __init__(self, file):
        self._file, self._numbers, self.entries = file, {}, []

    def number(self, material):
        """Returns the number of a material of Blender's, or None."""
        original = material.original if material is not None else None
        key = original.session_uid if original is not None else 0
        if key not in self._numbers:
            name = f"m{len(self._numbers)}"
            self._numbers[key] = self._file.add_material(name, _diffuse_colour(original))
            if original is not None and original.btf.path:
                self.entries.append((name, original))
        return self._numbers[key]

    def shows_asset(self, material):
        return material is not None and bool(material.original.btf.path)

    def toml(self):
        """Returns the tables of materials that show assets, and the names of their parts.

        Raises AssetError for an asset that is not there.
        """
        tables, parts = [], []
        for name, material in self.entries:
            settings = material.btf
            try:
                asset = absolute_path(settings.path)
            except AssetError as error:
                raise AssetError(f"{material.name}: {error}") from error
            tables += [_written_at(asset), "[[material]]"]
            tables += [f"name = {_text(name)}", f"asset = {_text(asset)}"]
            tables.append(f"uv_scale = [{settings.repeats[0]!r}, {settings.repeats[1]!r}]")
            if settings.has_heights and settings.displacement > 0.0 and min(settings.repeats) > 0.0:
                tables.append(f"displacement = {settings.displacement!r}")
            parts.append(f"{name} = {_text(name)}")
        return tables, parts


def _text(value):
    """Returns a string as TOML has it, which is as JSON has it but for what lies beyond 16 bits."""
    return json.dumps(value, ensure_ascii=False)


def _written_at(path):
    """Returns a comment with a file's time: another time makes another scene, which is read again."""
    return f"# written at {os.stat(path).st_mtime_ns}"


def _add_surfaces(depsgraph, file, materials):
    """Adds all surfaces that a picture shows."""
    meshes = {}
    for instance in depsgraph.object_instances:
        obj = instance.object
        if not has_surface(obj) or not instance.show_self or abs(instance.matrix_world.determinant()) < 1e-18:
            continue
        # Instances of geometry nodes are their owner with other data.
        key = (obj.original.session_uid, obj.data.as_pointer())
        if key not in meshes:
            meshes[key] = _add_mesh(obj, depsgraph, file, materials)
        if meshes[key] is not None:
            file.place(meshes[key], instance.matrix_world)


def _materials_of(obj, depsgraph):
    """Returns the materials of an evaluated object's slots; those of an instance of geometry nodes are its mesh's."""
    owner = obj.original.evaluated_get(depsgraph)
    if obj.data.as_pointer() != owner.data.as_pointer():
        return list(obj.data.materials)
    return [slot.material for slot in obj.material_slots]


def _add_mesh(obj, depsgraph, file, materials):
    """Adds the mesh of an evaluated object. Returns its number, or None where it has no triangle.

    Raises AssetError for an asset on a mesh without a UV map.
    """
    mesh = obj.to_mesh()
    if mesh is None:
        return None
    try:
        arrays = mesh_arrays.read(mesh)
        if arrays is None:
            return None
        slots = _materials_of(obj, depsgraph)
        material_of = lambda slot: slots[min(slot, len(slots) - 1)] if slots else None
        if arrays.uvs is None and any(materials.shows_asset(material_of(slot)) for slot in set(arrays.slots.tolist())):
            raise AssetError(f"{obj.name} has no UV map, so it cannot show an asset: unwrap it")
        return file.add_mesh(arrays, lambda slot: materials.number(material_of(slot)))
    finally:
        obj.to_mesh_clear()


def write(depsgraph, folder):
    """Writes the files into `folder`; each has a name that tells its contents.

    Raises AssetError for assets that cannot be shown, and where the files cannot be written.
    """
    file = MeshFile()
    materials = _Materials(file)
    _add_surfaces(depsgraph, file, materials)
    try:
        world = lights.world_of(depsgraph.scene.world, folder)
        if file.is_empty():
            return Exported(None, world, world.left_out)
        return _written(file, materials, world, folder)
    except (OSError, struct.error, UnicodeError) as error:
        raise AssetError(f"the scene cannot be written into {folder} ({error}): make room there") from error


def _written(file, materials, world, folder):
    """Writes the two files. Names tell contents, so that a picture of an earlier scene may still be in the making."""
    name = named_files.write(folder, "meshes", ".glb", file.encoded())
    tables, parts = materials.toml()
    lines = ["[[object]]", f"mesh = {_text(name)}", f"parts = {{ {', '.join(parts)} }}"]
    if world.picture:
        lines += [_written_at(world.picture), "[environment]", f"file = {_text(world.picture)}"]
        lines += [f"gain = {world.gain!r}", f"turn_deg = {world.turn_deg!r}"]
    scene = named_files.write(folder, "scene", ".toml", "\n".join([*tables, *lines, ""]).encode())
    for kind in ("scene", "meshes"):
        named_files.remove_old(folder, kind, _KEPT)
    return Exported(os.path.join(folder, scene), world, world.left_out)

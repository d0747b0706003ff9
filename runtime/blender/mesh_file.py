"""Writes binary glTF with numpy.

Blender's own exporter is an operator, which a render engine cannot call while it draws.
"""

import json
import struct

import numpy as np

from .axes import Y_UP

_FLOAT, _UNSIGNED = 5126, 5125
_VERTICES, _INDICES = 34962, 34963


class MeshFile:
    """Meshes, each at one or more places, and the colours of their materials."""

    def __init__(self):
        self._bytes = bytearray()
        self._document = {
            "asset": {"version": "2.0", "generator": "btf_materials"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "meshes": [],
            "materials": [],
            "accessors": [],
            "bufferViews": [],
        }

    def add_material(self, name, colour):
        """Adds a diffuse material, linear RGB. Returns its number."""
        shade = {"baseColorFactor": [*colour, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0}
        self._document["materials"].append({"name": name, "pbrMetallicRoughness": shade})
        return len(self._document["materials"]) - 1

    def add_mesh(self, arrays, material_of_slot):
        """Adds a mesh, z up, with a part for each material. Returns its number."""
        x, y, z = arrays.positions.T
        attributes = {"POSITION": self._vectors(np.stack([x, z, -y], -1), bounds=True)}
        x, y, z = arrays.normals.T
        attributes["NORMAL"] = self._vectors(np.stack([x, z, -y], -1))
        if arrays.uvs is not None:
            u, v = arrays.uvs.T
            attributes["TEXCOORD_0"] = self._vectors(np.stack([u, 1.0 - v], -1))
        # Of those slots alone that are seen: what none has need not be there.
        slots, places = np.unique(arrays.slots, return_inverse=True)
        of_triangle = np.array([material_of_slot(int(slot)) for slot in slots])[places]
        parts = []
        for material in np.unique(of_triangle):
            indices = self._accessor(arrays.triangles[of_triangle == material].ravel(), _UNSIGNED, "SCALAR", _INDICES)
            parts.append({"attributes": attributes, "indices": indices, "material": int(material)})
        self._document["meshes"].append({"primitives": parts})
        return len(self._document["meshes"]) - 1

    def place(self, mesh, matrix):
        """Puts a mesh into the scene by a matrix of Blender's."""
        turned = Y_UP @ matrix @ Y_UP.inverted()
        columns = [turned[row][column] for column in range(4) for row in range(4)]
        self._document["scenes"][0]["nodes"].append(len(self._document["nodes"]))
        self._document["nodes"].append({"mesh": mesh, "matrix": columns})

    def is_empty(self):
        return not self._document["nodes"]

    def encoded(self):
        """Returns the file's bytes."""
        self._document["buffers"] = [{"byteLength": len(self._bytes)}]
        text = json.dumps(self._document).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self._bytes)
        length = 12 + 8 + len(text) + 8 + len(data)
        head = struct.pack("<4sII", b"glTF", 2, length) + struct.pack("<I4s", len(text), b"JSON")
        return head + text + struct.pack("<I4s", len(data), b"BIN\0") + data

    def _vectors(self, rows, bounds=False):
        return self._accessor(rows.astype(np.float32), _FLOAT, f"VEC{rows.shape[1]}", _VERTICES, bounds)

    def _accessor(self, values, component, kind, target, bounds=False):
        data = np.ascontiguousarray(values, np.uint32 if component == _UNSIGNED else np.float32)
        view = {"buffer": 0, "byteOffset": len(self._bytes), "byteLength": data.nbytes, "target": target}
        self._bytes += data.tobytes()
        accessor = {"bufferView": len(self._document["bufferViews"]), "componentType": component}
        accessor.update(count=len(data), type=kind)
        if bounds:
            accessor.update(min=data.min(axis=0).tolist(), max=data.max(axis=0).tolist())
        self._document["bufferViews"].append(view)
        self._document["accessors"].append(accessor)
        return len(self._document["accessors"]) - 1

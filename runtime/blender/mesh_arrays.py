"""A mesh of Blender's as numpy arrays: corners that agree in all that they have are one vertex, as in glTF."""

from dataclasses import dataclass
from typing import Optional

import numpy as np


@dataclass
class MeshArrays:
    """Vertices of a mesh in its own space, and its triangles."""

    #: (vertices, 3), single precision, as all but the triangles.
    positions: np.ndarray
    #: (vertices, 3), of unit length.
    normals: np.ndarray
    #: (vertices, 2), v up; None without a UV map.
    uvs: Optional[np.ndarray]
    #: (triangles, 3) vertices.
    triangles: np.ndarray
    #: (triangles,) slots.
    slots: np.ndarray


def _read(collection, attribute, width, kind=np.float32):
    values = np.empty(len(collection) * width, kind)
    collection.foreach_get(attribute, values)
    return values.reshape(-1, width)


def _unique_rows(rows):
    """Returns the index of one row of each kind, and for each row the number of its kind."""
    whole = np.ascontiguousarray(rows).view(np.dtype((np.void, rows.dtype.itemsize * rows.shape[1]))).ravel()
    _, first, kinds = np.unique(whole, return_index=True, return_inverse=True)
    return first, kinds


def read(mesh):
    """Reads a mesh; None where it has no triangle."""
    mesh.calc_loop_triangles()
    if not mesh.loop_triangles:
        return None
    vertex_of_corner = _read(mesh.loops, "vertex_index", 1, np.int32)
    normals = _read(mesh.corner_normals, "vector", 3)
    # The one that engines draw, which is another than the one that is edited, if the user says so.
    layer = next((layer for layer in mesh.uv_layers if layer.active_render), mesh.uv_layers.active)
    uvs = _read(layer.uv, "vector", 2) if layer is not None else None
    # Rows that are equal bit by bit; the vertex's number stands for its position.
    parts = [vertex_of_corner, normals.view(np.int32)] + ([uvs.view(np.int32)] if uvs is not None else [])
    first, kinds = _unique_rows(np.concatenate(parts, axis=1))
    return MeshArrays(
        positions=_read(mesh.vertices, "co", 3)[vertex_of_corner[first, 0]],
        normals=normals[first],
        uvs=uvs[first] if uvs is not None else None,
        triangles=kinds[_read(mesh.loop_triangles, "loops", 3, np.int32)].astype(np.int32),
        slots=_read(mesh.loop_triangles, "material_index", 1, np.int32)[:, 0],
    )


def unit(vectors):
    """Returns vectors of length 1; those without length stay so."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-30)


def along_uv(positions, uvs, triangles):
    """Returns of each triangle the changes of the position along u and along v, (triangles, 3), the determinant of its texture
    coordinates, by which both have to be divided, and twice its area."""
    corners, turns = positions[triangles].astype(np.float64), uvs[triangles].astype(np.float64)
    e, f = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    s, t = turns[:, 1] - turns[:, 0], turns[:, 2] - turns[:, 0]
    determinant = s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0]
    area = np.linalg.norm(np.cross(e, f), axis=1)
    return e * t[:, 1:] - f * s[:, 1:], f * s[:, :1] - e * t[:, :1], determinant, area


def tangents(positions, normals, uvs, triangles):
    """Returns tangents along u, (vertices, 3), at right angles to the normals, and bitangents, as `btf-view` derives them.

    They are sums over the triangles around a vertex, each weighted by its area.
    """
    along_u, along_v, determinant, area = along_uv(positions, uvs, triangles)
    good = np.abs(determinant) >= 1e-20
    determinant = np.where(good, determinant, 1.0)[:, None]
    sums = []
    for direction in (along_u, along_v):
        total = np.zeros((len(positions), 3))
        weighted = unit(direction / determinant) * (area * good)[:, None]
        for corner in range(3):
            np.add.at(total, triangles[:, corner], weighted)
        sums.append(total)
    normals = normals.astype(np.float64)
    flat = sums[0] - normals * np.sum(normals * sums[0], axis=1, keepdims=True)
    # Where u has no direction, any will do.
    other = np.cross(normals, np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    lost = np.linalg.norm(flat, axis=1, keepdims=True) <= 1e-6 * np.linalg.norm(sums[0], axis=1, keepdims=True)
    tangent = unit(np.where(lost, other, flat))
    sign = np.where(np.sum(np.cross(normals, sums[0]) * sums[1], axis=1) < 0.0, -1.0, 1.0)
    return tangent, np.cross(normals, tangent) * sign[:, None]

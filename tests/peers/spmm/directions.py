"""The section "Directions" of docs/reference/format.md, with all that follows from the directions."""

import ctypes
import math

from spmm.decoding import Sphere, dot
from spmm.entropy_coder import must


def single(x):
    """The single-precision number nearest to `x`; infinite beyond their range."""
    return ctypes.c_float(x).value


def must_be_counts(n, t, e):
    must(1 <= n <= 4096 and t <= 2 * n and 1 <= e <= n, "a count of directions is out of its range")


def must_be_directions(directions, triangles, edges):
    """The other rules, for the ids of triangles' corners and of edges' ends."""
    units = (0.998 <= dot(d, d) <= 1.002 and d[2] > 0 for d in directions)
    must(all(units), "a direction is no unit vector with z above 0")
    must(all(i < len(directions) for ids in triangles + edges for i in ids), "a direction is not there")
    for corners in triangles:
        (x0, y0, _), (x1, y1, _), (x2, y2, _) = (directions[i] for i in corners)
        must(abs((x1 - x0) * (y2 - y0) - (y1 - y0) * (x2 - x0)) > 1e-9, "a triangle has no area")
    for p, q in edges:
        length = math.dist(directions[p][:2], directions[q][:2])
        must(length == 0 or length >= 1e-15, "the ends of an edge are too close")


def cells_a_side(triangles):
    return min(64, max(4, math.ceil(math.sqrt(2 * triangles))))


def direction_set(section):
    n, t, e = section.numbers("I", 3)
    must_be_counts(n, t, e)
    flat = section.numbers("f", 3 * n)
    ids = section.numbers("H", 3 * t + 2 * e)
    section.end()
    directions = [tuple(flat[3 * i : 3 * i + 3]) for i in range(n)]
    triangle_ids = [ids[3 * i : 3 * i + 3] for i in range(t)]
    edge_ids = [ids[3 * t + 2 * i :][:2] for i in range(e)]
    return derived(directions, triangle_ids, edge_ids)


def derived(directions, triangle_ids, edge_ids):
    """The set with everything that follows from its directions and ids: matrices and the grid."""
    must_be_directions(directions, triangle_ids, edge_ids)
    disk = [d[:2] for d in directions]

    triangles, edges = [], []
    for corners in triangle_ids:
        p0, p1, p2 = [disk[i] for i in corners]
        u, v = (p1[0] - p0[0], p1[1] - p0[1]), (p2[0] - p0[0], p2[1] - p0[1])
        area = u[0] * v[1] - v[0] * u[1]
        inverse = 1 / area
        matrix = v[1] * inverse, -v[0] * inverse, -u[1] * inverse, u[0] * inverse
        triangles.append([single(x) for x in (*p0, *matrix)] + corners)
    for p, q in edge_ids:
        dx, dy = disk[q][0] - disk[p][0], disk[q][1] - disk[p][1]
        length2 = dx * dx + dy * dy
        edges.append([single(x) for x in (*disk[p], dx, dy, 1 / length2 if length2 > 0 else 0)] + [p, q])

    side = cells_a_side(len(triangles))
    offsets, items = [0], []
    for row in range(side):
        for column in range(side):
            low = -1 + 2 * column / side - 1e-6, -1 + 2 * row / side - 1e-6
            high = -1 + 2 * (column + 1) / side + 1e-6, -1 + 2 * (row + 1) / side + 1e-6
            box = [low, (high[0], low[1]), high, (low[0], high[1])]
            shapes = [[disk[i] for i in corners] for corners in triangle_ids]
            items += [i for i, shape in enumerate(shapes) if convex_shapes_meet(shape, box)]
            if not all(any(is_within(corner, shape) for shape in shapes) for corner in box):
                centre = (low[0] + high[0]) / 2, (low[1] + high[1]) / 2
                distances = [distance(centre, disk[p], disk[q]) for p, q in edge_ids]
                most = min(distances) + math.dist(low, high) + 1e-6
                items += [i + 2**31 for i, d in enumerate(distances) if d <= most]
            offsets.append(len(items))
    return Sphere(directions, triangles, edges, side, offsets, items)


def convex_shapes_meet(a, b):
    """Two convex polygons have a point in common unless a line along one of their sides separates them."""
    for shape, other in ((a, b), (b, a)):
        for p, q in zip(shape, shape[1:] + shape[:1]):
            normal = q[1] - p[1], p[0] - q[0]
            own = [normal[0] * x + normal[1] * y for x, y in shape]
            others = [normal[0] * x + normal[1] * y for x, y in other]
            if max(own) < min(others) or max(others) < min(own):
                return False
    return True


def is_within(p, triangle):
    a, b, c = triangle
    sides = [(q[0] - o[0]) * (p[1] - o[1]) - (q[1] - o[1]) * (p[0] - o[0]) for o, q in ((a, b), (b, c), (c, a))]
    return all(s >= 0 for s in sides) or all(s <= 0 for s in sides)


def distance(p, start, end):
    dx, dy = end[0] - start[0], end[1] - start[1]
    length2 = dx * dx + dy * dy
    t = ((p[0] - start[0]) * dx + (p[1] - start[1]) * dy) / length2 if length2 > 0 else 0
    t = min(1, max(0, t))
    return math.dist(p, (start[0] + t * dx, start[1] + t * dy))

"""Interpolation between measured directions: Delaunay triangles of the unit disk, barycentric weights."""

import numpy as np


def disk_of(directions_deg):
    """[n, 2] projections onto the disk of (theta, phi) in degrees."""
    theta, phi = np.radians(np.asarray(directions_deg, np.float64)).T
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)], 1)


def nearest_on_hull(corners, point):
    """The nearest point of a closed polygon."""
    start, end = corners, np.roll(corners, -1, 0)
    along = end - start
    t = np.clip(((point - start) * along).sum(1) / np.maximum((along**2).sum(1), 1e-30), 0, 1)
    feet = start + t[:, None] * along
    return feet[((feet - point) ** 2).sum(1).argmin()]


class Triangles:
    """Three measured directions and weights for any direction; outside the hull, of its nearest point."""

    def __init__(self, directions_deg):
        from scipy.spatial import Delaunay

        self.points = disk_of(directions_deg)
        self.mesh = Delaunay(self.points)
        hull = self.points[np.unique(self.mesh.convex_hull)]
        centre = hull.mean(0)
        angle = np.arctan2(*(hull - centre).T[::-1])
        self.corners = hull[np.argsort(angle)]
        self.centre = centre

    def weights(self, direction_deg):
        """([3] indices, [3] weights)."""
        point = disk_of([direction_deg])[0]
        if self.mesh.find_simplex(point, tol=1e-9) < 0:
            point = nearest_on_hull(self.corners, point)
        best = None
        # The simplex by the largest least barycentric coordinate: no trouble with points on edges.
        for simplex, transform in zip(self.mesh.simplices, self.mesh.transform):
            b = transform[:2] @ (point - transform[2])
            b = np.array([b[0], b[1], 1 - b.sum()])
            if np.isfinite(b).all() and (best is None or b.min() > best[1].min()):
                best = (simplex, b)
        weights = np.clip(best[1], 0, 1)
        return best[0], weights / weights.sum()

    def neighbours(self):
        """[n] arrays of the directions that share an edge with each."""
        starts, flat = self.mesh.vertex_neighbor_vertices
        return [np.sort(flat[starts[i] : starts[i + 1]]) for i in range(len(self.points))]


def pair_weights(views_deg, lights_deg, new_views_deg, new_lights_deg):
    """[new pair, measured pair] matrix of nine weights a row, pairs as view * lights + light."""
    views, lights = Triangles(views_deg), Triangles(lights_deg)
    matrix = np.zeros((len(new_views_deg) * len(new_lights_deg), len(views_deg) * len(lights_deg)), np.float32)
    of_lights = [lights.weights(d) for d in new_lights_deg]
    for v, direction in enumerate(new_views_deg):
        view_index, view_weight = views.weights(direction)
        for l, (light_index, light_weight) in enumerate(of_lights):
            row = matrix[v * len(new_lights_deg) + l]
            for i, wi in zip(view_index, view_weight):
                row[i * len(lights_deg) + light_index] += wi * light_weight
    return matrix

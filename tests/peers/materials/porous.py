"""A porous stone: a solid from which many overlapping bubbles have been cut, so that it has caves and overhangs.

Modelled: caves that open into each other below the surface, occlusion and parallax of true depth, cast shadows,
Lambert's law with an albedo that varies in space, one bounce of light between the walls: rays from every
sample, spread with density cos / pi, meet the nearest wall and bring its direct light. All texels have the same spread,
so its error (96 rays a texel) is smooth and no noise.
Not modelled: gloss, light that goes through the solid, more than one bounce, holes below the voxels' size.
"""

import numpy as np

from tracing import PLASTIC, ShadowMap, interleaved, march, periodic_noise, points_at, read_trilinear

# Rays of a sample that look for bounced light.
BOUNCE_RAYS = 12
MAP_RAYS_PER_VOXEL = 4
BIAS = 0.25
# Lengths in tile widths.
DEPTH = 0.28
ROOM_ABOVE = 0.02
# Radius from, radius to, number of bubbles: their count falls with their size as in a foam.
BUBBLES = ((0.065, 0.095, 16), (0.035, 0.06, 90), (0.018, 0.032, 420))
CREAM = np.array([0.72, 0.58, 0.40], np.float32)
RUST = np.array([0.46, 0.20, 0.10], np.float32)


class Porous:
    """The stone: a periodic function on voxels of half a texel that is above 0 in the solid."""

    largest_albedo = CREAM

    def __init__(self, size, seed, bounce=True):
        generator = np.random.default_rng([seed, 3])
        self.size, self.side = size, 2 * size
        self.pitch = 1.0 / self.side
        self.top = ROOM_ABOVE
        self.layers = int(round((DEPTH + ROOM_ABOVE) * self.side)) + 1
        self.solid = self.carve(generator)
        spread = periodic_noise((self.side // 2,) * 3, self.side / 4, self.side / 40, generator, falloff=1.9)
        depth = self.layers // 2 + 1
        self.blend = np.clip(0.5 + 0.45 * spread[:depth], 0, 1)
        self.bounce = bounce
        if bounce:
            self.find_walls()

    def carve(self, generator):
        """Returns the distance to the nearest wall in voxels, above 0 in the solid, cut off at 3 voxels."""
        side, layers = self.side, self.layers
        height = (self.top - np.arange(layers) * self.pitch)[:, None, None].astype(np.float32)
        surface = -0.009 + 0.005 * periodic_noise((side, side), side / 3, side / 20, generator)
        solid = np.clip((surface - height) * side, -3, 3).astype(np.float32)
        for smallest, largest, count in BUBBLES:
            for _ in range(count):
                radius = generator.uniform(smallest, largest) * side
                column, row = generator.random(2) * side
                layer = (self.top + generator.uniform(-0.3 * largest, DEPTH - 1.1 * largest)) * side
                reach = int(radius + 4)
                columns = np.arange(int(column) - reach, int(column) + reach + 1)
                rows = np.arange(int(row) - reach, int(row) + reach + 1)
                depths = np.arange(max(0, int(layer) - reach), min(layers, int(layer) + reach + 1))
                # Bubbles are a little flattened, as in pumice.
                square = (((depths - layer) * 1.15) ** 2)[:, None, None] + ((rows - row) ** 2)[None, :, None]
                distance = np.sqrt(square + ((columns - column) ** 2)[None, None, :]) - radius
                box = np.ix_(depths, rows % side, columns % side)
                solid[box] = np.minimum(solid[box], distance.astype(np.float32))
        grain = periodic_noise((layers, side, side), max(side / 12, 10), 5, generator, falloff=1.6)
        solid += 0.55 * grain
        # The lowest slices are solid: no ray leaves the material.
        floor = (np.arange(layers) - (layers - 4)).astype(np.float32)[:, None, None]
        return np.maximum(np.clip(solid, -3, 3), floor)

    def trace(self, direction, rays, offset):
        """Returns the heights at which rays along `-direction` meet the stone."""
        return march(self.solid, self.top, self.pitch, direction, rays, offset)

    def normals(self, points):
        """Returns unit normals by central differences over half a voxel to each side."""
        step = 0.5 * self.pitch
        gradient = np.empty_like(points)
        for axis in range(3):
            lifted = np.zeros(3, np.float32)
            lifted[axis] = step
            ahead = read_trilinear(self.solid, self.top, self.pitch, points + lifted)
            behind = read_trilinear(self.solid, self.top, self.pitch, points - lifted)
            gradient[:, axis] = behind - ahead
        length = np.sqrt((gradient**2).sum(axis=1, keepdims=True))
        return np.where(length > 1e-6, gradient / np.maximum(length, 1e-6), np.float32([0, 0, 1]))

    def albedo(self, points):
        """Returns the albedo `[n, 3]` at points."""
        share = read_trilinear(self.blend, self.top, 2 * self.pitch, points)[:, None]
        return RUST + share * (CREAM - RUST)

    def find_walls(self):
        """Lists the voxels at walls, with the point of the wall next to each, its normal and its albedo."""
        near = np.flatnonzero(np.abs(self.solid) < 1.3)
        layer, row, column = np.unravel_index(near, self.solid.shape)
        x, y, z = (column + 0.5) * self.pitch, 1 - (row + 0.5) * self.pitch, self.top - layer * self.pitch
        centres = np.stack([x, y, z], axis=1).astype(np.float32)
        self.wall_normals = self.normals(centres)
        points = centres + self.wall_normals * (self.solid.ravel()[near] * np.float32(self.pitch))[:, None]
        self.wall_lifted = points + self.wall_normals * np.float32(0.5 * self.pitch)
        self.wall_albedo = self.albedo(points)
        # The last record stands for the sky: it gives no light.
        self.wall_of_voxel = np.full(self.solid.size, len(near), np.int32)
        self.wall_of_voxel[near] = np.arange(len(near), dtype=np.int32)
        # One byte a voxel is enough for steps: 1 / 40 of a voxel.
        self.coarse = np.round(self.solid * 40).astype(np.int8).ravel()

    def bounced_from(self, points, normals, samples):
        """Returns, for BOUNCE_RAYS rays from each point, the wall's number that each meets: int32 `[point, ray]`.

        Points are in the order of `samples` samples of all texels.
        """
        count = len(points)
        walls = np.full((count, BOUNCE_RAYS), len(self.wall_albedo), np.int32)
        sphere = sphere_points(BOUNCE_RAYS * samples)
        for ray in range(BOUNCE_RAYS):
            # A point on a unit sphere around the normal's tip has the density cos / pi as a direction.
            tips = np.repeat(sphere[ray * samples:(ray + 1) * samples], count // samples, axis=0)
            way = normals + tips
            way /= np.maximum(np.sqrt((way**2).sum(axis=1, keepdims=True)), 1e-4)
            # In voxels: columns, rows downwards, layers downwards.
            place = (points + normals * np.float32(1.5 * self.pitch)) * np.float32(self.side)
            place = np.stack([place[:, 0], self.side - place[:, 1],
                              np.float32(self.top * self.side + 0.5) - place[:, 2]])
            way = way.T * np.float32([[1], [-1], [-1]])
            going = np.arange(count)
            for _ in range(160):
                inside = (place[2] >= 0) & (place[2] < self.layers)
                going, place, way = going[inside], place[:, inside], way[:, inside]
                if not len(going):
                    break
                cell = np.floor(place).astype(np.int32)
                voxel = (cell[2] * self.side + cell[1] % self.side) * self.side + cell[0] % self.side
                wall = self.coarse.take(voxel)
                met = wall > 0
                walls[going[met], ray] = self.wall_of_voxel.take(voxel[met])
                free = ~met
                step = np.maximum(wall[free] * np.float32(-0.7 / 40), np.float32(0.7))
                going, way = going[free], way[:, free]
                place = place[:, free] + step * way
        return walls

    def see(self, view, offsets):
        """Returns what the eye at `view` sees at the samples `offsets` of all texels: a dict of arrays by sample."""
        heights = [self.trace(view, self.size, offset) for offset in offsets]
        points = np.concatenate([points_at(self.size, o, view, h) for o, h in zip(offsets, heights)])
        normals = self.normals(points)
        seen = {"points": points, "normals": normals, "albedo": self.albedo(points),
                "lifted": points + normals * np.float32(0.5 * self.pitch)}
        if self.bounce:
            seen["walls"] = self.bounced_from(points, normals, len(offsets))
        return seen

    def illuminate(self, light):
        """Returns the shadow map of a light and the light that each wall throws back."""
        rays = MAP_RAYS_PER_VOXEL * self.side
        heights = interleaved(lambda n, offset: self.trace(light, n, offset), rays, MAP_RAYS_PER_VOXEL)
        lamp = {"map": ShadowMap(heights, light), "light": light.astype(np.float32)}
        if self.bounce:
            lit = np.maximum(self.wall_normals @ lamp["light"], 0)
            lit *= lamp["map"].lit_share(self.wall_lifted, BIAS / self.side)
            lamp["walls"] = np.concatenate([self.wall_albedo * lit[:, None], np.zeros((1, 3), np.float32)])
        return lamp

    def shade(self, seen, lamp, view):
        """Returns X `[sample, 3]` of what is seen under a lamp."""
        lit = np.maximum(seen["normals"] @ lamp["light"], 0)
        lit *= lamp["map"].lit_share(seen["lifted"], BIAS / self.side)
        irradiance = lit[:, None]
        if self.bounce:
            brought = sum(lamp["walls"].take(seen["walls"][:, ray], axis=0) for ray in range(BOUNCE_RAYS))
            irradiance = irradiance + brought * np.float32(1 / BOUNCE_RAYS)
        return seen["albedo"] * irradiance


def sphere_points(count):
    """Returns `count` points spread evenly over the unit sphere, neighbours in number far from each other."""
    steps = (0.5 + np.arange(1, count + 1)[:, None] * np.array([1 / PLASTIC, 1 / PLASTIC**2])) % 1.0
    z, turn = 2 * steps[:, 0] - 1, 2 * np.pi * steps[:, 1]
    ring = np.sqrt(1 - z * z)
    return np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1).astype(np.float32)

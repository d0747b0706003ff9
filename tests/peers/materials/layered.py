"""Pebbles cast in a tinted resin with a satin surface, and metal flakes that float in it at several depths.

Modelled: refraction at the resin's surface (apparent depth is less than true depth), Fresnel transmission both ways,
absorption along both paths, light that is thrown back at the surface from below, rough pebbles (Oren & Nayar 1994)
with relief and cast shadows, flakes with normals of their own (GGX, Walter et al. 2007) that hide and shadow what lies
below them, the satin surface's own reflection (GGX with height-correlated shadowing, Heitz 2014) on faint waves.
Not modelled: the waves' and the roughness' effect on refraction, light that goes from pebble to pebble or from flake to
flake, tilt of a flake in its outline's depth, scattering in the resin.
The reference plane z = 0 is the resin's surface.
"""

import numpy as np

from tracing import ShadowMap, interleaved, march_heights, periodic_noise, points_at, read_periodic

INDEX = 1.5
# Share of diffuse light from below that the surface throws back: 1 - (1 - r_e) / n^2 with r_e = 0.092 for n = 1.5
# (Egan & Hilgeman 1979).
INNER_REFLECTANCE = 0.596
SURFACE_ALPHA = 0.26
FLAKE_ALPHA = 0.32
FLAKE_F0 = np.array([0.91, 0.78, 0.48], np.float32)
# Absorption of the resin in 1 / tile width: a warm tint.
ABSORPTION = np.array([1.1, 2.2, 5.0], np.float32)
# Standard deviation of the pebbles' facets' slope angle in radians.
SIGMA_RAD = 0.45
# Heights in tile widths.
HIGHEST, LOWEST = -0.035, -0.16
FLAKE_HEIGHTS = (-0.008, -0.018, -0.028)
FLAKES = 90
PEBBLES = 46
MAP_RAYS_PER_TEXEL = 8
PALETTE = np.array([[0.70, 0.62, 0.50], [0.42, 0.16, 0.09], [0.16, 0.34, 0.36], [0.55, 0.38, 0.16], [0.10, 0.10, 0.12],
                    [0.80, 0.78, 0.74]], np.float32)


def refracted(direction):
    """Returns a direction above the surface as it is below it (Snell)."""
    below = np.asarray(direction, np.float64) / INDEX
    below[2] = np.sqrt(1 - below[0] ** 2 - below[1] ** 2)
    return below


def fresnel(cosine):
    """Returns the reflectance of the surface for unpolarised light, exactly."""
    inside = np.sqrt(1 - (1 - cosine**2) / INDEX**2)
    parallel = (INDEX * cosine - inside) / (INDEX * cosine + inside)
    across = (cosine - INDEX * inside) / (cosine + INDEX * inside)
    return 0.5 * (parallel**2 + across**2)


def ggx_times_pi(normal_in, normal_out, normal_half, alpha):
    """Returns `pi * D * G / (4 cos cos)` of GGX with height-correlated shadowing."""
    square = np.float32(alpha * alpha)
    spread = square / (normal_half**2 * (square - 1) + 1) ** 2
    masking = normal_in * np.sqrt(normal_out**2 * (1 - square) + square)
    masking = masking + normal_out * np.sqrt(normal_in**2 * (1 - square) + square)
    return np.where((normal_in > 0) & (normal_out > 0), spread * 0.5 / np.maximum(masking, 1e-6), 0)


class Layered:
    """The resin's surface, its flakes by layer, and the height field of the pebbles."""

    largest_albedo = PALETTE.max(axis=0)

    def __init__(self, size, seed, bounce=True):
        generator = np.random.default_rng([seed, 2])
        self.size, self.side = size, 4 * size
        self.lay_pebbles(generator)
        self.scatter_flakes(generator)
        waves = periodic_noise((self.side,) * 2, self.side / 4, self.side / 14, generator)
        self.wave_normals = self.normals_of(waves * np.float32(0.0011))
        self.bounce = None
        self.steps = 72
        self.map_rays = MAP_RAYS_PER_TEXEL * size

    def lay_pebbles(self, generator):
        """Makes heights, normals and albedo of the base from the two nearest of some points (Worley 1996)."""
        side = self.side
        spread = self.spread_points(PEBBLES, generator)
        x, y = np.meshgrid((np.arange(side) + 0.5) / side, 1 - (np.arange(side) + 0.5) / side)
        bend = 0.006 * np.stack([periodic_noise((side, side), side / 4, side / 16, generator) for _ in range(2)])
        nearest = np.full((2, side, side), np.inf)
        owner = np.zeros((side, side), np.int64)
        for index, (px, py) in enumerate(spread):
            dx, dy = (x + bend[0] - px + 0.5) % 1 - 0.5, (y + bend[1] - py + 0.5) % 1 - 0.5
            distance = np.hypot(dx, dy)
            closer = distance < nearest[0]
            nearest[1] = np.where(closer, nearest[0], np.minimum(nearest[1], distance))
            nearest[0] = np.where(closer, distance, nearest[0])
            owner[closer] = index
        # A pebble falls away towards the bisector with the next one.
        inner = np.clip((nearest[1] - nearest[0]) / (nearest[1] + nearest[0]) * 1.5, 0, 1)
        dome = np.sqrt(1 - (1 - inner) ** 2.4)
        lift = generator.uniform(0.55, 1.0, PEBBLES)[owner]
        grain = periodic_noise((side, side), side / 6, side / 60, generator, falloff=1.2)
        heights = LOWEST + (HIGHEST - LOWEST) * (dome * lift) + 0.0008 * grain
        self.heights = np.clip(heights, LOWEST, HIGHEST).astype(np.float32)
        self.base_normals = self.normals_of(self.heights)
        colour = PALETTE[generator.integers(0, len(PALETTE), PEBBLES)][owner]
        streaks = periodic_noise((side, side), side / 5, side / 40, generator, falloff=1.0)
        colour = colour * np.clip(1 + 0.22 * streaks, 0.4, 1.35)[:, :, None]
        sand = np.array([0.34, 0.27, 0.18], np.float32)
        share = np.clip(inner * 6, 0, 1)[:, :, None]
        self.base_albedo = np.minimum(sand + share * (colour - sand), 0.85).astype(np.float32)

    @staticmethod
    def spread_points(count, generator):
        """Draws points that keep away from each other: the best of some candidates each (Mitchell 1991)."""
        chosen = [generator.random(2)]
        while len(chosen) < count:
            candidates = generator.random((12, 2))
            apart = np.abs(candidates[:, None] - np.array(chosen)[None])
            apart = np.minimum(apart, 1 - apart)
            chosen.append(candidates[(apart**2).sum(axis=2).min(axis=1).argmax()])
        return np.array(chosen)

    def normals_of(self, heights):
        """Returns unit normals of a periodic height field in tile widths."""
        slope_x = (np.roll(heights, -1, axis=1) - np.roll(heights, 1, axis=1)) * (self.side / 2)
        slope_y = (np.roll(heights, 1, axis=0) - np.roll(heights, -1, axis=0)) * (self.side / 2)
        normals = np.stack([-slope_x, -slope_y, np.ones_like(slope_x)], axis=-1)
        return (normals / np.linalg.norm(normals, axis=-1, keepdims=True)).astype(np.float32)

    def scatter_flakes(self, generator):
        """Makes a map of flake numbers, 0 where there is none, for each depth, and the flakes' normals."""
        side = 8 * self.size
        self.flake_maps = np.zeros((len(FLAKE_HEIGHTS), side, side), np.int16)
        normals = [[0, 0, 1]]
        for level in range(len(FLAKE_HEIGHTS)):
            for _ in range(FLAKES // len(FLAKE_HEIGHTS)):
                tilt, turn = np.abs(generator.normal(0, np.radians(11))), generator.uniform(0, 2 * np.pi)
                normals.append([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
                column, row = generator.random(2) * side
                radius = generator.uniform(0.011, 0.021) * side
                rows, columns = np.mgrid[-int(radius) - 1:int(radius) + 2, -int(radius) - 1:int(radius) + 2]
                rim = radius * (1 + 0.18 * np.cos(3 * np.arctan2(rows, columns) + turn))
                inside = np.hypot(rows, columns) < rim
                self.flake_maps[level][(rows[inside] + int(row)) % side,
                                       (columns[inside] + int(column)) % side] = len(normals) - 1
        self.flake_normals = np.array(normals, np.float32)

    def flakes_on_way(self, below, rays, offset):
        """Returns the number of the highest flake on each ray, 0 if there is none, and its height."""
        number = np.zeros(rays * rays, np.int16)
        height = np.full(rays * rays, np.float32(LOWEST - 1))
        side = self.flake_maps.shape[1]
        for level, z in reversed(list(enumerate(FLAKE_HEIGHTS))):
            places = points_at(rays, offset, below, np.full(rays * rays, z))
            column = np.floor(places[:, 0] * side).astype(np.int64) % side
            row = np.floor((1 - places[:, 1]) * side).astype(np.int64) % side
            here = self.flake_maps[level][row, column]
            number = np.where(here > 0, here, number)
            height = np.where(here > 0, np.float32(z), height)
        return number, height

    def trace(self, below, rays, offset):
        """Returns where rays meet a flake or a pebble, along a direction below the surface."""
        base = march_heights(self.heights, HIGHEST, below, rays, offset, self.steps)
        _, flake = self.flakes_on_way(below, rays, offset)
        return np.maximum(base, flake.reshape(rays, rays))

    def see(self, view, offsets):
        """Returns what the eye at `view` sees at the samples `offsets` of all texels."""
        below = refracted(view)
        parts = []
        for offset in offsets:
            number, flake = self.flakes_on_way(below, self.size, offset)
            base = march_heights(self.heights, HIGHEST, below, self.size, offset, self.steps).ravel()
            points = points_at(self.size, offset, below, np.maximum(base, flake))
            surface = points_at(self.size, offset, below, np.zeros(self.size**2))
            parts.append((number, points, surface))
        number, points, surface = (np.concatenate(part) for part in zip(*parts))
        base_normals = read_periodic(self.base_normals, points[:, 0], points[:, 1])
        normals = np.where(number[:, None] > 0, self.flake_normals[number], base_normals)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        waves = read_periodic(self.wave_normals, surface[:, 0], surface[:, 1])
        waves /= np.linalg.norm(waves, axis=1, keepdims=True)
        albedo = read_periodic(self.base_albedo, points[:, 0], points[:, 1])
        depth = -points[:, 2:3]
        kept = np.exp(-ABSORPTION * depth / np.float32(below[2])) * np.float32((1 - fresnel(view[2])) / INDEX**2)
        flakes = np.flatnonzero(number)
        # Factors that no light changes: what is left on the way up, and for pebbles what the surface throws back.
        weight = np.where(number[:, None] > 0, FLAKE_F0, albedo / (1 - albedo * INNER_REFLECTANCE)) * kept
        lifted = points + normals * np.float32(1.2 / self.map_rays) * (number[:, None] == 0)
        return {"points": points, "normals": normals, "waves": waves, "flakes": flakes, "weight": weight,
                "depth": depth, "lifted": lifted, "below": below.astype(np.float32)}

    def illuminate(self, light):
        """Returns the shadow map of the light below the surface, and what the surface lets through."""
        below = refracted(light)
        heights = interleaved(lambda n, offset: self.trace(below, n, offset), self.map_rays, 2)
        return {"map": ShadowMap(heights, below), "light": light.astype(np.float32),
                "below": below.astype(np.float32), "passed": (1 - fresnel(light[2])) * light[2] / below[2]}

    def shade(self, seen, lamp, view):
        """Returns X `[sample, 3]` of what is seen under a lamp."""
        light, view = lamp["light"], view.astype(np.float32)
        into, out = lamp["below"], seen["below"]
        cos_in, cos_out = seen["normals"] @ into, np.maximum(seen["normals"] @ out, 1e-3)
        response = oren_nayar(cos_in, cos_out, float(into @ out))
        flakes = seen["flakes"]
        if len(flakes):
            half = (into + out) / np.linalg.norm(into + out)
            cos_half = seen["normals"][flakes] @ half
            # Below the surface X has the cosine of the flake's own normal, as for pebbles.
            response[flakes] = ggx_times_pi(cos_in[flakes], cos_out[flakes], cos_half, FLAKE_ALPHA) * cos_in[flakes]
        lit = lamp["map"].lit_share(seen["lifted"], 0.5 / self.map_rays)
        kept = np.exp(seen["depth"] * (-ABSORPTION / into[2])) * np.float32(lamp["passed"])
        inner = seen["weight"] * kept * (response * lit)[:, None]
        half = (light + view) / np.linalg.norm(light + view)
        waves = seen["waves"]
        gloss = ggx_times_pi(waves @ light, waves @ view, waves @ half, SURFACE_ALPHA) * np.maximum(waves @ light, 0)
        return inner + (gloss * np.float32(fresnel(float(half @ view))))[:, None]


def oren_nayar(cos_in, cos_out, cos_between):
    """Returns Oren and Nayar's qualitative model times the light's cosine, for albedo 1."""
    square = SIGMA_RAD**2
    a, b = 1 - 0.5 * square / (square + 0.33), 0.45 * square / (square + 0.09)
    cos_in = np.maximum(cos_in, 0)
    ridge = np.maximum(0, np.float32(cos_between) - cos_in * cos_out) / np.maximum(np.maximum(cos_in, cos_out), 1e-3)
    return cos_in * (np.float32(a) + np.float32(b) * ridge)

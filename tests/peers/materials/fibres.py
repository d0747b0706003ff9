"""A plain weave of spun yarns, each of many fibres that are curved cylinders in space, with stray fibres above them.

Modelled: every fibre as a chain of cylinders, met by rays exactly, so gaps, overhangs, parallax and masking are true;
shading per fibre: a diffuse surface (Lambert), light scattered in the fibre that leaves evenly around it (the diffuse
term of Kajiya & Kay 1989, normalised), the highlight of the fibre's surface and a wider coloured one from its inside
(R and TRT of Marschner et al. 2003, without the tilt of scales, so that both are reciprocal; Gaussians are normalised
over the outgoing angle as d'Eon et al. 2011 ask); shadows; one bounce between fibres as in a medium of the fibres' mean
density; a dark table below.
Not modelled: light through a fibre (TT), caustics, the place across a fibre at which its highlights stand (they are
spread over its width), more than one bounce.
What a fibre scatters, SURFACE_SHARE + VOLUME_SHARE + INNER_SHARE = 1, is multiplied by its albedo, the inner highlight
twice; the outer highlight's Fresnel reflectance comes on top. The reference plane z = 0 touches the tops of the yarns;
stray fibres stand above it.
"""

import numpy as np

from tracing import Medium, ShadowMap, grid_places, points_at

YARNS = 8
PLIES = 2
# Fibres of a yarn: ring radius as a share of the yarn's, and number of fibres on it; one ring system for each ply.
FIBRES_OF_PLY = ((0.0, 1), (0.38, 5), (0.80, 9))
TURNS_PER_TILE = 5
STRAY_FIBRES = 6
# Lengths in tile widths.
YARN_RADIUS = 0.065
FIBRE_RADIUS = 0.0088
CRIMP = 0.034
TABLE_BELOW = 0.17
STEP = 0.022
MAP_RAYS_PER_TEXEL = 8

SURFACE_SHARE, VOLUME_SHARE, INNER_SHARE = 0.47, 0.38, 0.15
# Reflectance along the normal for a refractive index of 1.53.
F0 = 0.044
SHINE_SPREAD_RAD = 0.20
INNER_SPREAD_RAD = 0.42
# Albedo of each fibre's scattering, before it varies from fibre to fibre.
WARP = np.array([0.10, 0.17, 0.42], np.float32)
WEFT = np.array([0.66, 0.50, 0.24], np.float32)
STRAY = np.array([0.62, 0.58, 0.50], np.float32)
TABLE = np.array([0.03, 0.03, 0.03], np.float32)


def wander(generator, amplitude, waves):
    """Returns a periodic function of mean 0 over [0, 1) of the first few waves."""
    phase = generator.uniform(0, 2 * np.pi, waves)
    size = amplitude * generator.normal(0, 1, waves) / np.sqrt(np.arange(1, waves + 1))
    return lambda s: sum(a * np.sin(2 * np.pi * (k + 1) * s + p) for k, (a, p) in enumerate(zip(size, phase)))


class Fibres:
    """All cylinders as arrays by segment: ends, tangents at the ends, radius, albedo.

    `albedos` are those of warp, weft, stray fibres and table, `[channel]` each: red, green and blue, or bands.
    """

    def __init__(self, size, seed, bounce=True, albedos=(WARP, WEFT, STRAY, TABLE)):
        generator = np.random.default_rng([seed, 1])
        self.size = size
        self.warp, self.weft, self.stray_albedo, self.table = albedos
        self.largest_albedo = np.maximum(np.maximum(self.warp, self.weft), self.stray_albedo) * 1.25
        self.chains = []
        for number in range(YARNS):
            for warp in (True, False):
                self.spin(number, warp, generator)
        self.stray(generator)
        self.start, self.end, self.tangent_start, self.tangent_end, self.radius, self.albedo = (
            np.concatenate(part).astype(np.float32) for part in zip(*self.chains))
        self.floor = np.float32(-TABLE_BELOW)
        long = np.linalg.norm(self.end - self.start, axis=1)
        thickness = float(np.percentile(self.start[:, 2], 98) - np.percentile(self.start[:, 2], 2))
        # Cylinders in random directions show pi / 4 of their length times their width (Cauchy).
        self.extinction = float((2 * self.radius * long).sum() * np.pi / 4 / thickness)
        reach = 1 / self.extinction
        self.bounce = None
        if bounce:
            high = float(self.end[:, 2].max()) + 0.02
            self.bounce = Medium(size, -TABLE_BELOW, high, reach, 1.5 * FIBRE_RADIUS)

    def add(self, curve, radius, colour, length):
        """Adds a periodic curve, a function of s in [0, 1], as a chain of cylinders."""
        count = max(8, int(round(length / STEP)))
        s = np.arange(count + 1) / count
        points = curve(s)
        small = 1e-4
        tangents = (curve(s + small) - curve(s - small))
        tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
        self.chains.append((points[:-1], points[1:], tangents[:-1], tangents[1:], np.full(count, radius),
                            np.tile(colour, (count, 1))))

    def spin(self, number, warp, generator):
        """Spins a yarn: plies twisted around each other, fibres twisted around a ply's axis, all periodic."""
        place = (number + 0.5) / YARNS
        swing, thick = wander(generator, 0.0045, 3), wander(generator, 0.05, 3)
        over = 1 if (number % 2 == 0) == warp else -1
        mean_z = -0.62 * YARN_RADIUS - CRIMP
        yarn_phase = generator.uniform(0, 2 * np.pi)
        base = self.warp if warp else self.weft
        for ply in range(PLIES):
            for ring, count in FIBRES_OF_PLY:
                for index in range(count):
                    phase = 2 * np.pi * index / count + generator.normal(0, 0.25)
                    breathe = wander(generator, 0.10, 4)
                    drift = wander(generator, 0.0022, 5)
                    lift = wander(generator, 0.0022, 5)
                    spread = ring * (1 + generator.normal(0, 0.08))
                    colour = base * np.clip(generator.normal(1, 0.14), 0.6, 1.25)

                    def curve(s, ring=spread, phase=phase, breathe=breathe, drift=drift, lift=lift, ply=ply):
                        turn = 2 * np.pi * TURNS_PER_TILE * s
                        ply_angle = turn + yarn_phase + np.pi * 2 * ply / PLIES
                        # Plies twist against their fibres, as spinners make them.
                        fibre_angle = phase - 2 * np.pi * 3 * s
                        radius = YARN_RADIUS * (1 + thick(s))
                        wide = ring * (1 + breathe(s))
                        side = radius * (0.46 * np.cos(ply_angle) + 0.52 * wide * np.cos(fibre_angle))
                        up = radius * (0.28 * np.sin(ply_angle) + 0.34 * wide * np.sin(fibre_angle))
                        wave = over * CRIMP * np.cos(np.pi * YARNS * (s - 0.5 / YARNS))
                        across = place + swing(s) + side + drift(s)
                        z = mean_z + wave + up + lift(s)
                        return np.stack([across, s, z] if warp else [s, across, z], axis=1)

                    self.add(curve, FIBRE_RADIUS * generator.uniform(0.88, 1.12), colour, 1.25)

    def stray(self, generator):
        """Lays thin fibres over the weave that wander, dip into it and stand off it."""
        for _ in range(STRAY_FIBRES):
            winding = generator.integers(-1, 2, 2)
            if not winding.any():
                winding[generator.integers(0, 2)] = 1
            start = generator.random(2)
            x, y = wander(generator, 0.07, 3), wander(generator, 0.07, 3)
            z = wander(generator, 0.009, 5)
            level = generator.uniform(-0.022, 0.0)

            def curve(s, winding=winding, start=start, x=x, y=y, z=z, level=level):
                height = level + z(s)
                return np.stack([start[0] + winding[0] * s + x(s), start[1] + winding[1] * s + y(s),
                                 np.where(height > 0.03, 0.03 + 0.4 * (height - 0.03), height)], axis=1)

            colour = self.stray_albedo * np.clip(generator.normal(1, 0.15), 0.6, 1.2)
            self.add(curve, 0.5 * FIBRE_RADIUS, colour, 4.0)

    def candidates(self, direction, rays, offset, chosen):
        """Returns (segment, column, row) of the rays that may meet the segments `chosen`; they may lie off the tile."""
        along = np.array([direction[0], direction[1]]) / direction[2]
        # A sphere of radius r covers, on the plane, r sideways and r / cos along the slope: bounded per axis.
        reach_x = np.sqrt(1 + along[0] ** 2) * self.radius[chosen]
        reach_y = np.sqrt(1 + along[1] ** 2) * self.radius[chosen]
        foot = [self.start[chosen], self.end[chosen]]
        x = [p[:, 0] - p[:, 2] * along[0] for p in foot]
        y = [p[:, 1] - p[:, 2] * along[1] for p in foot]
        first_column = np.ceil((np.minimum(*x) - reach_x) * rays - 0.5 - offset[0]).astype(np.int64)
        last_column = np.floor((np.maximum(*x) + reach_x) * rays - 0.5 - offset[0]).astype(np.int64)
        first_row = np.ceil((1 - np.maximum(*y) - reach_y) * rays - 0.5 - offset[1]).astype(np.int64)
        last_row = np.floor((1 - np.minimum(*y) + reach_y) * rays - 0.5 - offset[1]).astype(np.int64)
        wide, high = np.maximum(last_column - first_column + 1, 0), np.maximum(last_row - first_row + 1, 0)
        area = wide * high
        own = np.repeat(np.arange(len(chosen)), area)
        inside = np.arange(area.sum()) - np.repeat(np.cumsum(area) - area, area)
        row = inside // np.maximum(wide, 1)[own]
        column = inside - row * wide[own]
        return chosen[own], column + first_column[own], row + first_row[own]

    def meet(self, segment, x, y, direction):
        """Returns the height at which rays through (x, y, 0) meet the cylinders `segment`, and -inf if they do not."""
        axis = self.end - self.start
        length = np.linalg.norm(axis, axis=1)
        axis = axis / length[:, None]
        w = direction.astype(np.float32)
        slant = axis @ w
        a = 1 - slant**2
        start = self.start
        dx, dy = x - start[segment, 0], y - start[segment, 1]
        dz = -start[segment, 2]
        t = axis[segment]
        d_axis = dx * t[:, 0] + dy * t[:, 1] + dz * t[:, 2]
        d_ray = dx * w[0] + dy * w[1] + dz * w[2]
        lean = slant[segment]
        b = d_ray - d_axis * lean
        c = dx * dx + dy * dy + dz * dz - d_axis * d_axis - (self.radius**2)[segment]
        under_root = b * b - a[segment] * c
        distance = (-b + np.sqrt(np.maximum(under_root, 0))) / np.maximum(a[segment], 1e-6)
        along = (d_axis + distance * lean) / length[segment]
        met = (under_root > 0) & (along > -0.06) & (along < 1.06)
        return np.where(met, distance * w[2], -np.inf).astype(np.float32), along

    def trace(self, direction, rays, offset, chunk=2_000_000):
        """Returns heights `[ray]` and segments `[ray]` of the highest meeting; -1 and the table's height where none."""
        best = np.full(rays * rays, -1, np.int64)
        slants = np.sqrt(1 + (direction[0] ** 2 + direction[1] ** 2) / direction[2] ** 2)
        # Segments at a time: about `chunk` candidates, a segment's box being 0.35 % of the tile.
        group = max(64, int(chunk / (rays * rays * 0.0035 * slants)))
        for first in range(0, len(self.start), group):
            chosen = np.arange(first, min(first + group, len(self.start)))
            segment, column, row = self.candidates(direction, rays, offset, chosen)
            x = ((column + 0.5 + offset[0]) / rays).astype(np.float32)
            y = (1 - (row + 0.5 + offset[1]) / rays).astype(np.float32)
            z, _ = self.meet(segment, x, y, direction)
            kept = z > self.floor
            place = (row[kept] % rays) * rays + column[kept] % rays
            key = ((z[kept].astype(np.float64) + 1) * 2**26).astype(np.int64) << 24 | segment[kept]
            np.maximum.at(best, place, key)
        segment = np.where(best >= 0, best & (2**24 - 1), -1)
        z = np.where(best >= 0, (best >> 24) / 2**26 - 1, self.floor).astype(np.float32)
        return z, segment

    def see(self, view, offsets):
        """Returns what the eye at `view` sees at the samples `offsets` of all texels."""
        parts = []
        for offset in offsets:
            z, segment = self.trace(view, self.size, offset)
            parts.append((points_at(self.size, offset, view, z), segment))
        points, segment = (np.concatenate(part) for part in zip(*parts))
        return self.describe(points, segment, view)

    def describe(self, points, segment, view):
        """Returns axis, normal, tangent and albedo at points of the segments; the table's where the segment is -1."""
        on_table = segment < 0
        own = np.maximum(segment, 0)
        axis = self.end[own] - self.start[own]
        from_start = points - self.start[own]
        # Fibres cross the tile's edges, so the start may lie a tile away.
        from_start[:, :2] -= np.round(from_start[:, :2] - axis[:, :2] / 2)
        share = np.clip((from_start * axis).sum(axis=1) / (axis**2).sum(axis=1), 0, 1)[:, None]
        outwards = from_start - share * axis
        centre = points - outwards
        tangent = self.tangent_start[own] * (1 - share) + self.tangent_end[own] * share
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        normal = outwards - (outwards * tangent).sum(axis=1, keepdims=True) * tangent
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        normal[on_table] = (0, 0, 1)
        albedo = self.albedo[own].copy()
        albedo[on_table] = self.table
        seen = {"points": points, "centre": centre, "tangent": tangent, "normal": normal, "albedo": albedo,
                "radius": self.radius[own], "fibre": (~on_table).astype(np.float32),
                "lifted": points + normal * np.float32(1.2 / (MAP_RAYS_PER_TEXEL * self.size))}
        if self.bounce:
            seen["cells"] = self.bounce.index(points + normal * np.float32(0.5 * FIBRE_RADIUS)).astype(np.int32)
        w = view.astype(np.float32)
        seen["sin_out"] = tangent @ w
        return seen

    def illuminate(self, light):
        """Returns the shadow map of a light and the field of light that fibres give each other."""
        rays = MAP_RAYS_PER_TEXEL * self.size
        z, segment = self.trace(light, rays, (0.0, 0.0))
        lamp = {"map": ShadowMap(z.reshape(rays, rays), light), "light": light.astype(np.float32)}
        if self.bounce:
            points = points_at(rays, (0.0, 0.0), light, z)
            albedo = np.where((segment >= 0)[:, None], self.albedo[np.maximum(segment, 0)], self.table)
            lamp["field"] = self.bounce.fluence(points, albedo * np.float32(light[2] / rays**2))
        return lamp

    def shade(self, seen, lamp, view):
        """Returns X `[sample, channel]` of what is seen under a lamp."""
        w_in, w_out = lamp["light"], view.astype(np.float32)
        tangent, normal, fibre = seen["tangent"], seen["normal"], seen["fibre"]
        bias = 0.5 / (MAP_RAYS_PER_TEXEL * self.size)
        sin_in, sin_out = tangent @ w_in, seen["sin_out"]
        cos_in = np.sqrt(np.maximum(1 - sin_in**2, 1e-6))
        cos_out = np.sqrt(np.maximum(1 - sin_out**2, 1e-6))
        # The side of the fibre that faces the light: its visibility counts for what does not depend on the normal.
        facing = w_in[None, :] - sin_in[:, None] * tangent
        facing *= ((seen["radius"] + np.float32(bias)) / cos_in)[:, None]
        facing += seen["centre"]
        lit_point = lamp["map"].lit_share(seen["lifted"], bias)
        lit_fibre = lamp["map"].lit_share(facing, bias) * fibre
        surface = np.maximum(normal @ w_in, 0) * lit_point
        diffuse = np.where(fibre > 0, np.float32(SURFACE_SHARE) * surface, surface)
        # Light that enters over the width 2 r leaves over the girth 2 pi r.
        diffuse += np.float32(VOLUME_SHARE / np.pi) * cos_in * lit_fibre
        cos_phi = np.clip((float(w_in @ w_out) - sin_in * sin_out) / (cos_in * cos_out), -1, 1)
        half_phi = np.sqrt(0.5 * (1 + cos_phi))
        # cos of half the difference of the angles to the normal plane, squared.
        cos_d_square = 0.5 * (1 + cos_in * cos_out + sin_in * sin_out)
        angle_sum = np.arcsin(np.clip(sin_in, -1, 1)) + np.arcsin(np.clip(sin_out, -1, 1))
        grazing = 1 - half_phi * np.sqrt(cos_d_square)
        fresnel = np.float32(F0) + np.float32(1 - F0) * grazing**5
        common = np.float32(np.pi) * cos_in / np.maximum(cos_d_square, 0.05) * lit_fibre
        shine = fresnel * gauss(angle_sum, SHINE_SPREAD_RAD) * (half_phi * np.float32(0.25)) * common
        inner = gauss(angle_sum, INNER_SPREAD_RAD) * (1 + cos_phi) * common * np.float32(INNER_SHARE / (2 * np.pi))
        scattered = diffuse[:, None] + inner[:, None] * seen["albedo"]
        if self.bounce:
            # An isotropic field of fluence F has the irradiance F / 4 on every side.
            scattered += 0.25 * lamp["field"].take(seen["cells"], axis=0)
        return seen["albedo"] * scattered + shine[:, None]


def gauss(angle, spread):
    """Returns the normal density of an angle in radians."""
    return np.exp(angle**2 * np.float32(-0.5 / spread**2)) * np.float32(1 / (np.sqrt(2 * np.pi) * spread))

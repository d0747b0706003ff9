"""The chapter "Decoding" of docs/reference/format.md and the lobes of docs/reference/model.md, section 3, in double precision.

`decode` takes the layers that file_form.py or resident_form.py has made of a file; its comments name the steps of the
chapter. Directions are three numbers, colours lists of three.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Callable, Optional

LAMBERTIAN, OREN_NAYAR, BLINN_PHONG, WARD, COOK_TORRANCE = range(5)
LAFORTUNE, ASHIKHMIN_SHIRLEY, GGX, WINDOWED_COSINE = range(5, 9)
ADDITIVE, LOG, ROOT = range(3)
OLD_BASE, GUIDE, BASE = range(3)

# What "Dictionary" lists: of each family the range of each parameter, (0, 0) for those that it does not use.
RANGES = [
    [],
    [(0, 1.5)],
    [(1, 1000)],
    [(0.05, 1), (0.05, 1)],
    [(0.05, 1), (0, 1)],
    [(-1, 1), (-1, 1), (-1, 1), (0.5, 500)],
    [(1, 1000), (1, 1000), (0, 1)],
    [(0.05, 1), (0, 1)],
    [(0, 60), (-0.98, 0.98), (-0.98, 0.98)],
]
RANGES = [ranges + [(0, 0)] * (4 - len(ranges)) for ranges in RANGES]


def within_ranges(params, family):
    """Whether they are in their ranges, widened as "Dictionary" says."""
    pairs = zip(params, RANGES[family])
    return all(low - 0.001 * abs(low) <= p <= high + 0.001 * abs(high) for p, (low, high) in pairs)


def within_relief_ranges(likeness, shading, gloss):
    """Those of the section "Relief"."""
    return 0 <= likeness <= 10000 and 0 <= shading <= 1 and 0 <= gloss <= 1


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def clamp(x, least, most):
    return min(most, max(least, x))


def raised(x, y):
    """The unit vector above the disk point (x, y)."""
    return x, y, math.sqrt(1 - x * x - y * y)


@dataclass
class Sphere:
    """A direction set: `triangles` are corner, matrix and ids, `edges` start, extent, inverse and ids, and `items` of
    cell i those from `offsets[i]` on, triangles' numbers and edges' with bit 31."""

    directions: list
    triangles: list
    edges: list
    side: int
    offsets: list
    items: list


@dataclass
class Lobe:
    family: int
    normal: tuple
    tangent: tuple
    # A windowed cosine's are k, m.x, m.y, m.z.
    params: tuple
    scale: float


@dataclass
class Edit:
    tint: tuple
    keep: float
    # The layer's dictionaries as the edit has them.
    dictionaries: list


@dataclass
class Relief:
    likeness: float
    shading: float
    gloss: float
    # What gives a texel's record: slopes p and q; codes of red, green and blue over 255; the eight horizons.
    # None without a residual.
    record: Optional[Callable] = None


@dataclass
class Layer:
    """A layer at one level."""

    light_side: int
    view_side: int
    residual_kind: int
    epsilon: float
    lobe_role: int
    horizon: float
    lights: Sphere
    views: Sphere
    dictionaries: list
    edits: list
    width: int
    height: int
    clusters: list
    references: list
    # Of each texel its edit, counted from 1; 0 for none.
    texel_edits: list
    # The height codes and what one is in texel widths.
    height_codes: Optional[list]
    height_step: float
    # The codes of each component, and what gives (texel, view, light) its residual; None without one.
    codes: list = field(default_factory=list)
    residual: Optional[Callable] = None
    relief: Optional[Relief] = None
    # Of each shown value the weights of the channels, where there is a spectrum.
    shown: Optional[list] = None


# model.md, section 3


def carried(normal, angle):
    """The tangent: x carried along by the least rotation of z to the normal, turned about the normal by the angle."""
    x, y, z = normal
    carried_x = 1 - x * x / (1 + z), -x * y / (1 + z), -x
    carried_y = -x * y / (1 + z), 1 - y * y / (1 + z), -y
    return tuple(math.cos(angle) * a + math.sin(angle) * b for a, b in zip(carried_x, carried_y))


def lobe_value(lobe, wi, wo):
    """`rho` of sections 3.1 and 3.2."""
    n, t, b = lobe.normal, lobe.tangent, cross(lobe.normal, lobe.tangent)
    p0, p1, p2, p3 = lobe.params
    ci, co = dot(n, wi), max(dot(n, wo), 0.02)
    if ci <= 0:
        return 0.0
    between = [a + b for a, b in zip(wi, wo)]
    h = [a / max(math.sqrt(dot(between, between)), 0.001) for a in between]
    nh, th, bh = clamp(dot(n, h), 0, 1), dot(t, h), dot(b, h)
    vh = clamp(dot(wo, h), 0.001, 1)

    def fresnel(f0):
        return f0 + (1 - f0) * (1 - vh) ** 5

    if lobe.family == LAMBERTIAN:
        return ci
    if lobe.family == OREN_NAYAR:
        variance = p0 * p0
        a, b = 1 - 0.5 * variance / (variance + 0.33), 0.45 * variance / (variance + 0.09)
        return ci * (a + b * max(0, dot(wi, wo) - ci * co) / max(ci, co))
    if lobe.family == BLINN_PHONG:
        return ci * (p0 + 8) / 8 * nh**p0
    if lobe.family == WARD:
        if nh == 0:
            return 0.0
        return math.sqrt(ci / co) / (4 * p0 * p1) * math.exp(-((th / p0) ** 2 + (bh / p1) ** 2) / nh / nh)
    if lobe.family == COOK_TORRANCE:
        # Below, the exponential is 0 in double precision, too.
        if nh < 1e-3:
            return 0.0
        d = math.exp((nh * nh - 1) / (p0 * p0 * nh * nh)) / (p0 * p0 * nh**4)
        g = min(1, 2 * nh * min(ci, co) / vh)
        return fresnel(p1) * d * g / (4 * co)
    if lobe.family == LAFORTUNE:
        cosine = p0 * dot(t, wi) * dot(t, wo) + p1 * dot(b, wi) * dot(b, wo) + p2 * dot(n, wi) * dot(n, wo)
        return ci * clamp(cosine, 0, 1) ** p3
    if lobe.family == ASHIKHMIN_SHIRLEY:
        power = nh ** ((p0 * th * th + p1 * bh * bh) / (1 - nh * nh)) if nh < 1 else 1
        return ci * math.sqrt((p0 + 1) * (p1 + 1)) / 8 * power * fresnel(p2) / (vh * max(ci, co))
    if lobe.family == GGX:
        a2 = p0 * p0
        d = a2 / (nh * nh * (a2 - 1) + 1) ** 2
        w = 0.5 / (ci * math.sqrt(co * co * (1 - a2) + a2) + co * math.sqrt(ci * ci * (1 - a2) + a2))
        return fresnel(p1) * d * w * ci
    return ci * math.exp(p0 * (dot((p1, p2, p3), wo) - 1))


# Step 10, the table


def edited_lobe(lobe, angle, diffuse, specular, roughness, tilt):
    """A lobe as an edit changes it; `angle` is its tangent angle."""
    if (diffuse, specular, roughness) == (1, 1, 1) and not any(tilt):
        return lobe
    family, p, scale = lobe.family, list(lobe.params), lobe.scale
    exponent = p[3]
    if family in (OREN_NAYAR, COOK_TORRANCE, GGX, WARD):
        p[0] *= roughness
    if family == WARD:
        p[1] *= roughness
    if family in (BLINN_PHONG, WINDOWED_COSINE, ASHIKHMIN_SHIRLEY):
        p[0] /= roughness**2
    if family == ASHIKHMIN_SHIRLEY:
        p[1] /= roughness**2
    if family == LAFORTUNE:
        p[3] /= roughness**2
    p = [clamp(x, *bounds) for x, bounds in zip(p, RANGES[family])]
    if family == LAFORTUNE:
        scale *= (p[3] + 1) / (exponent + 1)
    if family == WINDOWED_COSINE:
        p[1:] = raised(*shortened(p[1], p[2]))
    normal = raised(*shortened(lobe.normal[0] + tilt[0], lobe.normal[1] + tilt[1]))
    scale *= diffuse if family in (LAMBERTIAN, OREN_NAYAR, WINDOWED_COSINE) else specular
    return replace(lobe, normal=normal, tangent=carried(normal, angle), params=tuple(p), scale=scale)


def shortened(x, y):
    length2 = x * x + y * y
    factor = math.sqrt(0.97 / length2) if length2 > 0.98 else 1
    return x * factor, y * factor


def keep(diffuse, specular, roughness, tilt, fade):
    logarithms = sum(abs(math.log(max(3.4e-4, factor))) for factor in (diffuse, specular, roughness))
    return math.exp(-fade * (logarithms + math.hypot(*tilt)))


# Steps 2, 4 and 5


def lobe_sum(layer, dictionaries, texel, wi, wo):
    total = [0.0] * 3
    for number, *codes in layer.references[texel]:
        lobe = dictionaries[layer.clusters[texel]][number]
        value = lobe.scale * lobe_value(lobe, wi, wo)
        total = [s + value * (q / 255) ** 2 for s, q in zip(total, codes)]
    return total


def neighbours(sphere, w):
    """`([(id, weight), ...], beyond)`."""

    def cell(x):
        return int(clamp(math.floor((x + 1) / 2 * sphere.side), 0, sphere.side - 1))

    at = cell(w[1]) * sphere.side + cell(w[0])
    items = sphere.items[sphere.offsets[at] : sphere.offsets[at + 1]]
    edges = [item - 2**31 for item in items if item >= 2**31]
    best, inside = None, -math.inf
    for triangle in (item for item in items if item < 2**31):
        x, y, a, b, c, d, *ids = sphere.triangles[triangle]
        dx, dy = w[0] - x, w[1] - y
        w1, w2 = a * dx + b * dy, c * dx + d * dy
        weights = 1 - w1 - w2, w1, w2
        if min(weights) > inside:
            best, inside = (ids, weights), min(weights)
    if best and (inside >= -1e-5 or not edges):
        ids, weights = best[0], [max(0, weight) for weight in best[1]]
        return [(i, weight / sum(weights)) for i, weight in zip(ids, weights)], 1.0
    best, least = None, math.inf
    for edge in edges:
        x, y, dx, dy, inverse, *ids = sphere.edges[edge]
        t = clamp(((w[0] - x) * dx + (w[1] - y) * dy) * inverse, 0, 1)
        c = x + t * dx, y + t * dy
        if math.dist(w[:2], c) < least:
            best, least = (ids, t, c), math.dist(w[:2], c)
    (p, q), t, c = best
    return [(p, 1 - t), (q, t)], min(1, w[2] / math.sqrt(max(1e-6, 1 - c[0] ** 2 - c[1] ** 2)))


def curve(layer, x):
    if layer.residual_kind == ADDITIVE:
        return x
    x = max(0, x) + layer.epsilon
    return math.log(x) if layer.residual_kind == LOG else x ** (1 / 2.4)


def inverse(layer, y):
    if layer.residual_kind == ADDITIVE:
        return y
    return (math.exp(clamp(y, -12, 12)) if layer.residual_kind == LOG else max(0, y) ** 2.4) - layer.epsilon


def combine(layer, s, r, beyond):
    """Per channel; lobes that only guide are no part of the value."""
    if layer.lobe_role == GUIDE:
        return beyond * max(0, inverse(layer, curve(layer, 0) + r))
    if layer.lobe_role == OLD_BASE:
        r *= {ADDITIVE: beyond, LOG: 1, ROOT: max(1e-12, beyond) ** (1 / 2.4)}[layer.residual_kind]
    return max(0, inverse(layer, curve(layer, s) + r))


# Step 8


def slope(d):
    s = d[0] / max(1e-6, d[2]), -d[1] / max(1e-6, d[2])
    length = math.hypot(*s)
    return tuple(x * 10 / length for x in s) if length > 10 else s


def around(layer, place):
    """`[(texel, weight), ...]`: the four texels around a place, bilinear; the outermost ones are continued."""

    def cells(x, count):
        x = clamp(x, 0, count - 1)
        low = min(math.floor(x), max(0, count - 2))
        return (low, 1 - (x - low)), (min(low + 1, count - 1), x - low)

    columns, rows = cells(place[0], layer.width), cells(place[1], layer.height)
    return [(row * layer.width + column, u * v) for row, v in rows for column, u in columns]


def height_at(layer, place):
    return layer.height_step * sum(weight * layer.height_codes[texel] for texel, weight in around(layer, place))


def place_of(layer, texel):
    return texel % layer.width, texel // layer.width


def moved(place, length, s):
    return place[0] + length * s[0], place[1] + length * s[1]


def hit(layer, place, s):
    least, most = (layer.height_step * end(layer.height_codes) for end in (min, max))
    n = clamp(math.ceil(2 * math.hypot(*s) * (most - least) - 1e-4), 8, 64)
    z_before, above_before = most, max(0, most - height_at(layer, moved(place, most, s)))
    for i in range(1, n + 1):
        z = most - (most - least) * i / n
        above = z - height_at(layer, moved(place, z, s))
        if above <= 0:
            part = above_before / (above_before - above) if above_before > above else 0
            return z_before + (z - z_before) * part
        z_before, above_before = z, above
    return least


def shown(layer, texel, wo, views, beyond):
    """`[(view, weight, texel), ...]`: each view neighbour with the texel that it shows."""
    part = clamp(5 * (1 - beyond), 0, 1)
    if layer.height_codes is None or part == 0:
        return [(view, weight, texel) for view, weight in views]
    x = place_of(layer, texel)
    s_eye = slope(wo)
    z = hit(layer, x, s_eye)
    result = []
    for view, weight in views:
        if weight == 0:
            continue
        s = slope(layer.views.directions[view])
        x_v = moved(x, z, (s_eye[0] - s[0], s_eye[1] - s[1]))
        column, row = (
            int(clamp(math.floor(own + part * (other - own) + 0.5), 0, count - 1))
            for own, other, count in zip(x, x_v, (layer.width, layer.height))
        )
        visible = (1 - min(1, (hit(layer, x_v, s) - z) ** 2)) ** 2
        if not all(-0.5 <= at <= count - 0.5 for at, count in zip(x_v, (layer.width, layer.height))):
            visible *= 0.1
        weight *= 0.05 + 0.95 * (1 + part * (visible - 1))
        result.append((view, weight, row * layer.width + column))
    total = sum(weight for _, weight, _ in result)
    return [(view, weight / total, texel) for view, weight, texel in result]


# Step 9, records

DIAGONAL = math.sqrt(0.5)
# In columns and rows: right, then against the clock by 45 degrees each.
AZIMUTHS = [
    (1, 0),
    (DIAGONAL, -DIAGONAL),
    (0, -1),
    (-DIAGONAL, -DIAGONAL),
    (-1, 0),
    (-DIAGONAL, DIAGONAL),
    (0, 1),
    (DIAGONAL, DIAGONAL),
]
# How far from a texel its horizon is looked for, in texel widths.
DISTANCES = [1 + 0.75 * i for i in range(11)] + [10 + 1.5 * i for i in range(21)]


def relief_record(layer, stored, texel):
    """A texel's record as `Relief` has it; `stored` gives (texel, view, light) the residual of the stored bases."""
    x = place_of(layer, texel)
    p = (height_at(layer, moved(x, 1, (1, 0))) - height_at(layer, moved(x, 1, (-1, 0)))) / 2
    q = (height_at(layer, moved(x, 1, (0, -1))) - height_at(layer, moved(x, 1, (0, 1)))) / 2
    slopes = [clamp(nearest(8192 * slope), -32768, 32767) / 8192 for slope in (p, q)]
    horizons = [min(255, nearest(64 * horizon(layer, x, azimuth))) / 64 for azimuth in AZIMUTHS]
    return [*slopes, *(code / 255 for code in albedo_codes(layer, stored, texel)), *horizons]


def nearest(x):
    """The nearest whole number, halves upwards."""
    return math.floor(x + 0.5)


def horizon(layer, x, azimuth):
    own, most = height_at(layer, x), 0.0
    for distance in DISTANCES:
        place = moved(x, distance, azimuth)
        if not all(0 <= at <= count - 1 for at, count in zip(place, (layer.width, layer.height))):
            break
        most = max(most, (height_at(layer, place) - own) / distance)
    return most


def albedo_codes(layer, stored, texel):
    """Those of the roots of an albedo in red, green and blue."""
    lights, views = layer.lights.directions, layer.views.directions
    upright = max(range(len(views)), key=lambda view: views[view][2])
    residuals = [stored(texel, upright, light) for light in range(len(lights))]
    white = max(0.002, inverse(layer, sum(curve(layer, light[2]) for light in lights) / len(lights)))
    codes = []
    for c in range(3):
        y = curve(layer, 0) + sum(residual[c] for residual in residuals) / len(lights)
        albedo = clamp(inverse(layer, y) / white, 0.002, 2.4) / 1.2
        codes.append(nearest(255 * math.sqrt(albedo / 2)))
    return codes


# Step 9


@dataclass
class Point:
    """A point of the relief, seen or lit."""

    normal: tuple
    # Those of red, green and blue over 255.
    codes: list
    horizons: list

    def albedo(self):
        return [2 * code**2 for code in self.codes]


def point_at(layer, place):
    records = [(weight, layer.relief.record(texel)) for texel, weight in around(layer, place)]
    p, q, *others = (sum(weight * record[i] for weight, record in records) for i in range(13))
    length = math.sqrt(p * p + q * q + 1)
    return Point((-p / length, -q / length, 1 / length), others[:3], others[3:])


def point_seen(layer, texel, d):
    """The point that an eye at `d` sees in a texel."""
    x, s = place_of(layer, texel), slope(d)
    return point_at(layer, moved(x, hit(layer, x, s), s))


def horizon_towards(point, l):
    x, y = abs(l[0]), abs(l[1])
    azimuth = min(x, y) / max(x, y, 1e-6)
    if y > x:
        azimuth = 2 - azimuth
    if l[0] < 0:
        azimuth = 4 - azimuth
    if l[1] < 0:
        azimuth = 8 - azimuth
    low = math.floor(azimuth)
    part = azimuth - low
    return (1 - part) * point.horizons[low % 8] + part * point.horizons[(low + 1) % 8]


def body_and_gloss(layer, point, l, d):
    """B, three numbers, and G of a point under light `l` for an eye at `d`."""
    n = point.normal
    nl = max(0, dot(n, l))
    above_horizon = l[2] / max(1e-4, math.hypot(l[0], l[1])) - horizon_towards(point, l)
    lit = nl * clamp(above_horizon / 0.4 + 0.5, 0, 1)
    body = [albedo * (lit + 0.2 * l[2]) for albedo in point.albedo()]
    if layer.relief.gloss == 0:
        return body, 0.0
    between = [a + b for a, b in zip(l, d)]
    h = [a / math.sqrt(dot(between, between)) for a in between]
    nd, nh, a2 = max(0.02, dot(n, d)), max(0, dot(n, h)), 0.09
    fresnel = 0.04 + 0.96 * (1 - dot(d, h)) ** 5
    distribution = a2 / (nh * nh * (a2 - 1) + 1) ** 2
    visibility = 0.5 / (1e-6 + nl * math.sqrt(nd * nd * (1 - a2) + a2) + nd * math.sqrt(nl * nl * (1 - a2) + a2))
    return body, fresnel * distribution * visibility * lit


def shaded(layer, point, l, d, flat):
    """`(E, added)`, three numbers each; `flat` is the F of the text."""
    body, gloss = body_and_gloss(layer, point, l, d)
    all_shaded, added = [], []
    for b, f in zip(body, flat):
        g_body, g_all = curve(layer, b), curve(layer, b + gloss)
        all_shaded.append(g_all)
        added.append(layer.relief.shading * (g_body - curve(layer, f * l[2])) + layer.relief.gloss * (g_all - g_body))
    return all_shaded, added


def distance2(a, b):
    return sum((x - y) ** 2 for x, y in zip(a, b))


def shares(weights):
    return [weight / sum(weights) for weight in weights]


def weighted_sum(weights, vectors):
    return [sum(weight * x for weight, x in zip(weights, xs)) for xs in zip(*vectors)]


def with_relief(layer, texel, views, lights, wi, beyond, wo, hull_wi, hull_wo):
    """`(views, lights, added)`: the neighbours with the weights that relief gives them, and what it adds to the
    residual. `hull_wi` and `hull_wo` are light and eye, beyond the measured ones those of the hull; `beyond` is the
    light's."""
    likeness = layer.relief.likeness
    seen = point_seen(layer, texel, wo)
    directions = [layer.views.directions[view] for view, _, _ in views]
    points = [point_seen(layer, place, d) for d, (_, _, place) in zip(directions, views)]
    own_points = [point_at(layer, place_of(layer, place)) for _, _, place in views]
    flats = [[1.2 * albedo for albedo in point.albedo()] for point in own_points]

    def unlike(point):
        return distance2(point.codes, seen.codes) / 3 + 0.1 * distance2(point.normal, seen.normal)

    of_views = shares([weight / (1 + likeness * unlike(point)) for (_, weight, _), point in zip(views, points)])
    flat = weighted_sum(of_views, flats)
    here, added = shaded(layer, seen, hull_wi, hull_wo, flat)
    if beyond < 1:
        added = [x / max(0.3, beyond) for x in shaded(layer, seen, wi, hull_wo, flat)[1]]
    of_lights, added_there = [], []
    for light, weight in lights:
        l = layer.lights.directions[light]
        there = [shaded(layer, point, l, d, flat) for point, d, flat in zip(points, directions, flats)]
        of_lights.append(weight / (1 + likeness * distance2(weighted_sum(of_views, [e for e, _ in there]), here) / 3))
        added_there.append(weighted_sum(of_views, [own for _, own in there]))
    of_lights = shares(of_lights)
    views = [(view, weight, place) for (view, _, place), weight in zip(views, of_views)]
    lights = [(light, weight) for (light, _), weight in zip(lights, of_lights)]
    return views, lights, [a - b for a, b in zip(added, weighted_sum(of_lights, added_there))]


# All steps


def at_hull(sphere, own, d, beyond):
    """The direction, or beyond the measured ones that of the hull's nearest point; `own` are its neighbours."""
    if beyond == 1:
        return d
    ends = [(sphere.directions[i], weight) for i, weight in own]
    x, y = (sum(weight * end[axis] for end, weight in ends) for axis in range(2))
    return x, y, math.sqrt(max(1e-6, 1 - x * x - y * y))


def decode(levels, number, level, texel, wi, wo, rule):
    """The value, three numbers, of a texel of a level (0 the finest) by the rule "fast" or "exact"; `levels` holds the
    layers of each level."""
    layer = levels[level][number]
    if not layer.shown:
        return decode_group(layer, 0, texel, wi, wo, rule)
    # 11. Spectrum
    groups, count = len(layer.shown[0]) // 3, len(layer.lights.directions)
    values = [x for g in range(groups) for x in decode_group(layer, g * count // groups, texel, wi, wo, rule)]
    return [max(0, sum(w * min(x, 1e30) for w, x in zip(row, values))) for row in layer.shown]


def decode_group(layer, first, texel, wi, wo, rule):
    """The value of the group of channels whose lights begin with number `first`."""
    # 1. Sides
    wi = (*wi[:2], -wi[2] if layer.light_side == 1 else wi[2])
    wo = (*wo[:2], -wo[2] if layer.view_side == 1 else wo[2])
    if wi[2] <= 0 or wo[2] <= 0:
        return [0.0] * 3
    # 3. Horizon
    fade = min(1, wi[2] / layer.horizon)
    # 4. Neighbours, 8. Parallax
    lights, beyond = neighbours(layer.lights, wi)
    lights = [(light + first, weight) for light, weight in lights]
    falls = layer.residual and layer.lobe_role == BASE and rule == "fast"
    toward = at_hull(layer.lights, lights, wi, beyond) if falls else wi
    own_views, beyond_views = neighbours(layer.views, wo)
    views = shown(layer, texel, wo, own_views, beyond_views)
    # 9. Relief
    added = [0.0] * 3
    if layer.relief and layer.residual and rule == "fast":
        hull_wo = at_hull(layer.views, own_views, wo, beyond_views)
        views, lights, added = with_relief(layer, texel, views, lights, wi, beyond, wo, toward, hull_wo)
    pairs = [(view, light, v * l, place) for view, v, place in views for light, l in lights]

    def lobes(dictionaries):
        """`S(wi, wo)` of the texels that the views show."""
        sums = [(weight, lobe_sum(layer, dictionaries, place, toward, wo)) for _, weight, place in views]
        return [sum(weight * s[c] for weight, s in sums) for c in range(3)]

    s = lobes(layer.dictionaries)
    if not layer.residual:
        value = [max(0, x) for x in s]
    elif rule == "fast":
        # 6. Rule "fast"
        residuals = [layer.residual(place, view, light) for view, light, _, place in pairs]
        r = weighted_sum([weight for _, _, weight, _ in pairs], residuals)
        value = [combine(layer, s[c], r[c] + added[c], beyond) for c in range(3)]
    else:
        # 7. Rule "exact"
        x_sum, s_sum = [0.0] * 3, [0.0] * 3
        for view, light, weight, place in pairs:
            measured = layer.lights.directions[light], layer.views.directions[view]
            here, r = lobe_sum(layer, layer.dictionaries, place, *measured), layer.residual(place, view, light)
            for c in range(3):
                x_sum[c] += weight * combine(layer, here[c], r[c], 1)
                s_sum[c] += weight * here[c]
        value = [x * clamp((own + 0.03) / (q + 0.03), 0.3, 4) for x, own, q in zip(x_sum, s, s_sum)]
    # 10. Edits
    if layer.texel_edits[texel] > 0:
        edit = layer.edits[layer.texel_edits[texel] - 1]
        changed = lobes(edit.dictionaries)
        value = [
            tint * max(0, inverse(layer, curve(layer, s1) + edit.keep * (curve(layer, x) - curve(layer, s0))))
            for tint, x, s0, s1 in zip(edit.tint, value, s, changed)
        ]
    # Beyond the measured lights the value at their hull falls.
    return [x * fade * (beyond if falls else 1) for x in value]

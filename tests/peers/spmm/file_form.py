"""The chapter "Sections" of docs/reference/format.md: the layers of a file of the file form, by level."""

import math
from dataclasses import replace
from functools import cache

from spmm.container import BASIS, COEFFICIENTS, DICTIONARY, DIRECTIONS, EDITS, FACTORS, HEIGHT, LAYER, LEVEL
from spmm.container import FACTOR_CODES, LOBE_REFS, LOBE_WEIGHTS, PREDICTED_COEFFICIENTS, RELIEF, SHARED_BASES
from spmm.container import SHARED_BASES_PART, SPECTRUM, TEXEL_CLUSTERS, TEXEL_LOBE_COUNTS
from spmm.container import must_repeat, sides_of_levels, spectrum
from spmm.decoding import BASE, ROOT, WINDOWED_COSINE, Edit, Layer, Lobe, Relief, carried, clamp, curve, edited_lobe
from spmm.decoding import keep, lobe_value, raised, relief_record, within_ranges, within_relief_ranges
from spmm.directions import direction_set, single
from spmm.entropy_coder import byte_plane, cluster_ids, lobe_counts, lobe_references, must, plane
from spmm.predicted_coefficients import Groups, factors, shared_bases

FRAME = [
    [1 / math.sqrt(3)] * 3,
    [1 / math.sqrt(2), 0, -1 / math.sqrt(2)],
    [1 / math.sqrt(6), -2 / math.sqrt(6), 1 / math.sqrt(6)],
]


def read(header, show):
    """The layers of each level. `show(name, numbers)` is told what the resident form does not have."""
    edits, texel_edits = read_edits(header)
    for i, edit in enumerate(edits, 1):
        show(f"edit {i}", edit)
    layers = [read_layer(header, i, edits, texel_edits, show) for i in range(header.layers)]
    if header.basis == 1:
        part = header.section(SPECTRUM, 0)
        count, groups = part.numbers("I", 2)
        shown = spectrum(count, groups, lambda n: part.numbers("f", n))
        part.end()
        for layer, _ in layers:
            must_repeat(layer.lights, groups)
            layer.shown = shown
    sides = [(layer.light_side, layer.view_side) for layer, _ in layers]
    must(len(set(sides)) == len(sides), "two layers have the same sides")
    levels = [[layer for layer, _ in layers]]
    for number, size in enumerate(sides_of_levels(header.width, header.height)[1:], 1):
        held = [header.has(LEVEL, i, number) for i in range(header.layers)]
        must(not header.whole or held in ([True] * len(held), [False] * len(held)), "a layer lacks a level of others")
        if not all(held):
            break
        parts = [header.section(LEVEL, i, number) for i in range(header.layers)]
        levels.append([read_level(part, *layer, size) for part, layer in zip(parts, layers)])
    return levels


def read_layer(header, number, edits, texel_edits, show):
    """The finest level of a layer, and the bases' `Bases` or None."""

    def section(kind, index=0):
        return header.section(kind, number, index)

    part = section(LAYER)
    light_side, view_side, kind, _, clusters, components, has_residual, role = part.numbers("I", 8)
    part.end()
    epsilon = section(LAYER).numbers("f", 8)[3]
    must(max(light_side, view_side, has_residual) <= 1 and max(kind, role) <= 2, "a word of a layer is out of its range")
    must(single(1e-6) <= epsilon <= 1, "a layer's epsilon is out of its range")
    must(1 <= clusters <= 256 and components <= 128, "a count of a layer is out of its range")
    lights, views = (direction_set(section(DIRECTIONS, index)) for index in range(2))
    height_codes, height_step, texels = None, 0.0, header.width * header.height
    if header.has(HEIGHT, number):
        part = section(HEIGHT)
        (height_step,) = part.steps(1, 16)
        must(height_step > 0, "a height step is 0")
        height_codes = part.stream(texels, lambda stream: byte_plane(stream, header.width, header.height))

    relief = None
    if header.has(RELIEF, number):
        part = section(RELIEF)
        numbers = part.numbers("f", 3)
        part.end()
        must(within_relief_ranges(*numbers), "a number of a relief is out of its range")
        must(header.has(HEIGHT, number), "a layer with relief has no heights")
        must((kind, role) == (ROOT, BASE), "a layer with relief has another kind of residual or role of lobes")
        must(header.has(LOBE_WEIGHTS, number), "a layer with relief has no lobe weights")
        must(has_residual == 1, "a layer with relief has no residual")
        relief = Relief(*numbers)

    ids = section(TEXEL_CLUSTERS).stream(texels, lambda stream: cluster_ids(stream, header.width, header.height))
    must(max(ids) < clusters, "a cluster is not there")
    dictionaries, angles = read_dictionary(section(DICTIONARY), clusters)
    groups = None
    if has_residual and header.has(PREDICTED_COEFFICIENTS, number, 1):
        groups = Groups(header, number, ids, clusters, components)
    weights = None
    if header.has(LOBE_WEIGHTS, number):
        weights = Weights(header, number, components * has_residual, ids, dictionaries, groups)
    if weights and not header.has(TEXEL_LOBE_COUNTS, number):
        kinds = TEXEL_CLUSTERS, DICTIONARY, LOBE_WEIGHTS
        most = sum(len(dictionaries[k]) for k in ids)
        must(most <= 4096 * sum(len(section(kind).data) for kind in kinds), "there are too many lobes")
        references = [weights.references(k, inputs) for k, inputs in zip(ids, weights.of_texels)]
    else:
        counts = section(TEXEL_LOBE_COUNTS).stream(texels, lambda stream: lobe_counts(stream, ids))
        references = section(LOBE_REFS).stream(sum(counts), lambda stream: lobe_references(stream, ids, counts))
    must_have_lobes(references, ids, dictionaries)
    lobes = sum(map(len, dictionaries))
    must(len(edits) * (9 + clusters + 16 * lobes) <= 2**24, "there are too many edits")

    def changed(edit):
        tint, (diffuse, specular, roughness, *tilt, fade) = edit[:3], edit[3:]
        parts = diffuse, specular, roughness, tilt
        lobes = (zip(*both) for both in zip(dictionaries, angles))
        changed = [[edited_lobe(lobe, angle, *parts) for lobe, angle in of_cluster] for of_cluster in lobes]
        return Edit(tint, keep(*parts, fade), changed)

    layer = Layer(
        light_side=light_side,
        view_side=view_side,
        residual_kind=kind,
        epsilon=epsilon,
        lobe_role=role,
        horizon=max(1e-6, min(0.1, *(d[2] for d in lights.directions))),
        lights=lights,
        views=views,
        dictionaries=dictionaries,
        edits=[changed(edit) for edit in edits],
        width=header.width,
        height=header.height,
        clusters=ids,
        references=references,
        texel_edits=texel_edits,
        height_codes=height_codes,
        height_step=height_step,
        relief=relief,
    )
    for name, sphere in ("light", lights), ("view", views):
        show(f"layer {number}: {name} directions", flat(sphere.directions))
        show(f"layer {number}: {name} triangles", flat(sphere.triangles))
        show(f"layer {number}: {name} edges", flat(sphere.edges))
        show(f"layer {number}: {name} cells a side", [sphere.side])
        show(f"layer {number}: {name} cell offsets", sphere.offsets)
        show(f"layer {number}: {name} items", sphere.items)
    complete = all(header.has(kind, number) for kind in (FACTORS, SHARED_BASES, BASIS))
    if groups:
        of_factors = header.has(FACTORS, number) or header.has(FACTOR_CODES, number)
        complete = of_factors and header.has(SHARED_BASES_PART, number) and bool(groups.bases)
    must(complete or not has_residual or not header.whole, "a part of a residual is missing")
    if not has_residual or not complete:
        return layer, None
    bases = Bases(header, number, layer, components, show, groups)
    if weights:
        weights.take_from(bases, layer)
    return bases.given_to(layer, bases.codes), bases


def read_dictionary(part, clusters):
    """Each cluster's lobes, and their tangent angles."""
    dictionaries, angles = [], []
    for count in part.numbers("I", clusters):
        must(count <= 256, "a dictionary has too many lobes")
        dictionaries.append([])
        angles.append([])
        for _ in range(count):
            family = part.peek("H")
            _, angle, x, y, *params, scale, zero = part.numbers("e", 10)
            must(family <= 8 and all(map(math.isfinite, (angle, x, y, *params, scale))), "a lobe is not finite")
            must(zero == 0 and scale >= 0, "a lobe's weight scale is not allowed")
            must(within_ranges(params, family) and x * x + y * y <= 0.99, "a parameter of a lobe is out of its range")
            if family == WINDOWED_COSINE:
                must(params[1] ** 2 + params[2] ** 2 <= 0.99, "a window's axis is out of its range")
                params[1:] = raised(*params[1:3])
            normal = raised(x, y)
            dictionaries[-1].append(Lobe(family, normal, carried(normal, angle), tuple(params), scale))
            angles[-1].append(angle)
    part.end()
    return dictionaries, angles


def read_edits(header):
    """Nine numbers of each edit, and of each texel its edit."""
    texels = header.width * header.height
    if not header.has(EDITS, 0):
        return [], [0] * texels
    part = header.section(EDITS, 0)
    (count,) = part.numbers("I", 1)
    must(1 <= count <= 255, "the number of edits is out of its range")
    edits = [part.numbers("f", 9) for _ in range(count)]
    for *factors, roughness, x, y, fade in edits:
        must(all(0 <= factor <= 16 for factor in (*factors, fade)), "a number of an edit is out of its range")
        must(0.1 <= roughness <= 10 and max(abs(x), abs(y)) <= 0.9, "a number of an edit is out of its range")
    of_texels = part.stream(texels, lambda stream: cluster_ids(stream, header.width, header.height))
    must(max(of_texels) <= count, "an edit is not there")
    return edits, of_texels


def read_level(part, finest, bases, size):
    """A coarser level of a layer whose finest level and bases are known."""
    width, height = size
    texels = width * height
    (components,) = part.numbers("I", 1)
    must(components <= len(finest.codes), "a level has more components than its layer")
    (step,) = part.steps(1, 16)
    planes = components + (step > 0)

    def read(stream):
        ids = cluster_ids(stream, width, height)
        must(max(ids) < len(finest.dictionaries), "a cluster is not there")
        counts = lobe_counts(stream, ids)
        stream.will_read(sum(counts))
        references = lobe_references(stream, ids, counts)
        return ids, references, [byte_plane(stream, width, height) for _ in range(planes)]

    ids, references, codes = part.stream(texels * (2 + planes), read)
    must_have_lobes(references, ids, finest.dictionaries)
    heights = codes.pop(0) if step > 0 else None
    # An edit is that of the finest texel in the middle.
    columns = [((2 * x + 1) * finest.width) // (2 * width) for x in range(width)]
    rows = [((2 * y + 1) * finest.height) // (2 * height) for y in range(height)]
    layer = replace(
        finest,
        width=width,
        height=height,
        clusters=ids,
        references=references,
        texel_edits=[finest.texel_edits[row * finest.width + column] for row in rows for column in columns],
        height_codes=heights,
        height_step=step,
    )
    return bases.given_to(layer, codes) if bases else layer


class Weights:
    """The lobe weights of a layer: `codes[cluster][lobe][channel]`, and the inputs of texels and of clusters' nodes."""

    def __init__(self, header, number, components, ids, dictionaries, groups):
        part = header.section(LOBE_WEIGHTS, number)
        inputs, most, stored = part.numbers("I", 3)
        (self.step,) = part.numbers("f", 1)
        must(inputs <= 16 and most <= 64 and stored <= 1, "a count of the lobe weights is out of its range")
        self.units = part.numbers("f", inputs)
        must(all(0 < x < math.inf for x in [self.step, *self.units]), "a step or unit of lobe weights is not above 0")
        counts = part.numbers("I", len(dictionaries)) if stored else []
        must(all(count <= most for count in counts), "a cluster has too many nodes")
        width, rows = 1 + inputs, 3 * sum(map(len, dictionaries))

        def read(stream):
            codes = plane(stream, width, rows, -32768, 32767)
            return codes, byte_plane(stream, inputs, sum(counts)) if stored else []

        codes, of_nodes = part.stream(rows * width + sum(counts) * inputs, read)
        rows = iter([codes[i : i + width] for i in range(0, len(codes), width)])
        self.codes = [[[next(rows) for _ in range(3)] for _ in lobes] for lobes in dictionaries]
        planes = groups.planes[:inputs] if groups else []
        for j in range(1, 1 if groups else min(inputs, components) + 1):
            if not header.has(COEFFICIENTS, number, j):
                break
            part = header.section(COEFFICIENTS, number, j)
            part.steps(1, 1e9)
            planes.append(part.stream(len(ids), lambda stream: byte_plane(stream, header.width, header.height)))
        self.of_texels = [[codes[texel] for codes in planes] + [0] * (inputs - len(planes)) for texel in range(len(ids))]
        if stored:
            nodes = iter(of_nodes[i * inputs : (i + 1) * inputs] for i in range(sum(counts)))
            self.nodes = [[next(nodes) for _ in range(count)] for count in counts]
        else:
            self.nodes = []
            for k in range(len(dictionaries)):
                members = [texel for texel, cluster in enumerate(ids) if cluster == k]
                count = min(most, len(members))
                self.nodes.append([self.of_texels[members[i * len(members) // count]] for i in range(count)])

    def references(self, k, inputs):
        references = []
        for lobe, channels in enumerate(self.codes[k]):
            weights = []
            for constant, *slopes in channels:
                u = self.step * (constant + sum(q * (c / unit) for q, c, unit in zip(slopes, inputs, self.units)))
                u = single(clamp(u, 0, 1))
                weights.append(min(range(256), key=lambda code: abs((code / 255) ** 2 - u)))
            if any(weights):
                references.append([lobe, *weights])
        return references

    def take_from(self, bases, layer):
        """Has the bases subtract what the lobes give."""
        pairs = [(wo, wi) for wo in layer.views.directions for wi in layer.lights.directions]
        for k, nodes in enumerate(self.nodes):
            lobes = layer.dictionaries[k]
            if not nodes or not lobes:
                continue
            references = [self.references(k, node) for node in nodes]
            factors = nearest_affine(nodes)
            for pair, (wo, wi) in enumerate(pairs):
                values = [lobe.scale * lobe_value(lobe, wi, wo) for lobe in lobes]
                for c in range(3):
                    sums = [sum(values[own[0]] * (own[1 + c] / 255) ** 2 for own in lobes_) for lobes_ in references]
                    y = [curve(layer, s) - curve(layer, 0) for s in sums]
                    columns = range(1 + len(self.units))
                    bases.taken[k, pair, c] = [sum(own[j] * x for own, x in zip(factors, y)) for j in columns]


def nearest_affine(nodes):
    """Of each node the factors of its value in the constant and the slopes of the nearest affine function."""
    count, inputs = len(nodes), len(nodes[0])
    means = [sum(node[i] for node in nodes) / count for i in range(inputs)]
    centred = [[c - m for c, m in zip(node, means)] for node in nodes]
    matrix = [[sum(node[i] * node[j] for node in centred) for j in range(inputs)] for i in range(inputs)]
    for i in range(inputs):
        matrix[i][i] += 0.001 * count
    slopes = solve(matrix, [[node[i] for node in centred] for i in range(inputs)])
    return [
        [1 / count - sum(slopes[i][s] * means[i] for i in range(inputs)), *(slopes[i][s] for i in range(inputs))]
        for s in range(count)
    ]


def solve(matrix, right):
    """Gauss-Jordan elimination; the matrix is positive definite."""
    rows = [own + other for own, other in zip(matrix, right)]
    for i in range(len(rows)):
        rows[i] = [x / rows[i][i] for x in rows[i]]
        for j in range(len(rows)):
            if j != i:
                factor = rows[j][i]
                rows[j] = [x - factor * y for x, y in zip(rows[j], rows[i])]
    return [row[len(rows) :] for row in rows]


class Bases:
    """The bases of a layer at all pairs, in double precision, and the codes of the finest level's texels."""

    def __init__(self, header, number, layer, components, show, groups):
        lights, views, clusters = len(layer.lights.directions), len(layer.views.directions), len(layer.dictionaries)
        self.lights, self.views = lights, views
        # What lobes take, by cluster, pair and channel: a constant, and for a code of 1 of each component.
        self.taken = {}
        if groups and header.has(FACTOR_CODES, number):
            self.ranks, self.factors = factors(header, number, views, lights)
        else:
            part = header.section(FACTORS, number)
            words = part.numbers("I", 8)
            must(max(words[:6]) <= 256 and words[6:] == [0, 0], "a rank is out of its range")
            self.ranks = [words[0:2], words[2:4], words[4:6]]
            self.factors = [(part.numbers("e", views * rv), part.numbers("e", lights * rl)) for rv, rl in self.ranks]
            must(all(math.isfinite(x) for pair in self.factors for m in pair for x in m), "a factor is not finite")
            part.end()
        must(views * lights * 3 * clusters * ((components + 2) // 2) <= 2**28, "the expanded bases are too large")

        core = sum(rv * rl for rv, rl in self.ranks)
        if groups:
            steps, codes = shared_bases(header, number, core, groups.shared)
            shared = len(steps)
        else:
            part = header.section(SHARED_BASES, number)
            (shared,) = part.numbers("I", 1)
            must(shared <= 1024, "there are too many shared bases")
            steps = part.steps(shared, 1e4)
            codes = part.stream(shared * core, lambda stream: plane(stream, core, shared, -32768, 32767))
        show(f"layer {number}: shared bases", codes)
        shared_cores = [[step * q for q in codes[r * core : (r + 1) * core]] for r, step in enumerate(steps)]

        # Bases and coefficients that are complete, in order; of each basis and cluster `[pair][rgb]`.
        self.at_pairs, self.codes, self.steps = [], [], [1.0]
        for j in range(len(groups.bases) if groups else components + 1):
            complete = header.has(BASIS, number, j) and (j == 0 or groups or header.has(COEFFICIENTS, number, j))
            must(complete or not header.whole, "a part of a residual is missing")
            if not complete:
                break
            if groups:
                steps, codes = groups.bases[j]
                rows = range(0, len(codes), max(1, groups.shared))
                codes = [code for at in rows for code in codes[at : at + shared]]
            else:
                part = header.section(BASIS, number, j)
                steps = part.steps(clusters, 1e4)
                codes = part.stream(clusters * shared, lambda stream: plane(stream, shared, clusters, -32768, 32767))
            show(f"layer {number}: basis {j}", codes)
            self.at_pairs.append([])
            for k in range(clusters):
                weights = [steps[k] * q for q in codes[k * shared : (k + 1) * shared]]
                mixed = [sum(w * entries[i] for w, entries in zip(weights, shared_cores)) for i in range(core)]
                show(f"layer {number}: core {j} of cluster {k}", mixed)
                self.at_pairs[j].append(self.expanded(mixed))
            if groups and j > 0:
                self.steps.append(groups.steps[j - 1])
                self.codes.append(groups.planes[j - 1])
            elif j > 0:
                part = header.section(COEFFICIENTS, number, j)
                self.steps += part.steps(1, 1e9)
                texels = layer.width * layer.height
                self.codes.append(part.stream(texels, lambda stream: byte_plane(stream, layer.width, layer.height)))

    def expanded(self, core):
        rgb, at = [[0.0] * 3 for _ in range(self.views * self.lights)], 0
        for (rv, rl), (view, light), frame in zip(self.ranks, self.factors, FRAME):
            for v in range(self.views):
                row = [sum(view[v * rv + r] * core[at + r * rl + s] for r in range(rv)) for s in range(rl)]
                for l in range(self.lights):
                    b = sum(x * light[l * rl + s] for s, x in enumerate(row))
                    pair = rgb[v * self.lights + l]
                    pair[:] = [x + b * e for x, e in zip(pair, frame)]
            at += rv * rl
        return rgb

    def given_to(self, layer, codes):
        """The layer with the residual and the relief that the components of `codes` give its texels."""

        def stored(texel, view, light):
            pair, k = view * self.lights + light, layer.clusters[texel]
            coefficients = [1.0] + [step * plane[texel] for step, plane in zip(self.steps[1:], codes)]
            values = [self.at_pairs[j][k][pair] for j in range(len(coefficients))]
            return [sum(y * value[c] for y, value in zip(coefficients, values)) for c in range(3)]

        def residual(texel, view, light):
            pair, k = view * self.lights + light, layer.clusters[texel]
            inputs = [1, *(plane[texel] for plane in codes)]
            taken = [sum(a * x for a, x in zip(self.taken.get((k, pair, c), []), inputs)) for c in range(3)]
            return [value - own for value, own in zip(stored(texel, view, light), taken)]

        relief = None
        # A coarser level may lack heights.
        if layer.relief and layer.height_codes is not None:
            relief = replace(layer.relief, record=cache(lambda texel: relief_record(layer, stored, texel)))
        return replace(layer, codes=codes, residual=residual, relief=relief)


def must_have_lobes(references, ids, dictionaries):
    pairs = zip(references, ids)
    must(all(lobe[0] < len(dictionaries[k]) for lobes, k in pairs for lobe in lobes), "a lobe is not there")


def flat(lists):
    return [number for numbers in lists for number in numbers]

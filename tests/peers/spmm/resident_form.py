"""The chapter "Resident form" of docs/reference/format.md: the layers by level, from the words alone."""

import struct
import sys
from array import array
from dataclasses import replace

from spmm.container import WORDS, must_repeat, sides_of_levels, spectrum
from spmm.decoding import BASE, ROOT, WINDOWED_COSINE, Edit, Layer, Lobe, Relief, Sphere, dot, within_ranges
from spmm.decoding import within_relief_ranges
from spmm.directions import cells_a_side, must_be_counts, must_be_directions, single
from spmm.entropy_coder import must
from spmm.file_form import FRAME

WORDS_A_SECTION = 2**25


def read(header):
    """The layers of each level."""
    data, index = b"", 0
    while header.has(WORDS, 0, index):
        part = header.found[WORDS, 0, index]
        must(len(data) == 4 * index * WORDS_A_SECTION and len(part) % 4 == 0, "the words are not without gaps")
        data, index = data + part, index + 1
    must(512 <= len(data) <= 4 * index * WORDS_A_SECTION, "the words are too few or too many")
    words = Words(data)
    width, height, layers, total, levels, without_edits = words[0:6]
    must((width, height, layers) == (header.width, header.height, header.layers), "words 0 to 2 are not the header's")
    must(total == words.count and without_edits <= total, "word 3 or 5 is out of its range")
    sizes = sides_of_levels(width, height)
    must(1 <= levels <= min(15, len(sizes)), "the number of levels is out of its range")
    shown, at = None, words[6:7][0]
    must((at != 0) == (header.basis == 1), "word 6 and the basis disagree")
    if at != 0:
        count, groups = words[words.part(at, 2) : at + 2]
        must(1 <= count <= 256 and 1 <= groups <= 4, "the number of bands or of groups is out of its range")
        length = 9 * groups + count * (1 + 3 * groups)
        rest = iter(words.floats(words.part(at, 2 + length) + 2, length))
        shown = spectrum(count, groups, lambda n: [next(rest) for _ in range(n)])
    result = []
    for level, size in enumerate(sizes[:levels]):
        blocks = words[8 + level * layers : 8 + (level + 1) * layers]
        result.append([replace(read_layer(words, block, size), shown=shown) for block in blocks])
        if shown:
            for layer in result[-1]:
                must_repeat(layer.lights, len(shown[0]) // 3)
        sides = [(layer.light_side, layer.view_side) for layer in result[-1]]
        must(len(set(sides)) == layers, "two layers have the same sides")
        finest = [(layer.light_side, layer.view_side) for layer in result[0]]
        must(sides == finest, "a level's layers have another order")
    return result


class Words:
    """The words as whole numbers, floats, halves and signed bytes."""

    def __init__(self, data):
        self.data, self.count = data, len(data) // 4

    def within(self, at, count):
        must(at + count <= self.count, "a part is not within the words")
        return 4 * at, 4 * (at + count)

    def part(self, at, count):
        """The place of an own part, which begins at a multiple of 64."""
        must(at >= 128 and at % 64 == 0, "a part's place is not allowed")
        self.within(at, count)
        return at

    def values(self, code, at, count):
        """The numbers of `count` words as those of an array's code."""
        start, end = self.within(at, count)
        numbers = array(code)
        numbers.frombytes(self.data[start:end])
        if sys.byteorder == "big":
            numbers.byteswap()
        return numbers

    def __getitem__(self, places):
        """Words of a slice, in a tuple."""
        return tuple(self.values("I", places.start, places.stop - places.start))

    def floats(self, at, count):
        return tuple(self.values("f", at, count))


def read_layer(words, at, size):
    block = words[words.part(at, 32) : at + 32]
    (epsilon,), (horizon,), heights = words.floats(at + 3, 1), words.floats(at + 16, 1), words.floats(at + 19, 3)
    clusters, references, edits, bases, stride = *block[25:28], *block[4:6]
    must(max(block[0], block[1]) <= 1 and max(block[2], block[17]) <= 2, "a word of a layer is out of its range")
    must(single(1e-6) <= epsilon <= 1, "a layer's epsilon is out of its range")
    must(single(1e-6) <= horizon <= single(0.1), "h of the horizon is out of its range")
    must(1 <= clusters <= 256 and bases <= 129 and edits <= 255, "a count of a layer is out of its range")
    must(block[22:24] == size, "a level has another size")
    lights, views = (read_directions(words, place) for place in block[6:8])
    pairs = len(lights.directions) * len(views.directions)
    must(block[14:16] == (len(lights.directions), pairs), "lights or pairs are not those of the directions")
    packed = None
    if bases > 0 and stride == 0:
        packed = PackedBases(words, block[11], clusters, pairs, bases)
        must(block[13] == 0, "packed codes have words of their own")
        words.part(block[12], 0)
    else:
        must((bases + 1) // 2 <= stride <= 65, "the words a pair and channel are out of their range")

    width, height = size
    texels = width * height
    dictionaries = read_dictionaries(words, block[10], clusters)
    list_of_edits = []
    for i in range(edits):
        *tint, keep = words.floats(block[24] + 8 * i, 4)
        (table,) = words[block[24] + 8 * i + 4 : block[24] + 8 * i + 5]
        must(all(0 <= x <= 16 for x in tint) and 0 <= keep <= 1, "a number of an edit is out of its range")
        changed = read_dictionaries(words, table, clusters)
        must(list(map(len, changed)) == list(map(len, dictionaries)), "an edited dictionary has another size")
        list_of_edits.append(Edit(tuple(tint), keep, changed))

    records = words[words.part(block[8], 2 * texels) : block[8] + 2 * texels]
    lobes = words[words.part(block[9], references) : block[9] + references]
    ids, texel_edits, of_texels, packed_codes = [], [], [], []
    for record, first in zip(records[::2], records[1::2]):
        ids.append(record & 255)
        texel_edits.append(record >> 8 & 255)
        must(ids[-1] < clusters and texel_edits[-1] <= edits, "a texel's cluster or edit is not there")
        must(first + (record >> 16) <= references, "a texel's references are not there")
        if packed is not None:
            length = packed.places[ids[-1]][2]
            must(length <= first, "a texel's codes are not there")
            packed_codes.append(lobes[first - length : first])
        of_texels.append([list(lobe.to_bytes(4, "little")) for lobe in lobes[first : first + (record >> 16)]])
        must(all(lobe[0] < len(dictionaries[ids[-1]]) for lobe in of_texels[-1]), "a lobe is not there")

    height_codes = None
    if block[18] != 0:
        must(0 < heights[0] <= 16, "a height step is out of its range")
        height_codes = list(words.values("b", words.part(block[18], -(-texels // 4)), -(-texels // 4))[:texels])
    components = max(0, bases - 1)
    codes, residual = [], None
    if packed is not None:
        codes = packed.codes(packed_codes, ids)
        residual = packed.residual_of(len(lights.directions), ids, codes)
    elif components > 0:
        must(4 * block[13] >= components, "the words a texel are too few")
        bytes_of_texels = words.values("b", words.part(block[12], texels * block[13]), texels * block[13])
        codes = [list(bytes_of_texels[j :: 4 * block[13]]) for j in range(components)]
    if bases > 0 and packed is None:
        count = clusters * pairs * 3 * stride
        must(finite_halves(words.values("H", words.part(block[11], count), count)), "a basis is not finite")
        residual = residual_of(words.data, block[11], stride, len(lights.directions), pairs, ids, codes)
    relief = None
    if block[28] != 0:
        must(block[18] != 0 and bases > 0, "a layer with relief has no heights or no bases")
        must((block[2], block[17]) == (ROOT, BASE), "a layer with relief has another kind of residual or role of lobes")
        relief = words.floats(at + 29, 3)
        must(within_relief_ranges(*relief), "a number of a relief is out of its range")
        relief = Relief(*relief, relief_records(words.data, words.part(block[28], 4 * texels)))
    return Layer(
        light_side=block[0],
        view_side=block[1],
        residual_kind=block[2],
        epsilon=epsilon,
        lobe_role=block[17],
        horizon=horizon,
        lights=lights,
        views=views,
        dictionaries=dictionaries,
        edits=list_of_edits,
        width=width,
        height=height,
        clusters=ids,
        references=of_texels,
        texel_edits=texel_edits,
        height_codes=height_codes,
        height_step=heights[0],
        codes=codes,
        residual=residual,
        relief=relief,
    )


class PackedBases:
    """The chapter "Packed bases": the bases of a level's clusters, and the widths of its texels' codes."""

    def __init__(self, words, at, clusters, pairs, bases):
        self.words, self.at, self.bases = words, words.part(at, 4), bases
        (self.unit,), (_, stored, first, zero) = words.floats(at, 1), words[at : at + 4]
        must(0 < self.unit <= 1e9, "the unit of packed bases is out of its range")
        must(first == 4 + 3 * clusters and zero == 0 and bases <= stored, "packed bases are not where they may be")
        places = words[at + 4 : at + first]
        self.places = list(zip(places[::3], places[1::3], places[2::3]))
        self.steps, self.widths, self.code_widths = [], [], []
        for k, (rows, length, code_words) in enumerate(self.places):
            packed = words[at + first + k * stored : at + first + (k + 1) * stored]
            steps = struct.unpack(f"<{stored}e", b"".join((x & 0xFFFF).to_bytes(2, "little") for x in packed))
            widths = [[x >> shift & 15 for shift in (16, 20, 24)] for x in packed]
            code_widths = [x >> 28 for x in packed]
            must(all(x & 0x8000 == 0 and x & 0x7C00 != 0x7C00 for x in packed), "a packed step is out of its range")
            largest = max(self.unit * step * 1.25 * 2 ** (max(own) - 1) for step, own in zip(steps, widths))
            must(largest <= 1e6, "a packed number is too large")
            must(code_widths[0] == 0 and max(code_widths) <= 8, "a code's width is out of its range")
            empty = all(code > 0 or not any(own) for code, own in zip(code_widths[1:], widths[1:]))
            must(empty, "a component without codes has numbers")
            must(length == -(-sum(map(sum, widths)) // 32), "a packed row has not the words of its numbers")
            must(code_words == -(-sum(code_widths) // 32), "a texel has not the words of its codes")
            words.within(at + rows, pairs * length)
            self.steps.append(steps)
            self.widths.append(widths)
            self.code_widths.append(code_widths)

    def codes(self, words_of_texels, ids):
        """The codes of the components at hand, those of all texels for each."""
        planes = [[] for _ in range(self.bases - 1)]
        for words, cluster in zip(words_of_texels, ids):
            bits = Bits(words)
            for plane, width in zip(planes, self.code_widths[cluster][1:]):
                plane.append(bits.take(width))
        return planes

    def residual_of(self, lights, ids, codes):
        """The function of texel, view and light."""

        def at(texel, view, light):
            cluster = ids[texel]
            rows, length, _ = self.places[cluster]
            first = self.at + rows + (view * lights + light) * length
            bits = Bits(self.words[first : first + length])
            sums = [0.0] * 3
            weights = [1] + [plane[texel] for plane in codes]
            for weight, step, widths in zip(weights, self.steps[cluster], self.widths[cluster]):
                for channel, width in enumerate(widths):
                    if width > 0:
                        place = bits.take(width) + 0.5
                        level = place * (0.5 + 1.5 / 2**width * abs(place))
                        sums[channel] += weight * step * self.unit * level
            return [sum(x * frame[c] for x, frame in zip(sums, FRAME)) for c in range(3)]

        return at


class Bits:
    """Numbers in two's complement, from the lowest bit of the first word on."""

    def __init__(self, words):
        self.bits = sum(word << 32 * i for i, word in enumerate(words))

    def take(self, width):
        value = self.bits & ((1 << width) - 1)
        self.bits >>= width
        return value - (1 << width) if width > 0 and value >> (width - 1) else value


def residual_of(data, bases, stride, lights, pairs, clusters, codes):
    """The function of texel, view and light; the halves' components have their steps multiplied in."""

    def at(texel, view, light):
        place = 4 * bases + 12 * stride * (clusters[texel] * pairs + view * lights + light)
        coefficients = [1] + [plane[texel] for plane in codes]
        channels = (struct.unpack_from(f"<{len(coefficients)}e", data, place + 4 * stride * c) for c in range(3))
        return [sum(y * b for y, b in zip(coefficients, channel)) for channel in channels]

    return at


def relief_records(data, records):
    """The function of a texel."""

    def at(texel):
        p, q, *codes = struct.unpack_from("<2h3Bx8B", data, 4 * records + 16 * texel)
        return [p / 8192, q / 8192, *(code / 255 for code in codes[:3]), *(code / 64 for code in codes[3:])]

    return at


def finite_halves(halves):
    return all(half & 0x7C00 != 0x7C00 for half in halves)


def read_dictionaries(words, at, clusters):
    places = words[at : at + clusters + 1]
    must(all(a <= b for a, b in zip(places, places[1:])), "dictionaries do not rise")
    return [[read_lobe(words, place) for place in range(a, b, 16)] for a, b in zip(places, places[1:])]


def read_lobe(words, at):
    (family,), numbers = words[at : at + 1], words.floats(at + 1, 11)
    normal, tangent, params, scale = numbers[:3], numbers[3:6], numbers[6:10], numbers[10]
    must(family <= 8 and 0 <= scale < float("inf"), "a lobe's family or weight scale is out of its range")
    units = [normal, tangent] + [params[1:]] * (family == WINDOWED_COSINE)
    must(all(0.998 <= dot(d, d) <= 1.002 for d in units) and normal[2] > 0, "a lobe's vector is no unit vector")
    in_file = params[:3] if family == WINDOWED_COSINE else params
    must(within_ranges(in_file, family), "a parameter of a lobe is out of its range")
    return Lobe(family, normal, tangent, params, scale)


def read_directions(words, at):
    n, t, e, side, m = words[words.part(at, 8) : at + 5]
    must_be_counts(n, t, e)
    must(side == cells_a_side(t), "the cells a side are not those of the triangles")
    at_triangles = at + 8 + 3 * n
    at_edges = at_triangles + 12 * t
    at_offsets = at_edges + 8 * e
    at_items = at_offsets + side * side + 1
    triangles = [
        [*words.floats(place, 6), *words[place + 6 : place + 9]] for place in range(at_triangles, at_edges, 12)
    ]
    edges = [[*words.floats(place, 5), *words[place + 5 : place + 7]] for place in range(at_edges, at_offsets, 8)]
    directions = [words.floats(place, 3) for place in range(at + 8, at_triangles, 3)]
    must_be_directions(directions, [triangle[6:] for triangle in triangles], [edge[5:] for edge in edges])
    must_be_small(triangles, [1.01] * 2 + [1e10] * 4)
    must_be_small(edges, [1.01] * 2 + [2.02] * 2 + [1e30])
    offsets, items = words[at_offsets:at_items], words[at_items : at_items + m]
    must(offsets[0] == 0 and offsets[-1] == m and all(a < b for a, b in zip(offsets, offsets[1:])), "cells do not rise")
    must(all(item - 2**31 < e if item >= 2**31 else item < t for item in items), "an item is not there")
    return Sphere(directions, triangles, edges, side, offsets, items)


def must_be_small(rows, most):
    pairs = (pair for row in rows for pair in zip(row, most))
    must(all(abs(x) <= bound for x, bound in pairs), "a number of a triangle or an edge is too large")

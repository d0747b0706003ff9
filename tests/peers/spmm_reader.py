"""A reader of .spmm files, written from docs/FORMAT.md alone, with Python's whole numbers and double precision.

    python3 spmm_reader.py FILE [--decisions]

prints every number of the file, one `name = numbers` a line: what the entropy coder holds, the direction sets
with all that follows from them, the mixed cores, and the residual of every texel at every pair; with `--decisions`
also each decision of each stream: range, code, probability, bound, result. It checks lengths,
padding and ranges as the document's lists ask, except the BLAKE3 checksums, which Python lacks.
`runtime/tests/format_document.rs` compares the numbers with those of btf-runtime.
"""

import math
import struct
import sys

MATERIAL, LAYER, DIRECTIONS, TEXEL_CLUSTERS, TEXEL_LOBE_COUNTS, DICTIONARY, LOBE_REFS = range(1, 8)
FACTORS, SHARED_BASES, BASIS, COEFFICIENTS = range(8, 12)


def must(condition, reason):
    if not condition:
        raise ValueError(reason)


# Chapter "Entropy coder"


class AdaptiveBit:
    def __init__(self):
        self.fast = self.slow = 32768
        self.seen = 0

    def probability_of_zero(self):
        return min(65024, max(512, (self.fast + self.slow) // 2))

    def adapt(self, bit):
        slow = next(shift for most, shift in SLOW_SHIFTS if self.seen <= most)
        fast = min(slow, 5)
        if bit:
            self.fast -= self.fast >> fast
            self.slow -= self.slow >> slow
        else:
            self.fast += (65535 - self.fast) >> fast
            self.slow += (65535 - self.slow) >> slow
        self.seen = min(self.seen + 1, 63)


SLOW_SHIFTS = [(0, 1), (1, 2), (4, 3), (11, 4), (23, 5), (47, 6), (63, 7)]


def bits(count):
    return [AdaptiveBit() for _ in range(count)]


class Decoder:
    def __init__(self, stream, numbers):
        must(numbers <= 1024 * len(stream), "a stream is too short for its numbers")
        self.stream, self.place = stream, 0
        self.range, self.code = 2**32 - 1, 0
        self.decisions = []
        for _ in range(4):
            self.code = self.code * 256 + self.next_byte()

    def next_byte(self):
        self.place += 1
        return self.stream[self.place - 1] if self.place <= len(self.stream) else 0

    def bit(self, model):
        p = model.probability_of_zero()
        bound, before = (self.range >> 16) * p, (self.range, self.code)
        result = int(self.code >= bound)
        if result:
            self.code -= bound
            self.range -= bound
        else:
            self.range = bound
        self.decisions.append((*before, p, bound, result))
        model.adapt(result)
        while self.range < 2**24:
            self.range *= 256
            self.code = (self.code * 256 + self.next_byte()) % 2**32
        return result

    def end(self):
        must(self.place == len(self.stream), "a stream is not as long as its numbers need")
        STREAMS.append((self.stream, self.decisions))


STREAMS = []


def encoded(decisions):
    """Chapter "Range encoder"."""
    low, span, shifts = 0, 2**32 - 1, 0
    for _, _, p, _, decision in decisions:
        bound = (span >> 16) * p
        if decision:
            low += bound
            span -= bound
        else:
            span = bound
        while span < 2**24:
            low, span, shifts = low * 256, span * 256, shifts + 1
    return low.to_bytes(shifts + 4, "big")


class Tree:
    def __init__(self):
        self.bits = bits(256)

    def number(self, decoder):
        node = 1
        for _ in range(8):
            node = 2 * node + decoder.bit(self.bits[node])
        return node - 256


def context(a):
    if a < 4:
        return a
    k = a.bit_length() - 1
    return min(67, 4 + 4 * (k - 2) + (a // 2 ** (k - 2)) % 4)


class Signed:
    def __init__(self):
        self.zero, self.sign = bits(68), bits(5)
        self.longer = [bits(15) for _ in range(34)]
        self.digit = [bits(32) for _ in range(16)]

    def number(self, decoder, around, signs):
        c = context(around)
        if decoder.bit(self.zero[c]) == 0:
            return 0
        negative = decoder.bit(self.sign[signs + 2])
        length = 0
        while length < 15 and decoder.bit(self.longer[c // 2][length]) == 1:
            length += 1
        magnitude = 1
        for _ in range(length):
            magnitude = 2 * magnitude + decoder.bit(self.digit[length][min(magnitude, 31)])
        return -magnitude if negative else magnitude


def plane(stream, width, rows, least, most):
    decoder, model = Decoder(stream, width * rows), Signed()
    numbers = [[0] * width for _ in range(rows)]

    def at(row, column):
        return numbers[row][column] if row >= 0 and 0 <= column < width else 0

    for row in range(rows):
        for column in range(width):
            west, north = at(row, column - 1), at(row - 1, column)
            others = at(row - 1, column - 1), at(row - 1, column + 1), at(row, column - 2), at(row - 2, column)
            around = 2 * (abs(west) + abs(north)) + sum(map(abs, others))
            signs = (west > 0) - (west < 0) + (north > 0) - (north < 0)
            numbers[row][column] = model.number(decoder, around, signs)
    decoder.end()
    numbers = [number for row in numbers for number in row]
    must(all(least <= number <= most for number in numbers), "a code is out of its range")
    return numbers


def cluster_ids(stream, width, height):
    decoder, tree = Decoder(stream, width * height), Tree()
    same = [bits(8) for _ in range(3)]
    ids = {}
    for row in range(height):
        for column in range(width):
            w = ids[row, column - 1] if column > 0 else 0
            n = ids[row - 1, column] if row > 0 else w
            nw = ids[row - 1, column - 1] if row > 0 and column > 0 else n
            ne = ids[row - 1, column + 1] if row > 0 and column < width - 1 else n
            alike = (w == n) + 2 * (n == ne) + 4 * (w == nw)
            if decoder.bit(same[0][alike]) == 1:
                ids[row, column] = w
            elif n != w and decoder.bit(same[1][alike]) == 1:
                ids[row, column] = n
            elif ne not in (n, w) and decoder.bit(same[2][alike]) == 1:
                ids[row, column] = ne
            else:
                ids[row, column] = tree.number(decoder)
    decoder.end()
    return [ids[row, column] for row in range(height) for column in range(width)]


def lobe_counts(stream, clusters):
    decoder, same, tree = Decoder(stream, len(clusters)), bits(2), Tree()
    last, before, counts = {}, 0, []
    for cluster in clusters:
        before = decoder.bit(same[before])
        if before == 0:
            last[cluster] = tree.number(decoder)
        counts.append(last.get(cluster, 0))
    decoder.end()
    return counts


def lobe_references(stream, clusters, counts):
    decoder, same, before = Decoder(stream, sum(counts)), bits(2), 0
    trees, models, memories = {}, [Signed() for _ in range(3)], {}
    last, references = {}, []
    for cluster, count in zip(clusters, counts):
        earlier, own = last.get(cluster, []), []
        last[cluster] = own
        if count == 0:
            continue
        if len(earlier) == count:
            before = decoder.bit(same[before])
            if before == 1:
                own += earlier
                references += own
                continue
        for _ in range(count):
            lobe = trees.setdefault(cluster, Tree()).number(decoder)
            (r, g, b), size = memories.get((cluster, lobe), ((128, 128, 128), 8))
            dr, dg, db = [model.number(decoder, size, 0) for model in models]
            codes = (r + dr) % 256, (g + dr + dg) % 256, (b + dr + db) % 256
            memories[cluster, lobe] = codes, (size + abs(dr) + abs(dg) + abs(db)) // 2
            own.append([lobe, *codes])
        references += own
    decoder.end()
    return references


# Chapter "Sections"


class Section:
    def __init__(self, data):
        self.data = data

    def take(self, count):
        must(count <= len(self.data), "a section is too short")
        head, self.data = self.data[:count], self.data[count:]
        return head

    def numbers(self, letter, count):
        """`count` numbers of a struct letter, padded to whole words."""
        size = struct.calcsize("<" + letter)
        head = self.take(-(-count * size // 4) * 4)
        must(not any(head[count * size :]), "padding is not zero")
        return list(struct.unpack(f"<{count}{letter}", head[: count * size]))

    def rest(self):
        return self.take(len(self.data))

    def end(self):
        must(not self.data, "a section is too long")


def sections_of(data):
    words = struct.unpack("<16I", data[:64])
    must(words[0] == 0x4D4D5053 and words[1] == 0, "this is no SPMM file of version 0")
    section_count, tier_count, layers, width, height = words[4:9]
    table = struct.unpack_from(f"<{8 * section_count}I", data, 64)
    tiers = struct.unpack_from(f"<{tier_count}I", data, 64 + 32 * section_count)
    must(len(data) in tiers and tiers[-1] == words[2], "the length is not a tier's")
    end, found = 64 + 32 * section_count + 4 * tier_count, {}
    for i in range(section_count):
        kind, layer, index, _, offset, length = table[8 * i : 8 * i + 6]
        must(offset == -(-end // 16) * 16, "a section is out of place")
        must(not any(data[end:offset]), "padding is not zero")
        end = offset + length
        if end <= len(data):
            found[kind, layer, index] = data[offset:end]
    must(-(-end // 16) * 16 == words[2], "the sections do not fill the file")
    return width, height, layers, tiers, found


def single(x):
    return struct.unpack("<f", struct.pack("<f", x))[0]


def direction_set(section):
    """What the file has, and the derived numbers: triangles, edges, cell offsets, items (edges with bit 31)."""
    n, t, e = section.numbers("I", 3)
    must(1 <= n <= 4096 and t <= 2 * n and 1 <= e <= n, "a count of directions is out of range")
    flat = section.numbers("f", 3 * n)
    ids = section.numbers("H", 3 * t + 2 * e)
    section.end()
    must(all(i < n for i in ids), "a direction is not there")
    directions = [flat[3 * i : 3 * i + 3] for i in range(n)]
    triangle_ids = [ids[3 * i : 3 * i + 3] for i in range(t)]
    edge_ids = [ids[3 * t + 2 * i :][:2] for i in range(e)]
    disk = [d[:2] for d in directions]

    triangles, edges = [], []
    for corners in triangle_ids:
        p0, p1, p2 = [disk[i] for i in corners]
        u, v = (p1[0] - p0[0], p1[1] - p0[1]), (p2[0] - p0[0], p2[1] - p0[1])
        area = u[0] * v[1] - v[0] * u[1]
        must(abs(area) > 1e-9, "a triangle has no area")
        inverse = 1 / area
        matrix = v[1] * inverse, -v[0] * inverse, -u[1] * inverse, u[0] * inverse
        triangles.append([single(x) for x in (*p0, *matrix)])
    for p, q in edge_ids:
        dx, dy = disk[q][0] - disk[p][0], disk[q][1] - disk[p][1]
        length2 = dx * dx + dy * dy
        edges.append([single(x) for x in (*disk[p], dx, dy, 1 / length2 if length2 > 0 else 0)])

    side = min(64, max(4, math.ceil(math.sqrt(2 * t))))
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
    return directions, triangle_ids, edge_ids, triangles, edges, side, offsets, items


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


FRAME = [
    [1 / math.sqrt(3)] * 3,
    [1 / math.sqrt(2), 0, -1 / math.sqrt(2)],
    [1 / math.sqrt(6), -2 / math.sqrt(6), 1 / math.sqrt(6)],
]


def basis_at_pairs(core, ranks, view, light, views, lights):
    """`[pair][rgb]`."""
    rgb, at = [[0.0] * 3 for _ in range(views * lights)], 0
    for channel in range(3):
        rv, rl = ranks[channel]
        for v in range(views):
            for l in range(lights):
                b = sum(
                    view[channel][v * rv + r] * core[at + r * rl + s] * light[channel][l * rl + s]
                    for r in range(rv)
                    for s in range(rl)
                )
                for c in range(3):
                    rgb[v * lights + l][c] += b * FRAME[channel][c]
        at += rv * rl
    return rgb


def show(name, numbers):
    print(name, "=", *numbers)


def flat(lists):
    return [number for numbers in lists for number in numbers]


def read_layer(found, layer, width, height):
    def section(kind, index=0):
        return Section(found[kind, layer, index])

    def steps(part, count, most):
        numbers = part.numbers("f", count)
        must(all(0 <= step <= most for step in numbers), "a step is out of its range")
        return numbers

    part = section(LAYER)
    _, _, _, _, clusters, components, has_residual, _ = part.numbers("I", 8)
    part.end()
    counts_of_sets = []
    for index, name in enumerate(["light", "view"]):
        directions, triangle_ids, edge_ids, triangles, edges, side, offsets, items = direction_set(
            section(DIRECTIONS, index)
        )
        show(f"{name} directions", flat(directions))
        show(f"{name} triangles", flat(a + b for a, b in zip(triangles, triangle_ids)))
        show(f"{name} edges", flat(a + b for a, b in zip(edges, edge_ids)))
        show(f"{name} cells a side", [side])
        show(f"{name} cell offsets", offsets)
        show(f"{name} items", items)
        counts_of_sets.append(len(directions))
    lights, views = counts_of_sets

    ids = cluster_ids(section(TEXEL_CLUSTERS).rest(), width, height)
    must(all(i < clusters for i in ids), "a cluster is not there")
    counts = lobe_counts(section(TEXEL_LOBE_COUNTS).rest(), ids)
    dictionary = section(DICTIONARY)
    lobes = dictionary.numbers("I", clusters)
    dictionary.take(20 * sum(lobes))
    dictionary.end()
    references = lobe_references(section(LOBE_REFS).rest(), ids, counts)
    show("clusters", ids)
    show("lobe counts", counts)
    show("lobe references", flat(references))

    if not has_residual or any((kind, layer, 0) not in found for kind in (FACTORS, SHARED_BASES, BASIS)):
        return
    part = section(FACTORS)
    words = part.numbers("I", 8)
    ranks = [words[0:2], words[2:4], words[4:6]]
    view, light = [], []
    for rv, rl in ranks:
        view.append(part.numbers("e", views * rv))
        light.append(part.numbers("e", lights * rl))
    part.end()
    core = sum(rv * rl for rv, rl in ranks)
    part = section(SHARED_BASES)
    (shared,) = part.numbers("I", 1)
    must(shared <= 1024, "there are too many shared bases")
    shared_steps = steps(part, shared, 1e4)
    codes = plane(part.rest(), core, shared, -32768, 32767)
    show("shared bases", codes)
    shared_cores = [[shared_steps[r] * q for q in codes[r * core : (r + 1) * core]] for r in range(shared)]

    residual = [[[0.0] * 3 for _ in range(views * lights)] for _ in ids]
    for j in range(components + 1):
        if (BASIS, layer, j) not in found or (j > 0 and (COEFFICIENTS, layer, j) not in found):
            break
        part = section(BASIS, j)
        cluster_steps = steps(part, clusters, 1e4)
        codes = plane(part.rest(), shared, clusters, -32768, 32767)
        show(f"basis {j}", codes)
        bases = []
        for k in range(clusters):
            weights = [cluster_steps[k] * q for q in codes[k * shared : (k + 1) * shared]]
            mixed = [sum(w * entries[i] for w, entries in zip(weights, shared_cores)) for i in range(core)]
            show(f"core {j} of cluster {k}", mixed)
            bases.append(basis_at_pairs(mixed, ranks, view, light, views, lights))
        coefficients = [1.0] * len(ids)
        if j > 0:
            part = section(COEFFICIENTS, j)
            (step,) = steps(part, 1, 1e9)
            codes = plane(part.rest(), width, height, -128, 127)
            show(f"coefficients {j}", codes)
            coefficients = [step * q for q in codes]
        for texel, k in enumerate(ids):
            for pair in range(views * lights):
                for c in range(3):
                    residual[texel][pair][c] += coefficients[texel] * bases[k][pair][c]
    for texel, values in enumerate(residual):
        show(f"residual of texel {texel}", flat(values))


def main(path, with_decisions):
    with open(path, "rb") as file:
        data = file.read()
    width, height, layers, tiers, found = sections_of(data)
    show("grid", [width, height, layers])
    show("tiers", tiers)
    print("material =", found[MATERIAL, 0, 0].decode("utf-8"))
    for layer in range(layers):
        show("layer", [layer])
        read_layer(found, layer, width, height)
    again = [encoded(decisions) == stream for stream, decisions in STREAMS]
    show("streams, those that the encoder of the text makes again", [len(again), sum(again)])
    if with_decisions:
        for number, (_, decisions) in enumerate(STREAMS):
            for i, decision in enumerate(decisions):
                show(f"decision {i} of stream {number}", decision)


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3) or sys.argv[2:] not in ([], ["--decisions"]):
        sys.exit("usage: python3 spmm_reader.py FILE [--decisions]")
    try:
        main(sys.argv[1], len(sys.argv) == 3)
    except (ValueError, KeyError, OSError, struct.error) as error:
        sys.exit(f"{sys.argv[1]} cannot be read: {error}")

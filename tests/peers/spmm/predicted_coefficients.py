"""The chapters "PredictedCoefficients", "SharedBasesPart" and "FactorCodes" of docs/reference/format.md."""

import math
import struct

from spmm.container import BASIS, FACTOR_CODES, PREDICTED_COEFFICIENTS, SHARED_BASES_PART
from spmm.directions import single
from spmm.entropy_coder import bits, columns, context, must, plane


def half(x):
    """The half nearest to `x`, of two the even one."""
    return struct.unpack("<e", struct.pack("<e", x))[0]


def times(a, b):
    return single(a * b)


def add(a, b):
    return single(a + b)


def divided(a, b):
    return single(a / b)


def total(terms, first=0.0):
    for term in terms:
        first = add(first, term)
    return first


def factors(header, number, views, lights):
    """The ranks, and of each channel the view matrix and the light matrix, row by row; from FactorCodes."""
    part = header.section(FACTOR_CODES, number)
    words = part.numbers("I", 8)
    must(max(words[:6]) <= 256 and words[6:] == [0, 0], "a rank is out of its range")
    ranks = [words[0:2], words[2:4], words[4:6]]
    exponents = part.numbers("B", sum(words[:6]))
    must(all(e <= 24 for e in exponents), "an exponent is out of its range")

    def read(stream):
        sizes = [(rank, width) for pair in ranks for rank, width in zip(pair, (views, lights))]
        return [(rank, width, plane(stream, width, rank, -32768, 32767)) for rank, width in sizes]

    matrices, rest = [], iter(exponents)
    for rank, width, codes in part.stream(sum(rv * views + rl * lights for rv, rl in ranks), read):
        steps = [2.0 ** -next(rest) for _ in range(rank)]
        matrices.append([half(codes[r * width + i] * steps[r]) for i in range(width) for r in range(rank)])
    return ranks, list(zip(matrices[0::2], matrices[1::2]))


def shared_bases(header, number, core, shared):
    """Steps and codes of the shared bases at hand; `shared` are those of the whole file."""
    steps, codes = [], []
    for index in range(2):
        if not header.has(SHARED_BASES_PART, number, index):
            must(not header.whole, "a part of a residual is missing")
            break
        part = header.section(SHARED_BASES_PART, number, index)
        (count,) = part.numbers("I", 1)
        must(len(steps) + count <= shared, "there are too many shared bases")
        steps += part.steps(count, 1e4)
        codes += part.stream(count * core, lambda stream: columns(stream, core, count))
    must(not header.whole or len(steps) == shared, "there are too few shared bases")
    return steps, codes


class Groups:
    """The groups at hand: bases as `(steps, codes)`, and of each component its step and its texels' codes."""

    def __init__(self, header, number, ids, clusters, components):
        must(components > 0, "a layer with predicted coefficients has no components")
        self.shared, self.bases, self.steps, self.planes = 0, [], [], []
        index = 1
        while len(self.steps) < components:
            if not header.has(PREDICTED_COEFFICIENTS, number, index):
                must(not header.whole, "a part of a residual is missing")
                break
            part = header.section(PREDICTED_COEFFICIENTS, number, index)
            shared, count, *inputs, own = part.numbers("I", 7)
            first, end = len(self.steps), len(self.steps) + count
            must(shared <= 1024 and index == 1 or shared == self.shared, "a number of shared bases is not allowed")
            must(1 <= count <= 128 and end <= components, "a group's components are out of their range")
            must(max(inputs) <= min(255, end) and own <= min(255, first), "a group's inputs are out of their range")
            must(sum(inputs) + own <= 256, "a group has too many inputs")
            self.shared = shared
            steps = part.steps(count, 1e9)
            has_bases = all(header.has(BASIS, number, j) for j in range(end + 1))
            must(has_bases or not header.whole, "a part of a residual is missing")
            if not has_bases:
                break
            for j in range(len(self.bases), end + 1):
                of_basis = header.section(BASIS, number, j)
                basis_steps = of_basis.steps(clusters, 1e4)
                read = lambda stream: plane(stream, shared, clusters, -32768, 32767)
                self.bases.append((basis_steps, of_basis.stream(clusters * shared, read)))
            self.steps += steps
            must_be_allowed(len(part.data), len(ids), clusters, shared, count, end, inputs, own)
            group = Group(self, ids, header.width, first, end, inputs, own)
            part.stream(len(ids) * count, group.read)
            index += 1


def must_be_allowed(length, texels, clusters, shared, count, end, inputs, own):
    all_inputs = sum(inputs) + own
    numbers = all_inputs * (all_inputs + count) + shared * (1 + end + max(inputs))
    must(texels * numbers <= 2**18 * length, "a group takes too long for its bytes")
    must(clusters * numbers <= 2**10 * length, "a group takes too much memory for its bytes")


class Cluster:
    """The state of a cluster in a group."""

    def __init__(self, groups, k, first, end, inputs, own):
        shared, count, self.inputs = groups.shared, end - first, sum(inputs) + own
        self.mixtures = [
            [times(steps[k], code) for code in codes[k * shared : (k + 1) * shared]] for steps, codes in groups.bases
        ]
        self.onto = [
            [divided(m, step) if step > 0 else 0.0 for m in mixture]
            for mixture, step in zip(self.mixtures[1:], groups.steps)
        ]
        self.has = [any(self.mixtures[1 + j]) for j in range(first, end)]
        self.p = [[single(1 / 50) if i == j else 0.0 for j in range(self.inputs)] for i in range(self.inputs)]
        self.w = [[0.0] * count for _ in range(self.inputs)]
        for before, same in (0, inputs[0]), (inputs[0], inputs[1]):
            for j in range(first, min(end, same)):
                self.w[before + j][j - first] = 0.5
        self.sizes, self.count = [0.5] * count, 1.0

    def learn(self, x, errors):
        if not x:
            return
        g = [total(times(x_i, row[j]) for x_i, row in zip(x, self.p)) for j in range(len(x))]
        q = total((times(x_i, g_i) for x_i, g_i in zip(x, g)), 1.0)
        if not (math.isfinite(q) and q >= 1):
            return
        for i, g_i in enumerate(g):
            f = divided(g_i, q)
            self.p[i] = [add(p, times(-f, g_j)) for p, g_j in zip(self.p[i], g)]
            self.w[i] = [add(w, times(f, error)) for w, error in zip(self.w[i], errors)]


class Group:
    """Reads the codes of components `first` to `end` (counted from 0) of all texels into `groups.planes`."""

    def __init__(self, groups, ids, width, first, end, inputs, own):
        self.groups, self.ids, self.width = groups, ids, width
        self.first, self.end, self.inputs, self.own = first, end, inputs, own
        self.clusters = {}
        self.models = Differences()

    def cluster(self, k):
        if k not in self.clusters:
            self.clusters[k] = Cluster(self.groups, k, self.first, self.end, self.inputs, self.own)
        return self.clusters[k]

    def read(self, stream):
        planes = self.groups.planes
        planes += [[0] * len(self.ids) for _ in range(self.end - self.first)]
        errors = {}
        for texel, k in enumerate(self.ids):
            cluster = self.cluster(k)
            x = self.inputs_of(texel, cluster)
            differences = []
            at = divmod(texel, self.width)
            left, upper = errors.get((at[0], at[1] - 1)), errors.get((at[0] - 1, at[1]))
            sizes = [0.0] * (self.end - self.first)
            u = w = 2.0
            for j in range(self.end - self.first):
                if not cluster.has[j]:
                    differences.append(0.0)
                    continue
                p = total(times(x_i, row[j]) for x_i, row in zip(x, cluster.w))
                p = 0.0 if math.isnan(p) else max(-127.0, min(127.0, p))
                near = math.floor(add(p, 0.5))
                away = add(p, -near)
                beside = add(left[j] if left else 0.0, upper[j] if upper else 0.0)
                scaled = times(cluster.sizes[j], divided(u, w))
                expected = add(times(single(0.9), scaled), times(single(0.1), beside))
                c = min(31, context(math.floor(times(16.0, expected))))
                d = min(3, math.floor(times(8.0, abs(away))))
                difference = self.models.number(stream, c, d)
                code = near + (-difference if away < 0 else difference)
                must(-128 <= code <= 127, "a code is out of its range")
                planes[self.first + j][texel] = code
                error = add(float(code), -p)
                differences.append(error)
                sizes[j] = size = abs(error)
                u, w = add(u, size), add(w, cluster.sizes[j])
                rate = divided(1.0, add(1.0, cluster.count))
                cluster.sizes[j] = add(cluster.sizes[j], times(rate, add(size, -cluster.sizes[j])))
            cluster.count = min(400.0, add(cluster.count, 1.0))
            errors[at] = sizes
            cluster.learn(x, differences)

    def inputs_of(self, texel, cluster):
        row, column = divmod(texel, self.width)
        x = []
        for (right, down), count in zip(((-1, 0), (0, -1), (-1, -1), (1, -1)), self.inputs):
            at, line = column + right, row + down
            if not (0 <= at < self.width and line >= 0):
                x += [0.0] * count
                continue
            neighbour = line * self.width + at
            if self.ids[neighbour] == self.ids[texel]:
                x += [float(plane[neighbour]) for plane in self.groups.planes[:count]]
            else:
                value = self.value(neighbour)
                centred = [add(v, -m) for v, m in zip(value, cluster.mixtures[0])]
                x += [total(times(v, m) for v, m in zip(centred, cluster.onto[i])) for i in range(count)]
        return x + [float(plane[texel]) for plane in self.groups.planes[: self.own]]

    def value(self, texel):
        """A texel's value in shared bases."""
        cluster = self.cluster(self.ids[texel])
        value = list(cluster.mixtures[0])
        for plane, step, mixture in zip(self.groups.planes, self.groups.steps, cluster.mixtures[1:]):
            if plane[texel] != 0:
                y = times(float(plane[texel]), step)
                value = [add(v, times(y, m)) for v, m in zip(value, mixture)]
        return value


class Differences:
    """`difference(c, d)` of the chapter."""

    def __init__(self):
        self.zero, self.negative = ([bits(4) for _ in range(32)] for _ in range(2))
        self.larger = [bits(18) for _ in range(32)]
        self.longer, self.digit = bits(8), bits(8)

    def number(self, decoder, c, d):
        if decoder.bit(self.zero[c][d]) == 0:
            return 0
        negative = decoder.bit(self.negative[c][d])
        size = 1
        while size < 18 and decoder.bit(self.larger[c][size]) == 1:
            size += 1
        if size == 18:
            length = 0
            while length < 8 and decoder.bit(self.longer[length]) == 1:
                length += 1
            rest = 1
            for i in reversed(range(length)):
                rest = 2 * rest + decoder.bit(self.digit[i])
            size = 17 + rest
        return -size if negative else size

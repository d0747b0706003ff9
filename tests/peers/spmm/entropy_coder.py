"""The chapter "Entropy coder" of docs/reference/format.md with Python's whole numbers."""


def must(condition, reason):
    if not condition:
        raise ValueError(reason)


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
        self.stream, self.place = stream, 0
        self.will_read(numbers)
        self.range, self.code = 2**32 - 1, 0
        self.decisions = []
        for _ in range(4):
            self.code = self.code * 256 + self.next_byte()

    def will_read(self, numbers):
        must(numbers <= 1024 * len(self.stream), "a stream is too short for its numbers")

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
    def __init__(self, digits=8):
        self.digits, self.bits = digits, bits(2**digits)

    def number(self, decoder):
        node = 1
        for _ in range(self.digits):
            node = 2 * node + decoder.bit(self.bits[node])
        return node - 2**self.digits


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


def plane(decoder, width, rows, least, most):
    model = Signed()
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
    numbers = [number for row in numbers for number in row]
    must(all(least <= number <= most for number in numbers), "a code is out of its range")
    return numbers


def columns(decoder, width, rows):
    model, means, numbers = Signed(), [0] * width, []
    for i in range(rows):
        shift = min(4, (i + 1).bit_length() - 1)
        for column, m in enumerate(means):
            number = model.number(decoder, m // 2, 0)
            size = 64 * abs(number)
            means[column] = m + ((size - m) >> shift) if size > m else m - ((m - size) >> shift)
            numbers.append(number)
    must(all(-32768 <= number <= 32767 for number in numbers), "a code is out of its range")
    return numbers


def byte_plane(decoder, width, rows):
    return plane(decoder, width, rows, -128, 127)


def cluster_ids(decoder, width, height):
    tree = Tree()
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
    return [ids[row, column] for row in range(height) for column in range(width)]


def lobe_counts(decoder, clusters):
    same, tree = bits(2), Tree()
    last, before, counts = {}, 0, []
    for cluster in clusters:
        before = decoder.bit(same[before])
        if before == 0:
            last[cluster] = tree.number(decoder)
        counts.append(last.get(cluster, 0))
    return counts


def lobe_references(decoder, clusters, counts):
    """For each texel a list of `[lobe, red, green, blue]`."""
    same, before = bits(2), 0
    trees, models, memories = {}, [Signed() for _ in range(3)], {}
    last, references = {}, []
    for cluster, count in zip(clusters, counts):
        earlier, own = last.get(cluster, []), []
        last[cluster] = own
        references.append(own)
        if count == 0:
            continue
        if len(earlier) == count:
            before = decoder.bit(same[before])
            if before == 1:
                own += earlier
                continue
        for _ in range(count):
            lobe = trees.setdefault(cluster, Tree()).number(decoder)
            (r, g, b), size = memories.get((cluster, lobe), ((128, 128, 128), 8))
            dr, dg, db = [model.number(decoder, size, 0) for model in models]
            codes = (r + dr) % 256, (g + dr + dg) % 256, (b + dr + db) % 256
            memories[cluster, lobe] = codes, (size + abs(dr) + abs(dg) + abs(db)) // 2
            own.append([lobe, *codes])
    return references

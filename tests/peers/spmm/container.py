"""The chapter "File" of docs/reference/format.md: header, tables, checksums, and how a section is read."""

import struct

from spmm.blake3 import checksum
from spmm.entropy_coder import Decoder, must

MATERIAL, LAYER, DIRECTIONS, TEXEL_CLUSTERS, TEXEL_LOBE_COUNTS, DICTIONARY, LOBE_REFS = range(1, 8)
FACTORS, SHARED_BASES, BASIS, COEFFICIENTS, HEIGHT, LEVEL, EDITS, WORDS = range(8, 16)
LOBE_WEIGHTS, RELIEF, PREDICTED_COEFFICIENTS, SHARED_BASES_PART, FACTOR_CODES, SPECTRUM = range(16, 22)


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

    def steps(self, count, most):
        numbers = self.numbers("f", count)
        must(all(0 <= step <= most for step in numbers), "a step is out of its range")
        return numbers

    def peek(self, letter):
        """The number that comes next, which is not taken."""
        must(struct.calcsize("<" + letter) <= len(self.data), "a section is too short")
        return struct.unpack_from("<" + letter, self.data)[0]

    def stream(self, numbers, read):
        """What `read` makes of the decoder of the rest, which holds so many numbers; the section ends with it."""
        decoder = Decoder(self.take(len(self.data)), numbers)
        result = read(decoder)
        decoder.end()
        return result

    def end(self):
        must(not self.data, "a section is too long")


class Container:
    """Header, tables and the sections that are at hand: `found[kind, layer, index]`."""

    def __init__(self, data, magic, versions):
        must(len(data) >= 80, "the file is too short for a header")
        self.words = words = struct.unpack("<20I", data[:80])
        must(data[:4] == magic, f"this is no {magic.decode()} file")
        must(words[1] in versions, f"version {words[1]} is not known")
        self.data, self.tables = data, 80 + 32 * words[4] + 4 * words[5]
        must(1 <= words[4] <= 4096 and 1 <= words[5] <= 4096, "a count of the header is out of its range")
        must(words[3] == 0, "a reserved word of the header is not zero")

    def read_tables(self, alignment, layers, kinds):
        """Finds the sections of `kinds`; the header's own words are in their ranges."""
        data, words, tables = self.data, self.words, self.tables
        section_count, tier_count = words[4:6]
        must(len(data) >= tables, "the file is too short for its tables")
        covered = data[:48] + bytes(8) + data[56:tables]
        must(checksum(covered) == words[12] | words[13] << 32, "the checksum of header and tables is wrong")
        self.tiers = tiers = struct.unpack_from(f"<{tier_count}I", data, 80 + 32 * section_count)
        must(all(a < b for a, b in zip(tiers, tiers[1:])), "tiers do not rise")
        must(not any(tier % alignment for tier in tiers) and tiers[-1] == words[2], "a tier's length is not allowed")
        must(len(data) in tiers, "the length is not a tier's")
        self.whole = len(data) == tiers[-1]

        end, self.found = tables, {}
        for i in range(section_count):
            kind, layer, index, flags, offset, length, low, high = struct.unpack_from("<8I", data, 80 + 32 * i)
            must(offset == -(-end // alignment) * alignment, "a section is out of place")
            must(not any(data[end:offset]), "padding is not zero")
            end = offset + length
            must(not any(offset < tier < end for tier in tiers), "a tier ends inside a section")
            must(layer < layers and flags <= 1, "a section's layer or flags are out of their range")
            if end > len(data):
                continue
            part = data[offset:end]
            must(checksum(part) == low | high << 32, f"the checksum of section {i} is wrong")
            if kind in kinds:
                must((kind, layer, index) not in self.found, "a section is there twice")
                self.found[kind, layer, index] = part
            else:
                must(flags == 0, f"sections of kind {kind} are required and not known")
        must(-(-end // alignment) * alignment == words[2], "the sections do not fill the file")
        must(not any(data[end:]), "padding is not zero")

    def has(self, kind, layer, index=0):
        return (kind, layer, index) in self.found

    def section(self, kind, layer, index=0):
        must(self.has(kind, layer, index), f"section {index} of kind {kind} is missing in layer {layer}")
        return Section(self.found[kind, layer, index])


class Header(Container):
    """An asset's."""

    def __init__(self, data):
        super().__init__(data, b"SPMM", (1, 2, 3))
        words = self.words
        self.layers, self.width, self.height, channels, self.basis, self.flags = words[6:12]
        ranges = (self.layers, 4), (self.width, 16384), (self.height, 16384)
        must(all(1 <= x <= most for x, most in ranges), "a count of the header is out of its range")
        must(channels == 3 and self.flags & ~6 == 0, "channels or flags are not known")
        must(self.basis <= (1 if words[1] >= 3 else 0), "the basis is not known")
        must(not any(words[17:]), "a reserved word of the header is not zero")
        self.form, self.size_mm = words[14], struct.unpack("<2f", data[60:68])
        must(self.form <= 1, "the form is not known")
        must(self.size_mm == (0, 0) or all(0 < x <= 1e6 for x in self.size_mm), "the physical size is out of its range")
        self.read_tables(256 if self.form == 1 else 16, self.layers, range(MATERIAL, SPECTRUM + 1))
        must(self.form == 0 or len(self.tiers) == 1, "the resident form has one tier")
        self.material = str(self.section(MATERIAL, 0).data, "utf-8")


def spectrum(count, groups, numbers):
    """`shown` of a spectrum of so many bands and groups; `numbers(n)` takes the next n numbers."""
    must(1 <= count <= 256 and 1 <= groups <= 4, "the number of bands or of groups is out of its range")
    channels = 3 * groups
    shown, wavelengths, weights = numbers(3 * channels), numbers(count), numbers(channels * count)
    must(all(100 <= nm <= 20000 for nm in wavelengths), "a wavelength is out of its range")
    must(all(a < b for a, b in zip(wavelengths, wavelengths[1:])), "wavelengths do not rise")
    must(all(abs(weight) <= 1000 for weight in (*shown, *weights)), "a weight of a band is out of its range")
    return [shown[channels * i : channels * (i + 1)] for i in range(3)]


def must_repeat(lights, groups):
    """The directions of lights are there once for each group, of which the first are named."""
    count = len(lights.directions) // groups
    must(count * groups == len(lights.directions), "the lights are no whole number of rounds")
    must(all(d == lights.directions[i % count] for i, d in enumerate(lights.directions)), "the rounds of lights differ")
    named = [i for ids in (*lights.triangles, *lights.edges) for i in ids]
    must(all(i < count for i in named), "a light of a later round is named")


def sides_of_levels(width, height):
    """`(width, height)` of the finest level and of each that may follow."""
    sides = [(width, height)]
    while sides[-1] != (1, 1):
        sides.append(tuple(max(1, side // 2) for side in sides[-1]))
    return sides

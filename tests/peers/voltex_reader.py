"""A reader of .voltex files, written from docs/reference/voltex.md alone, with the chapters "File" and "Entropy coder" of
docs/reference/format.md that it stands on.

    python3 voltex_reader.py FILE...

refuses a file, or a tier of one, that breaks a "must" of the documents' lists, checksums included; else prints its
numbers, one `name = numbers` a line: of each level its shadow and its voxels, each with coordinates, material, matrix.

Any Python from 3.9 on does, nothing needs to be installed. `runtime/tests/voltex_document.rs` compares the numbers with
those of btf-runtime.
"""

import struct
import sys
from math import ceil, cos, pi, sin, sqrt

from spmm.container import Container
from spmm.entropy_coder import STREAMS, Decoder, Signed, Tree, bits, encoded, must

DESCRIPTION, MATERIALS, LEVEL, BRICK = 1, 2, 3, 4


class Head(Container):
    def __init__(self, data):
        super().__init__(data, b"VTEX", (1,))
        words = self.words
        self.levels, self.materials, self.flags = words[6:9]
        must(1 <= self.levels <= 13 and 1 <= self.materials <= 65536, "a count of the header is out of its range")
        must(self.flags <= 3, "the flags are not known")
        must(not any(words[i] for i in (14, 16, 17, 18, 19)), "a reserved word of the header is not zero")
        self.extent, (self.side_m,) = struct.unpack("<3f", data[36:48]), struct.unpack("<f", data[60:64])
        must(all(0 < x <= 1 for x in self.extent), "the extent is out of its range")
        must(0 < self.side_m <= 1e9, "the side is out of its range")
        self.read_tables(16, 1, (DESCRIPTION, MATERIALS, LEVEL, BRICK))


class Voxel:
    """The codes of a voxel."""

    def partial_right_angle(self):
        if 0 in self.ratios or 63 in map(abs, self.angles[:2]):
            return 0
        return ceil(63 * cos(pi / 2 * max(map(abs, self.angles[:2])) / 63))

    def matrix(self):
        """xx, yy, zz, xy, xz, yz."""
        j, k = [i for i in range(3) if i != self.axis]
        share = {self.axis: 1.0, j: self.ratios[0] / 63, k: self.ratios[1] / 63}
        a, b = (sin(pi / 2 * angle / 63) for angle in self.angles[:2])
        partial = sin(pi / 2 * self.angles[2] / max(1, self.partial_right_angle()))
        correlation = {(self.axis, j): a, (self.axis, k): b, (j, k): a * b + partial * sqrt((1 - a * a) * (1 - b * b))}
        density = 2 ** (self.density / 64)
        entries = []
        for p, q in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
            c = 1.0 if p == q else correlation.get((p, q), correlation.get((q, p)))
            entries.append(density * density * share[p] * share[q] * c)
        return entries


# By number of children.
DENSITY_OF_CHILDREN = [0, 192, 128, 91, 64, 43, 27, 12, 0]


def expected_of_children(parents):
    """For each child of `(parent, number of its children)` its parent, and by how much denser it is expected to be."""
    return [(parent, DENSITY_OF_CHILDREN[count]) for parent, count in parents for _ in range(count)]


# Stands for the parent of the coarsest voxel.
ROOT_PARENT = Voxel()
ROOT_PARENT.density, ROOT_PARENT.axis, ROOT_PARENT.material = -192, 0, 0


class AngleModel:
    def __init__(self, contexts):
        self.magnitude, self.sign = [Tree(6) for _ in range(contexts)], bits(1)[0]

    def angle(self, decoder, context):
        magnitude = self.magnitude[context].number(decoder)
        return -magnitude if magnitude > 0 and decoder.bit(self.sign) else magnitude


def read_voxels(decoder, expected):
    """As many voxels as `expected` has `(voxel that it is like, by how much denser)`."""
    density, axes, ratios = Signed(), [Tree(2) for _ in range(3)], [Tree(6) for _ in range(2)]
    angles, partial = AngleModel(2), AngleModel(7)
    same, high, low = [bits(2) for _ in range(2)], Tree(), Tree()
    last, material, alike, voxels = (0, 0), 0, 0, []

    def sign(x):
        return (x > 0) - (x < 0)

    for parent, denser in expected:
        voxel = Voxel()
        voxels.append(voxel)
        around = 2 * abs(last[0]) + abs(last[1])
        difference = density.number(decoder, around, sign(last[0]) + sign(last[1]))
        last = difference, last[0]
        voxel.density = parent.density + denser + difference
        must(abs(voxel.density) <= 1920, "a density is out of its range")
        voxel.axis = axes[parent.axis].number(decoder)
        must(voxel.axis <= 2, "an axis is out of its range")
        voxel.ratios = [tree.number(decoder) for tree in ratios]
        must(63 not in voxel.ratios[: voxel.axis], "an axis is not the first")
        voxel.angles = [angles.angle(decoder, i) if voxel.ratios[i] > 0 else 0 for i in range(2)]
        right = voxel.partial_right_angle()
        voxel.angles.append(partial.angle(decoder, right.bit_length()) if right > 0 else 0)
        must(abs(voxel.angles[2]) <= right, "an angle is out of its range")
        if decoder.bit(same[0][alike]) == 1:
            alike, material = 1, parent.material
        else:
            if decoder.bit(same[1][alike]) == 0:
                material = 256 * high.number(decoder) + low.number(decoder)
            alike = 0
        voxel.material = material
    return voxels


def read_numbers(section):
    """The shadow's numbers, the clumping's, the facets' and those of the correction of light."""
    shadow, clumping, facets, light = (section.numbers("f", count) for count in (11, 6, 15, 26))
    must(0 <= shadow[0] <= 1024 and all(-16 <= share <= 1 for share in shadow[1:]), "a shadow is out of its range")
    must(all(-4 <= entry <= 4 for entry in clumping), "a clumping is out of its range")
    must(all(-64 <= number <= 64 for number in facets), "facets are out of their range")
    must(all(-64 <= number <= 64 for number in light), "a correction of light is out of its range")
    return shadow, clumping, facets, light


def read_stream(section, coarser, materials):
    """The voxels of a level or of a brick as `(place, voxel)`, and others as `(number of the voxel, voxel)`."""
    decoder = Decoder(section.data, 8 * len(coarser))
    if coarser:
        tree = Tree()
        masks = [tree.number(decoder) for _ in coarser]
        must(all(masks), "a voxel has no child")
        parents = [(voxel, bin(mask).count("1")) for (_, voxel), mask in zip(coarser, masks)]
        places = [
            tuple(2 * place[axis] + (child >> axis & 1) for axis in range(3))
            for (place, _), mask in zip(coarser, masks)
            for child in range(8)
            if mask >> child & 1
        ]
        decoder.will_read(16 * len(places))
    else:
        parents, places = [(ROOT_PARENT, 1)], [(0, 0, 0)]
    voxels = read_voxels(decoder, expected_of_children(parents))
    have, before = bits(2), 0
    others = []
    for i in range(len(voxels)):
        before = decoder.bit(have[before])
        others += [i] * before
    decoder.will_read(16 * (len(voxels) + len(others)))
    others = list(zip(others, read_voxels(decoder, [(voxels[i], 0) for i in others])))
    decoder.end()
    must(all(voxel.material < materials for voxel in voxels + [voxel for _, voxel in others]), "a material is not there")
    return list(zip(places, voxels)), others


def morton(place):
    return sum((place[axis] >> bit & 1) << (3 * bit + axis) for bit in range(3) for axis in range(3))


def read_bricks(head, section, index, bricks, coarser):
    """The voxels of a level that is stored by brick, and its others; `None` if one of its bricks is not at hand."""
    counts = section.numbers("I", 2 * len(bricks))
    section.end()
    numbers = [512 * index + morton(brick) for brick in bricks]
    if not head.whole and not all(head.has(BRICK, 0, number) for number in numbers):
        return None
    voxels, others = [], []
    for i, (brick, number) in enumerate(zip(bricks, numbers)):
        parents = [(place, voxel) for place, voxel in coarser if tuple(x >> (index - 4) for x in place) == brick]
        own, beside = read_stream(head.section(BRICK, 0, number), parents, head.materials)
        must((len(own), len(beside)) == tuple(counts[2 * i : 2 * i + 2]), "a brick has not as many voxels as its level says")
        others += [(len(voxels) + at, voxel) for at, voxel in beside]
        voxels += own
    return voxels, others


def show(name, numbers):
    print(name, "=", *numbers)


def read(path):
    STREAMS.clear()
    with open(path, "rb") as file:
        head = Head(file.read())
    show("levels, materials, flags", [head.levels, head.materials, head.flags])
    show("extent, side", [*head.extent, head.side_m])
    show("tiers", head.tiers)
    print("description =", str(head.section(DESCRIPTION, 0).data, "utf-8"))
    section = head.section(MATERIALS, 0)
    numbers = section.numbers("e", 8 * head.materials)
    section.end()
    must(all(0 <= x <= 1 for x in numbers), "a material is out of its range")
    show("materials", numbers)
    coarser, bricks = [], []
    for index in range(head.levels):
        if not head.has(LEVEL, 0, index) and index > 0 and not head.whole:
            break
        section = head.section(LEVEL, 0, index)
        shadow, clumping, facets, light = read_numbers(section)
        if index < 8:
            found = read_stream(section, coarser, head.materials)
        else:
            found = read_bricks(head, section, index, bricks, coarser)
        if found is None:
            break
        coarser, others = found
        if index == 3:
            bricks = [place for place, _ in coarser]
        show(f"level {index}: shadow", shadow)
        show(f"level {index}: clumping", clumping)
        show(f"level {index}: facets", facets)
        show(f"level {index}: correction of light", light)
        for i, (place, voxel) in enumerate(coarser):
            show(f"level {index}: voxel {i}", [*place, voxel.material, *voxel.matrix()])
        for i, voxel in others:
            show(f"level {index}: other {i}", [voxel.material, *voxel.matrix()])
    again = [encoded(decisions) == stream for stream, decisions in STREAMS]
    show("streams, those that the encoder of the text makes again", [len(again), sum(again)])


def main():
    """Reads all files; the exit status is 1 where one of them was refused."""
    status = 0
    for path in sys.argv[1:]:
        try:
            read(path)
        except (ValueError, OSError, struct.error) as error:
            print(f"{path} cannot be read: {error}", file=sys.stderr)
            status = 1
    return status


if __name__ == "__main__":
    sys.exit(main())

"""docs/reference/ktx2.md: the layers by level, from an exported KTX2 file and those that it names. Uncompressed 2-D arrays alone."""

import json
import os
import struct

from spmm.decoding import Edit, Layer, Lobe
from spmm.directions import derived, single
from spmm.entropy_coder import must

IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
R8_UINT, RGBA16_FLOAT = 13, 97
TEXEL_BYTES = {R8_UINT: 1, RGBA16_FLOAT: 8}
ZERO = 128


class Array:
    """A two-dimensional array: `levels[l]` are the bytes of `layers` pictures of `sizes[l]`."""

    def __init__(self, data):
        must(data[:12] == IDENTIFIER, "this is no KTX2 file")
        numbers = struct.unpack_from("<9I4I2Q", data, 12)
        self.format, _, width, height, depth, layers, faces, levels, scheme = numbers[:9]
        must(self.format in TEXEL_BYTES and (depth, faces, scheme) == (0, 1, 0), "this is no array that we export")
        self.layers = max(1, layers)
        self.sizes, self.levels = [], []
        for level in range(levels):
            offset, length, plain = struct.unpack_from("<3Q", data, 80 + 24 * level)
            size = max(1, width >> level), max(1, height >> level)
            must(length == plain == size[0] * size[1] * self.layers * TEXEL_BYTES[self.format], "a level has another length")
            must(offset + length <= len(data), "a level is not within the file")
            self.sizes.append(size)
            self.levels.append(data[offset : offset + length])
        at, end = numbers[11], numbers[11] + numbers[12]
        self.notes = {}
        while at < end:
            (length,) = struct.unpack_from("<I", data, at)
            key, _, value = data[at + 4 : at + 4 + length].partition(b"\0")
            self.notes[key.decode()] = value.rstrip(b"\0").decode()
            at += 4 + (length + 3) // 4 * 4


def read(path):
    """The layers of each level."""
    with open(path, "rb") as file:
        planes = Array(file.read())
    must(planes.format == R8_UINT and "BTFspmm" in planes.notes, "this is not the file of the planes")
    index = json.loads(planes.notes["BTFspmm"])
    must(index["layout"] == 1, "its layout is not known")
    layers = [Parts(told, os.path.dirname(path)) for told in index["layers"]]
    return [[layer.at(planes, level) for layer in layers] for level in range(len(planes.levels))]


class Parts:
    """What a layer has apart from its planes."""

    def __init__(self, told, folder):
        self.told = told
        self.lights, self.views = directions(told["lights"]), directions(told["views"])
        self.dictionaries = dictionaries(told["dictionaries"])
        self.edits = [Edit(tuple(e["tint"]), e["keep"], dictionaries(e["dictionaries"])) for e in told["edits"]]
        self.bases = None
        if "bases" in told:
            with open(os.path.join(folder, told["bases"]["file"]), "rb") as file:
                self.bases = Array(file.read())
            must(self.bases.format == RGBA16_FLOAT, "the bases have another format")

    def at(self, planes, level):
        told, places = self.told, self.told["planes"]
        width, height = planes.sizes[level]
        texels = width * height

        def plane(number):
            return planes.levels[level][number * texels : (number + 1) * texels]

        def signed(number):
            return [byte - ZERO for byte in plane(number)]

        clusters = list(plane(places["cluster"]))
        slots = [[plane(places["lobes"] + 4 * s + i) for i in range(4)] for s in range(places["lobeSlots"])]
        # A slot without weights is one that the texel does not use.
        of_texels = ([[part[texel] for part in slot] for slot in slots] for texel in range(texels))
        references = [[lobe for lobe in lobes if any(lobe[1:])] for lobes in of_texels]
        codes = [signed(places["coefficients"] + j) for j in range(places["components"])]
        step = told["heightSteps"][level] if "height" in places else 0
        side = told["side"]
        return Layer(
            light_side=int(side in ("back", "transmission-back")),
            view_side=int(side in ("back", "transmission-front")),
            residual_kind=told["residualKind"],
            epsilon=told["epsilon"],
            lobe_role=told["lobeRole"],
            horizon=told["horizon"],
            lights=self.lights,
            views=self.views,
            dictionaries=self.dictionaries,
            edits=self.edits,
            width=width,
            height=height,
            clusters=clusters,
            references=references,
            texel_edits=list(plane(places["edit"])) if "edit" in places else [0] * texels,
            height_codes=signed(places["height"]) if step > 0 else None,
            height_step=step,
            codes=codes,
            residual=self.residual(clusters, codes) if self.bases else None,
        )

    def residual(self, clusters, codes):
        """The function of texel, view and light."""
        bases, columns = self.bases, self.told["bases"]["clusterColumns"]
        (width, height), lights, views = bases.sizes[0], len(self.lights.directions), len(self.views.directions)

        def at(texel, view, light):
            row, column = divmod(clusters[texel], columns)
            place = (row * views + view) * width + column * lights + light
            total = [0.0] * 3
            for basis, weight in enumerate([1] + [plane[texel] for plane in codes]):
                values = struct.unpack_from("<4e", bases.levels[0], 8 * (basis * width * height + place))
                total = [sum + weight * value for sum, value in zip(total, values)]
            return total

        return at


def directions(told):
    units = [tuple(map(single, unit)) for unit in told["directions"]]
    return derived(units, [list(ids) for ids in told["triangles"]], [list(ids) for ids in told["edges"]])


def dictionaries(told):
    def lobe(of):
        return Lobe(of["family"], tuple(of["normal"]), tuple(of["tangent"]), tuple(of["parameters"]), of["scale"])

    return [[lobe(of) for of in lobes] for lobes in told]

"""A reader of .spmm files, written from docs/reference/format.md (and section 3 of docs/reference/model.md for the lobes) alone, with
Python's whole numbers and double precision.

    python3 spmm_reader.py FILE... [--residuals] [--decisions] [--decode QUERIES]

refuses a file of either form, or a tier of one, that breaks a "must" of the document's lists, checksums included; else
prints its numbers, one `name = numbers` a line. Of both forms: what the texels of all levels have, dictionaries and
edits. Of the file form also the direction sets with all that follows from them and the mixed cores; with `--residuals`
the residual of every texel of the finest level at every pair; with `--decisions` each decision of each stream: range,
code, probability, bound, result. QUERIES is a file with
`fast|exact layer level texel wi.x wi.y wi.z wo.x wo.y wo.z`
a line; of each the decoded value is printed, and its spread: how far it moves where the lobes' normals are shorter by
2^-23, which is what a decoder in single precision cannot tell.

A file that ends in `.ktx2` is the first of those that `btf-fit export-ktx2` writes (docs/reference/ktx2.md); of it and of those that it
names the same is printed about texels, dictionaries, edits and values.

The package `spmm` follows the document chapter by chapter; any Python from 3.9 on does, nothing needs to be installed.
`runtime/tests/format_document.rs` compares the numbers and the decoded values with those of btf-runtime.
"""

import argparse
import struct
import sys
from dataclasses import replace

from spmm import file_form, ktx2_form, resident_form
from spmm.container import Header
from spmm.decoding import decode
from spmm.entropy_coder import STREAMS, encoded, must


def show(name, numbers):
    print(name, "=", *numbers)


def show_texels(number, level, layer):
    name = f"layer {number} level {level}"
    show(f"{name}: size", [layer.width, layer.height])
    show(f"{name}: clusters", layer.clusters)
    show(f"{name}: lobe counts", map(len, layer.references))
    show(f"{name}: lobe references", [x for lobes in layer.references for lobe in lobes for x in lobe])
    for j, codes in enumerate(layer.codes, 1):
        show(f"{name}: coefficients {j}", codes)
    if layer.height_codes is not None:
        show(f"{name}: height step", [layer.height_step])
        show(f"{name}: heights", layer.height_codes)
    show(f"{name}: edits", layer.texel_edits)
    show_dictionaries(name, layer.dictionaries)
    for i, edit in enumerate(layer.edits, 1):
        show(f"{name}: edit {i}: tint, keep", [*edit.tint, edit.keep])
        show_dictionaries(f"{name}: edit {i}", edit.dictionaries)


def show_dictionaries(name, dictionaries):
    for k, lobes in enumerate(dictionaries):
        numbers = ((lobe.family, *lobe.normal, *lobe.tangent, *lobe.params, lobe.scale) for lobe in lobes)
        show(f"{name}: dictionary {k}", [x for lobe in numbers for x in lobe])


def show_residuals(number, layer):
    views, lights = len(layer.views.directions), len(layer.lights.directions)
    pairs = [(view, light) for view in range(views) for light in range(lights)]
    for texel in range(len(layer.clusters) if layer.residual else 0):
        values = (layer.residual(texel, view, light) for view, light in pairs)
        show(f"layer {number}: residual of texel {texel}", [x for value in values for x in value])


def shortened(levels):
    """The same with all lobes' normals shorter by 2^-23: near the peak of a sharp lobe its cosine decides all."""

    def lobes(dictionaries):
        factor = 1 - 2.0**-23
        return [[replace(lobe, normal=tuple(factor * x for x in lobe.normal)) for lobe in own] for own in dictionaries]

    def short(layer):
        edits = [replace(edit, dictionaries=lobes(edit.dictionaries)) for edit in layer.edits]
        return replace(layer, dictionaries=lobes(layer.dictionaries), edits=edits)

    return [[short(layer) for layer in layers] for layers in levels]


def decoded(levels, query):
    """The value of a line of QUERIES."""
    rule, *numbers = query.split()
    must(rule in ("fast", "exact") and len(numbers) == 9, f"a query is not understood: {query}")
    layer, level, texel = map(int, numbers[:3])
    must(0 <= level < len(levels) and 0 <= layer < len(levels[level]), f"there is no such layer: {query}")
    must(0 <= texel < len(levels[level][layer].clusters), f"there is no such texel: {query}")
    directions = [float(x) for x in numbers[3:]]
    return decode(levels, layer, level, texel, directions[:3], directions[3:], rule)


def read_asset(path):
    """The layers of each level of a .spmm file; prints what its header says."""
    with open(path, "rb") as file:
        header = Header(file.read())
    show("grid", [header.width, header.height, header.layers])
    show("flags, size in mm", [header.flags, *header.size_mm])
    show("tiers", header.tiers)
    print("material =", header.material)
    return resident_form.read(header) if header.form == 1 else file_form.read(header, show)


def read(path, arguments):
    """Prints what the file has and what was asked for."""
    STREAMS.clear()
    levels = ktx2_form.read(path) if path.endswith(".ktx2") else read_asset(path)
    for level, layers in enumerate(levels):
        for number, layer in enumerate(layers):
            show_texels(number, level, layer)
    again = [encoded(decisions) == stream for stream, decisions in STREAMS]
    show("streams, those that the encoder of the text makes again", [len(again), sum(again)])
    if arguments.residuals:
        for number, layer in enumerate(levels[0]):
            show_residuals(number, layer)
    if arguments.decisions:
        for number, (_, decisions) in enumerate(STREAMS):
            for i, decision in enumerate(decisions):
                show(f"decision {i} of stream {number}", decision)
    if arguments.decode:
        other = shortened(levels)
        with open(arguments.decode, encoding="utf-8") as queries:
            for i, query in enumerate(queries):
                value = decoded(levels, query)
                show(f"value {i}", value)
                show(f"spread {i}", [abs(a - b) for a, b in zip(value, decoded(other, query))])


def main():
    """Reads all files; the exit status is 1 where one of them was refused."""
    parser = argparse.ArgumentParser(description="Prints the numbers of .spmm files, and values decoded from them.")
    parser.add_argument("files", metavar="FILE", nargs="+")
    parser.add_argument("--residuals", action="store_true", help="print the residual of every texel at every pair")
    parser.add_argument("--decisions", action="store_true", help="print each decision of each stream")
    parser.add_argument("--decode", metavar="QUERIES", help="print the values of a file of queries")
    arguments = parser.parse_args()
    status = 0
    for path in arguments.files:
        try:
            read(path, arguments)
        except (ValueError, OSError, struct.error) as error:
            print(f"{path} cannot be read: {error}", file=sys.stderr)
            status = 1
    return status


if __name__ == "__main__":
    sys.exit(main())

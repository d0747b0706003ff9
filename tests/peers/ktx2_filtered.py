"""Decodes the block-compressed textures of `btf-fit export-ktx2 --bc` by docs/reference/ktx2-filtered.md alone, and tells
their error against a capture folder, whose directions may be any:

    python tests/peers/ktx2_filtered.py wool.ktx2 WOOL [--pairs 400] [--write PICTURES]

PSNR is that of 8-bit sRGB values. Needs numpy and Pillow, whose decoder of BC7 is not ours.
"""

import argparse
import json
import math
import os
import re
import struct

import numpy as np
from PIL import Image

IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
RGBA16_FLOAT, RGBA32_FLOAT, BC5, BC7 = 97, 109, 141, 145
ZERO = 128.0 / 255.0


def blocks_of_bc4(data):
    """[block, 16] values, 0 to 1, of 8 bytes a block."""
    data = np.frombuffer(data, np.uint8).reshape(-1, 8)
    first, second = data[:, 0].astype(np.float64), data[:, 1].astype(np.float64)
    words = np.zeros(len(data), np.uint64)
    for byte in range(6):
        words |= data[:, 2 + byte].astype(np.uint64) << np.uint64(8 * byte)
    index = np.stack([(words >> np.uint64(3 * i)) & np.uint64(7) for i in range(16)], 1).astype(np.int64)
    eight = np.stack([first, second] + [(first * (7 - i) + second * i) / 7 for i in range(1, 7)], 1)
    six = np.stack([first, second] + [(first * (5 - i) + second * i) / 5 for i in range(1, 5)] + [0 * first, 0 * first + 255], 1)
    levels = np.where((first > second)[:, None], eight, six)
    return np.take_along_axis(levels, index, 1) / 255.0


def from_blocks(blocks, layers, width, height):
    """[layer, row, column, channel] of blocks [layer, row, column] of 4 x 4 texels."""
    rows, columns = (height + 3) // 4, (width + 3) // 4
    channels = blocks.shape[-1]
    grid = blocks.reshape(layers, rows, columns, 4, 4, channels).transpose(0, 1, 3, 2, 4, 5)
    return grid.reshape(layers, rows * 4, columns * 4, channels)[:, :height, :width]


class Texture:
    def __init__(self, path):
        with open(path, "rb") as file:
            data = file.read()
        if data[:12] != IDENTIFIER:
            raise SystemExit(f"{path} is no KTX2 file")
        numbers = struct.unpack_from("<9I4I", data, 12)
        self.format, _, width, height, _, layers, _, levels, _ = numbers[:9]
        self.levels = []
        for level in range(levels):
            offset, length, _ = struct.unpack_from("<3Q", data, 80 + 24 * level)
            size = max(1, width >> level), max(1, height >> level)
            self.levels.append(self.texels(data[offset : offset + length], max(1, layers), *size))
        self.notes = {}
        at, end = numbers[11], numbers[11] + numbers[12]
        while at < end:
            (length,) = struct.unpack_from("<I", data, at)
            key, _, value = data[at + 4 : at + 4 + length].partition(b"\0")
            self.notes[key.decode()] = value.rstrip(b"\0").decode()
            at += 4 + (length + 3) // 4 * 4

    def texels(self, data, layers, width, height):
        if self.format in (RGBA16_FLOAT, RGBA32_FLOAT):
            kind = np.float16 if self.format == RGBA16_FLOAT else np.float32
            return np.frombuffer(data, kind).astype(np.float64).reshape(layers, height, width, 4)
        if self.format == BC5:
            pairs = np.frombuffer(data, np.uint8).reshape(-1, 2, 8)
            planes = [blocks_of_bc4(pairs[:, channel].tobytes()) for channel in (0, 1)]
            return from_blocks(np.stack(planes, -1), layers, width, height)
        if self.format == BC7:
            length = len(data) // layers
            parts = [data[layer * length : (layer + 1) * length] for layer in range(layers)]
            images = [Image.frombytes("RGBA", (width, height), part, "bcn", (7, "BC7")) for part in parts]
            return np.stack([np.asarray(image) for image in images]) / 255.0
        raise SystemExit(f"format {self.format} is none of an export")


class Material:
    """A layer of an export at the middles of its finest texels."""

    def __init__(self, path, side="front"):
        tables = Texture(path)
        index = json.loads(tables.notes["BTFspmm"])
        if index["layout"] != 2:
            raise SystemExit(f"{path} is not of layout 2")
        (names,) = [layer for layer in index["layers"] if layer["side"] == side]
        other = {kind: Texture(os.path.join(os.path.dirname(path), names[kind])) for kind in ("planes", "fine", "bases", "mean")}
        table = tables.levels[0][0].reshape(-1, 4)
        self.nodes, self.columns, coarse, pairs = (int(x) for x in table[0])
        self.radius, self.lowest, self.fading, views = table[1]
        self.cells = table[64 : 64 + 4096, :3].astype(int)
        self.views = table[4160 : 4160 + int(views), :2]
        scales = table[4160 + int(views) :][:pairs, :2].reshape(-1)
        planes = np.concatenate([other["planes"].levels[0], other["fine"].levels[0]])
        self.size = planes.shape[1:3]
        # [component, texel]
        planes = planes.transpose(0, 3, 1, 2).reshape(2 * pairs, -1)
        self.planes = ((planes - ZERO) * scales[:, None]).astype(np.float32)
        self.bases = other["bases"].levels[0][..., :3] - ZERO
        self.mean = other["mean"].levels[0][0][..., :3]

    def bilinear(self, texels, place):
        """Texels [..., row, column, channel] at a place in texels, whose middles are at halves."""
        x, y = place[0] - 0.5, place[1] - 0.5
        column, row = int(math.floor(x)), int(math.floor(y))
        p, q = x - column, y - row
        column_1, row_1 = min(column + 1, texels.shape[-2] - 1), min(row + 1, texels.shape[-3] - 1)
        upper = texels[..., row, column, :] * (1 - p) + texels[..., row, column_1, :] * p
        lower = texels[..., row_1, column, :] * (1 - p) + texels[..., row_1, column_1, :] * p
        return upper * (1 - q) + lower * q

    def image(self, wi, wo):
        """Linear values [row, column, channel] for unit vectors to light and eye."""
        if wi[2] <= 0 or wo[2] <= 0:
            return np.zeros((*self.size, 3))
        cell = [int(min(63.0, max(0.0, x * 32 + 32))) for x in wo[:2]]
        ids = self.cells[cell[1] * 64 + cell[0]]
        a, e, f = self.views[ids[0]], self.views[ids[1]] - self.views[ids[0]], self.views[ids[2]] - self.views[ids[0]]
        p = np.asarray(wo[:2]) - a
        area = e[0] * f[1] - e[1] * f[0]
        if abs(area) < 1e-9:
            w1, w2 = min(1.0, max(0.0, p @ e / max(e @ e, 1e-9))), 0.0
        else:
            w1, w2 = (p[0] * f[1] - p[1] * f[0]) / area, (e[0] * p[1] - e[1] * p[0]) / area
        weights = np.maximum([1 - w1 - w2, w1, w2], 0)
        weights /= weights.sum()
        x, y = (t / (self.radius * math.sqrt(1 + wi[2])) for t in wi[:2])
        r = min(math.hypot(x, y), 1.0)
        turned = r * math.atan2(min(abs(x), abs(y)), max(abs(x), abs(y))) * 4 / math.pi
        u, v = (r, turned) if abs(x) >= abs(y) else (turned, r)
        square = 0.5 + 0.5 * math.copysign(u, x), 0.5 + 0.5 * math.copysign(v, y)
        mean, bases = np.zeros(3), np.zeros((len(self.bases), 3))
        for number, weight in zip(ids, weights):
            tile = number % self.columns, number // self.columns
            place = [tile[axis] * self.nodes + square[axis] * (self.nodes - 1) + 0.5 for axis in (0, 1)]
            mean += weight * self.bilinear(self.mean, place)
            bases += weight * self.bilinear(self.bases, place)
        values = self.planes.T @ bases.astype(np.float32) + mean
        fade = min(1.0, wi[2] / self.lowest) * min(1.0, wi[2] / self.fading)
        return (np.maximum(values, 0) ** 2.4 * fade).reshape(*self.size, 3)


def unit(theta, phi):
    theta, phi = math.radians(theta), math.radians(phi)
    return [math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)]


def codes(linear):
    linear = np.clip(linear, 0, 1)
    return np.rint(255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055))


def pairs_of(folder):
    """Path, light and view of each 8-bit picture whose name tells its angles, in Bonn's way."""
    found = []
    for root, _, names in sorted(os.walk(folder)):
        for name in sorted(names):
            angles = re.search(r"tl([\d.]+?)[ _]pl([\d.]+?)[ _]tv([\d.]+?)[ _]pv([\d.]+?)\.(?:png|jpg)$", name)
            if angles:
                tl, pl, tv, pv = (float(x) for x in angles.groups())
                found.append((os.path.join(root, name), unit(tl, pl), unit(tv, pv)))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("textures")
    parser.add_argument("capture")
    parser.add_argument("--pairs", type=int, default=400, help="pairs at most, evenly spread")
    parser.add_argument("--write", help="folder for the decoded pictures")
    arguments = parser.parse_args()
    material, pairs = Material(arguments.textures), pairs_of(arguments.capture)
    if not pairs:
        raise SystemExit(f"{arguments.capture} has no png or jpg whose name tells its angles")
    pairs = [pairs[i * len(pairs) // min(arguments.pairs, len(pairs))] for i in range(min(arguments.pairs, len(pairs)))]
    squares = count = energy = decoded = 0
    for path, wi, wo in pairs:
        wanted = np.asarray(Image.open(path).convert("RGB")).astype(np.float64)
        values = material.image(wi, wo)
        found = codes(values)
        if arguments.write:
            os.makedirs(arguments.write, exist_ok=True)
            Image.fromarray(found.astype(np.uint8)).save(os.path.join(arguments.write, os.path.basename(path)))
        squares += ((found - wanted) ** 2).sum()
        count += wanted.size
        linear = np.where(wanted / 255 <= 0.04045, wanted / 255 / 12.92, ((wanted / 255 + 0.055) / 1.055) ** 2.4)
        energy, decoded = energy + linear.sum(), decoded + np.clip(values, 0, 1).sum()
    psnr = 10 * math.log10(255**2 * count / max(squares, 1e-9))
    print(f"{len(pairs)} pairs: PSNR {psnr:.2f} dB, energy x {decoded / energy:.3f}, memory {material_bytes(arguments.textures)} bytes")


def material_bytes(path):
    """Bytes of all files beside the first one that belong to it, without their headers: about what they take in memory."""
    stem = path[: -len(".ktx2")]
    folder = os.path.dirname(path) or "."
    names = [name for name in os.listdir(folder) if name == os.path.basename(path) or name.startswith(os.path.basename(stem) + ".")]
    return sum(os.path.getsize(os.path.join(folder, name)) for name in names if name.endswith(".ktx2"))


if __name__ == "__main__":
    main()

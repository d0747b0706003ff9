"""The bytes of a neural rival: all that a decoder needs. Each latent is a plane of 8-bit codes, entropy-coded."""

import bz2
import json
import lzma
import struct
import zlib

import numpy as np
import torch

from .neural_model import Dense, Model, Shape, row_scale

MAGIC = b"NEURAL1\n"


def packed(codes):
    """One byte for the way, four for the length and the smallest of three coders on three differences of `codes`."""
    best = None
    for turn, difference in enumerate(DIFFERENCES):
        data = difference(codes).astype(np.uint8).tobytes()
        for coder, (pack, _) in enumerate(CODERS):
            part = pack(data)
            if best is None or len(part) < len(best[1]):
                best = (3 * turn + coder, part)
    return struct.pack("<BI", best[0], len(best[1])) + best[1]


def unpacked(data, at, shape):
    """(codes, where the next begin)."""
    way, length = struct.unpack_from("<BI", data, at)
    at += 5
    codes = np.frombuffer(CODERS[way % 3][1](data[at : at + length]), np.uint8).reshape(shape)
    if way // 3:
        codes = np.cumsum(codes, axis=2 - way // 3, dtype=np.uint8)
    return codes.view(np.int8), at + length


FILTERS = [{"id": lzma.FILTER_LZMA2, "preset": 9, "dict_size": 1 << 18, "lc": 0, "lp": 0, "pb": 0}]
CODERS = (
    (lambda data: zlib.compress(data, 9), zlib.decompress),
    (lambda data: bz2.compress(data, 9), bz2.decompress),
    (lambda data: lzma.compress(data, format=lzma.FORMAT_RAW, filters=FILTERS),
     lambda data: lzma.decompress(data, format=lzma.FORMAT_RAW, filters=FILTERS)),
)
# As it is, less the left neighbour, less the upper one; all modulo 256.
DIFFERENCES = (
    lambda codes: codes.view(np.uint8),
    lambda codes: np.diff(codes.view(np.uint8), axis=1, prepend=np.uint8(0)),
    lambda codes: np.diff(codes.view(np.uint8), axis=0, prepend=np.uint8(0)),
)


def dense_layers(decoder):
    return [module for module in decoder.modules() if isinstance(module, Dense)]


def serialise(model):
    """The bytes of a rounded model: a header, the network's rows with their scales, and one plane for each latent."""
    shape = model.shape
    header = json.dumps({**shape.told(), "transfer": model.transfer, "sigma": model.sigma}).encode()
    parts = [MAGIC, struct.pack("<H", len(header)), header]
    kind, top = (np.int8, 127) if shape.weight_bits == 8 else (np.int16, 2 ** (shape.weight_bits - 1) - 1)
    with torch.no_grad():
        for layer in dense_layers(model.decoder):
            scale = row_scale(layer.weight, top)
            codes = torch.clamp(torch.round(layer.weight / scale), -top, top).numpy().astype(kind)
            parts += [scale.half().numpy().tobytes(), packed(codes.view(np.int8))]
            if layer.bias is not None:
                parts.append(layer.bias.half().numpy().tobytes())
    for table in model.tables:
        parts.append(table.step.numpy().astype(np.float32).tobytes())
        parts += [packed(np.ascontiguousarray(plane).reshape(shape.height, shape.width)) for plane in table.codes().T]
    return b"".join(parts)


def deserialise(data):
    """The model that `serialise` wrote, ready to decode."""
    if data[: len(MAGIC)] != MAGIC:
        raise ValueError("these bytes are no neural rival's: they do not begin with NEURAL1")
    at = len(MAGIC) + 2
    length = struct.unpack_from("<H", data, at - 2)[0]
    header = json.loads(data[at : at + length])
    at += length
    transfer, sigma = header.pop("transfer"), header.pop("sigma")
    shape = Shape(**header)
    model = Model(shape, transfer, sigma, torch.zeros(3), shape.height * shape.width)
    kind = np.int8 if shape.weight_bits == 8 else np.int16

    def halves(count):
        nonlocal at
        found = np.frombuffer(data, np.float16, count, at).astype(np.float32)
        at += 2 * count
        return torch.from_numpy(found)

    with torch.no_grad():
        for layer in dense_layers(model.decoder):
            rows, columns = layer.weight.shape
            scale = halves(rows)[:, None]
            codes, at = unpacked(data, at, (rows, columns * np.dtype(kind).itemsize))
            layer.weight.copy_(torch.from_numpy(np.ascontiguousarray(codes).view(kind).astype(np.float32)) * scale)
            if layer.bias is not None:
                layer.bias.copy_(halves(rows))
    for table in model.tables:
        count = table.values.shape[1]
        table.step = torch.from_numpy(np.frombuffer(data, np.float32, count, at).copy())
        at += 4 * count
        planes = []
        for _ in range(count):
            plane, at = unpacked(data, at, (shape.height, shape.width))
            planes.append(plane.reshape(-1))
        table.values = torch.from_numpy(np.ascontiguousarray(np.stack(planes, 1)))
        table.first = table.second = table.count = None
    if at != len(data):
        raise ValueError(f"{len(data) - at} bytes follow the last plane: the file is no neural rival's or is damaged")
    # Hidden units are decoded as they were trained.
    model.decoder.unit_type = torch.bfloat16
    return model


def memory_bytes(model):
    """What a decoder holds: latents as 8-bit codes, the network in single precision."""
    latents = sum(table.values.numel() + 4 * len(table.step) for table in model.tables)
    return latents + 4 * sum(p.numel() for p in model.decoder.parameters())


def eight_bit_bytes(model):
    """Without entropy coding, so with random access: a byte a latent, the network's rows and their scales."""
    size = sum(table.values.numel() + 4 * len(table.step) for table in model.tables)
    for layer in dense_layers(model.decoder):
        size += layer.weight.numel() * model.shape.weight_bits // 8 + 2 * len(layer.weight)
        size += 0 if layer.bias is None else 2 * len(layer.bias)
    return size

"""Entropy coding of planes with general coders of the standard library: what bytes a rival could still save in transport."""

import bz2
import lzma
import zlib

import numpy as np

try:
    import zstandard
except ImportError:
    zstandard = None


def coded_bytes(data):
    """Smallest size of `data` (bytes) among raw, zlib, bz2, lzma and, where it is installed, zstandard."""
    filters = [{"id": lzma.FILTER_LZMA2, "preset": 9, "lc": 0, "lp": 0, "pb": 0}]
    sizes = [
        len(data),
        len(zlib.compress(data, 9)),
        len(bz2.compress(data, 9)),
        len(lzma.compress(data, format=lzma.FORMAT_RAW, filters=filters)),
    ]
    if zstandard is not None:
        sizes.append(len(zstandard.ZstdCompressor(level=19).compress(data)))
    return min(sizes)


def order_zero_bytes(symbols):
    """Shannon's bound of an adaptive order-zero coder (arithmetic coding), with 2 bytes for each symbol in use."""
    counts = np.unique(symbols, return_counts=True)[1].astype(np.float64)
    total = counts.sum()
    return int(np.ceil(-(counts * np.log2(counts / total)).sum() / 8)) + 2 * len(counts)


def plane_bytes(plane):
    """Smallest size of an 8-bit plane [row, column] as it is, or as differences to the left or to the mean neighbour."""
    plane = np.ascontiguousarray(plane).astype(np.uint8)
    left = plane.copy()
    left[:, 1:] -= plane[:, :-1]
    mean = plane.copy()
    mean[1:, 1:] -= ((plane[1:, :-1].astype(np.uint16) + plane[:-1, 1:]) // 2).astype(np.uint8)
    return min(coded_bytes(p.tobytes()) for p in (plane, left, mean)) + 1

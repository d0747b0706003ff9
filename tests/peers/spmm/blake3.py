"""The first 64 bits of BLAKE3, the checksums of docs/reference/format.md, after the paper "BLAKE3: one function, fast everywhere"
(O'Connor, Aumasson, Neves and Wilcox-O'Hearn 2020). Slow: a megabyte takes some seconds."""

import struct

IV = (0x6A09E667, 0xBB67AE85, 0x3C6EF372, 0xA54FF53A, 0x510E527F, 0x9B05688C, 0x1F83D9AB, 0x5BE0CD19)
PERMUTATION = (2, 6, 3, 10, 7, 0, 4, 13, 1, 11, 12, 5, 9, 14, 15, 8)
MIXES = (0, 4, 8, 12), (1, 5, 9, 13), (2, 6, 10, 14), (3, 7, 11, 15)
MIXES += (0, 5, 10, 15), (1, 6, 11, 12), (2, 7, 8, 13), (3, 4, 9, 14)
CHUNK_START, CHUNK_END, PARENT, ROOT = 1, 2, 4, 8
CHUNK, BLOCK, MASK = 1024, 64, 2**32 - 1


def compress(chaining, words, counter, length, flags):
    """The eight words that a block of 16 words makes of a chaining value."""
    v = [*chaining, *IV[:4], counter & MASK, counter >> 32, length, flags]
    for _ in range(7):
        for i, (a, b, c, d) in enumerate(MIXES):
            va, vb, vc, vd = v[a], v[b], v[c], v[d]
            va = (va + vb + words[2 * i]) & MASK
            vd ^= va
            vd = vd >> 16 | (vd & 0xFFFF) << 16
            vc = (vc + vd) & MASK
            vb ^= vc
            vb = vb >> 12 | (vb & 0xFFF) << 20
            va = (va + vb + words[2 * i + 1]) & MASK
            vd ^= va
            vd = vd >> 8 | (vd & 0xFF) << 24
            vc = (vc + vd) & MASK
            vb ^= vc
            v[a], v[b], v[c], v[d] = va, vb >> 7 | (vb & 0x7F) << 25, vc, vd
        words = [words[i] for i in PERMUTATION]
    return [v[i] ^ v[i + 8] for i in range(8)]


def node(data, first_chunk, root):
    """The chaining value of the tree over `data`, whose first chunk has the number `first_chunk`."""
    if len(data) > CHUNK:
        # The left side takes as many chunks as the largest power of two that leaves something for the right one.
        chunks = 1 << ((len(data) - 1) // CHUNK).bit_length() - 1
        left = node(data[: chunks * CHUNK], first_chunk, 0)
        right = node(data[chunks * CHUNK :], first_chunk + chunks, 0)
        return compress(IV, left + right, 0, BLOCK, PARENT | root)
    value, places = IV, range(0, max(1, len(data)), BLOCK)
    for at in places:
        block = data[at : at + BLOCK]
        flags = CHUNK_START * (at == 0) | (CHUNK_END | root) * (at == places[-1])
        words = struct.unpack("<16I", block.ljust(BLOCK, b"\0"))
        value = compress(value, words, first_chunk, len(block), flags)
    return value


def checksum(data):
    """The first eight bytes of the hash of `data` as a little-endian number."""
    low, high = node(bytes(data), 0, ROOT)[:2]
    return low | high << 32

"""Coefficients of one basis for all texels: every component is an image, coded by cosine transforms of its blocks."""

import numpy as np

from .codes import Model, step_of
from .rounding import LAGRANGIAN, rounded


def cosines(n):
    """[frequency, place], orthonormal."""
    k, x = np.mgrid[0:n, 0:n]
    matrix = np.cos(np.pi * k * (2 * x + 1) / (2 * n)) * np.sqrt(2 / n)
    matrix[0] /= np.sqrt(2)
    return matrix.astype(np.float32)


def blocks_of(planes, n):
    """[component, block row, block column, frequency down, frequency right] of planes [component, y, x]."""
    count, height, width = planes.shape
    tiles = planes.reshape(count, height // n, n, width // n, n).transpose(0, 1, 3, 2, 4)
    matrix = cosines(n)
    return np.matmul(np.matmul(matrix, tiles), matrix.T)


def planes_of(blocks):
    count, rows, columns, n, _ = blocks.shape
    matrix = cosines(n)
    tiles = np.matmul(np.matmul(matrix.T, blocks), matrix)
    return tiles.transpose(0, 1, 3, 2, 4).reshape(count, rows * n, columns * n)


def moved(size, down, right):
    """size[..., u - down, v - right] in a block, zeros outside."""
    out = np.zeros_like(size)
    n = size.shape[-1]
    out[..., max(down, 0) : n + min(down, 0), max(right, 0) : n + min(right, 0)] = size[
        ..., max(-down, 0) : n + min(-down, 0), max(-right, 0) : n + min(-right, 0)]
    return out


def cross(size):
    """Of each frequency its own and half of the four beside it."""
    return size + 0.5 * (moved(size, 1, 0) + moved(size, 0, 1) + moved(size, -1, 0) + moved(size, 0, -1))


def transformed(planes, n, step, lagrangian=LAGRANGIAN):
    """(numbers, decoded planes, shifts) of planes [component, y, x] by cosines in blocks of n x n."""
    blocks = blocks_of(planes, n)
    ratio = blocks / step
    size = np.abs(np.sign(ratio) * np.floor(np.abs(ratio) + 0.35))
    for _ in range(2):
        expected = 0.35 * (cross(size) - size) / 2
        beside = np.zeros_like(size)
        beside[:, 1:] += size[:, :-1]
        beside[:, :-1] += size[:, 1:]
        beside[:, :, 1:] += size[:, :, :-1]
        beside[:, :, :-1] += size[:, :, 1:]
        expected += 0.3 * cross(beside) / 12
        expected[1:] += 0.2 * cross(size[:-1]) / 3
        expected[:-1] += 0.15 * cross(size[1:]) / 3
        numbers = rounded(ratio, expected, lagrangian)
        size = np.abs(numbers)
    # Where in its cell a value lies on average: told once for 1 and once for larger ones.
    shifts = [np.float32(np.float16(np.mean(np.abs(ratio[among]) - size[among]) if among.any() else 0))
              for among in (size == 1, size > 1)]
    numbers = numbers.astype(np.int32)
    return numbers, decoded_of(numbers, shifts, step), shifts


def decoded_of(numbers, shifts, step):
    """What a decoder makes of numbers: planes [component, y, x]."""
    size = np.abs(numbers)
    decoded = np.sign(numbers) * (size + np.where(size == 1, shifts[0], shifts[1]))
    return planes_of((decoded * np.float32(step)).astype(np.float32))


class BlocksPlan:
    """Numbers [component, block row, block column, frequency, frequency]; a batch is some block rows of a component.

    Of each component the last diagonal of frequencies in use is told in a byte; of a component told before, everything
    is known, of this one the lower frequencies and the blocks above and to the left.
    """

    def __init__(self, shape, ends, batch=6000):
        count, rows, columns, n, _ = shape
        self.shape, self.ends = shape, ends
        self.diagonal = np.add.outer(np.arange(n), np.arange(n)).reshape(-1)
        self.order = np.lexsort((np.repeat(np.arange(n), n), self.diagonal))
        place = step_of(np.arange(n), 2, 11)
        self.place = (place[:, None] * 12 + place).reshape(-1)
        self.together = max(1, batch // (columns * n * n))
        self.batches = [(c, start) for c in range(count) for start in range(0, rows, self.together)]
        self.model = Model((16 * 16, 16 * 16, 48 * 6, 144 * 6, 24 * 24, 16 * 16, 32 * 16), 12)
        self.average = np.zeros((n, n), np.float32)
        self.known = None

    def of_component(self, component, numbers):
        """What earlier components tell, and the mean by frequency so far; made once a component."""
        if self.known is None or self.known[0] != component:
            past = [cross(np.abs(numbers[component - d]).astype(np.float32)) if component >= d
                    else np.zeros(self.shape[1:], np.float32) for d in (1, 2, 3)]
            scan = self.order[self.diagonal[self.order] <= self.ends[component]]
            self.known = (component, past[0] + 0.7 * past[1] + 0.5 * past[2], scan)
            self.mean, self.weight = self.average.copy(), 1.0
        return self.known[1:]

    def contexts(self, batch, numbers):
        component, start = batch
        _, rows, columns, n, _ = self.shape
        lower, scan = self.of_component(component, numbers)
        if self.ends[component] < 0:
            return np.zeros(0, int), None, None
        stop = min(start + self.together, rows)
        # With the block row above.
        size = np.zeros((stop - start + 1, columns, n, n), np.float32)
        first = max(start - 1, 0)
        size[first - start + 1 :] = np.abs(numbers[component, first:stop])
        crossed = cross(size)
        beside = crossed[:-1].copy()
        beside[:, 1:] += crossed[1:, :-1]
        size = size[1:]
        inner = (moved(size, 1, 0) + moved(size, 0, 1) + 0.7 * moved(size, 1, 1) + 0.5 * moved(size, 1, -1)
                 + 0.5 * moved(size, 2, 0) + 0.5 * moved(size, 0, 2) + 0.3 * moved(size, 2, -1)
                 + 0.3 * moved(size, -1, 2))
        flat = lambda a: a.reshape(-1, columns, n * n)[:, :, scan]
        inner, beside, lower = flat(inner), flat(beside), flat(lower[start:stop])
        mean = self.mean
        smooth = (mean + moved(mean, 1, 0) + moved(mean, 0, 1) + moved(mean, -1, 0) + moved(mean, 0, -1)) / 5
        usual = np.broadcast_to(smooth.reshape(-1)[scan], inner.shape)
        expected = 0.3 * inner / 4.8 + 0.2 * beside / 6 + 0.2 * lower / 6.6 + 0.3 * usual
        total = step_of(expected * 40, 2.6, 47)
        a, b, c = step_of(inner * 2, 2, 15), step_of(beside, 2, 15), step_of(lower, 2, 15)
        whole = lambda v: np.broadcast_to(v, a.shape)
        contexts = np.stack([
            a * 16 + b, c * 16 + a, total * 6 + min(int(np.log2(1 + component)), 5),
            whole(self.place[scan]) * 6 + np.minimum(total // 5, 5),
            step_of(usual * 40, 2, 23) * 24 + step_of(expected * 16, 2, 23), b * 16 + c,
            step_of(whole(self.diagonal[scan]), 4, 31) * 16 + step_of(usual * 8 + inner, 2, 15),
        ]).reshape(7, -1)
        block = (component * rows + np.arange(start, stop)[:, None]) * columns + np.arange(columns)
        at = block[:, :, None] * n * n + scan
        return at.reshape(-1), contexts, step_of(expected * 8, 1.4, 11).reshape(-1)

    def learn(self, batch, numbers):
        component, start = batch
        self.of_component(component, numbers)
        rows = self.shape[1]
        part = np.abs(numbers[component, start : start + self.together])
        share = len(part) / rows * 4
        self.mean = (self.mean * self.weight + part.mean((0, 1)) * share) / (self.weight + share)
        self.weight += share
        if start + self.together >= rows:
            self.average = 0.5 * self.average + 0.5 * np.abs(numbers[component]).mean((0, 1))


def ends_of(numbers):
    """Of each component the last diagonal in use; -1 for none."""
    n = numbers.shape[-1]
    diagonal = np.add.outer(np.arange(n), np.arange(n))
    return [int(diagonal[live].max()) if live.any() else -1 for live in (np.any(c, (0, 1)) for c in numbers)]

"""What strong+ tells beside coefficients: factor matrices, cores of shared bases, and bases of clusters mixed of them.

Everything is scaled so that an error of 1 costs as much as an error of one step in a coefficient: a number that is
multiplied by much is told finely. So one Lagrangian rounds them all.
"""

import numpy as np

from .codes import Model, bits_of, step_of
from .rounding import rounded

# Side information is rounded more boldly than coefficients: what a coarse basis loses its coefficients partly repair.
SIDE_LAGRANGIAN = 0.25


class RowsPlan:
    """Rows of a matrix that come in groups (a cluster's basis): alike along rows, columns, and from group to group.

    `groups` are ranges of rows; row i of a group is compared with row i of the groups before.
    """

    def __init__(self, columns, groups):
        self.batches = [g for g in groups if g[1] > g[0]]
        most = max((last - first for first, last in groups), default=0)
        self.totals, self.seen = np.zeros((most, columns), np.float32), np.full((most, 1), 0.5, np.float32)
        self.model = Model((16 * 16, 16 * 16, 40, 24 * 24, 16 * 16), 10)

    def contexts(self, group, rows):
        first, last = group
        n, columns = last - first, rows.shape[1]
        size = np.abs(rows[first:last]).astype(np.float32)
        near, over = np.zeros_like(size), np.zeros_like(size)
        for d, weight in enumerate((1.0, 0.8, 0.6, 0.5, 0.4, 0.3), 1):
            if d < columns:
                near[:, d:] += weight * size[:, :-d]
        over[1:] += size[:-1]
        over[2:] += 0.7 * size[:-2]
        mean = self.totals[:n] / self.seen[:n]
        smooth = mean.copy()
        smooth[:, 1:] += mean[:, :-1]
        smooth[:, :-1] += mean[:, 1:]
        expected = near / 3.6 * 0.4 + over / 1.7 * 0.25 + smooth / 3 * 0.35
        row, place = step_of(np.arange(n), 2, 15)[:, None], step_of(np.arange(columns), 2, 15)
        contexts = np.stack([
            step_of(near, 2, 15) * 16 + step_of(over * 2, 2, 15),
            step_of(smooth * 4, 2, 15) * 16 + step_of(near, 2, 15),
            step_of(expected * 40, 2.6, 39),
            step_of(expected * 8, 2, 23) * 24 + step_of(over * 4, 2, 23),
            np.broadcast_to(row * 16 + place, near.shape),
        ]).reshape(5, -1)
        return np.arange(first * columns, last * columns), contexts, step_of(expected * 8, 1.2, 9).reshape(-1)

    def learn(self, group, rows):
        n = group[1] - group[0]
        self.totals[:n] += np.abs(rows[group[0] : group[1]])
        self.seen[:n] += 1


class CoresPlan:
    """Cores [component, view rank, light rank, colour]: alike beside each other and from component to component."""

    def __init__(self, count):
        self.batches = range(count)
        self.model = Model((16 * 16, 16 * 16, 12 * 12 * 3, 48 * 3, 16 * 16, 20 * 16), 10)
        self.mean = 0.0

    def contexts(self, q, cores):
        _, a, b, c = cores.shape
        size = np.abs(cores[q]).astype(np.float32)
        near, far, before, colours = (np.zeros_like(size) for _ in range(4))
        near[1:] += size[:-1]
        near[:, 1:] += size[:, :-1]
        near[1:, 1:] += 0.7 * size[:-1, :-1]
        far[2:] += size[:-2]
        far[:, 2:] += size[:, :-2]
        for d, weight in ((1, 1.0), (2, 0.8), (3, 0.6), (4, 0.5), (6, 0.4), (8, 0.3)):
            if q >= d:
                before += weight * np.abs(cores[q - d])
        colours[..., 1:] += size[..., :-1]
        colours[..., 2:] += 0.5 * size[..., :-2]
        mean = np.broadcast_to(self.mean, size.shape)
        expected = near / 2.7 * 0.35 + before / 3.6 * 0.3 + far / 2 * 0.15 + mean * 0.2
        place_a, place_b = step_of(np.arange(a), 2, 11)[:, None, None], step_of(np.arange(b), 2, 11)[None, :, None]
        colour = np.arange(c)[None, None, :]
        contexts = np.stack([
            step_of(near, 2, 15) * 16 + step_of(before, 2, 15),
            step_of(far + 0.5 * near, 2, 15) * 16 + step_of(colours, 2, 15),
            np.broadcast_to((place_a * 12 + place_b) * 3 + colour, near.shape),
            step_of(expected * 40, 2.6, 47) * 3 + colour,
            step_of(mean * 8, 2, 15) * 16 + step_of(near + before, 2, 15),
            step_of(expected * 8, 2, 19) * 16 + min(int(2 * np.log2(1 + q)), 15),
        ]).reshape(6, -1)
        return np.arange(q * size.size, (q + 1) * size.size), contexts, step_of(expected * 8, 1.2, 9).reshape(-1)

    def learn(self, q, cores):
        self.mean = self.mean + (np.abs(cores[q]) - self.mean) * max(1 / (q + 1), 0.06)


def orthonormal_rows(rows):
    """Gram-Schmidt in the order of rows: what a decoder does with decoded rows, so that coefficients do not mix."""
    q, r = np.linalg.qr(rows.T.astype(np.float64))
    return (q * np.where(np.diag(r) < 0, -1, 1)).T.astype(np.float32)


def smoothed(size, axes):
    """Means of magnitudes and of those beside them along axes: what an encoder expects there."""
    total = size.copy()
    for axis in axes:
        fore, back = [slice(None)] * size.ndim, [slice(None)] * size.ndim
        fore[axis], back[axis] = slice(1, None), slice(None, -1)
        total[tuple(fore)] += size[tuple(back)]
        total[tuple(back)] += size[tuple(fore)]
    return total / (1 + 2 * len(axes))


def coded_rows(rows, groups):
    """Bits of whole numbers [row, column]."""
    return bits_of(RowsPlan(rows.shape[1], groups), rows) if rows.size else 0.0


def shared_bases(scaled, shape, lagrangian=SIDE_LAGRANGIAN):
    """(decoded rows, bits, (view rank, light rank)) of bases `scaled` [n, value], factored over view x light x colour.

    Ranks follow from the rounding: a mode whose numbers are all 0 is left out.
    """
    views, lights, _ = shape
    tensor = scaled.reshape(len(scaled), views, lights, 3)

    def turned(t, matrices):
        for axis, matrix in matrices:
            t = np.moveaxis(np.tensordot(t, matrix, (axis, 0)), -1, axis)
        return np.ascontiguousarray(t)

    matrices = []
    for axis in (1, 2, 3):
        flat = np.moveaxis(tensor, axis, 0).reshape(tensor.shape[axis], -1)
        matrices.append(np.linalg.eigh((flat @ flat.T).astype(np.float64))[1][:, ::-1].astype(np.float32))
    matrices[2] = orthonormal_rows(matrices[2].astype(np.float16).astype(np.float32).T).T
    cores = turned(tensor, list(zip((1, 2, 3), matrices)))
    first = np.abs(rounded(cores, np.full(cores.shape, 0.1, np.float32), lagrangian))
    bits, ranks = 9 * 16.0, []
    for axis in (1, 2):
        others = tuple(a for a in range(4) if a != axis)
        rank = int(np.flatnonzero(first.sum(others) > 2).max(initial=0)) + 1
        if tensor.shape[axis] > 1:
            energy = np.sum(cores.astype(np.float64) ** 2, others)[:rank]
            step = np.maximum(1 / np.sqrt(np.maximum(energy, 1)), 1e-6).astype(np.float16).astype(np.float64)
            numbers = np.rint(matrices[axis - 1][:, :rank] / step)
            bits += coded_rows(numbers.T.astype(np.int64), [(0, rank)]) + 16 * rank
            matrices[axis - 1] = orthonormal_rows((numbers * step).T).T
        ranks.append(rank)
    modes = list(zip((1, 2, 3), matrices))
    cores = turned(tensor, modes)
    plain = np.abs(rounded(cores, np.full(cores.shape, 0.3, np.float32), lagrangian))
    numbers = rounded(cores, smoothed(plain, (0, 1, 2)), lagrangian).astype(np.int32)
    live = np.flatnonzero(np.abs(numbers).sum((1, 2, 3)))
    numbers = numbers[live]
    bits += bits_of(CoresPlan(len(numbers)), numbers)
    decoded = turned(numbers.astype(np.float32), [(axis, matrix.T) for axis, matrix in modes])
    return live, decoded.reshape(len(live), -1), bits, tuple(ranks)

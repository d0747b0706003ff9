"""A capture in the coordinates of its leading singular vectors: everything that is searched is searched there."""

from dataclasses import dataclass

import numpy as np

from .parallel import WORKERS, each

# Texels of one block; 512 x 19,683 single-precision values are 40 MB.
BLOCK = 512


@dataclass
class Coordinates:
    """`domain values = points @ basis.T + what lies outside`. Not centred: the mean lies along the first vectors."""

    basis: np.ndarray  # [value, rank], orthonormal columns
    points: np.ndarray  # [texel, rank]
    energy: float  # sum of squares of all domain values
    shape: tuple  # (views, lights, 3)

    @property
    def rank(self):
        return self.basis.shape[1]

    @property
    def outside(self):
        """Energy that the basis does not hold."""
        return max(self.energy - float(np.sum(self.points.astype(np.float64) ** 2)), 0.0)


def blocks(count, size=BLOCK):
    return (slice(start, min(start + size, count)) for start in range(0, count, size))


def orthonormal(matrix):
    """Orthonormal columns spanning the same space."""
    return np.linalg.qr(matrix.astype(np.float64))[0].astype(np.float32)


def measure(capture, domain, rank, seed=1, subset=4096, keep=None):
    """Randomised SVD: range finder on a subset of texels, one power step and one projection over all of them.

    `keep` (indices of values) restricts it to measured pairs.
    """
    rng = np.random.default_rng(seed)
    texels = capture.texels
    width = capture.values.shape[1] if keep is None else len(keep)
    rank = min(rank, width, texels)
    wide = min(rank + 16, width, texels)

    def rows(index):
        codes = np.asarray(capture.values[index])
        return domain.forward(codes if keep is None else codes[:, keep])

    chosen = np.sort(rng.choice(texels, min(subset, texels), replace=False))
    sample = rows(chosen)
    basis = orthonormal(sample.T @ rng.standard_normal((len(chosen), wide)).astype(np.float32))
    for _ in range(2):
        basis = orthonormal(sample.T @ (sample @ basis))
    del sample
    def power_step(blocks_of_worker):
        image, energy = np.zeros((width, wide), np.float32), 0.0
        for block in blocks_of_worker:
            values = rows(block)
            # Row by row: one long single-precision sum would lose more than a fine codec's error.
            energy += float(np.einsum("tv,tv->t", values, values).sum(dtype=np.float64))
            image += values.T @ (values @ basis)
        return image, energy

    every = list(blocks(texels))
    parts = each(power_step, [every[worker::WORKERS] for worker in range(WORKERS)])
    energy = sum(part[1] for part in parts)
    basis = orthonormal(sum(part[0] for part in parts))
    del parts
    points = np.empty((texels, wide), np.float32)

    def project(block):
        points[block] = rows(block) @ basis

    each(project, every)
    gram = points.T.astype(np.float64) @ points.astype(np.float64)
    _, turn = np.linalg.eigh(gram)
    turn = turn[:, ::-1][:, :rank].astype(np.float32)
    return Coordinates(basis @ turn, points @ turn, energy, capture.shape)

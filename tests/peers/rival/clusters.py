"""Local principal component analysis: clusters of texels, each with a mean and its own components.

Texels are reassigned by the error of their reconstruction [Mueller 2003], not by the distance to a mean.
"""

from dataclasses import dataclass

import numpy as np

from .coordinates import blocks
from .parallel import each


@dataclass
class LocalPca:
    labels: np.ndarray  # [texel]
    means: np.ndarray  # [cluster, rank]
    bases: np.ndarray  # [cluster, component, rank], orthonormal rows
    error: float  # sum of squares over all texels


def k_means(points, clusters, rng, rounds=12):
    """Labels by k-means with k-means++ seeds on a subset."""
    count = len(points)
    sample = points[rng.choice(count, min(count, 8192), replace=False)]
    lengths = np.sum(sample**2, 1)
    centres = sample[rng.integers(len(sample))][None]
    nearest = np.sum((sample - centres[0]) ** 2, 1)
    while len(centres) < clusters:
        total = nearest.sum()
        if total <= 0:
            centres = np.concatenate([centres, sample[rng.integers(len(sample))][None]])
            continue
        # Several candidates, the one that lowers the error most.
        candidates = rng.choice(len(sample), 8, p=nearest / total)
        trials = np.maximum(lengths[None] - 2 * sample[candidates] @ sample.T + lengths[candidates][:, None], 0)
        trials = np.minimum(nearest[None], trials)
        best = int(np.argmin(trials.sum(1)))
        centres = np.concatenate([centres, sample[candidates[best]][None]])
        nearest = trials[best]
    labels = None
    for _ in range(rounds):
        distance = np.sum(centres**2, 1)[None] - 2 * points @ centres.T
        labels = distance.argmin(1)
        sizes = np.bincount(labels, minlength=clusters)
        order = np.argsort(labels, kind="stable")
        full = np.flatnonzero(sizes)
        starts = np.concatenate([[0], np.cumsum(sizes)])[full]
        centres[full] = np.add.reduceat(points[order], starts) / sizes[full][:, None]
        empty = np.flatnonzero(sizes == 0)
        centres[empty] = points[rng.integers(len(points), size=len(empty))]
    return labels


def fit_clusters(points, labels, clusters, components):
    """(means, bases, eigenvalues [cluster, rank]) of the clusters as they are."""
    rank = points.shape[1]
    means = np.zeros((clusters, rank), np.float32)
    bases = np.zeros((clusters, components, rank), np.float32)
    spectra = np.zeros((clusters, rank))
    order = np.argsort(labels, kind="stable")
    ends = np.searchsorted(labels[order], np.arange(clusters + 1))
    def one(cluster):
        members = points[order[ends[cluster] : ends[cluster + 1]]]
        if len(members) == 0:
            return
        means[cluster] = members.mean(0)
        centred = members - means[cluster]
        if len(members) < rank // 2:
            _, sizes, rows = np.linalg.svd(centred, full_matrices=False)
            have = min(components, len(rows))
            bases[cluster, :have] = rows[:have]
            spectra[cluster, : len(sizes)] = sizes.astype(np.float64) ** 2
        else:
            sizes, columns = np.linalg.eigh(centred.T @ centred)
            spectra[cluster] = np.maximum(sizes[::-1], 0)
            bases[cluster] = columns[:, ::-1][:, :components].T

    each(one, range(clusters))
    return means, bases, spectra


def distances(points, means, bases):
    """[texel, cluster] squared error of every texel in every cluster (up to what lies outside the coordinates)."""
    clusters, components, rank = bases.shape
    flat = bases.reshape(-1, rank)
    offset = np.einsum("kcr,kr->kc", bases, means)
    lengths = np.sum(means**2, 1)
    result = np.empty((len(points), clusters), np.float32)

    def one(block):
        part = points[block]
        error = np.sum(part**2, 1)[:, None] - 2 * part @ means.T + lengths
        if components:
            inner = (part @ flat.T).reshape(len(part), clusters, components) - offset
            error -= np.einsum("tkc,tkc->tk", inner, inner)
        result[block] = error

    each(one, blocks(len(points), 4096))
    return result


def local_pca(points, clusters, components, seed=1, rounds=8, labels=None, stop=1e-3):
    """Alternates principal components of the clusters and reassignment by reconstruction error."""
    rng = np.random.default_rng(seed)
    if labels is None:
        labels = k_means(points[:, : min(points.shape[1], 96)], clusters, rng) if clusters > 1 else np.zeros(len(points), int)
    means, bases, spectra = fit_clusters(points, labels, clusters, components)
    error = spectra[:, components:].sum()
    if clusters > 1:
        for _ in range(rounds):
            distance = distances(points, means, bases)
            labels = distance.argmin(1)
            sizes = np.bincount(labels, minlength=clusters)
            for empty in np.flatnonzero(sizes == 0):
                worst = np.argsort(distance.min(1))[-max(4 * components, 16) :]
                labels[worst] = empty
            means, bases, spectra = fit_clusters(points, labels, clusters, components)
            now = spectra[:, components:].sum()
            done = error - now < stop * error
            error = now
            if done:
                break
    return LocalPca(labels.astype(np.int32), means, bases, float(error))

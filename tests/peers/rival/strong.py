"""The strong rival: local PCA in the gamma (or log) domain with Tucker-factored 8-bit bases and 8-bit coefficients.

A configuration is (clusters, components, view rank, light rank). The search estimates the error of hundreds of them in
coordinates; the best at each size are then really encoded and decoded, and only those count.
"""

import time
from dataclasses import dataclass

import numpy as np

from .clusters import distances, fit_clusters, local_pca
from .coordinates import BLOCK, blocks
from .domain import psnr_db, squared_error
from .parallel import each
from .tucker import factors_of, quantise_cores, quantise_half

CLUSTERS = (1, 2, 4, 8, 16, 24, 32, 48, 64, 128, 256)
COMPONENTS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40, 48, 56, 64)
RANKS = (8, 12, 16, 20, 24, 32, 40, 48, 64, 81)
# Texels on which configurations are searched.
SEARCH_TEXELS = 16384
# Coordinates in which configurations are searched; the energy of the others counts as error.
SEARCH_RANK = 256
# Length of a component's core as it is stored.
CORE_LENGTH = 256


def id_bits(clusters):
    """Bits of a texel's cluster id."""
    return (clusters - 1).bit_length()


def bytes_of(texels, clusters, components, factors):
    """Every byte: factors, the global mean (half precision), cluster means and bases, coefficient scales, ids, codes."""
    bases = clusters * (components + (clusters > 1)) * factors.core_bytes()
    scales = 2 * clusters * components
    ids = (texels * id_bits(clusters) + 7) // 8
    return factors.bytes + 2 * factors.core_size + bases + scales + ids + texels * components


@dataclass
class Space:
    """Coordinates inside the product of a pair of factor matrices."""

    factors: object
    turn: np.ndarray  # [rank, inner rank]: coordinates inside from the capture's coordinates
    cores: np.ndarray  # [inner rank, core]: the core of every inner coordinate
    lost: float  # share of energy inside the capture's coordinates that the factors lose


def space_of(frame, weighted, view_rank, light_rank):
    """The space of the factors that keep most of `weighted` [n, value]."""
    factors = factors_of(weighted, frame.shape, view_rank, light_rank)
    cores = factors.cores(np.ascontiguousarray(frame.basis.T)).reshape(frame.rank, -1)
    inner, triangle = np.linalg.qr(cores.T.astype(np.float64))
    turn = triangle.T.astype(np.float32)
    energies = np.sum(frame.points.astype(np.float64) ** 2, 0)
    lost = energies.sum() - energies @ np.sum(cores.astype(np.float64) ** 2, 1)
    return Space(factors, turn, inner.T.astype(np.float32), float(max(lost, 0)))


def spaces_of(frame, log=print):
    """The pairs of ranks that no pair of fewer bytes beats."""
    strength = np.sqrt(np.sum(frame.points.astype(np.float64) ** 2, 0))
    weighted = (frame.basis * strength.astype(np.float32)).T
    weighted = weighted[: min(len(weighted), 160)]
    views, lights, _ = frame.shape
    pairs = {(min(a, views), min(b, lights)) for a in RANKS for b in RANKS if a <= 2.1 * b and b <= 2.1 * a}
    if views == 1:
        pairs = {(1, min(b, lights)) for b in RANKS}
    # Energies of the whole grid come from the two largest factors: a core's leading block is nearly its truncation.
    full = factors_of(weighted, frame.shape, views, lights)
    cores = full.cores(weighted).reshape(len(weighted), lights, views, 3)
    energy = np.sum(cores.astype(np.float64) ** 2, (0, 3))
    kept = np.cumsum(np.cumsum(energy, 0), 1)
    tried = sorted((3 * a * b + 2 * b, kept[-1, -1] - kept[b - 1, a - 1], a, b) for a, b in pairs)
    front, best = [], np.inf
    for size, lost, a, b in tried:
        if lost < best * 0.88:
            front.append((a, b))
            best = lost
    spaces = each(lambda pair: space_of(frame, weighted, *pair), front)
    log("ranks (view, light): " + ", ".join(f"{a} x {b}" for a, b in front))
    return spaces


@dataclass
class Estimate:
    bytes: int
    psnr_db: float
    clusters: int
    components: int
    space: int
    labels: np.ndarray


def search(frame, spaces, texels, largest, seed=1, clusters=CLUSTERS, log=print):
    """Estimates every configuration up to `largest` bytes, on a subset of texels and without quantisation."""
    rng = np.random.default_rng(seed)
    chosen = np.sort(rng.choice(texels, min(SEARCH_TEXELS, texels), replace=False))
    rank = min(SEARCH_RANK, frame.rank)
    points = np.ascontiguousarray(frame.points[chosen, :rank])
    scale = texels / len(points)
    count = texels * frame.basis.shape[0]
    energies = [frame.outside + space.lost for space in spaces]
    tail = float(np.sum(frame.points[:, rank:].astype(np.float64) ** 2))
    # `turn` is triangular from the left, so the leading coordinates stay the leading ones.
    turns = [space.turn[:rank, :rank] for space in spaces]
    found = []
    for k in clusters:
        if k * 4 > len(points):
            continue
        references = [(0, 0, 1), (2, 1, 3), (6, 4, 8), (14, 8, 64)] if k > 1 else [(8, 1, 64)]
        references = references[:2] if k > 64 else references
        labels = None
        for reference, low, high in references:
            wanted = [c for c in COMPONENTS if low <= c <= high and (k > 1 or c > 0)]
            smallest = bytes_of(texels, k, min(wanted), spaces[0].factors)
            if smallest > largest:
                continue
            model = local_pca(points, k, reference, seed, rounds=5, labels=labels)
            labels = model.labels

            covariances = covariances_of(points, labels, k)

            def estimates(index):
                smallest = bytes_of(texels, k, min(wanted), spaces[index].factors)
                if smallest > largest:
                    return []
                total = np.zeros(turns[index].shape[1])
                for covariance in covariances:
                    total += np.linalg.eigvalsh(turns[index].T @ covariance @ turns[index])[::-1]
                result = []
                for c in wanted:
                    size = bytes_of(texels, k, c, spaces[index].factors)
                    if size <= largest:
                        error = max(total[c:].sum(), 0) * scale + energies[index] + tail
                        result.append(Estimate(size, psnr_db(error, count), k, c, index, labels))
                return result

            found += [e for part in each(estimates, range(len(spaces))) for e in part]
    log(f"{len(found)} configurations estimated")
    return found, chosen


def refactored(frame, model, ranks):
    """The space whose factors keep most of what the clusters of `model` represent, not of all that is measured."""
    clusters, components = model.bases.shape[:2]
    gram = np.zeros((frame.rank, frame.rank))
    for index in members_of(model.labels, clusters):
        if len(index) == 0:
            continue
        mean = frame.points[index].mean(0)
        centred = frame.points[index] - mean
        gram += len(index) * np.outer(mean, mean)
        if components:
            energies, vectors = np.linalg.eigh(centred.T @ centred)
            vectors = vectors[:, -components:] * np.sqrt(np.maximum(energies[-components:], 0))
            gram += vectors @ vectors.T
    energies, vectors = np.linalg.eigh(gram)
    vectors = (vectors * np.sqrt(np.maximum(energies, 0)))[:, ::-1][:, :200].astype(np.float32)
    return space_of(frame, np.ascontiguousarray((frame.basis @ vectors).T), *ranks)


def best_model(frame, space, clusters, components, labels, seed, rounds):
    """(space, clusters' model) with the least error of two starts, then with factors of its own."""
    inner = frame.points @ space.turn
    models = [local_pca(inner, clusters, components, seed, rounds, labels)]
    if clusters > 1:
        models.append(local_pca(inner, clusters, components, seed + 6, rounds))
    model = min(models, key=lambda m: m.error)
    own = refactored(frame, model, space.factors.ranks)
    again = local_pca(frame.points @ own.turn, clusters, components, seed, rounds, model.labels)
    return (own, again) if again.error + own.lost < model.error + space.lost else (space, model)


def covariances_of(points, labels, clusters):
    """[cluster, rank, rank] sums of products of centred points."""
    result = []
    for index in members_of(labels, clusters):
        centred = points[index] - points[index].mean(0) if len(index) else points[:0]
        result.append(centred.T @ centred)
    return result


def best_at(found, targets):
    """The best estimate within each target, without repetition."""
    result = []
    for target in targets:
        inside = [e for e in found if e.bytes <= target]
        if inside:
            best = max(inside, key=lambda e: e.psnr_db)
            if not any(best is other for other in result):
                result.append(best)
    return result


@dataclass
class Encoded:
    """What is stored; every array holds values as a decoder reads them back."""

    factors: object
    mean: np.ndarray  # [core]
    means: np.ndarray  # [cluster, core], differences from the mean
    cores: np.ndarray  # [cluster, component, core]
    labels: np.ndarray  # [texel]
    codes: np.ndarray  # [texel, component] int8
    scales: np.ndarray  # [cluster, component]
    bytes: int

    @property
    def clusters(self):
        return self.cores.shape[0]

    @property
    def components(self):
        return self.cores.shape[1]

    def expanded(self, cluster):
        """(mean [value], bases [component, value]) in the domain."""
        stack = np.concatenate([(self.mean + self.means[cluster])[None], self.cores[cluster]])
        light, view = self.factors.ranks[1], self.factors.ranks[0]
        values = self.factors.half().expand(stack.reshape(len(stack), light, view * 3))
        return values[0], values[1:]


def members_of(labels, clusters):
    order = np.argsort(labels, kind="stable")
    ends = np.searchsorted(labels[order], np.arange(clusters + 1))
    return [order[ends[k] : ends[k + 1]] for k in range(clusters)]


def solve_coefficients(centred, bases):
    """Least squares on bases as they are decoded; a component that vanished gets 0."""
    gram = (bases @ bases.T).astype(np.float64)
    gram += np.eye(len(gram)) * (1e-7 * np.trace(gram) / max(len(gram), 1) + 1e-12)
    return (centred @ bases.T @ np.linalg.inv(gram)).astype(np.float32)


def encode(capture, domain, frame, space, clusters, components, labels, seed=1, rounds=12):
    """Encodes all texels: clusters and bases in coordinates, bases again from all values, coefficients on decoded bases.

    `labels`: a first assignment of all texels. Returns (Encoded, (sum of squares, count) of decoded 8-bit values).
    """
    space, model = best_model(frame, space, clusters, components, labels, seed, rounds)
    inner = frame.points @ space.turn
    members = members_of(model.labels, clusters)
    factors = space.factors
    width = capture.values.shape[1]
    light, view = factors.ranks[1], factors.ranks[0]
    half = factors.half()
    to_core = lambda values: half.cores(values).reshape(len(values), -1)

    # Bases by least squares on the texels' scores: they also hold what lies outside the coordinates.
    def bases_of(cluster):
        index = members[cluster]
        if len(index) == 0:
            return np.zeros((components + 1, factors.core_size), np.float32)
        scores = (inner[index] - model.means[cluster]) @ model.bases[cluster].T
        design = np.concatenate([np.ones((len(index), 1), np.float32), scores], 1)
        image = np.zeros((components + 1, width), np.float32)
        for block in blocks(len(index)):
            image += design[block].T @ domain.forward(capture.values[index[block]])
        gram = (design.T @ design).astype(np.float64)
        # Scores of a cluster are uncorrelated and centred, so the normal matrix is diagonal up to rounding.
        gram += np.diag(1e-9 * np.diag(gram) + 1e-9)
        return to_core(np.linalg.solve(gram, image.astype(np.float64)).astype(np.float32))

    stacks = np.stack(each(bases_of, range(clusters)))
    sizes = np.array([len(index) for index in members], np.float64)
    mean = quantise_half(np.tensordot(sizes / sizes.sum(), stacks[:, 0], 1))
    rows = lambda cores: cores.reshape(*cores.shape[:-1], light, view * 3)
    if clusters > 1:
        means = quantise_cores(rows(stacks[:, 0] - mean)).reshape(clusters, -1)
    else:
        means = np.zeros((1, factors.core_size), np.float32)
    # One length before quantisation, so that no scale leaves the range of half precision.
    cores = stacks[:, 1:]
    cores = CORE_LENGTH * cores / np.maximum(np.linalg.norm(cores, axis=-1, keepdims=True), 1e-12)
    cores = quantise_cores(rows(cores)).reshape(clusters, components, factors.core_size)
    codes = np.zeros((capture.texels, components), np.int8)
    scales = np.zeros((clusters, components), np.float32)
    encoded = Encoded(factors, mean, means, cores, model.labels, codes, scales,
                      bytes_of(capture.texels, clusters, components, factors))

    def fit_and_decode(cluster):
        index = members[cluster]
        if len(index) == 0:
            return 0.0
        mean_values, bases = encoded.expanded(cluster)
        scores = np.empty((len(index), components), np.float32)
        if components:
            gram = (bases @ bases.T).astype(np.float64)
            gram += np.eye(components) * (1e-7 * np.trace(gram) / components + 1e-12)
            inverse = np.linalg.inv(gram)
            offset = bases @ mean_values
            for block in blocks(len(index)):
                raw = domain.forward(capture.values[index[block]]) @ bases.T - offset
                scores[block] = raw @ inverse
            scale = np.abs(scores).max(0) / 127
            scale = np.nextafter((scale * 1.0005).astype(np.float16), np.float16(np.inf)).astype(np.float32)
            scale = np.maximum(scale, 1e-7)
            codes[index] = np.clip(np.rint(scores / scale), -127, 127)
            scales[cluster] = scale
        error = 0.0
        for block in blocks(len(index)):
            part = index[block]
            decoded = (codes[part] * scales[cluster]) @ bases + mean_values
            error += squared_error(domain.codes(decoded), capture.values[part])
        return error

    error = sum(each(fit_and_decode, range(clusters)))
    return encoded, (error, capture.texels * width)


def decode(encoded, index):
    """Domain values [len(index), value] of texels."""
    out = np.empty((len(index), len(encoded.factors.view) * len(encoded.factors.light) * 3), np.float32)
    for cluster in np.unique(encoded.labels[index]):
        at = np.flatnonzero(encoded.labels[index] == cluster)
        mean, bases = encoded.expanded(cluster)
        out[at] = (encoded.codes[index[at]] * encoded.scales[cluster]) @ bases + mean
    return out


def labels_of_all(frame, space, estimate, chosen):
    """Extends the assignment of the searched texels to all."""
    inner = frame.points @ space.turn
    means, bases, _ = fit_clusters(inner[chosen], estimate.labels, estimate.clusters, estimate.components)
    return distances(inner, means, bases).argmin(1)


def measure(capture, domain, frame, spaces, estimate, chosen, seed=1):
    """One point: (record, Encoded)."""
    start = time.time()
    space = spaces[estimate.space]
    labels = labels_of_all(frame, space, estimate, chosen) if estimate.clusters > 1 else np.zeros(capture.texels, int)
    encoded, (error, count) = encode(
        capture, domain, frame, space, estimate.clusters, estimate.components, labels, seed
    )
    view, light = space.factors.ranks
    record = {
        "codec": "strong", "domain": domain.kind, "clusters": estimate.clusters, "components": estimate.components,
        "view_rank": view, "light_rank": light, "bytes": encoded.bytes, "psnr_db": psnr_db(error, count),
        "estimated_psnr_db": estimate.psnr_db, "encode_seconds": round(time.time() - start, 2), "decoded": "all texels",
    }
    return record, encoded

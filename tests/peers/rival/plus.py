"""Strong+: the strong rival with bits by importance, prediction between texels and context-modelled codes.

Everything is told with one quantisation step s. Coefficients of orthonormal bases have it themselves; a basis whose
coefficients have the energy E has the step s / sqrt(E), and so on down to the factor matrices: an error costs the same
everywhere, so all bits go where they matter (reverse water-filling). Bases are decoded and made orthonormal first;
coefficients are then fitted to decoded bases. Two forms, both on *shared bases* (principal components of what is
decoded, factored over view x light x colour):

- `local`: clusters with a mean and components of their own, mixed of the shared bases; coefficients are predicted from
  decoded neighbours (`predicted`).
- `global`: one cluster; the planes of coefficients are images and go through cosine transforms (`transformed`).

The decoder follows all models. It decodes a whole file to coefficients, from which a texel can then be decoded alone;
the file itself has no random access, so strong+ is told beside the rival that has it.
"""

import time
from dataclasses import dataclass

import numpy as np

from .clusters import fit_clusters, local_pca
from .codes import bits_of
from .coordinates import blocks
from .domain import psnr_db, squared_error
from .parallel import each
from .predicted import LocalPlan, label_bits, predicted, shifted
from .rounding import rounded
from .sides import SIDE_LAGRANGIAN, coded_rows, orthonormal_rows, shared_bases, smoothed
from .strong import members_of
from .transformed import BlocksPlan, ends_of, transformed

# Sizes that strong+ is measured at.
TARGETS = (64e3, 100e3, 128e3, 200e3, 250e3, 400e3, 500e3, 1e6, 2e6, 4e6)
# Coordinates of the search; what lies outside of them is lost.
RANK = 640
# Forms of the search: clusters of the local form, sides of the blocks of the global form.
CLUSTERS = (4, 8, 16, 32, 64)
SIDES = (8, 16, 32, 64, 128)
# A local component is told where its variance is at least this many squared steps; more where a basis costs little.
KEPT = ((1, 0.05), (8, 0.15), (10**9, 0.22))
COMPONENTS = 160
# Header: form, sizes, counts of components, scales of the colour matrix.
HEADER = 64


@dataclass
class Coded:
    """What a decoder has before it decodes a texel. `coefficients` x cluster's basis + mean = shared coordinates."""

    shared: np.ndarray  # [shared, value], orthonormal rows
    means: np.ndarray  # [cluster, shared]
    bases: np.ndarray  # [cluster, component, shared]
    kept: np.ndarray  # [cluster, component]
    labels: np.ndarray  # [texel]
    coefficients: np.ndarray  # [texel, component]
    record: dict
    refitted: tuple  # (energies, directions in the search's coordinates) for another round

    @property
    def clusters(self):
        return len(self.means)

    def coordinates(self, index):
        """[n, shared] of texels."""
        own = self.labels[index]
        out = self.means[own]
        for cluster in np.unique(own):
            at = own == cluster
            out[at] += self.coefficients[index[at]] @ self.bases[cluster]
        return out


def represented(frame, labels, clusters, step, kept):
    """(energies, directions) of what clusters will tell: means, and components above the threshold."""
    rank = frame.rank
    sizes = np.bincount(labels, minlength=clusters).astype(np.float64)
    means, bases, spectra = fit_clusters(frame.points, labels, clusters, min(COMPONENTS, rank))
    energies = spectra[:, : bases.shape[1]]
    variances = energies / np.maximum(sizes, 1)[:, None]
    energies = np.where(variances > kept * step**2, np.maximum(energies - 0.15 * step**2 * sizes[:, None], 0), 0)
    gram = (means * sizes[:, None]).T.astype(np.float64) @ means
    told = energies.reshape(-1) > 0
    flat = bases.reshape(-1, rank)[told]
    gram += (flat * energies.reshape(-1)[told][:, None]).T.astype(np.float64) @ flat
    return principal(gram, step)


def principal(gram, step):
    energies, vectors = np.linalg.eigh(gram)
    live = energies[::-1] > 0.5 * step**2
    return energies[::-1][live], vectors[:, ::-1][:, live].astype(np.float32)


def refitted(points, decoded, step):
    """(energies, directions) of the least-squares image of all points on decoded coordinates: bases fitted to codes."""
    gram = decoded.T.astype(np.float64) @ decoded
    cross = decoded.T.astype(np.float64) @ points
    gram[np.diag_indices_from(gram)] += 1e-6 * np.trace(gram) / len(gram)
    return principal(cross.T @ np.linalg.solve(gram, cross), step)


def threshold(clusters):
    return next(kept for most, kept in KEPT if clusters <= most)


def local_bases(points, labels, clusters, step, kept):
    """(means, bases, kept, bits) as they are decoded, orthonormal in each cluster, in shared coordinates."""
    rank = points.shape[1]
    sizes = np.maximum(np.bincount(labels, minlength=clusters), 1).astype(np.float64)
    means, bases, spectra = fit_clusters(points, labels, clusters, min(COMPONENTS, rank))
    count = bases.shape[1]
    use = spectra[:, :count] / sizes[:, None] > kept * step**2
    mean_steps = (step / np.sqrt(sizes))[:, None]
    numbers = rounded(means / mean_steps, np.ones_like(means), SIDE_LAGRANGIAN)
    means = (numbers * mean_steps).astype(np.float32)
    bits = coded_rows(numbers.astype(np.int64), [(k, k + 1) for k in range(clusters)]) + 8 * clusters
    rows, groups, decoded = [], [], np.zeros((clusters, count, rank), np.float32)
    for cluster in range(clusters):
        told = int(use[cluster].sum())
        steps = (step / np.sqrt(np.maximum(spectra[cluster, :told], 1e-9))).astype(np.float32)[:, None]
        ratio = bases[cluster, :told] / steps
        part = rounded(ratio, smoothed(np.abs(np.rint(ratio)), (0, 1)), SIDE_LAGRANGIAN)
        empty = np.flatnonzero(np.abs(part).sum(1) == 0)
        told = int(empty[0]) if len(empty) else told
        use[cluster] = np.arange(count) < told
        if told:
            decoded[cluster, :told] = orthonormal_rows(part[:told] * steps[:told])
        groups.append((len(rows), len(rows) + told))
        rows += list(part[:told])
    bits += 16 * len(rows)
    if rows:
        bits += coded_rows(np.array(rows).astype(np.int64), groups)
    most = max(int(use.sum(1).max()), 1)
    return means, decoded[:, :most], use[:, :most], bits


def labels_by_rate(points, labels, clusters, step, height, rounds=3, bit=0.07, change=0.7):
    """Texels reassigned by error and bits: of coefficients by their size, of an id by the neighbours that differ.

    Costs in squared steps: `bit` of a bit, `change` of each of four neighbours that has another id.
    """
    kept = threshold(clusters)
    for _ in range(rounds):
        sizes = np.bincount(labels, minlength=clusters)
        means, bases, spectra = fit_clusters(points, labels, clusters, min(64, points.shape[1]))
        told = (spectra[:, : bases.shape[1]] / np.maximum(sizes, 1)[:, None] > kept * step**2).sum(1)
        cost = np.full((len(points), clusters), np.inf, np.float32)
        for cluster in np.flatnonzero(sizes >= 8):
            for block in blocks(len(points), 8192):
                centred = points[block] - means[cluster]
                ratio = np.abs(centred @ bases[cluster, : told[cluster]].T) / step
                outside = np.sum(centred**2, 1) / step**2 - np.sum(ratio**2, 1)
                rate = np.minimum(ratio**2, 1 / 12 + bit * (1 + 2 * np.log2(1 + ratio)))
                cost[block, cluster] = outside + rate.sum(1)
        cost = cost.reshape(height, -1, clusters)
        grid = labels.reshape(height, -1)
        checker = np.add.outer(np.arange(grid.shape[0]), np.arange(grid.shape[1])) % 2
        for turn in range(3):
            own = np.eye(clusters, dtype=np.float32)[grid]
            near = shifted(own, 0, 1) + shifted(own, 0, -1) + shifted(own, 1, 0) + shifted(own, -1, 0)
            grid = np.where(checker == turn % 2, (cost - change * near).argmin(2), grid)
        labels = grid.reshape(-1).astype(np.int32)
    return labels


def encode(frame, height, labels, step, block=None, rounds=1, start=None):
    """A `Coded`: of clusters `labels`, or with `block` of the global form with cosines of that side.

    Its psnr_db is that of unrounded values, exact but for what lies outside the search's coordinates.
    """
    began = time.time()
    texels = len(frame.points)
    width = texels // height
    clusters = 1 if block else int(labels.max()) + 1
    kept = threshold(clusters)
    spectrum = start
    if spectrum is None:
        spectrum = (represented(frame, labels, clusters, step, kept) if block is None
                    else principal(frame.points.T.astype(np.float64) @ frame.points, step * 2))
    if block:
        # What transformed planes will hold of each component; those without any number are not told.
        planes = np.ascontiguousarray((frame.points @ spectrum[1]).T).reshape(-1, height, width)
        numbers, decoded, _ = transformed(planes, block, step)
        live = np.abs(numbers).reshape(len(numbers), -1).sum(1) > 8
        held = np.sum(decoded[live].reshape(live.sum(), -1).astype(np.float64) ** 2, 1)
        spectrum = (np.maximum(held, step**2), spectrum[1][:, live])
        del planes, numbers, decoded
    energies, directions = spectrum
    scaled = (frame.basis @ (directions * (np.sqrt(energies) / step).astype(np.float32))).T
    live, told, side_bits, ranks = shared_bases(np.ascontiguousarray(scaled), frame.shape)
    del scaled
    side_bits += 16 * len(told) + 8 * HEADER
    shared = orthonormal_rows(told / np.sqrt(energies[live])[:, None].astype(np.float32))
    del told
    points = frame.points @ (frame.basis.T @ shared.T)
    rank = points.shape[1]
    base_bits = mean_components = label_cost = 0.0
    if block:
        means, bases = np.zeros((1, rank), np.float32), np.eye(rank, dtype=np.float32)[None]
        use, labels = np.ones((1, rank), bool), np.zeros(texels, np.int64)
        numbers, decoded, _ = transformed(np.ascontiguousarray(points.T).reshape(rank, height, width), block, step)
        ends = ends_of(numbers)
        bits = bits_of(BlocksPlan(numbers.shape, ends), numbers) + 8 * rank + 32
        coefficients = np.ascontiguousarray(decoded.reshape(rank, -1).T)
        lost = 0.0
        error = float(np.sum((coefficients - points).astype(np.float64) ** 2))
        mean_components = float(rank)
    else:
        means, bases, use, base_bits = local_bases(points, labels, clusters, step, kept)
        components = bases.shape[1]
        targets, lost = np.zeros((texels, components), np.float32), 0.0
        for cluster, index in enumerate(members_of(labels, clusters)):
            centred = points[index] - means[cluster]
            targets[index] = centred @ bases[cluster].T
            lost += float(np.sum(centred.astype(np.float64) ** 2) - np.sum(targets[index].astype(np.float64) ** 2))
        grid = labels.reshape(height, width)
        numbers, decoded = predicted(targets.reshape(height, width, components), grid, means, bases, use, step)
        bits = bits_of(LocalPlan(grid, use), numbers)
        label_cost = float(label_bits(grid, clusters).sum())
        coefficients = decoded.reshape(texels, components)
        error = float(np.sum((coefficients - targets).astype(np.float64) ** 2))
        mean_components = float(use.sum(1) @ np.bincount(labels, minlength=clusters) / texels)
    outside = frame.energy - float(np.sum(points.astype(np.float64) ** 2))
    size = int(np.ceil((side_bits + base_bits + bits + label_cost) / 8))
    width_of_texel = frame.basis.shape[0]
    record = {
        "codec": "strong+", "form": f"global, cosines {block}" if block else "local", "clusters": clusters,
        "mean_components": mean_components, "shared_bases": rank, "view_rank": ranks[0], "light_rank": ranks[1],
        "step": float(step / np.sqrt(width_of_texel)), "bytes": size,
        "bytes_of": {"shared": int(side_bits / 8), "clusters": int(base_bits / 8), "labels": int(label_cost / 8),
                     "coefficients": int(bits / 8)},
        "psnr_db": psnr_db(max(outside + lost + error, 1e-9), texels * width_of_texel),
    }
    coded = Coded(shared, means, bases, use, np.asarray(labels), coefficients, record, None)
    if rounds > 1:
        coded.refitted = refitted(frame.points, coded.coordinates(np.arange(texels)), step)
        again = encode(frame, height, labels, step, block, rounds - 1, coded.refitted)
        again.record["encode_seconds"] = round(time.time() - began, 2)
        return again
    record["encode_seconds"] = round(time.time() - began, 2)
    return coded


def decode(coded, index):
    """Domain values [n, value] of texels."""
    return coded.coordinates(index) @ coded.shared


def measured(capture, domain, coded):
    """The record with psnr_db of decoded 8-bit values of all texels, and what a decoder holds and does."""
    began = time.time()

    def one(block):
        index = np.arange(block.start, block.stop)
        return squared_error(domain.codes(decode(coded, index)), np.asarray(capture.values[block]))

    error = sum(each(one, blocks(capture.texels, 1024)))
    clusters, components = coded.kept.shape
    width = capture.values.shape[1]
    used = float(coded.record["mean_components"])
    told = int(coded.kept.sum())
    return coded.record | {
        "psnr_db": psnr_db(error, capture.texels * width), "estimated_psnr_db": coded.record["psnr_db"],
        "decoded": "all texels", "decode_seconds": round(time.time() - began, 2),
        # Resident, any texel alone: 16-bit coefficients, ids, and half-precision bases of clusters at all pairs.
        "resident_bytes": int(capture.texels * (2 * used + (clusters > 1)) + 2 * (told + clusters) * width),
        # The same with factored bases: mixtures, cores and factor matrices in half precision.
        "resident_factored_bytes": int(capture.texels * (2 * used + (clusters > 1)) + 2 * (
            (told + clusters if clusters > 1 else 0) * len(coded.shared)
            + len(coded.shared) * coded.record["view_rank"] * coded.record["light_rank"] * 3)),
        # Of one measured pair, three channels, on expanded bases.
        "multiply_adds": round(3 * used, 1), "bytes_read": round(2 * used + 1 + 2 * 3 * (used + 1), 1),
    }


class Search:
    """Forms and steps by their estimates; every estimate is a real encoding but for rounding to 8 bits."""

    def __init__(self, frame, height, seed=1, clusters=CLUSTERS, sides=SIDES, log=print):
        self.frame, self.height, self.seed, self.log = frame, height, seed, log
        self.forms = [("local", k) for k in clusters if k * 16 <= len(frame.points)]
        self.forms += [("global", n) for n in sides if n <= height and height % n == 0]
        self.labels, self.found = {}, {form: [] for form in self.forms}

    def labels_of(self, clusters):
        if clusters not in self.labels:
            points = self.frame.points[:, :256]
            self.labels[clusters] = (local_pca(points, clusters, 24, self.seed, rounds=6).labels if clusters > 1
                                     else np.zeros(len(points), np.int32))
        return self.labels[clusters]

    def encode(self, form, step, labels=None):
        kind, number = form
        if kind == "global":
            coded = encode(self.frame, self.height, None, step, block=number)
        else:
            coded = encode(self.frame, self.height, self.labels_of(number) if labels is None else labels, step)
        point = coded.record
        self.found[form].append((np.log(point["bytes"]), point["psnr_db"], np.log(step)))
        self.log("strong+", form, f"step {point['step']:.3g}", point["bytes"], f"{point['psnr_db']:.2f} dB",
                 point["bytes_of"], f"{point['encode_seconds']:.0f} s")
        return coded

    def at(self, form, size):
        """(psnr_db, log step) of a form at a size, linear in log bytes, also a little beyond what was found."""
        line = np.array(sorted(self.found[form]))
        x = np.log(size)
        if len(line) == 1:
            return line[0, 1] + 2.2 * (x - line[0, 0]), line[0, 2] - 0.75 * (x - line[0, 0])
        i = int(np.clip(np.searchsorted(line[:, 0], x), 1, len(line) - 1))
        t = (x - line[i - 1, 0]) / max(line[i, 0] - line[i - 1, 0], 1e-9)
        return tuple((line[i - 1] + t * (line[i] - line[i - 1]))[1:])

    def best(self, size, count=1):
        """The forms with the best estimates there."""
        ranked = sorted((form for form in self.forms if self.found[form]), key=lambda f: -self.at(f, size)[0])
        return ranked[:count]

    def near(self, form, size, tolerance=0.03, tries=3):
        """An encoding of at most `size` bytes, and not much less."""
        best = labels = None
        aim = size * (1 - tolerance / 2)
        step = float(np.exp(self.at(form, aim)[1]))
        for _ in range(tries):
            if form[0] == "local" and form[1] > 1 and labels is None:
                points = np.ascontiguousarray(self.frame.points[:, :256])
                labels = labels_by_rate(points, self.labels_of(form[1]), form[1], step, self.height)
            coded = self.encode(form, step, labels)
            if coded.record["bytes"] <= size and (best is None or coded.record["bytes"] > best.record["bytes"]):
                best = coded
            if best and best.record["bytes"] > size * (1 - 1.5 * tolerance):
                break
            # Bytes go about with the step to the power of -1.3.
            step *= (coded.record["bytes"] / aim) ** 0.75
        return best


def scan(search, targets):
    """Finds each form's curve by a few encodings, the promising ones at all of a coarse grid of sizes."""
    step = 8.0 * np.sqrt(search.frame.basis.shape[0])
    low, high = min(targets), max(targets)
    probe = np.sqrt(low * high)
    for form in search.forms:
        # The first form seeks the step of the middle size; the others start from what it found.
        known = [search.at(other, probe)[1] for other in search.forms if search.found[other]]
        start = float(np.exp(np.median(known))) if known else step
        size = search.encode(form, start).record["bytes"]
        while not known and not probe / 2 < size < probe * 2 and len(search.found[form]) < 8:
            start = float(np.exp(search.at(form, min(max(probe, size / 8), size * 8))[1]))
            size = search.encode(form, start).record["bytes"]
    for size in (low, high):
        for form in search.best(probe, 3):
            search.encode(form, float(np.exp(search.at(form, size)[1])))
        # Curves cross: the best one at an end may be one that looked worse in the middle.
        for form in search.forms:
            best = search.at(search.best(size)[0], size)[0]
            if len(search.found[form]) == 1 and search.at(form, size)[0] > best - 0.3:
                search.encode(form, float(np.exp(search.at(form, size)[1])))


def sweep(capture, domain, frame, targets=TARGETS, seed=1, log=print, clusters=CLUSTERS, sides=SIDES, then=None):
    """Measured points, one for each size; `then(coded, point)` may measure more of each and write it into the point."""
    targets = [t for t in targets if t < capture.raw_bytes / 8]
    search = Search(frame, capture.height, seed, clusters, sides, log)
    scan(search, targets)
    result = []
    for target in targets:
        form = search.best(target)[0]
        coded = search.near(form, target)
        # A neighbour of the best form may pass it at its real curve.
        rival = search.best(target)[0]
        if rival != form:
            other = search.near(rival, target)
            coded = max((c for c in (coded, other) if c), key=lambda c: c.record["psnr_db"], default=None)
        if coded is None:
            continue
        point = measured(capture, domain, coded) | {"target": int(target)}
        if then:
            then(coded, point)
        result.append(point)
    return result

"""Pairs left out of the fit, chosen as `btf-fit fit --leave-out` chooses them, and how a rival predicts them.

The rival is fitted to the measured pairs only (masked alternating least squares): bases are completed at the held-back
pairs by the best linear prediction under a separable covariance (view x light, estimated from the measured pairs and the
completion in turns), coefficients are solved on measured pairs. Two predictions of held-back pairs are measured, and
their mean: the decoded completion, and decoded measured neighbours interpolated in linear values.
"""

import json
from pathlib import Path

import numpy as np

from . import coordinates, strong
from .coordinates import Coordinates, blocks
from .directions import Triangles
from .domain import encoded_of, psnr_db
from .parallel import each

MASK64 = (1 << 64) - 1


class Xoshiro256PlusPlus:
    """[Blackman and Vigna 2019], seeded by SplitMix64 as rand_xoshiro's `seed_from_u64` does."""

    def __init__(self, seed):
        self.state = []
        for _ in range(4):
            seed = (seed + 0x9E3779B97F4A7C15) & MASK64
            z = seed
            z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK64
            z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK64
            self.state.append(z ^ (z >> 31))

    def next_u64(self):
        rotate = lambda x, k: ((x << k) | (x >> (64 - k))) & MASK64
        s = self.state
        result = (rotate((s[0] + s[3]) & MASK64, 23) + s[0]) & MASK64
        t = (s[1] << 17) & MASK64
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= t
        s[3] = rotate(s[3], 45)
        return result

    def below(self, bound):
        """Uniform below `bound`, as rand 0.8's `gen_range(0..bound as u32)`."""
        zone = ((bound << (32 - bound.bit_length())) - 1) & 0xFFFFFFFF
        while True:
            product = (self.next_u64() >> 32) * bound
            if product & 0xFFFFFFFF <= zone:
                return product >> 32


def held_pairs(pair_count, share, seed):
    """Ascending pairs (view * lights + light): the first of a shuffle of all."""
    pairs = list(range(pair_count))
    generator = Xoshiro256PlusPlus(seed ^ 0x5EED0F0E)
    for i in range(pair_count - 1, 0, -1):
        j = generator.below(i + 1)
        pairs[i], pairs[j] = pairs[j], pairs[i]
    # Rust rounds halves away from zero.
    return sorted(pairs[: int(np.floor(pair_count * share + 0.5))])


def read_pairs(path, lights):
    """Held-back pairs of a JSON file [[view, light], ...]."""
    return sorted(view * lights + light for view, light in json.loads(Path(path).read_text(encoding="utf-8")))


def values_of_pairs(pairs):
    return (np.asarray(pairs)[:, None] * 3 + np.arange(3)).reshape(-1)


def complete(weighted_kept, kept, held, shape, rounds=4, noise=1e-3, log=print):
    """[n, held, 3] prediction from [n, kept, 3]: separable kriging, covariances by expectation-maximisation."""
    views, lights, _ = shape
    count = views * lights
    filled = np.zeros((len(weighted_kept), count, 3))
    filled[:, kept] = weighted_kept
    predicted = None
    for step in range(rounds):
        tensor = filled.reshape(-1, views, lights, 3)
        if step == 0:
            # The measured share of each product stands in for the whole.
            seen = np.zeros(count)
            seen[kept] = 1
            seen = seen.reshape(views, lights)
            light = np.einsum("nvlc,nvmc->lm", tensor, tensor, optimize=True) / np.maximum(seen.T @ seen, 1)
            view = np.einsum("nvlc,nwlc->vw", tensor, tensor, optimize=True) / np.maximum(seen @ seen.T, 1)
            light, view = positive(light), positive(view)
        else:
            light = np.einsum("nvlc,nvmc->lm", tensor, tensor, optimize=True) / views
            view = np.einsum("nvlc,nwlc->vw", tensor, tensor, optimize=True) / lights
        light = light / np.trace(light) * lights
        view = view / np.trace(view) * views
        v, l = np.divmod(np.arange(count), lights)
        covariance = view[np.ix_(v[kept], v[kept])] * light[np.ix_(l[kept], l[kept])]
        covariance[np.diag_indices_from(covariance)] += noise
        cross = view[np.ix_(v[held], v[kept])] * light[np.ix_(l[held], l[kept])]
        right = filled[:, kept].transpose(1, 0, 2).reshape(len(kept), -1)
        from scipy.linalg import cho_factor, cho_solve

        predicted = cross @ cho_solve(cho_factor(covariance, overwrite_a=True, check_finite=False), right)
        predicted = predicted.reshape(len(held), -1, 3).transpose(1, 0, 2)
        filled[:, held] = predicted
    return predicted


def positive(matrix):
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    return (vectors * np.maximum(values, 1e-6 * values[-1])) @ vectors.T


class Filled:
    """A capture whose held-back values are replaced by what `points @ bases` predicts, rounded to 8 bits."""

    def __init__(self, capture, held_values, points, held_basis):
        self.source, self.held_values, self.points, self.held_basis = capture.values, held_values, points, held_basis
        self.shape = capture.values.shape

    def __getitem__(self, index):
        values = np.array(self.source[index])
        values[:, self.held_values] = np.clip(np.rint(self.points[index] @ self.held_basis), 0, 255)
        return values


def neighbour_weights(capture, kept, held):
    """Two sparse [held, pair] matrices: means of measured neighbours at the same view, and at the same light."""
    from scipy.sparse import csr_matrix

    views, lights, _ = capture.shape
    near_light, near_view = Triangles(capture.lights_deg).neighbours(), Triangles(capture.views_deg).neighbours()
    measured = np.zeros(views * lights, bool)
    measured[kept] = True
    both = np.zeros((2, len(held), views * lights), np.float32)
    for row, pair in enumerate(held):
        view, light = divmod(int(pair), lights)
        for which, near in ((0, view * lights + near_light[light]), (1, near_view[view] * lights + light)):
            near = near[measured[near]]
            if len(near):
                both[which, row, near] = 1 / len(near)
    empty = both.sum(-1) == 0
    both[0][empty[0]] = both[1][empty[0]]
    both[1][empty[1]] = both[0][empty[1]]
    return csr_matrix(both[0]), csr_matrix(both[1])


def measure(capture, domain, held, size, rank=256, seed=1, log=print):
    """The report of one leave-out: psnr_db over kept and held-back pairs, by way of prediction."""
    views, lights, _ = capture.shape
    held = np.asarray(sorted(held))
    kept = np.setdiff1d(np.arange(views * lights), held)
    kept_values, held_values = values_of_pairs(kept), values_of_pairs(held)
    frame = coordinates.measure(capture, domain, rank, seed, keep=kept_values)
    strength = np.sqrt(np.sum(frame.points.astype(np.float64) ** 2, 0))
    weighted = (frame.basis * strength).T.reshape(frame.rank, len(kept), 3)

    # The noise (what the separable covariance does not explain) by hiding a tenth of the measured pairs.
    rng = np.random.default_rng(seed)
    hidden = np.sort(rng.choice(len(kept), max(len(kept) // 10, 1), replace=False))
    rest = np.setdiff1d(np.arange(len(kept)), hidden)
    errors = {}
    for noise in (1e-4, 3e-4, 1e-3, 3e-3, 1e-2):
        guess = complete(weighted[:, rest], kept[rest], kept[hidden], capture.shape, rounds=2, noise=noise)
        errors[noise] = float(np.sum((guess - weighted[:, hidden]) ** 2))
    noise = min(errors, key=errors.get)
    log(f"completion: noise {noise:g}, hidden pairs "
        f"{psnr_db(errors[noise], capture.texels * len(hidden) * 3):.2f} dB before coding")
    predicted = complete(weighted, kept, held, capture.shape, noise=noise)
    predicted = (predicted / np.maximum(strength, 1e-9)[:, None, None]).reshape(frame.rank, -1).astype(np.float32)

    # A frame over all values; its columns are made orthonormal again.
    basis = np.zeros((views * lights * 3, frame.rank), np.float32)
    basis[kept_values], basis[held_values] = frame.basis, predicted.T
    filled = Filled(capture, held_values, frame.points, predicted)
    q, r = np.linalg.qr(basis.astype(np.float64))
    points = frame.points @ r.T.astype(np.float32)
    _, turn = np.linalg.eigh(points.T.astype(np.float64) @ points)
    turn = turn[:, ::-1].astype(np.float32)
    full = Coordinates((q.astype(np.float32) @ turn), points @ turn, 0.0, capture.shape)
    full.energy = float(np.sum(full.points.astype(np.float64) ** 2)) + frame.outside

    stand_in = type(capture)(capture.name, filled, capture.height, capture.width, capture.views_deg, capture.lights_deg,
                             capture.transfer)
    spaces = strong.spaces_of(full, log)
    found, chosen = strong.search(full, spaces, capture.texels, size, seed, clusters=(8, 16, 32, 48), log=log)
    estimate = strong.best_at(found, [size])[0]
    point, encoded = strong.measure(stand_in, domain, full, spaces, estimate, chosen, seed)

    # Coefficients once more, on measured pairs only; then everything is decoded.
    members = strong.members_of(encoded.labels, encoded.clusters)
    by_light, by_view = neighbour_weights(capture, kept, held)
    names = ("completion", "light neighbours", "view neighbours", "all neighbours", "mean of both")

    def one(cluster):
        index = members[cluster]
        sums = np.zeros(1 + len(names))
        if len(index) == 0:
            return sums
        mean, bases = encoded.expanded(cluster)
        scores = np.concatenate([strong.solve_coefficients(
            domain.forward(np.asarray(capture.values[index[b]])[:, kept_values]) - mean[kept_values],
            bases[:, kept_values]) for b in blocks(len(index))])
        scale = np.maximum(np.abs(scores).max(0) / 127, 1e-7).astype(np.float16).astype(np.float32) * 1.001
        codes = np.clip(np.rint(scores / scale), -127, 127)
        for b in blocks(len(index), 256):
            measured = np.asarray(capture.values[index[b]]).astype(np.float32)
            decoded = (codes[b] * scale).astype(np.float32) @ bases + mean
            truth = measured[:, held_values]
            linear = domain.to_linear(decoded).astype(np.float32).reshape(len(decoded), -1, 3)
            direct = np.clip(decoded[:, held_values], 0, 255)
            # Interpolated linear values, encoded again.
            linear = np.ascontiguousarray(linear.transpose(1, 0, 2)).reshape(views * lights, -1)
            sides = [weights @ linear for weights in (by_light, by_view)]
            mixes = []
            for mixed in (*sides, (sides[0] + sides[1]) / 2):
                mixed = mixed.reshape(len(held), -1, 3).transpose(1, 0, 2).reshape(len(decoded), -1)
                mixes.append(255 * np.clip(encoded_of(mixed, capture.transfer), 0, 1))
            guesses = [direct, *mixes, (direct + mixes[2]) / 2]
            sums[0] += np.sum((domain.codes(decoded)[:, kept_values] - measured[:, kept_values]).astype(np.float64) ** 2)
            for slot, guess in enumerate(guesses):
                sums[1 + slot] += np.sum((np.rint(guess) - truth).astype(np.float64) ** 2)
        return sums

    sums = sum(each(one, range(encoded.clusters)))
    by_way = {name: psnr_db(s, capture.texels * len(held_values)) for name, s in zip(names, sums[1:])}
    return {
        "held_pairs": len(held), "bytes": encoded.bytes, "clusters": encoded.clusters, "components": encoded.components,
        "view_rank": point["view_rank"], "light_rank": point["light_rank"], "noise": noise,
        "psnr_db_kept": psnr_db(sums[0], capture.texels * len(kept_values)),
        "psnr_db_held": max(by_way.values()), "psnr_db_held_by": by_way,
    }

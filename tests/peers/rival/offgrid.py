"""Directions between the measured ones: the rival decodes nine neighbours to linear values and interpolates them."""

import numpy as np

from . import strong
from .coordinates import blocks
from .directions import pair_weights
from .domain import encoded_of, linear_of, psnr_db
from .parallel import each


def strong_groups(encoded):
    """`groups` of the strong rival: one for each cluster."""

    def groups(columns):
        for cluster, index in enumerate(strong.members_of(encoded.labels, encoded.clusters)):
            if len(index):
                yield index, lambda part, k=cluster: decoded_at(encoded, k, part, columns)

    return groups


def decoded_at(encoded, cluster, part, columns):
    mean, bases = encoded.expanded(cluster)
    return (encoded.codes[part] * encoded.scales[cluster]) @ np.ascontiguousarray(bases[:, columns]) + mean[columns]


def plus_groups(coded):
    """`groups` of strong+: all texels."""

    def groups(columns):
        shared = np.ascontiguousarray(coded.shared[:, columns])
        yield np.arange(len(coded.labels)), lambda part: coded.coordinates(part) @ shared

    return groups


def cosines(directions_deg):
    """Cosines to the normal, not below 0.05."""
    return np.maximum(np.cos(np.radians(np.asarray(directions_deg, np.float64)[:, 0])), 0.05)


def measure(capture, other, domain, groups, told, uncompressed=True):
    """psnr_db over all values of `other` (same texels, other directions): of a decoder and of the uncompressed capture,
    which bounds it, by the best of four interpolations: of linear or gamma-encoded values, each as they are or divided
    by the light's cosine before and multiplied by it after (so that they fall off beyond the measured lights).

    `groups(columns)` yields texels and a function that decodes a part of them at these values; `told` is reported.
    """
    plain = pair_weights(capture.views_deg, capture.lights_deg, other.views_deg, other.lights_deg)
    ratio = np.tile(cosines(other.lights_deg), len(other.views_deg))[:, None] / np.tile(
        cosines(capture.lights_deg), len(capture.views_deg))
    used = np.flatnonzero(plain.any(0))
    ways = {
        "linear": (True, plain), "gamma": (False, plain),
        "linear, by cosine": (True, plain * ratio), "gamma, by cosine": (False, plain * ratio ** (1 / 2.4)),
    }
    ways = {name: (linear, np.ascontiguousarray(w[:, used].T.astype(np.float32))) for name, (linear, w) in ways.items()}
    columns = (used[:, None] * 3 + np.arange(3)).reshape(-1)
    pairs = len(plain)

    def errors(linear, truth):
        """[way, new pair] sums of squares of one source of linear values at the used pairs."""
        gamma = encoded_of(linear, capture.transfer).astype(np.float32)
        sums = []
        for from_linear, weights in ways.values():
            values = (linear if from_linear else gamma).reshape(len(truth), -1, 3)
            mixed = np.stack([values[:, :, c] @ weights for c in range(3)], -1)
            if from_linear:
                mixed = encoded_of(mixed, capture.transfer)
            guess = np.rint(255 * np.clip(mixed, 0, 1))
            sums.append(np.sum((guess - truth).astype(np.float64) ** 2, (0, 2)))
        return np.array(sums)

    def one(work):
        part, decode = work
        truth = np.asarray(other.values[part]).astype(np.float32).reshape(len(part), pairs, 3)
        sources = [domain.to_linear(decode(part)).astype(np.float32)]
        if uncompressed:
            measured = np.asarray(capture.values[part])[:, columns] / np.float32(255)
            sources.append(linear_of(measured, capture.transfer).astype(np.float32))
        return np.array([errors(source, truth) for source in sources])

    parts = [(index[b], decode) for index, decode in groups(columns) for b in blocks(len(index))]
    sums = sum(each(one, parts))
    inside = np.outer(np.asarray(other.views_deg)[:, 0] <= 70, np.asarray(other.lights_deg)[:, 0] <= 70).reshape(-1)
    result = told | {"capture": other.name, "views": len(other.views_deg), "lights": len(other.lights_deg)}
    for name, by_way in zip(("psnr_db", "psnr_db_uncompressed"), sums):
        for ending, which in (("", np.ones(pairs, bool)), ("_within_70_degrees", inside)):
            if which.any():
                count = capture.texels * int(which.sum()) * 3
                by = {way: psnr_db(float(s[which].sum()), count) for way, s in zip(ways, by_way)}
                result[name + ending] = max(by.values())
                result[name + ending + "_by"] = by
    return result

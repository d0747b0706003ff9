"""Directions between the measured ones: the rival decodes nine neighbours to linear values and interpolates them."""

import numpy as np

from . import strong
from .coordinates import blocks
from .directions import pair_weights
from .domain import encoded_of, linear_of, psnr_db
from .parallel import each


def measure(capture, other, domain, encoded):
    """psnr_db over all values of `other` (same texels, other directions): of the encoded rival in linear and in gamma
    interpolation, and of the uncompressed capture interpolated alike, which bounds it."""
    weights = pair_weights(capture.views_deg, capture.lights_deg, other.views_deg, other.lights_deg)
    used = np.flatnonzero(weights.any(0))
    weights = np.ascontiguousarray(weights[:, used].T)
    columns = (used[:, None] * 3 + np.arange(3)).reshape(-1)
    members = strong.members_of(encoded.labels, encoded.clusters)

    def interpolated(values):
        """[texel, new pair * 3] of [texel, used pair * 3]."""
        values = values.reshape(len(values), -1, 3)
        return np.stack([values[:, :, c] @ weights for c in range(3)], -1).reshape(len(values), -1)

    def encoded_codes(linear):
        return np.rint(255 * np.clip(encoded_of(linear, capture.transfer), 0, 1))

    def one(cluster):
        sums = np.zeros(3)
        index = members[cluster]
        if len(index) == 0:
            return sums
        mean, bases = encoded.expanded(cluster)
        mean, bases = mean[columns], np.ascontiguousarray(bases[:, columns])
        for b in blocks(len(index)):
            part = index[b]
            truth = np.asarray(other.values[part]).astype(np.float32)
            decoded = (encoded.codes[part] * encoded.scales[cluster]) @ bases + mean
            measured = np.asarray(capture.values[part])[:, columns] / np.float32(255)
            linear = domain.to_linear(decoded).astype(np.float32)
            gamma = encoded_of(linear, capture.transfer).astype(np.float32)
            guesses = (encoded_codes(interpolated(linear)), np.rint(255 * np.clip(interpolated(gamma), 0, 1)),
                       encoded_codes(interpolated(linear_of(measured, capture.transfer).astype(np.float32))))
            sums += [np.sum((guess - truth).astype(np.float64) ** 2) for guess in guesses]
        return sums

    sums = sum(each(one, range(encoded.clusters)))
    count = other.values.shape[0] * other.values.shape[1]
    return {
        "capture": other.name, "views": len(other.views_deg), "lights": len(other.lights_deg), "bytes": encoded.bytes,
        "clusters": encoded.clusters, "components": encoded.components,
        "psnr_db": psnr_db(sums[0], count), "psnr_db_gamma_interpolation": psnr_db(sums[1], count),
        "psnr_db_uncompressed": psnr_db(sums[2], count),
    }

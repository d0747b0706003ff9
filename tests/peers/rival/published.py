"""The published codecs: full matrix factorisation and local PCA, linear domain, half precision throughout.

Full matrix factorisation [Koudelka 2003; btflib's FMF]: global components, no mean. Local PCA [Mueller 2003]: a mean and
components per cluster, texels reassigned by reconstruction error.
"""

import time

import numpy as np

from .clusters import local_pca
from .coordinates import blocks
from .domain import psnr_db, squared_error
from .parallel import each
from .strong import id_bits, members_of
from .tucker import quantise_half

FMF_COMPONENTS = (4, 8, 16, 32, 64)
LPCA_CLUSTERS = (4, 8, 16, 32, 64)
LPCA_COMPONENTS = (1, 2, 4, 8, 12, 16)
# Points beyond this size are decoded on a sample of texels only, except 32 x 8.
DECODE_ALL_BYTES = 5e6
SAMPLE_TEXELS = 4096


def fmf_bytes(texels, width, components):
    return 2 * components * (texels + width)


def lpca_bytes(texels, width, clusters, components):
    bases = 2 * clusters * (components + 1) * width
    return bases + 2 * texels * components + (texels * id_bits(clusters) + 7) // 8


def decode_error(capture, domain, labels, means, bases, index):
    """Sum of squares over the texels `index`; half-precision bases, coefficients by projection, half precision."""

    def one(cluster):
        part = index[labels[index] == cluster]
        if len(part) == 0:
            return 0.0
        stored = quantise_half(bases[cluster])
        gram = (stored @ stored.T).astype(np.float64)
        gram += np.eye(len(gram)) * (1e-7 * np.trace(gram) / len(gram) + 1e-12)
        inverse = np.linalg.inv(gram)
        mean = quantise_half(means[cluster])
        error = 0.0
        for block in blocks(len(part)):
            codes = np.asarray(capture.values[part[block]])
            scores = quantise_half(((domain.forward(codes) - mean) @ stored.T @ inverse).astype(np.float32))
            error += squared_error(domain.codes(scores @ stored + mean), codes)
        return error

    return sum(each(one, range(len(means))))


def record(codec, capture, error, texels, size, seconds, **parameters):
    width = capture.values.shape[1]
    return {
        "codec": codec, "domain": "linear", **parameters, "bytes": size, "psnr_db": psnr_db(error, texels * width),
        "encode_seconds": round(seconds, 2), "decoded": "all texels" if texels == capture.texels else f"{texels} texels",
    }


def fmf_points(capture, domain, frame, components=FMF_COMPONENTS):
    """Global components. Blocks of texels are decoded in parallel, as clusters are elsewhere."""
    width = capture.values.shape[1]
    everything = np.arange(capture.texels)
    # Every worker takes a slice of the texels, as if it were a cluster with the same bases.
    share = (everything * 8 // capture.texels).astype(np.int32)
    result = []
    for c in components:
        if c > frame.rank:
            continue
        start = time.time()
        bases = np.ascontiguousarray(frame.basis[:, :c].T)[None].repeat(8, 0)
        error = decode_error(capture, domain, share, np.zeros((8, width), np.float32), bases, everything)
        result.append(record("fmf", capture, error, capture.texels, fmf_bytes(capture.texels, width, c),
                             time.time() - start, components=c))
    return result


def lpca_points(capture, domain, frame, seed=1, clusters=LPCA_CLUSTERS, components=LPCA_COMPONENTS, log=print):
    """Local PCA in coordinates, bases once more by least squares on all values, then decoded."""
    width = capture.values.shape[1]
    rng = np.random.default_rng(seed)
    sample = np.sort(rng.choice(capture.texels, min(SAMPLE_TEXELS, capture.texels), replace=False))
    result = []
    for k in clusters:
        labels = None
        for c in components:
            start = time.time()
            size = lpca_bytes(capture.texels, width, k, c)
            model = local_pca(frame.points, k, c, seed, rounds=6 if labels is None else 3, labels=labels)
            labels = model.labels
            members = members_of(labels, k)
            in_full = size <= DECODE_ALL_BYTES or (k, c) == (32, 8)
            means = np.empty((k, width), np.float32)
            bases = np.empty((k, c, width), np.float32)

            def refit(cluster):
                index = members[cluster]
                means[cluster] = frame.basis @ model.means[cluster]
                bases[cluster] = model.bases[cluster] @ frame.basis.T
                if not in_full or len(index) == 0:
                    return
                scores = (frame.points[index] - model.means[cluster]) @ model.bases[cluster].T
                image, total = np.zeros((c, width), np.float32), np.zeros(width, np.float32)
                for block in blocks(len(index)):
                    values = domain.forward(capture.values[index[block]])
                    total += values.sum(0)
                    image += scores[block].T @ values
                means[cluster] = total / len(index)
                power = np.sum(scores.astype(np.float64) ** 2, 0)[:, None]
                image = image.astype(np.float64) / np.maximum(power, 1e-12)
                length = np.linalg.norm(image, axis=1, keepdims=True)
                bases[cluster] = image / np.maximum(length, 1e-12)

            each(refit, range(k))
            index = np.arange(capture.texels) if in_full else sample
            error = decode_error(capture, domain, labels, means, bases, index)
            result.append(record("local pca", capture, error, len(index), size, time.time() - start,
                                 clusters=k, components=c))
        log(f"local pca {k} x {components}: " + ", ".join(f"{p['psnr_db']:.2f}" for p in result[-len(components):]))
    return result

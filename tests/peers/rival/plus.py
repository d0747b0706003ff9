"""Strong+: the strong rival with bits by importance and entropy-coded codes. Told beside the rival, not part of it.

In an orthonormal basis one quantisation step for all coefficients of all clusters is reverse water-filling: components
of little energy get few bits, and those below the step vanish. What is left is coded by a general coder, planes in raster
order. Cores get the same treatment with a step of their own. No random access.
"""

import time

import numpy as np

from .clusters import local_pca
from .coordinates import blocks
from .domain import psnr_db, squared_error
from .entropy import coded_bytes, order_zero_bytes, plane_bytes
from .parallel import each
from .strong import members_of
from .tucker import quantise_half

# Coefficient steps of the sweep, in 8-bit steps x sqrt(values): the last ones matter on smooth materials alone.
STEPS = (12, 8, 5, 3.2, 2, 1.3, 0.8, 0.5, 0.3, 0.2)


def symbols_bytes(symbols):
    """Bytes of small integers of any sign: folded to bytes, larger ones escaped into 16 bits more."""
    folded = np.where(symbols < 0, -2 * symbols - 1, 2 * symbols)
    escaped = folded > 254
    low = np.where(escaped, 255, folded).astype(np.uint8)
    # An adaptive arithmetic coder of order zero is real and standard; its size is within a fraction of a per cent of this.
    return min(plane_bytes(low), order_zero_bytes(low.reshape(-1))) + 2 * int(escaped.sum())


def encode(capture, domain, frame, space, clusters, components, labels, step, seed=1, rounds=4):
    """(record) with coefficient step `step` (in 8-bit steps x sqrt(values))."""
    start = time.time()
    inner = frame.points @ space.turn
    model = local_pca(inner, clusters, components, seed, rounds=rounds, labels=labels)
    members = members_of(model.labels, clusters)
    half = space.factors.half()
    light, view = space.factors.ranks[1], space.factors.ranks[0]
    width = capture.values.shape[1]
    symbols = np.zeros((capture.texels, components), np.int32)
    kept = np.zeros((clusters, components), bool)
    size = space.factors.bytes + 2 * space.factors.core_size + 4 * 2
    sizes = np.array([len(index) for index in members], np.float64)
    mean = quantise_half(np.tensordot(sizes / sizes.sum(), model.means @ space.cores, 1))
    # An error of d in a core's value costs d^2 x its coefficients' energy; one in a coefficient costs its square.
    stacks, core_symbols = [], []
    for cluster, index in enumerate(members):
        scores = (inner[index] - model.means[cluster]) @ model.bases[cluster].T
        energy = np.sum(scores.astype(np.float64) ** 2, 0)
        # A component stays where it saves more error than its bytes would elsewhere; below the step all symbols are 0.
        kept[cluster] = np.abs(np.rint(scores / step)).sum(0) > 8 if len(index) else False
        weights = np.sqrt(np.maximum(np.concatenate([[len(index)], energy]), 1e-12))
        stack = np.concatenate([(model.means[cluster] @ space.cores - mean)[None], model.bases[cluster] @ space.cores])
        stack[1:][~kept[cluster]] = 0
        steps = np.maximum(quantise_half(step / weights).astype(np.float32), 6e-8)[:, None]
        quantised = np.rint(stack / steps).astype(np.int64)
        quantised[1:][~kept[cluster]] = 0
        core_symbols.append(quantised[np.concatenate([[True], kept[cluster]])])
        stacks.append((quantised * steps).astype(np.float32))
        size += 2 * (1 + int(kept[cluster].sum()))
    flat = np.concatenate(core_symbols)
    # Planes of equal (light, view, channel) row together: their magnitudes are alike.
    size += min(sum(symbols_bytes(flat[:, i : i + view * 3]) for i in range(0, flat.shape[1], view * 3)),
                symbols_bytes(flat))

    def fit_and_decode(cluster):
        index = members[cluster]
        if len(index) == 0:
            return 0.0
        use = np.flatnonzero(kept[cluster])
        cores = np.concatenate([(mean + stacks[cluster][0])[None], stacks[cluster][1:][use]])
        values = half.expand(cores.reshape(len(cores), light, view * 3))
        mean_values, bases = values[0], values[1:]
        length = np.maximum(np.linalg.norm(bases, axis=1), 1e-6)
        gram = (bases @ bases.T).astype(np.float64)
        inverse = np.linalg.inv(gram + np.eye(len(gram)) * (1e-7 * np.trace(gram) / max(len(gram), 1) + 1e-12))
        offset = bases @ mean_values
        error = 0.0
        for block in blocks(len(index)):
            part = index[block]
            codes = np.asarray(capture.values[part])
            scores = ((domain.forward(codes) @ bases.T - offset) @ inverse).astype(np.float32)
            # A dead zone: rounding towards zero costs little error and saves many bits.
            ratio = scores * length / step
            quantised = np.sign(ratio) * np.floor(np.abs(ratio) + 0.42)
            symbols[part[:, None], use[None]] = quantised
            error += squared_error(domain.codes((quantised * (step / length)).astype(np.float32) @ bases + mean_values), codes)
        return error

    error = sum(each(fit_and_decode, range(clusters)))
    planes = symbols.reshape(capture.height, capture.width, components)
    by_plane = sum(each(lambda c: symbols_bytes(planes[:, :, c]), range(components)))
    # The same grouped by cluster: the statistics of a cluster's component are its own.
    by_cluster = sum(each(lambda k: sum(symbols_bytes(symbols[members[k]][None, :, c]) for c in np.flatnonzero(kept[k])),
                          range(clusters)))
    size += min(by_plane, by_cluster) + (kept.size + 7) // 8
    if clusters > 1:
        size += min(plane_bytes(model.labels.reshape(capture.height, capture.width)),
                    order_zero_bytes(model.labels))
    return {
        "codec": "strong+", "domain": domain.kind, "clusters": clusters, "components": components,
        "mean_components": float(kept.sum(1) @ sizes / sizes.sum()), "view_rank": view, "light_rank": light,
        "step": float(step), "bytes": int(size), "psnr_db": psnr_db(error, capture.texels * width),
        "encode_seconds": round(time.time() - start, 2), "decoded": "all texels",
    }


def sweep(capture, domain, frame, spaces, largest, seed=1, log=print, clusters=(1, 8, 32), steps=None):
    """Points over coefficient steps; step s gives a mean error of about s^2 / 12 per kept coefficient."""
    width = capture.values.shape[1]
    result = []
    for k in clusters:
        labels = None
        for step in steps or [s * np.sqrt(width) for s in STEPS]:
            # A finer step pays for higher ranks and more components.
            at = max(0, min(len(spaces) - 1, int(len(spaces) * (0.25 + 0.5 * np.log(12 * np.sqrt(width) / step) / np.log(9)))))
            components = int(min(96, 6 * (12 * np.sqrt(width) / step) ** 1.3) * (2 if k == 1 else 1))
            space = spaces[at]
            components = min(components, space.cores.shape[0] - 1)
            if labels is None and k > 1:
                labels = local_pca(frame.points[:, :128], k, 4, seed, rounds=5).labels
            start_labels = labels if k > 1 else np.zeros(capture.texels, int)
            point = encode(capture, domain, frame, space, k, components, start_labels, step, seed)
            log("strong+", {n: point[n] for n in ("clusters", "mean_components", "view_rank", "light_rank", "bytes")},
                f"{point['psnr_db']:.2f} dB")
            if point["bytes"] > largest * 1.3:
                break
            result.append(point)
    return result

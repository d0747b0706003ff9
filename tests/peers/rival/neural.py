"""Neural rivals: a NeuMIP-like codec and a smaller one, trained, quantised, entropy-coded and decoded again.

`train` fits latents and network (see neural_model.py) to 8-bit values: latents start as principal components, the
network's factors as the components themselves; then Adam on random texels x views x lights with a cosine schedule. In
the last part of the training latents and weights are rounded (straight-through). `serialise` writes every byte that
`deserialise` needs, and all errors are of values decoded from what `deserialise` gives back.
"""

import math
import time

import numpy as np
import torch

from . import coordinates
from .directions import pair_weights
from .domain import Domain, encoded_of, psnr_db
from .neural_file import deserialise, eight_bit_bytes, memory_bytes, serialise
from .neural_model import Model, Shape, features, vectors

# The two kinds, and the texels x views x lights of one of their steps.
KINDS = {
    "neural": {"latents": 8, "hidden": 32, "layers": 2, "direction": 64},
    "neumip": {"latents": 40, "hidden": 40, "layers": 3, "direction": 128, "offset": 7},
}
BATCHES = {"neural": {"texels": 128, "views": 16, "lights": 16}, "neumip": {"texels": 96, "views": 16, "lights": 16}}
# Adam's first rate for the network; latents, which have unit spread, go four times as far.
RATE = 5e-3
# Share of the training in which the encoder gives the latents.
ENCODER_SHARE = 0.5
# Share of the training with rounded latents and weights.
ROUNDED_SHARE = 0.3
# Of the time, what goes to all pairs after the training on those that are not held back.
SECOND_SHARE = 1 / 3
# Rounding of latents may add this share of the squared error (before training goes on with it).
NOISE_SHARE = 0.02


# Training is told in seconds of CPU time, so that a busy machine takes nothing from it; one thread works.
clock = time.process_time


def values_of(pairs):
    """The values of these pairs."""
    return (np.asarray(pairs)[:, None] * 3 + np.arange(3)).reshape(-1)


def components(data, kept, seed, rank=64):
    """Principal components of the measured pairs in 8-bit values: (mean, factors [value, rank], scores [texel, rank])."""
    frame = coordinates.measure(data, Domain("gamma", data.transfer), rank, seed, keep=values_of(kept))
    centre = frame.points.mean(0)
    spread = np.maximum(frame.points.std(0), 1e-3)
    return frame.basis @ centre, frame.basis * spread, ((frame.points - centre) / spread).astype(np.float32)


def start(data, shape, kept, found, seed, fit_seconds, fit_steps=None):
    """A model whose latents are principal components (`found`) and whose factors are fitted to them."""
    views, lights, _ = data.shape
    torch.manual_seed(seed)  # the same start for the same seed
    mean, factors, scores = found
    sigma = float(np.sqrt((factors**2).sum(1).mean())) or 1.0
    model = Model(shape, data.transfer, sigma, torch.zeros(3), data.texels)
    for table in model.tables:
        table.encode_with(torch.from_numpy(scores), linear=table is model.tables[0])
    target = np.concatenate([mean[:, None], factors[:, : shape.latents]], 1) / sigma
    target = torch.from_numpy(target.astype(np.float32)).reshape(len(kept), -1)
    every = features(data.views_deg, data.lights_deg, shape.frequencies).reshape(views * lights, -1)[kept]
    if shape.factors:
        # The network of directions alone: cheap beside a sweep over the capture.
        optimiser = torch.optim.Adam(model.decoder.direction.parameters(), 5e-3)
        begun, steps = clock(), 0
        while (spent := steps / fit_steps if fit_steps else (clock() - begun) / fit_seconds) < 1:
            steps += 1
            optimiser.param_groups[0]["lr"] = 5e-3 * (0.5 + 0.5 * math.cos(math.pi * spent))
            some = torch.randint(0, len(kept), (1024,))
            got = model.decoder.of_directions(every[some])[2]
            loss = (got - target[some]).square().sum(1).mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
    return model


def train(data, shape, seconds, held=(), seed=1, model=None, found=None, texels=128, views=16, lights=16, rate=RATE,
          latent_rate=4 * RATE, log=print, marks=12, steps_at_most=None, fit_steps=None):
    """(model, curve): trained for `seconds` of `clock` (or a number of steps); `held` pairs are never looked at.

    The curve is [[seconds, psnr_db of a fixed sample, not rounded to 8 bits]], `model` what to go on with, `found` the
    principal components to start from. A step is on `texels` x `views` x `lights`."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    begun = clock()
    view_count, light_count, _ = data.shape
    measured = np.ones((view_count, light_count), bool)
    measured.reshape(-1)[list(held)] = False
    kept = np.flatnonzero(measured)
    if model is None:
        found = found or components(data, kept, seed)
        model = start(data, shape, kept, found, seed, min(15.0, seconds / 12), fit_steps)
    for table in model.tables:
        table.step = None
        if table.encoder is None:
            table.settle()
    model.decoder.round_weights(None)
    decoder, sigma = model.decoder, model.sigma
    every = features(data.views_deg, data.lights_deg, shape.frequencies)
    view_vectors = torch.tensor(vectors(data.views_deg).astype(np.float32))
    weights = torch.tensor(measured.astype(np.float32))
    flat = np.asarray(data.values).reshape(-1)
    texels, views, lights = min(texels, data.texels), min(views, view_count), min(lights, light_count)
    encoders = [p for table in model.tables if table.encoder is not None for p in table.encoder.parameters()]
    optimiser = torch.optim.Adam([*decoder.parameters(), *encoders], rate, betas=(0.9, 0.99))

    def batch(t, v, l):
        columns = ((v[:, None] * light_count + l)[..., None] * 3 + np.arange(3)).reshape(-1)
        codes = np.take(flat, t[:, None] * np.int64(data.values.shape[1]) + columns)
        return torch.from_numpy(codes).reshape(len(t), len(v), len(l), 3).float() / sigma

    def forward(t, v, l, track=None):
        latents = model.latents_at(torch.from_numpy(t), view_vectors[v], track)
        directions = decoder.of_directions(every[v[:, None], l])
        return decoder.values(latents, directions)

    # The curve's sample: other texels in each of its parts, so that it covers many.
    sample_rng = np.random.default_rng(7)
    sample = [(np.sort(sample_rng.choice(data.texels, min(512, data.texels), replace=False)),
               sample_rng.choice(view_count, min(12, view_count), replace=False),
               sample_rng.choice(light_count, min(12, light_count), replace=False)) for _ in range(4)]

    @torch.no_grad()
    def sampled():
        error = count = 0.0
        for part in sample:
            w = weights[part[1][:, None], part[2]][..., None]
            error += float(((forward(*part) - batch(*part)).square() * w).sum())
            count += float(w.sum()) * len(part[0]) * 3
        return error / count

    curve = [[round(clock() - begun, 1), psnr_db(sampled() * sigma**2, 1)]]
    order, at, steps = rng.permutation(data.texels), 0, 0
    rounding, next_mark = False, seconds / marks
    begun_steps = clock() - begun
    while True:
        now = clock() - begun
        spent = steps / steps_at_most if steps_at_most else (now - begun_steps) / max(seconds - begun_steps, 1e-3)
        if spent >= 1:
            break
        if now > next_mark and not steps_at_most:
            curve.append([round(now, 1), psnr_db(sampled() * sigma**2, 1)])
            log(f"{now:5.0f} s of {seconds:.0f}: {curve[-1][1]:.2f} dB, {steps} steps")
            next_mark += seconds / marks
        if spent > ENCODER_SHARE and encoders:
            log(f"{now:5.0f} s: latents are free")
            encoders = None
            for table in model.tables:
                table.settle()
        if spent > 1 - ROUNDED_SHARE and not rounding:
            rounding = True
            set_steps(model, forward, sample, sampled())
            decoder.round_weights(shape.weight_bits)
            log(f"{now:5.0f} s: rounded, {psnr_db(sampled() * sigma**2, 1):.2f} dB")
            # The clock stands still meanwhile, so that a busy machine cannot take the training after it.
            begun += clock() - begun - now
        warm = min(1.0, (steps + 1) / 100)
        factor = warm * (0.5 + 0.5 * math.cos(math.pi * spent))
        if at + texels > data.texels:
            order, at = rng.permutation(data.texels), 0
        t = np.sort(order[at : at + texels])
        at += texels
        v, l = rng.choice(view_count, views, replace=False), rng.choice(light_count, lights, replace=False)
        track = []
        # bfloat16 is four times as fast on CPUs that know it, and what is decoded with.
        decoder.unit_type = torch.bfloat16
        difference = forward(t, v, l, track) - batch(t, v, l)
        decoder.unit_type = torch.float32
        if len(held):
            difference = difference * weights[v[:, None], l][..., None]
        loss = difference.square().mean()
        optimiser.param_groups[0]["lr"] = rate * factor
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        with torch.no_grad():
            for table, index, rows in track:
                table.update(index, rows.grad, latent_rate * factor)
        steps += 1
    if not rounding:
        for table in model.tables:
            table.settle()
        set_steps(model, forward, sample, sampled())
        decoder.round_weights(shape.weight_bits)
    curve.append([round(clock() - begun, 1), psnr_db(sampled() * sigma**2, 1)])
    log(f"{clock() - begun:5.0f} s: {curve[-1][1]:.2f} dB, {steps} steps")
    return model, curve


def set_steps(model, forward, sample, error):
    """Steps by importance: each latent's rounding may add the same error, all of them NOISE_SHARE of what there is."""
    sums = [torch.zeros(table.values.shape[1]) for table in model.tables]
    pushes = 4
    for part in sample:
        for _ in range(pushes):
            track = []
            out = forward(*part, track)
            # The gradient of a random signed sum has, in the mean of squares, the sum of squared derivatives.
            out.backward(torch.randn_like(out))
            for table, index, rows in track:
                total = sums[model.tables.index(table)]
                total += rows.grad.square().sum(0) / (pushes * len(sample) * len(part[0]) * len(part[1]) * len(part[2]) * 3)
    model.decoder.zero_grad()
    count = sum(len(s) for s in sums)
    for table, gain in zip(model.tables, sums):
        step = (12 * NOISE_SHARE * error / count / gain.clamp_min(1e-12)).sqrt()
        most = table.values.abs().amax(0)
        # Eight bits at most; and a latent that says nothing becomes zero.
        table.step = torch.maximum(torch.minimum(step, most.clamp_min(1e-6) * 4), most / 127).float()


def error_of(model, data, pairs=None, texels=48):
    """psnr_db of decoded values rounded to 8 bits, over all texels of `data`: at all pairs, or at some of them."""
    views, lights, _ = data.shape
    if pairs is None:
        return errors_of(model, data, None, texels)[0]
    total = 0.0
    # View by view, as the decoder's batches are products of views and lights.
    for view in range(views):
        light = np.array([pair % lights for pair in pairs if pair // lights == view], int)
        if len(light) == 0:
            continue
        columns = values_of(view * lights + light)
        for part in torch.arange(data.texels).split(64 * texels):
            decoded = model.decode(part, data.views_deg[[view]], data.lights_deg[light]).round_().clamp_(0, 255)
            truth = np.asarray(data.values[part[0] : part[-1] + 1])[:, columns]
            total += squared(decoded, truth)
    return psnr_db(total, data.texels * len(pairs) * 3)


def errors_of(model, data, other, texels=48):
    """(psnr_db over all values of `data`, {way: psnr_db over all values of `other`, at other directions}).

    The ways: the network at these directions, and what it gives at the nine measured neighbours, interpolated in 8-bit
    values and in linear ones."""
    total, sums = 0.0, np.zeros(3)
    if other is not None:
        weights = pair_weights(data.views_deg, data.lights_deg, other.views_deg, other.lights_deg)
        used = torch.from_numpy(np.flatnonzero(weights.any(0)))
        weights = torch.from_numpy(np.ascontiguousarray(weights[:, used]))
        linear_of_code = torch.from_numpy(Domain("linear", data.transfer).table / 255)
    for part in torch.arange(data.texels).split(texels):
        rows = slice(int(part[0]), int(part[-1]) + 1)
        decoded = model.decode(part, data.views_deg, data.lights_deg).round_().clamp_(0, 255)
        if other is not None:
            near = decoded.reshape(len(part), -1, 3)[:, used]
            truth = np.asarray(other.values[rows])
            linear = torch.matmul(weights, linear_of_code[near.int()]).numpy()
            direct = model.decode(part, other.views_deg, other.lights_deg).round_().clamp_(0, 255)
            ways = (direct, torch.matmul(weights, near).round_(),
                    torch.from_numpy(np.rint(255 * np.clip(encoded_of(linear, data.transfer), 0, 1))))
            sums += [squared(way, truth) for way in ways]
        total += squared(decoded, np.asarray(data.values[rows]))
    names = ("network", "neighbours in 8-bit values", "neighbours in linear values")
    of_other = {} if other is None else {
        name: psnr_db(one, other.values.size) for name, one in zip(names, sums)}
    return psnr_db(total, data.values.size), of_other


def squared(decoded, codes):
    """Sum of squared differences; `decoded` is a tensor, `codes` an array."""
    difference = decoded.reshape(len(codes), -1) - torch.from_numpy(np.array(codes))
    return float(difference.square().sum(1).double().sum())


def nanoseconds(model, queries=16384, repeats=12, seed=1):
    """ns an evaluation: CPU time of batches of random texels, views and lights on one thread, the median of `repeats`."""
    generator = torch.Generator().manual_seed(seed)
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    taken = []
    for _ in range(repeats):
        texels = torch.randint(0, model.shape.height * model.shape.width, (queries,), generator=generator)
        view, light = (upper(torch.randn(queries, 3, generator=generator)) for _ in range(2))
        begun = time.thread_time()
        model.query(texels, view, light)
        taken.append((time.thread_time() - begun) / queries * 1e9)
    torch.set_num_threads(threads)
    return float(np.median(taken))


def upper(directions):
    directions = directions / directions.norm(dim=-1, keepdim=True)
    return torch.cat([directions[:, :2], directions[:, 2:].abs()], -1)


def points(data, kinds, latents, seconds, held=(), other=None, log=print, keep=None, rate=RATE):
    """Points of these kinds and numbers of latents (None: each kind's own), one by one."""
    begun = clock()
    found = components(data, not_held(data, held), 1)
    found_seconds = clock() - begun
    for kind in kinds:
        for count in latents or [None]:
            yield measure(data, kind, seconds, count, held, other, found, found_seconds, log=log, keep=keep,
                          rate=rate)


def not_held(data, held):
    return np.setdiff1d(np.arange(data.shape[0] * data.shape[1]), np.asarray(held, int))


def measure(data, kind, seconds, latents=None, held=(), other=None, found=None, found_seconds=0.0, seed=1, log=print,
            keep=None, rate=RATE, steps_at_most=None, **changes):
    """A point of the report, trained for `seconds` of CPU time.

    With `held` pairs the training is cut in two: two thirds of the time without them, after which they are measured, then
    the rest with all pairs, after which everything else is. `other` is a capture at other directions, never trained on.
    `found` are components of the pairs that are not held back and took `found_seconds`. `keep` is a folder for the bytes."""
    shape = Shape(data.height, data.width, **{**KINDS[kind], **({"latents": latents} if latents else {}), **changes})
    found = found or components(data, not_held(data, held), seed)
    point = {"codec": kind}
    first = seconds * (1 - SECOND_SHARE) if len(held) else seconds
    settings = {"log": log, "steps_at_most": steps_at_most, **BATCHES[kind]}
    model, curve = train(data, shape, first, held, seed, found=found, rate=rate, latent_rate=4 * rate, **settings)
    if len(held):
        written = serialise(model)
        point["held"] = {"pairs": len(held), "bytes": len(written), "training_seconds": first,
                         "psnr_db_held": error_of(deserialise(written), data, held), "psnr_db_kept_sample": curve[-1][1]}
        log(f"{kind}: held back {point['held']['psnr_db_held']:.2f} dB")
        # Gentler than the first start, so that little of what was learnt is lost.
        model, more = train(data, shape, seconds - first, (), seed + 1, model, rate=0.4 * rate, latent_rate=2 * rate, **settings)
        curve = curve + [[round(first + at, 1), db] for at, db in more]
    written = serialise(model)
    if keep:
        keep.mkdir(parents=True, exist_ok=True)
        (keep / f"{data.name}-{kind}-{shape.latents}-{seconds:.0f}.nbtf").write_bytes(written)
    model = deserialise(written)
    measured, random = errors_of(model, data, other)
    point |= {
        "latents": shape.latents, "offset_latents": shape.offset, "hidden": shape.hidden, "layers": shape.layers,
        "bytes": len(written), "bytes_eight_bit": eight_bit_bytes(model), "memory_bytes": memory_bytes(model),
        "psnr_db": measured, "encode_seconds": round(found_seconds + seconds, 1), "training_seconds": seconds,
        "rate": rate,
        "clock": "CPU time of one thread", "curve": curve, "ns_an_evaluation": round(nanoseconds(model), 1),
        "multiply_adds": model.decoder.multiply_adds(), "decoded": "all texels",
    }
    if random:
        point |= {"psnr_db_random": max(random.values()), "psnr_db_random_by": random}
    return point

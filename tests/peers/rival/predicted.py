"""Coefficients of clusters' own bases: predicted from decoded neighbours, coded with contexts from all sides.

Neighbours of a texel mostly belong to other clusters, whose coefficients mean something else; so what predicts is the
neighbour's decoded *value*, in the basis of the texel's own cluster.
"""

import numpy as np

from .codes import Model, step_of
from .rounding import LAGRANGIAN, rounded


def shifted(planes, dy, dx):
    """planes[..., y - dy, x - dx, :] with zeros outside."""
    out = np.zeros_like(planes)
    height, width = planes.shape[0], planes.shape[1]
    out[max(dy, 0) : height + min(dy, 0), max(dx, 0) : width + min(dx, 0)] = planes[
        max(-dy, 0) : height + min(-dy, 0), max(-dx, 0) : width + min(-dx, 0)]
    return out


NEIGHBOURS = ((0, 1), (1, 0), (1, 1), (1, -1))


class Predictor:
    """A texel's coefficients from the decoded ones of its neighbours W, N, NW, NE, whatever their clusters.

    The neighbours' decoded values are expressed in the texel's own basis. Linear weights per cluster are learnt on the
    way by recursive least squares, so they cost no bytes.
    """

    def __init__(self, means, bases, wide=32, narrow=16):
        clusters, components, _ = bases.shape
        self.wide, self.narrow = min(wide, components), min(narrow, components)
        self.counts = (self.wide, self.wide, self.narrow, self.narrow)
        self.inputs = sum(self.counts)
        self.components = components
        leading = bases[:, : self.wide]
        # transfer[from, to]: coefficients of cluster `from` in the leading components of cluster `to`.
        self.transfer = np.einsum("acq,bpq->abcp", bases, leading, optimize=True).astype(np.float32)
        self.offset = (np.einsum("aq,bpq->abp", means, leading, optimize=True)
                       - np.einsum("bq,bpq->bp", means, leading)[None]).astype(np.float32)
        self.products = np.zeros((clusters, self.inputs, self.inputs))
        self.targets = np.zeros((clusters, self.inputs, components))
        prior = np.zeros((self.inputs, components))
        start = 0
        for count, weight in zip(self.counts, (0.4, 0.4, 0.0, 0.1)):
            prior[start + np.arange(count), np.arange(count)] = weight
            start += count
        self.prior = prior
        self.weights = np.tile(prior.astype(np.float32), (clusters, 1, 1))
        self.dirty = np.zeros(clusters, bool)

    def inputs_of(self, decoded, labels, y, x):
        """[n, inputs] of texels (y, x)."""
        height, width, _ = decoded.shape
        own = labels[y, x]
        parts = []
        for (dy, dx), count in zip(NEIGHBOURS, self.counts):
            ny, nx = y - dy, x - dx
            inside = (ny >= 0) & (nx >= 0) & (nx < width)
            ny, nx = np.where(inside, ny, 0), np.where(inside, nx, 0)
            other = labels[ny, nx]
            part = np.einsum("nc,ncp->np", decoded[ny, nx], self.transfer[other, own, :, :count])
            part += self.offset[other, own, :count]
            parts.append(part * inside[:, None])
        return np.concatenate(parts, 1)

    def predict(self, inputs, own):
        return np.einsum("ni,nic->nc", inputs, self.weights[own])

    def learn(self, inputs, own, values):
        for cluster in np.unique(own):
            mine = own == cluster
            part = inputs[mine].astype(np.float64)
            self.products[cluster] += part.T @ part
            self.targets[cluster] += part.T @ values[mine]
            self.dirty[cluster] = True

    def solve(self, noise):
        at = np.flatnonzero(self.dirty)
        if len(at) == 0:
            return
        ridge = np.eye(self.inputs) * noise
        self.weights[at] = np.linalg.solve(self.products[at] + ridge, self.targets[at] + noise * self.prior)
        self.dirty[:] = False


def decoded_of(numbers, labels, means, bases, kept, step, every=6):
    """What a decoder makes of numbers [y, x, component]: coefficients alike."""
    return predicted(None, labels, means, bases, kept, step, every=every, told=numbers)[1]


def predicted(targets, labels, means, bases, kept, step, lagrangian=LAGRANGIAN, every=6, told=None):
    """(numbers [y, x, component], decoded coefficients alike): closed loop, texels of equal x + 2 y at once.

    With the numbers `told` instead of targets it is the decoder.
    """
    height, width, components = (targets if told is None else told).shape
    predictor = Predictor(means, bases)
    numbers = np.zeros((height, width, components), np.int32)
    decoded = np.zeros((height, width, components), np.float32)
    sizes = np.zeros((height + 1, width + 2, components), np.float32)
    clusters = len(means)
    seen = np.full((clusters, 1), 4.0, np.float32)
    if told is None:
        # Mean magnitude per cluster and component so far; the encoder's business alone.
        flat = np.abs(targets).reshape(-1, components) / step
        mean = np.stack([flat[labels.reshape(-1) == k].mean(0) if (labels == k).any() else flat[0] * 0
                         for k in range(clusters)])
        running = (np.maximum(mean - 0.3, 0.01) * seen).astype(np.float32)
    use = kept.astype(np.float32)
    for wave in range(width + 2 * (height - 1)):
        y = np.arange(max(0, (wave - width + 2) // 2), min(height - 1, wave // 2) + 1)
        x = wave - 2 * y
        own = labels[y, x]
        inputs = predictor.inputs_of(decoded, labels, y, x)
        guess = predictor.predict(inputs, own) * use[own]
        if told is None:
            near = (sizes[y + 1, x] + sizes[y, x + 1]) * 0.3 + (sizes[y, x] + sizes[y, x + 2]) * 0.2
            expected = 0.6 * running[own] / seen[own] + 0.4 * near
            part = rounded((targets[y, x] - guess) / step, expected, lagrangian) * use[own]
            np.add.at(running, own, np.abs(part))
            np.add.at(seen, own, 1)
        else:
            part = told[y, x].astype(np.float32)
        numbers[y, x] = part
        sizes[y + 1, x + 1] = np.abs(part)
        decoded[y, x] = guess + step * part
        predictor.learn(inputs, own, decoded[y, x])
        if wave % every == 0:
            predictor.solve(30 * step**2)
    return numbers, decoded


class LocalPlan:
    """Numbers [y, x, component]: a batch is a row, the components of a texel in their order (see `codes.bits_of`)."""

    def __init__(self, labels, kept):
        clusters, components = kept.shape
        self.labels, self.kept = labels, kept
        self.batches = range(len(labels))
        self.model = Model((14 * 14, 16 * 16, clusters * components, 40 * 4, 12 * 12 * 12, 24 * 24), 12)
        self.running = np.full((clusters, components), 0.5, np.float32)
        self.seen = np.ones((clusters, 1), np.float32)

    def contexts(self, y, numbers):
        height, width, components = numbers.shape
        own = self.labels[y]
        rows = np.zeros((3, width + 4, components), np.float32)
        for back in range(min(y, 2) + 1):
            rows[back, 2:-2] = np.abs(numbers[y - back])
        size, west, north = rows[0, 2:-2], rows[0, 1:-3], rows[1, 2:-2]
        around = 2 * (west + north) + rows[1, 1:-3] + rows[1, 3:-1] + rows[0, :-4] + rows[2, 2:-2]
        mean = self.running[own] / self.seen[own]
        # How lively this texel is beside its cluster's average: by lower components and neighbours.
        lower, lower_mean = np.cumsum(size, 1) - size, np.cumsum(mean, 1) - mean
        last, last_mean = lower.copy(), lower_mean.copy()
        last[:, 6:] -= lower[:, :-6]
        last_mean[:, 6:] -= lower_mean[:, :-6]
        lively = ((last + 0.5 * lower + around.sum(1, keepdims=True) / 16 + 0.5)
                  / (last_mean + 0.5 * lower_mean + 0.5 * mean.sum(1, keepdims=True) + 0.5))
        expected = 0.5 * mean * lively + 0.5 * (around / 16 + mean * 0.5)
        column = np.arange(components)
        contexts = np.stack([
            step_of(around, 2, 13) * 14 + step_of(mean * 16, 2, 13),
            step_of(lively * 4, 3, 15) * 16 + step_of(mean * 16, 2, 15),
            own[:, None] * components + column,
            step_of(expected * 40, 2.6, 39) * 4 + np.minimum(column // 4, 3),
            (step_of(west, 2, 11) * 12 + step_of(north, 2, 11)) * 12 + step_of(mean * 8, 2, 11),
            step_of(last * 2, 2, 23) * 24 + step_of(expected * 16, 2, 23),
        ])
        use = self.kept[own]
        at = (y * width + np.arange(width)[:, None]) * components + column
        return at[use], contexts[:, use], step_of(expected * 8, 1.2, 11)[use]

    def learn(self, y, numbers):
        np.add.at(self.running, self.labels[y], np.abs(numbers[y]))
        np.add.at(self.seen, self.labels[y], 1)
        old = self.seen[:, 0] > 1500
        self.running[old] /= 2
        self.seen[old] /= 2


def label_bits(labels, clusters):
    """Bits of every row of a map of cluster ids: like W, N, NE or NW, or another, by how often it followed W and N."""
    if clusters == 1:
        return np.zeros(len(labels))
    height, width = labels.shape
    model = Model((16, clusters * 16, clusters * clusters), 1)
    after = np.zeros((clusters, clusters))
    plain = np.ones(clusters)
    at = lambda dy, dx: shifted(labels[:, :, None] + 1, dy, dx)[:, :, 0] - 1
    west, north, east, corner = at(0, 1), at(1, 0), at(1, -1), at(1, 1)
    west = np.where(west < 0, 0, west)
    north, east, corner = (np.where(n < 0, west, n) for n in (north, east, corner))
    alike = (west == north) + 2 * (north == east) + 4 * (west == corner) + 8 * (corner == north)
    by_row = np.zeros(height)
    for y in range(height):
        own, told = labels[y], []
        left = np.arange(width)
        refused = np.zeros((width, clusters), bool)
        for decision, guess in enumerate((west[y], north[y], east[y], corner[y])):
            ask = left[~refused[left, guess[left]]]
            hit = own[ask] == guess[ask]
            contexts = np.stack([
                alike[y, ask], guess[ask] * 16 + alike[y, ask], west[y, ask] * clusters + north[y, ask]])
            probability, inputs = model.predict(decision, contexts, np.zeros(len(ask), int))
            by_row[y] -= np.log2(np.where(hit, probability, 1 - probability)).sum()
            told.append((decision, contexts, np.zeros(len(ask), int), hit.astype(float), probability, inputs))
            refused[ask, guess[ask]] = True
            left = np.setdiff1d(left, ask[hit])
        if len(left):
            weight = after[west[y, left]] + after[north[y, left]] + 2 * plain / plain.sum()
            weight[refused[left]] = 0
            by_row[y] -= np.log2(weight[np.arange(len(left)), own[left]] / weight.sum(1)).sum()
            np.add.at(after, (west[y, left], own[left]), 1)
            np.add.at(after, (north[y, left], own[left]), 1)
            np.add.at(plain, own[left], 1)
        for one in told:
            if len(one[3]):
                model.learn(*one)
    return by_row

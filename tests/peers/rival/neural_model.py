"""The networks of the neural rivals: a table of latents, a decoder, and for the NeuMIP-like one [Kuznetsov et al. 2021] a
parallax module. NeuMIP's pyramid has its finest level only: coarser ones would cost a third more bytes and help no pixel
that is measured here.

A value is decoded in three steps. Directions: a small network maps features of (view, light) to a scale and a shift for
each hidden unit and to `latents x 3` factors. Texel: its latents, for the NeuMIP-like kind read bilinearly where the
view ray meets the depth that a network of (offset latents, view) predicts. Both meet in the hidden layers
`relu(scale * W latents + shift)`, further dense layers, and a sum with `latents . factors`, which alone would be a
matrix factorisation with a smooth basis. In a batch of texels x pairs the first two steps are done once per texel and
once per pair.
"""

from dataclasses import asdict, dataclass

import numpy as np
import torch
from torch import nn
from torch.nn import functional


@dataclass
class Shape:
    """What is needed to build a model of the same shape again."""

    height: int
    width: int
    latents: int = 8
    hidden: int = 32
    layers: int = 2  # hidden layers of the decoder
    direction: int = 64  # units of the two direction layers; 0: one linear layer
    offset: int = 0  # offset latents of the NeuMIP-like kind; 0: no parallax module
    offset_hidden: int = 25
    factors: bool = True  # the term `latents . factors`
    frequencies: int = 2
    weight_bits: int = 8

    def told(self):
        return asdict(self)


def vectors(directions_deg):
    """[n, 3] unit vectors of (theta, phi) in degrees."""
    theta, phi = np.radians(np.asarray(directions_deg, np.float64)).T
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], 1)


def features_of(view, light, frequencies):
    """[..., feature] of unit vectors [..., 3]: view, light and half vector, the cosine between view and half vector, and
    sines and cosines of the projected vectors."""
    half = view + light
    half = half / half.norm(dim=-1, keepdim=True).clamp_min(1e-6)
    dot = (view * half).sum(-1, keepdim=True)
    flat = torch.cat([view[..., :2], light[..., :2], half[..., :2]], -1)
    waves = [wave(k * np.pi * flat) for k in range(1, frequencies + 1) for wave in (torch.sin, torch.cos)]
    return torch.cat([view, light, half, dot, *waves], -1)


def features(views_deg, lights_deg, frequencies):
    """[view, light, feature] of all pairs of directions in degrees."""
    view = torch.tensor(vectors(views_deg).astype(np.float32))[:, None]
    light = torch.tensor(vectors(lights_deg).astype(np.float32))[None]
    view, light = torch.broadcast_tensors(view, light)
    return features_of(view, light, frequencies)


def rounded(weight, bits):
    """Straight-through rounding of a matrix [row, column] to `bits` with a half-precision scale per row."""
    top = 2 ** (bits - 1) - 1
    scale = row_scale(weight.detach(), top)
    return weight + (torch.clamp(torch.round(weight.detach() / scale), -top, top) * scale - weight.detach())


def row_scale(weight, top):
    # Rounded to half precision as it is stored; the margin keeps the largest weight within `top`.
    return (weight.abs().amax(1, keepdim=True) / top * 1.001).clamp_min(1e-6).half().float()


class Dense(nn.Linear):
    """A linear layer whose weights are rounded while `bits` is set."""

    bits = None

    def forward(self, x):
        weight = self.weight if self.bits is None else rounded(self.weight, self.bits)
        bias = None if self.bias is None else self.bias.to(x.dtype)
        return functional.linear(x, weight.to(x.dtype), bias)


class Decoder(nn.Module):
    """Everything but the latents."""

    def __init__(self, shape, feature_count, mean):
        super().__init__()
        self.shape = shape
        # Hidden units are trained and decoded in bfloat16.
        self.unit_type = torch.float32
        # One factor more than latents: the mean of all texels.
        wide = 2 * shape.hidden + (3 * (shape.latents + 1) if shape.factors else 0)
        sizes = [feature_count, shape.direction, shape.direction] if shape.direction else [feature_count]
        self.direction = nn.ModuleList(Dense(a, b) for a, b in zip(sizes, sizes[1:] + [wide]))
        self.first = Dense(shape.latents, shape.hidden, bias=False)
        self.dense = nn.ModuleList(Dense(shape.hidden, shape.hidden) for _ in range(shape.layers - 1))
        self.last = Dense(shape.hidden, 3)
        with torch.no_grad():
            # Starts as a plain network: scales near 1; the hidden part near 0, so that the factors lead.
            self.last.weight *= 0.1
            self.last.bias.copy_(mean)
        if shape.offset:
            sizes = [shape.offset + 3, shape.offset_hidden, shape.offset_hidden, 1]
            self.offset = nn.ModuleList(Dense(a, b) for a, b in zip(sizes, sizes[1:]))
            with torch.no_grad():
                self.offset[-1].weight *= 0.01
                self.offset[-1].bias.zero_()

    def round_weights(self, bits):
        for module in self.modules():
            if isinstance(module, Dense):
                module.bits = bits

    def of_directions(self, x):
        """Features [pair, feature] -> (scale, shift, factors) of each pair."""
        for layer in self.direction[:-1]:
            x = functional.relu(layer(x))
        x = self.direction[-1](x)
        hidden = self.shape.hidden
        return 1 + x[..., :hidden], x[..., hidden : 2 * hidden], x[..., 2 * hidden :]

    def depth(self, offset_latents, view):
        """Depth along the view ray, in texels."""
        x = torch.cat([offset_latents, view], -1)
        for layer in self.offset[:-1]:
            x = functional.relu(layer(x))
        return self.offset[-1](x)[..., 0]

    def hidden(self, first, scale, shift):
        """The decoder's hidden layers and its last one, of tensors that broadcast to [..., hidden]."""
        x = functional.relu(torch.addcmul(*(part.to(self.unit_type) for part in (shift, first, scale))))
        for layer in self.dense:
            x = functional.relu(layer(x))
        return self.last(x).float()

    def values(self, latents, directions):
        """Latents [texel, view, latent] (one view where they do not depend on it), directions of [view, light] ->
        [texel, view, light, 3]."""
        scale, shift, factors = directions
        views, lights = scale.shape[:2]
        x = self.hidden(self.first(latents)[:, :, None], scale[None], shift[None])
        if self.shape.factors:
            factors = factors.reshape(views, lights * 3, -1)
            mean, factors = factors[:, :, 0], factors[:, :, 1:]
            if latents.shape[1] == 1:
                sums = torch.addmm(mean.reshape(1, -1), latents[:, 0], factors.reshape(-1, self.shape.latents).t())
            else:
                sums = torch.baddbmm(mean[:, None], latents.transpose(0, 1), factors.transpose(1, 2)).transpose(0, 1)
            x = x + sums.reshape(x.shape)
        return x

    def queries(self, latents, directions):
        """The same for single queries: latents [query, latent], directions of [query] -> [query, 3]."""
        scale, shift, factors = directions
        x = self.hidden(self.first(latents), scale, shift)
        if self.shape.factors:
            factors = factors.reshape(len(latents), 3, -1)
            x = x + factors[:, :, 0] + torch.bmm(factors[:, :, 1:], latents[:, :, None])[:, :, 0]
        return x

    def multiply_adds(self):
        """Of one evaluation: (what depends on directions only, what is left)."""
        of = lambda layers: sum(layer.weight.numel() for layer in layers)
        texel = of([self.first, *self.dense, self.last]) + self.shape.hidden
        texel += 3 * self.shape.latents * self.shape.factors
        if self.shape.offset:
            texel += of(self.offset) + 4 * self.shape.latents
        return of(self.direction), texel


def corners(shape, texels, view, depth):
    """Where the view rays end: indices [texel, view, 4] and bilinear weights, clamped at the border.

    `texels` [texel], `view` [view, 3] unit vectors or, of a view for each texel, [texel, 1, 3], `depth` [texel, view] in
    texels."""
    row, column = (texels // shape.width).float()[:, None], (texels % shape.width).float()[:, None]
    # Images have their rows downwards and y upwards. Grazing views are held at 0.3, as rays would leave the material.
    slope = view[..., :2] / view[..., 2:].clamp_min(0.3)
    x = (column + depth * slope[..., 0]).clamp(0, shape.width - 1)
    y = (row - depth * slope[..., 1]).clamp(0, shape.height - 1)
    left = x.detach().floor().clamp(max=shape.width - 2)
    top = y.detach().floor().clamp(max=shape.height - 2)
    fx, fy = x - left, y - top
    index = (top * shape.width + left).long()
    indices = torch.stack([index, index + 1, index + shape.width, index + shape.width + 1], -1)
    weights = torch.stack([(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy], -1)
    return indices, weights


class Encoder(nn.Module):
    """Scores of principal components (unit spread) to latents; gone after the training."""

    def __init__(self, scores, latents, linear, hidden=128):
        super().__init__()
        self.linear = nn.Linear(scores, latents)
        self.dense = nn.Sequential(nn.Linear(scores, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU(),
                                   nn.Linear(hidden, latents))
        with torch.no_grad():
            self.linear.bias.zero_()
            if linear:
                self.linear.weight.copy_(torch.eye(latents, scores))
            else:
                self.linear.weight *= 0.3
            self.dense[-1].weight *= 0.1
            self.dense[-1].bias.zero_()

    def forward(self, scores):
        return self.linear(scores) + self.dense(scores)


class Table:
    """Latents with an Adam of their own: only the rows of a batch are touched.

    At first an encoder gives them, a small network of each texel's principal components: what one texel learns, all
    learn. `settle` turns what it gives into free values."""

    def __init__(self, texels, latents):
        self.values = torch.zeros(texels, latents)
        self.encoder, self.scores = None, None
        self.step = None  # [latent], when rounded

    def encode_with(self, scores, linear):
        """Starts as the first components (`linear`), or as noise."""
        latents = self.values.shape[1]
        self.scores, self.encoder = scores, Encoder(scores.shape[1], latents, linear)

    @torch.no_grad()
    def settle(self):
        if self.encoder is not None:
            self.values = torch.cat([self.encoder(part) for part in self.scores.split(8192)])
            self.encoder = self.scores = None
        self.first, self.second = torch.zeros_like(self.values), torch.zeros_like(self.values)
        self.count = torch.zeros(len(self.values), 1)

    def rounded(self, values):
        if self.values.dtype == torch.int8:
            return values * self.step
        return torch.clamp(torch.round(values / self.step), -127, 127) * self.step

    def codes(self):
        if self.values.dtype == torch.int8:
            return self.values.numpy()
        return torch.clamp(torch.round(self.values / self.step), -127, 127).to(torch.int8).numpy()

    def rows(self, index, track=None):
        if self.encoder is not None:
            return self.encoder(self.scores[index])
        values = self.values[index]
        if self.step is not None:
            values = self.rounded(values)
        if track is not None:
            values.requires_grad_()
            track.append((self, index, values))
        return values

    def update(self, index, gradient, rate, beta1=0.9, beta2=0.98):
        count = self.count[index] + 1
        first = beta1 * self.first[index] + (1 - beta1) * gradient
        second = beta2 * self.second[index] + (1 - beta2) * gradient * gradient
        self.first[index], self.second[index], self.count[index] = first, second, count
        move = first / (1 - beta1**count) / ((second / (1 - beta2**count)).sqrt() + 1e-9)
        self.values[index] -= rate * move


class Model:
    """Decoder, latents `[texel, latent]` and offset latents, the unit of values and, when rounded, steps per latent."""

    def __init__(self, shape, transfer, sigma, mean, texels):
        self.shape, self.transfer, self.sigma, self.at = shape, transfer, sigma, None
        count = features([(0, 0)], [(0, 0)], shape.frequencies).shape[-1]
        self.decoder = Decoder(shape, count, mean)
        self.tables = [Table(texels, shape.latents)] + ([Table(texels, shape.offset)] if shape.offset else [])

    def latents_at(self, texels, view, track=None):
        """[texel, view or 1, latent]; `track` collects what the tables must be told the gradients of.

        `view` is [view, 3] or, of a view for each texel, [texel, 1, 3]."""
        if len(self.tables) == 1:
            return self.tables[0].rows(texels, track)[:, None]
        shared = view if view.dim() == 3 else view[None]
        offset = self.tables[1].rows(texels, track)[:, None].expand(-1, shared.shape[1], -1)
        depth = self.decoder.depth(offset, shared.expand(len(texels), -1, -1))
        index, weight = corners(self.shape, texels, view, depth)
        if track is None and self.tables[0].encoder is None:
            rows = self.tables[0].rows(index.reshape(-1)).reshape(*index.shape, -1)
        else:
            unique, inverse = torch.unique(index, return_inverse=True)
            rows = functional.embedding(inverse, self.tables[0].rows(unique, track))
        return (rows * weight[..., None]).sum(2)

    @torch.no_grad()
    def decode(self, texels, views_deg, lights_deg):
        """float32 8-bit values before rounding [texel, view, light, 3]."""
        at = (np.asarray(views_deg).tobytes(), np.asarray(lights_deg).tobytes())
        if self.at != at:
            every = features(views_deg, lights_deg, self.shape.frequencies)
            self.at, self.every = at, self.decoder.of_directions(every)
        view = torch.tensor(vectors(views_deg).astype(np.float32))
        latents = self.latents_at(torch.as_tensor(texels), view)
        return self.decoder.values(latents, self.every) * self.sigma

    @torch.no_grad()
    def query(self, texels, view, light):
        """The same for single queries: texels [query], unit vectors [query, 3] -> [query, 3]."""
        directions = self.decoder.of_directions(features_of(view, light, self.shape.frequencies))
        return self.decoder.queries(self.latents_at(texels, view[:, None])[:, 0], directions) * self.sigma

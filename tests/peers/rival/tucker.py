"""Bases factored over view x light [Tucker 1966]: global factor matrices, one small core per component.

Cores are 8 bits with a half-precision scale per (component, light-mode row); factor matrices are half precision.
"""

from dataclasses import dataclass

import numpy as np

CHANNELS = 3


@dataclass
class Factors:
    view: np.ndarray  # [view, view rank], orthonormal columns
    light: np.ndarray  # [light, light rank]

    @property
    def ranks(self):
        return self.view.shape[1], self.light.shape[1]

    @property
    def core_size(self):
        return self.view.shape[1] * self.light.shape[1] * CHANNELS

    @property
    def bytes(self):
        """Half precision, both matrices."""
        return 2 * (self.view.size + self.light.size)

    def core_bytes(self):
        """Bytes of one component: 8-bit values and a half-precision scale per light-mode row."""
        return self.core_size + 2 * self.light.shape[1]

    def half(self):
        """As they are stored."""
        return Factors(*(m.astype(np.float16).astype(np.float32) for m in (self.view, self.light)))

    def cores(self, bases):
        """[n, light rank, view rank * 3] of [n, value]."""
        views, view_rank = self.view.shape
        lights, light_rank = self.light.shape
        # [n, v, l, c] -> [n, a, l, c] -> [n, b, a, c]
        tensor = self.view.T @ bases.reshape(len(bases), views, lights * CHANNELS)
        tensor = tensor.reshape(-1, view_rank, lights, CHANNELS).transpose(0, 2, 1, 3)
        tensor = self.light.T @ tensor.reshape(-1, lights, view_rank * CHANNELS)
        return tensor.reshape(-1, light_rank, view_rank * CHANNELS)

    def expand(self, cores):
        """[n, value] of [n, light rank, view rank * 3]."""
        views, view_rank = self.view.shape
        lights, light_rank = self.light.shape
        tensor = self.light @ cores.reshape(len(cores), light_rank, view_rank * CHANNELS)
        tensor = tensor.reshape(-1, lights, view_rank, CHANNELS).transpose(0, 2, 1, 3)
        tensor = self.view @ tensor.reshape(-1, view_rank, lights * CHANNELS)
        return np.ascontiguousarray(tensor.reshape(len(cores), -1), np.float32)


def leading(covariance, rank):
    return np.linalg.eigh(covariance)[1][:, ::-1][:, :rank]


def factors_of(weighted, shape, view_rank, light_rank, rounds=3):
    """Factors that keep most energy of `weighted` [n, value] (basis vectors times their singular values): HOOI."""
    views, lights, _ = shape
    view_rank, light_rank = min(view_rank, views), min(light_rank, lights)
    tensor = weighted.reshape(len(weighted), views, lights, CHANNELS).astype(np.float32)

    def covariance_of_views(t):
        return sum((flat @ flat.T for flat in t.reshape(len(t), t.shape[1], -1))).astype(np.float64)

    def covariance_of_lights(t):
        return covariance_of_views(t.transpose(0, 2, 1, 3))

    light = leading(covariance_of_lights(tensor), light_rank)
    view = leading(covariance_of_views(tensor), view_rank)
    for _ in range(rounds if view_rank < views and light_rank < lights else 0):
        narrowed = light.T.astype(np.float32) @ tensor.transpose(0, 2, 1, 3).reshape(-1, lights, views * CHANNELS)
        view = leading(covariance_of_lights(narrowed.reshape(-1, light_rank, views, CHANNELS)), view_rank)
        narrowed = view.T.astype(np.float32) @ tensor.reshape(-1, views, lights * CHANNELS)
        light = leading(covariance_of_lights(narrowed.reshape(-1, view_rank, lights, CHANNELS)), light_rank)
    return Factors(view.astype(np.float32), light.astype(np.float32))


def quantise_cores(cores, bits=8):
    """What a decoder reads back from cores at `bits` with a half-precision scale per (component, light-mode row)."""
    if cores.size == 0:
        return cores.astype(np.float32)
    top = 2 ** (bits - 1) - 1
    scale = np.abs(cores).max(-1, keepdims=True) / top
    # Rounded up, so that the largest value is not clipped; subnormal halves are too coarse.
    scale = np.maximum(np.nextafter((scale * 1.0005).astype(np.float16), np.float16(np.inf)), np.float16(6.2e-5))
    scale = scale.astype(np.float32)
    return np.clip(np.rint(cores / scale), -top, top).astype(np.float32) * scale


def quantise_half(values):
    return values.astype(np.float16).astype(np.float32)

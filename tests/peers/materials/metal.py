"""Brushed brass with dust on it: values far above 1 in its highlights, and a hundredth beside them.

Modelled: anisotropic GGX (Walter et al. 2007, Heitz 2014) with two roughnesses, a direction of the brush and a normal
of their own at every place, Schlick's Fresnel term, a little diffuse dust.
Not modelled: relief, light that goes from facet to facet.
"""

import numpy as np

from tracing import grid_places, periodic_noise, read_periodic

F0 = np.array([0.93, 0.78, 0.45], np.float32)
# Roughness along and across the brush, where the noise is 0.
ALPHA = (0.08, 0.22)
DUST = 0.02
SIDE_TEXELS = 256


class Metal:
    """The sheet: textures `[row, column, channel]` of tangents, normals and roughnesses."""

    largest_albedo = np.ones(3, np.float32)

    # Nothing bounces.
    bounce = False

    def __init__(self, size, seed, bounce=False):
        generator = np.random.default_rng([seed, 4])
        self.size = size
        side = (SIDE_TEXELS, SIDE_TEXELS)

        def noise(longest, shortest):
            return periodic_noise(side, longest, shortest, generator)

        angle = 0.15 * noise(128, 16)
        # Scratches: noise that is drawn out along the rows.
        scratches = np.fft.ifft(np.fft.fft(noise(64, 4), axis=1) * np.exp(-np.abs(np.fft.fftfreq(256) * 60)), axis=1).real
        normals = np.stack([0.04 * noise(96, 12), 0.08 * scratches / scratches.std(), np.ones(side)], axis=-1)
        tangents = np.stack([np.cos(angle), np.sin(angle), np.zeros(side)], axis=-1)
        alphas = np.stack([ALPHA[0] * np.exp(0.3 * noise(96, 12)), ALPHA[1] * np.exp(0.2 * noise(96, 12))], axis=-1)
        self.textures = [texture.astype(np.float32) for texture in (normals, tangents, alphas)]

    def see(self, view, offsets):
        """Returns frames and roughnesses at the samples `offsets` of all texels; `view` moves nothing."""
        places = [grid_places(self.size, offset) for offset in offsets]
        x, y = (np.concatenate([place[axis].ravel() for place in places]) for axis in range(2))
        normals, tangents, alphas = (read_periodic(texture, x, y) for texture in self.textures)
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        tangents = tangents - normals * np.sum(tangents * normals, axis=1, keepdims=True)
        tangents = tangents / np.linalg.norm(tangents, axis=1, keepdims=True)
        return {"frames": (tangents, np.cross(normals, tangents), normals), "alphas": alphas}

    def illuminate(self, light):
        """Returns the light's direction: nothing shadows."""
        return light

    def shade(self, seen, light, view):
        """Returns X of all samples `[n, channel]`."""
        half = (light + view) / np.linalg.norm(light + view)
        along, across = seen["alphas"].T
        stretched = np.stack([along, across, np.ones_like(along)])

        def local(direction):
            return np.stack([axis @ direction.astype(np.float32) for axis in seen["frames"]])

        to_light, to_eye, to_half = local(light), local(view), local(half)
        slopes = to_half / stretched
        spread = 1.0 / (along * across * np.sum(slopes * slopes, axis=0) ** 2)
        reach = [np.linalg.norm(stretched * direction, axis=0) for direction in (to_light, to_eye)]
        masking = to_light[2] * reach[1] + to_eye[2] * reach[0]
        gloss = np.where((to_light[2] > 0) & (to_eye[2] > 0), 0.5 * spread * to_light[2] / np.maximum(masking, 1e-6), 0)
        fresnel = F0 + (1 - F0) * (1 - float(view @ half)) ** 5
        return gloss[:, None] * fresnel + DUST * max(float(light[2]), 0.0)

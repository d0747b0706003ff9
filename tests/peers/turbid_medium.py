"""Reflectance of a turbid medium by Monte Carlo: infinitely small diffuse leaves, strewn at random with normals of all directions,
over diffuse soil. Nothing else is approximated, so this is the truth that closed forms such as SAIL come near to. There is no hot spot.

python turbid_medium.py [PHOTONS]: prints the reflectances that viewer/src/canopy/measure.rs compares with, in its order, and their
standard errors.
"""

import sys

import numpy as np

LEAF_AREA_INDEX = 3.0
BANDS = [(0.10, 0.08, 0.15), (0.45, 0.48, 0.30)]  # reflectance and transmittance of a leaf, reflectance of the soil
SUN_DEG = 30.0
EYES_DEG = [-60.0, -30.0, 0.0, 15.0, 45.0, 60.0]  # in the sun's plane, positive on its side
G = 0.5  # mean projection of leaves with normals of all directions
PARTS = 20


def around(axis, cosine, turn):
    """Directions at an angle of `cosine` from `axis`, turned by `turn` about it, (n, 3)."""
    helper = np.where(np.abs(axis[:, :1]) < 0.5, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    a = np.cross(helper, axis)
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b = np.cross(axis, a)
    sine = np.sqrt(np.maximum(0.0, 1.0 - cosine**2))
    return cosine[:, None] * axis + (sine * np.cos(turn))[:, None] * a + (sine * np.sin(turn))[:, None] * b


def direction(zenith_deg):
    """Unit vector in the plane of x and z, z up."""
    return np.array([np.sin(np.radians(zenith_deg)), 0.0, np.cos(np.radians(zenith_deg))])


def reflectances(random, photons, rho, tau, soil, sky):
    """Share that is reflected, and the factors towards the eyes."""
    eyes = np.stack([direction(deg) for deg in EYES_DEG])
    up = np.array([[0.0, 0.0, 1.0]])
    towards = np.tile(-direction(SUN_DEG), (photons, 1))
    if sky:
        towards = -around(np.repeat(up, photons, 0), np.sqrt(random.random(photons)), 2 * np.pi * random.random(photons))
    depth = np.zeros(photons)  # leaf area index above
    weight = np.ones(photons)
    reflected, seen = 0.0, np.zeros(len(eyes))
    while weight.size:
        turn = lambda: 2 * np.pi * random.random(weight.size)
        depth = depth + np.log(1.0 - random.random(weight.size)) * towards[:, 2] / G
        above, below = depth < 0.0, depth > LEAF_AREA_INDEX
        reflected += weight[above].sum()
        depth = np.minimum(depth, LEAF_AREA_INDEX)
        # A leaf is met in proportion to what it shows; its normal is on the side that is met.
        normal = around(-towards, np.sqrt(random.random(weight.size)), turn())
        normal[below] = up
        cosine = normal @ eyes.T
        share = np.where(below[:, None], soil, np.where(cosine > 0, rho, tau))
        share = np.where(below[:, None] & (cosine <= 0), 0.0, share)
        through = np.exp(-G * depth[:, None] / eyes[:, 2])
        seen += (weight[:, None] * share * np.abs(cosine) / eyes[:, 2] * through)[~above].sum(0)
        reflects = random.random(weight.size) * (rho + tau) < rho
        side = np.where((below | reflects)[:, None], normal, -normal)
        towards = around(side, np.sqrt(random.random(weight.size)), turn())
        weight = weight * np.where(below, soil, rho + tau)
        # What is faint goes on by chance.
        chance = np.minimum(1.0, weight / 0.05)
        goes_on = ~above & (random.random(weight.size) < chance)
        towards, depth, weight = towards[goes_on], depth[goes_on], (weight / chance)[goes_on]
    return np.concatenate([[reflected], seen]) / photons


def main(photons=1_000_000):
    for rho, tau, soil in BANDS:
        parts = []
        for seed in range(PARTS):
            random = np.random.default_rng(seed)
            sun = reflectances(random, photons // PARTS, rho, tau, soil, sky=False)
            sky = reflectances(random, photons // PARTS, rho, tau, soil, sky=True)
            parts.append([sun[0], sky[0], *sun[1:]])
        mean, error = np.mean(parts, 0), np.std(parts, 0, ddof=1) / np.sqrt(PARTS)
        print("[" + ", ".join(f"{x:.5f}" for x in mean) + "]")
        print(" +- " + ", ".join(f"{x:.5f}" for x in error))


if __name__ == "__main__":
    main(*[int(float(text)) for text in sys.argv[1:]])

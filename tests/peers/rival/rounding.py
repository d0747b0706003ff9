"""Rounding that knows what bits cost."""

import numpy as np

# What a bit may cost, in squared steps: the slope of a uniform quantiser with few levels.
LAGRANGIAN = 0.06


def rounded(ratio, mean_size, lagrangian=LAGRANGIAN):
    """Whole numbers near `ratio`, rounded towards zero as far as bits cost more than the error that it makes.

    `mean_size` is the mean magnitude expected there: numbers are taken as two-sided geometric, so one more costs
    -log2 of their decay.
    """
    mean_size = np.maximum(mean_size, 1e-3)
    decay = (np.sqrt(1 + mean_size**2) - 1) / mean_size
    offset = np.maximum(0.5 + 0.5 * lagrangian * np.log2(decay), 0.05)
    return np.sign(ratio) * np.floor(np.abs(ratio) + offset)

"""Reflectance spectra of dyed cotton: the share of light that a fibre scatters, by wavelength.

Kubelka and Munk (1931): a fibre of absorption K and scattering S gives back R = 1 + k - sqrt(k^2 + 2 k) with k = K / S, and the k of
dyes add up. The dyes' bands of absorption are Gaussians about wavelengths that are typical of their kind; no measured spectrum is
meant. Grey and beige have one colour under daylight and another under a lamp of other power, as dyed cloth has.
"""

import numpy as np

# Absorption of dyes: wavelength and width (standard deviation) in nm, and k of full strength.
INDIGO = ((660.0, 45.0, 1.0), (610.0, 40.0, 0.5))
MADDER = ((510.0, 45.0, 1.0), (430.0, 50.0, 0.35))
WELD = ((410.0, 35.0, 1.0),)


def cotton(wavelengths_nm):
    """Returns k of undyed cotton: a little yellow."""
    return 0.012 + 0.10 * np.exp(-(wavelengths_nm - 400.0) / 70.0)


def absorbed(dye, wavelengths_nm):
    """Returns k of a dye of full strength."""
    return sum(k * np.exp(-0.5 * ((wavelengths_nm - nm) / width) ** 2) for nm, width, k in dye)


def dyed(wavelengths_nm, *dyes):
    """Returns the reflectance of cotton with dyes, pairs of a dye and its strength, `[band]`."""
    k = cotton(wavelengths_nm) + sum(strength * absorbed(dye, wavelengths_nm) for dye, strength in dyes)
    return (1.0 + k - np.sqrt(k * k + 2.0 * k)).astype(np.float32)


def of_cloth(wavelengths_nm):
    """Returns the reflectances of warp, weft and stray fibres, and of the table below."""
    warp = dyed(wavelengths_nm, (INDIGO, 3.0), (MADDER, 0.3))
    weft = dyed(wavelengths_nm, (MADDER, 0.5), (WELD, 1.5))
    return warp, weft, dyed(wavelengths_nm, (WELD, 0.1)), np.full(len(wavelengths_nm), 0.03, np.float32)

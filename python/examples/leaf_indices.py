"""Draws the NDVI and the red edge of every texel of a leaf's asset in bands: python leaf_indices.py leaf.spmm indices.png

Light falls from 30 degrees, the eye is above. NDVI is that of 670 and 800 nm [rouse1974]; the red edge is the wavelength half way up
between 670 and 780 nm, by the four points of [guyot1988], where NDVI is 0.3 or more. Needs numpy and matplotlib.
"""

import sys

import btf
import matplotlib.pyplot as plt
import numpy as np

LIGHT = np.array([0.5, 0.0, np.sqrt(0.75)], np.float32)
EYE = np.array([0.0, 0.0, 1.0], np.float32)


def texels(asset):
    """Texture coordinates of all texels, (rows, columns, 2)."""
    width, height = asset.meta["width"], asset.meta["height"]
    row, column = np.mgrid[:height, :width]
    return np.stack([(column + 0.5) / width, 1 - (row + 0.5) / height], -1).astype(np.float32)


def indices(nm, bands):
    """NDVI, and the red edge in nm, of bands (..., len(nm))."""
    at = lambda wanted: bands[..., np.abs(nm - wanted).argmin()]
    red, infrared = at(670), at(800)
    half = (at(670) + at(780)) / 2
    edge = 700 + 40 * (half - at(700)) / np.maximum(at(740) - at(700), 1e-4)
    ndvi = (infrared - red) / np.maximum(infrared + red, 1e-4)
    # Without chlorophyll there is no edge.
    return ndvi, np.where(ndvi < 0.3, np.nan, np.clip(edge, 680, 760))


def main(path, out):
    asset = btf.open(path)
    if asset.wavelengths_nm.size == 0 or asset.wavelengths_nm.max() < 790:
        sys.exit(f"{path} has no bands up to 800 nm; fit a capture such as that of btf-synth leaf LEAF --bands 31 --to-nm 1000")
    uv = texels(asset)
    ndvi, edge = indices(asset.wavelengths_nm, asset.eval_bands(uv, LIGHT, EYE))
    colours = np.clip(asset.eval(uv, LIGHT, EYE), 0, 1)
    figure, axes = plt.subplots(1, 3, figsize=(12, 4), layout="constrained")
    axes[0].imshow(np.where(colours < 0.0031308, 12.92 * colours, 1.055 * colours ** (1 / 2.4) - 0.055))
    axes[0].set_title("colours under D65")
    for axis, values, title, colour_map in [(axes[1], ndvi, "NDVI", "RdYlGn"), (axes[2], edge, "red edge, nm", "viridis")]:
        figure.colorbar(axis.imshow(values, cmap=colour_map), ax=axis)
        axis.set_title(title)
    for axis in axes:
        axis.set_axis_off()
    figure.savefig(out, dpi=100)
    print(f"NDVI {ndvi.mean():.3f} +- {ndvi.std():.3f}, red edge {np.nanmean(edge):.1f} +- {np.nanstd(edge):.1f} nm")


if __name__ == "__main__":
    main(*sys.argv[1:])

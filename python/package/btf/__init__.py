"""Packed BTF assets (.spmm) on numpy arrays: `btf.fit` makes one of a capture, `btf.open` opens one, `btf.compare` measures it.

Values are pi x BRDF x |cosine of the light|, linear RGB: 1 is a white Lambertian lit at normal incidence.
`btf.leaf` finds the contents of leaves from their spectra. `import btf.mitsuba` gives Mitsuba 3 a BSDF.
"""

from . import leaf
from ._btf import Asset, Capture, __version__, compare, fit, open

__all__ = ["Asset", "Capture", "__version__", "compare", "fit", "leaf", "open"]

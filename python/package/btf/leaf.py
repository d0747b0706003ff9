"""Leaves: their contents from measured spectra.

`invert` finds chlorophyll, carotenoids, anthocyanins, brown pigment, water, dry matter and the structure N of leaves from
reflectance, transmittance or both, as `btf-synth invert` does.
"""

from typing import Any, Dict, Literal, Mapping, Optional

import numpy as np
from numpy.typing import ArrayLike

from ._btf import invert_leaves as _invert_leaves

__all__ = ["invert"]


def _rows(shares: Optional[ArrayLike]) -> Optional[np.ndarray]:
    """One row for each leaf, in double precision."""
    return None if shares is None else np.ascontiguousarray(np.atleast_2d(np.asarray(shares, dtype=np.float64)))


def invert(
    wavelengths_nm: ArrayLike,
    reflectance: Optional[ArrayLike] = None,
    transmittance: Optional[ArrayLike] = None,
    *,
    abaxial_reflectance: Optional[ArrayLike] = None,
    abaxial_transmittance: Optional[ArrayLike] = None,
    model: Literal["plate-n", "plate-two-sided", "abm97", "abm-b", "abm-u"] = "plate-n",
    side: Literal["adaxial", "abaxial"] = "adaxial",
    held: Optional[Mapping[str, float]] = None,
    independent: bool = False,
    cone_deg: float = 40.0,
    rays: int = 200_000,
    seed: int = 1,
    threads: int = 0,
) -> Dict[str, Any]:
    """Finds the contents of leaves from their spectra.

    wavelengths_nm: ascending; those outside of 400 to 2500 are passed over.
    reflectance, transmittance: shares of light, (wavelengths,) or (leaves, wavelengths); NaN where nothing was measured.
    abaxial_reflectance, abaxial_transmittance: of the same leaves lit from below: "plate-two-sided" tells from both faces how
        contents divide between its halves.
    model: the leaf's optics. side: the face that was lit for the first two; for "plate-n" faces are alike.
    held: values that are known, such as {"brown": 0}.
    independent: take errors at neighbouring wavelengths for independent, as plain least squares do.
    cone_deg: half-angle of the cone of incident light, for plates.
    rays, seed: of the traces of an algorithmic model. threads: 0 for as many as there are processors.

    Returns a dict. For each key in "unknowns": KEY, an array of a value for each leaf; KEY + "_standard_error", an array with NaN
    for what was not found; KEY + "_state", a list of "found", "found-by-domain", "at-bound", "held" or "untold". Besides
    "correlations", an array (leaves, unknowns, unknowns); "rmse_reflectance", "rmse_transmittance", "rmse_abaxial_reflectance"
    and "rmse_abaxial_transmittance", arrays with NaN for what was not measured; "remarks", a list of sentences for each leaf. Raises ValueError for spectra and values that do not fit.
    """
    nm = np.ascontiguousarray(np.asarray(wavelengths_nm, dtype=np.float64))
    shares = (reflectance, transmittance, abaxial_reflectance, abaxial_transmittance)
    return _invert_leaves(
        nm, *map(_rows, shares), model, side, dict(held or {}), independent, cone_deg, rays, seed, threads
    )

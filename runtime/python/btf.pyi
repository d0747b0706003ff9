"""Packed BTF assets (.spmm): `btf.open(path)`, then `eval`, `sample` and `pdf` on numpy arrays.

Values are pi x BRDF x |cosine of the light|, linear RGB: 1 is a white Lambertian lit at normal incidence.
"""

import os
from typing import Any, Literal, Optional, Tuple, Union, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

def open(path: Union[str, os.PathLike[str]], *, levels: Literal["file", "all"] = "file", threads: int = 0) -> Asset:
    """Opens an asset file, checks it and expands it to the form that is evaluated.

    levels: "file" for those of the file, "all" for all down to one texel, which may take seconds.
    threads: number of threads that opening may use; 0 for as many as there are processors.

    Raises OSError if the file cannot be read and ValueError if it is no whole asset.
    """

@final
class Asset:
    """An open asset. It never changes, and any number of threads may use it at once.

    Directions are unit vectors away from the surface in the frame of tangent (along u), bitangent (along v) and normal:
    `wi` to the light, `wo` to the eye, z < 0 behind the surface. `uv`: u to the right, v up. Arrays of the shapes
    (..., 2) and (..., 3) are broadcast against each other; results are float32. Raises ValueError for shapes, types and
    keywords that do not fit.
    """

    @property
    def meta(self) -> dict[str, Any]:
        """The material description of the file, and width, height, layers, levels, components and sides."""

    def eval(
        self,
        uv: ArrayLike,
        wi: ArrayLike,
        wo: ArrayLike,
        *,
        components: Optional[int] = None,
        lobes: Optional[int] = None,
        interpolation: Literal["fast", "exact"] = "fast",
        heights: Literal["none", "parallax", "relief"] = "relief",
        level: int = 0,
    ) -> NDArray[np.float32]:
        """Returns pi x BRDF x |cosine of wi|, linear RGB, at least 0: (..., 3)."""

    def pdf(
        self,
        uv: ArrayLike,
        wi: ArrayLike,
        wo: ArrayLike,
        *,
        components: Optional[int] = None,
        lobes: Optional[int] = None,
        interpolation: Literal["fast", "exact"] = "fast",
        heights: Literal["none", "parallax", "relief"] = "relief",
        level: int = 0,
    ) -> NDArray[np.float32]:
        """Returns the density with which `sample` draws `wi`, per steradian: (...)."""

    def sample(
        self,
        uv: ArrayLike,
        wo: ArrayLike,
        at: ArrayLike,
        *,
        components: Optional[int] = None,
        lobes: Optional[int] = None,
        interpolation: Literal["fast", "exact"] = "fast",
        heights: Literal["none", "parallax", "relief"] = "relief",
        level: int = 0,
    ) -> Tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """Draws directions to light from `at`, three numbers in [0, 1) each: (..., 3).

        Returns wi (..., 3), its density per steradian (...) and its value as of `eval` (..., 3). Where a density
        is 0 nothing was drawn.
        """

    def uv_between(self, uv: ArrayLike, at: ArrayLike, *, level: int = 0) -> NDArray[np.float32]:
        """Draws one of the four texels around each `uv` by `at`, two numbers in [0, 1) each: its middle, (..., 2).

        Values there have the bilinear interpolation of the four texels' values as their mean.
        """

    def heights(self) -> Optional[NDArray[np.float32]]:
        """Returns the heights of the front's texels above the plane of the capture, (rows, columns) from the top left.

        In widths of a texel; None where the asset has none.
        """

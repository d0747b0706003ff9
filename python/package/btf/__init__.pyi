"""Packed BTF assets (.spmm) on numpy arrays: `btf.fit` makes one of a capture, `btf.open` opens one, `btf.compare` measures it.

Values are pi x BRDF x |cosine of the light|, linear RGB: 1 is a white Lambertian lit at normal incidence.
"""

import os
from typing import Any, Callable, List, Literal, Optional, Sequence, Tuple, Union, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import leaf as leaf

__version__: str

#: Called as `progress(stage, done, total)`; 0 of 0 at the begin of a stage. What it raises ends the work.
Progress = Callable[[str, int, int], object]
#: A folder, a zip, a list of images (.csv), a UBO2014 file (.btf), or a `Capture`.
AnyCapture = Union[str, os.PathLike[str], Capture]
#: A number of bytes, or a text such as "2MB".
Size = Union[int, float, str]

def open(path: Union[str, os.PathLike[str]], *, levels: Literal["file", "all"] = "file", threads: int = 0) -> Asset:
    """Opens an asset file, checks it and expands it to the form that is evaluated.

    levels: "file" for those of the file, "all" for all down to one texel, which may take seconds.
    threads: number of threads that opening may use; 0 for as many as there are processors.

    Raises OSError if the file cannot be read and ValueError if it is no whole asset.
    """

def fit(
    capture: Union[AnyCapture, Sequence[AnyCapture]],
    *,
    bytes: Optional[Size] = None,
    psnr_db: Optional[float] = None,
    output: Union[str, os.PathLike[str], None] = None,
    clusters: Optional[int] = None,
    lobes: Optional[int] = None,
    components: Optional[int] = None,
    error: Literal["auto", "gamma", "linear", "log"] = "auto",
    heights: bool = False,
    colours: bool = False,
    priors: Optional[Sequence[Union[str, os.PathLike[str]]]] = None,
    gpu: str = "off",
    seed: int = 1,
    memory: Optional[Size] = None,
    threads: int = 0,
    progress: Optional[Progress] = None,
) -> Asset:
    """Fits an asset to a capture, or to a list of captures, one for each layer, which differ in their sides.

    bytes: largest size of the file; or psnr_db: least PSNR of the 8-bit values, of the smallest asset that reaches it.
    output: file to write; without it `Asset.save` writes it.
    clusters, lobes, components: numbers of the model; None for what the goal gives.
    error: the error to make small. heights: whether to find the texels' heights. seed: of every random choice.
    colours: whether a capture in spectral bands is fitted as colours under D65.
    priors: fitted assets by which pairs without an image are predicted; None for those that come with the program.
    gpu: "off", "auto" for an adapter that multiplies matrices quicker than the processor, or a part of an adapter's name.
    memory: most memory to use. threads: 0 for as many as there are processors.

    Returns the asset; `meta["error"]` has the figures. Raises OSError for what cannot be read or written, ValueError for
    captures and parameters that do not fit, KeyboardInterrupt on Control-C; nothing is half written.
    """

def compare(
    asset: Union[str, os.PathLike[str], Asset],
    capture: AnyCapture,
    *,
    components: Optional[int] = None,
    lobes: Optional[int] = None,
    interpolation: Literal["fast", "exact"] = "exact",
    heights: Literal["none", "parallax", "relief"] = "relief",
    memory: Optional[Size] = None,
    threads: int = 0,
    progress: Optional[Progress] = None,
) -> dict[str, Any]:
    """Measures an asset in its file form against a capture of the same texels.

    Returns psnr_db of the 8-bit values, psnr_linear_db, rel_rmse, worst_texel_rmse, energy_ratio and delta_e00_mean; None for
    the PSNR of what is equal. Raises as `fit`.
    """

@final
class Capture:
    """Photographs of a flat material under several lights from several views: of arrays, or opened by `Capture.open`.

    images: (views, lights, rows, columns, 3), linear reflectance times the cosine of the light, rows from the top; copied.
    wavelengths_nm: of bands in place of three channels, ascending.
    lights, views: unit vectors (n, 3) away from the surface, x along columns, y upwards.
    size_mm: physical width and height. Raises ValueError for shapes that do not fit and directions that are none.
    """

    def __init__(
        self,
        images: ArrayLike,
        lights: ArrayLike,
        views: ArrayLike,
        *,
        size_mm: Optional[Tuple[float, float]] = None,
        side: Literal["front", "back", "transmission-back", "transmission-front"] = "front",
        name: str = "array",
        wavelengths_nm: Optional[Sequence[float]] = None,
    ) -> None: ...
    @staticmethod
    def open(path: Union[str, os.PathLike[str]]) -> Capture:
        """Opens a folder, a zip, a list of images or a UBO2014 file. Raises OSError and ValueError."""

    @property
    def lights(self) -> NDArray[np.float32]:
        """Unit vectors to the lights, (lights, 3), in the order of `image`."""

    @property
    def views(self) -> NDArray[np.float32]:
        """Unit vectors to the eyes, (views, 3), in the order of `image`."""

    @property
    def missing(self) -> List[Tuple[int, int]]:
        """View and light of each pair that has no image, in ascending order."""

    @property
    def wavelengths_nm(self) -> NDArray[np.float64]:
        """Wavelengths of the bands, ascending; empty for colours."""

    @property
    def shape(self) -> Tuple[int, int]:
        """Rows and columns."""

    @property
    def size_mm(self) -> Optional[Tuple[float, float]]:
        """Physical width and height, where known."""

    @property
    def name(self) -> str:
        """A short name."""

    def image(self, view: int, light: int) -> NDArray[np.float32]:
        """Reads an image, (rows, columns, 3), linear, rows from the top. Raises IndexError and ValueError."""

    def image_bands(self, view: int, light: int) -> NDArray[np.float32]:
        """Reads all bands of an image, (rows, columns, bands). Raises IndexError and ValueError."""

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

    @property
    def wavelengths_nm(self) -> NDArray[np.float32]:
        """Wavelengths of the bands, ascending; empty for an asset of colours."""

    def eval_bands(
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
        """Returns the bands of an asset that has any, as `eval` does its colours: (..., bands)."""

    def under(self, illuminant: str, *, observer: str = "1931") -> Asset:
        """Returns this asset in bands as it is seen under another light or by another eye.

        illuminant: "D65", "A", "E" or a table of wavelengths in nm and power; observer: "1931" or a table of wavelengths and
        three sensitivities.
        """

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

    def save(self, path: Union[str, os.PathLike[str]]) -> None:
        """Writes the asset's file, never half of it. Raises OSError."""

    @property
    def nbytes(self) -> int:
        """Length of the asset's file in bytes."""

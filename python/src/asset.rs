//! `btf.open` and `btf.Asset`.

use crate::arrays::{Shape, Vectors};
use crate::faults::capture_error;
use btf_capture::{Illuminant, Observer, shown_weights, write_file_atomically};
use btf_runtime::{
    Asset, DecodeOptions, HeightField, HeightUse, Interpolation, Levels, Query, ResidentBytes, ResidentFile, Sample,
    Spectrum, SurfaceSide, density, evaluate_bands, evaluate_many, sample,
};
use numpy::{PyArray1, PyArrayDyn, PyArrayMethods};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Number of places that are evaluated between checks for Control-C.
const BATCH: usize = 1 << 15;

/// An array of results.
type Numbers<'py> = Bound<'py, PyArrayDyn<f32>>;

/// An open asset, made by `btf.open`: evaluates, samples and returns its description. It never changes, and any number
/// of threads may use it at once.
///
/// Directions are unit vectors away from the surface in the frame of tangent (along u), bitangent (along v) and normal:
/// `wi` to the light, `wo` to the eye, z < 0 behind the surface. Texture coordinates `uv`: u to the right, v up, one
/// repetition a unit; the nearest texel is evaluated. Arrays of the shapes (..., 2) and (..., 3) are broadcast against
/// each other. Results are black, densities 0, where the asset has no layer for the sides of light and eye, where a
/// number is not finite, and where a direction is not of length 1 within half a percent.
///
/// Keywords of all calls:
/// components: largest number of residual components; None for all, 0 for the residual's mean.
/// lobes: largest number of lobes of a texel; None for all.
/// interpolation: "fast" or "exact", the rule by which a value between the measured directions is computed from theirs.
/// heights: "none", "parallax" (of eyes outside the measured ones) or "relief" (also between the measured directions): the
/// use of the heights, where the asset has any.
/// level: 0 the finest, below meta["levels"].
#[pyclass(name = "Asset", module = "btf", frozen)]
pub struct PyAsset {
    file: ResidentFile,
    bytes: ResidentBytes,
    path: PathBuf,
}

/// Opens an asset file, checks it and expands it to the form that is evaluated.
///
/// levels: "file" for those of the file, "all" for all down to one texel, which may take seconds.
/// threads: number of threads that opening may use; 0 for as many as there are processors.
///
/// A file in its resident form is mapped: it must not be changed in place while it is open.
///
/// Raises OSError if the file cannot be read and ValueError if it is no whole asset.
#[pyfunction]
#[pyo3(signature = (path, *, levels="file", threads=0))]
pub fn open(py: Python<'_>, path: PathBuf, levels: &str, threads: usize) -> PyResult<PyAsset> {
    let levels = match levels {
        "file" => Levels::AtHand,
        "all" => Levels::All,
        other => return Err(PyValueError::new_err(format!("levels is '{other}': take 'file' or 'all'"))),
    };
    py.detach(|| {
        let bytes = bytes_of(&path).map_err(|error| {
            std::io::Error::new(error.kind(), format!("{} cannot be read: {error}", path.display()))
        })?;
        PyAsset::opened(bytes, path, levels, threads)
    })
}

/// Maps the bytes of a file; an empty file has no mapping.
fn bytes_of(path: &Path) -> std::io::Result<ResidentBytes> {
    let file = std::fs::File::open(path)?;
    if file.metadata()?.len() == 0 {
        return Ok(Arc::new(Vec::new()));
    }
    #[allow(unsafe_code, reason = "mapping a file: `open` asks that it is not changed in place")]
    // SAFETY: as said there; btf-fit never does.
    Ok(Arc::new(unsafe { memmap2::Mmap::map(&file) }?))
}

impl PyAsset {
    /// Opens bytes; `path` is for messages.
    fn opened(bytes: ResidentBytes, path: PathBuf, levels: Levels, threads: usize) -> PyResult<PyAsset> {
        let name = path.display();
        // Threads of its own: rayon's common ones would be missing in a process that Python forks.
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|error| PyRuntimeError::new_err(format!("no threads for opening {name}: {error}")))?;
        let parallel = |count: usize, work: &(dyn Fn(usize) + Sync)| (0..count).into_par_iter().for_each(work);
        let opened = pool.install(|| btf_runtime::open(Arc::clone(&bytes), levels, &parallel));
        let file = opened.map_err(|error| PyValueError::new_err(format!("{name}: {error}")))?;
        Ok(PyAsset { file, bytes, path })
    }

    /// Opens the bytes of a file that was just made.
    pub(crate) fn of_file_bytes(py: Python<'_>, bytes: Vec<u8>, path: PathBuf) -> PyResult<PyAsset> {
        py.detach(|| PyAsset::opened(Arc::new(bytes), path, Levels::AtHand, 0))
    }

    /// Returns the file form, for measurements.
    ///
    /// # Errors
    /// ValueError for an asset in resident form.
    pub(crate) fn file_form(&self) -> PyResult<Asset> {
        Asset::parse((*self.bytes).as_ref()).map_err(|error| {
            PyValueError::new_err(format!("{} is no asset in its file form: {error}", self.path.display()))
        })
    }

    /// Returns the bands.
    ///
    /// # Errors
    /// ValueError for an asset of colours.
    fn bands(&self) -> PyResult<Spectrum> {
        self.file.resident.spectrum().ok_or_else(|| {
            PyValueError::new_err(format!(
                "{} has colours and no bands; fit a capture in spectral bands",
                self.path.display()
            ))
        })
    }

    fn checked_level(&self, level: u32) -> PyResult<()> {
        let levels = self.file.resident.levels();
        if level < levels {
            return Ok(());
        }
        Err(PyValueError::new_err(format!(
            "level {level} was asked for, the asset has {levels}, from 0; open it with levels='all' for all"
        )))
    }

    fn options(
        &self,
        components: Option<u32>,
        lobes: Option<u32>,
        interpolation: &str,
        heights: &str,
        level: u32,
    ) -> PyResult<DecodeOptions> {
        let options = decode_options(components, lobes, interpolation, heights)?;
        self.checked_level(level)?;
        Ok(options)
    }
}

/// Takes the options of an evaluation as keywords have them.
///
/// # Errors
/// ValueError for words that are none.
pub(crate) fn decode_options(
    components: Option<u32>,
    lobes: Option<u32>,
    interpolation: &str,
    heights: &str,
) -> PyResult<DecodeOptions> {
    let interpolation = match interpolation {
        "fast" => Interpolation::Fast,
        "exact" => Interpolation::Exact,
        other => return Err(PyValueError::new_err(format!("interpolation is '{other}': take 'fast' or 'exact'"))),
    };
    let Some(heights) = HeightUse::ALL.into_iter().find(|known| known.name() == heights) else {
        return Err(PyValueError::new_err(format!("heights is '{heights}': take 'none', 'parallax' or 'relief'")));
    };
    Ok(DecodeOptions {
        components: components.unwrap_or(u32::MAX),
        lobes: lobes.unwrap_or(u32::MAX),
        interpolation,
        heights,
    })
}

/// Broadcasts the arrays against each other; returns their places and their shape.
fn queries(uv: &Bound<'_, PyAny>, wi: &Bound<'_, PyAny>, wo: &Bound<'_, PyAny>) -> PyResult<(Shape, Vec<Query>)> {
    let (uv, wi, wo) = (Vectors::new(uv, "uv", 2)?, Vectors::new(wi, "wi", 3)?, Vectors::new(wo, "wo", 3)?);
    let shape = Shape::of(&[&uv, &wi, &wo])?;
    let mut queries: Vec<Query> = shape.room()?;
    shape.visit(&uv, |uv| queries.push(Query { uv, ..Query::default() }))?;
    let mut places = queries.iter_mut();
    shape.visit(&wi, |wi| places.by_ref().take(1).for_each(|query| query.wi = wi))?;
    let mut places = queries.iter_mut();
    shape.visit(&wo, |wo| places.by_ref().take(1).for_each(|query| query.wo = wo))?;
    Ok((shape, queries))
}

#[allow(clippy::too_many_arguments, reason = "each is an argument of the Python function, most by keyword")]
#[pymethods]
impl PyAsset {
    /// Returns pi x BRDF x |cosine of wi|, linear RGB, at least 0: float32 of the shape (..., 3). A white Lambertian
    /// surface lit at normal incidence gives 1; a renderer multiplies by no further cosine.
    #[pyo3(signature = (uv, wi, wo, *, components=None, lobes=None, interpolation="fast", heights="relief", level=0))]
    fn eval<'py>(
        &self,
        py: Python<'py>,
        uv: &Bound<'py, PyAny>,
        wi: &Bound<'py, PyAny>,
        wo: &Bound<'py, PyAny>,
        components: Option<u32>,
        lobes: Option<u32>,
        interpolation: &str,
        heights: &str,
        level: u32,
    ) -> PyResult<Numbers<'py>> {
        let options = self.options(components, lobes, interpolation, heights, level)?;
        let (shape, queries) = queries(uv, wi, wo)?;
        let mut values = shape.room()?;
        values.resize(queries.len(), [0.0; 3]);
        for (queries, values) in queries.chunks(BATCH).zip(values.chunks_mut(BATCH)) {
            py.detach(|| evaluate_many(&self.file.resident, level, queries, &options, values));
            py.check_signals()?;
        }
        shape.array(py, values.into_flattened(), Some(3))
    }

    /// Wavelengths of the bands in nanometres, ascending; empty for an asset of colours.
    #[getter]
    fn wavelengths_nm<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        PyArray1::from_vec(py, self.file.resident.spectrum().map_or_else(Vec::new, |spectrum| spectrum.wavelengths_nm))
    }

    /// Returns the bands of an asset that has any, as `eval` does its colours: float32 of the shape (..., bands).
    ///
    /// Raises ValueError for an asset of colours.
    #[pyo3(signature = (uv, wi, wo, *, components=None, lobes=None, interpolation="fast", heights="relief", level=0))]
    fn eval_bands<'py>(
        &self,
        py: Python<'py>,
        uv: &Bound<'py, PyAny>,
        wi: &Bound<'py, PyAny>,
        wo: &Bound<'py, PyAny>,
        components: Option<u32>,
        lobes: Option<u32>,
        interpolation: &str,
        heights: &str,
        level: u32,
    ) -> PyResult<Numbers<'py>> {
        let options = self.options(components, lobes, interpolation, heights, level)?;
        let spectrum = self.bands()?;
        let bands = spectrum.weights.len();
        let (shape, queries) = queries(uv, wi, wo)?;
        let mut values = vec![0.0f32; queries.len() * bands];
        for (queries, values) in queries.chunks(BATCH).zip(values.chunks_mut(BATCH * bands)) {
            let each = queries.iter().zip(values.chunks_mut(bands));
            let resident = &self.file.resident;
            py.detach(|| {
                each.for_each(|(query, values)| evaluate_bands(resident, &spectrum, level, query, &options, values));
            });
            py.check_signals()?;
        }
        shape.array(py, values, Some(bands))
    }

    /// Returns this asset in bands as it is seen under another light, or by another eye: `eval` and `sample` of the result give
    /// that in place of colours under D65.
    ///
    /// illuminant: "D65", "A", "E" (equal power) or a table (CSV) of wavelengths in nm and power.
    /// observer: "1931" or a table of wavelengths and three sensitivities, of a camera.
    ///
    /// Raises ValueError for an asset of colours and for what is no such table.
    #[pyo3(signature = (illuminant, *, observer="1931"))]
    fn under(&self, illuminant: &str, observer: &str) -> PyResult<PyAsset> {
        let spectrum = self.bands()?;
        let illuminant = Illuminant::by_name(illuminant).map_err(|error| capture_error(&error))?;
        let observer = Observer::by_name(observer).map_err(|error| capture_error(&error))?;
        let nm: Vec<f64> = spectrum.wavelengths_nm.iter().map(|nm| f64::from(*nm)).collect();
        let mut file = self.file.clone();
        file.resident.set_shown(spectrum.shown_through(&shown_weights(&nm, &illuminant, &observer)));
        Ok(PyAsset { file, bytes: Arc::clone(&self.bytes), path: self.path.clone() })
    }

    /// Returns the density with which `sample` draws `wi`, per steradian: float32 of the shape (...).
    #[pyo3(signature = (uv, wi, wo, *, components=None, lobes=None, interpolation="fast", heights="relief", level=0))]
    fn pdf<'py>(
        &self,
        py: Python<'py>,
        uv: &Bound<'py, PyAny>,
        wi: &Bound<'py, PyAny>,
        wo: &Bound<'py, PyAny>,
        components: Option<u32>,
        lobes: Option<u32>,
        interpolation: &str,
        heights: &str,
        level: u32,
    ) -> PyResult<Numbers<'py>> {
        let options = self.options(components, lobes, interpolation, heights, level)?;
        let (shape, queries) = queries(uv, wi, wo)?;
        let mut densities = shape.room()?;
        for queries in queries.chunks(BATCH) {
            let of = |query| density(&self.file.resident, level, query, &options);
            py.detach(|| densities.extend(queries.iter().map(of)));
            py.check_signals()?;
        }
        shape.array(py, densities, None)
    }

    /// Draws directions to light that matter to the eye, from `at`: three numbers in [0, 1) each, (..., 3). Returns wi
    /// (..., 3), its density per steradian (...) and its value as of `eval` (..., 3). Where a density is 0 nothing was
    /// drawn: the path ends. value / (pi x density) is the weight of a path that continues.
    #[pyo3(signature = (uv, wo, at, *, components=None, lobes=None, interpolation="fast", heights="relief", level=0))]
    fn sample<'py>(
        &self,
        py: Python<'py>,
        uv: &Bound<'py, PyAny>,
        wo: &Bound<'py, PyAny>,
        at: &Bound<'py, PyAny>,
        components: Option<u32>,
        lobes: Option<u32>,
        interpolation: &str,
        heights: &str,
        level: u32,
    ) -> PyResult<(Numbers<'py>, Numbers<'py>, Numbers<'py>)> {
        let options = self.options(components, lobes, interpolation, heights, level)?;
        let (uv, wo, at) = (Vectors::new(uv, "uv", 2)?, Vectors::new(wo, "wo", 3)?, Vectors::new(at, "at", 3)?);
        let shape = Shape::of(&[&uv, &wo, &at])?;
        let mut draws: Vec<([f32; 2], [f32; 3], [f32; 3])> = shape.room()?;
        shape.visit(&uv, |uv| draws.push((uv, [0.0; 3], [0.0; 3])))?;
        let mut places = draws.iter_mut();
        shape.visit(&wo, |wo| places.by_ref().take(1).for_each(|draw| draw.1 = wo))?;
        let mut places = draws.iter_mut();
        shape.visit(&at, |at| places.by_ref().take(1).for_each(|draw| draw.2 = at))?;
        let (mut wi, mut densities, mut values) = (shape.room()?, shape.room()?, shape.room()?);
        for draws in draws.chunks(BATCH) {
            py.detach(|| {
                for (uv, wo, at) in draws {
                    let drawn: Sample = sample(&self.file.resident, level, *uv, *wo, *at, &options).unwrap_or_default();
                    wi.push(drawn.wi);
                    densities.push(drawn.density);
                    values.push(drawn.value);
                }
            });
            py.check_signals()?;
        }
        Ok((
            shape.array(py, wi.into_flattened(), Some(3))?,
            shape.array(py, densities, None)?,
            shape.array(py, values.into_flattened(), Some(3))?,
        ))
    }

    /// Draws one of the four texels around each texture coordinate `uv` by two numbers in [0, 1) each, `at`: (..., 2).
    /// Returns the middles of the texels, (..., 2). Values there have the bilinear interpolation of the four texels'
    /// values as their mean; give `eval`, `sample` and `pdf` of one path vertex the same.
    #[pyo3(signature = (uv, at, *, level=0))]
    fn uv_between<'py>(
        &self,
        py: Python<'py>,
        uv: &Bound<'py, PyAny>,
        at: &Bound<'py, PyAny>,
        level: u32,
    ) -> PyResult<Numbers<'py>> {
        self.checked_level(level)?;
        let (uv, at) = (Vectors::new(uv, "uv", 2)?, Vectors::new(at, "at", 2)?);
        let shape = Shape::of(&[&uv, &at])?;
        let mut places: Vec<[f32; 2]> = shape.room()?;
        shape.visit(&uv, |uv| places.push(uv))?;
        let mut next = places.iter_mut();
        let resident = &self.file.resident;
        shape.visit(&at, |at| next.by_ref().take(1).for_each(|uv| *uv = resident.uv_between(level, *uv, at)))?;
        shape.array(py, places.into_flattened(), Some(2))
    }

    /// Writes the asset's file, never half of it.
    ///
    /// Raises OSError if it cannot be written.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let written = py.detach(|| write_file_atomically(&path, (*self.bytes).as_ref()));
        written.map_err(|error| capture_error(&error))
    }

    /// Returns the length of the asset's file in bytes.
    #[getter]
    fn nbytes(&self) -> usize {
        (*self.bytes).as_ref().len()
    }

    /// Returns the heights of the front's texels above the plane of the capture, (rows, columns) from the top left, in widths
    /// of a texel; None where the asset has none.
    fn heights<'py>(&self, py: Python<'py>) -> PyResult<Option<Numbers<'py>>> {
        let resident = &self.file.resident;
        let layer = resident.layer_for_sides(0, SurfaceSide::Front, SurfaceSide::Front);
        let Some(field) = layer.and_then(|layer| HeightField::of_resident(resident, layer)) else { return Ok(None) };
        let [columns, rows] = field.size();
        PyArray1::from_vec(py, field.heights()).reshape(vec![rows, columns]).map(Some)
    }

    /// Returns the asset's description as a dict: the material description of its file (name, ...), and width, height,
    /// layers, levels, components (largest number of residual components), sides, a list of (light, eye) such as
    /// ("front", "back"), size_mm, the physical width and height or None, and seamless, whether the left edge continues
    /// the right and the bottom the top.
    #[getter]
    fn meta<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let json = py.import("json")?;
        let told = json.call_method1("loads", (&self.file.material,)).ok();
        let meta = match told.and_then(|told| told.cast_into::<PyDict>().ok()) {
            Some(meta) => meta,
            // The format holds text; that it is an object is up to who wrote it.
            None => {
                let meta = PyDict::new(py);
                meta.set_item("material", &self.file.material)?;
                meta
            }
        };
        let resident = &self.file.resident;
        meta.set_item("width", resident.width())?;
        meta.set_item("height", resident.height())?;
        meta.set_item("layers", resident.layers())?;
        meta.set_item("levels", resident.levels())?;
        meta.set_item("components", resident.most_components())?;
        let name = |side: SurfaceSide| match side {
            SurfaceSide::Front => "front",
            SurfaceSide::Back => "back",
        };
        let sides: Vec<(&str, &str)> = SurfaceSide::ALL
            .into_iter()
            .flat_map(|eye| SurfaceSide::ALL.map(|light| (light, eye)))
            .filter(|(light, eye)| resident.layer_for_sides(0, *light, *eye).is_some())
            .map(|(light, eye)| (name(light), name(eye)))
            .collect();
        meta.set_item("sides", sides)?;
        meta.set_item("size_mm", self.file.size_mm.map(|[width, height]| (width, height)))?;
        meta.set_item("seamless", (self.file.seamless[0], self.file.seamless[1]))?;
        Ok(meta)
    }

    fn __repr__(&self) -> String {
        let (resident, name) = (&self.file.resident, self.path.display());
        let [width, height] = [resident.width(), resident.height()];
        format!(
            "<btf.Asset {name}: {width} x {height} texels, {} layers, {} levels>",
            resident.layers(),
            resident.levels()
        )
    }
}

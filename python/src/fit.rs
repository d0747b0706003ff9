//! `btf.fit` and `btf.compare`.

use crate::asset::{PyAsset, decode_options};
use crate::capture::capture_of;
use crate::faults::{capture_error, fit_error, value_error};
use crate::work;
use btf_capture::{AtomicFile, Capture, bytes_from_text, write_file_atomically};
use btf_fit::{
    ErrorMeasure, FitParams, GpuChoice, MeasureParams, Metrics, Priors, fit_and_measure, layer_for_capture,
    measure_capture, output_fault, resident_in_parallel,
};
use btf_runtime::Asset;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};
use std::path::{Path, PathBuf};

/// Fits an asset to a capture.
///
/// capture: a path or a btf.Capture; or a list of them, one for each layer, which differ in their sides.
/// bytes: largest size of the file, a number or a text such as "2MB"; or
/// psnr_db: least PSNR of the 8-bit values: the smallest asset that reaches it is chosen.
/// output: file to write; without it the asset is in memory alone, and `save` writes it.
/// clusters, lobes, components: numbers of the model; None for what the goal gives.
/// error: "gamma", "linear" or "log", the error to make small; "auto" chooses.
/// heights: whether to find the texels' heights, where they predict steep views.
/// colours: whether a capture in spectral bands is fitted as colours under D65.
/// priors: paths of fitted assets by which pairs without an image are predicted; None for those that come with the program,
/// an empty list for none.
/// gpu: "off", "auto" for the adapter that multiplies matrices quicker than the processor, or a part of an adapter's name.
/// seed: of every random choice. The same capture, parameters and seed give the same bytes on any number of threads.
/// memory: most memory to use, a number or a text such as "4GB".
/// threads: 0 for as many as there are processors.
/// progress: called as progress(stage, done, total); what it raises ends the fit.
///
/// Returns the asset. Its `meta["error"]` has the figures against the capture. Raises OSError for what cannot be read or
/// written, ValueError for captures and parameters that do not fit, KeyboardInterrupt on Control-C; nothing is half written.
#[allow(clippy::too_many_arguments, reason = "each is an argument of the Python function, most by keyword")]
#[pyfunction]
#[pyo3(signature = (capture, *, bytes=None, psnr_db=None, output=None, clusters=None, lobes=None, components=None,
                    error="auto", heights=false, colours=false, priors=None, gpu="off", seed=1, memory=None, threads=0, progress=None))]
pub fn fit(
    py: Python<'_>,
    capture: &Bound<'_, PyAny>,
    bytes: Option<&Bound<'_, PyAny>>,
    psnr_db: Option<f64>,
    output: Option<PathBuf>,
    clusters: Option<usize>,
    lobes: Option<usize>,
    components: Option<usize>,
    error: &str,
    heights: bool,
    colours: bool,
    priors: Option<Vec<PathBuf>>,
    gpu: &str,
    seed: u64,
    memory: Option<&Bound<'_, PyAny>>,
    threads: usize,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<PyAsset> {
    let captures = captures_of(capture)?;
    if let Some(output) = &output {
        // Before the work, not after it; the temporary file goes with the drop.
        if let Some(sentence) = output_fault(output, &paths_in(capture)?) {
            return Err(value_error(sentence));
        }
        drop(AtomicFile::create(output).map_err(|error| capture_error(&error))?);
    }
    let usual = FitParams::default();
    let mut params = FitParams {
        bytes: bytes.map(|size| size_of(size, "bytes")).transpose()?,
        psnr_db,
        components,
        error: match error {
            "auto" => None,
            "gamma" => Some(ErrorMeasure::Gamma),
            "linear" => Some(ErrorMeasure::Linear),
            "log" => Some(ErrorMeasure::Log),
            other => {
                return Err(value_error(format!("error is '{other}': take 'auto', 'gamma', 'linear' or 'log'")));
            }
        },
        heights,
        colours,
        priors: priors.map_or(Priors::BuiltIn, Priors::Assets),
        gpu: GpuChoice::from_words(gpu).map_err(|reason| value_error(format!("gpu: {reason}")))?,
        seed,
        memory_bytes: memory.map_or(Ok(usual.memory_bytes), |size| size_of(size, "memory"))?,
        cache_directory: folder_of(output.as_deref()),
        ..usual
    };
    // As `btf-fit fit` does.
    let share = params.bytes.map(|bytes| bytes / captures.len() as u64);
    params.clusters = clusters.unwrap_or(params.clusters_for(share, captures[0].info().texel_count()));
    params.lobes = lobes.unwrap_or(params.lobes_for(share, params.clusters));
    let params = params.check().map_err(|error| fit_error(&error))?;
    let fitted = work::run(py, progress, threads, |monitor| {
        let fitted = fit_and_measure(&captures, &params, monitor)?;
        monitor.check()?;
        if let Some(output) = &output {
            write_file_atomically(output, &fitted.bytes)?;
        }
        Ok(fitted)
    })?;
    PyAsset::of_file_bytes(py, fitted.bytes, output.unwrap_or_else(|| "fitted".into()))
}

/// Measures an asset against a capture of the same texels, as `btf-fit compare` does.
///
/// asset: a btf.Asset in its file form, or the path of one. capture: a path or a btf.Capture.
/// components, lobes, interpolation, heights: as of `Asset.eval`; directions that the asset has not measured are interpolated.
/// memory, threads, progress: as of `btf.fit`.
///
/// Returns a dict: psnr_db of the 8-bit values, psnr_linear_db, rel_rmse, worst_texel_rmse, energy_ratio, delta_e00_mean; None for
/// the PSNR of what is equal. Raises as `btf.fit`.
#[allow(clippy::too_many_arguments, reason = "each is an argument of the Python function, most by keyword")]
#[pyfunction]
#[pyo3(signature = (asset, capture, *, components=None, lobes=None, interpolation="exact", heights="relief", memory=None,
                    threads=0, progress=None))]
pub fn compare<'py>(
    py: Python<'py>,
    asset: &Bound<'py, PyAny>,
    capture: &Bound<'py, PyAny>,
    components: Option<u32>,
    lobes: Option<u32>,
    interpolation: &str,
    heights: &str,
    memory: Option<&Bound<'py, PyAny>>,
    threads: usize,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let capture = capture_of(capture)?;
    let parsed = asset_of(asset)?;
    let options = decode_options(components, lobes, interpolation, heights)?;
    let memory_bytes = memory.map_or(Ok(FitParams::default().memory_bytes), |size| size_of(size, "memory"))?;
    let metrics = work::run(py, progress, threads, |monitor| {
        let layer = layer_for_capture(capture.info(), &parsed)?;
        let resident = resident_in_parallel(&parsed);
        let params = MeasureParams { layer, options, memory_bytes, ..MeasureParams::default() };
        Ok(measure_capture(&capture, &parsed, &resident, &params, monitor)?.metrics())
    })?;
    as_dict(py, &metrics)
}

/// Returns figures as a dict, with the keys of `--json`.
fn as_dict<'py>(py: Python<'py>, metrics: &Metrics) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(metrics).map_err(|error| value_error(error.to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}

/// Takes one capture or a list of them.
fn captures_of(value: &Bound<'_, PyAny>) -> PyResult<Vec<Capture>> {
    if !value.is_instance_of::<PyList>() && !value.is_instance_of::<PyTuple>() {
        return Ok(vec![capture_of(value)?]);
    }
    let captures: Vec<Capture> = value.try_iter()?.map(|one| capture_of(&one?)).collect::<PyResult<_>>()?;
    match captures.is_empty() {
        false => Ok(captures),
        true => Err(value_error("the list of captures is empty: give one for each layer")),
    }
}

/// Returns the paths among one capture or a list of them.
fn paths_in(value: &Bound<'_, PyAny>) -> PyResult<Vec<PathBuf>> {
    match value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        true => value.try_iter()?.filter_map(|one| one.map(|one| one.extract().ok()).transpose()).collect(),
        false => Ok(value.extract().into_iter().collect()),
    }
}

/// Takes an asset or the path of one, in file form.
fn asset_of(value: &Bound<'_, PyAny>) -> PyResult<Asset> {
    match value.cast::<PyAsset>() {
        Ok(asset) => asset.get().file_form(),
        Err(_) => {
            let path: PathBuf = value.extract()?;
            btf_fit::load_asset(&path).map(|(_, asset)| asset).map_err(|error| fit_error(&error))
        }
    }
}

/// Takes a number of bytes or a text such as "2MB".
fn size_of(value: &Bound<'_, PyAny>, name: &str) -> PyResult<u64> {
    if let Ok(text) = value.extract::<String>() {
        return bytes_from_text(&text).map_err(|error| value_error(format!("{name}: {error}")));
    }
    let number: f64 = value.extract()?;
    match (0.0..1e18).contains(&number) {
        true => Ok(number as u64),
        false => Err(value_error(format!("{name} is {number}: give a number of bytes, or a text such as '2MB'"))),
    }
}

/// Returns the folder for temporary files: beside the output, else the system's.
fn folder_of(output: Option<&Path>) -> PathBuf {
    match output.map(|output| output.parent().filter(|folder| !folder.as_os_str().is_empty())) {
        Some(Some(folder)) => folder.to_path_buf(),
        Some(None) => PathBuf::from("."),
        None => std::env::temp_dir(),
    }
}

//! Small captures, fitted assets, and data that may be absent: for promises and benches.

use btf_capture::{Capture, CaptureInfo, CaptureWriter, DirectionSet, ImageFormat};
use btf_fit::{FitOutcome, FitParams, Monitor, fit};
use btf_runtime::{Asset, Resident};
use btf_synth::{CaptureParams, LeafParams, write_leaf_capture};
use rayon::prelude::*;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Writes a leaf capture of `size` x `size` texels under `views` and `lights` and opens it.
///
/// # Panics
/// If it cannot be written or read: the test that asked for it has failed.
pub fn leaf_capture(
    folder: &Path,
    size: usize,
    views: &DirectionSet,
    lights: &DirectionSet,
    format: ImageFormat,
) -> Capture {
    let params = LeafParams::default();
    let params = LeafParams {
        capture: CaptureParams { size, views: views.clone(), lights: lights.clone(), format, ..params.capture },
        ..params
    };
    write_leaf_capture(folder, &params, &|_, _| ControlFlow::Continue(())).expect("the leaf capture is written");
    Capture::open(folder).expect("the leaf capture is read")
}

/// Writes a capture whose samples are `value(texel, wi, wo)`, linear reflectance times cosine, as EXR or 8 bit.
///
/// # Panics
/// If it cannot be written or read.
pub fn capture_of(
    folder: &Path,
    size: usize,
    views: &DirectionSet,
    lights: &DirectionSet,
    format: ImageFormat,
    value: impl Fn(usize, [f32; 3], [f32; 3]) -> [f32; 3] + Sync,
) -> Capture {
    capture_from(folder, CaptureInfo::new("test", size, size, views.clone(), lights.clone(), format), value)
}

/// Writes the capture that `info` describes, of any side and shape. `value(texel, wi, wo)` is in the capture's own
/// frame: of the back, that of the turned-over sample.
///
/// # Panics
/// If it cannot be written or read.
pub fn capture_from(
    folder: &Path,
    info: CaptureInfo,
    value: impl Fn(usize, [f32; 3], [f32; 3]) -> [f32; 3] + Sync,
) -> Capture {
    let (view_units, light_units, texels) = (info.views.units(), info.lights.units(), info.texel_count());
    let writer = CaptureWriter::create(folder, info).expect("the capture folder is made");
    for (v, wo) in view_units.iter().enumerate() {
        (0..light_units.len()).into_par_iter().for_each(|l| {
            let image: Vec<f32> = (0..texels).flat_map(|texel| value(texel, light_units[l], *wo)).collect();
            writer.write(v, l, &image).expect("an image is written");
        });
    }
    writer.finish().expect("the capture is finished");
    Capture::open(folder).expect("the capture is read")
}

/// Parameters that fit a small capture in seconds, with the cache in `folder`.
pub fn small_fit(folder: &Path) -> FitParams {
    FitParams {
        clusters: 3,
        lobes: 4,
        components: Some(4),
        cache_directory: folder.to_path_buf(),
        ..FitParams::default()
    }
}

/// Fits one capture.
///
/// # Panics
/// If it cannot be fitted.
pub fn fitted(capture: &Capture, params: &FitParams) -> FitOutcome {
    let params = params.check().expect("the parameters are in range");
    fit(std::slice::from_ref(capture), &params, &Monitor::default()).expect("the capture is fitted")
}

/// The resident form, expanded on all threads.
pub fn resident(asset: &Asset) -> Resident {
    Resident::from_asset_on(asset, &|count, work| (0..count).into_par_iter().for_each(work))
}

/// A file or folder of the measured data that is handed around outside of the repository, or `None`, with a
/// line for the skip count: `BTF_DATA` names its folder, `../shared/data` is looked at without it.
pub fn measured_data(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("BTF_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"), PathBuf::from);
    let path = root.join(name);
    if path.exists() {
        return Some(path);
    }
    skip(&format!("measured data {name} is not here (set BTF_DATA to its folder)"));
    None
}

/// Counts a test as skipped because a program of others is not here, as `reason` says.
///
/// # Panics
/// In CI, where everything must be here: `CI` or `BTF_CI` is set.
pub fn absent(reason: &str) {
    let is_ci = ["CI", "BTF_CI"].iter().any(|name| std::env::var_os(name).is_some_and(|value| !value.is_empty()));
    assert!(!is_ci, "{reason}");
    skip(reason);
}

/// Says visibly that a test was skipped: on stderr and in the file that `BTF_SKIP_LOG` names, which
/// `cargo xtask test` counts.
pub fn skip(reason: &str) {
    eprintln!("skipped: {reason}");
    if let Some(log) = std::env::var_os("BTF_SKIP_LOG") {
        let file = std::fs::OpenOptions::new().create(true).append(true).open(log);
        if let Ok(mut file) = file {
            let _ = writeln!(file, "{reason}");
        }
    }
}

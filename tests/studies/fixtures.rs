//! Small captures, fitted assets, and data that may be absent: for promises and benches.

use btf_capture::{Capture, CaptureInfo, CaptureWriter, DirectionSet, ImageFormat};
use btf_fit::{FitOutcome, FitParams, Monitor, fit};
use btf_runtime::{Asset, Resident};
use btf_synth::{CaptureParams, LeafParams, write_leaf_capture};
use btf_viewer::Gpu;
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

/// Writes a capture of a plain weave, `size` x `size` texels in 8 bits, and opens it. Threads are four texels wide and
/// two alternate on top; each is curved across, has a colour of its own and a highlight that is narrow along it.
///
/// # Panics
/// If it cannot be written or read.
pub fn cloth_capture(folder: &Path, size: usize, views: &DirectionSet, lights: &DirectionSet) -> Capture {
    const THREAD: usize = 4;
    capture_of(folder, size, views, lights, ImageFormat::Png, |texel, wi, wo| {
        let [column, row] = [texel % size, texel / size];
        let is_warp = (column / THREAD + row / THREAD).is_multiple_of(2);
        // -1 to 1 across and along the part of the thread that is on top.
        let within = |place: usize| (2 * (place % THREAD) + 1) as f32 / THREAD as f32 - 1.0;
        let (across, along) = if is_warp { (within(column), within(row)) } else { (within(row), within(column)) };
        let turned = |[x, y, z]: [f32; 3]| if is_warp { [x, y, z] } else { [y, x, z] };
        let (wi, wo) = (turned(wi), turned(wo));
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let normal = [0.7 * across, 0.25 * along, 1.0];
        let normal = normal.map(|x| x / dot(normal, normal).sqrt());
        let half = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
        // Slopes of the half vector against the fibre: six times as wide across the thread as along.
        let slopes = [half[0] / half[2] - normal[0] / normal[2], half[1] / half[2] - normal[1] / normal[2]];
        let gloss = (-(slopes[0] / 0.6).powi(2) - (slopes[1] / 0.1).powi(2)).exp();
        // Every thread is dyed a little differently.
        let thread = if is_warp { column / THREAD } else { 7 + row / THREAD };
        let dye = 0.8 + 0.05 * (thread * 5 % 7) as f32;
        let colour = if is_warp { [0.35, 0.12, 0.08] } else { [0.10, 0.16, 0.34] };
        let lit = dot(normal, wi).max(0.0);
        colour.map(|c| c * dye * lit + 0.15 * gloss * wi[2])
    })
}

/// Returns parameters that fit a small capture in seconds, with the cache in `folder`.
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

/// Returns the resident form, expanded on all threads.
pub fn resident(asset: &Asset) -> Resident {
    Resident::from_asset_on(asset, &|count, work| (0..count).into_par_iter().for_each(work))
}

/// Returns the GPU for test `test`, or `None`, with a line for the skip count, where `BTF_SKIP_GPU=1` leaves it out.
///
/// # Panics
/// If no adapter answers, with how to get one.
pub fn gpu(test: &str) -> Option<Gpu> {
    if std::env::var_os("BTF_SKIP_GPU").is_some_and(|value| value == "1") {
        skip(&format!("{test} (BTF_SKIP_GPU=1)"));
        return None;
    }
    Some(Gpu::headless(None).unwrap_or_else(|error| panic!("{error}; BTF_SKIP_GPU=1 skips this test")))
}

/// Returns a file or folder of the measured data that is handed around outside of the repository, or `None` with a
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

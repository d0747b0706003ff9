//! What a library's fits will cost, told before they run.

use crate::cost::image_probe::ImageProbe;
use crate::cost::model::{CostModel, FitCost, product_gflops};
use crate::cost::work::FitWork;
use crate::error::FitError;
use crate::library::plan::{LibraryPlan, PlannedMaterial};
use crate::library::record::{
    LibraryFolders, MaterialRecord, MaterialState, Outcome, read_record, record_key, state_of,
};
use crate::library::scripts::WorkerLimits;
use crate::monitor::Monitor;
use btf_capture::Capture;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Captures whose images are timed, of those of one format and about one size; the others are taken to be alike.
const TIMED_CAPTURES: usize = 8;
/// Fits of this library from which on their times correct the estimate.
const MIN_CORRECTING: usize = 3;
/// Bytes of a record and of a material's part of the catalogue.
const RECORD_BYTES: f64 = 60_000.0;

/// Cost of a library's fits. The names are the keys of `library plan --estimate --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LibraryEstimate {
    /// Materials that are fitted already.
    pub done: usize,
    /// Materials that are still to be fitted.
    pub open: usize,
    /// Materials that have failed before: a worker tries them only with `--retry`, and they are not in the sums.
    pub failed: usize,
    /// Materials that cannot be told about, with the reason.
    pub unknown: BTreeMap<String, String>,
    /// Hours of cores that workers keep, idle ones included.
    pub core_hours: f64,
    /// Hours until all are done.
    pub hours: f64,
    /// Greatest memory of a worker, bytes.
    pub memory_bytes: f64,
    /// Bytes of all assets that are still to be written.
    pub asset_bytes: f64,
    /// Bytes of all assets where every one whose size is not given is smaller, and larger, by the factor within which two of three lie;
    /// equal where all sizes are given.
    pub asset_bytes_range: [f64; 2],
    /// Bytes of records and the catalogue.
    pub record_bytes: f64,
    /// Bytes of temporary files of all workers at a time, at most.
    pub temporary_bytes: f64,
    /// Speed of this processor in a matrix product of one thread, billions of operations a second.
    pub product_gflops: f64,
    /// Fits of this library that corrected the time; 0 where there are too few.
    pub corrected_by: usize,
    /// Factor by which these fits took longer than the constants say.
    pub correction: f64,
    /// The materials that are still to be fitted.
    pub materials: Vec<MaterialCost>,
}

/// Cost of a material.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MaterialCost {
    /// Name of the material.
    pub name: String,
    /// Hours of cores.
    pub core_hours: f64,
    /// Greatest memory, bytes.
    pub memory_bytes: f64,
    /// Size of the asset, bytes.
    pub asset_bytes: f64,
    /// Size of the temporary file, bytes.
    pub temporary_bytes: f64,
}

/// A material whose captures were looked at.
struct Known<'a> {
    material: &'a PlannedMaterial,
    state: MaterialState,
    cost: FitCost,
    /// Whether a size was asked for.
    has_size: bool,
}

/// Tells the cost of what the plan at `path` has still to be fitted by workers of `limits`, by `model`. Opens every capture and decodes a few images of
/// some.
///
/// # Errors
/// [`FitError::Interrupted`]. A capture that cannot be read is named in the result.
pub fn estimate_library(
    plan: &LibraryPlan,
    path: &Path,
    model: &CostModel,
    limits: WorkerLimits,
    monitor: &Monitor,
) -> Result<LibraryEstimate, FitError> {
    let folders = LibraryFolders::of_plan(plan, path);
    let estimator = Estimator {
        plan,
        folders: &folders,
        model,
        limits,
        product_gflops: product_gflops(),
        timed: Mutex::new(BTreeMap::new()),
    };
    let seen = AtomicUsize::new(0);
    let looked: Vec<(&PlannedMaterial, Result<Known, FitError>)> = plan
        .materials
        .par_iter()
        .map(|material| {
            monitor.report("estimate", seen.fetch_add(1, Ordering::Relaxed), plan.materials.len())?;
            Ok((material, estimator.look(material)))
        })
        .collect::<Result<_, FitError>>()?;
    let (mut unknown, mut known) = (BTreeMap::new(), Vec::new());
    let (mut done_unseen, mut failed_unseen) = (0, 0);
    for (material, looked) in looked {
        match looked {
            Ok(found) => known.push(found),
            Err(reason) => match estimator.state(material) {
                // What is done needs no capture any more.
                MaterialState::Done(_) => done_unseen += 1,
                MaterialState::Failed(_) => failed_unseen += 1,
                MaterialState::Open => {
                    unknown.insert(material.name.clone(), reason.to_string());
                }
            },
        }
    }
    let mut estimate = estimator.sum(known, unknown);
    estimate.done += done_unseen;
    estimate.failed += failed_unseen;
    Ok(estimate)
}

/// Images that take about the same time a pixel: format, and logarithm of the number of texels.
type ImageKind = (String, u32);

/// What the images of a capture took.
struct TimedImages {
    /// Seconds a pixel.
    pixel_s: f64,
    /// Bytes of a sample.
    sample_bytes: usize,
}

struct Estimator<'a> {
    plan: &'a LibraryPlan,
    folders: &'a LibraryFolders,
    model: &'a CostModel,
    limits: WorkerLimits,
    product_gflops: f64,
    /// Captures whose images were timed.
    timed: Mutex<BTreeMap<ImageKind, Vec<TimedImages>>>,
}

impl Estimator<'_> {
    /// Opens the captures of `material` and tells its cost.
    fn look<'b>(&self, material: &'b PlannedMaterial) -> Result<Known<'b>, FitError> {
        let paths = self.folders.captures(material);
        let captures = paths.iter().map(Capture::open).collect::<Result<Vec<_>, _>>()?;
        let options = self.plan.options_of(material);
        let mut params = options.params(&self.folders.assets);
        if options.memory.is_none() {
            params.memory_bytes = self.limits.fit_bytes();
        }
        params.suit(&captures, options.clusters, options.lobes);
        let params = params.check()?;
        let needs_detail = params.bytes().is_none();
        let probes = captures.iter().map(|capture| self.probe(capture, needs_detail)).collect::<Result<Vec<_>, _>>()?;
        let work = FitWork::new(&captures, &params, &probes, self.limits.threads)?;
        let cost = self.model.cost(&work, self.product_gflops, self.limits.threads, params.memory_bytes());
        Ok(Known { material, state: self.state(material), cost, has_size: work.bytes.is_some() })
    }

    /// Returns what has become of `material`.
    fn state(&self, material: &PlannedMaterial) -> MaterialState {
        let key = record_key(material, &self.plan.options_of(material));
        let record = read_record(self.folders, &material.name).filter(|record| record.key == key);
        state_of(self.folders, &material.name, record)
    }

    /// Looks at a few images of `capture`. Where only the time to decode them is wanted and captures like it are known, theirs is
    /// taken.
    fn probe(&self, capture: &Capture, needs_detail: bool) -> Result<ImageProbe, FitError> {
        let info = capture.info();
        let pixels = (info.texel_count() * info.present_pairs().count()) as f64;
        let kind = (format!("{:?} {}", info.format, capture.container().is_some()), info.texel_count().ilog2());
        if !needs_detail
            && let Ok(timed) = self.timed.lock()
            && let Some(known) = timed.get(&kind).filter(|known| known.len() >= TIMED_CAPTURES)
        {
            let decoding_s = known.iter().map(|timed| timed.pixel_s).sum::<f64>() / known.len() as f64 * pixels;
            return Ok(ImageProbe { decoding_s, detail: 1.0, sample_bytes: known[0].sample_bytes });
        }
        let probe = ImageProbe::of_capture(capture)?;
        if let Ok(mut timed) = self.timed.lock() {
            timed
                .entry(kind)
                .or_default()
                .push(TimedImages { pixel_s: probe.decoding_s / pixels.max(1.0), sample_bytes: probe.sample_bytes });
        }
        Ok(probe)
    }

    fn sum(&self, known: Vec<Known>, unknown: BTreeMap<String, String>) -> LibraryEstimate {
        let done: Vec<(&Known, &MaterialRecord)> = known
            .iter()
            .filter_map(|known| match &known.state {
                MaterialState::Done(record) => Some((known, &**record)),
                _ => None,
            })
            .collect();
        let open: Vec<&Known> = known.iter().filter(|known| known.state == MaterialState::Open).collect();
        let failed = known.len() - done.len() - open.len();
        let times = done
            .iter()
            .filter(|(_, record)| record.processor_s > 0.0)
            .map(|(known, record)| record.processor_s / known.cost.processor_s.max(1e-9));
        let time = Correction::of(times.collect()).unwrap_or_default();
        let sizes = done.iter().filter(|(known, _)| !known.has_size).filter_map(|(known, record)| {
            let Outcome::Fitted(fitted) = &record.outcome else { return None };
            Some(fitted.bytes as f64 / known.cost.asset_bytes.max(1.0))
        });
        let unsure = Correction { deviation: self.model.bytes_deviation, ..Correction::default() };
        let size = Correction::of(sizes.collect()).unwrap_or(unsure);

        let threads = self.limits.threads.max(1);
        let materials: Vec<MaterialCost> = open
            .iter()
            .map(|known| MaterialCost {
                name: known.material.name.clone(),
                core_hours: time.factor * known.cost.core_seconds(threads) / 3600.0,
                memory_bytes: known.cost.memory_bytes,
                asset_bytes: known.cost.asset_bytes * if known.has_size { 1.0 } else { size.factor },
                temporary_bytes: known.cost.temporary_bytes,
            })
            .collect();
        // The sum of nothing is -0.
        let total = |of: &dyn Fn(&MaterialCost) -> f64| materials.iter().map(of).sum::<f64>() + 0.0;
        let greatest = |of: &dyn Fn(&MaterialCost) -> f64| materials.iter().map(of).fold(0.0, f64::max);
        let core_hours = total(&|material| material.core_hours);
        let workers = self.limits.workers.clamp(1, materials.len().max(1));
        let asset_bytes = total(&|material| material.asset_bytes);
        let unsized_bytes: f64 = open
            .iter()
            .zip(&materials)
            .filter(|(known, _)| !known.has_size)
            .map(|(_, material)| material.asset_bytes)
            .sum();
        let end = |sign: f64| asset_bytes + unsized_bytes * ((sign * size.deviation).exp() - 1.0);
        LibraryEstimate {
            done: done.len(),
            open: open.len(),
            failed,
            unknown,
            core_hours,
            hours: (core_hours / (workers * threads) as f64)
                .max(greatest(&|material| material.core_hours) / threads as f64),
            memory_bytes: greatest(&|material| material.memory_bytes),
            asset_bytes,
            asset_bytes_range: [end(-1.0), end(1.0)],
            record_bytes: RECORD_BYTES * materials.len() as f64,
            temporary_bytes: workers as f64 * greatest(&|material| material.temporary_bytes),
            product_gflops: self.product_gflops,
            corrected_by: time.fits,
            correction: time.factor,
            materials,
        }
    }
}

/// What fits of the library say about an estimate.
#[derive(Debug, Clone, Copy)]
struct Correction {
    /// Number of fits.
    fits: usize,
    /// Median of truth over estimate.
    factor: f64,
    /// Standard deviation of the logarithm of truth over estimate.
    deviation: f64,
}

impl Default for Correction {
    /// Returns what no fit says.
    fn default() -> Correction {
        Correction { fits: 0, factor: 1.0, deviation: 0.0 }
    }
}

impl Correction {
    /// Returns what `ratios` of truth over estimate say; `None` where they are too few.
    fn of(mut ratios: Vec<f64>) -> Option<Correction> {
        if ratios.len() < MIN_CORRECTING {
            return None;
        }
        ratios.sort_by(f64::total_cmp);
        let factor = ratios[ratios.len() / 2];
        let squares: f64 = ratios.iter().map(|ratio| (ratio / factor).max(1e-9).ln().powi(2)).sum();
        Some(Correction { fits: ratios.len(), factor, deviation: (squares / ratios.len() as f64).sqrt() })
    }
}

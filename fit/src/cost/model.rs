//! The measured constants by which the work of a fit becomes seconds and bytes.

use crate::cost::work::{FitWork, Recipe};
use crate::error::FitError;
use btf_capture::toml_text::{bounded_text, line_and_reason};
use ndarray::Array2;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// Version of the file.
pub(super) const VERSION: u32 = 1;
/// Largest file that is read.
const MAX_BYTES: u64 = 1 << 20;
/// The constants that come with the program, made by `cargo xtask cost`.
const BUILT_IN: &str = include_str!("cost.toml");
/// Rows, inner length and columns of the product that a processor's speed is told by, as in a fit of Bonn's directions.
const PRODUCT: [usize; 3] = [256, 4096, 320];
/// Products of which the quickest counts.
const PRODUCTS: usize = 12;

/// Constants of the fitter on a processor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CostModel {
    /// Version of the file.
    pub(super) version: u32,
    /// Number of fits that the constants come from.
    pub fits: usize,
    /// Speed of the processor that they were measured on, billions of operations a second in a matrix product of one thread.
    pub product_gflops: f64,
    /// Constants of each stage and recipe: seconds for each of [`FitWork::quantities`].
    pub(super) stages: BTreeMap<String, BTreeMap<Recipe, StageConstants>>,
    /// Share of each of [`FitWork::memory_parts`] that is in use at the peak.
    pub(super) memory: Vec<f64>,
    /// Constants of the natural logarithm of the bytes a texel where a PSNR is asked for: 1, the PSNR in dB, the logarithms of the number
    /// of pairs, of the number of texels and of the detail.
    pub(super) bytes_for_psnr: Vec<f64>,
    /// Bytes a texel of an asset without a goal.
    pub(super) bytes_without_goal: f64,
    /// Standard deviation of the natural logarithm of the bytes of assets whose size is not given.
    pub bytes_deviation: f64,
}

/// Constants of a stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StageConstants {
    /// Seconds of all processors.
    pub processor: Vec<f64>,
    /// Seconds in which one thread works alone.
    pub alone: Vec<f64>,
}

/// Cost of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct FitCost {
    /// Processor time of all threads, seconds.
    pub processor_s: f64,
    /// Seconds in which one thread works alone.
    pub alone_s: f64,
    /// Greatest memory, bytes.
    pub memory_bytes: f64,
    /// Size of the asset, bytes.
    pub asset_bytes: f64,
    /// Size of the file of decoded images, bytes; 0 where memory holds them.
    pub temporary_bytes: f64,
}

impl FitCost {
    /// Returns the seconds that the fit takes on `threads` threads with a processor core each.
    pub fn seconds(&self, threads: usize) -> f64 {
        self.alone_s + (self.processor_s - self.alone_s).max(0.0) / threads as f64
    }

    /// Returns the seconds of cores that the fit keeps on `threads` threads, the idle ones included.
    pub fn core_seconds(&self, threads: usize) -> f64 {
        self.seconds(threads) * threads as f64
    }
}

impl CostModel {
    /// Returns the constants that come with the program.
    ///
    /// # Errors
    /// Never, unless the file that is built in is damaged.
    pub fn built_in() -> Result<CostModel, FitError> {
        CostModel::from_text(BUILT_IN, Path::new("cost.toml"))
    }

    /// Reads constants that `btf-fit bench cost` wrote.
    ///
    /// # Errors
    /// A file that cannot be read or is something else, one sentence.
    pub fn read(path: &Path) -> Result<CostModel, FitError> {
        let refuse = |reason: String| FitError::Library(format!("{} {reason}", path.display()));
        CostModel::from_text(&bounded_text(path, MAX_BYTES, "a table of costs").map_err(refuse)?, path)
    }

    fn from_text(text: &str, path: &Path) -> Result<CostModel, FitError> {
        let wrong = |reason: String| {
            FitError::Library(format!("{} {reason}; write it anew with `btf-fit bench cost`", path.display()))
        };
        let model: CostModel = toml::from_str(text).map_err(|error| {
            let (line, reason) = line_and_reason(text, &error);
            wrong(format!("line {line}: {reason}"))
        })?;
        if model.version != VERSION {
            return Err(wrong(format!("has version {}, and this program reads version {VERSION}", model.version)));
        }
        model.check().map_err(wrong)?;
        Ok(model)
    }

    /// Returns a verb phrase about the first fault of the numbers.
    fn check(&self) -> Result<(), String> {
        let is_amount = |number: &f64| number.is_finite() && *number >= 0.0;
        let work = FitWork::sample();
        for (stage, recipes) in &self.stages {
            for StageConstants { processor, alone } in recipes.values() {
                let count = work.quantities(stage, 0.0).len();
                if [processor, alone].iter().any(|list| list.len() != count || !list.iter().all(is_amount)) {
                    return Err(format!("gives the stage {stage} other than {count} numbers from 0 on"));
                }
            }
        }
        let amounts = [self.product_gflops, self.bytes_without_goal, self.bytes_deviation];
        let sizes = &self.bytes_for_psnr;
        let sound = self.memory.len() == work.memory_parts(1, 0).len()
            && self.memory.iter().chain(&amounts).all(is_amount)
            && self.product_gflops > 0.0
            && sizes.len() == SIZE_QUANTITIES
            && sizes.iter().all(|number| number.is_finite());
        if sound { Ok(()) } else { Err("has too few or odd numbers for memory, sizes or the processor".into()) }
    }

    /// Takes from `known` what this table lacks, as measured on a processor of another speed.
    pub fn completed_by(mut self, known: &CostModel) -> CostModel {
        let slower = known.product_gflops / self.product_gflops.max(1e-3);
        for (stage, recipes) in &known.stages {
            for (recipe, constants) in recipes {
                let scaled = |list: &[f64]| list.iter().map(|number| slower * number).collect();
                let own = self.stages.entry(stage.clone()).or_default();
                own.entry(*recipe).or_insert_with(|| StageConstants {
                    processor: scaled(&constants.processor),
                    alone: scaled(&constants.alone),
                });
            }
        }
        if self.memory.is_empty() {
            self.memory.clone_from(&known.memory);
        }
        if self.bytes_for_psnr.is_empty() {
            self.bytes_for_psnr.clone_from(&known.bytes_for_psnr);
            self.bytes_deviation = known.bytes_deviation;
        }
        if self.bytes_without_goal <= 0.0 {
            self.bytes_without_goal = known.bytes_without_goal;
        }
        self
    }

    /// Returns the constants as a file's text.
    pub fn to_toml(&self) -> String {
        format!(
            "# Constants of a fit's cost, by which `btf-fit library plan --estimate` tells hours before they are spent. Written by\n\
             # `btf-fit bench cost`; the quantities behind the numbers are in fit/src/cost/work.rs.\n{}",
            toml::to_string(self).unwrap_or_default()
        )
    }

    /// Returns the cost of `work` on `threads` threads of a processor of `product_gflops` ([`product_gflops`]), with a memory limit
    /// of `limit` bytes.
    pub fn cost(&self, work: &FitWork, product_gflops: f64, threads: usize, limit: u64) -> FitCost {
        let slower = self.product_gflops / product_gflops.max(1e-3);
        let (asset_bytes, mut sums) = (self.asset_bytes(work), [0.0; 2]);
        for stage in work.stages() {
            let [all, decoding] = self.stage_seconds(work, stage, asset_bytes);
            // Decoding was timed on this processor, the rest on another one.
            for (sum, (all, decoding)) in sums.iter_mut().zip(all.into_iter().zip(decoding)) {
                *sum += decoding + slower * (all - decoding);
            }
        }
        let parts = work.memory_parts(threads, limit);
        let images = 3.0 * work.pairs as f64 * (work.texels * work.sample_bytes) as f64;
        FitCost {
            processor_s: sums[0],
            alone_s: sums[1].min(sums[0]),
            memory_bytes: parts.iter().zip(&self.memory).map(|(part, share)| part * share).sum(),
            asset_bytes,
            temporary_bytes: if work.in_file { images / work.layers as f64 } else { 0.0 },
        }
    }

    /// Returns the seconds of `stage` on the processor of the constants, of all processors and of one alone: all, and those that
    /// are decoding.
    fn stage_seconds(&self, work: &FitWork, stage: &str, bytes: f64) -> [[f64; 2]; 2] {
        let Some(constants) = self.stages.get(stage).and_then(|recipes| recipes.get(&work.recipe)) else {
            return [[0.0; 2]; 2];
        };
        let quantities = work.quantities(stage, bytes);
        let both = [&constants.processor, &constants.alone];
        let all = both.map(|constants| constants.iter().zip(&quantities).map(|(c, q)| c * q).sum());
        let decoding = FitWork::decoding_quantity(stage).map(|at| both.map(|constants| constants[at] * quantities[at]));
        [all, decoding.unwrap_or_default()]
    }

    fn asset_bytes(&self, work: &FitWork) -> f64 {
        if let Some(bytes) = work.bytes {
            return bytes as f64;
        }
        let texels = (work.texels * work.layers) as f64;
        match size_quantities(work) {
            Some(quantities) => {
                let sum: f64 = quantities.iter().zip(&self.bytes_for_psnr).map(|(q, c)| q * c).sum();
                texels * sum.exp()
            }
            None => texels * self.bytes_without_goal,
        }
    }
}

/// Numbers that the logarithm of an asset's size is a sum of.
pub(super) const SIZE_QUANTITIES: usize = 5;

/// Returns what the logarithm of the bytes a texel is a sum of where a PSNR is asked for.
pub(super) fn size_quantities(work: &FitWork) -> Option<[f64; SIZE_QUANTITIES]> {
    let pairs = work.pairs as f64 / work.layers as f64;
    work.psnr_db.map(|db| [1.0, db, pairs.ln(), (work.texels as f64).ln(), work.detail.ln()])
}

/// Returns the speed of one thread of this processor in a matrix product in single precision, billions of operations a second.
/// Takes some tens of milliseconds.
pub fn product_gflops() -> f64 {
    let [rows, inner, columns] = PRODUCT;
    let value = |i: usize, j: usize| ((i * 31 + j * 17) % 97) as f32 / 97.0;
    let a = Array2::from_shape_fn((rows, inner), |(i, j)| value(i, j));
    let b = Array2::from_shape_fn((inner, columns), |(i, j)| value(j, i));
    let quickest = (0..PRODUCTS).fold(f64::INFINITY, |quickest, _| {
        let start = Instant::now();
        std::hint::black_box(a.dot(&b));
        quickest.min(start.elapsed().as_secs_f64())
    });
    2e-9 * (rows * inner * columns) as f64 / quickest.max(1e-9)
}

//! What a fit has to do, as far as it shows before images are decoded, and the quantities that its stages take time for.

use crate::cost::image_probe::ImageProbe;
use crate::error::FitError;
use crate::numeric::principal_directions::{OVERSAMPLING, ROW_BLOCK};
use crate::params::{Goal, ValidFitParams};
use crate::pipeline::memory_plan::{DICTIONARY_PAIRS, FEATURE_DIMENSIONS, Surroundings, plan_memory, shared_bases};
use crate::pipeline::prepare_layer::{GUIDE_PAIRS, MEAN_SAMPLE};
use crate::priors::predict::{MAX_WHOLE, predicting_pairs};
use btf_capture::Capture;
use btf_runtime::MAX_COMPONENTS;
use serde::{Deserialize, Serialize};

/// Number of pairs that colour differences and the mean are taken over, about.
const SOME_PAIRS: f64 = 256.0;
/// Functions of priors for each seen pair that the cost of a prediction is told by, about.
const PRIOR_FUNCTIONS: f64 = 100.0;

/// What a fit has to do.
#[derive(Debug, Clone, PartialEq)]
pub struct FitWork {
    /// Number of texels.
    pub texels: usize,
    /// Number of views and of lights of the first layer.
    pub directions: [usize; 2],
    /// Number of layers.
    pub layers: usize,
    /// Pairs of all layers, those without an image included.
    pub pairs: usize,
    /// Pairs of all layers that have no image.
    pub missing: usize,
    /// Bytes in which a sample of a decoded image is kept.
    pub sample_bytes: usize,
    /// Shared bases that are looked for in a layer.
    pub shared_bases: usize,
    /// Texels that shared bases are found from.
    pub sample: usize,
    /// Clusters of a layer.
    pub clusters: usize,
    /// Bytes that the asset may have; `None` with another goal.
    pub bytes: Option<u64>,
    /// PSNR that is asked for, dB.
    pub psnr_db: Option<f64>,
    /// How the lobes are fitted.
    pub recipe: Recipe,
    /// Whether the weights of lobes follow from the residual's coefficients.
    pub predicts_lobes: bool,
    /// Whether heights are looked for.
    pub heights: bool,
    /// Whether decoded images lie in a file, because memory does not hold them.
    pub in_file: bool,
    /// Processor time to decode all images once, seconds.
    pub decoding_s: f64,
    /// Difference between neighbouring texels ([`ImageProbe::detail`]).
    pub detail: f64,
}

/// The way that a fit goes, on which it depends what a stage does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Recipe {
    /// Every texel stores lobes of its own.
    Stored,
    /// A size is given.
    Bytes,
    /// An error is given.
    Psnr,
}

impl FitWork {
    /// Returns the work of fitting `captures` with `params`, of which a few images were looked at, on `threads` threads.
    ///
    /// # Errors
    /// [`FitError::Memory`] where the memory does not suffice.
    pub fn new(
        captures: &[Capture],
        params: &ValidFitParams,
        probes: &[ImageProbe],
        threads: usize,
    ) -> Result<FitWork, FitError> {
        let info = captures[0].info();
        let texels = info.texel_count();
        let plan = plan_memory(info, params, Surroundings { waiting: captures.len() - 1, threads, gpu: false })?;
        let sample_bytes = probes.iter().map(|probe| probe.sample_bytes).max().unwrap_or(1);
        let missing = captures.iter().map(|capture| capture.info().missing.len()).sum();
        let samples = 3 * info.pair_count();
        Ok(FitWork {
            texels,
            directions: [info.views.len(), info.lights.len()],
            layers: captures.len(),
            pairs: captures.iter().map(|capture| capture.info().pair_count()).sum(),
            missing,
            sample_bytes,
            shared_bases: shared_bases(params, texels).min(samples).min(texels),
            sample: plan.sample,
            clusters: params.clusters().min(texels),
            bytes: params.bytes(),
            psnr_db: params.asked().psnr_db,
            recipe: match params.goal() {
                _ if params.stores_lobes() => Recipe::Stored,
                Goal::PsnrDb(_) => Recipe::Psnr,
                _ => Recipe::Bytes,
            },
            predicts_lobes: params.predicts_lobes(),
            // They are found from all images of a view.
            heights: params.finds_heights() && missing == 0,
            in_file: plan.cache_bytes < (texels * samples * sample_bytes) as u64,
            decoding_s: probes.iter().map(|probe| probe.decoding_s).sum(),
            detail: probes.iter().map(|probe| probe.detail).sum::<f64>() / probes.len().max(1) as f64,
        })
    }

    /// Returns some work, to count quantities of.
    pub(super) fn sample() -> FitWork {
        FitWork {
            texels: 1,
            directions: [1, 1],
            layers: 1,
            pairs: 1,
            missing: 0,
            sample_bytes: 1,
            shared_bases: 1,
            sample: 1,
            clusters: 1,
            bytes: None,
            psnr_db: None,
            recipe: Recipe::Bytes,
            predicts_lobes: false,
            heights: false,
            in_file: false,
            decoding_s: 0.0,
            detail: 1.0,
        }
    }

    /// Returns the names of the stages of this fit, and last `other`: what it does between them.
    pub fn stages(&self) -> Vec<&'static str> {
        let runs = |stage: &&str| match *stage {
            "leave-out" => self.missing > 0,
            "heights" => self.heights,
            "relief" => self.heights && self.predicts_lobes,
            "predict" => self.predicts_lobes,
            _ => true,
        };
        STAGES.into_iter().filter(runs).collect()
    }

    /// Returns which of the quantities of `stage` are seconds of decoding, which are timed where the cost is told.
    pub fn decoding_quantity(stage: &str) -> Option<usize> {
        match stage {
            "read" => Some(0),
            "measure" => Some(4),
            _ => None,
        }
    }

    /// Returns the quantities that the time of `stage` is a sum of, in billions of operations each: what its loops run over.
    /// `bytes` is the size of the asset.
    pub fn quantities(&self, stage: &str, bytes: f64) -> Vec<f64> {
        let [views, lights] = self.directions.map(|count| count as f64);
        let (texels, pairs, layers) = (self.texels as f64, self.pairs as f64, self.layers as f64);
        let pairs_a_layer = pairs / layers;
        let values = 3.0 * pairs_a_layer;
        let (bases, sample, clusters) = (self.shared_bases as f64, self.sample as f64, self.clusters as f64);
        let components = bases.min(MAX_COMPONENTS as f64);
        let wide = (bases + OVERSAMPLING as f64).min(sample);
        let halves = if self.sample_bytes == 2 { 1.0 } else { 0.0 };
        let once = 1e6 * layers;
        let missing = self.missing as f64 / layers;
        let seen = pairs_a_layer - missing;
        let all: Vec<f64> = match stage {
            // Decoding is in seconds already.
            "read" => vec![1e9 * self.decoding_s, texels * pairs, once],
            "leave-out" => vec![
                1e9 * layers,
                layers * missing * seen,
                layers * seen * seen.min(MAX_WHOLE as f64) * PRIOR_FUNCTIONS,
            ],
            "project" => vec![
                layers * sample * values * wide,
                layers * texels * values * bases,
                layers * (sample + texels) * values,
                layers * (sample + texels) * values * halves,
                layers * (bases * bases * values + bases.powi(3)),
                3.0 * layers * (sample + texels) * missing * predicting_pairs(seen as usize) as f64,
                once,
            ],
            "cluster" => vec![
                layers * texels * clusters * FEATURE_DIMENSIONS as f64,
                layers * texels * bases,
                layers * clusters * (FEATURE_DIMENSIONS as f64).powi(3),
                once,
            ],
            "dictionary" => {
                let most = if self.recipe == Recipe::Stored { DICTIONARY_PAIRS } else { GUIDE_PAIRS };
                let some = pairs_a_layer.min(most as f64);
                vec![layers * some, layers * clusters * some, layers * clusters * values, once]
            }
            "weights" => {
                vec![
                    layers * clusters * values,
                    layers * MEAN_SAMPLE as f64 * values,
                    texels * pairs,
                    layers * texels,
                    once,
                ]
            }
            "residual" => vec![
                layers * bases * pairs_a_layer * (views + lights),
                layers * (views.powi(3) + lights.powi(3)),
                layers * texels * bases * bases,
                layers * clusters * bases.powi(3),
                layers * texels * values * bases * if self.recipe == Recipe::Stored { 1.0 } else { 0.0 },
                once,
            ],
            "predict" => {
                vec![layers * sample, layers * sample * values, layers * values * bases, layers * texels * bases, once]
            }
            "encode" => vec![
                layers * texels * bases,
                layers * texels,
                bytes,
                layers * clusters * components * values,
                layers * values * bases,
                once,
            ],
            "energy" => vec![
                layers * texels * SOME_PAIRS,
                layers * values * bases,
                layers * clusters * components * values,
                once,
            ],
            "measure" => vec![
                texels * pairs,
                layers * texels * SOME_PAIRS,
                layers * values * bases,
                layers * clusters * components * values,
                1e9 * self.decoding_s * if self.in_file { 1.0 } else { 0.0 },
                once,
            ],
            "heights" => vec![texels * pairs, layers * texels, once],
            "relief" => vec![layers * texels, layers * texels * bases, once],
            _ => vec![layers * texels, bytes, layers * values * bases, once],
        };
        all.into_iter().map(|operations| 1e-9 * operations).collect()
    }

    /// Returns the parts of a fit that take memory, in bytes, with `threads` threads and a limit of `limit` bytes.
    pub fn memory_parts(&self, threads: usize, limit: u64) -> Vec<f64> {
        let (texels, layers) = (self.texels as f64, self.layers as f64);
        let values = 3.0 * self.pairs as f64 / layers;
        let (bases, clusters) = (self.shared_bases as f64, self.clusters as f64);
        let images = (texels * values * self.sample_bytes as f64).min(if self.in_file { 0.0 } else { limit as f64 });
        vec![
            images,
            4.0 * layers * texels * bases,
            4.0 * layers * values * bases,
            4.0 * clusters * values,
            (self.sample_bytes * self.sample) as f64 * values,
            1000.0 * layers * texels,
            1e6 * threads as f64,
            4.0 * ROW_BLOCK as f64 * values * threads as f64,
            1e6,
        ]
    }
}

/// What a fit does between its stages.
pub const OTHER: &str = "other";
/// The stages of a fit in order.
const STAGES: [&str; 14] = [
    "read",
    "leave-out",
    "project",
    "cluster",
    "dictionary",
    "weights",
    "residual",
    "predict",
    "heights",
    "encode",
    "energy",
    "relief",
    "measure",
    OTHER,
];

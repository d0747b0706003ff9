//! What a fit is asked for.

use crate::error::FitError;
use btf_runtime::{MAX_LOG, ROOT, ResidualKind};
use std::path::PathBuf;

/// Largest number of half precision.
pub(crate) const MAX_HALF: f32 = 65504.0;

/// The error that a fit minimises.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorMeasure {
    /// Gamma-encoded values, as `psnr_db` counts them: root residual.
    Gamma,
    /// Linear values: additive residual.
    Linear,
    /// Relative values: log residual.
    Log,
}

impl ErrorMeasure {
    /// The residual's curve and its epsilon.
    pub fn residual(self) -> (ResidualKind, f32) {
        match self {
            ErrorMeasure::Gamma => (ResidualKind::Root, 0.003),
            ErrorMeasure::Linear => (ResidualKind::Additive, 0.001),
            ErrorMeasure::Log => (ResidualKind::Log, 0.01),
        }
    }

    /// The largest sample that an asset can hold whose residual alone must carry it: a decoder keeps bases in half
    /// precision and ends the log curve at [`MAX_LOG`].
    pub fn most(self) -> f32 {
        match self {
            ErrorMeasure::Gamma => MAX_HALF.powf(ROOT),
            ErrorMeasure::Linear => MAX_HALF,
            ErrorMeasure::Log => MAX_LOG.exp(),
        }
    }
}

/// Which k-means runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KMeansEngine {
    /// Matrix-product Lloyd with greedy k-means++ seeding (default).
    Product,
    /// linfa-clustering's, single run.
    Linfa,
}

/// What is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct FitParams {
    /// Largest asset in bytes.
    pub bytes: Option<u64>,
    /// Least `psnr_db`; the smallest asset that reaches it is chosen.
    pub psnr_db: Option<f64>,
    /// Clusters, 1 to 256.
    pub clusters: usize,
    /// Most lobes per texel, 0 to 32.
    pub lobes: usize,
    /// Residual components, 0 to 64; `None`: what the budget gives, else 8.
    pub components: Option<usize>,
    /// Peak memory in bytes.
    pub memory_bytes: u64,
    /// Error to minimise.
    pub error: ErrorMeasure,
    /// Share of the direction pairs that is held back, 0 to 0.9.
    pub leave_out: f64,
    /// Find the texels' heights and store them, where they predict steep views.
    pub heights: bool,
    /// Seed of every random choice.
    pub seed: u64,
    /// Which k-means.
    pub kmeans: KMeansEngine,
    /// Folder for the temporary cache.
    pub cache_directory: PathBuf,
    /// Folder in which the results of finished stages are kept and looked for; `None` keeps nothing.
    pub resume: Option<PathBuf>,
}

impl Default for FitParams {
    fn default() -> FitParams {
        FitParams {
            bytes: None,
            psnr_db: None,
            clusters: 32,
            lobes: 8,
            components: None,
            memory_bytes: 4_000_000_000,
            error: ErrorMeasure::Gamma,
            leave_out: 0.0,
            heights: false,
            seed: 1,
            kmeans: KMeansEngine::Product,
            cache_directory: PathBuf::from("."),
            resume: None,
        }
    }
}

impl FitParams {
    /// The clusters that a fit of `texels` texels a layer does best with when it may spend `bytes` on each layer: with
    /// less than 2 bytes a texel, ids of 32 clusters take bytes that coefficients use better.
    pub fn clusters_for(bytes: Option<u64>, texels: usize) -> usize {
        if bytes.is_some_and(|bytes| bytes < 2 * texels as u64) { 16 } else { FitParams::default().clusters }
    }

    /// Checks every range.
    pub fn check(&self) -> Result<(), FitError> {
        let refuse = |text: &str| Err(FitError::Params(text.to_string()));
        if !(1..=256).contains(&self.clusters) {
            return refuse("--clusters must be 1 to 256");
        }
        if self.lobes > 32 {
            return refuse("--lobes must be 0 to 32");
        }
        if self.components.is_some_and(|components| components > 64) {
            return refuse("--components must be 0 to 64");
        }
        if !(0.0..=0.9).contains(&self.leave_out) {
            return refuse("--leave-out must be 0 to 0.9");
        }
        if self.bytes.is_some() && self.psnr_db.is_some() {
            return refuse("--bytes and --psnr ask for two different things; give one of them");
        }
        if self.psnr_db.is_some_and(|db| !(5.0..=80.0).contains(&db)) {
            return refuse("--psnr must be 5 to 80 (dB)");
        }
        Ok(())
    }
}

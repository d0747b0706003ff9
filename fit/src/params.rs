//! What a fit is asked for.

use crate::error::FitError;
use crate::gpu::device::GpuChoice;
use btf_capture::Capture;
use btf_runtime::{LobeRole, MAX_COMPONENTS, MAX_LOG, ROOT, ResidualKind};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Largest number of half precision.
pub(crate) const MAX_HALF: f32 = 65504.0;
/// Residual components at most without a goal.
const DEFAULT_COMPONENTS: usize = 8;
/// Lobes of a cluster whose weights follow from the coefficients: 8 give 0.08 dB more at random directions
/// (leather of 2 MB) and take time in every evaluation.
const PREDICTED_LOBES: usize = 4;
/// Bytes that such a lobe takes in the file: itself 20, its weights 10 and a share of what sections cost.
const BYTES_PER_PREDICTED_LOBE: f64 = 32.0;
/// Share of the bytes that such lobes may take.
const PREDICTED_LOBE_SHARE: f64 = 0.025;

/// The error that a fit minimises.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ErrorMeasure {
    /// Error of gamma-encoded values, as `psnr_db` counts them: root residual.
    Gamma,
    /// Error of linear values: additive residual.
    Linear,
    /// Relative error: log residual.
    Log,
}

impl ErrorMeasure {
    /// Returns the residual's curve and its epsilon.
    pub fn residual(self) -> (ResidualKind, f32) {
        match self {
            ErrorMeasure::Gamma => (ResidualKind::Root, 0.003),
            ErrorMeasure::Linear => (ResidualKind::Additive, 0.001),
            ErrorMeasure::Log => (ResidualKind::Log, 0.01),
        }
    }

    /// Returns what is minimised, in words.
    pub fn words(self) -> &'static str {
        match self {
            ErrorMeasure::Gamma => "error of gamma-encoded values",
            ErrorMeasure::Linear => "error of linear values",
            ErrorMeasure::Log => "relative error",
        }
    }

    /// Returns the largest sample that an asset can hold whose residual alone must carry it: a decoder keeps bases in
    /// half precision and ends the log curve at [`MAX_LOG`].
    pub fn most(self) -> f32 {
        match self {
            ErrorMeasure::Gamma => MAX_HALF.powf(ROOT),
            ErrorMeasure::Linear => MAX_HALF,
            ErrorMeasure::Log => MAX_LOG.exp(),
        }
    }
}

/// Role of the lobes: whether the residual holds the whole value or what the lobes leave.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// The residual holds the whole value. Each cluster has one set of lobes, which guides interpolation, sampling and
    /// editing and adds nothing to the value.
    Guide,
    /// Each texel has lobes of its own, and the residual is what they leave. With a size or a PSNR as goal their weights
    /// follow from the residual's coefficients, else each texel stores its own.
    Base,
}

impl Role {
    /// Returns the role as a layer of an asset stores it.
    pub(crate) fn of_layer(self) -> LobeRole {
        match self {
            Role::Guide => LobeRole::Guide,
            Role::Base => LobeRole::Base,
        }
    }
}

impl From<LobeRole> for Role {
    fn from(role: LobeRole) -> Role {
        match role {
            LobeRole::Guide => Role::Guide,
            LobeRole::OldBase | LobeRole::Base => Role::Base,
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
    /// Product's in two levels, the finer clusters within the coarser; texels are not moved to other clusters later.
    Levels,
}

/// Assets that tell what materials have in common.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Priors {
    /// The priors that come with the program.
    #[default]
    BuiltIn,
    /// Assets of the user's; without any, nothing is known but that near directions look alike.
    Assets(Vec<PathBuf>),
}

impl Priors {
    /// Returns the files of the assets; none for those that come with the program.
    pub fn files(&self) -> &[PathBuf] {
        match self {
            Priors::BuiltIn => &[],
            Priors::Assets(paths) => paths,
        }
    }
}

/// Goal of a fit: a size, a PSNR, or neither.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// Neither a size nor an error: 8 components and a fine step.
    None,
    /// The least error within so many bytes.
    Bytes(u64),
    /// The smallest asset with this `psnr_db` at least.
    PsnrDb(f64),
}

/// Parameters of a fit as the user gives them. [`FitParams::check`] makes parameters of them that [`crate::fit()`] runs
/// with.
#[derive(Debug, Clone, PartialEq)]
pub struct FitParams {
    /// Largest asset in bytes.
    pub bytes: Option<u64>,
    /// Least `psnr_db`; the smallest asset that reaches it is chosen.
    pub psnr_db: Option<f64>,
    /// Clusters, 1 to 256.
    pub clusters: usize,
    /// Most lobes of a texel ([`Role::Base`]) or of a cluster ([`Role::Guide`]), 0 to 32.
    pub lobes: usize,
    /// What lobes are to the residual; `None`: [`Role::Base`].
    pub role: Option<Role>,
    /// Residual components, 0 to 128; `None`: what the goal gives, 8 without a goal.
    pub components: Option<usize>,
    /// Peak memory in bytes.
    pub memory_bytes: u64,
    /// Error to minimise; `None`: chosen from the captures.
    pub error: Option<ErrorMeasure>,
    /// Share of the direction pairs that is held back, 0 to 0.9.
    pub leave_out: f64,
    /// What predicts pairs that are held back or have no image.
    pub priors: Priors,
    /// Whether a capture in bands is fitted as colours under D65.
    pub colours: bool,
    /// Whether to find the texels' heights and store them, where they predict steep views.
    pub heights: bool,
    /// Seed of every random choice.
    pub seed: u64,
    /// Which k-means.
    pub kmeans: KMeansEngine,
    /// Adapter that multiplies matrices where it is quicker than the CPU. The asset then differs by rounding.
    pub gpu: GpuChoice,
    /// Folder for the temporary cache.
    pub cache_directory: PathBuf,
    /// Folder in which the results of finished stages are kept and looked for; `None` keeps nothing.
    pub resume: Option<PathBuf>,
}

/// Texels that a cluster has on average at least, where there are more than [`MIN_CLUSTERS`]. Layered pebbles of 96 x 96
/// texels in 300 kB have 29.6, 29.1 and 28.5 dB with 8, 16 and 32 clusters.
const MIN_CLUSTER_TEXELS: usize = 1024;
/// Least number of clusters of a fit with a goal.
const MIN_CLUSTERS: usize = 4;
/// Largest number of clusters where a file has less than a byte a texel.
const MAX_SMALL_CLUSTERS: usize = 16;

impl Default for FitParams {
    fn default() -> FitParams {
        FitParams {
            bytes: None,
            psnr_db: None,
            clusters: 32,
            lobes: 8,
            role: None,
            components: None,
            memory_bytes: 4_000_000_000,
            error: None,
            leave_out: 0.0,
            priors: Priors::BuiltIn,
            colours: false,
            heights: false,
            seed: 1,
            kmeans: KMeansEngine::Product,
            gpu: GpuChoice::Off,
            cache_directory: PathBuf::from("."),
            resume: None,
        }
    }
}

impl FitParams {
    /// Returns whether a size or an error is asked for.
    fn has_goal(&self) -> bool {
        self.bytes.is_some() || self.psnr_db.is_some()
    }

    /// Returns the clusters that a fit of `texels` texels a layer does best with. With a goal in bytes or in dB a cluster has
    /// to share its mixtures of bases among a thousand texels; and where `bytes` for each layer are less than a byte a
    /// texel, ids of more than 16 clusters take bytes that coefficients use better.
    pub fn clusters_for(&self, bytes: Option<u64>, texels: usize) -> usize {
        let most = FitParams::default().clusters;
        if !self.has_goal() {
            return most;
        }
        let most = if bytes.is_some_and(|bytes| bytes < texels as u64) { MAX_SMALL_CLUSTERS } else { most };
        (texels / MIN_CLUSTER_TEXELS).clamp(MIN_CLUSTERS, most)
    }

    /// Returns the most lobes that a fit should have whose layers have `clusters` clusters and may take `bytes` each,
    /// `None` for any size: where a file is small, so few, at least 1, that they take at most 2.5 % of it.
    pub fn lobes_for(&self, bytes: Option<u64>, clusters: usize) -> usize {
        if !self.has_goal() || self.role == Some(Role::Guide) {
            return FitParams::default().lobes;
        }
        let affordable = bytes.map_or(f64::INFINITY, |bytes| {
            PREDICTED_LOBE_SHARE * bytes as f64 / (BYTES_PER_PREDICTED_LOBE * clusters.max(1) as f64)
        });
        (affordable as usize).clamp(1, PREDICTED_LOBES)
    }

    /// Sets the numbers of clusters and lobes: to those asked for, else to what does best for `captures`.
    pub fn suit(&mut self, captures: &[Capture], clusters: Option<usize>, lobes: Option<usize>) {
        let Some(first) = captures.first() else { return };
        let bytes = self.bytes.map(|bytes| bytes / captures.len() as u64);
        self.clusters = clusters.unwrap_or(self.clusters_for(bytes, first.info().texel_count()));
        self.lobes = lobes.unwrap_or(self.lobes_for(bytes, self.clusters));
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`FitError::Params`], one sentence that names the option.
    pub fn check(&self) -> Result<ValidFitParams, FitError> {
        let refuse = |text: &str| Err(FitError::Params(text.to_string()));
        if !(1..=256).contains(&self.clusters) {
            return refuse("--clusters must be 1 to 256");
        }
        if self.lobes > 32 {
            return refuse("--lobes must be 0 to 32");
        }
        if self.components.is_some_and(|components| components > MAX_COMPONENTS) {
            return refuse("--components must be 0 to 128");
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
        Ok(ValidFitParams { asked: self.clone() })
    }
}

/// Parameters whose ranges [`FitParams::check`] has checked: what a fit runs with.
#[derive(Debug, Clone, PartialEq)]
pub struct ValidFitParams {
    asked: FitParams,
}

impl ValidFitParams {
    /// Returns the parameters that were checked, with `None` where the goal decides.
    pub fn asked(&self) -> &FitParams {
        &self.asked
    }

    /// Returns the goal.
    pub fn goal(&self) -> Goal {
        match (self.asked.bytes, self.asked.psnr_db) {
            (Some(bytes), _) => Goal::Bytes(bytes),
            (None, Some(db)) => Goal::PsnrDb(db),
            (None, None) => Goal::None,
        }
    }

    /// Returns what lobes are to the residual: as asked for, else its base.
    pub fn role(&self) -> Role {
        self.asked.role.unwrap_or(Role::Base)
    }

    /// Returns whether every texel stores lobes of its own.
    pub fn stores_lobes(&self) -> bool {
        self.role() == Role::Base && self.goal() == Goal::None
    }

    /// Returns whether the weights of lobes follow from the residual's coefficients.
    pub fn predicts_lobes(&self) -> bool {
        self.role() == Role::Base && self.goal() != Goal::None && self.lobes() > 0
    }

    /// Returns the adapter that may multiply matrices.
    pub fn gpu(&self) -> &GpuChoice {
        &self.asked.gpu
    }

    /// Returns the largest asset in bytes, where the goal is a size.
    pub fn bytes(&self) -> Option<u64> {
        self.asked.bytes
    }

    /// Returns the number of clusters, 1 to 256.
    pub fn clusters(&self) -> usize {
        self.asked.clusters
    }

    /// Returns the most lobes of a texel or, as guide, of a cluster, 0 to 32.
    pub fn lobes(&self) -> usize {
        self.asked.lobes
    }

    /// Returns the residual components that were asked for, 0 to 128.
    pub fn components(&self) -> Option<usize> {
        self.asked.components
    }

    /// Returns the residual components that are encoded at most: those asked for, else all that are worth their bytes
    /// with a goal and 8 without.
    pub fn most_components(&self) -> usize {
        let usual = if self.goal() == Goal::None { DEFAULT_COMPONENTS } else { MAX_COMPONENTS };
        self.asked.components.unwrap_or(usual)
    }

    /// Returns the limit of the peak memory in bytes.
    pub fn memory_bytes(&self) -> u64 {
        self.asked.memory_bytes
    }

    /// Returns the error to minimise: as asked for or chosen, else that of gamma-encoded values.
    pub fn error(&self) -> ErrorMeasure {
        self.asked.error.unwrap_or(ErrorMeasure::Gamma)
    }

    /// Returns the parameters with another error to minimise.
    pub(crate) fn with_error(&self, error: ErrorMeasure) -> ValidFitParams {
        ValidFitParams { asked: FitParams { error: Some(error), ..self.asked.clone() } }
    }

    /// Returns the parameters with a size, where one is asked for, that leaves room for `bytes` more.
    pub(crate) fn leaving(&self, bytes: usize) -> ValidFitParams {
        let left = self.asked.bytes.map(|most| most.saturating_sub(bytes as u64));
        ValidFitParams { asked: FitParams { bytes: left, ..self.asked.clone() } }
    }

    /// Tells whether a capture in bands is fitted as colours.
    pub fn fits_colours(&self) -> bool {
        self.asked.colours
    }

    /// Returns the share of the direction pairs that is held back, 0 to 0.9.
    pub fn leave_out(&self) -> f64 {
        self.asked.leave_out
    }

    /// Returns what predicts pairs that are held back or have no image.
    pub fn priors(&self) -> &Priors {
        &self.asked.priors
    }

    /// Tells whether the texels' heights are looked for.
    pub fn finds_heights(&self) -> bool {
        self.asked.heights
    }

    /// Returns the seed of every random choice.
    pub fn seed(&self) -> u64 {
        self.asked.seed
    }

    /// Returns which k-means runs.
    pub fn kmeans(&self) -> KMeansEngine {
        self.asked.kmeans
    }

    /// Returns the folder for the temporary cache.
    pub fn cache_directory(&self) -> &Path {
        &self.asked.cache_directory
    }

    /// Returns the folder in which the results of finished stages are kept and looked for.
    pub fn resume(&self) -> Option<&Path> {
        self.asked.resume.as_deref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lobes_are_the_base_unless_it_is_said_otherwise() {
        let role = |params: FitParams| params.check().unwrap().role();
        let plain = FitParams::default();
        for goal in [
            plain.clone(),
            FitParams { bytes: Some(1_000), ..plain.clone() },
            FitParams { psnr_db: Some(30.0), ..plain.clone() },
        ] {
            assert_eq!(role(goal.clone()), Role::Base);
            assert_eq!(role(FitParams { role: Some(Role::Guide), ..goal }), Role::Guide);
        }
    }

    #[test]
    fn a_small_file_gets_few_lobes_and_always_one() {
        let sized = FitParams { bytes: Some(1), ..FitParams::default() };
        let lobes = |bytes| sized.lobes_for(Some(bytes), 32);
        assert_eq!([lobes(10_000), lobes(100_000), lobes(2_000_000)], [1, 2, 4]);
        assert_eq!(sized.lobes_for(Some(100_000), 16), 4);
        assert_eq!(FitParams { psnr_db: Some(30.0), ..FitParams::default() }.lobes_for(None, 32), 4);
        for other in [FitParams::default(), FitParams { role: Some(Role::Guide), ..sized }] {
            assert_eq!(other.lobes_for(Some(10_000), 32), FitParams::default().lobes);
        }
    }

    #[test]
    fn clusters_have_a_thousand_texels_where_there_is_a_goal() {
        let sized = FitParams { bytes: Some(1), ..FitParams::default() };
        let clusters = |side: usize, bytes: u64| sized.clusters_for(Some(bytes), side * side);
        assert_eq!([32, 96, 128, 256, 512].map(|side| clusters(side, 2_000_000)), [4, 9, 16, 32, 32]);
        assert_eq!([96, 256].map(|side| clusters(side, 9_000)), [9, 16]);
        assert_eq!(FitParams { psnr_db: Some(30.0), ..FitParams::default() }.clusters_for(None, 9216), 9);
        assert_eq!(FitParams::default().clusters_for(None, 9216), 32);
    }

    #[test]
    fn what_is_out_of_range_is_named() {
        let plain = FitParams::default();
        for (params, option) in [
            (FitParams { clusters: 0, ..plain.clone() }, "--clusters"),
            (FitParams { lobes: 33, ..plain.clone() }, "--lobes"),
            (FitParams { components: Some(129), ..plain.clone() }, "--components"),
            (FitParams { leave_out: 0.95, ..plain.clone() }, "--leave-out"),
            (FitParams { bytes: Some(1), psnr_db: Some(30.0), ..plain.clone() }, "--bytes and --psnr"),
            (FitParams { psnr_db: Some(f64::NAN), ..plain }, "--psnr"),
        ] {
            let message = params.check().unwrap_err().to_string();
            assert!(message.contains(option), "{message}");
        }
    }
}

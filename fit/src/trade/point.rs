//! A setting of a trade with its figures.

use crate::metrics::Metrics;
use crate::params::Role;
use btf_runtime::Interpolation;
use serde::Serialize;

/// Limit of the number of components.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Limit {
    /// No limit: all components that are worth their bytes.
    None,
    /// A file that was encoded with fewer components.
    Encode,
    /// A file with more components, read up to the tier with these; the decoder is told to use no others.
    Decode,
    /// The file's first tier: lobes without residual.
    Lobes,
}

/// Precision of the expanded bases in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// 16 bits, as in the resident form.
    Half,
    /// 32 bits.
    Single,
}

/// Rule by which directions that were not measured are decoded, as `--interpolation`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Rule {
    /// The fast rule, [`Interpolation::Fast`].
    Fast,
    /// The exact rule, [`Interpolation::Exact`].
    Exact,
}

impl Rule {
    /// Returns the rule as the decoder names it.
    pub(crate) fn interpolation(self) -> Interpolation {
        match self {
            Rule::Fast => Interpolation::Fast,
            Rule::Exact => Interpolation::Exact,
        }
    }
}

/// A setting with its figures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TradePoint {
    /// Most lobes of a texel or, as guide, of a cluster, as asked for.
    pub lobes: usize,
    /// Role of the lobes; [`Role::Guide`] without lobes.
    pub role: Role,
    /// Mean number of a texel's own lobes, as chosen; 0 where lobes guide.
    pub lobes_per_texel_mean: f64,
    /// Mean number of lobes in a cluster's set, as chosen; 0 where lobes are the base.
    pub lobes_per_cluster_mean: f64,
    /// The step of the quantisers in bits: the step is the length of a texel's coefficients (root mean square over the
    /// texels) over two to this power. One more bit halves the error of rounding. `None` for lobes alone.
    pub bits: Option<f64>,
    /// Bits that a coefficient takes in the file, on average, after entropy coding; `None` without components.
    pub bits_per_coefficient: Option<f64>,
    /// Limit of the components.
    pub limit: Limit,
    /// Number of components that are decoded.
    pub components: usize,
    /// Rule by which directions between measured ones are decoded.
    pub interpolation: Rule,
    /// Precision of the expanded bases.
    pub precision: Precision,
    /// Bytes of the file, or of its tier.
    pub bytes: usize,
    /// Bytes of the whole file, also where `bytes` is of a tier.
    pub file_bytes: usize,
    /// Bytes in the decoder's memory.
    pub resident_bytes: usize,
    /// Error on the share of pairs; the colour difference is taken on at most eight of them. Both rules decode measured
    /// directions alike.
    #[serde(flatten)]
    pub metrics: Metrics,
    /// `psnr_db` at directions that the asset has to interpolate ([`crate::Trade::between`] says which); `None` where
    /// that was not measured.
    pub psnr_between_db: Option<f64>,
    /// Nanoseconds of an evaluation at random directions on one thread of the CPU.
    pub cpu_ns: f64,
    /// Nanoseconds of an evaluation on the GPU; `None` without a measurement.
    pub gpu_ns: Option<f64>,
    /// Whether no other point has fewer bytes at this PSNR; only for points with the fast rule and half precision,
    /// because the others have the same file.
    pub front_bytes_psnr: bool,
    /// Whether no other point is faster at this PSNR.
    pub front_ns_psnr: bool,
    /// Whether no other point is faster at this PSNR between measured directions.
    pub front_ns_between: bool,
    /// Error over all pairs, for the points of the summary.
    pub all_pairs: Option<Metrics>,
}

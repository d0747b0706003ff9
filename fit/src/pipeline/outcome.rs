//! What a fit gives.

use crate::stages::lobe_dictionaries::LobeFigures;
use btf_runtime::Asset;

/// What a fit gives.
#[derive(Debug, Clone)]
pub struct FitOutcome {
    /// The asset.
    pub asset: Asset,
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// Mean number of lobes of a texel, all layers.
    pub lobes_per_texel_mean: f64,
    /// What the lobes achieve, the first layer's.
    pub lobes: LobeFigures,
    /// Residual components, the first layer's.
    pub components: usize,
    /// Clusters, the first layer's.
    pub clusters: usize,
    /// Held-back pairs (`view * lights + light`), the first layer's; empty without `--leave-out`.
    pub left_out: Vec<usize>,
}

//! What a fit gives.

use crate::error::FitError;
use crate::inspect::lobe_use::LobeUse;
use crate::stages::lobe_dictionaries::LobeFigures;
use btf_runtime::{Asset, read_directory};

/// What a fit gives.
#[derive(Debug, Clone)]
pub struct FitOutcome {
    /// The asset.
    pub asset: Asset,
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// How many lobes there are and what they are to the residual, all layers.
    pub lobe_use: LobeUse,
    /// What the lobes achieve, the first layer's.
    pub lobes: LobeFigures,
    /// Residual components, the first layer's.
    pub components: usize,
    /// Clusters, the first layer's.
    pub clusters: usize,
    /// Held-back pairs (`view * lights + light`), the first layer's; empty without `--leave-out`.
    pub left_out: Vec<usize>,
}

impl FitOutcome {
    /// Reads the figures of the packed asset in `bytes` off it.
    pub(crate) fn new(bytes: Vec<u8>, lobes: LobeFigures, left_out: Vec<usize>) -> Result<FitOutcome, FitError> {
        let asset = Asset::parse(&bytes)?;
        let lobe_use = LobeUse::of(&asset.layers, 0, &read_directory(&bytes)?.sections);
        let components = asset.layers[0].residual.as_ref().map_or(0, |residual| residual.coefficients.len());
        let clusters = asset.layers[0].dictionary.len();
        Ok(FitOutcome { asset, bytes, lobe_use, lobes, components, clusters, left_out })
    }
}

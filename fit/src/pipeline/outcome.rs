//! Result of a fit.

use crate::error::FitError;
use crate::inspect::lobe_use::LobeUse;
use crate::stages::lobe_dictionaries::LobeFigures;
use btf_runtime::{Asset, read_directory};

/// Result of a fit.
#[derive(Debug, Clone)]
pub struct FitOutcome {
    /// The asset.
    pub asset: Asset,
    /// Bytes of the asset.
    pub bytes: Vec<u8>,
    /// Number, role and bytes of the lobes of all layers.
    pub lobe_use: LobeUse,
    /// Error of the lobes alone, of the first layer.
    pub lobes: LobeFigures,
    /// Residual components of the first layer.
    pub components: usize,
    /// Clusters of the first layer.
    pub clusters: usize,
    /// Held-back pairs of the first layer (`view * lights + light`); empty without `--leave-out`.
    pub left_out: Vec<usize>,
}

impl FitOutcome {
    /// Reads the figures of the packed asset in `bytes`.
    pub(crate) fn new(bytes: Vec<u8>, lobes: LobeFigures, left_out: Vec<usize>) -> Result<FitOutcome, FitError> {
        let asset = Asset::parse(&bytes)?;
        let lobe_use = LobeUse::of(&asset.layers, 0, &read_directory(&bytes)?.sections);
        let components = asset.layers[0].residual.as_ref().map_or(0, |residual| residual.coefficients.len());
        let clusters = asset.layers[0].dictionary.len();
        Ok(FitOutcome { asset, bytes, lobe_use, lobes, components, clusters, left_out })
    }
}

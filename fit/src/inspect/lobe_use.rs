//! Counts of an asset's lobes, their role and their bytes: for every report that mentions them.

use crate::params::Role;
use btf_capture::text_from_bytes;
use btf_runtime::{Layer, SectionEntry, SectionKind};
use serde::Serialize;
use std::fmt::{self, Display};

/// Kinds of sections that lobes are stored in.
const LOBE_SECTIONS: [SectionKind; 4] =
    [SectionKind::TexelLobeCounts, SectionKind::Dictionary, SectionKind::LobeRefs, SectionKind::LobeWeights];

/// Lobes of a layer or of an asset. The names are keys of `fit --json` and of the layers in `info --json`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LobeUse {
    /// Role of the lobes, `base` or `guide`; of an asset its first layer's.
    #[serde(rename = "lobe_role")]
    pub role: Role,
    /// Bytes of dictionaries, lobe counts, lobe references and lobe weights in the file, finest level.
    #[serde(rename = "lobe_bytes")]
    pub bytes: u64,
    /// Mean number of a texel's own lobes with a weight that is not 0; 0 where lobes guide.
    #[serde(rename = "lobes_per_texel_mean")]
    pub per_texel_mean: f64,
    /// Mean number of lobes in a cluster's set where lobes guide; 0 where they are the base.
    #[serde(rename = "lobes_per_cluster_mean")]
    pub per_cluster_mean: f64,
}

impl LobeUse {
    /// Counts the lobes of `layers`, of which layer `first` of the asset is the first; `sections` is the directory of
    /// the asset's file.
    pub fn of(layers: &[Layer], first: usize, sections: &[SectionEntry]) -> LobeUse {
        let role = layers.first().map_or(Role::Guide, |layer| layer.lobe_role.into());
        let numbers = first..first + layers.len();
        let is_own = |entry: &&SectionEntry| {
            LOBE_SECTIONS.iter().any(|kind| *kind as u32 == entry.kind) && numbers.contains(&(entry.layer as usize))
        };
        let mean = |counts: Vec<usize>| counts.iter().sum::<usize>() as f64 / counts.len().max(1) as f64;
        let (mut of_texels, mut of_clusters) = (Vec::new(), Vec::new());
        for layer in layers {
            match Role::from(layer.lobe_role) {
                Role::Base => of_texels.extend(own_lobes(layer)),
                Role::Guide => of_clusters.extend(lobes_of_clusters(layer)),
            }
        }
        LobeUse {
            role,
            bytes: sections.iter().filter(is_own).map(|entry| u64::from(entry.length)).sum(),
            per_texel_mean: mean(of_texels),
            per_cluster_mean: mean(of_clusters),
        }
    }
}

/// Returns for each texel of `layer` how many of its lobes have a weight that is not 0.
fn own_lobes(layer: &Layer) -> Vec<usize> {
    let mut refs = layer.lobe_refs.iter();
    let counts = layer.texel_lobe_counts.iter();
    counts
        .map(|count| refs.by_ref().take(usize::from(*count)).filter(|reference| reference.weight != [0; 3]).count())
        .collect()
}

/// Returns for each cluster of `layer` that has texels how many lobes the texel with most of them refers to: all texels
/// of a cluster refer to one set.
fn lobes_of_clusters(layer: &Layer) -> Vec<usize> {
    let mut most: Vec<Option<usize>> = vec![None; layer.dictionary.len()];
    for (cluster, count) in layer.texel_clusters.iter().zip(&layer.texel_lobe_counts) {
        let most = &mut most[usize::from(*cluster)];
        *most = Some(most.unwrap_or(0).max(usize::from(*count)));
    }
    most.into_iter().flatten().collect()
}

impl Display for LobeUse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.role {
            Role::Guide => write!(
                f,
                "{:.2} lobes per cluster (guide interpolation, sampling and editing; they add nothing to the value)",
                self.per_cluster_mean
            )?,
            Role::Base => {
                write!(f, "{:.2} lobes per texel (base: the residual is what they leave)", self.per_texel_mean)?;
            }
        }
        write!(f, ", {}", text_from_bytes(self.bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_asset::sample_asset;
    use btf_runtime::{LobeRole, pack, read_directory};

    #[test]
    fn a_guide_is_told_by_cluster_and_a_base_by_texel() {
        let mut asset = sample_asset();
        let of = |asset: &btf_runtime::Asset| {
            LobeUse::of(&asset.layers, 0, &read_directory(&pack(asset).unwrap()).unwrap().sections)
        };
        asset.layers[0].lobe_role = LobeRole::Base;
        let base = of(&asset);
        let refs = asset.layers[0].lobe_refs.iter().filter(|reference| reference.weight != [0; 3]).count();
        assert_eq!((base.role, base.per_cluster_mean), (Role::Base, 0.0));
        assert_eq!(base.per_texel_mean, refs as f64 / asset.texel_count() as f64);
        assert!(base.to_string().contains("lobes per texel (base") && base.bytes > 0, "{base}");
        asset.layers[0].lobe_role = LobeRole::Guide;
        let guide = of(&asset);
        assert_eq!((guide.role, guide.per_texel_mean, guide.bytes), (Role::Guide, 0.0, base.bytes));
        assert!(guide.per_cluster_mean >= 1.0 && guide.per_cluster_mean <= 3.0, "{guide:?}");
        assert!(guide.to_string().contains("add nothing to the value") && !guide.to_string().contains("per texel"));
    }

    #[test]
    fn a_lobe_of_weight_zero_does_not_count() {
        let mut asset = sample_asset();
        asset.layers[0].lobe_role = LobeRole::Base;
        let before = LobeUse::of(&asset.layers, 0, &[]).per_texel_mean;
        let own = asset.layers[0].lobe_refs.iter().position(|reference| reference.weight != [0; 3]).unwrap();
        asset.layers[0].lobe_refs[own].weight = [0; 3];
        let after = LobeUse::of(&asset.layers, 0, &[]).per_texel_mean;
        assert!((before - after - 1.0 / asset.texel_count() as f64).abs() < 1e-12, "{before} {after}");
    }
}

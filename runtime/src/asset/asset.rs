//! An asset in memory, in its file form: what [`crate::pack`] writes and [`Asset::parse`] reads.

use crate::asset::dictionary::{DictionaryLobe, LobeRef};
use crate::asset::edit::Edits;
use crate::asset::heights::Heights;
use crate::asset::limits::MAX_LEVELS;
use crate::asset::residual::{Residual, ResidualKind};
use crate::asset::sphere::Sphere;

/// Which side of the surface a light or an eye is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum SurfaceSide {
    /// The side that the macroscopic normal points to.
    Front = 0,
    /// The other one; its directions are stored mirrored in z, so that they too have z > 0. Their x and
    /// y are the front's.
    Back = 1,
}

impl SurfaceSide {
    /// Both sides.
    pub const ALL: [SurfaceSide; 2] = [SurfaceSide::Front, SurfaceSide::Back];

    /// Returns the side that a direction in the texel's frame points to: the back where its z is below 0.
    pub fn of(direction: [f32; 3]) -> SurfaceSide {
        if direction[2] < 0.0 { SurfaceSide::Back } else { SurfaceSide::Front }
    }

    /// Returns the opposite side.
    pub fn other(self) -> SurfaceSide {
        match self {
            SurfaceSide::Front => SurfaceSide::Back,
            SurfaceSide::Back => SurfaceSide::Front,
        }
    }
}

impl From<bool> for SurfaceSide {
    /// Returns the back for `true`.
    fn from(is_back: bool) -> SurfaceSide {
        if is_back { SurfaceSide::Back } else { SurfaceSide::Front }
    }
}

/// What a layer's lobes are to its residual.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum LobeRole {
    /// The residual is added to them: `X = g^-1(g(S) + R)`.
    Base = 0,
    /// The residual stands alone, `X = g^-1(g(0) + R)`; the lobes guide interpolation, sampling and editing.
    Guide = 1,
}

/// One combination of light side and eye side.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// Side of the light.
    pub light_side: SurfaceSide,
    /// Side of the eye.
    pub view_side: SurfaceSide,
    /// What the lobes are to the residual.
    pub lobe_role: LobeRole,
    /// Curve in which the residual is added.
    pub residual_kind: ResidualKind,
    /// The curve's epsilon, 1e-6 to 1.
    pub epsilon: f32,
    /// Light directions.
    pub lights: Sphere,
    /// View directions.
    pub views: Sphere,
    /// Heights of the texels, if parallax between the views is to be removed.
    pub heights: Option<Heights>,
    /// Cluster per texel.
    pub texel_clusters: Vec<u8>,
    /// Number of lobes per texel.
    pub texel_lobe_counts: Vec<u8>,
    /// Dictionary per cluster.
    pub dictionary: Vec<Vec<DictionaryLobe>>,
    /// References of all texels, one texel after the other, in order of importance.
    pub lobe_refs: Vec<LobeRef>,
    /// The residual, if the asset has one and the tier at hand reaches it.
    pub residual: Option<Residual>,
}

impl Layer {
    /// Lobes of the texel that has most.
    pub fn most_lobes(&self) -> usize {
        self.texel_lobe_counts.iter().copied().max().unwrap_or(0).into()
    }
}

/// What a layer's texels are at a coarser level; everything else is as at the finest.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelTexels {
    /// Heights of the texels, in the level's texel widths.
    pub heights: Option<Heights>,
    /// Cluster per texel.
    pub clusters: Vec<u8>,
    /// Number of lobes per texel.
    pub lobe_counts: Vec<u8>,
    /// References of all texels, as in [`Layer::lobe_refs`].
    pub lobe_refs: Vec<LobeRef>,
    /// Coefficient codes `[component][texel]`, of the first components alone where the level needs no more. Their steps are those of
    /// the layer's residual.
    pub codes: Vec<Vec<i8>>,
}

/// A coarser level: each half as wide and high as the one before, at least one texel.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// Texels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The texels of each layer.
    pub layers: Vec<LevelTexels>,
}

/// A packed BTF in its file form.
#[derive(Debug, Clone, PartialEq)]
pub struct Asset {
    /// Texels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Physical width and height in millimetres, where known; above 0, at most a kilometre.
    pub size_mm: Option<[f32; 2]>,
    /// Whether the left edge continues the right one, and the bottom edge the top one, so that repetitions show no seam.
    pub seamless: [bool; 2],
    /// Material description, JSON.
    pub material: String,
    /// One to four layers, no two with the same sides, all on one texel grid: the front's.
    pub layers: Vec<Layer>,
    /// Coarser levels, from half the width and height on; none where nobody made them, see [`crate::with_levels`].
    pub levels: Vec<Level>,
    /// What was changed after it was measured.
    pub edits: Edits,
}

impl Asset {
    /// The same with at most so many residual components, and of each texel's lobes at most so many, the most important
    /// ones. Cost: a copy.
    pub fn trimmed(&self, components: usize, lobes: usize) -> Asset {
        let mut asset = self.clone();
        for layer in &mut asset.layers {
            if let Some(residual) = &mut layer.residual {
                residual.coefficients.truncate(components);
                residual.bases.truncate(residual.coefficients.len() + 1);
            }
            keep_lobes(&mut layer.texel_lobe_counts, &mut layer.lobe_refs, lobes);
        }
        for texels in asset.levels.iter_mut().flat_map(|level| &mut level.layers) {
            texels.codes.truncate(components);
            keep_lobes(&mut texels.lobe_counts, &mut texels.lobe_refs, lobes);
        }
        asset
    }

    /// The same without its levels, and without the clusters behind the last one that the finest level uses. Cost: a copy.
    pub fn without_levels(&self) -> Asset {
        if self.levels.is_empty() {
            return self.clone();
        }
        let mut asset = Asset { levels: Vec::new(), ..self.clone() };
        for layer in &mut asset.layers {
            let clusters = layer.texel_clusters.iter().map(|cluster| usize::from(*cluster) + 1).max().unwrap_or(1);
            layer.dictionary.truncate(clusters);
            if let Some(residual) = &mut layer.residual {
                let shared = residual.shared.steps.len();
                for basis in &mut residual.bases {
                    basis.steps.truncate(clusters);
                    basis.values.truncate(clusters * shared);
                }
            }
        }
        asset
    }

    /// Level `number` as an asset of its own, 0 the finest; the coarsest beyond them all. It has no levels. Cost: a copy.
    pub fn level(&self, number: usize) -> Asset {
        let mut asset = Asset { levels: Vec::new(), ..self.clone() };
        let Some(last) = self.levels.len().checked_sub(1).filter(|_| number > 0) else { return asset };
        let level = &self.levels[(number - 1).min(last)];
        asset.edits = self.edits.coarser([self.width, self.height], [level.width, level.height]);
        (asset.width, asset.height) = (level.width, level.height);
        for (layer, texels) in asset.layers.iter_mut().zip(&level.layers) {
            layer.heights = texels.heights.clone();
            layer.texel_clusters = texels.clusters.clone();
            layer.texel_lobe_counts = texels.lobe_counts.clone();
            layer.lobe_refs = texels.lobe_refs.clone();
            if let Some(residual) = &mut layer.residual {
                residual.bases.truncate(texels.codes.len() + 1);
                residual.coefficients.truncate(texels.codes.len());
                let planes = residual.coefficients.iter_mut().zip(&texels.codes);
                planes.for_each(|(plane, codes)| plane.codes = codes.clone());
            }
        }
        asset
    }

    /// Residual components of the layer that has most.
    pub fn most_components(&self) -> usize {
        let residuals = self.layers.iter().filter_map(|layer| layer.residual.as_ref());
        residuals.map(|residual| residual.coefficients.len()).max().unwrap_or(0)
    }

    /// Lobes of the texel that has most.
    pub fn most_lobes(&self) -> usize {
        self.layers.iter().map(Layer::most_lobes).max().unwrap_or(0)
    }

    /// Texels.
    pub fn texel_count(&self) -> usize {
        self.width * self.height
    }
}

/// Keeps the first `most` references of each texel.
fn keep_lobes(counts: &mut [u8], refs: &mut Vec<LobeRef>, most: usize) {
    let (mut first, mut kept) = (0, Vec::new());
    for count in counts {
        let all = usize::from(*count);
        kept.extend_from_slice(&refs[first..first + all.min(most)]);
        *count = all.min(most) as u8;
        first += all;
    }
    *refs = kept;
}

/// Sizes of the levels below one of `finest`, down to one texel.
pub(crate) fn level_sizes(finest: [usize; 2]) -> Vec<[usize; 2]> {
    let halved = |size: &[usize; 2]| (*size != [1, 1]).then(|| size.map(|side| (side / 2).max(1)));
    std::iter::successors(halved(&finest), halved).take(MAX_LEVELS - 1).collect()
}

/// Number of the first layer whose sides an earlier one has.
pub(crate) fn doubled_sides<'a>(layers: impl IntoIterator<Item = &'a Layer>) -> Option<usize> {
    let sides: Vec<_> = layers.into_iter().map(|layer| (layer.light_side, layer.view_side)).collect();
    (0..sides.len()).find(|&number| sides[..number].contains(&sides[number]))
}

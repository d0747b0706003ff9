//! An asset in memory in its file form, which [`crate::pack`] writes and [`Asset::parse`] reads.

use crate::asset::dictionary::{DictionaryLobe, LobeRef};
use crate::asset::edit::Edits;
use crate::asset::heights::Heights;
use crate::asset::limits::MAX_LEVELS;
use crate::asset::lobe_weights::LobeWeights;
use crate::asset::relief::Relief;
use crate::asset::residual::{Residual, ResidualKind};
use crate::asset::spectrum::Spectrum;
use crate::asset::sphere::Sphere;

/// The side of the surface that a light or an eye is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum SurfaceSide {
    /// The side that the macroscopic normal points to.
    Front = 0,
    /// The side opposite to [`SurfaceSide::Front`]. Its directions are stored mirrored in z, so that they have z > 0
    /// like those of the front; x and y are those of the front's frame.
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

/// The role of a layer's lobes besides its residual.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum LobeRole {
    /// Base of files of version 1: as [`LobeRole::Base`], but beyond the measured lights the lobes are evaluated where
    /// the light is, and the residual falls instead of the value.
    OldBase = 0,
    /// Lobes that only guide interpolation, sampling and editing; the residual stands alone: `X = g^-1(g(0) + R)`.
    Guide = 1,
    /// Lobes to which the residual is added: `X = g^-1(g(S) + R)`. Beyond the measured lights the value at their hull
    /// falls with the light's cosine.
    Base = 2,
}

impl LobeRole {
    /// Returns the role with a number of the file; `None` if this version does not know it.
    pub fn from_number(number: u32) -> Option<LobeRole> {
        [LobeRole::OldBase, LobeRole::Guide, LobeRole::Base].into_iter().find(|role| *role as u32 == number)
    }
}

/// The part of an asset for one combination of light side and eye side, such as lit from behind and seen from in front.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// Side of the light.
    pub light_side: SurfaceSide,
    /// Side of the eye.
    pub view_side: SurfaceSide,
    /// Role of the lobes besides the residual.
    pub lobe_role: LobeRole,
    /// Curve `g` in which the residual is added.
    pub residual_kind: ResidualKind,
    /// Epsilon of the residual's curve, 1e-6 to 1.
    pub epsilon: f32,
    /// Measured light directions.
    pub lights: Sphere,
    /// Measured view directions.
    pub views: Sphere,
    /// Displacement of the texels; `None` if parallax between the views is not to be removed.
    pub heights: Option<Heights>,
    /// Corrections between the measured directions that the heights give; `None` for none.
    pub relief: Option<Relief>,
    /// Cluster of each texel.
    pub texel_clusters: Vec<u8>,
    /// Number of lobes of each texel.
    pub texel_lobe_counts: Vec<u8>,
    /// Dictionary of lobes of each cluster.
    pub dictionary: Vec<Vec<DictionaryLobe>>,
    /// Lobe references of all texels, one texel after the other, each texel's in order of importance.
    pub lobe_refs: Vec<LobeRef>,
    /// Weights of the lobes as functions of the coefficients; `None` where every texel's references are stored. Where
    /// they are there, the residual holds the whole value, and decoders subtract from its bases what the lobes give.
    pub lobe_weights: Option<LobeWeights>,
    /// Residual; `None` if the asset has none or the tier at hand ends before it.
    pub residual: Option<Residual>,
}

impl Layer {
    /// Returns whether the layer is one that may have [`Relief`]: it has heights, the root curve, and lobes of
    /// [`LobeRole::Base`] whose weights the coefficients predict.
    pub fn may_have_relief(&self) -> bool {
        self.heights.is_some()
            && self.residual_kind == ResidualKind::Root
            && self.lobe_role == LobeRole::Base
            && self.lobe_weights.is_some()
    }

    /// Returns the largest number of lobes that a texel has.
    pub fn most_lobes(&self) -> usize {
        self.texel_lobe_counts.iter().copied().max().unwrap_or(0).into()
    }
}

/// The texels of a layer at a coarser level. Everything else of the layer holds for all its levels.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelTexels {
    /// Displacement of the texels, in the level's texel widths.
    pub heights: Option<Heights>,
    /// Cluster of each texel.
    pub clusters: Vec<u8>,
    /// Number of lobes of each texel.
    pub lobe_counts: Vec<u8>,
    /// Lobe references of all texels, as in [`Layer::lobe_refs`].
    pub lobe_refs: Vec<LobeRef>,
    /// Coefficient codes `[component][texel]`, of the first components alone where the level needs no more. Steps are
    /// those of the layer's residual.
    pub codes: Vec<Vec<i8>>,
}

/// A coarser level: half as wide and high as the level before, at least one texel.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// Texels per row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// The texels of each layer.
    pub layers: Vec<LevelTexels>,
}

/// A packed BTF in its file form.
#[derive(Debug, Clone, PartialEq)]
pub struct Asset {
    /// Texels per row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Physical width and height in millimetres, above 0 and at most a kilometre; `None` where they are not known.
    pub size_mm: Option<[f32; 2]>,
    /// Whether the left edge continues the right one, and the bottom edge the top one, so that repetitions show no
    /// seam.
    pub seamless: [bool; 2],
    /// Bands of the channels; `None` where the channels are colours.
    pub spectrum: Option<Spectrum>,
    /// Material description, JSON.
    pub material: String,
    /// One to four layers on one texel grid, that of the front; no two have the same sides.
    pub layers: Vec<Layer>,
    /// Coarser levels, from half the width and height on. Empty unless they were made, see [`crate::with_levels`].
    pub levels: Vec<Level>,
    /// Changes made after the measurement.
    pub edits: Edits,
}

impl Asset {
    /// Returns the asset with at most `components` residual components, and of each texel's lobes the `lobes` most
    /// important ones at most. Cost: a copy.
    pub fn trimmed(&self, components: usize, lobes: usize) -> Asset {
        let mut asset = self.clone();
        for layer in &mut asset.layers {
            keep_predicted_lobes(layer, lobes);
            if let Some(residual) = &mut layer.residual {
                residual.truncate(components);
            }
            keep_lobes(&mut layer.texel_lobe_counts, &mut layer.lobe_refs, lobes);
        }
        for texels in asset.levels.iter_mut().flat_map(|level| &mut level.layers) {
            texels.codes.truncate(components);
            keep_lobes(&mut texels.lobe_counts, &mut texels.lobe_refs, lobes);
        }
        asset
    }

    /// Returns the asset without its coarser levels, and without the clusters behind the last one that the finest level
    /// uses. Cost: a copy.
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

    /// Returns level `number` as an asset of its own without coarser levels. 0 is the finest level; a number beyond the
    /// coarsest gives the coarsest. Cost: a copy.
    pub fn level(&self, number: usize) -> Asset {
        let mut asset = Asset { levels: Vec::new(), ..self.clone() };
        let Some(last) = self.levels.len().checked_sub(1).filter(|_| number > 0) else { return asset };
        let level = &self.levels[(number - 1).min(last)];
        asset.edits = self.edits.coarser([self.width, self.height], [level.width, level.height]);
        (asset.width, asset.height) = (level.width, level.height);
        for (layer, texels) in asset.layers.iter_mut().zip(&level.layers) {
            layer.heights = texels.heights.clone();
            layer.relief = layer.relief.filter(|_| layer.heights.is_some());
            layer.texel_clusters = texels.clusters.clone();
            layer.texel_lobe_counts = texels.lobe_counts.clone();
            layer.lobe_refs = texels.lobe_refs.clone();
            if let Some(residual) = &mut layer.residual {
                residual.truncate(texels.codes.len());
                let planes = residual.coefficients.iter_mut().zip(&texels.codes);
                planes.for_each(|(plane, codes)| plane.codes = codes.clone());
            }
        }
        asset
    }

    /// Returns the largest number of residual components that a layer has.
    pub fn most_components(&self) -> usize {
        let residuals = self.layers.iter().filter_map(|layer| layer.residual.as_ref());
        residuals.map(|residual| residual.coefficients.len()).max().unwrap_or(0)
    }

    /// Returns the largest number of lobes that a texel has.
    pub fn most_lobes(&self) -> usize {
        self.layers.iter().map(Layer::most_lobes).max().unwrap_or(0)
    }

    /// Returns the number of texels.
    pub fn texel_count(&self) -> usize {
        self.width * self.height
    }
}

/// Keeps the first `most` lobes of each cluster where the coefficients predict them. What the others take from the bases
/// then stays in these.
fn keep_predicted_lobes(layer: &mut Layer, most: usize) {
    if layer.dictionary.iter().all(|lobes| lobes.len() <= most) || !layer.has_predicted_lobes() {
        return;
    }
    let Some(mut weights) = layer.lobe_weights.take() else { return };
    let columns = 3 * (1 + weights.units.len());
    let numbers = layer.dictionary.iter().flat_map(|lobes| 0..lobes.len());
    for (codes, number) in weights.codes.chunks_exact_mut(columns).zip(numbers) {
        if number >= most {
            codes.fill(0);
        }
    }
    layer.lobe_weights = Some(weights);
    layer.predict_lobes();
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

/// Returns the sizes of the levels coarser than `finest`, down to one texel.
pub(crate) fn level_sizes(finest: [usize; 2]) -> Vec<[usize; 2]> {
    let halved = |size: &[usize; 2]| (*size != [1, 1]).then(|| size.map(|side| (side / 2).max(1)));
    std::iter::successors(halved(&finest), halved).take(MAX_LEVELS - 1).collect()
}

/// Returns the number of the first layer whose sides an earlier layer has; `None` if there is none.
pub(crate) fn doubled_sides<'a>(layers: impl IntoIterator<Item = &'a Layer>) -> Option<usize> {
    let sides: Vec<_> = layers.into_iter().map(|layer| (layer.light_side, layer.view_side)).collect();
    (0..sides.len()).find(|&number| sides[..number].contains(&sides[number]))
}

//! An asset decoded image by image: all texels for one pair of directions. What measuring and
//! expanding use; [`btf_runtime::decode`] is the slow definition that it is tested against.
//!
//! A pair is planned once (lobe values and residual rows of every cluster), then a texel costs its few
//! weights only.

use crate::frame::layer_directions;
use btf_capture::{DirectionSet, Side};
use btf_runtime::{
    Asset, DecodeOptions, HORIZON_COS, Interpolation, Layer, LobeRole, LobeSetup, Neighbours, RATIO_EPSILON,
    RATIO_RANGE, ROOT, Resident, ResidualKind, SingleBases, Sphere, block, weight_from_byte,
};
use half::f16;
use std::ops::Range;

/// Directions closer than this count as the same, in degrees.
pub const SAME_DIRECTION_DEG: f64 = 0.01;

/// A direction as a layer knows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Spot {
    /// Direction number so-and-so of the layer's own set.
    Measured(usize),
    /// Another one: a unit vector in the layer's frame.
    Other([f32; 3]),
}

impl Spot {
    /// The direction of `sphere` within [`SAME_DIRECTION_DEG`] of `unit`, or else `unit` itself.
    pub fn find(sphere: &Sphere, unit: [f32; 3]) -> Spot {
        let same = |id: &usize| is_same_direction(sphere.direction(*id as u32), unit);
        (0..sphere.len()).find(same).map_or(Spot::Other(unit), Spot::Measured)
    }

    /// One spot per direction of a set of a capture of `side`.
    pub fn of_set(sphere: &Sphere, set: &DirectionSet, side: Side) -> Vec<Spot> {
        layer_directions(set, side).into_iter().map(|unit| Spot::find(sphere, unit)).collect()
    }
}

fn is_same_direction(a: [f32; 3], b: [f32; 3]) -> bool {
    // The sine: the cosine of so small an angle is 1 in single precision.
    let (a, b) = (a.map(f64::from), b.map(f64::from));
    let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let sine = cross.iter().map(|x| x * x).sum::<f64>().sqrt();
    let cosine: f64 = a.iter().zip(b).map(|(x, y)| x * y).sum();
    cosine > 0.0 && sine < SAME_DIRECTION_DEG.to_radians().sin()
}

/// A layer of an asset, ready to be decoded image by image.
pub struct ImageDecoder<'a> {
    layer: &'a Layer,
    words: &'a [u32],
    /// First word of the expanded bases, `[cluster, pair, channel, word]`.
    basis_at: usize,
    /// Words per pair and channel in the resident form.
    channel_words: usize,
    /// The same bases in single precision, if those are to be used.
    singles: Option<&'a [f32]>,
    /// Words per pair and channel that the options use.
    used_words: usize,
    /// Bases that the options use; 0 without residual.
    bases: usize,
    interpolation: Interpolation,
    most_lobes: usize,
    setups: Vec<LobeSetup>,
    /// Per cluster the number of its first lobe in `setups`.
    first_lobe: Vec<usize>,
    /// Per texel the number of its first lobe reference, and one more.
    first_ref: Vec<u32>,
}

/// What all texels share at one pair of directions.
pub struct PairPlan {
    /// Weight, lobe values `[lobe]` and residual rows `[cluster, channel, basis]` of each neighbour pair.
    taps: Vec<Tap>,
    /// Exact interpolation only: the lobe values at the pair itself.
    here: Option<Vec<f32>>,
    /// Factor of the residual outside the hull.
    residual_scale: f32,
    /// Factor of everything towards the horizon.
    fade: f32,
}

struct Tap {
    weight: f32,
    values: Vec<f32>,
    rows: Vec<f32>,
}

/// Texels with their weights unpacked.
pub struct TexelBlock {
    clusters: Vec<usize>,
    /// Per texel the end of its references.
    ends: Vec<usize>,
    /// Index into a plan's lobe values, and RGB weight.
    refs: Vec<(usize, [f32; 3])>,
    /// `[texel, basis]`, padded to an even number of bases.
    basis_weights: Vec<f32>,
}

impl<'a> ImageDecoder<'a> {
    /// A decoder of layer `layer`. `resident` must be `asset`'s.
    ///
    /// # Panics
    /// If `layer` is out of range.
    pub fn new(asset: &'a Asset, resident: &'a Resident, layer: usize, options: &DecodeOptions) -> ImageDecoder<'a> {
        let words = resident.words();
        let base = words[btf_runtime::ASSET_LAYERS + layer] as usize;
        let source = &asset.layers[layer];
        let bases = words[base + block::BASES].min(options.components.saturating_add(1)) as usize;
        let mut setups = Vec::new();
        let mut first_lobe = Vec::new();
        for dictionary in &source.dictionary {
            first_lobe.push(setups.len());
            setups.extend(dictionary.iter().map(|entry| entry.lobe.setup()));
        }
        let mut first_ref = Vec::with_capacity(source.texel_lobe_counts.len() + 1);
        first_ref.push(0);
        for count in &source.texel_lobe_counts {
            first_ref.push(first_ref[first_ref.len() - 1] + u32::from(*count));
        }
        ImageDecoder {
            layer: source,
            words,
            basis_at: words[base + block::BASIS] as usize,
            channel_words: words[base + block::CHANNEL_WORDS] as usize,
            singles: None,
            used_words: bases.div_ceil(2),
            bases,
            interpolation: options.interpolation,
            most_lobes: options.lobes as usize,
            setups,
            first_lobe,
            first_ref,
        }
    }

    /// The same decoder with layer `layer` of `bases`, which must be of the same asset, in place of the resident
    /// form's halves.
    pub fn with_single_bases(self, bases: &'a SingleBases, layer: usize) -> ImageDecoder<'a> {
        ImageDecoder { singles: Some(bases.layer(layer)), ..self }
    }

    /// Prepares a pair. Cost: an evaluation of every dictionary lobe, ten where neither direction is
    /// measured and the interpolation is exact.
    pub fn plan(&self, view: Spot, light: Spot) -> PairPlan {
        let (lights, views) = (&self.layer.lights, &self.layer.views);
        if let (Spot::Measured(v), Spot::Measured(l)) = (view, light) {
            return PairPlan { taps: vec![self.tap(v, l, 1.0)], here: None, residual_scale: 1.0, fade: 1.0 };
        }
        let (wo, out) = neighbours(views, view);
        let (wi, into) = neighbours(lights, light);
        if wi[2] <= 0.0 || wo[2] <= 0.0 {
            return PairPlan { taps: Vec::new(), here: None, residual_scale: 1.0, fade: 0.0 };
        }
        let fade = (wi[2] / HORIZON_COS.min(lights.least_cosine())).min(1.0);
        let here = self.lobe_values(wi, wo);
        let mut taps = Vec::new();
        for v in 0..3 {
            for l in 0..3 {
                let weight = out.weights[v] * into.weights[l];
                if weight > 0.0 {
                    taps.push(self.tap(out.ids[v] as usize, into.ids[l] as usize, weight));
                }
            }
        }
        if self.interpolation == Interpolation::Exact && self.bases > 0 {
            return PairPlan { taps, here: Some(here), residual_scale: 1.0, fade };
        }
        // The fast rule is linear in the residual, so its nine rows become one.
        let mut rows = vec![0.0; self.row_len()];
        for tap in &taps {
            for (sum, row) in rows.iter_mut().zip(&tap.rows) {
                *sum += tap.weight * row;
            }
        }
        let (residual_scale, fade) = match self.layer.residual_kind {
            _ if self.bases == 0 => (1.0, fade),
            _ if self.layer.lobe_role == LobeRole::Guide => (1.0, fade * into.beyond),
            ResidualKind::Additive => (into.beyond, fade),
            ResidualKind::Log => (1.0, fade),
            ResidualKind::Root => (into.beyond.max(1e-12).powf(1.0 / ROOT), fade),
        };
        PairPlan { taps: vec![Tap { weight: 1.0, values: here, rows }], here: None, residual_scale, fade }
    }

    /// Unpacks the weights of `texels`. Memory: about 150 bytes a texel.
    pub fn block(&self, texels: Range<usize>) -> TexelBlock {
        let layer = self.layer;
        let clusters: Vec<usize> = layer.texel_clusters[texels.clone()].iter().map(|id| usize::from(*id)).collect();
        let mut refs = Vec::new();
        let mut ends = Vec::with_capacity(clusters.len());
        for (texel, &cluster) in texels.clone().zip(&clusters) {
            let all = self.first_ref[texel] as usize..self.first_ref[texel + 1] as usize;
            for reference in layer.lobe_refs[all].iter().take(self.most_lobes) {
                let lobe = usize::from(reference.lobe);
                let scale = layer.dictionary[cluster][lobe].weight_scale;
                let weight = reference.weight.map(|q| weight_from_byte(q.into(), scale));
                refs.push((self.first_lobe[cluster] + lobe, weight));
            }
            ends.push(refs.len());
        }
        let stride = 2 * self.used_words;
        let mut basis_weights = vec![0.0; clusters.len() * stride];
        if let Some(residual) = layer.residual.as_ref().filter(|_| self.bases > 0) {
            for (texel, weights) in texels.zip(basis_weights.chunks_exact_mut(stride)) {
                weights[0] = 1.0;
                for (weight, plane) in weights[1..self.bases].iter_mut().zip(&residual.coefficients) {
                    *weight = f32::from(plane.codes[texel]);
                }
            }
        }
        TexelBlock { clusters, ends, refs, basis_weights }
    }

    /// Linear reflectance x cosine of `block`'s texels at `plan`'s pair, into `out`: `[texel, channel]`.
    ///
    /// At a measured pair the same operations in the same order as [`btf_runtime::decode_measured`].
    pub fn decode(&self, block: &TexelBlock, plan: &PairPlan, out: &mut [f32]) {
        if plan.taps.is_empty() {
            out.fill(0.0);
            return;
        }
        let mut first = 0;
        for (texel, out) in out.chunks_exact_mut(3).enumerate() {
            let refs = &block.refs[first..block.ends[texel]];
            first = block.ends[texel];
            let stride = 2 * self.used_words;
            let weights = &block.basis_weights[texel * stride..(texel + 1) * stride];
            let cluster = block.clusters[texel];
            let value = match &plan.here {
                None => {
                    let tap = &plan.taps[0];
                    let s = lobe_sum(refs, &tap.values);
                    self.combine(s, self.residual(weights, cluster, tap), plan.residual_scale)
                }
                Some(here) => self.decode_exact(refs, weights, cluster, here, &plan.taps),
            };
            for c in 0..3 {
                out[c] = value[c] * plan.fade;
            }
        }
    }

    /// The exact rule: the neighbours decoded and interpolated, times the clamped ratio of the lobes here
    /// to the lobes interpolated.
    fn decode_exact(
        &self,
        refs: &[(usize, [f32; 3])],
        weights: &[f32],
        cluster: usize,
        here: &[f32],
        taps: &[Tap],
    ) -> [f32; 3] {
        let here = lobe_sum(refs, here);
        let (mut decoded, mut lobes) = ([0.0; 3], [0.0; 3]);
        for tap in taps {
            let s = lobe_sum(refs, &tap.values);
            let value = self.combine(s, self.residual(weights, cluster, tap), 1.0);
            for c in 0..3 {
                decoded[c] += tap.weight * value[c];
                lobes[c] += tap.weight * s[c];
            }
        }
        [0, 1, 2].map(|c| {
            let ratio = (here[c] + RATIO_EPSILON) / (lobes[c] + RATIO_EPSILON);
            decoded[c] * ratio.clamp(RATIO_RANGE[0], RATIO_RANGE[1])
        })
    }

    fn residual(&self, weights: &[f32], cluster: usize, tap: &Tap) -> [f32; 3] {
        let stride = weights.len();
        let rows = &tap.rows[cluster * 3 * stride..(cluster + 1) * 3 * stride];
        [0, 1, 2].map(|c| {
            let row = &rows[c * stride..(c + 1) * stride];
            let mut sum = 0.0;
            for (w, h) in weights.chunks_exact(2).zip(row.chunks_exact(2)) {
                sum += w[0] * h[0] + w[1] * h[1];
            }
            sum
        })
    }

    fn combine(&self, s: [f32; 3], r: [f32; 3], scale: f32) -> [f32; 3] {
        if self.bases == 0 {
            return s;
        }
        let (kind, epsilon) = (self.layer.residual_kind, self.layer.epsilon);
        let share = if self.layer.lobe_role == LobeRole::Guide { 0.0 } else { 1.0 };
        [0, 1, 2].map(|c| kind.decode(kind.encode(share * s[c], epsilon) + r[c] * scale, epsilon).max(0.0))
    }

    fn row_len(&self) -> usize {
        self.first_lobe.len() * 3 * 2 * self.used_words
    }

    fn tap(&self, view: usize, light: usize, weight: f32) -> Tap {
        let layer = self.layer;
        let values = self.lobe_values(layer.lights.direction(light as u32), layer.views.direction(view as u32));
        let pair = view * layer.lights.len() + light;
        let pairs = layer.views.len() * layer.lights.len();
        let mut rows = Vec::with_capacity(self.row_len());
        for cluster in 0..self.first_lobe.len() {
            for channel in 0..3 {
                let at = ((cluster * pairs + pair) * 3 + channel) * self.channel_words;
                if let Some(singles) = self.singles {
                    rows.extend_from_slice(&singles[2 * at..2 * (at + self.used_words)]);
                    continue;
                }
                let at = self.basis_at + at;
                for word in 0..self.used_words {
                    let halves = self.words[at + word];
                    rows.extend([halves as u16, (halves >> 16) as u16].map(|bits| f16::from_bits(bits).to_f32()));
                }
            }
        }
        Tap { weight, values, rows }
    }

    fn lobe_values(&self, wi: [f32; 3], wo: [f32; 3]) -> Vec<f32> {
        self.setups.iter().map(|setup| setup.eval(wi, wo)).collect()
    }
}

/// A spot's unit vector and its neighbours in the set.
fn neighbours(sphere: &Sphere, spot: Spot) -> ([f32; 3], Neighbours) {
    match spot {
        Spot::Measured(id) => {
            let ids = [id as u32; 3];
            (sphere.direction(id as u32), Neighbours { ids, weights: [1.0, 0.0, 0.0], beyond: 1.0 })
        }
        Spot::Other(unit) if unit[2] > 0.0 => (unit, sphere.locate(unit)),
        Spot::Other(unit) => (unit, Neighbours { ids: [0; 3], weights: [0.0; 3], beyond: 0.0 }),
    }
}

fn lobe_sum(refs: &[(usize, [f32; 3])], values: &[f32]) -> [f32; 3] {
    let mut sum = [0.0; 3];
    for (lobe, weight) in refs {
        let value = values[*lobe];
        for c in 0..3 {
            sum[c] += weight[c] * value;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_asset::{sample_asset, sample_asset_with};
    use btf_runtime::{decode, decode_measured, lobe_tables, pack};

    const KINDS: [ResidualKind; 3] = [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root];

    fn asset(kind: ResidualKind) -> Asset {
        let (views, lights) = (DirectionSet::random(7, 3).unwrap(), DirectionSet::random(9, 4).unwrap());
        let asset = sample_asset_with(5, 3, &views, &lights, kind);
        Asset::parse(&pack(&asset).unwrap()).unwrap()
    }

    fn image(decoder: &ImageDecoder, texels: usize, view: Spot, light: Spot) -> Vec<f32> {
        let mut out = vec![f32::NAN; texels * 3];
        decoder.decode(&decoder.block(0..texels), &decoder.plan(view, light), &mut out);
        out
    }

    #[test]
    fn measured_pairs_are_bit_for_bit_those_of_the_runtime() {
        for kind in KINDS {
            let asset = asset(kind);
            let resident = Resident::from_asset(&asset);
            let layer = &asset.layers[0];
            for (components, lobes) in [(u32::MAX, u32::MAX), (2, u32::MAX), (1, 1), (0, 2)] {
                let options = DecodeOptions { components, lobes, ..DecodeOptions::default() };
                let decoder = ImageDecoder::new(&asset, &resident, 0, &options);
                let mut first_ref = 0;
                for texel in 0..asset.texel_count() {
                    let cluster = usize::from(layer.texel_clusters[texel]);
                    let lobes: Vec<_> = layer.dictionary[cluster].iter().map(|entry| entry.lobe).collect();
                    let tables = lobe_tables(&lobes, &layer.views, &layer.lights);
                    let mut slow = vec![0.0; 7 * 9 * 3];
                    decode_measured(&resident, &asset, 0, texel, first_ref, &tables, &options, &mut slow);
                    first_ref += usize::from(layer.texel_lobe_counts[texel]);
                    for pair in 0..7 * 9 {
                        let fast = image(&decoder, 15, Spot::Measured(pair / 9), Spot::Measured(pair % 9));
                        assert_eq!(fast[texel * 3..texel * 3 + 3], slow[pair * 3..pair * 3 + 3], "{kind:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn other_directions_agree_with_the_runtime_under_both_rules_and_at_the_horizon() {
        let near = |a: f32, b: f32| (a - b).abs() <= 1e-5 + 1e-4 * b.abs();
        let directions = DirectionSet::random(12, 99).unwrap().units();
        let grazing = [[1.0, 0.0, 0.0], [0.9999, 0.0, 0.014_141], [0.0, -0.6, -0.8]];
        for kind in KINDS {
            let asset = asset(kind);
            let resident = Resident::from_asset(&asset);
            let (lights, views) = (&asset.layers[0].lights, &asset.layers[0].views);
            for interpolation in [Interpolation::Fast, Interpolation::Exact] {
                let options = DecodeOptions { interpolation, ..DecodeOptions::default() };
                let decoder = ImageDecoder::new(&asset, &resident, 0, &options);
                let mut rules_differ = false;
                for wi in directions.iter().chain(&grazing).chain([&lights.direction(4)]) {
                    for wo in directions.iter().chain(&grazing).chain([&views.direction(2)]) {
                        let fast = image(&decoder, 15, Spot::find(views, *wo), Spot::find(lights, *wi));
                        for texel in 0..15 {
                            let slow = decode(&resident, 0, texel as u32, *wi, *wo, &options);
                            let other = match interpolation {
                                Interpolation::Fast => Interpolation::Exact,
                                Interpolation::Exact => Interpolation::Fast,
                            };
                            let other = DecodeOptions { interpolation: other, ..options };
                            let planted = decode(&resident, 0, texel as u32, *wi, *wo, &other);
                            for c in 0..3 {
                                let got = fast[texel * 3 + c];
                                assert!(near(got, slow[c]), "{kind:?} {interpolation:?} {wi:?} {wo:?}: {got} {slow:?}");
                                rules_differ |= !near(got, planted[c]);
                            }
                        }
                    }
                }
                assert!(rules_differ, "the planted rule must not agree");
            }
        }
    }

    #[test]
    fn an_asset_without_residual_decodes_to_its_lobes() {
        let mut asset = sample_asset();
        asset.layers[0].residual = None;
        let resident = Resident::from_asset(&asset);
        let options = DecodeOptions::default();
        let decoder = ImageDecoder::new(&asset, &resident, 0, &options);
        let (wi, wo) = (asset.layers[0].lights.direction(3), asset.layers[0].views.direction(5));
        let fast = image(&decoder, 15, Spot::Measured(5), Spot::Measured(3));
        for texel in 0..15 {
            assert_eq!(fast[texel * 3..texel * 3 + 3], decode(&resident, 0, texel as u32, wi, wo, &options));
        }
        assert!(fast.iter().any(|x| *x > 0.0));
    }

    #[test]
    fn a_direction_is_measured_within_a_hundredth_of_a_degree_only() {
        let set = DirectionSet::bonn81();
        let sphere = Sphere::new(&set.units()).unwrap();
        let shifted = |by: f64| btf_capture::Direction::new(75.0 + by, 345.0).unit();
        assert_eq!(Spot::find(&sphere, shifted(0.009)), Spot::Measured(80));
        assert!(matches!(Spot::find(&sphere, shifted(0.011)), Spot::Other(_)));
        assert_eq!(Spot::of_set(&sphere, &set, Side::Front), (0..81).map(Spot::Measured).collect::<Vec<_>>());
    }
}

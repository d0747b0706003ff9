//! Decoder of whole images: all texels for one pair of directions, for measuring and expanding. [`btf_runtime::decode`]
//! is the slow definition that it is tested against.
//!
//! A pair is planned once (lobe values and residual rows of every cluster), then the texels of a cluster are
//! decoded tile by tile, in vectors over the texels.

use crate::input::layer_frame::layer_directions;
use crate::measure::texel_tiles::{BasisWeights, RowWord, TILE_TEXELS, TexelTile, TileRgb, texel_tiles};
use btf_capture::{DirectionSet, Side};
use btf_runtime::twin_constants::MAX_CHANNEL;
use btf_runtime::{
    Asset, Channels, DecodeOptions, HORIZON_COS, HeightField, HeightUse, Interpolation, Layer, LobeRole, LobeSetup,
    MAX_GROUPS, Neighbours, RATIO_EPSILON, RATIO_RANGE, Resident, SeenBy, SingleBases, Sphere, SurfaceSide,
    ViewedTexel, block,
};
use half::f16;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};

/// Angle in degrees below which two directions count as the same.
pub const SAME_DIRECTION_DEG: f64 = 0.01;

/// A direction as a layer knows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Spot {
    /// Direction of the layer's own set, by number.
    Measured(usize),
    /// Any other direction: a unit vector in the layer's frame.
    Other([f32; 3]),
}

impl Spot {
    /// Returns the direction of `sphere` within [`SAME_DIRECTION_DEG`] of `unit`, or else `unit` itself.
    pub fn find(sphere: &Sphere, unit: [f32; 3]) -> Spot {
        let same = |id: &usize| is_same_direction(sphere.direction(*id as u32), unit);
        (0..sphere.len()).find(same).map_or(Spot::Other(unit), Spot::Measured)
    }

    /// Returns one spot per direction of the set of a capture of `side`. Of directions that come more than once each is that
    /// of its own number, if it is the same.
    pub fn of_set(sphere: &Sphere, set: &DirectionSet, side: Side) -> Vec<Spot> {
        let own = |number: usize, unit| {
            let is_own = number < sphere.len() && is_same_direction(sphere.direction(number as u32), unit);
            if is_own { Spot::Measured(number) } else { Spot::find(sphere, unit) }
        };
        layer_directions(set, side).into_iter().enumerate().map(|(number, unit)| own(number, unit)).collect()
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
    /// Number of the layer.
    number: usize,
    options: DecodeOptions,
    resident: &'a Resident,
    words: &'a [u32],
    /// First word of the expanded bases, `[cluster, pair, channel, word]`.
    basis_at: usize,
    /// Words per pair and channel in the resident form.
    channel_words: usize,
    /// Bases in single precision, where those are to be used.
    singles: Option<&'a SingleBases>,
    /// Words per pair and channel that the options use; 0 without residual.
    used_words: usize,
    interpolation: Interpolation,
    /// Heights of the layer, also as words, where parallax is to be removed.
    heights: Option<HeightField<'a>>,
    /// Eye beyond the measured views that was asked for last, and what it saw in each texel: its lights follow one
    /// another.
    last_seen: Mutex<([f32; 3], Arc<Vec<SeenBy>>)>,
    setups: Vec<LobeSetup>,
    /// Number of each cluster's first lobe in `setups`.
    first_lobe: Vec<usize>,
    tiles: Vec<TexelTile>,
    /// Weights of the channels of an asset with a spectrum in the values that are given, `[set][value]`: three to a set, of which
    /// the last is filled up with zeros. Empty for an asset of colours.
    shown: Vec<[Channels; 3]>,
    /// Whether a value follows from each group of channels.
    used: [bool; MAX_GROUPS],
    /// Values that are given for a texel: three colours, or bands.
    values: usize,
    /// Groups of channels.
    groups: usize,
}

/// Channels of a tile of texels, `[group]`; those of groups that nothing follows from are any finite numbers.
pub type TileChannels = [TileRgb; MAX_GROUPS];

/// Everything that all texels share at one pair of directions.
pub struct PairPlan {
    /// Neighbour pairs that are interpolated.
    taps: Vec<Tap>,
    /// Lobe values at the pair itself; only for exact interpolation.
    here: Option<Vec<f32>>,
    /// Factor of everything towards the horizon.
    fade: f32,
    /// Finished image, where parallax is removed and a texel shows other texels.
    image: Option<Vec<[f32; 3]>>,
    /// Plans of the other groups of channels.
    more: Vec<PairPlan>,
}

impl PairPlan {
    /// Plan of a black image, which every other plan starts from.
    const NOTHING: PairPlan = PairPlan { taps: Vec::new(), here: None, fade: 1.0, image: None, more: Vec::new() };

    /// Returns the image as a plain sum; `None` where directions are interpolated by the exact rule or with heights, and for a
    /// black image.
    pub(crate) fn plain(&self) -> Option<PlainImage<'_>> {
        match (&self.taps[..], &self.here, &self.image) {
            ([Tap { values, rows, .. }], None, None) => Some(PlainImage { values, rows, fade: self.fade }),
            _ => None,
        }
    }
}

/// What an image consists of that is a sum of a cluster's lobes and bases.
pub(crate) struct PlainImage<'a> {
    /// Value of each lobe of all clusters.
    pub values: &'a [f32],
    /// Residual rows `[cluster, word]`.
    pub rows: &'a [RowWord],
    /// Factor of everything.
    pub fade: f32,
}

struct Tap {
    weight: f32,
    /// Lobe values `[lobe]` of all clusters.
    values: Vec<f32>,
    /// Residual rows `[cluster, word]`.
    rows: Vec<RowWord>,
}

impl<'a> ImageDecoder<'a> {
    /// Returns a decoder of layer `layer`. `resident` must be `asset`'s.
    ///
    /// # Panics
    /// If `layer` is out of range.
    pub fn new(asset: &'a Asset, resident: &'a Resident, layer: usize, options: &DecodeOptions) -> ImageDecoder<'a> {
        let words = resident.words();
        let base = words[btf_runtime::ASSET_LAYERS + layer] as usize;
        let source = &asset.layers[layer];
        let bases = words[base + block::BASES].min(options.components.saturating_add(1)) as usize;
        let spectrum = resident.spectrum();
        let mut setups = Vec::new();
        let mut first_lobe = Vec::new();
        for dictionary in &source.dictionary {
            first_lobe.push(setups.len());
            setups.extend(dictionary.iter().map(|entry| entry.lobe.setup()));
        }
        let decoder = ImageDecoder {
            layer: source,
            number: layer,
            options: *options,
            resident,
            words,
            basis_at: words[base + block::BASIS] as usize,
            channel_words: words[base + block::CHANNEL_WORDS] as usize,
            singles: None,
            used_words: bases.div_ceil(2),
            interpolation: options.interpolation,
            heights: source
                .heights
                .as_ref()
                .filter(|_| options.heights != HeightUse::None)
                .map(|heights| heights.field([asset.width, asset.height])),
            last_seen: Mutex::new(([0.0; 3], Arc::default())),
            setups,
            first_lobe,
            tiles: texel_tiles(source, bases, options.lobes as usize),
            groups: spectrum.as_ref().map_or(1, |spectrum| spectrum.groups),
            shown: Vec::new(),
            used: [true; MAX_GROUPS],
            values: 3,
        };
        match spectrum {
            Some(spectrum) => decoder.showing(&spectrum.shown),
            None => decoder,
        }
    }

    /// Returns this decoder with `bases`, which must be of the same asset, in place of the resident
    /// form's half-precision bases.
    pub fn with_single_bases(self, bases: &'a SingleBases) -> ImageDecoder<'a> {
        ImageDecoder { singles: Some(bases), ..self }
    }

    /// Returns the layer.
    pub(crate) fn layer(&self) -> &Layer {
        self.layer
    }

    /// Returns the number of the first lobe of `cluster`.
    pub(crate) fn first_lobe(&self, cluster: usize) -> usize {
        self.first_lobe[cluster]
    }

    /// Returns the numbers of clusters, of lobes of all of them, and of words of a residual row.
    pub(crate) fn counts(&self) -> [usize; 3] {
        [self.first_lobe.len(), self.setups.len(), self.used_words]
    }

    /// Returns this decoder of an asset with a spectrum, giving other values than the asset asks for, of which there may be
    /// any number: weights of the channels in each, as those of [`btf_runtime::Spectrum::weights`] for all bands.
    pub fn showing(self, weights: &[Channels]) -> ImageDecoder<'a> {
        let set = |set: &[Channels]| std::array::from_fn(|value| set.get(value).copied().unwrap_or_default());
        let is_used = |group: usize| weights.iter().any(|weights| weights[3 * group..3 * group + 3] != [0.0; 3]);
        ImageDecoder {
            shown: weights.chunks(3).map(set).collect(),
            used: std::array::from_fn(is_used),
            values: weights.len(),
            ..self
        }
    }

    /// Returns whether values follow from the channels of a spectrum.
    pub(crate) fn is_spectral(&self) -> bool {
        !self.shown.is_empty()
    }

    /// Returns the number of values that are given for a texel: three colours, or bands.
    pub fn values(&self) -> usize {
        self.values
    }

    /// Returns the number of sets of three that these values come in.
    pub fn sets(&self) -> usize {
        self.values.div_ceil(3)
    }

    /// Returns the tiles of all texels of the layer, each texel once.
    pub fn tiles(&self) -> &[TexelTile] {
        &self.tiles
    }

    /// Plans a pair. Cost: an evaluation of every dictionary lobe, ten where neither direction is measured and the
    /// interpolation is exact.
    pub fn plan(&self, view: Spot, light: Spot) -> PairPlan {
        let more = (1..self.groups).map(|group| self.plan_group(view, light, group)).collect();
        PairPlan { more, ..self.plan_group(view, light, 0) }
    }

    /// Plans a pair for a group of channels.
    fn plan_group(&self, view: Spot, light: Spot, group: usize) -> PairPlan {
        let (lights, views) = (&self.layer.lights, &self.layer.views);
        let first = group * (lights.len() / self.groups);
        if let (Spot::Measured(v), Spot::Measured(l)) = (view, light) {
            return PairPlan { taps: vec![self.tap(v, first + l, 1.0)], ..PairPlan::NOTHING };
        }
        let (wo, out) = neighbours(views, view);
        let (wi, mut into) = neighbours(lights, light);
        into.ids = into.ids.map(|id| id + first as u32);
        if wi[2] <= 0.0 || wo[2] <= 0.0 {
            return PairPlan::NOTHING;
        }
        let fade = (wi[2] / HORIZON_COS.min(lights.least_cosine())).min(1.0);
        if self.has_relief() {
            return PairPlan { image: Some(self.relief_image(wi, wo, group)), ..PairPlan::NOTHING };
        }
        if let Some(field) = self.heights.as_ref().filter(|_| out.beyond < 1.0) {
            let image = self.shifted_image([wi, wo], [&into, &out], fade, &self.seen_by(field, wo, &out));
            return PairPlan { image: Some(image), ..PairPlan::NOTHING };
        }
        let exact = self.interpolation == Interpolation::Exact && self.used_words > 0;
        let here = self.lobe_values(self.toward(wi, &into), wo);
        let mut taps = Vec::new();
        for v in 0..3 {
            for l in 0..3 {
                let weight = out.weights[v] * into.weights[l];
                if weight > 0.0 {
                    taps.push(self.tap(out.ids[v] as usize, into.ids[l] as usize, weight));
                }
            }
        }
        if exact {
            return PairPlan { taps, here: Some(here), fade, ..PairPlan::NOTHING };
        }
        // The fast rule is linear in the residual, so its nine rows become one.
        let mut rows = vec![[[0.0; 2]; 3]; self.first_lobe.len() * self.used_words];
        for tap in &taps {
            for (sum, row) in
                rows.as_flattened_mut().as_flattened_mut().iter_mut().zip(tap.rows.as_flattened().as_flattened())
            {
                *sum += tap.weight * row;
            }
        }
        let (scale, falling) = self.beyond(&into);
        rows.as_flattened_mut().as_flattened_mut().iter_mut().for_each(|row| *row *= scale);
        let fade = fade * falling;
        let taps = vec![Tap { weight: 1.0, values: here, rows }];
        PairPlan { taps, fade, ..PairPlan::NOTHING }
    }

    /// Returns whether relief corrects the interpolation between measured directions.
    fn has_relief(&self) -> bool {
        self.options.heights == HeightUse::Relief
            && self.interpolation == Interpolation::Fast
            && self.layer.relief.is_some()
            && self.used_words > 0
    }

    /// Returns the image at `[wi, wo]`, whose interpolation relief corrects texel by texel.
    fn relief_image(&self, wi: [f32; 3], wo: [f32; 3], group: usize) -> Vec<[f32; 3]> {
        let layer = self.number as u32;
        let back = [self.layer.light_side, self.layer.view_side].map(|side| side == SurfaceSide::Back);
        let [wi, wo] = [(wi, back[0]), (wo, back[1])].map(|([x, y, z], back)| [x, y, if back { -z } else { z }]);
        let texels = (0..self.layer.texel_clusters.len() as u32).into_par_iter();
        texels
            .map(|texel| {
                let viewed = match self.singles {
                    Some(bases) => ViewedTexel::new_single(self.resident, bases, layer, texel, wo, &self.options),
                    None => ViewedTexel::new(self.resident, layer, texel, wo, &self.options),
                };
                let channels = viewed.channels_alone(wi).unwrap_or_default();
                [0, 1, 2].map(|c| channels[3 * group + c])
            })
            .collect()
    }

    /// Returns the direction for which lobes are evaluated with a light at `wi`, whose neighbours are `light`.
    fn toward(&self, wi: [f32; 3], light: &Neighbours) -> [f32; 3] {
        let nearest = self.layer.lobe_role == LobeRole::Base && self.interpolation == Interpolation::Fast;
        if nearest && self.used_words > 0 { self.layer.lights.within_hull(wi, light) } else { wi }
    }

    /// Returns the factors of the residual and of the value by the fast rule, for a light with these neighbours.
    fn beyond(&self, light: &Neighbours) -> (f32, f32) {
        match self.layer.lobe_role {
            _ if self.used_words == 0 => (1.0, 1.0),
            LobeRole::OldBase => (self.layer.residual_kind.scale_beyond(light.beyond), 1.0),
            LobeRole::Guide | LobeRole::Base => (1.0, light.beyond),
        }
    }

    /// Returns for every texel the texels that an eye at `wo` sees in its place.
    fn seen_by(&self, field: &HeightField, wo: [f32; 3], view: &Neighbours) -> Arc<Vec<SeenBy>> {
        let last = || self.last_seen.lock().unwrap_or_else(PoisonError::into_inner);
        let (of, seen) = last().clone();
        if of == wo && !seen.is_empty() {
            return seen;
        }
        let views = view.ids.map(|id| self.layer.views.direction(id));
        let texels = (0..self.layer.texel_clusters.len() as u32).into_par_iter();
        let seen: Arc<Vec<SeenBy>> =
            Arc::new(texels.map(|texel| field.seen_by(texel, wo, view.beyond, &views, &view.weights)).collect());
        *last() = (wo, Arc::clone(&seen));
        seen
    }

    /// Returns the image at `[wi, wo]`, whose neighbours are `[light, view]`, with the parallax between the views
    /// removed: it decodes the image of each neighbour view, then takes every texel from those that show what is `seen`
    /// in its place.
    fn shifted_image(
        &self,
        [wi, wo]: [[f32; 3]; 2],
        [light, view]: [&Neighbours; 2],
        fade: f32,
        seen: &[SeenBy],
    ) -> Vec<[f32; 3]> {
        let (kind, epsilon) = (self.layer.residual_kind, self.layer.epsilon);
        let guide = self.layer.lobe_role == LobeRole::Guide;
        let exact = self.interpolation == Interpolation::Exact && self.used_words > 0;
        let arch = Arch::new();
        let (scale, falling) = self.beyond(light);
        let here = match guide && self.used_words > 0 && !exact {
            true => vec![[0.0; 3]; seen.len()],
            false => arch.dispatch(LobeImage { decoder: self, values: &self.lobe_values(self.toward(wi, light), wo) }),
        };
        let parts = [0, 1, 2].map(|v| {
            if view.weights[v] <= 0.0 || self.used_words == 0 {
                return ViewParts { values: vec![[0.0; 3]; seen.len()], lobes: vec![[0.0; 3]; seen.len()] };
            }
            let taps: Vec<Tap> = (0..3)
                .filter(|l| light.weights[*l] > 0.0)
                .map(|l| self.tap(view.ids[v] as usize, light.ids[l] as usize, light.weights[l]))
                .collect();
            arch.dispatch(PartsOfView { decoder: self, taps: &taps, exact })
        });
        let blend = |seen: &SeenBy, image: &dyn Fn(usize) -> [f32; 3]| {
            let mut sum = [0.0; 3];
            for v in (0..3).filter(|v| seen.weights[*v] > 0.0) {
                let value = image(v);
                (0..3).for_each(|c| sum[c] += seen.weights[v] * value[c]);
            }
            sum
        };
        let share = if guide { 0.0 } else { 1.0 };
        seen.iter()
            .map(|seen| {
                let at = |v: usize| seen.texels[v] as usize;
                let here = blend(seen, &|v| here[at(v)]);
                if self.used_words == 0 {
                    return here.map(|x| x.max(0.0) * fade);
                }
                let value = blend(seen, &|v| parts[v].values[at(v)]);
                if !exact {
                    let combined = |c: usize| kind.combine(share * here[c], scale * value[c], epsilon);
                    return [0, 1, 2].map(|c| combined(c) * (falling * fade));
                }
                let lobes = blend(seen, &|v| parts[v].lobes[at(v)]);
                [0, 1, 2].map(|c| {
                    let ratio = (here[c] + RATIO_EPSILON) / (lobes[c] + RATIO_EPSILON);
                    value[c] * ratio.clamp(RATIO_RANGE[0], RATIO_RANGE[1]) * fade
                })
            })
            .collect()
    }

    /// Returns one measured view at lights between the measured ones: the residual interpolated, or, for the exact
    /// rule, values and lobes.
    #[inline(always)]
    fn parts_of_view<S: Simd>(&self, simd: S, taps: &[Tap], exact: bool) -> ViewParts {
        let zero = [[0.0f32; TILE_TEXELS]; 3];
        let texels = self.layer.texel_clusters.len();
        let mut parts = ViewParts { values: vec![[0.0; 3]; texels], lobes: vec![[0.0; 3]; texels] };
        let mut weights = BasisWeights::default();
        for tile in &self.tiles {
            tile.unpack(&mut weights);
            let rows = tile.cluster * self.used_words..(tile.cluster + 1) * self.used_words;
            let (mut value, mut lobes) = (zero, zero);
            for tap in taps {
                let (mut decoded, mut sums) = (zero, zero);
                if exact {
                    self.combine(simd, tile, &weights, tap, &mut decoded);
                    self.lobe_sums(tile, &tap.values, &mut sums);
                } else {
                    weights.residual_sums(simd, &tap.rows[rows.clone()], &mut decoded);
                }
                for c in 0..3 {
                    for i in 0..TILE_TEXELS {
                        value[c][i] += tap.weight * decoded[c][i];
                        lobes[c][i] += tap.weight * sums[c][i];
                    }
                }
            }
            for (i, texel) in tile.texels.iter().enumerate() {
                parts.values[*texel as usize] = [value[0][i], value[1][i], value[2][i]];
                parts.lobes[*texel as usize] = [lobes[0][i], lobes[1][i], lobes[2][i]];
            }
        }
        parts
    }

    /// Returns the image of the lobes alone, of all texels.
    #[inline(always)]
    fn lobe_image(&self, values: &[f32]) -> Vec<[f32; 3]> {
        let mut image = vec![[0.0; 3]; self.layer.texel_clusters.len()];
        let mut sums = [[0.0; TILE_TEXELS]; 3];
        for tile in &self.tiles {
            self.lobe_sums(tile, values, &mut sums);
            for (i, texel) in tile.texels.iter().enumerate() {
                image[*texel as usize] = [sums[0][i], sums[1][i], sums[2][i]];
            }
        }
        image
    }

    /// Decodes the channels of `tile`'s texels at `plan`'s pair, from which [`ImageDecoder::show`] makes values. `weights` must be
    /// those of this tile.
    ///
    /// At a measured pair the same operations in the same order as [`btf_runtime::decode_measured`].
    /// Cost: about 3 ns and 0.2 ns per basis a sample on one core.
    #[inline(always)]
    pub fn decode_channels<S: Simd>(
        &self,
        simd: S,
        tile: &TexelTile,
        weights: &BasisWeights,
        plan: &PairPlan,
        out: &mut TileChannels,
    ) {
        for ((plan, out), used) in std::iter::once(plan).chain(&plan.more).zip(out).zip(self.used) {
            if used {
                self.decode_group(simd, tile, weights, plan, out);
            }
        }
    }

    /// Makes a set of three values from `channels`: linear reflectance x cosine, of colours or bands.
    #[inline(always)]
    pub fn show(&self, channels: &TileChannels, set: usize, out: &mut TileRgb) {
        let Some(shown) = self.shown.get(set) else {
            *out = channels[0];
            return;
        };
        *out = [[0.0; TILE_TEXELS]; 3];
        for (group, channels) in channels.iter().enumerate().take(self.groups).filter(|(group, _)| self.used[*group]) {
            for (sums, weights) in out.iter_mut().zip(shown) {
                for (channel, values) in channels.iter().enumerate() {
                    let weight = weights[3 * group + channel];
                    sums.iter_mut().zip(values).for_each(|(sum, x)| *sum += weight * x.min(MAX_CHANNEL));
                }
            }
        }
        out.as_flattened_mut().iter_mut().for_each(|sum| *sum = sum.max(0.0));
    }

    /// Decodes the channels of a group of `tile`'s texels.
    #[inline(always)]
    fn decode_group<S: Simd>(
        &self,
        simd: S,
        tile: &TexelTile,
        weights: &BasisWeights,
        plan: &PairPlan,
        out: &mut TileRgb,
    ) {
        if let Some(image) = &plan.image {
            for (i, texel) in tile.texels.iter().enumerate() {
                (0..3).for_each(|c| out[c][i] = image[*texel as usize][c]);
            }
            return;
        }
        match (&plan.here, plan.taps.first()) {
            (_, None) => out.as_flattened_mut().fill(0.0),
            (None, Some(tap)) => self.combine(simd, tile, weights, tap, out),
            (Some(here), _) => self.decode_exact(simd, tile, weights, here, &plan.taps, out),
        }
        if plan.fade != 1.0 {
            out.as_flattened_mut().iter_mut().for_each(|x| *x *= plan.fade);
        }
    }

    /// Decodes a whole image at `plan`'s pair, `[texel, value]`, tile by tile.
    pub fn decode_image(&self, plan: &PairPlan, out: &mut [f32]) {
        Arch::new().dispatch(DecodeTiles { decoder: self, plan, out });
    }

    #[inline(always)]
    fn decode_tiles<S: Simd>(&self, simd: S, plan: &PairPlan, out: &mut [f32]) {
        let mut weights = BasisWeights::default();
        let mut channels = [[[0.0; TILE_TEXELS]; 3]; MAX_GROUPS];
        let mut decoded = [[0.0; TILE_TEXELS]; 3];
        for tile in &self.tiles {
            tile.unpack(&mut weights);
            self.decode_channels(simd, tile, &weights, plan, &mut channels);
            for set in 0..self.sets() {
                self.show(&channels, set, &mut decoded);
                for (i, texel) in tile.texels.iter().enumerate() {
                    let texel = &mut out[*texel as usize * self.values..][3 * set..self.values.min(3 * set + 3)];
                    texel.iter_mut().zip(&decoded).for_each(|(value, decoded)| *value = decoded[i]);
                }
            }
        }
    }

    /// Decodes by the exact rule: the neighbours decoded and interpolated, times the clamped ratio of the lobes at the
    /// pair to the lobes interpolated.
    #[inline(always)]
    fn decode_exact<S: Simd>(
        &self,
        simd: S,
        tile: &TexelTile,
        weights: &BasisWeights,
        here: &[f32],
        taps: &[Tap],
        out: &mut TileRgb,
    ) {
        let zero = [[0.0; TILE_TEXELS]; 3];
        let (mut sums, mut decoded, mut lobes) = (zero, zero, zero);
        out.as_flattened_mut().fill(0.0);
        for tap in taps {
            self.lobe_sums(tile, &tap.values, &mut sums);
            self.combine(simd, tile, weights, tap, &mut decoded);
            for c in 0..3 {
                for i in 0..TILE_TEXELS {
                    out[c][i] += tap.weight * decoded[c][i];
                    lobes[c][i] += tap.weight * sums[c][i];
                }
            }
        }
        self.lobe_sums(tile, here, &mut sums);
        for c in 0..3 {
            for i in 0..TILE_TEXELS {
                let ratio = (sums[c][i] + RATIO_EPSILON) / (lobes[c][i] + RATIO_EPSILON);
                out[c][i] *= ratio.clamp(RATIO_RANGE[0], RATIO_RANGE[1]);
            }
        }
    }

    /// Combines lobes and residual at `tap`.
    #[inline(always)]
    fn combine<S: Simd>(&self, simd: S, tile: &TexelTile, weights: &BasisWeights, tap: &Tap, out: &mut TileRgb) {
        let (kind, epsilon) = (self.layer.residual_kind, self.layer.epsilon);
        if self.used_words == 0 {
            return self.lobe_sums(tile, &tap.values, out);
        }
        // Guiding lobes add nothing.
        if tile.has_lobes() && self.layer.lobe_role != LobeRole::Guide {
            self.lobe_sums(tile, &tap.values, out);
            kind.encode_slice(out.as_flattened_mut(), epsilon);
        } else {
            out.as_flattened_mut().fill(kind.encode(0.0, epsilon));
        }
        let mut residual = [[0.0; TILE_TEXELS]; 3];
        let rows = tile.cluster * self.used_words..(tile.cluster + 1) * self.used_words;
        weights.residual_sums(simd, &tap.rows[rows], &mut residual);
        for (x, r) in out.as_flattened_mut().iter_mut().zip(residual.as_flattened()) {
            *x += r;
        }
        kind.decode_slice(out.as_flattened_mut(), epsilon);
    }

    #[inline(always)]
    fn lobe_sums(&self, tile: &TexelTile, values: &[f32], sums: &mut TileRgb) {
        tile.lobe_sums(&values[self.first_lobe[tile.cluster]..], sums);
    }

    fn tap(&self, view: usize, light: usize, weight: f32) -> Tap {
        let layer = self.layer;
        let values = self.lobe_values(layer.lights.direction(light as u32), layer.views.direction(view as u32));
        let pair = view * layer.lights.len() + light;
        let pairs = layer.views.len() * layer.lights.len();
        let singles = self.singles.map(|bases| bases.layer(self.number));
        let mut rows = Vec::with_capacity(self.first_lobe.len() * self.used_words);
        for cluster in 0..self.first_lobe.len() {
            let at = (cluster * pairs + pair) * 3 * self.channel_words;
            rows.extend((0..self.used_words).map(|word| {
                [0, 1, 2].map(|channel| {
                    let at = at + channel * self.channel_words + word;
                    if let Some(singles) = singles {
                        return [singles[2 * at], singles[2 * at + 1]];
                    }
                    let halves = self.words[self.basis_at + at];
                    [halves as u16, (halves >> 16) as u16].map(|bits| f16::from_bits(bits).to_f32())
                })
            }));
        }
        Tap { weight, values, rows }
    }

    fn lobe_values(&self, wi: [f32; 3], wo: [f32; 3]) -> Vec<f32> {
        self.setups.iter().map(|setup| setup.eval(wi, wo)).collect()
    }
}

/// Body of [`ImageDecoder::decode_image`] as a type: a closure would not be inlined where the wide vectors are.
struct DecodeTiles<'a> {
    decoder: &'a ImageDecoder<'a>,
    plan: &'a PairPlan,
    out: &'a mut [f32],
}

impl WithSimd for DecodeTiles<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.decoder.decode_tiles(simd, self.plan, self.out);
    }
}

/// Images of one measured view, `[texel, channel]`.
struct ViewParts {
    values: Vec<[f32; 3]>,
    lobes: Vec<[f32; 3]>,
}

struct PartsOfView<'a> {
    decoder: &'a ImageDecoder<'a>,
    taps: &'a [Tap],
    exact: bool,
}

impl WithSimd for PartsOfView<'_> {
    type Output = ViewParts;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> ViewParts {
        self.decoder.parts_of_view(simd, self.taps, self.exact)
    }
}

struct LobeImage<'a> {
    decoder: &'a ImageDecoder<'a>,
    values: &'a [f32],
}

impl WithSimd for LobeImage<'_> {
    type Output = Vec<[f32; 3]>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Vec<[f32; 3]> {
        self.decoder.lobe_image(self.values)
    }
}

/// Returns a spot's unit vector and its neighbours in the set.
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

#[cfg(test)]
mod tests;

//! The decoder: from texel, light and eye to reflectance times cosine. Twin: `shaders/decode.wgsl`.

use crate::asset::Asset;
use crate::lobe::{LobeSetup, RESIDENT_WORDS};
use crate::quantize::{coefficient_from_code, half_at, weight_from_byte};
use crate::resident::{ASSET_LAYERS, Resident, block};
use crate::residual::{ResidualKind, core_at_pair};
use crate::sphere::{direction, locate};

/// How the residual is carried from the measured directions to others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Interpolation {
    /// Interpolate the residual, then combine it with the lobes: one lobe evaluation.
    Fast = 0,
    /// Decode the nine neighbours to linear, interpolate those, multiply by the clamped ratio of the
    /// lobes here to the lobes interpolated: ten lobe evaluations.
    Exact = 1,
}

/// The speed and accuracy dial of one evaluation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DecodeOptions {
    /// Residual components at most; `u32::MAX` for all. 0 keeps the residual's mean.
    pub components: u32,
    /// Lobes per texel at most; `u32::MAX` for all.
    pub lobes: u32,
    /// Interpolation rule.
    pub interpolation: Interpolation,
}

impl Default for DecodeOptions {
    fn default() -> DecodeOptions {
        DecodeOptions { components: u32::MAX, lobes: u32::MAX, interpolation: Interpolation::Fast }
    }
}

/// Added to both lobe sums before their ratio is taken (exact rule).
pub const RATIO_EPSILON: f32 = 0.03;
/// Range of that ratio.
pub const RATIO_RANGE: [f32; 2] = [0.3, 4.0];

fn f(words: &[u32], index: usize) -> f32 {
    f32::from_bits(words[index])
}

/// A texel within a layer: what does not depend on the directions.
struct Texel<'a> {
    words: &'a [u32],
    layer: usize,
    texel: usize,
    cluster: usize,
    lobes: usize,
    first_ref: usize,
    bases: usize,
}

impl<'a> Texel<'a> {
    fn new(resident: &'a Resident, layer: u32, texel: u32, options: &DecodeOptions) -> Texel<'a> {
        let words = resident.words();
        let layer = words[ASSET_LAYERS + layer as usize] as usize;
        let record = words[layer + block::RECORDS] as usize + 2 * texel as usize;
        Texel {
            words,
            layer,
            texel: texel as usize,
            cluster: (words[record] & 0xffff) as usize,
            lobes: (words[record] >> 16).min(options.lobes) as usize,
            first_ref: words[record + 1] as usize,
            bases: words[layer + block::BASES].min(options.components.saturating_add(1)) as usize,
        }
    }

    fn field(&self, field: usize) -> usize {
        self.words[self.layer + field] as usize
    }

    /// Sum of the lobes, RGB.
    fn lobe_sum(&self, wi: [f32; 3], wo: [f32; 3]) -> [f32; 3] {
        let dictionary = self.words[self.field(block::DICTIONARIES) + self.cluster] as usize;
        let refs = self.field(block::REFS) + self.first_ref;
        let mut sum = [0.0; 3];
        for slot in 0..self.lobes {
            let reference = self.words[refs + slot];
            let at = dictionary + (reference & 0xff) as usize * RESIDENT_WORDS;
            let (lobe, scale) = LobeSetup::from_resident_words(&self.words[at..at + RESIDENT_WORDS]);
            let value = lobe.eval(wi, wo);
            for c in 0..3 {
                sum[c] += weight_from_byte(reference >> (8 * (c as u32 + 1)) & 0xff, scale) * value;
            }
        }
        sum
    }

    /// Weight of basis `index`: 1 for the mean, the decoded code for a component.
    fn basis_weight(&self, index: usize) -> f32 {
        if index == 0 {
            return 1.0;
        }
        if index >= self.bases {
            return 0.0;
        }
        let component = index - 1;
        let word = self.words[self.field(block::CODES) + self.texel * self.field(block::CODE_WORDS) + component / 4];
        let bits = self.words[self.field(block::BITS) + component];
        coefficient_from_code(word >> (8 * (component as u32 % 4)) & 0xff, bits)
    }

    /// Residual at `pairs`, RGB each, added into `out`.
    fn residual(&self, pairs: &[usize; 9], out: &mut [[f32; 3]; 9]) {
        let channel_words = self.field(block::CHANNEL_WORDS);
        let cluster_at = self.field(block::BASIS) + self.cluster * self.field(block::PAIRS) * 3 * channel_words;
        for word in 0..self.bases.div_ceil(2) {
            let (even, odd) = (self.basis_weight(2 * word), self.basis_weight(2 * word + 1));
            for (pair, out) in pairs.iter().zip(out.iter_mut()) {
                for (c, out) in out.iter_mut().enumerate() {
                    let halves = self.words[cluster_at + (pair * 3 + c) * channel_words + word];
                    *out += even * half_at(halves, 0) + odd * half_at(halves, 1);
                }
            }
        }
    }
}

/// Reflectance times cosine times pi of `texel` in `layer` of a resident asset, linear RGB, at least 0.
///
/// `wi` points to the light, `wo` to the eye, both unit, in the texel's frame. A light or an eye on
/// another side than the layer's gives 0. `layer` and `texel` must be within the asset.
pub fn decode(
    resident: &Resident,
    layer: u32,
    texel: u32,
    wi: [f32; 3],
    wo: [f32; 3],
    options: &DecodeOptions,
) -> [f32; 3] {
    let t = Texel::new(resident, layer, texel, options);
    let words = t.words;
    let wi = [wi[0], wi[1], if t.field(block::LIGHT_SIDE) == 1 { -wi[2] } else { wi[2] }];
    let wo = [wo[0], wo[1], if t.field(block::VIEW_SIDE) == 1 { -wo[2] } else { wo[2] }];
    if wi[2] <= 0.0 || wo[2] <= 0.0 {
        return [0.0; 3];
    }
    let fade = (wi[2] / f(words, t.layer + block::HORIZON)).min(1.0);
    let here = t.lobe_sum(wi, wo);
    if t.bases == 0 {
        return here.map(|x| x.max(0.0) * fade);
    }
    let (lights_at, views_at) = (t.field(block::LIGHTS), t.field(block::VIEWS));
    let light = locate(words, lights_at, wi);
    let view = locate(words, views_at, wo);
    let light_count = t.field(block::LIGHT_COUNT);
    let mut pairs = [0; 9];
    let mut weights = [0.0; 9];
    for v in 0..3 {
        for l in 0..3 {
            pairs[v * 3 + l] = view.ids[v] as usize * light_count + light.ids[l] as usize;
            weights[v * 3 + l] = view.weights[v] * light.weights[l];
        }
    }
    let mut residual = [[0.0; 3]; 9];
    t.residual(&pairs, &mut residual);
    let kind = ResidualKind::from_number(t.field(block::RESIDUAL_KIND) as u32).unwrap_or(ResidualKind::Additive);
    let epsilon = f(words, t.layer + block::EPSILON);

    if options.interpolation == Interpolation::Fast {
        let mut r = [0.0; 3];
        for (weight, residual) in weights.iter().zip(&residual) {
            for c in 0..3 {
                r[c] += weight * residual[c];
            }
        }
        return [0, 1, 2].map(|c| kind.combine(here[c], r[c], epsilon, light.beyond) * fade);
    }

    let mut decoded = [0.0; 3];
    let mut lobes = [0.0; 3];
    for v in 0..3 {
        let wo_measured = direction(words, views_at, view.ids[v]);
        for l in 0..3 {
            let wi_measured = direction(words, lights_at, light.ids[l]);
            let s = t.lobe_sum(wi_measured, wo_measured);
            for c in 0..3 {
                decoded[c] += weights[v * 3 + l] * kind.combine(s[c], residual[v * 3 + l][c], epsilon, 1.0);
                lobes[c] += weights[v * 3 + l] * s[c];
            }
        }
    }
    [0, 1, 2].map(|c| {
        let ratio = (here[c] + RATIO_EPSILON) / (lobes[c] + RATIO_EPSILON);
        decoded[c] * ratio.clamp(RATIO_RANGE[0], RATIO_RANGE[1]) * fade
    })
}

/// A texel's lobe sum at every measured pair, `[view, light, rgb]`, given its cluster's lobe tables
/// (`tables[lobe][pair]`, see [`lobe_tables`]). What fitting and measuring use instead of [`decode`].
pub fn lobe_sum_at_pairs(refs: &[crate::LobeRef], scales: &[f32], tables: &[Vec<f32>], out: &mut [f32]) {
    out.fill(0.0);
    for reference in refs {
        let table = &tables[usize::from(reference.lobe)];
        let weights = reference.weight.map(|q| weight_from_byte(q.into(), scales[usize::from(reference.lobe)]));
        for (out, value) in out.chunks_exact_mut(3).zip(table) {
            for c in 0..3 {
                out[c] += weights[c] * value;
            }
        }
    }
}

/// The values of each lobe of `dictionary` at every pair of `views` x `lights`, `[lobe][view * L + light]`.
pub fn lobe_tables(lobes: &[crate::Lobe], views: &crate::Sphere, lights: &crate::Sphere) -> Vec<Vec<f32>> {
    lobes
        .iter()
        .map(|lobe| {
            let setup = lobe.setup();
            let mut table = Vec::with_capacity(views.len() * lights.len());
            for v in 0..views.len() as u32 {
                for l in 0..lights.len() as u32 {
                    table.push(setup.eval(lights.direction(l), views.direction(v)));
                }
            }
            table
        })
        .collect()
}

/// All measured pairs of one texel, decoded: `out` is `[view, light, rgb]`.
///
/// `tables` are its cluster's [`lobe_tables`] and `bases` the cluster's rows as [`Resident`] holds them.
/// Agrees with [`decode`] at the measured directions up to rounding.
pub fn decode_measured(
    resident: &Resident,
    asset: &Asset,
    layer: usize,
    texel: usize,
    first_ref: usize,
    tables: &[Vec<f32>],
    options: &DecodeOptions,
    out: &mut [f32],
) {
    let source = &asset.layers[layer];
    let t = Texel::new(resident, layer as u32, texel as u32, options);
    let refs = &source.lobe_refs[first_ref..first_ref + t.lobes];
    let scales: Vec<f32> = source.dictionary[t.cluster].iter().map(|entry| entry.weight_scale).collect();
    lobe_sum_at_pairs(refs, &scales, tables, out);
    if t.bases == 0 {
        return;
    }
    let channel_words = t.field(block::CHANNEL_WORDS);
    let at = t.field(block::BASIS) + t.cluster * t.field(block::PAIRS) * 3 * channel_words;
    let rows = &t.words[at..at + out.len() * channel_words];
    let used = t.bases.div_ceil(2);
    let weights: Vec<[f32; 2]> =
        (0..used).map(|word| [t.basis_weight(2 * word), t.basis_weight(2 * word + 1)]).collect();
    for (out, row) in out.iter_mut().zip(rows.chunks_exact(channel_words)) {
        let mut r = 0.0;
        for (word, weight) in row[..used].iter().zip(&weights) {
            r += weight[0] * half_at(*word, 0) + weight[1] * half_at(*word, 1);
        }
        *out = source.residual_kind.combine(*out, r, source.epsilon, 1.0);
    }
}

/// One measured pair decoded straight from the file form, without the resident one: the memory end of
/// the decode-cost trade. `first_ref` is the texel's first lobe reference.
pub fn decode_from_file_form(
    asset: &Asset,
    layer: usize,
    texel: usize,
    first_ref: usize,
    view: usize,
    light: usize,
) -> [f32; 3] {
    let layer = &asset.layers[layer];
    let cluster = usize::from(layer.texel_clusters[texel]);
    let (wi, wo) = (layer.lights.direction(light as u32), layer.views.direction(view as u32));
    let mut s = [0.0; 3];
    for reference in &layer.lobe_refs[first_ref..first_ref + usize::from(layer.texel_lobe_counts[texel])] {
        let entry = layer.dictionary[cluster][usize::from(reference.lobe)];
        let value = entry.lobe.setup().eval(wi, wo);
        for c in 0..3 {
            s[c] += weight_from_byte(reference.weight[c].into(), entry.weight_scale) * value;
        }
    }
    let Some(residual) = &layer.residual else {
        return s;
    };
    let mut r = [0.0; 3];
    for (index, basis) in residual.bases.iter().enumerate() {
        let weight = match index.checked_sub(1).map(|i| &residual.coefficients[i]) {
            None => 1.0,
            Some(plane) => coefficient_from_code(plane.codes[texel].into(), plane.bits) * plane.steps[cluster].to_f32(),
        };
        let value = core_at_pair(&residual.factors, basis, cluster, view, light);
        for c in 0..3 {
            r[c] += weight * value[c];
        }
    }
    [0, 1, 2].map(|c| layer.residual_kind.combine(s[c], r[c], layer.epsilon, 1.0))
}

//! Decodes the measured pairs, without interpolation, for fitting and measuring.

use crate::asset::asset::{Asset, LobeRole};
use crate::asset::lobe_tables::lobe_sum_at_pairs;
use crate::asset::residual::{COLOUR_FRAME, core_at_pair};
use crate::decode::options::DecodeOptions;
use crate::decode::texel::Texel;
use crate::numeric::quantize::{half_at, weight_from_byte};
use crate::resident::layout::block;
use crate::resident::resident::Resident;

/// A texel of an asset's finest level, as the file form numbers it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TexelPlace {
    /// Number of the layer.
    pub layer: usize,
    /// Number of the texel, row by row.
    pub texel: usize,
    /// Number of the texel's first lobe reference: the sum of the lobe counts before the texel.
    pub first_ref: usize,
}

/// Decodes all measured pairs of one texel; `out` is `[view, light, rgb]`.
///
/// `resident` must be made of `asset`, and `tables` are the [`crate::lobe_tables`] of the texel's cluster. Agrees with
/// [`crate::decode`] at the measured directions up to rounding, but leaves edits out: the result is what was measured.
pub fn decode_measured(
    resident: &Resident,
    asset: &Asset,
    TexelPlace { layer, texel, first_ref }: TexelPlace,
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
    let share = if source.lobe_role == LobeRole::Guide { 0.0 } else { 1.0 };
    if t.is_packed() {
        let weights = t.packed_weights();
        for (pair, out) in out.chunks_exact_mut(3).enumerate() {
            let mut r = [0.0; 3];
            t.packed().unpack(t.cluster, pair, t.bases, |basis, channel, value| {
                (0..3).for_each(|c| r[c] += COLOUR_FRAME[channel][c] * weights[basis] * value);
            });
            for (out, r) in out.iter_mut().zip(r) {
                *out = source.residual_kind.combine(share * *out, r, source.epsilon);
            }
        }
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
        *out = source.residual_kind.combine(share * *out, r, source.epsilon);
    }
}

/// Decodes one measured pair straight from the file form, without the resident form: the slowest decoder, and the one
/// that needs the least memory.
pub fn decode_from_file_form(
    asset: &Asset,
    TexelPlace { layer, texel, first_ref }: TexelPlace,
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
    let share = if layer.lobe_role == LobeRole::Guide { 0.0 } else { 1.0 };
    // The texel's own core.
    let mut core = residual.core(0, cluster);
    for (component, plane) in residual.coefficients.iter().enumerate() {
        let weight = plane.step * f32::from(plane.codes[texel]);
        if weight != 0.0 {
            let basis = residual.core(component + 1, cluster);
            core.iter_mut().zip(basis).for_each(|(sum, x)| *sum += weight * x);
        }
    }
    let mut r = core_at_pair(&residual.factors, &core, view, light);
    let here: Vec<Vec<f32>> =
        layer.dictionary[cluster].iter().map(|entry| vec![entry.lobe.setup().eval(wi, wo)]).collect();
    if let Some((inputs, taken)) = layer.taken_at(cluster, &here) {
        for (r, taken) in r.iter_mut().zip(taken.chunks_exact(1 + inputs)) {
            let slopes = residual.coefficients.iter().zip(&taken[1..]);
            *r -= taken[0] + slopes.map(|(plane, slope)| slope * f32::from(plane.codes[texel])).sum::<f32>();
        }
    }
    [0, 1, 2].map(|c| layer.residual_kind.combine(share * s[c], r[c], layer.epsilon))
}

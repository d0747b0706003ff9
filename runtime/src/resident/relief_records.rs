//! The records of relief, a few words a texel, which are made at load from heights and coefficients: slopes, horizons
//! and the albedo of the upright view. `decode/relief.rs` reads them.

use crate::asset::asset::Layer;
use crate::asset::heights::Heights;
use crate::asset::relief::{EVEN_LIGHT, HORIZON_STEP, MAX_ALBEDO, RELIEF_WORDS, SLOPE_STEP};
use crate::asset::residual::{COLOUR_FRAME, Residual};

/// Least albedo.
const MIN_ALBEDO: f32 = 0.002;

/// Returns the mean over the lights of each basis of each cluster at `view`, `[cluster][basis]`, RGB.
///
/// Cost: a multiplication for each number of the shared cores, then one for each cluster, basis and shared basis.
fn mean_over_lights(residual: &Residual, view: usize) -> Vec<Vec<[f32; 3]>> {
    let factors = &residual.factors;
    let lights = factors.shape[1];
    // Of each number of a core: its factor in the mean.
    let mut shares = Vec::with_capacity(factors.core_len());
    for channel in 0..3 {
        let [rv, rl] = factors.ranks[channel];
        let mean =
            |s: usize| (0..lights).map(|l| factors.light[channel][l * rl + s].to_f32()).sum::<f32>() / lights as f32;
        let means: Vec<f32> = (0..rl).map(mean).collect();
        for r in 0..rv {
            let of_view = factors.view[channel][view * rv + r].to_f32();
            shares.extend(means.iter().map(|mean| (channel, of_view * mean)));
        }
    }
    let shared: Vec<[f32; 3]> = (0..residual.shared.steps.len())
        .map(|number| {
            let mut rgb = [0.0; 3];
            for (x, (channel, share)) in residual.shared.core(number).iter().zip(&shares) {
                (0..3).for_each(|c| rgb[c] += COLOUR_FRAME[*channel][c] * share * x);
            }
            rgb
        })
        .collect();
    let clusters = residual.bases.first().map_or(0, |mean| mean.steps.len());
    let of_basis = |cluster: usize, index: usize| {
        let basis = &residual.bases[index];
        let mut rgb = [0.0; 3];
        for (q, x) in basis.values[cluster * shared.len()..].iter().zip(&shared) {
            (0..3).for_each(|c| rgb[c] += basis.steps[cluster] * f32::from(*q) * x[c]);
        }
        rgb
    };
    (0..clusters).map(|cluster| (0..residual.bases.len()).map(|index| of_basis(cluster, index)).collect()).collect()
}

/// Returns the albedo of an upright plane that looks like each texel from the most upright view: the inverse of the
/// curve's mean over the lights, over that of a white plane. `codes` are `[component][texel]`.
fn flat_albedos(layer: &Layer, residual: &Residual, clusters: &[u8], codes: &[&[i8]]) -> Vec<[f32; 3]> {
    let (kind, epsilon) = (layer.residual_kind, layer.epsilon);
    let height = |view: &usize| layer.views.direction(*view as u32)[2];
    let upright = (0..layer.views.len()).max_by(|a, b| height(a).total_cmp(&height(b))).unwrap_or(0);
    let means = mean_over_lights(residual, upright);
    let lights = layer.lights.len();
    let white = (0..lights).map(|l| kind.encode(layer.lights.direction(l as u32)[2], epsilon)).sum::<f32>();
    let white = kind.decode(white / lights as f32, epsilon).max(MIN_ALBEDO);
    let nothing = kind.encode(0.0, epsilon);
    let of_texel = |(texel, cluster): (usize, &u8)| {
        let means = &means[usize::from(*cluster)];
        let mut y = means[0].map(|mean| nothing + mean);
        for ((plane, codes), mean) in residual.coefficients.iter().zip(codes).zip(&means[1..]) {
            let coefficient = plane.step * f32::from(codes[texel]);
            (0..3).for_each(|c| y[c] += coefficient * mean[c]);
        }
        y.map(|y| (kind.decode(y, epsilon) / white).clamp(MIN_ALBEDO, (1.0 + EVEN_LIGHT) * MAX_ALBEDO))
    };
    clusters.iter().enumerate().map(of_texel).collect()
}

/// Returns the records of a level of `layer` whose texels have these heights, clusters and codes; empty without a
/// residual.
///
/// Cost: up to 35 heights for each texel and azimuth.
pub(crate) fn relief_records(
    layer: &Layer,
    size: [usize; 2],
    heights: &Heights,
    clusters: &[u8],
    codes: &[&[i8]],
) -> Vec<u32> {
    let Some(residual) = &layer.residual else { return Vec::new() };
    let albedos = flat_albedos(layer, residual, clusters, codes);
    let field = heights.field(size);
    let mut records = Vec::with_capacity(RELIEF_WORDS * clusters.len());
    for (texel, albedo) in albedos.iter().enumerate() {
        let place = [(texel % size[0]) as f32, (texel / size[0]) as f32];
        let at = |x: f32, y: f32| field.at([place[0] + x, place[1] + y]);
        let slopes = [at(1.0, 0.0) - at(-1.0, 0.0), at(0.0, -1.0) - at(0.0, 1.0)];
        let [p, q] = slopes.map(|slope| u32::from((0.5 * slope / SLOPE_STEP).round() as i16 as u16));
        let code = |x: f32| (255.0 * (x / ((1.0 + EVEN_LIGHT) * MAX_ALBEDO)).sqrt()).round() as u32;
        let [r, g, b] = albedo.map(code);
        let byte = |tangent: f32| (tangent / HORIZON_STEP).round().min(255.0) as u8;
        let [a, b1, c, d, e, f, g1, h] = field.horizons(place).map(byte);
        records.extend([
            p | q << 16,
            r | g << 8 | b << 16,
            u32::from_le_bytes([a, b1, c, d]),
            u32::from_le_bytes([e, f, g1, h]),
        ]);
    }
    records
}

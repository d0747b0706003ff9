//! The shares of relief that an asset is decoded with, chosen by leaving directions out: the decoder predicts measured
//! views and lights from the others with each share, and the shares that come nearest to what was measured stay.

use crate::error::FitError;
use crate::inspect::load::resident_in_parallel;
use crate::monitor::Monitor;
use btf_runtime::{Asset, DecodeOptions, Factors, Layer, Relief, ResidualKind, Sphere, ViewedTexel, decode};
use half::f16;
use rayon::prelude::*;

/// Shares that the search starts from.
pub const FIRST_RELIEF: Relief = Relief { likeness: 100.0, shading: 0.5, gloss: 0.25 };
/// Values that are tried, one number after the other.
const GLOSSES: [f32; 3] = [0.0, 0.5, 0.75];
const SHADINGS: [f32; 3] = [0.0, 0.25, 0.75];
const LIKENESSES: [f32; 2] = [300.0, 1000.0];
/// Number of views and of lights that are left out at most; their range of cosines with the normal (25 to 65 degrees).
const LEFT_OUT: usize = 12;
const LEFT_OUT_COS: [f32; 2] = [0.42, 0.91];
/// Number of directions of a set for each that is left out, so that those around stay.
const DIRECTIONS_A_GAP: usize = 6;
/// Number of texels at which values are predicted.
const TEXELS: usize = 1024;
/// Share of the error without relief that relief must take away to be kept.
const MIN_GAIN: f64 = 0.005;

/// Chooses the relief of each layer of `asset` that has any; a layer in which no share predicts left-out directions
/// better than none is left without.
///
/// Cost: twelve decodings of 144 pairs at 1024 texels, most of them with relief; the resident form, twice.
pub fn choose_relief(asset: &mut Asset, monitor: &Monitor) -> Result<(), FitError> {
    for number in 0..asset.layers.len() {
        if asset.layers[number].relief.is_some() {
            asset.layers[number].relief = chosen(asset, number, monitor)?;
        }
    }
    Ok(())
}

fn chosen(asset: &Asset, number: usize, monitor: &Monitor) -> Result<Option<Relief>, FitError> {
    // Other layers would only take memory.
    let alone = Asset { layers: vec![asset.layers[number].clone()], levels: Vec::new(), ..asset.clone() };
    let layer = &alone.layers[0];
    let out = [&layer.views, &layer.lights].map(left_out);
    if out.iter().any(Vec::is_empty) {
        return Ok(layer.relief);
    }
    let mut rest = alone.clone();
    rest.layers[0] = without_directions(layer, &out)?;
    let count = asset.texel_count();
    let texels: Vec<u32> = (0..TEXELS.min(count)).map(|i| (i * count / TEXELS.min(count)) as u32).collect();
    let pairs: Vec<[[f32; 3]; 2]> = out[0]
        .iter()
        .flat_map(|view| out[1].iter().map(|light| [layer.lights.direction(*light), layer.views.direction(*view)]))
        .collect();
    monitor.check()?;
    let options = DecodeOptions::default();
    let truth: Vec<Vec<[f32; 3]>> = {
        let resident = resident_in_parallel(&alone);
        let value = |texel: u32, [wi, wo]: [[f32; 3]; 2]| encoded(layer, decode(&resident, 0, texel, wi, wo, &options));
        texels.par_iter().map(|texel| pairs.iter().map(|pair| value(*texel, *pair)).collect()).collect()
    };
    monitor.check()?;
    let mut resident = resident_in_parallel(&rest);
    let mut error = |relief: Relief| -> f64 {
        resident.set_relief(0, relief);
        let of_texel = |(texel, truth): (&u32, &Vec<[f32; 3]>)| -> f64 {
            let mut sum = 0.0;
            for (pairs, truth) in pairs.chunks(out[1].len()).zip(truth.chunks(out[1].len())) {
                let viewed = ViewedTexel::new(&resident, 0, *texel, pairs[0][1], &options);
                for ([wi, _], truth) in pairs.iter().zip(truth) {
                    let value = encoded(layer, viewed.light_alone(*wi));
                    sum += (0..3).map(|c| f64::from(value[c] - truth[c]).powi(2)).sum::<f64>();
                }
            }
            sum
        };
        // Summed in order, so that threads change nothing.
        texels.par_iter().zip(&truth).map(of_texel).collect::<Vec<_>>().iter().sum()
    };
    let nothing = error(Relief { likeness: 0.0, shading: 0.0, gloss: 0.0 });
    let mut best = (error(FIRST_RELIEF), FIRST_RELIEF);
    let mut consider = |relief: &dyn Fn(Relief) -> Relief| {
        let relief = relief(best.1);
        let error = error(relief);
        if error < best.0 {
            best = (error, relief);
        }
    };
    GLOSSES.iter().for_each(|gloss| consider(&|best| Relief { gloss: *gloss, ..best }));
    SHADINGS.iter().for_each(|shading| consider(&|best| Relief { shading: *shading, ..best }));
    LIKENESSES.iter().for_each(|likeness| consider(&|best| Relief { likeness: *likeness, ..best }));
    Ok((best.0 < (1.0 - MIN_GAIN) * nothing).then_some(best.1))
}

fn encoded(layer: &Layer, value: [f32; 3]) -> [f32; 3] {
    value.map(|x| ResidualKind::Root.encode(x, layer.epsilon))
}

/// Returns the directions of a set that are left out, of its first round: spread over those that are neither upright nor at
/// the set's edge.
fn left_out(sphere: &Sphere) -> Vec<u32> {
    let range = LEFT_OUT_COS[0]..LEFT_OUT_COS[1];
    let inner: Vec<u32> =
        (0..sphere.distinct() as u32).filter(|id| range.contains(&sphere.direction(*id)[2])).collect();
    let count = LEFT_OUT.min(sphere.distinct() / DIRECTIONS_A_GAP).min(inner.len());
    (0..count).map(|i| inner[(2 * i + 1) * inner.len() / (2 * count)]).collect()
}

/// Returns `layer` as if the `[views, lights]` left out had not been measured, in any round.
fn without_directions(layer: &Layer, out: &[Vec<u32>; 2]) -> Result<Layer, FitError> {
    let mut layer = layer.clone();
    let Some(residual) = &mut layer.residual else { return Ok(layer) };
    let kept = |sphere: &Sphere, out: &[u32]| {
        let round = sphere.distinct() as u32;
        (0..sphere.len() as u32).filter(|id| !out.contains(&(id % round))).collect()
    };
    let [views, lights]: [Vec<u32>; 2] = [kept(&layer.views, &out[0]), kept(&layer.lights, &out[1])];
    let set = |sphere: &Sphere, ids: &[u32]| {
        let directions: Vec<[f32; 3]> = ids.iter().map(|id| sphere.direction(*id)).collect();
        Sphere::of_rounds(&directions, sphere.len() / sphere.distinct())
    };
    let rows = |matrix: &[f16], rank: usize, ids: &[u32]| -> Vec<f16> {
        ids.iter().flat_map(|id| &matrix[*id as usize * rank..(*id as usize + 1) * rank]).copied().collect()
    };
    let factors = &residual.factors;
    residual.factors = Factors {
        shape: [views.len(), lights.len()],
        ranks: factors.ranks,
        view: std::array::from_fn(|c| rows(&factors.view[c], factors.ranks[c][0], &views)),
        light: std::array::from_fn(|c| rows(&factors.light[c], factors.ranks[c][1], &lights)),
    };
    (layer.views, layer.lights) = (set(&layer.views, &views)?, set(&layer.lights, &lights)?);
    Ok(layer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_asset::sample_asset_with;
    use btf_capture::DirectionSet;
    use btf_runtime::testing::{sample_heights, sample_relief_asset};

    /// Returns a measured value of the first layer.
    fn value(asset: &Asset, view: u32, light: u32) -> [f32; 3] {
        let layer = &asset.layers[0];
        let [wi, wo] = [layer.lights.direction(light), layer.views.direction(view)];
        decode(&resident_in_parallel(asset), 0, 17, wi, wo, &DecodeOptions::default())
    }

    #[test]
    fn directions_that_are_left_out_leave_the_others_values_as_they_are() {
        let whole = sample_relief_asset(3, 8, 8);
        let layer = &whole.layers[0];
        let out = [vec![2u32, 5], vec![0u32, 4]];
        let mut rest = whole.clone();
        rest.layers[0] = without_directions(layer, &out).unwrap();
        let kept = |count: usize, out: &[u32]| (0..count as u32).filter(|id| !out.contains(id)).collect::<Vec<_>>();
        let [views, lights] = [kept(layer.views.len(), &out[0]), kept(layer.lights.len(), &out[1])];
        assert_eq!([rest.layers[0].views.len(), rest.layers[0].lights.len()], [views.len(), lights.len()]);
        let near = |a: [f32; 3], b: [f32; 3]| (0..3).all(|c| (a[c] - b[c]).abs() < 1e-3 * (1.0 + b[c]));
        let mut unlike = 0;
        for (number, view) in views.iter().enumerate() {
            for (index, light) in lights.iter().enumerate() {
                let found = value(&rest, number as u32, index as u32);
                assert!(near(found, value(&whole, *view, *light)), "view {view}, light {light}");
                // Planted difference: the ids of before.
                unlike += usize::from(!near(found, value(&whole, number as u32, index as u32)));
            }
        }
        assert!(unlike > views.len() * lights.len() / 2, "{unlike}");
    }

    #[test]
    fn a_light_is_left_out_of_every_round() {
        let set = DirectionSet::random(24, 1).unwrap();
        let mut layer = sample_asset_with(4, 3, &set, &set, ResidualKind::Root).layers.remove(0);
        let directions: Vec<[f32; 3]> = (0..24).map(|id| layer.lights.direction(id)).collect();
        layer.lights = Sphere::of_rounds(&directions.repeat(2), 2).unwrap();
        let factors = &mut layer.residual.as_mut().unwrap().factors;
        factors.shape[1] = 48;
        factors.light.iter_mut().for_each(|rows| *rows = rows.repeat(2));
        let out = [&layer.views, &layer.lights].map(left_out);
        assert!(!out[1].is_empty() && out[1].iter().all(|id| *id < 24));
        let rest = without_directions(&layer, &out).unwrap();
        let kept = 24 - out[1].len();
        assert_eq!((rest.lights.len(), rest.lights.distinct()), (2 * kept, kept));
        assert_eq!(rest.residual.unwrap().factors.shape, [24 - out[0].len(), 2 * kept]);
    }

    #[test]
    fn relief_stays_only_where_it_predicts_left_out_directions() {
        let set = DirectionSet::bonn81();
        let mut asset = sample_asset_with(8, 8, &set, &set, ResidualKind::Root);
        let layer = &mut asset.layers[0];
        layer.heights = Some(sample_heights(3, 64));
        layer.relief = Some(FIRST_RELIEF);
        // Lobes alone, which need no correction between directions; shadows would be wrong.
        layer.residual.as_mut().unwrap().bases.iter_mut().for_each(|basis| basis.values.fill(0));
        let chosen = |mut asset: Asset| {
            choose_relief(&mut asset, &Monitor::default()).unwrap();
            asset.layers[0].relief
        };
        assert_eq!(chosen(asset.clone()), None);
        // Too few directions to leave any out: there is no telling, and the first shares stay.
        let few: Vec<u32> = (5..81).collect();
        asset.layers[0] = without_directions(&asset.layers[0], &[few.clone(), few]).unwrap();
        assert_eq!(chosen(asset), Some(FIRST_RELIEF));
    }
}

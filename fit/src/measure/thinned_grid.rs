//! Estimate of how well an asset interpolates, from its own capture: some directions are taken out of the asset's grid,
//! and the capture's images there are compared with what is interpolated from the rest.

use btf_runtime::{Asset, Layer, Residual, Sphere};
use half::f16;

/// One direction in this many is a candidate to be taken out.
const EVERY: usize = 5;
/// Number of the first candidate: never the zenith, which Bonn's sets begin with.
const FIRST: usize = 2;

/// An asset without some of its directions.
pub(crate) struct ThinnedGrid {
    /// The asset: a single layer, of fewer views and lights.
    pub(crate) asset: Asset,
    /// Pairs of the whole grid (`view * lights + light`) whose directions were taken out, both where both kinds could
    /// be spared, ascending.
    pub(crate) pairs: Vec<usize>,
}

/// Returns layer `layer` of `asset` without every fifth view and light that has measured ones all around. Where no view
/// can be spared, as in a capture of one view, only lights are taken out, and the other way round. `None` where no
/// direction at all can be spared or the layer has no residual.
pub(crate) fn thinned_grid(asset: &Asset, layer: usize) -> Option<ThinnedGrid> {
    let whole = &asset.layers[layer];
    let residual = whole.residual.as_ref()?;
    let (thin_views, thin_lights) = (thinned(&whole.views), thinned(&whole.lights));
    if thin_views.is_none() && thin_lights.is_none() {
        return None;
    }
    let all = |sphere: &Sphere| (sphere.clone(), (0..sphere.len()).collect());
    let (views, kept_views) = thin_views.unwrap_or_else(|| all(&whole.views));
    let (lights, kept_lights) = thin_lights.unwrap_or_else(|| all(&whole.lights));
    // What is measured: directions that are gone, or all where none is.
    let out = |kept: &[usize], count: usize| {
        (0..count).filter(|id| kept.len() == count || !kept.contains(id)).collect::<Vec<_>>()
    };
    let (out_views, out_lights) = (out(&kept_views, whole.views.len()), out(&kept_lights, whole.lights.len()));
    let light_count = whole.lights.len();
    let pairs = out_views.iter().flat_map(|view| out_lights.iter().map(move |light| view * light_count + light));
    let mut factors = residual.factors.clone();
    factors.shape = [views.len(), lights.len()];
    for channel in 0..3 {
        let [rv, rl] = factors.ranks[channel];
        factors.view[channel] = rows(&factors.view[channel], rv, &kept_views);
        factors.light[channel] = rows(&factors.light[channel], rl, &kept_lights);
    }
    let residual = Some(Residual { factors, ..residual.clone() });
    let pairs = pairs.collect();
    let thin = Layer { views, lights, residual, ..whole.clone() };
    Some(ThinnedGrid { asset: Asset { layers: vec![thin], ..asset.clone() }, pairs })
}

fn rows(matrix: &[f16], width: usize, kept: &[usize]) -> Vec<f16> {
    kept.iter().flat_map(|row| matrix[row * width..(row + 1) * width].iter().copied()).collect()
}

/// Returns the directions that stay, and their numbers. A direction that the others do not surround stays: beyond them
/// it would be extrapolated.
fn thinned(sphere: &Sphere) -> Option<(Sphere, Vec<usize>)> {
    let rest = |out: &[usize]| -> Option<(Sphere, Vec<usize>)> {
        let kept: Vec<usize> = (0..sphere.len()).filter(|id| !out.contains(id)).collect();
        let directions: Vec<[f32; 3]> = kept.iter().map(|id| sphere.direction(*id as u32)).collect();
        Some((Sphere::new(&directions).ok()?, kept))
    };
    let mut out: Vec<usize> = (FIRST..sphere.len()).step_by(EVERY).collect();
    let (coarse, _) = rest(&out)?;
    out.retain(|id| {
        let neighbours = coarse.locate(sphere.direction(*id as u32));
        neighbours.beyond == 1.0 && neighbours.weights.iter().filter(|weight| **weight > 0.0).count() > 1
    });
    if out.is_empty() { None } else { rest(&out) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_asset::sample_asset_with;
    use btf_capture::DirectionSet;
    use btf_runtime::{ResidualKind, decode_from_file_form};

    #[test]
    fn what_stays_decodes_as_before_and_only_surrounded_directions_go() {
        let set = DirectionSet::bonn81();
        let asset = sample_asset_with(5, 4, &set, &set, ResidualKind::Root);
        let thin = thinned_grid(&asset, 0).unwrap();
        let (whole, layer) = (&asset.layers[0], &thin.asset.layers[0]);
        let taken = whole.views.len() - layer.views.len();
        assert!((6..=16).contains(&taken), "{taken}");
        assert_eq!(thin.pairs.len(), taken * (whole.lights.len() - layer.lights.len()));
        assert!(thin.pairs.windows(2).all(|two| two[0] < two[1]));
        let find = |sphere: &Sphere, d: [f32; 3]| (0..sphere.len()).find(|id| sphere.direction(*id as u32) == d);
        for (view, light) in [(0, 0), (7, 30), (40, 3), (layer.views.len() - 1, layer.lights.len() - 1)] {
            let old_view = find(&whole.views, layer.views.direction(view as u32)).unwrap();
            let old_light = find(&whole.lights, layer.lights.direction(light as u32)).unwrap();
            let old = decode_from_file_form(&asset, 0, 0, 0, old_view, old_light);
            assert_eq!(decode_from_file_form(&thin.asset, 0, 0, 0, view, light), old);
            assert!(!thin.pairs.contains(&(old_view * whole.lights.len() + old_light)));
        }
        for pair in &thin.pairs {
            let unit = whole.views.direction((pair / whole.lights.len()) as u32);
            assert!(find(&layer.views, unit).is_none() && layer.views.locate(unit).beyond == 1.0);
        }
    }

    #[test]
    fn one_view_is_kept_and_lights_are_taken_out() {
        let one = DirectionSet::random(1, 3).unwrap();
        let asset = sample_asset_with(3, 2, &one, &DirectionSet::bonn81(), ResidualKind::Root);
        let thin = thinned_grid(&asset, 0).unwrap();
        assert_eq!(thin.asset.layers[0].views.len(), 1);
        assert_eq!(thin.pairs.len(), 81 - thin.asset.layers[0].lights.len());
    }

    #[test]
    fn too_few_directions_cannot_be_thinned() {
        let few = DirectionSet::random(4, 3).unwrap();
        let asset = sample_asset_with(2, 2, &few, &few, ResidualKind::Root);
        assert!(thinned_grid(&asset, 0).is_none());
    }
}

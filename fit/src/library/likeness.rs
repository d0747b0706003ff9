//! Features by which materials are compared: colour, gloss, anisotropy and texture as the asset decodes them, so that
//! materials whose captures had other directions can be compared too.

use crate::library::thumbnail::has_reflection;
use btf_capture::lab_from_linear;
use btf_runtime::{DecodeOptions, Interpolation, Query, Resident, evaluate_many};
use serde::{Deserialize, Serialize};
use std::f32::consts::TAU;

/// Texels along each side at which an asset is looked at.
const PROBES: usize = 24;

/// Features of a material. Distances between materials are taken after each feature was scaled to unit variance over the
/// library.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Likeness {
    /// Mean CIELAB of the texels under each setup.
    pub colours: Vec<[f32; 3]>,
    /// Standard deviation of the lightness L* over the texels under each setup.
    pub contrasts: Vec<f32>,
    /// Mean difference of L* between neighbouring texels at strides of 1, 4 and 16, lit obliquely: fine to coarse texture.
    pub grains: [f32; 3],
}

/// Names of the features, in the order of [`Likeness::features`].
pub fn feature_names() -> Vec<String> {
    let colours = SETUPS.iter().flat_map(|setup| ["L", "a", "b"].map(|axis| format!("{} {axis}", setup.name)));
    let contrasts = SETUPS.iter().map(|setup| format!("{} contrast", setup.name));
    let grains = GRAIN_STRIDES.map(|stride| format!("grain {stride}"));
    colours.chain(contrasts).chain(grains).collect()
}

impl Likeness {
    /// Returns all features as one vector.
    pub fn features(&self) -> Vec<f32> {
        self.colours.iter().flatten().chain(&self.contrasts).chain(&self.grains).copied().collect()
    }
}

/// A light and an eye, in degrees.
struct Setup {
    name: &'static str,
    light: [f32; 2],
    view: [f32; 2],
}

const fn setup(name: &'static str, light: [f32; 2], view: [f32; 2]) -> Setup {
    Setup { name, light, view }
}

/// Setups under which materials are compared, as inclination and azimuth of light and eye.
const SETUPS: [Setup; 7] = [
    setup("diffuse", [30.0, 60.0], [0.0, 0.0]),
    setup("mirrored", [45.0, 0.0], [45.0, 180.0]),
    setup("mirrored across", [45.0, 90.0], [45.0, 270.0]),
    setup("beside the mirror", [45.0, 0.0], [25.0, 180.0]),
    setup("back to the light", [45.0, 0.0], [40.0, 0.0]),
    setup("grazing", [70.0, 0.0], [70.0, 180.0]),
    setup("grazing light", [70.0, 45.0], [10.0, 0.0]),
];
/// The setup at which the grain is measured: light from low down.
const GRAIN_SETUP: usize = 6;
/// Strides of the grain in texels.
const GRAIN_STRIDES: [usize; 3] = [1, 4, 16];

/// Finds the features of `resident`.
///
/// Cost: some 6,000 evaluations.
pub fn likeness(resident: &Resident) -> Likeness {
    let behind = !has_reflection(resident);
    let lightness = |values: &[[f32; 3]]| values.iter().map(|rgb| lab(*rgb)[0]).collect::<Vec<_>>();
    let probes: Vec<[f32; 2]> = (0..PROBES * PROBES)
        .map(|i| [(i % PROBES) as f32, (i / PROBES) as f32].map(|x| (x + 0.5) / PROBES as f32))
        .collect();
    let mut likeness = Likeness::default();
    for setup in &SETUPS {
        let values = values(resident, &probes, setup, behind);
        let count = values.len() as f32;
        let mean = std::array::from_fn(|channel| values.iter().map(|rgb| rgb[channel]).sum::<f32>() / count);
        likeness.colours.push(lab(mean));
        let light = lightness(&values);
        let middle = light.iter().sum::<f32>() / count;
        likeness.contrasts.push((light.iter().map(|l| (l - middle).powi(2)).sum::<f32>() / count).sqrt());
    }
    let here = lightness(&values(resident, &probes, &SETUPS[GRAIN_SETUP], behind));
    likeness.grains = GRAIN_STRIDES.map(|stride| {
        let step = stride as f32 / resident.width().max(1) as f32;
        let beside: Vec<[f32; 2]> = probes.iter().map(|[u, v]| [u + step, *v]).collect();
        let there = lightness(&values(resident, &beside, &SETUPS[GRAIN_SETUP], behind));
        here.iter().zip(&there).map(|(a, b)| (a - b).abs()).sum::<f32>() / here.len() as f32
    });
    likeness
}

/// Returns what the texels at `uvs` look like under `setup`.
fn values(resident: &Resident, uvs: &[[f32; 2]], setup: &Setup, behind: bool) -> Vec<[f32; 3]> {
    let wo = direction(setup.view);
    let [x, y, z] = direction(setup.light);
    let wi = [x, y, if behind { -z } else { z }];
    let queries: Vec<Query> = uvs.iter().map(|uv| Query { uv: *uv, wi, wo }).collect();
    let mut values = vec![[0.0; 3]; queries.len()];
    let options = DecodeOptions { interpolation: Interpolation::Fast, ..DecodeOptions::default() };
    evaluate_many(resident, 0, &queries, &options, &mut values);
    // What a grazing light or a highlight multiplies is compared as a reflectance.
    let cosine = z.max(0.2);
    values.iter().map(|rgb| rgb.map(|value| (value / cosine).min(4.0))).collect()
}

fn direction([theta, phi]: [f32; 2]) -> [f32; 3] {
    let (theta, phi) = (theta / 360.0 * TAU, phi / 360.0 * TAU);
    [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()]
}

fn lab(rgb: [f32; 3]) -> [f32; 3] {
    let lab: [f64; 3] = lab_from_linear(rgb.map(f64::from));
    lab.map(|x| x as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_asset::sample_asset_with;
    use btf_capture::DirectionSet;
    use btf_runtime::ResidualKind;

    #[test]
    fn features_are_finite_named_and_tell_materials_apart() {
        let set = DirectionSet::bonn81();
        let asset = sample_asset_with(8, 8, &set, &set, ResidualKind::Root);
        let own = likeness(&Resident::from_asset(&asset));
        assert_eq!(own.features().len(), feature_names().len());
        assert!(own.features().iter().all(|feature| feature.is_finite()));
        assert_eq!(own, likeness(&Resident::from_asset(&asset)));
        let mut brighter = asset;
        brighter.layers[0].residual = None;
        let other = likeness(&Resident::from_asset(&brighter));
        assert_ne!(own.features(), other.features());
    }
}

//! Fit of the correction of a level's light: by directions of eye and light, what the voxels of a level send to the eye
//! in all, against what the model does.
//!
//! Shadows by optical depth and a share of common gaps, one curve over the angle between eye and light, leave a level
//! brighter than its model in some directions and darker in others, and each level in its own.

use crate::build::lit::{Lit, met_light};
use crate::build::shadow::ShadowParams;
use crate::rays::march::{March, Reflection};
use crate::rays::occluder::Occluder;
use crate::rays::projection::{HALF_SIDE, Projection, spread_directions};
use btf_runtime::voltex::{LIGHT_TERMS, LightCorrection, MAX_BRIGHTER, MAX_LIGHT_COEFFICIENT, Voltex};
use glam::Vec3;
use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

/// Directions of the eye for each view of [`ShadowParams`].
const EYES_OF_VIEW: usize = 4;
/// Lights for each direction of the eye.
const LIGHTS: usize = 12;
/// Rays along each side of a view through the volume; past the model twice as many.
const RAYS: usize = 48;
/// Share of the mean weight that is added for uncertainty.
const DOUBT: f64 = 1e-4;
/// Steps of Newton's method at most, and the largest change of a coefficient in one of them.
const STEPS: usize = 25;
const MAX_STEP: f64 = 0.5;
/// Change of a coefficient below which the steps end.
const END: f64 = 1e-5;

/// Light that a whole model sends from lights to eyes, and the directions.
#[derive(Debug)]
pub struct LightTruth {
    /// Direction to the eye, directions to the lights, and the light of each.
    eyes: Vec<(Vec3, Vec<Vec3>, Vec<f64>)>,
}

/// Adds up the light under each of so many lights of `across * across` rays from an eye, which `look` adds to sums for
/// a ray with this origin.
fn light_of_view(eye: Vec3, lights: usize, across: usize, look: impl Fn(Vec3, &mut [f32])) -> Vec<f64> {
    let view = Projection::new(-eye);
    let place = |i: usize| ((i as f32 + 0.5) / across as f32 * 2.0 - 1.0) * HALF_SIDE;
    let (mut sums, mut light) = (vec![0f64; lights], vec![0f32; lights]);
    for i in 0..across * across {
        light.fill(0.0);
        look(view.origin(place(i % across), place(i / across)), &mut light);
        sums.iter_mut().zip(&light).for_each(|(sum, light)| *sum += f64::from(*light));
    }
    let rays = (across * across) as f64;
    sums.into_iter().map(|sum| sum / rays).collect()
}

impl LightTruth {
    /// Looks at a model from four times as many directions as `params` has views; from none for no views.
    ///
    /// Cost: 9216 rays a direction, and twelve more for each of them that meets the model.
    pub fn new(occluder: &Occluder, lit: &impl Lit, params: &ShadowParams) -> LightTruth {
        let of_eye = |(i, eye): (usize, Vec3)| {
            let lights = spread_directions(LIGHTS, 1.0 + i as f32);
            let truth = light_of_view(eye, LIGHTS, 2 * RAYS, |origin, sums| {
                let Some(met) = occluder.trace(origin, -eye, 4.0) else { return };
                for (sum, light) in sums.iter_mut().zip(&lights) {
                    *sum = met_light(occluder, lit, &met, origin, -eye, *light);
                }
            });
            (eye, lights, truth)
        };
        let eyes = spread_directions(EYES_OF_VIEW * params.views, 0.37);
        LightTruth { eyes: eyes.into_par_iter().enumerate().map(of_eye).collect() }
    }

    /// Returns the correction of a level whose shadows are fitted: Poisson regression of the model's light on the
    /// level's, so that there is as much light in all, and as much weighted by each of the correction's terms.
    pub fn fit(&self, voltex: &Voltex, level: u32) -> LightCorrection {
        let march = March::new(voltex, level, Reflection::ClosedForm);
        let rows = |(eye, lights, truth): &(Vec3, Vec<Vec3>, Vec<f64>)| -> Vec<Row> {
            let found = light_of_view(*eye, lights.len(), RAYS, |origin, seen| {
                march.ray(origin, -*eye, lights, seen);
            });
            let row = |((light, truth), found): ((&Vec3, &f64), f64)| Row {
                terms: SVector::from(LightCorrection::terms(eye.to_array(), light.to_array()).map(f64::from)),
                truth: *truth,
                found,
            };
            lights.iter().zip(truth).zip(found).map(row).collect()
        };
        fitted(&self.eyes.par_iter().flat_map_iter(rows).collect::<Vec<_>>())
    }
}

/// A pair of directions: the terms of the correction, the light of the model and that of the volume.
#[derive(Debug, Clone, Copy)]
struct Row {
    terms: SVector<f64, LIGHT_TERMS>,
    truth: f64,
    found: f64,
}

impl Row {
    /// Returns the light of the volume with a correction.
    fn corrected(&self, correction: &SVector<f64, LIGHT_TERMS>) -> f64 {
        let limit = f64::from(MAX_BRIGHTER);
        self.found * self.terms.dot(correction).clamp(-limit, limit).exp()
    }
}

/// Returns the correction that maximises the sum of `truth ln value - value`, by Newton's method.
///
/// Least squares, with whatever weights, make the light less than it is where it is spread about the correction.
fn fitted(rows: &[Row]) -> LightCorrection {
    let mut solution = SVector::<f64, LIGHT_TERMS>::zeros();
    for _ in 0..STEPS {
        let (mut gram, mut right) = (SMatrix::<f64, LIGHT_TERMS, LIGHT_TERMS>::zeros(), SVector::zeros());
        for row in rows.iter().filter(|row| row.found > 0.0) {
            let value = row.corrected(&solution);
            gram.ger(value, &row.terms, &row.terms, 1.0);
            right += (row.truth - value) * row.terms;
        }
        let doubt = DOUBT * gram.trace() / LIGHT_TERMS as f64;
        let Some(factor) = (gram + SMatrix::identity() * doubt).cholesky() else { return LightCorrection::default() };
        let step = factor.solve(&right).map(|x| x.clamp(-MAX_STEP, MAX_STEP));
        solution += step;
        if step.amax() < END {
            break;
        }
    }
    LightCorrection(std::array::from_fn(|i| (solution[i] as f32).clamp(-MAX_LIGHT_COEFFICIENT, MAX_LIGHT_COEFFICIENT)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_runtime::testing::{Random, sphere_direction};

    #[test]
    fn what_was_made_darker_by_directions_is_found_again() {
        let mut random = Random::new(31);
        let made: [f32; LIGHT_TERMS] = std::array::from_fn(|_| random.within(-0.15, 0.15));
        let mut rows = |count: usize| -> Vec<Row> {
            let row = |_| {
                let [eye, light] = [0; 2].map(|_| sphere_direction(&mut random));
                let terms = SVector::from(LightCorrection::terms(eye, light).map(f64::from));
                let found = f64::from(random.within(0.1, 1.0));
                Row { terms, truth: found * f64::from(LightCorrection(made).brighter(eye, light)), found }
            };
            (0..count).map(row).collect()
        };
        let solution = fitted(&rows(600));
        let of = |correction: [f32; LIGHT_TERMS]| SVector::<f64, LIGHT_TERMS>::from(correction.map(f64::from));
        let others = rows(200);
        let worst = |correction: SVector<f64, LIGHT_TERMS>| {
            others.iter().map(|row| (row.corrected(&correction) / row.truth - 1.0).abs()).fold(0.0, f64::max)
        };
        assert!(worst(of(solution.0)) < 0.01, "{}", worst(of(solution.0)));
        // Planted difference: without the correction.
        assert!(worst(SVector::zeros()) > 0.2);
        // What shows nothing, and a model that was not looked at, are left as they are.
        let dark: Vec<Row> = others.iter().map(|row| Row { found: 0.0, ..*row }).collect();
        assert_eq!([fitted(&dark), fitted(&[])], [LightCorrection::default(); 2]);
        // No model is so bright that a coefficient leaves its range.
        let bright: Vec<Row> = others.iter().map(|row| Row { truth: 1e30 * row.truth, ..*row }).collect();
        assert!(fitted(&bright).0.iter().all(|x| x.abs() <= MAX_LIGHT_COEFFICIENT));
    }
}

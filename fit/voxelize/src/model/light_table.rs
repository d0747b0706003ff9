//! Light of a surface by the directions of eye and light: means over the surface and over its orientations in its own
//! plane, of the same material that is shaded near by.

use crate::model::additive_recurrence::{place_of, recurrence_steps};
use crate::model::microflakes::luminance;
use glam::Vec3;
use std::f32::consts::{FRAC_PI_2, PI};

/// Bins of the angle to the normal, of eye and of light, and of the azimuth between them.
const BINS: usize = 20;
/// Places and directions of the eye in each of its bins.
const SAMPLES: usize = 64;
/// Steps in seven dimensions: of the root of `x^8 = x + 1`.
const STEPS: [f64; 7] = recurrence_steps(1.096_981_557_798_559_6);

/// Table of the luminance that a surface sends to an eye from a light: of `pi f |cos|`, so that 1 is a white surface lit
/// along its normal.
#[derive(Debug, Clone, PartialEq)]
pub struct LightTable {
    /// By the side of the eye (front first), its angle, the side of the light, its angle and the azimuth.
    light: Vec<f32>,
}

/// Returns the place of bins in a table.
fn place([eye_behind, light_behind]: [bool; 2], [eye, light, azimuth]: [usize; 3]) -> usize {
    let eye = usize::from(eye_behind) * BINS + eye;
    let light = usize::from(light_behind) * BINS + light;
    (eye * 2 * BINS + light) * BINS + azimuth
}

impl LightTable {
    /// Tabulates a surface. `viewed` prepares its place at texture coordinates (in 0 to 1) for an eye, and what it
    /// returns is `pi f |cos|` in linear sRGB for a light: unit vectors in the surface's frame, z on its front. A side
    /// that is dark in every direction is as the other.
    ///
    /// Cost: 2560 calls of `viewed` and two million of what it returns.
    pub fn new<Viewed: Fn([f32; 3]) -> [f32; 3]>(viewed: impl Fn([f32; 2], [f32; 3]) -> Viewed) -> LightTable {
        let mut sums = vec![0f64; 4 * BINS * BINS * BINS];
        let mut number = 0;
        for (eye_bin, behind) in (0..BINS).flat_map(|bin| [(bin, false), (bin, true)]) {
            for _ in 0..SAMPLES {
                number += 1;
                let at = place_of(&STEPS, number);
                let turn = 2.0 * PI * at[2];
                let seen = viewed([at[0], at[1]], direction(eye_bin, at[3], turn, behind));
                // To the left and to the right alike.
                let way = if at[4] < 0.5 { -1.0 } else { 1.0 };
                let apart = |azimuth: usize| PI * (azimuth as f32 + at[5]) / BINS as f32;
                for (azimuth, light_bin) in (0..BINS).flat_map(|azimuth| (0..BINS).map(move |bin| (azimuth, bin))) {
                    for light_behind in [false, true] {
                        let light = direction(light_bin, at[6], turn + way * apart(azimuth), light_behind);
                        let bins = [eye_bin, light_bin, azimuth];
                        sums[place([behind, light_behind], bins)] += f64::from(luminance(seen(light)));
                    }
                }
            }
        }
        let mut light: Vec<f32> = sums.iter().map(|sum| (sum / SAMPLES as f64) as f32).collect();
        for light_behind in [false, true] {
            let of_side = |behind: bool| {
                let bins = (0..BINS * BINS * BINS).map(|i| [i / (BINS * BINS), i / BINS % BINS, i % BINS]);
                bins.map(move |bins| place([behind, light_behind != behind], bins))
            };
            let [front, back] = [false, true].map(|behind| of_side(behind).any(|place| light[place] > 0.0));
            for (a, b) in of_side(false).zip(of_side(true)).filter(|_| front != back) {
                if front { light[b] = light[a] } else { light[a] = light[b] }
            }
        }
        LightTable { light }
    }

    /// Returns the light that a surface with this unit normal on its front sends to `eye` from `light`, unit vectors
    /// towards them.
    pub fn light(&self, normal: Vec3, eye: Vec3, light: Vec3) -> f32 {
        let cosines = [normal.dot(eye), normal.dot(light)];
        let [across_eye, across_light] = [eye - normal * cosines[0], light - normal * cosines[1]];
        let apart = across_eye.dot(across_light) / (across_eye.length() * across_light.length()).max(1e-12);
        let bin = |share: f32| ((share * BINS as f32) as usize).min(BINS - 1);
        let [eye, light] = cosines.map(|cosine| bin(cosine.abs().min(1.0).acos() / FRAC_PI_2));
        let bins = [eye, light, bin(apart.clamp(-1.0, 1.0).acos() / PI)];
        self.light[place(cosines.map(|cosine| cosine < 0.0), bins)]
    }
}

/// Returns a unit vector in a bin of the angle: of equal solid angles, the share `within`.
fn direction(bin: usize, within: f32, azimuth: f32, behind: bool) -> [f32; 3] {
    let [from, to] = [bin, bin + 1].map(|bin| (FRAC_PI_2 * bin as f32 / BINS as f32).cos());
    let z = (from + (to - from) * within).clamp(0.0, 1.0);
    let (radius, (sin, cos)) = ((1.0 - z * z).max(0.0).sqrt(), azimuth.sin_cos());
    [radius * cos, radius * sin, if behind { -z } else { z }]
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_runtime::testing::{Random, sphere_direction};

    #[test]
    fn a_table_has_the_light_of_the_surface_it_is_made_of() {
        // Glossy on its front, which shows other light than the back does, and brighter towards one edge.
        let light = |uv: [f32; 2], wo: [f32; 3], wi: [f32; 3]| {
            let cos: f32 = (0..3).map(|k| wo[k] * wi[k] * if k < 2 { -1.0 } else { 1.0 }).sum();
            let side = match (wo[2] > 0.0, wi[2] > 0.0) {
                (true, true) => 0.3 + 0.5 * cos.max(0.0).powi(4),
                (false, false) => 0.2,
                (true, false) => 0.1,
                (false, true) => 0.15,
            };
            [side * 2.0 * uv[0] * wi[2].abs(); 3]
        };
        let table = LightTable::new(|uv, wo| move |wi| light(uv, wo, wi));
        let mut random = Random::new(3);
        let normal = Vec3::from(sphere_direction(&mut random));
        let x = normal.any_orthonormal_vector();
        let y = normal.cross(x);
        let mut sums = [[0f64; 4]; 2];
        for _ in 0..20_000 {
            let [wo, wi] = [0; 2].map(|_| sphere_direction(&mut random));
            let world = |[a, b, c]: [f32; 3]| x * a + y * b + normal * c;
            let found = table.light(normal, world(wo), world(wi));
            let expected = light([0.5, 0.5], wo, wi)[0];
            assert!((found - expected).abs() < 0.1, "{wo:?} {wi:?}: {found} {expected}");
            let side = 2 * usize::from(wo[2] < 0.0) + usize::from(wi[2] < 0.0);
            sums[0][side] += f64::from(found);
            sums[1][side] += f64::from(expected);
        }
        let apart = |a: [f64; 4], b: [f64; 4]| (0..4).map(|k| (a[k] / b[k] - 1.0).abs()).fold(0.0, f64::max);
        assert!(apart(sums[0], sums[1]) < 0.02, "{sums:?}");
        // Planted difference: the back for the front.
        let [a, b, c, d] = sums[0];
        assert!(apart([d, c, b, a], sums[1]) > 0.2);
    }

    #[test]
    fn a_side_that_was_not_measured_is_as_the_other() {
        let front = |wo: [f32; 3], wi: [f32; 3]| if wo[2] > 0.0 && wi[2] > 0.0 { wi[2] } else { 0.0 };
        let table = LightTable::new(|_, wo| move |wi| [front(wo, wi); 3]);
        let [up, aside] = [Vec3::Z, Vec3::new(0.6, 0.0, 0.8)];
        let seen = table.light(up, up, aside);
        assert!((seen - 0.8).abs() < 0.05 && table.light(up, -up, -aside) == seen, "{seen}");
        assert_eq!([table.light(up, up, -aside), table.light(up, -up, aside)], [0.0; 2]);
    }
}

//! The gloss of a leaf's face on its own, for programs that have the body from elsewhere, in any bands.
//!
//! The body lies under the gloss: of light from a direction of cosine `c` the share `1 - albedo(c)` enters, and what the
//! body sends out is proportional to `1 - albedo` of the cosine that it leaves by, over its mean `1 - mean_albedo`, so
//! that gloss and body together are reciprocal and a white body gives back all light [Kelemen 2001].

use crate::leaf::gloss::albedo_table;
use crate::leaf::lobe::{LeafFace, LeafLobe, albedo, lobe, lobe_density, lobe_direction};
use crate::leaf::state::LeafState;
use crate::leaf::words::ALBEDO_AT;
use crate::numeric::vector::{cross, dot};

/// Gloss of one roughness: Cook-Torrance with Beckmann facets, as [`crate::ViewedLeaf`] has it.
#[derive(Debug, Clone, PartialEq)]
pub struct FaceGloss {
    index: f32,
    roughness: f32,
    mean_albedo: f32,
    /// Table of directional albedo, where a leaf's words have it.
    words: Vec<u32>,
}

impl FaceGloss {
    /// Makes the gloss of a cuticle of refractive index `index`, 1.01 to 3, and of a `roughness` of 0.05 to 1 (the square root
    /// of twice the slope variance of its facets); other numbers are moved into these ranges. Costs some milliseconds.
    pub fn new(index: f32, roughness: f32) -> FaceGloss {
        let (index, roughness) = (index.clamp(1.01, 3.0), roughness.clamp(0.05, 1.0));
        let state =
            LeafState { gloss_index: index, gamma_along: roughness, gamma_across: roughness, ..LeafState::default() };
        let (table, mean_albedo) = albedo_table(&state);
        let mut words = vec![0; ALBEDO_AT];
        words.extend(table.into_iter().map(f32::to_bits));
        FaceGloss { index, roughness, mean_albedo, words }
    }

    fn lobe(&self) -> LeafLobe {
        LeafLobe { index: self.index, gamma: [self.roughness; 2], mean_albedo: self.mean_albedo }
    }

    /// Returns the share of light from, or to, a direction of cosine `cosine` to the normal that the gloss reflects.
    pub fn albedo(&self, cosine: f32) -> f32 {
        albedo(&self.words, &self.lobe(), cosine, [1.0, 0.0])
    }

    /// Returns its mean over the hemisphere, weighted by the cosine.
    pub fn mean_albedo(&self) -> f32 {
        self.mean_albedo
    }

    /// Returns `pi f cos_i` for unit vectors to the light and to the eye, about the unit vector `normal`; 0 where either is
    /// below it.
    pub fn value(&self, normal: [f32; 3], wi: [f32; 3], wo: [f32; 3]) -> f32 {
        lobe(&self.lobe(), &face(normal), wi, wo, dot(normal, wi), dot(normal, wo))
    }

    /// Draws a direction by which the gloss sends light of the unit vector `wo` on, from two numbers in [0, 1), with its
    /// [`FaceGloss::value`] over its density and pi, whose mean is the albedo: 0 for a direction below the surface.
    pub fn sample(&self, normal: [f32; 3], wo: [f32; 3], at: [f32; 2]) -> ([f32; 3], f32) {
        let (face, gloss) = (face(normal), self.lobe());
        let wi = lobe_direction(&gloss, &face, wo, at);
        let value = lobe(&gloss, &face, wi, wo, dot(normal, wi), dot(normal, wo));
        (wi, value / lobe_density(&gloss, &face, wi, wo).max(1e-20))
    }
}

/// Returns a face with veins in any direction.
fn face(normal: [f32; 3]) -> LeafFace {
    let axis = if normal[0].abs() < 0.7 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let along = cross(axis, normal);
    let along = along.map(|x| x / dot(along, along).sqrt());
    LeafFace { normal, along, across: cross(normal, along), gloss: 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    #[test]
    fn what_is_drawn_and_what_is_summed_up_over_the_hemisphere_is_the_albedo() {
        for (index, roughness) in [(1.42, 0.3), (1.5, 0.1), (2.0, 0.8)] {
            let gloss = FaceGloss::new(index, roughness);
            let normal = [0.3f32, -0.5, 0.8].map(|x| x / 0.98f32.sqrt());
            let tangents = face(normal);
            for cosine in [1.0f32, 0.6, 0.2] {
                let sine = (1.0 - cosine * cosine).sqrt();
                let wo = [0, 1, 2].map(|i| cosine * normal[i] + sine * tangents.along[i]);
                let albedo = f64::from(gloss.albedo(cosine));
                let mut random = Random::new(3);
                let count = 40_000;
                let (mut drawn, mut summed) = (0.0, 0.0);
                for _ in 0..count {
                    let at = [random.within(0.0, 1.0), random.within(0.0, 1.0)];
                    drawn += f64::from(gloss.sample(normal, wo, at).1) / f64::from(count);
                    // Directions whose density is the cosine over pi.
                    let (r, phi) = (at[0].sqrt(), std::f32::consts::TAU * at[1]);
                    let [x, y, z] = [r * phi.cos(), r * phi.sin(), (1.0 - at[0]).max(1e-6).sqrt()];
                    let wi = [0, 1, 2].map(|i| x * tangents.along[i] + y * tangents.across[i] + z * normal[i]);
                    summed += f64::from(gloss.value(normal, wi, wo) / z) / f64::from(count);
                }
                assert!((drawn / albedo - 1.0).abs() < 0.02, "{index} {roughness} {cosine}: {drawn} {albedo}");
                // Narrow lobes are seldom met by chance.
                let tolerance = if roughness < 0.2 { 0.2 } else { 0.04 };
                assert!((summed / albedo - 1.0).abs() < tolerance, "{index} {roughness} {cosine}: {summed} {albedo}");
            }
            // Planted difference: a smoother cuticle is no rougher one.
            assert_ne!(gloss, FaceGloss::new(index, 0.5));
        }
        // Fresnel by hand at the normal: ((1.5 - 1) / (1.5 + 1))^2.
        assert!((FaceGloss::new(1.5, 0.05).albedo(1.0) - 0.04).abs() < 5e-4);
    }
}

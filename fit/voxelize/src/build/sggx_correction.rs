//! SGGX correction of fourth degree: how the normals of a level are spread beyond what the ellipsoids of its voxels
//! express, fitted to the microflakes themselves.
//!
//! An ellipsoid has its most normals along one axis; leaves that are all inclined alike have none there.

use crate::model::microflakes::MicroflakeColour;
use crate::rays::projection::spread_directions;
use btf_runtime::voltex::{FACETS, Facets, MAX_FACETS, Sym3, Voltex, gloss};
use glam::Vec3;
use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

/// Half vectors between light and eye, spread over the sphere; angles in degrees of light and eye to each of them.
const HALF_WAYS: usize = 80;
const APART_DEG: [f32; 3] = [10.0, 30.0, 50.0];
/// Microflakes that are summed over at most: of more, every n-th is taken.
const MAX_MICROFLAKES: usize = 1 << 16;
/// Share of the mean weight that is added for uncertainty.
const DOUBT: f64 = 1e-4;

/// A microflake with a specular lobe.
#[derive(Debug, Clone, Copy)]
pub struct GlossyMicroflake {
    /// Area that counts.
    pub area: f32,
    /// Unit normal.
    pub normal: Vec3,
    /// Reflectance of the smooth surface at normal incidence, above 0.
    pub specular: f32,
    /// GGX alpha.
    pub roughness: f32,
}

/// Light that all microflakes of a model reflect specularly from lights to eyes, without shadow.
#[derive(Debug)]
pub struct GlossTruth {
    /// Direction to the eye, direction to the light, and the sum.
    pairs: Vec<(Vec3, Vec3, f64)>,
}

impl GlossTruth {
    /// Sums over microflakes. Cost: 16 million evaluations at most.
    pub fn new(microflakes: &[GlossyMicroflake]) -> GlossTruth {
        let chosen: Vec<&GlossyMicroflake> =
            microflakes.iter().step_by(microflakes.len().div_ceil(MAX_MICROFLAKES).max(1)).collect();
        let pairs = spread_directions(HALF_WAYS, 0.3).into_iter().enumerate().flat_map(|(i, half)| {
            let across = half.any_orthonormal_vector();
            // In no plane twice.
            let (sin, cos) = (2.4 * i as f32).sin_cos();
            let side = across * cos + half.cross(across) * sin;
            APART_DEG.map(|degrees| {
                let (sin, cos) = degrees.to_radians().sin_cos();
                (half * cos + side * sin, half * cos - side * sin)
            })
        });
        let pairs: Vec<(Vec3, Vec3)> = pairs.collect();
        let light = |(eye, light): &(Vec3, Vec3)| {
            let sum = chosen.iter().map(|microflake| f64::from(microflake.shine(*eye, *light))).sum();
            (*eye, *light, sum)
        };
        GlossTruth { pairs: pairs.par_iter().map(light).collect() }
    }

    /// Returns the SGGX correction of a level: least squares of the logarithm of what microflakes reflect over what its
    /// voxels do, as they were gathered.
    pub fn fit(&self, voltex: &Voltex, level: u32) -> Facets {
        let cells = voltex.numbers_at(level);
        let voxels: Vec<_> =
            cells.iter().flat_map(|number| voltex.microflakes(*number).map(|(_, voxel)| voxel)).collect();
        let of_voxels = |(eye, light, _): &(Vec3, Vec3, f64)| -> f64 {
            let shine = voxels.iter().map(|voxel| {
                let material = voltex.material(voxel.material);
                f64::from(gloss(
                    &voxel.extinction,
                    material.specular,
                    material.roughness,
                    eye.to_array(),
                    light.to_array(),
                ))
            });
            shine.sum()
        };
        let found: Vec<f64> = self.pairs.par_iter().map(of_voxels).collect();
        let sums = [self.pairs.iter().map(|(.., truth)| truth).sum::<f64>(), found.iter().sum()];
        if sums.into_iter().any(|sum| sum <= 0.0) {
            return Facets::default();
        }
        // As much in all: what is spread otherwise is not more.
        let scale = sums[0] / sums[1];
        let (mut gram, mut right) = (SMatrix::<f64, FACETS, FACETS>::zeros(), SVector::<f64, FACETS>::zeros());
        for ((eye, light, truth), found) in self.pairs.iter().zip(found) {
            if *truth > 0.0 && found > 0.0 {
                let half = (*eye + *light).normalize().to_array();
                let row = SVector::from(Facets::terms(half).map(f64::from));
                gram += *truth * row * row.transpose();
                right += *truth * (truth / (scale * found)).ln() * row;
            }
        }
        let doubt = DOUBT * gram.trace() / FACETS as f64;
        let Some(factor) = (gram + SMatrix::identity() * doubt).cholesky() else { return Facets::default() };
        let solution = factor.solve(&right);
        Facets(std::array::from_fn(|i| (solution[i] as f32).clamp(-MAX_FACETS, MAX_FACETS)))
    }
}

impl GlossyMicroflake {
    /// Returns a triangle, of whose area `weight` counts, as a microflake, if its colour has a specular lobe.
    pub fn of([a, b, c]: &[Vec3; 3], weight: f32, colour: &MicroflakeColour) -> Option<GlossyMicroflake> {
        let across = (*b - *a).cross(*c - *a);
        let MicroflakeColour { specular, roughness, .. } = *colour;
        let normal = across.try_normalize().filter(|_| specular > 0.0)?;
        Some(GlossyMicroflake { area: 0.5 * weight * across.length(), normal, specular, roughness })
    }

    /// Returns the light that the microflake reflects specularly from `light` to `eye` on the same side.
    fn shine(&self, eye: Vec3, light: Vec3) -> f32 {
        if self.normal.dot(eye) * self.normal.dot(light) <= 0.0 {
            return 0.0;
        }
        let own = Sym3::outer(self.normal.to_array(), self.area * self.area);
        gloss(&own, self.specular, self.roughness, eye.to_array(), light.to_array())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::microflakes::{CellMicroflakes, MicroflakeSums};
    use btf_runtime::testing::Random;

    const SHINY: MicroflakeColour =
        MicroflakeColour { reflectance: [0.1; 3], transmittance: [0.1; 3], specular: 0.04, roughness: 0.25 };

    /// Returns one cell of microflakes as a volume, and they themselves.
    fn one_cell(normals: &[Vec3], colour: &MicroflakeColour) -> (Voltex, Vec<GlossyMicroflake>) {
        let mut cell = CellMicroflakes::default();
        normals.iter().for_each(|normal| cell.add(&MicroflakeSums::microflake(0.01, *normal, colour)));
        let volume = crate::build::build::volume_of(&[[([0; 3], cell)].into()]);
        let microflake = |normal: &Vec3| GlossyMicroflake {
            area: 0.01,
            normal: *normal,
            specular: colour.specular,
            roughness: colour.roughness,
        };
        (Voltex::new(&volume), normals.iter().map(microflake).collect())
    }

    /// Returns the root mean square of the logarithm of what a cell sends over what its microflakes do, scaled to as
    /// much in all, over pairs of directions that nothing was fitted to; without `facets` and with them.
    fn errors(voltex: &Voltex, microflakes: &[GlossyMicroflake], facets: &Facets) -> [f64; 2] {
        let mut random = Random::new(4);
        let mut rows = Vec::new();
        while rows.len() < 200 {
            let mut direction = || Vec3::from(btf_runtime::testing::sphere_direction(&mut random));
            let (eye, light) = (direction(), direction());
            let truth: f64 = microflakes.iter().map(|microflake| f64::from(microflake.shine(eye, light))).sum();
            // Lamps behind microflakes shine through facets that these have not.
            if eye.dot(light) > 0.0 && truth > 0.0 {
                let voxel = voltex.voxel(voltex.numbers_at(0)[0]);
                let own = gloss(&voxel.extinction, SHINY.specular, SHINY.roughness, eye.to_array(), light.to_array());
                let denser = facets.denser((eye + light).to_array());
                rows.push([truth, f64::from(own), f64::from(own * denser)]);
            }
        }
        let sum = |i: usize| rows.iter().map(|row| row[i]).sum::<f64>();
        let total = [sum(0), sum(1), sum(2)];
        [1, 2].map(|i| {
            let error = |row: &[f64; 3]| row[0] / total[0] * (row[i] / total[i] * total[0] / row[0]).ln().powi(2);
            rows.iter().map(error).sum::<f64>().sqrt()
        })
    }

    #[test]
    fn leaves_that_are_all_inclined_alike_shine_as_they_do_and_not_as_their_ellipsoid() {
        let inclined = |i: u32| {
            let ((sin, cos), (x, y)) = (0.9f32.sin_cos(), (2.4 * i as f32).sin_cos());
            Vec3::new(sin * x, sin * y, cos)
        };
        let (voltex, microflakes) = one_cell(&(0..500).map(inclined).collect::<Vec<_>>(), &SHINY);
        let facets = GlossTruth::new(&microflakes).fit(&voltex, 0);
        let [without, with] = errors(&voltex, &microflakes, &facets);
        println!("{without} without, {with} with {facets:?}");
        assert!(with < 0.2 && without > 0.4, "{without} {with}");
        // One microflake and microflakes of all directions are what their ellipsoids say.
        let [single, all] = [vec![Vec3::new(0.48, 0.6, 0.64)], spread_directions(2000, 0.1)].map(|normals| {
            let (voltex, microflakes) = one_cell(&normals, &SHINY);
            let facets = GlossTruth::new(&microflakes).fit(&voltex, 0);
            spread_directions(40, 0.7).into_iter().map(|d| facets.denser(d.to_array()).ln().abs()).fold(0f32, f32::max)
        });
        println!("one microflake {single}, all {all}");
        assert!(single < 0.1 && all < 0.1, "{single} {all}");
        // What does not shine has no facets.
        let (dull, _) = one_cell(&[Vec3::Z], &MicroflakeColour { specular: 0.0, ..SHINY });
        assert_eq!(GlossTruth::new(&[]).fit(&dull, 0), Facets::default());
    }
}

//! One voxel: its microflakes as two matrices. Twin: `voltex/voxel.wgsl`.

use super::matrix::Sym3;
use crate::numeric::quantize::{half_at, word_from_halves};

/// Number of words of a voxel in the resident form; the last one links to the second sort of microflakes in the voxel's
/// cell.
pub const VOXEL_WORDS: usize = 9;
/// Word of a voxel that has the number of the voxel with the second sort of microflakes of its cell, or
/// [`NO_VOXEL`](super::NO_VOXEL).
pub const OTHER_AT: usize = 8;
/// Power of the eigenvalues of S that gives those of N; the eigenvectors are the same. Of the powers tried the best
/// against true microflakes.
const MOMENT_POWER: f32 = 0.75;
/// Power of the mean that gives the area of the microflakes from the roots of S's eigenvalues, without the division:
/// the binary logarithm of 3, which is exact for microflakes of one direction and of all.
const AREA_POWER: f32 = 1.584_962_5;

/// The microflakes of a voxel.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Voxel {
    /// Extinction matrix S: `sqrt(d' S d)` is the optical depth along d, a vector of texture space.
    pub extinction: Sym3,
    /// Moment N: sum over the microflakes of `a n n'`, in proportion to `extinction`.
    pub moment: Sym3,
    /// Number of the material.
    pub material: u32,
}

impl Voxel {
    /// Makes a voxel whose moment is derived from its extinction.
    pub fn new(extinction: Sym3, material: u32) -> Voxel {
        Voxel { extinction, moment: moment_of(&extinction), material }
    }

    /// Returns the optical depth per length along d, a vector of texture space that need not be unit.
    pub fn extinction_along(&self, d: [f32; 3]) -> f32 {
        self.extinction.form(d, d).max(0.0).sqrt()
    }

    /// Returns `factor` times as many of the same microflakes.
    pub fn scaled(&self, factor: f32) -> Voxel {
        Voxel { extinction: self.extinction.scale(factor * factor), moment: self.moment.scale(factor), ..*self }
    }

    /// Reads the voxel at a word. Twin: `voltex_voxel_at`.
    pub fn at(words: &[u32], at: usize) -> Voxel {
        let scale = f32::from_bits(words[at]);
        let halves = |first: usize| Sym3(std::array::from_fn(|i| half_at(words[at + first + i / 2], i as u32 % 2)));
        Voxel { extinction: halves(1).scale(scale * scale), moment: halves(4).scale(scale), material: words[at + 7] }
    }

    /// Returns the words of the voxel except the last.
    pub fn words(&self) -> [u32; OTHER_AT] {
        let most = self.extinction.0[..3].iter().fold(0.0f32, |most, x| most.max(*x));
        let scale = most.sqrt().max(1e-12);
        let (s, n) = (self.extinction.scale(1.0 / (scale * scale)), self.moment.scale(1.0 / scale));
        let pair = |m: &Sym3, i: usize| word_from_halves(m.0[2 * i], m.0[2 * i + 1]);
        [scale.to_bits(), pair(&s, 0), pair(&s, 1), pair(&s, 2), pair(&n, 0), pair(&n, 1), pair(&n, 2), self.material]
    }
}

/// Returns the moment of microflakes with the extinction matrix `s`. Its trace is their area, which is twice what they
/// project on average, to 2 %.
pub fn moment_of(s: &Sym3) -> Sym3 {
    let powered = |power: f32| s.mapped(|x| x.max(0.0).powf(power));
    let area = powered(0.5 * AREA_POWER).trace().powf(1.0 / AREA_POWER);
    let moment = powered(MOMENT_POWER);
    moment.scale(area / moment.trace().max(1e-30))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, sphere_direction};

    #[test]
    fn a_voxel_survives_its_words_within_a_half_and_any_scale() {
        let mut random = Random::new(2);
        let apart = |a: &Sym3, b: &Sym3| a.0.iter().zip(&b.0).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max);
        for round in 0..1000 {
            let area = 10f32.powi(round % 17 - 8);
            let microflakes = (0..1 + round % 4).map(|_| Sym3::outer(sphere_direction(&mut random), area * area));
            let voxel =
                Voxel::new(microflakes.fold(Sym3::default(), |sum, microflake| sum.plus(&microflake)), round as u32);
            let back = Voxel::at(&voxel.words(), 0);
            let (s, n) = (voxel.extinction.trace() / 1024.0, voxel.moment.trace() / 1024.0);
            assert!(
                apart(&back.extinction, &voxel.extinction) < s && apart(&back.moment, &voxel.moment) < n,
                "{voxel:?}"
            );
            assert_eq!(back.material, voxel.material);
            // Planted difference: as many microflakes and a hundredth.
            let more = voxel.scaled(1.01);
            assert!(apart(&more.extinction, &voxel.extinction) > s, "{voxel:?}");
        }
        assert_eq!(Voxel::at(&Voxel::default().words(), 0), Voxel::default());
    }

    #[test]
    fn twice_as_many_microflakes_are_twice_as_deep_and_twice_as_bright() {
        let voxel = Voxel::new(Sym3([3.0, 2.0, 1.0, 0.5, 0.25, 0.125]), 0);
        let (twice, d) = (voxel.scaled(2.0), [0.6, 0.0, 0.8]);
        let depth = |voxel: &Voxel| voxel.extinction.form(d, d).sqrt();
        assert!((depth(&twice) / depth(&voxel) - 2.0).abs() < 1e-6);
        assert!((twice.moment.trace() / voxel.moment.trace() - 2.0).abs() < 1e-6);
        // What the matrix of many microflakes makes of itself.
        assert!((Voxel::new(twice.extinction, 0).moment.trace() / twice.moment.trace() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn the_derived_moment_has_the_microflakes_area() {
        // Microflakes in all directions project half their area along each.
        let isotropic = moment_of(&Sym3([0.25, 0.25, 0.25, 0.0, 0.0, 0.0]));
        assert!(isotropic.0[..3].iter().all(|x| (x - 1.0 / 3.0).abs() < 1e-6), "{isotropic:?}");
        // One microflake.
        let mut random = Random::new(3);
        for _ in 0..1000 {
            let n = sphere_direction(&mut random);
            let moment = moment_of(&Sym3::outer(n, 1.0));
            assert!((moment.form(n, n) - 1.0).abs() < 1e-4 && (moment.trace() - 1.0).abs() < 1e-4, "{moment:?}");
        }
        // Between these: twice the mean of what is projected along many directions.
        let directions: Vec<[f32; 3]> = (0..20_000).map(|_| sphere_direction(&mut random)).collect();
        let (mut most, mut planted) = (0.0f32, 0.0f32);
        for (a, b) in (0..=10).flat_map(|a| (0..=a).map(move |b| (0.1 * a as f32, 0.1 * b as f32))) {
            let s = Sym3([1.0, a * a, b * b, 0.0, 0.0, 0.0]);
            let mean = directions.iter().map(|d| s.form(*d, *d).sqrt()).sum::<f32>() / directions.len() as f32;
            let error = |area: f32| (area / (2.0 * mean) - 1.0).abs();
            most = most.max(error(moment_of(&s).trace()));
            planted = planted.max(error(s.trace().sqrt()));
        }
        println!("areas are wrong by {most:.4} at most");
        assert!(most < 0.025, "{most}");
        // Planted difference: another power.
        assert!(planted > 0.1, "{planted}");
        assert_eq!(moment_of(&Sym3::default()), Sym3::default());
    }
}

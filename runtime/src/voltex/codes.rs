//! The integers that a file stores of a voxel. They are chosen so that any codes give a positive semidefinite matrix.
//! Normative text: docs/reference/voltex.md, chapter "Voxels".

use super::matrix::Sym3;
use super::voxel::Voxel;
use std::f64::consts::FRAC_PI_2;

/// Number of steps of the density's code for each doubling: the nearest code is within 0.55 %.
pub const DENSITY_STEPS: i32 = 64;
/// Largest magnitude of a density's binary logarithm. Lower densities are raised to it, higher ones are refused.
pub const MAX_DENSITY_LOG2: i32 = 30;
/// Number of bits of a ratio.
pub const RATIO_BITS: usize = 6;
/// Number of bits of an angle's magnitude.
pub const ANGLE_BITS: usize = 6;
/// Code of a ratio of 1.
const RATIO_ONE: u32 = (1 << RATIO_BITS) - 1;
/// Code of a right angle.
pub const RIGHT_ANGLE: i32 = (1 << ANGLE_BITS) - 1;

/// The extinction matrix S of a voxel as integers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct VoxelCodes {
    /// Density: binary logarithm of the largest of `sqrt(S_ii)`, in 64ths (`DENSITY_STEPS`).
    pub density: i32,
    /// Axis i of that largest entry; the first of those whose ratio to it has the code of 1.
    pub axis: u8,
    /// Ratios of `sqrt(S_jj)` of the other two axes to the largest, in the order j < k.
    pub ratios: [u8; 2],
    /// Correlations of the axis with j and with k, then the partial correlation of j and k given the axis: each as the
    /// angle of which it is the sine, in shares of a right angle; 0 where it has no effect.
    pub angles: [i8; 3],
}

/// Returns the sine of an angle's code; `right` is the code of a right angle.
fn sine(code: i8, right: i32) -> f64 {
    (FRAC_PI_2 * f64::from(code) / f64::from(right)).sin()
}

/// Returns the code of the angle with this sine; `right` is the code of a right angle.
fn angle(sine: f64, right: i32) -> i8 {
    (sine.clamp(-1.0, 1.0).asin() / FRAC_PI_2 * f64::from(right)).round() as i8
}

impl VoxelCodes {
    /// Returns the codes of a matrix that is finite and has no negative number on its diagonal; `None` where the matrix
    /// is too dense.
    pub fn of(s: &Sym3) -> Option<VoxelCodes> {
        let roots = [0, 1, 2].map(|i| f64::from(s.0[i]).max(0.0).sqrt());
        let most = roots.iter().fold(f64::from(-MAX_DENSITY_LOG2).exp2(), |most, root| most.max(*root));
        let ratios = roots.map(|root| (root / most * f64::from(RATIO_ONE)).round() as u8);
        let axis = ratios.iter().position(|ratio| u32::from(*ratio) == RATIO_ONE).unwrap_or(0);
        let log2 = most.log2();
        let density = (log2 * f64::from(DENSITY_STEPS)).round() as i32;
        let [j, k] = others(axis);
        let correlation = |i: usize, j: usize| f64::from(s.0[entry(i, j)]) / (roots[i] * roots[j]).max(1e-300);
        let mut codes =
            VoxelCodes { density, axis: axis as u8, ratios: [ratios[j], ratios[k]], ..VoxelCodes::default() };
        for (slot, i) in [j, k].into_iter().enumerate() {
            if codes.ratios[slot] > 0 {
                codes.angles[slot] = angle(correlation(axis, i), RIGHT_ANGLE);
            }
        }
        let right = codes.partial_right_angle();
        if right > 0 {
            // Of the correlations as they will be read.
            let [a, b] = [0, 1].map(|slot| sine(codes.angles[slot], RIGHT_ANGLE));
            let rest = ((1.0 - a * a) * (1.0 - b * b)).sqrt();
            codes.angles[2] = angle((correlation(j, k) - a * b) / rest, right);
        }
        codes.density_in_range().then_some(codes)
    }

    /// Returns whether the density is within its range.
    pub fn density_in_range(&self) -> bool {
        self.density.abs() <= MAX_DENSITY_LOG2 * DENSITY_STEPS
    }

    /// Returns whether the axis is the first of those whose ratio has the code of 1, so that a matrix has one axis.
    pub fn axis_is_first(&self) -> bool {
        self.ratios.iter().take(usize::from(self.axis)).all(|ratio| u32::from(*ratio) < RATIO_ONE)
    }

    /// Returns the code of a right angle in the partial correlation, 0 where that has no effect. It is as much less
    /// than 63 (`RIGHT_ANGLE`) as the partial correlation matters less.
    pub fn partial_right_angle(&self) -> i32 {
        if self.ratios.contains(&0) {
            return 0;
        }
        let most = i32::from(self.angles[0].unsigned_abs().max(self.angles[1].unsigned_abs()));
        if most == RIGHT_ANGLE {
            return 0;
        }
        let cosine = (FRAC_PI_2 * f64::from(most) / f64::from(RIGHT_ANGLE)).cos();
        (cosine * f64::from(RIGHT_ANGLE)).ceil() as i32
    }

    /// Returns the extinction matrix of the codes.
    pub fn extinction(&self) -> Sym3 {
        let density = (f64::from(self.density) / f64::from(DENSITY_STEPS)).exp2();
        let axis = usize::from(self.axis);
        let [j, k] = others(axis);
        let ratio = self.ratios.map(|code| f64::from(code) / f64::from(RATIO_ONE));
        let [a, b] = [0, 1].map(|slot| sine(self.angles[slot], RIGHT_ANGLE));
        let partial = sine(self.angles[2], self.partial_right_angle().max(1));
        let c = a * b + partial * ((1.0 - a * a) * (1.0 - b * b)).sqrt();
        let mut s = [0.0; 6];
        s[axis] = 1.0;
        s[j] = ratio[0] * ratio[0];
        s[k] = ratio[1] * ratio[1];
        s[entry(axis, j)] = ratio[0] * a;
        s[entry(axis, k)] = ratio[1] * b;
        s[entry(j, k)] = ratio[0] * ratio[1] * c;
        Sym3(s.map(|x| (x * density * density) as f32))
    }

    /// Returns the voxel of the codes.
    pub fn voxel(&self, material: u32) -> Voxel {
        Voxel::new(self.extinction(), material)
    }
}

/// Returns the two axes other than `axis`.
fn others(axis: usize) -> [usize; 2] {
    [[1, 2], [0, 2], [0, 1]][axis]
}

/// Returns the index in [`Sym3`] of the entry of two different axes.
fn entry(i: usize, j: usize) -> usize {
    i + j + 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    /// Bound on the difference of the projected area in any direction, as a share of the largest.
    const MAX_DIFFERENCE: f64 = 0.07;

    /// Returns the matrix of microflakes of one direction, of some, of many, or of nearly all in a plane.
    fn any_extinction(random: &mut Random) -> Sym3 {
        let count = [1, 2, 3, 30][random.below(4)];
        let flat = random.below(3) == 0;
        let sum = (0..count).fold(Sym3::default(), |sum, _| {
            let mut n = random.direction();
            n[2] *= if random.below(2) == 0 { 1.0 } else { -1.0 };
            if flat {
                n[random.below(3)] *= 0.02;
            }
            sum.plus(&Sym3::outer(n, random.within(0.01, 1.0)))
        });
        sum.scale(random.within(-8.0, 8.0).exp2())
    }

    fn direction(random: &mut Random) -> [f32; 3] {
        let [x, y, z] = random.direction();
        [x, y, if random.below(2) == 0 { z } else { -z }]
    }

    /// Returns the largest difference of the projected area over directions, and its root mean square, as shares of the
    /// largest area.
    fn difference(a: &Sym3, b: &Sym3, random: &mut Random) -> [f64; 2] {
        let (mut most, mut most_area, mut squares) = (0.0f64, 0.0f64, 0.0);
        for _ in 0..200 {
            let d = direction(random);
            let [x, y] = [a, b].map(|s| f64::from(s.form(d, d)).max(0.0).sqrt());
            most = most.max((x - y).abs());
            squares += (x - y) * (x - y) / 200.0;
            most_area = most_area.max(x);
        }
        [most / most_area, squares.sqrt() / most_area]
    }

    #[test]
    fn what_is_projected_survives_within_its_bound_and_codes_come_back() {
        let mut random = Random::new(1);
        let (mut most, mut squares) = (0.0f64, 0.0);
        for _ in 0..4000 {
            let s = any_extinction(&mut random);
            let codes = VoxelCodes::of(&s).unwrap();
            let back = codes.extinction();
            assert_eq!(VoxelCodes::of(&back), Some(codes), "{s:?}");
            assert!(back.eigen().0.iter().all(|value| *value >= -1e-5 * back.trace()), "{back:?}");
            let [difference, root_mean_square] = difference(&s, &back, &mut random);
            most = most.max(difference);
            squares += root_mean_square * root_mean_square / 4000.0;
        }
        assert!(most < MAX_DIFFERENCE && squares.sqrt() < 0.0045, "{most} {}", squares.sqrt());
        // Planted difference: a correlation one code off.
        let s = Sym3([1.0, 0.5, 0.25, 0.3, 0.2, -0.1]);
        let mut codes = VoxelCodes::of(&s).unwrap();
        codes.angles[0] += 4;
        let planted = difference(&s, &codes.extinction(), &mut random)[0];
        assert!(planted > 0.03, "{planted}");
    }

    #[test]
    fn any_codes_are_a_positive_semidefinite_matrix_and_its_only_ones() {
        let mut random = Random::new(2);
        for _ in 0..40_000 {
            let angle = |random: &mut Random, right: i32| random.below(2 * right as usize + 1) as i32 - right;
            let mut codes = VoxelCodes {
                density: random.below(3841) as i32 - 1920,
                axis: random.below(3) as u8,
                ratios: [0; 2].map(|_| [0, 1, 31, 62, RATIO_ONE as u8][random.below(5)]),
                angles: [angle(&mut random, RIGHT_ANGLE) as i8, angle(&mut random, RIGHT_ANGLE) as i8, 0],
            };
            (0..2).filter(|slot| codes.ratios[*slot] == 0).for_each(|slot| codes.angles[slot] = 0);
            codes.angles[2] = angle(&mut random, codes.partial_right_angle()) as i8;
            let s = codes.extinction();
            // The same codes come back of a matrix whose axis is the first, and of no other.
            assert_eq!(VoxelCodes::of(&s) == Some(codes), codes.axis_is_first(), "{codes:?}");
            assert!(s.0.iter().all(|x| x.is_finite()), "{codes:?}");
            let values = s.eigen().0;
            assert!(values.iter().all(|value| *value >= -1e-5 * s.trace()), "{codes:?} {values:?}");
        }
    }

    #[test]
    fn what_is_too_thin_is_the_least_and_what_is_too_dense_is_refused() {
        let least = VoxelCodes::of(&Sym3::default()).unwrap();
        assert!(least.extinction().trace() < 1e-15 && VoxelCodes::of(&least.extinction()) == Some(least));
        assert_eq!(VoxelCodes::of(&Sym3([1e19, 0.0, 0.0, 0.0, 0.0, 0.0])), None);
        assert!(VoxelCodes::of(&Sym3([1e18, 0.0, 0.0, 0.0, 0.0, 0.0])).is_some());
    }
}

//! The diffuse light that the microflakes of a voxel send to the eye, in closed form. Twin: `voltex/shade.wgsl`.

use super::matrix::Sym3;
use super::volume::{HOTSPOT_DEG, LevelShadow};

/// Least root of a product that is divided by.
pub const MIN_ROOT: f32 = 1e-30;
/// Optical depth below which [`seen_at`] uses a series.
pub const SERIES_DEPTH: f32 = 1.0;

/// Returns two sums over the microflakes of `a |n.v| |n.l|` for light from `l`, seen from `v` (unit vectors away from
/// the microflakes): over those with both directions on one side, and over those with the directions on two sides.
///
/// Exact for one microflake and for microflakes in all directions. For normals of which `n.v` and `n.l` are Gaussian
/// the mean of `|n.v| |n.l|` is `2/pi (sqrt(ab - c^2) + c asin(c / sqrt(ab)))`; the sum of `(n.v)(n.l)` is always
/// exact.
///
/// Twin: `voltex_shade`.
pub fn shade(moment: &Sym3, v: [f32; 3], l: [f32; 3]) -> [f32; 2] {
    let (a, b, c) = (moment.form(v, v), moment.form(l, l), moment.form(v, l));
    let root = (a * b).max(0.0).sqrt();
    let r = (c / root.max(MIN_ROOT)).clamp(-1.0, 1.0);
    let both = std::f32::consts::FRAC_2_PI * (root * ((1.0 - r) * (1.0 + r)).sqrt() + c * r.asin());
    [(0.5 * (both + c)).max(0.0), (0.5 * (both - c)).max(0.0)]
}

/// Returns the mean distance, from where a ray enters a cell, of the microflakes that it sees there: `length (1 / depth
/// - 1 / (exp(depth) - 1))` for an optical depth `depth` over `length`, and a series where that is a small difference.
/// Twin: `voltex_seen_at`.
pub fn seen_at(depth: f32, length: f32) -> f32 {
    if depth >= SERIES_DEPTH {
        return length * (1.0 / depth - 1.0 / depth.exp_m1());
    }
    let d2 = depth * depth;
    length * (0.5 - depth / 12.0 * (1.0 - d2 / 60.0 * (1.0 - d2 / 42.0 * (1.0 - d2 / 40.0))))
}

impl LevelShadow {
    /// Returns the share c of gaps that eye and light have in common at an angle with this cosine, linear between
    /// [`HOTSPOT_DEG`]. Twin: `voltex_shared_at`.
    pub fn shared_at(&self, cos: f32) -> f32 {
        let degrees = cos.clamp(-1.0, 1.0).acos().to_degrees();
        let last = HOTSPOT_DEG.len() - 2;
        let i = (0..=last).rev().find(|i| degrees >= HOTSPOT_DEG[*i]).unwrap_or(0);
        let part = (degrees - HOTSPOT_DEG[i]) / (HOTSPOT_DEG[i + 1] - HOTSPOT_DEG[i]);
        self.shared[i] + (self.shared[i + 1] - self.shared[i]) * part.clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::algebra::{cholesky, gram_of, solve};
    use crate::testing::{Random, sphere_direction};
    use crate::voltex::{Voxel, dot};
    use std::f64::consts::PI;

    /// A microflake: area and normal.
    type Microflake = (f32, [f32; 3]);

    fn moment(microflakes: &[Microflake]) -> Sym3 {
        microflakes.iter().fold(Sym3::default(), |sum, (a, n)| sum.plus(&Sym3::outer(*n, *a)))
    }

    /// Returns the sums that [`shade`] approximates.
    fn shaded(microflakes: &[Microflake], v: [f32; 3], l: [f32; 3]) -> [f32; 2] {
        let product = |n: &[f32; 3]| dot(*n, v) * dot(*n, l);
        [1.0, -1.0].map(|side| microflakes.iter().map(|(a, n)| a * (side * product(n)).max(0.0)).sum())
    }

    fn apart(a: [f32; 2], b: [f32; 2]) -> f32 {
        (a[0] - b[0]).abs().max((a[1] - b[1]).abs())
    }

    #[test]
    fn one_microflake_and_microflakes_in_all_directions_are_exact() {
        let mut random = Random::new(9);
        for round in 0..10_000 {
            let microflake = [(random.within(0.1, 3.0), sphere_direction(&mut random))];
            let v = sphere_direction(&mut random);
            // One in four as the hotspot is, or against the light.
            let l = match round % 8 {
                0 => v,
                1 => v.map(|x| -x),
                _ => sphere_direction(&mut random),
            };
            let expected = shaded(&microflake, v, l);
            let found = shade(&moment(&microflake), v, l);
            assert!(apart(found, expected) < 2e-6 * microflake[0].0, "{found:?} {expected:?}");
            assert!(apart(shade(&moment(&microflake).scale(1.001), v, l), expected) > 1e-4 * expected[0], "planted");
            // Area 3: the mean of |n.v| |n.l| is 2 / (3 pi) (sin + (pi / 2 - angle) cos).
            let isotropic = Sym3([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
            let cos = f64::from(dot(v, l)).clamp(-1.0, 1.0);
            let both = 2.0 / PI * ((1.0 - cos * cos).sqrt() + cos * cos.asin());
            let expected = [0.5 * (both + cos), 0.5 * (both - cos)].map(|x| x as f32);
            assert!(apart(shade(&isotropic, v, l), expected) < 2e-6, "{expected:?}");
        }
        assert_eq!(shade(&Sym3::default(), [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), [0.0; 2]);
    }

    /// Returns `count` microflakes whose normals are stretched along each axis of a random frame by up to `1 /
    /// stretch`.
    fn microflakes(random: &mut Random, count: usize, stretch: f32) -> Vec<Microflake> {
        let z = sphere_direction(random);
        let x = crate::voltex::cross(z, if z[0].abs() < 0.5 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] });
        let x = x.map(|c| c / dot(x, x).sqrt());
        let frame = [x, crate::voltex::cross(z, x), z];
        let scales = [0; 3].map(|_| stretch.powf(random.within(0.0, 1.0)));
        let microflake = |random: &mut Random| {
            // Within a ball, so that the stretched has no corners.
            let radius = random.within(0.0, 1.0).cbrt();
            let g = sphere_direction(random).map(|c| c * radius);
            let n: [f32; 3] = std::array::from_fn(|i| (0..3).map(|axis| frame[axis][i] * scales[axis] * g[axis]).sum());
            let length = dot(n, n).sqrt().max(1e-9);
            (-random.within(1e-6, 1.0).ln(), n.map(|c| c / length))
        };
        let microflakes: Vec<Microflake> = (0..count).map(|_| microflake(random)).collect();
        let area: f32 = microflakes.iter().map(|(a, _)| a).sum();
        microflakes.into_iter().map(|(a, n)| (a / area, n)).collect()
    }

    /// Returns the extinction matrix that approximates the microflakes' projected areas: least squares of the squares.
    fn extinction(microflakes: &[Microflake], directions: &[[f32; 3]], rows: &[Vec<f32>], factor: &[f32]) -> Sym3 {
        let squares: Vec<f32> = directions
            .iter()
            .map(|d| microflakes.iter().map(|(a, n)| a * dot(*n, *d).abs()).sum::<f32>().powi(2))
            .collect();
        let s = solve(factor, rows.iter().map(|row| row.iter().zip(&squares).map(|(x, y)| x * y).sum()).collect());
        Sym3(std::array::from_fn(|i| s[i])).mapped(|x| x.max(0.0))
    }

    /// Returns the root of the mean square, and the mean.
    fn spread(errors: &[f32]) -> [f64; 2] {
        let mean = |f: &dyn Fn(f64) -> f64| errors.iter().map(|x| f(f64::from(*x))).sum::<f64>() / errors.len() as f64;
        [mean(&|x| x * x).sqrt(), mean(&|x| x)]
    }

    #[test]
    fn closed_forms_are_near_the_sums_over_random_microflakes() {
        let mut random = Random::new(10);
        let directions: Vec<[f32; 3]> = (0..40).map(|_| sphere_direction(&mut random)).collect();
        let entry = |i: usize, d: &[f32; 3]| Sym3::outer(*d, if i < 3 { 1.0 } else { 2.0 }).0[i];
        let row = |i: usize| directions.iter().map(|d| entry(i, d)).collect();
        let rows: Vec<Vec<f32>> = (0..6).map(row).collect();
        let factor = cholesky(&gram_of(&rows), 6).unwrap();
        // Bars: root mean squares per unit area of the closed form by the microflakes' own moment and by the derived
        // one, and of the projected area. Light of which the mean is an eighth; voxels of a tree have many microflakes.
        for (counts, stretch, bars) in [
            (1..2, 0.3, [1e-6, 0.006, 1e-4]),
            (2..8, 0.3, [0.02, 0.022, 0.038]),
            (16..32, 0.3, [0.014, 0.014, 0.03]),
            (32..128, 0.1, [0.009, 0.01, 0.016]),
            (32..128, 1.0, [0.009, 0.01, 0.016]),
        ] {
            let mut errors = [const { Vec::new() }; 4];
            for _ in 0..20_000 {
                let count = counts.start + random.below(counts.end - counts.start);
                let microflakes = microflakes(&mut random, count, stretch);
                let (v, l) = (sphere_direction(&mut random), sphere_direction(&mut random));
                let voxel = Voxel::new(extinction(&microflakes, &directions, &rows, &factor), 0);
                let truth = shaded(&microflakes, v, l)[0];
                let projected: f32 = microflakes.iter().map(|(a, n)| a * dot(*n, v).abs()).sum();
                errors[0].push(shade(&moment(&microflakes), v, l)[0] - truth);
                errors[1].push(shade(&voxel.moment, v, l)[0] - truth);
                errors[2].push(voxel.extinction.form(v, v).max(0.0).sqrt() - projected);
                // Planted difference: a fiftieth more microflakes.
                errors[3].push(shade(&moment(&microflakes).scale(1.02), v, l)[0] - truth);
            }
            let found = errors.map(|errors| spread(&errors));
            println!("{counts:?} microflakes stretched by {stretch}: {found:.4?}");
            for (i, bias) in [0.001, 0.001, 0.003].into_iter().enumerate() {
                assert!(found[i][0] <= bars[i] && found[i][1].abs() <= bias, "{counts:?} {stretch} {i}: {found:?}");
            }
            assert!(found[3][1] > 0.001, "{found:?}");
        }
    }

    #[test]
    fn light_and_eye_exchange() {
        let mut random = Random::new(11);
        for _ in 0..10_000 {
            let m = moment(&microflakes(&mut random, 5, 0.3));
            let (v, l) = (sphere_direction(&mut random), sphere_direction(&mut random));
            assert!(apart(shade(&m, v, l), shade(&m, l, v)) < 1e-6);
            // Behind the microflakes what was reflected is transmitted.
            let [reflected, transmitted] = shade(&m, v, l.map(|x| -x));
            assert!(apart([transmitted, reflected], shade(&m, v, l)) < 1e-6);
        }
    }

    /// Returns the mean over lights from all sides, times their solid angle and over pi: the light that white
    /// microflakes send on.
    fn furnace(m: &Sym3, v: [f32; 3]) -> f64 {
        const RINGS: usize = 200;
        let mut sum = 0.0;
        for i in 0..RINGS {
            let z = (2.0 * i as f32 + 1.0) / RINGS as f32 - 1.0;
            for k in 0..2 * RINGS {
                let (sin, cos) = ((k as f32 + 0.5) / RINGS as f32 * std::f32::consts::PI).sin_cos();
                let r = (1.0 - z * z).sqrt();
                let [reflected, transmitted] = shade(m, v, [r * cos, r * sin, z]);
                sum += f64::from(reflected + transmitted);
            }
        }
        4.0 * sum / (2 * RINGS * RINGS) as f64
    }

    #[test]
    fn white_microflakes_send_on_twice_the_light_that_they_stop() {
        // The integral of |n.l| over all l is 2 pi, so a microflake sends on 2 pi a |n.v| / pi: of the light from both
        // sides all.
        let mut random = Random::new(12);
        for _ in 0..5 {
            let (n, v) = (sphere_direction(&mut random), sphere_direction(&mut random));
            let one = furnace(&Sym3::outer(n, 1.0), v) / (2.0 * f64::from(dot(n, v).abs()));
            // Microflakes of area 1 in all directions project 1/2.
            let all = furnace(&Sym3([1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0, 0.0, 0.0, 0.0]), v);
            assert!((one - 1.0).abs() < 1e-3 && (all - 1.0).abs() < 1e-3, "{one} {all}");
        }
        let mut ratios = Vec::new();
        for _ in 0..200 {
            let microflakes = microflakes(&mut random, 64, 0.3);
            let v = sphere_direction(&mut random);
            let projected: f32 = microflakes.iter().map(|(a, n)| a * dot(*n, v).abs()).sum();
            ratios.push((furnace(&moment(&microflakes), v) / (2.0 * f64::from(projected)) - 1.0) as f32);
        }
        let [rms, mean] = spread(&ratios);
        println!("furnace of other microflakes: {mean:+.4} of 1, RMS {rms:.4}");
        assert!(rms < 0.04 && mean.abs() < 0.01, "{rms} {mean}");
    }

    #[test]
    fn what_is_seen_of_a_cell_is_the_middle_of_its_extinction() {
        for i in 0..2000 {
            let depth = 1e-6 * 1.01f32.powi(i);
            let x = f64::from(depth);
            // As exp(-x) from the far end, without a small difference of large ones.
            let expected = if x < 0.02 { 0.5 - x / 12.0 + x.powi(3) / 720.0 } else { 1.0 / x - 1.0 / x.exp_m1() };
            let found = f64::from(seen_at(depth, 3.0)) / 3.0;
            assert!((found / expected - 1.0).abs() < 1e-6, "{depth}: {found} {expected}");
        }
        assert_eq!(seen_at(0.0, 2.0), 1.0);
    }

    #[test]
    fn shares_are_linear_between_their_angles() {
        let shadow = LevelShadow { offset: 0.0, shared: std::array::from_fn(|i| (i as f32 - 4.0).powi(2) / 30.0) };
        let at = |degrees: f32| shadow.shared_at(degrees.to_radians().cos());
        for i in 0..HOTSPOT_DEG.len() {
            // A cosine knows small angles to 0.02 degrees.
            assert!((at(HOTSPOT_DEG[i]) - shadow.shared[i]).abs() < 2e-3, "{i}");
        }
        assert!((at(90.0) - 0.5 * (shadow.shared[6] + shadow.shared[7])).abs() < 1e-4);
        assert!((at(15.0) - 0.5 * (shadow.shared[3] + shadow.shared[4])).abs() < 1e-4);
        assert_eq!([2.0, -2.0].map(|cos| shadow.shared_at(cos)), [shadow.shared[0], shadow.shared[9]]);
    }
}

//! The specular lobe of a voxel's microflakes: light that their smooth surfaces reflect to the eye.
//! Twin: `voltex/gloss.wgsl`.
//!
//! Facets are spread as microflakes whose ellipsoid is S, each of them tilted as GGX tilts those of a surface [Walter
//! et al. 2007]: F = S + alpha^2 (tr(S) I - S), which is GGX's own ellipsoid for one microflake and a sphere for
//! microflakes of all directions [after Heitz et al. 2015]. Ellipsoids, of second degree, cannot represent leaves that
//! are all inclined alike; a correction of fourth degree does, for all voxels of a level:
//! [`Facets`](super::corrections::facets::Facets).
//!
//! What other facets of a microflake hide of those along h depends on the microflake's own normal. As if normals and
//! tilts were normally distributed, microflakes with facets along h have normals about B F^-1 h with the covariance
//! B - B F^-1 B, where B = (1 - alpha^2) S: for one microflake, the normal that it has. The share that is seen is the
//! mean over three of these normals, a standard deviation apart in the plane in which light and eye exchange.

use super::corrections::facets::MIN_HALF2;
use super::matrix::Sym3;
use crate::leaf::lobe::fresnel;
use crate::numeric::vector::dot;

/// Least roughness, GGX alpha: a smaller one gives no ellipsoid in single precision.
pub const MIN_ROUGHNESS: f32 = 0.1;
/// Least share of the amplitude that is not reflected: a surface that reflects all light has an index of tens of
/// thousands.
pub const MIN_REFRACTED: f32 = 1e-4;

/// Least squared length of a normal and of a difference of directions that has a direction.
pub const MIN_NORMAL2: f32 = 1e-20;
/// Weight of the middle one of three normals; the others have half of what is left each.
pub const MIDDLE_WEIGHT: f32 = 0.5;

/// Returns the specular lobe for light from `l`, seen from `v` (unit vectors away from the microflakes): the sum over
/// the microflakes' smooth surfaces of `pi a F D G / 4`, to be added to `reflectance` times the first sum of
/// [`shade`](super::shade). `specular` is the reflectance at normal incidence, from air into a medium without
/// absorption; `roughness` is GGX's alpha.
///
/// Exact for one microflake. For many, the gaps between their normals are filled, which
/// [`Facets`](super::corrections::facets::Facets) correct; they are as bright as each of them alone within a tenth, and
/// rough ones of all directions up to 1.7 times as bright where light and eye are nearly opposite.
///
/// Twin: `voltex_gloss`.
pub fn gloss(extinction: &Sym3, specular: f32, roughness: f32, v: [f32; 3], l: [f32; 3]) -> f32 {
    let trace = extinction.trace();
    let half: [f32; 3] = std::array::from_fn(|i| v[i] + l[i]);
    let half2 = dot(half, half);
    if trace <= 0.0 || half2 < MIN_HALF2 {
        return 0.0;
    }
    let alpha2 = roughness.max(MIN_ROUGHNESS).powi(2);
    let tilted = extinction.scale((1.0 - alpha2) / trace);
    let facets = tilted.plus(&Sym3([alpha2, alpha2, alpha2, 0.0, 0.0, 0.0]));
    let adjugate = facets.adjugate();
    // The determinant, by the first row.
    let determinant = facets.0[0] * adjugate.0[0] + facets.0[3] * adjugate.0[3] + facets.0[4] * adjugate.0[4];
    let towards = adjugate.times(half);
    let spread = dot(half, towards) / half2;
    // pi D = 1 / (sqrt|S| (h' S^-1 h)^2).
    let density = trace.sqrt() * determinant.max(0.0).powf(1.5) / (spread * spread).max(1e-30);
    // The normals of the microflakes with facets along h: their mean, and one standard deviation aside.
    let length = (determinant * spread * half2).max(1e-30).sqrt();
    let mean = tilted.times(towards).map(|x| x / length);
    let difference: [f32; 3] = std::array::from_fn(|i| v[i] - l[i]);
    let along = dot(difference, mean) / dot(mean, mean).max(MIN_NORMAL2);
    let aside: [f32; 3] = std::array::from_fn(|i| difference[i] - along * mean[i]);
    let across = tilted.times(aside);
    let variance = dot(aside, across) - adjugate.form(across, across) / determinant;
    let deviation = variance.max(0.0).sqrt() / dot(aside, aside).max(MIN_NORMAL2);
    let seen = |tilt: f32| facets_seen(std::array::from_fn(|i| mean[i] + tilt * aside[i]), alpha2, v, l);
    let shares = MIDDLE_WEIGHT * seen(0.0) + 0.5 * (1.0 - MIDDLE_WEIGHT) * (seen(deviation) + seen(-deviation));
    // Of the index that has this reflectance at normal incidence.
    let root = specular.sqrt();
    let index = (1.0 + root) / (1.0 - root).max(MIN_REFRACTED);
    0.25 * fresnel(index, dot(half, v) / half2.sqrt()) * density * shares
}

/// Returns the share of a microflake's facets that others do not hide from `v` nor from `l` [Smith 1967]; 0 where they
/// are on different sides of it. The normal may have any length. Twin: `voltex_facets_seen`.
fn facets_seen(normal: [f32; 3], alpha2: f32, v: [f32; 3], l: [f32; 3]) -> f32 {
    let length = dot(normal, normal).max(MIN_NORMAL2).sqrt();
    let [cos_v, cos_l] = [v, l].map(|d| dot(normal, d) / length);
    if cos_v * cos_l <= 0.0 {
        return 0.0;
    }
    let seen = |cos: f32| 2.0 * cos / (cos + (alpha2 + (1.0 - alpha2) * cos * cos).sqrt());
    seen(cos_v.abs()) * seen(cos_l.abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, sphere_direction};
    use std::f32::consts::PI;

    /// Returns `pi D G / 4` of one microflake of area 1, by GGX's own formulas.
    fn of_microflake(n: [f32; 3], alpha: f32, v: [f32; 3], l: [f32; 3]) -> f32 {
        let side = dot(n, v).signum();
        let n = n.map(|x| x * side);
        let (cos_v, cos_l) = (dot(n, v), dot(n, l));
        if cos_l <= 0.0 {
            return 0.0;
        }
        let half: [f32; 3] = std::array::from_fn(|i| v[i] + l[i]);
        let cos_h = dot(n, half) / dot(half, half).sqrt();
        let tan2 = (1.0 - cos_h * cos_h).max(0.0) / (cos_h * cos_h);
        let d = alpha * alpha / (PI * cos_h.powi(4) * (alpha * alpha + tan2).powi(2));
        let g = |cos: f32| 2.0 * cos / (cos + (alpha * alpha + (1.0 - alpha * alpha) * cos * cos).sqrt());
        0.25 * PI * d * g(cos_v) * g(cos_l)
    }

    #[test]
    fn one_microflake_is_a_rough_surface() {
        let mut random = Random::new(21);
        let (mut compared, mut planted, mut dark) = (0, 0, 0);
        for _ in 0..20_000 {
            let n = sphere_direction(&mut random);
            let area = random.within(0.1, 4.0);
            let alpha = random.within(0.1, 0.6);
            let (v, l) = (sphere_direction(&mut random), sphere_direction(&mut random));
            // Where single precision tells cosines.
            if dot(n, v).abs().min(dot(n, l).abs()) < 0.05 {
                continue;
            }
            let expected = area * of_microflake(n, alpha, v, l);
            let s = Sym3::outer(n, area * area);
            if expected == 0.0 {
                assert_eq!(gloss(&s, 1.0, alpha, v, l), 0.0, "{n:?} {v:?} {l:?}");
                dark += 1;
                continue;
            }
            let fault = |found: f32| (found / expected - 1.0).abs();
            // White facets.
            let found = gloss(&s, 1.0, alpha, v, l);
            assert!(fault(found) < 5e-3, "{alpha}: {found} {expected}");
            compared += 1;
            planted += usize::from(fault(gloss(&s, 1.0, 1.02 * alpha, v, l)) > 5e-3);
        }
        assert!(compared > 5000 && dark > 5000 && planted > compared / 2, "{compared} {planted} {dark}");
    }

    #[test]
    fn light_and_eye_exchange_and_more_microflakes_are_as_much_brighter() {
        let mut random = Random::new(22);
        for _ in 0..5000 {
            let microflakes = (0..3).map(|_| Sym3::outer(sphere_direction(&mut random), random.within(0.1, 1.0)));
            let s = microflakes.fold(Sym3::default(), |sum, microflake| sum.plus(&microflake));
            let (v, l) = (sphere_direction(&mut random), sphere_direction(&mut random));
            let here = gloss(&s, 0.04, 0.3, v, l);
            assert!((gloss(&s, 0.04, 0.3, l, v) - here).abs() <= 1e-4 * here);
            assert!((gloss(&s.scale(16.0), 0.04, 0.3, v, l) - 4.0 * here).abs() <= 1e-4 * here);
        }
        let (v, opposite) = ([0.0, 0.6, 0.8], [0.0, -0.6, -0.8]);
        assert_eq!(
            [gloss(&Sym3::default(), 1.0, 0.3, v, v), gloss(&Sym3::outer(v, 1.0), 1.0, 0.3, v, opposite)],
            [0.0; 2]
        );
        assert!(gloss(&Sym3::outer(v, 1.0), 1.0, 0.0, v, v).is_finite());
    }

    #[test]
    fn many_microflakes_are_as_bright_as_each_of_them_alone() {
        let mut random = Random::new(24);
        let directions: Vec<[[f32; 3]; 2]> = (0..400).map(|_| [0; 2].map(|_| sphere_direction(&mut random))).collect();
        // Of all directions, nearly flat, nearly upright.
        for squeezed in [[1.0, 1.0, 1.0], [0.3, 0.3, 1.0], [1.0, 1.0, 0.3f32]] {
            let normal = || {
                let n = sphere_direction(&mut random);
                let n: [f32; 3] = std::array::from_fn(|i| n[i] * squeezed[i]);
                n.map(|x| x / dot(n, n).sqrt())
            };
            let normals: Vec<[f32; 3]> = std::iter::repeat_with(normal).take(4000).collect();
            let towards = |i: usize| normals.iter().map(|n| n[i].abs()).sum::<f32>() / normals.len() as f32;
            let [x, y, z] = [0, 1, 2].map(|i| towards(i).powi(2));
            let s = Sym3([x, y, z, 0.0, 0.0, 0.0]);
            for alpha in [0.2, 0.4, 0.6] {
                // Near one another, and on opposite sides.
                for (least, most) in [(0.0, 1.0), (-1.0, -0.5)] {
                    let pairs = directions.iter().filter(|[v, l]| (least..most).contains(&dot(*v, *l)));
                    let (mut sum, mut expected) = (0.0, 0.0);
                    for [v, l] in pairs {
                        let each = normals.iter().map(|n| f64::from(of_microflake(*n, alpha, *v, *l))).sum::<f64>();
                        expected += each / normals.len() as f64;
                        sum += f64::from(gloss(&s, 1.0, alpha, *v, *l));
                    }
                    println!("{squeezed:?}, roughness {alpha}, cosines from {least}: {:.2}", sum / expected);
                    // Of all normals, if they hid alike, those opposite would be four times as bright, and more.
                    let most = if least < 0.0 { 1.7 } else { 1.1 };
                    assert!((0.9..most).contains(&(sum / expected)), "{}", sum / expected);
                }
            }
        }
    }

    /// Returns four times the mean of `sent` over lights from all sides: irradiance pi from a solid angle of 4 pi.
    fn furnace(sent: impl Fn([f32; 3]) -> f32) -> f64 {
        const RINGS: usize = 300;
        let mut sum = 0.0;
        for i in 0..RINGS {
            let z = (2.0 * i as f32 + 1.0) / RINGS as f32 - 1.0;
            for k in 0..2 * RINGS {
                let (sin, cos) = ((k as f32 + 0.5) / RINGS as f32 * PI).sin_cos();
                let r = (1.0 - z * z).sqrt();
                sum += f64::from(sent([r * cos, r * sin, z]));
            }
        }
        4.0 * sum / (2 * RINGS * RINGS) as f64
    }

    #[test]
    fn white_facets_send_on_what_they_stop_but_what_other_facets_hide() {
        let mut random = Random::new(23);
        let (mut least, mut most) = (f64::INFINITY, 0f64);
        for i in 0..12 {
            let v = sphere_direction(&mut random);
            let normals: Vec<[f32; 3]> = (0..1 + i % 4).map(|_| sphere_direction(&mut random)).collect();
            let microflakes = normals.iter().map(|n| Sym3::outer(*n, random.within(0.1, 1.0)));
            let s = microflakes.fold(Sym3::default(), |sum, microflake| sum.plus(&microflake));
            let sent = furnace(|l| gloss(&s, 1.0, 0.3, v, l)) / f64::from(s.form(v, v).sqrt());
            (least, most) = (least.min(sent), most.max(sent));
            if let [n] = normals[..] {
                // What a surface of one microflake's facets sends: light that meets two of them is lost.
                let expected = furnace(|l| of_microflake(n, 0.3, v, l)) / f64::from(dot(n, v).abs());
                assert!((sent / expected - 1.0).abs() < 0.01, "{sent} {expected}");
            }
        }
        println!("furnace: {least:.3} to {most:.3}");
        assert!(least > 0.75 && most < 1.0, "{least} {most}");
        // Microflakes of all directions, whose facets are theirs.
        let (s, v) = (Sym3([0.25, 0.25, 0.25, 0.0, 0.0, 0.0]), [0.0, 0.6, 0.8]);
        let all = furnace(|l| gloss(&s, 1.0, MIN_ROUGHNESS, v, l)) / 0.5;
        assert!((all - 0.95).abs() < 0.03, "{all}");
    }
}

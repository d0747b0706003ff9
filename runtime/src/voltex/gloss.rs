//! The specular lobe of a voxel's microflakes: light that their smooth surfaces reflect to the eye.
//! Twin: `voltex/gloss.wgsl`.
//!
//! Facets are spread as microflakes whose ellipsoid is S, each of them tilted as GGX tilts those of a surface [Walter
//! et al. 2007]: S + alpha^2 (tr(S) I - S), which is GGX's own ellipsoid for one microflake and a sphere for
//! microflakes of all directions [after Heitz et al. 2015]. Ellipsoids, of second degree, cannot represent leaves that
//! are all inclined alike; a correction of fourth degree does, for all voxels of a level:
//! [`Facets`](super::corrections::facets::Facets).

use super::corrections::facets::MIN_HALF2;
use super::matrix::Sym3;
use super::shade::MIN_ROOT;
use crate::leaf::lobe::fresnel;
use crate::numeric::vector::dot;

/// Least roughness, GGX alpha: a smaller one gives no ellipsoid in single precision.
pub const MIN_ROUGHNESS: f32 = 0.1;
/// Least share of the amplitude that is not reflected: a surface that reflects all light has an index of tens of
/// thousands.
pub const MIN_REFRACTED: f32 = 1e-4;

/// Returns the specular lobe for light from `l`, seen from `v` (unit vectors away from the microflakes): the sum over
/// the microflakes' smooth surfaces of `pi a F D G / 4`, to be added to `reflectance` times the first sum of
/// [`shade`](super::shade). `specular` is the reflectance at normal incidence, from air into a medium without
/// absorption; `roughness` is GGX's alpha.
///
/// Exact for one microflake on the side of the light. On the other side it shows facets that a surface does not have,
/// and to eyes along it microflakes send up to an eighth more light than they stop. For many microflakes the gaps
/// between their normals are filled, which [`Facets`](super::corrections::facets::Facets) correct.
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
    let microflakes = extinction.scale(1.0 / trace);
    let facets = microflakes.scale(1.0 - alpha2).plus(&Sym3([alpha2, alpha2, alpha2, 0.0, 0.0, 0.0]));
    // Share of the facets towards d that others do not hide [Smith 1967].
    let seen = |d: [f32; 3]| {
        let [own, all] = [&microflakes, &facets].map(|s| s.form(d, d).max(0.0).sqrt());
        2.0 * own / (own + all).max(MIN_ROOT)
    };
    let adjugate = facets.adjugate();
    // The determinant, by the first row.
    let determinant = facets.0[0] * adjugate.0[0] + facets.0[3] * adjugate.0[3] + facets.0[4] * adjugate.0[4];
    let spread = adjugate.form(half, half) / half2;
    // pi D = 1 / (sqrt|S| (h' S^-1 h)^2).
    let density = trace.sqrt() * determinant.max(0.0).powf(1.5) / (spread * spread).max(1e-30);
    // Of the index that has this reflectance at normal incidence.
    let root = specular.sqrt();
    let index = (1.0 + root) / (1.0 - root).max(MIN_REFRACTED);
    0.25 * fresnel(index, dot(half, v) / half2.sqrt()) * density * seen(v) * seen(l)
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
        let (mut compared, mut planted) = (0, 0);
        for _ in 0..20_000 {
            let n = sphere_direction(&mut random);
            let area = random.within(0.1, 4.0);
            let alpha = random.within(0.1, 0.6);
            let (v, l) = (sphere_direction(&mut random), sphere_direction(&mut random));
            // On the side of the light, and where single precision tells cosines.
            if dot(n, v) * dot(n, l) <= 0.0 || dot(n, v).abs().min(dot(n, l).abs()) < 0.05 {
                continue;
            }
            let expected = area * of_microflake(n, alpha, v, l);
            let s = Sym3::outer(n, area * area);
            let fault = |found: f32| (found / expected - 1.0).abs();
            // White facets.
            let found = gloss(&s, 1.0, alpha, v, l);
            assert!(fault(found) < 5e-3, "{alpha}: {found} {expected}");
            compared += 1;
            planted += usize::from(fault(gloss(&s, 1.0, 1.02 * alpha, v, l)) > 5e-3);
        }
        assert!(compared > 5000 && planted > compared / 2, "{compared} {planted}");
    }

    #[test]
    fn light_and_eye_exchange_and_more_microflakes_are_as_much_brighter() {
        let mut random = Random::new(22);
        for _ in 0..5000 {
            let microflakes = (0..3).map(|_| Sym3::outer(sphere_direction(&mut random), random.within(0.1, 1.0)));
            let s = microflakes.fold(Sym3::default(), |sum, microflake| sum.plus(&microflake));
            let (v, l) = (sphere_direction(&mut random), sphere_direction(&mut random));
            let here = gloss(&s, 0.04, 0.3, v, l);
            assert!((gloss(&s, 0.04, 0.3, l, v) - here).abs() < 1e-4 * here);
            assert!((gloss(&s.scale(9.0), 0.04, 0.3, v, l) - 3.0 * here).abs() < 1e-4 * here);
        }
        let (v, opposite) = ([0.0, 0.6, 0.8], [0.0, -0.6, -0.8]);
        assert_eq!(
            [gloss(&Sym3::default(), 1.0, 0.3, v, v), gloss(&Sym3::outer(v, 1.0), 1.0, 0.3, v, opposite)],
            [0.0; 2]
        );
        assert!(gloss(&Sym3::outer(v, 1.0), 1.0, 0.0, v, v).is_finite());
    }

    /// Returns the mean over lights from all sides of the light that white facets send on, relative to the light they
    /// stop.
    fn furnace(s: &Sym3, alpha: f32, v: [f32; 3]) -> f64 {
        const RINGS: usize = 300;
        let mut sum = 0.0;
        for i in 0..RINGS {
            let z = (2.0 * i as f32 + 1.0) / RINGS as f32 - 1.0;
            for k in 0..2 * RINGS {
                let (sin, cos) = ((k as f32 + 0.5) / RINGS as f32 * PI).sin_cos();
                let r = (1.0 - z * z).sqrt();
                sum += f64::from(gloss(s, 1.0, alpha, v, [r * cos, r * sin, z]));
            }
        }
        // Irradiance pi from a solid angle of 4 pi over as many lights.
        4.0 * sum / (2 * RINGS * RINGS) as f64 / f64::from(s.form(v, v).sqrt())
    }

    #[test]
    fn white_facets_send_on_about_what_they_stop() {
        let mut random = Random::new(23);
        let (mut least, mut most) = (f64::INFINITY, 0f64);
        for i in 0..12 {
            let v = sphere_direction(&mut random);
            let microflakes =
                (0..1 + i % 4).map(|_| Sym3::outer(sphere_direction(&mut random), random.within(0.1, 1.0)));
            let s = microflakes.fold(Sym3::default(), |sum, microflake| sum.plus(&microflake));
            let sent = furnace(&s, 0.3, v);
            (least, most) = (least.min(sent), most.max(sent));
        }
        println!("furnace: {least:.3} to {most:.3}");
        assert!(least > 0.9 && most < 1.125, "{least} {most}");
        // Microflakes of all directions, whose facets are theirs.
        let all = furnace(&Sym3([0.25, 0.25, 0.25, 0.0, 0.0, 0.0]), MIN_ROUGHNESS, [0.0, 0.6, 0.8]);
        assert!((all - 1.0).abs() < 0.02, "{all}");
    }
}

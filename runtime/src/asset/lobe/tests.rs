//! Tests of the lobe families.

use super::*;
use crate::testing::{Random, direction_from_degrees, random_lobe};

fn lobe(family: LobeFamily, params: [f32; 4]) -> Lobe {
    Lobe { family, normal_xy: [0.0; 2], tangent_rad: 0.3, params }
}

fn rotate_z(v: [f32; 3], angle_rad: f32) -> [f32; 3] {
    let (sin, cos) = angle_rad.sin_cos();
    [cos * v[0] - sin * v[1], sin * v[0] + cos * v[1], v[2]]
}

fn close(a: f32, b: f32) -> bool {
    (a - b).abs() <= 1e-3 * a.max(b) + 1e-6
}

/// Returns `pi * BRDF`: the value without the light's cosine.
fn brdf(setup: &LobeSetup, wi: [f32; 3], wo: [f32; 3]) -> f32 {
    setup.eval(wi, wo) / dot(setup.normal, wi)
}

/// Returns the share of a white sky that reaches the eye: `1 / pi` of the value's integral over all lights, by the
/// midpoint rule on half-degree by degree cells.
fn albedo(setup: &LobeSetup, wo: [f32; 3]) -> f64 {
    let (rows, columns) = (180, 360);
    let (step_theta, step_phi) = (90.0 / f64::from(rows), 360.0 / f64::from(columns));
    let mut sum = 0.0;
    for i in 0..rows {
        let theta = (f64::from(i) + 0.5) * step_theta;
        let ring: f64 = (0..columns)
            .map(|j| {
                let wi = direction_from_degrees(theta, (f64::from(j) + 0.5) * step_phi);
                f64::from(setup.eval(wi, wo))
            })
            .sum();
        sum += ring * theta.to_radians().sin();
    }
    sum * step_theta.to_radians() * step_phi.to_radians() / std::f64::consts::PI
}

fn largest_albedo(setup: &LobeSetup) -> f64 {
    [0.0, 20.0, 40.0, 55.0, 65.0, 75.0, 80.0, 85.0, 88.0]
        .map(|theta| albedo(setup, direction_from_degrees(theta, 37.0)))
        .into_iter()
        .fold(0.0, f64::max)
}

#[test]
fn every_lobe_is_finite_and_not_negative_for_any_pair_of_directions() {
    let mut random = Random::new(1);
    for family in LobeFamily::ALL {
        for _ in 0..2000 {
            let setup = random_lobe(&mut random, family).setup();
            let mut pairs = Vec::new();
            for _ in 0..6 {
                let (mut wi, mut wo) = (random.direction(), random.direction());
                pairs.push((wi, wo));
                // Below the macroscopic horizon, and grazing.
                wo[2] = -wo[2];
                pairs.push((wi, wo));
                wi = direction_from_degrees(90.0 - f64::from(random.within(0.0, 0.01)), wi[0].into());
                pairs.push((wi, wo));
                // Opposite directions have no half vector, equal ones no angle.
                pairs.push((wi, wi.map(|x| -x)));
                pairs.push((wi, wi));
            }
            pairs.push((setup.normal, setup.normal));
            for (wi, wo) in pairs {
                let value = setup.eval(wi, wo);
                assert!(value.is_finite() && value >= 0.0, "{setup:?} {wi:?} {wo:?}: {value}");
                assert!(value == 0.0 || dot(setup.normal, wi) > 0.0);
            }
        }
    }
}

#[test]
fn every_family_but_the_windowed_cosine_is_reciprocal_where_no_clamp_acts() {
    let mut random = Random::new(2);
    for family in LobeFamily::ALL {
        let (mut compared, mut unequal) = (0, 0);
        while compared < 3000 {
            let setup = random_lobe(&mut random, family).setup();
            let (wi, wo) = (random.direction(), random.direction());
            // Below MIN_COS_VIEW the eye's cosine is clamped and the light's is not: exchanging the two
            // then changes the value of every model that divides by them.
            if dot(setup.normal, wi).min(dot(setup.normal, wo)) < MIN_COS_VIEW {
                continue;
            }
            compared += 1;
            if !close(brdf(&setup, wi, wo), brdf(&setup, wo, wi)) {
                unequal += 1;
            }
        }
        if family == LobeFamily::WindowedCosine {
            assert!(unequal > 1000, "the comparison must see that a window on the eye is not reciprocal");
        } else {
            assert_eq!(unequal, 0, "{family:?}");
        }
    }
    // What the clamp costs: half a degree above the horizon, exchanged directions differ.
    let setup = lobe(LobeFamily::Ggx, [0.3, 1.0, 0.0, 0.0]).setup();
    let (steep, grazing) = (direction_from_degrees(60.0, 0.0), direction_from_degrees(89.5, 180.0));
    assert!(!close(brdf(&setup, steep, grazing), brdf(&setup, grazing, steep)));
}

#[test]
fn turning_lobe_light_and_eye_together_changes_nothing() {
    let mut random = Random::new(3);
    for family in LobeFamily::ALL {
        let mut seen = 0;
        for _ in 0..2000 {
            let lobe = random_lobe(&mut random, family);
            let (wi, wo, angle) = (random.direction(), random.direction(), random.within(-3.0, 3.0));
            let turn = |x: f32, y: f32| {
                let [x, y, _] = rotate_z([x, y, 0.0], angle);
                [x, y]
            };
            let mut turned = lobe;
            turned.normal_xy = turn(lobe.normal_xy[0], lobe.normal_xy[1]);
            // The frame is the least rotation that brings z to the normal, so the tangent takes the turn.
            turned.tangent_rad += angle;
            if family == LobeFamily::WindowedCosine {
                [turned.params[1], turned.params[2]] = turn(lobe.params[1], lobe.params[2]);
            }
            let (here, there) =
                (lobe.setup().eval(wi, wo), turned.setup().eval(rotate_z(wi, angle), rotate_z(wo, angle)));
            assert!((here - there).abs() <= 3e-3 * here.max(there) + 1e-5, "{lobe:?}: {here} {there}");
            // Planted difference: a tangent left behind shows in the families that have one.
            turned.tangent_rad = lobe.tangent_rad;
            let left_behind = turned.setup().eval(rotate_z(wi, angle), rotate_z(wo, angle));
            seen += u32::from((here - left_behind).abs() > 3e-3 * here.max(left_behind) + 1e-5);
        }
        let has_tangent = [LobeFamily::Ward, LobeFamily::Lafortune, LobeFamily::AshikhminShirley];
        assert_eq!(seen > 100, has_tangent.contains(&family), "{family:?}: {seen}");
    }
}

#[test]
fn no_lobe_returns_more_light_than_its_definition_allows() {
    use LobeFamily::*;
    // With F0 = 1 or no Fresnel term at all; 0.2 % is the quadrature's error at roughness 0.05.
    const UNIT: f64 = 1.002;
    let check = |family: LobeFamily, params: [f32; 4], limit: f64| {
        let most = largest_albedo(&lobe(family, params).setup());
        assert!(most <= limit, "{family:?} {params:?}: {most} is above {limit}");
        most
    };
    for roughness in [0.05, 0.1, 0.25, 0.5, 1.0] {
        check(CookTorrance, [roughness, 1.0, 0.0, 0.0], UNIT);
        check(Ggx, [roughness, 1.0, 0.0, 0.0], UNIT);
        check(Ward, [roughness, roughness, 0.0, 0.0], UNIT);
        check(Ward, [roughness, 0.3, 0.0, 0.0], UNIT);
    }
    for exponent in [1.0, 10.0, 100.0, 1000.0] {
        check(AshikhminShirley, [exponent, exponent, 1.0, 0.0], UNIT);
        check(AshikhminShirley, [exponent, 10.0, 1.0, 0.0], UNIT);
        // The usual (s + 8) / 8 approximates the norm from above, by up to 7.5 % near s = 10.
        check(BlinnPhong, [exponent, 0.0, 0.0, 0.0], 1.08);
    }
    // The qualitative model overshoots a little at grazing angles for small sigma.
    for sigma in [0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0, 1.5] {
        check(OrenNayar, [sigma, 0.0, 0.0, 0.0], 1.02);
    }
    // Never above the cosine itself.
    check(Lambertian, [0.0; 4], UNIT);
    check(Lafortune, [-1.0, -1.0, 1.0, 0.5], UNIT);
    check(WindowedCosine, [0.0; 4], UNIT);

    // The norms are right, not merely small: a narrow peak sends everything back ...
    for (family, params) in [
        (Lambertian, [0.0; 4]),
        (BlinnPhong, [1000.0, 0.0, 0.0, 0.0]),
        (Ward, [0.05, 0.05, 0.0, 0.0]),
        (CookTorrance, [0.05, 1.0, 0.0, 0.0]),
        (AshikhminShirley, [1000.0, 1000.0, 1.0, 0.0]),
        (Ggx, [0.05, 1.0, 0.0, 0.0]),
    ] {
        let upright = albedo(&lobe(family, params).setup(), [0.0, 0.0, 1.0]);
        assert!((0.98..=1.01).contains(&upright), "{family:?}: {upright}");
    }
    // ... and the Schlick term scales it: planted, F0 = 0.5 must not pass for 1.
    let halved = albedo(&lobe(Ggx, [0.05, 0.5, 0.0, 0.0]).setup(), [0.0, 0.0, 1.0]);
    assert!((halved - 0.5).abs() < 0.02, "{halved}");
}

#[test]
fn a_lobe_falls_off_from_its_peak_and_narrows_as_it_sharpens() {
    use LobeFamily::*;
    let up = [0.0, 0.0, 1.0];
    let value = |setup: &LobeSetup, theta: f64| setup.eval(direction_from_degrees(theta, 20.0), up);
    // Up to rounding, which shows where the peak is flat, and to what is left where exp is clamped.
    let falls = |setup: &LobeSetup| {
        let at = |i: i32| value(setup, f64::from(i) * 0.1);
        (0..900).all(|i| at(i + 1) <= at(i) * (1.0 + 1e-5) + 1e-20)
    };
    for (family, blunt, sharp) in [
        (OrenNayar, [0.0; 4], [1.5, 0.0, 0.0, 0.0]),
        (BlinnPhong, [1.0, 0.0, 0.0, 0.0], [1000.0, 0.0, 0.0, 0.0]),
        (Ward, [1.0, 1.0, 0.0, 0.0], [0.05, 0.05, 0.0, 0.0]),
        // Beckmann's D peaks at the normal up to m = 1 / sqrt 2 only.
        (CookTorrance, [0.6, 1.0, 0.0, 0.0], [0.05, 1.0, 0.0, 0.0]),
        (Lafortune, [-1.0, -1.0, 1.0, 0.5], [-1.0, -1.0, 1.0, 500.0]),
        (AshikhminShirley, [1.0, 1.0, 1.0, 0.0], [1000.0, 1000.0, 1.0, 0.0]),
        (Ggx, [1.0, 1.0, 0.0, 0.0], [0.05, 1.0, 0.0, 0.0]),
        (WindowedCosine, [0.0; 4], [60.0, 0.0, 0.0, 0.0]),
    ] {
        let [blunt, sharp] = [blunt, sharp].map(|params| lobe(family, params).setup());
        assert!(falls(&blunt) && falls(&sharp), "{family:?}");
        if ![OrenNayar, WindowedCosine].contains(&family) {
            let rest = |setup: &LobeSetup| value(setup, 40.0) / value(setup, 0.0);
            assert!(rest(&sharp) < 0.2 * rest(&blunt), "{family:?}");
        }
    }
    // A window narrows in the eye's angle, not the light's.
    let window = lobe(WindowedCosine, [60.0, 0.0, 0.0, 0.0]).setup();
    assert!(window.eval(up, direction_from_degrees(30.0, 0.0)) < 0.01 * window.eval(up, up));
    // Planted difference: past the Beckmann bound the comparison sees the dip at the normal.
    assert!(!falls(&lobe(CookTorrance, [1.0, 1.0, 0.0, 0.0]).setup()));
}

#[test]
fn a_lobe_survives_its_file_words() {
    let mut random = Random::new(5);
    for family in LobeFamily::ALL {
        for _ in 0..500 {
            let lobe = random_lobe(&mut random, family);
            let (back, scale) = Lobe::from_words(lobe.to_words(0.375)).unwrap();
            assert_eq!((back, scale), (lobe, 0.375), "an already rounded lobe comes back bit by bit");
            assert_eq!(lobe.rounded(), lobe);
            let words = lobe.setup().to_resident_words(0.375);
            let (setup, scale) = (LobeSetup::from_resident_words(&words), weight_scale(&words));
            assert_eq!((setup, scale), (lobe.setup(), 0.375));
        }
        // Anything at all can be clamped into the file's ranges.
        for wild in [f32::NAN, f32::INFINITY, -1e30, 1e30, 7.0, -0.5] {
            let wild = Lobe { family, normal_xy: [wild, 0.4], tangent_rad: wild, params: [wild; 4] };
            let words = wild.clamped().to_words(1.0);
            assert!(Lobe::from_words(words).is_some(), "{wild:?} -> {:?}", wild.clamped());
        }
    }
    let turned = Lobe { tangent_rad: 1e5, ..lobe(LobeFamily::Ward, [0.1, 0.4, 0.0, 0.0]) };
    let (a, b) = (turned.setup(), turned.rounded().setup());
    assert!((0..3).all(|i| (a.tangent[i] - b.tangent[i]).abs() < 0.01), "full circles do not count: {a:?} {b:?}");
}

#[test]
fn every_lobe_word_out_of_its_range_is_refused() {
    for family in LobeFamily::ALL {
        let params = family.ranges().map(|(least, most)| 0.5 * (least + most));
        let good = Lobe { family, normal_xy: [0.1, -0.2], tangent_rad: 0.5, params };
        assert!(Lobe::from_words(good.to_words(1.0)).is_some(), "the control must pass");
        let refused = |bad: Lobe, scale: f32, what: &str| {
            assert!(Lobe::from_words(bad.to_words(scale)).is_none(), "{family:?}: {what} must be refused");
        };
        for (i, (least, most)) in family.ranges().into_iter().enumerate() {
            for value in [least - 0.01 - 0.01 * least.abs(), most + 0.01 + 0.01 * most.abs(), f32::NAN, f32::INFINITY] {
                let mut bad = good;
                bad.params[i] = value;
                refused(bad, 1.0, &format!("parameter {i} = {value}"));
            }
        }
        for xy in [[1.0, 0.0], [0.8, 0.8], [f32::NAN, 0.0], [0.0, f32::INFINITY]] {
            refused(Lobe { normal_xy: xy, ..good }, 1.0, "a normal at or below the horizon");
        }
        for tangent_rad in [f32::NAN, f32::INFINITY] {
            refused(Lobe { tangent_rad, ..good }, 1.0, "a tangent that is no angle");
        }
        for scale in [-1.0, f32::NAN, f32::INFINITY] {
            refused(good, scale, "a weight scale below 0 or not finite");
        }
        let mut words = good.to_words(1.0);
        words[4] |= 1 << 16;
        assert!(Lobe::from_words(words).is_none(), "the reserved half must be 0");
        let mut words = good.to_words(1.0);
        words[0] = words[0] & 0xffff_0000 | 9;
        assert!(Lobe::from_words(words).is_none(), "there are nine families");
    }
    let window = lobe(LobeFamily::WindowedCosine, [5.0, 0.9, 0.9, 0.0]);
    assert!(Lobe::from_words(window.to_words(1.0)).is_none(), "the window's axis must be above the horizon");
}

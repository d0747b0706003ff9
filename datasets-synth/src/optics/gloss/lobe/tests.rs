use super::*;
use crate::optics::gloss::params::{CUTICLE_INDEX, MIN_ROUGHNESS};
use crate::vector::dot;

fn direction(theta_deg: f64, phi_deg: f64) -> [f64; 3] {
    let (s, c) = theta_deg.to_radians().sin_cos();
    let (sp, cp) = phi_deg.to_radians().sin_cos();
    [s * cp, s * sp, c]
}

fn angles(wi: [f64; 3], wo: [f64; 3]) -> LobeAngles {
    let sum: [f64; 3] = std::array::from_fn(|k| wi[k] + wo[k]);
    let length = sum.iter().map(|c| c * c).sum::<f64>().sqrt();
    let o_dot_h: f64 = (0..3).map(|k| wo[k] * sum[k] / length).sum();
    LobeAngles { cos_i: wi[2] as f32, cos_o: wo[2] as f32, cos_h: (sum[2] / length) as f32, o_dot_h: o_dot_h as f32 }
}

fn pi_brdf_cos(lobe: &CookTorrance, wi: [f64; 3], wo: [f64; 3]) -> f64 {
    let angles = angles(wi, wo);
    f64::from(lobe.pi_brdf_cos(lobe.fresnel(angles.o_dot_h), angles))
}

/// Directional albedo at 0, 60, 80, 89 degrees of the corrected lobe of index 1.42, computed
/// independently of this code.
#[test]
fn directional_albedo_agrees_with_independent_figures() {
    const EXPECTED: [(f64, [f64; 4]); 5] = [
        (0.05, [0.030, 0.076, 0.359, 0.746]),
        (0.1, [0.030, 0.077, 0.306, 0.658]),
        (0.3, [0.030, 0.065, 0.197, 0.434]),
        (0.5, [0.028, 0.053, 0.152, 0.328]),
        (1.0, [0.014, 0.037, 0.102, 0.219]),
    ];
    for (roughness, row) in EXPECTED {
        let lobe = CookTorrance::new(1.42, roughness);
        for (theta, expected) in [0.0f64, 60.0, 80.0, 89.0].into_iter().zip(row) {
            let albedo = f64::from(lobe.albedo(theta.to_radians().cos() as f32));
            assert!((albedo - expected).abs() < 1e-2, "gamma {roughness} at {theta}: {albedo}");
            // Planted difference: the printed lobe, four times brighter.
            assert!((4.0 * albedo - expected).abs() > 1e-2);
        }
    }
}

#[test]
fn the_table_is_the_integral_of_the_lobe_itself() {
    // Plain midpoint rule over the outgoing hemisphere: another route than the table's.
    for roughness in [0.2, 0.5] {
        let lobe = CookTorrance::new(1.42, roughness);
        for theta in [10.0, 45.0, 70.0] {
            let (wi, steps) = (direction(theta, 0.0), 500);
            let mut sum = 0.0;
            for i in 0..steps {
                let cos_o: f64 = (f64::from(i) + 0.5) / f64::from(steps);
                let theta_o = cos_o.acos().to_degrees();
                for j in 0..steps {
                    let wo = direction(theta_o, 360.0 * (f64::from(j) + 0.5) / f64::from(steps));
                    sum += pi_brdf_cos(&lobe, wi, wo) / PI / wi[2] * wo[2];
                }
            }
            let integral = sum * 2.0 * PI / f64::from(steps * steps);
            let table = f64::from(lobe.albedo(wi[2] as f32));
            assert!((integral - table).abs() < 2e-3, "{roughness} {theta}: {integral} {table}");
        }
    }
}

#[test]
fn a_white_furnace_gains_nothing() {
    // Facets that reflect everything: an index so high that Fresnel is nearly 1.
    for roughness in [0.05, 0.1, 0.3, 0.5, 1.0] {
        for theta in [0.0, 30.0, 60.0, 80.0, 89.0, 89.9] {
            let albedo =
                GlossParams::isotropic(1e6, roughness).directional_albedo(f64::cos(f64::to_radians(theta)), 0.0);
            assert!(albedo <= 1.0 + 1e-3, "{roughness} {theta}: {albedo}");
        }
    }
}

#[test]
fn gloss_over_a_white_body_never_reflects_more_than_it_gets() {
    for roughness in [0.05, 0.3, 1.0] {
        let lobe = CookTorrance::new(1.42, roughness);
        for gloss in [0.0f32, 0.5, 1.0] {
            for theta in [0.0f64, 45.0, 75.0, 89.0, 89.9] {
                let cos_i = theta.to_radians().cos() as f32;
                let steps = 2000;
                let body: f32 = (0..steps)
                    .map(|i| (1.0 - (i as f32 + 0.5) / steps as f32).sqrt())
                    .map(|cos_o| lobe.coupling(gloss, lobe.albedo(cos_i), lobe.albedo(cos_o)))
                    .sum::<f32>()
                    / steps as f32;
                let total = body + gloss * lobe.albedo(cos_i);
                assert!((total - 1.0).abs() < 1e-3, "{roughness} {gloss} {theta}: {total}");
            }
        }
    }
}

#[test]
fn swapping_light_and_view_changes_nothing() {
    let lobe = CookTorrance::new(1.42, 0.3);
    for (a, b) in [((10.0, 0.0), (70.0, 200.0)), ((45.0, 20.0), (60.0, 190.0)), ((85.0, 0.0), (5.0, 90.0))] {
        let (a, b) = (direction(a.0, a.1), direction(b.0, b.1));
        let forward = pi_brdf_cos(&lobe, a, b) / a[2];
        let backward = pi_brdf_cos(&lobe, b, a) / b[2];
        assert!((forward - backward).abs() <= 1e-5 * forward.abs() + 1e-9, "{forward} {backward}");
    }
    let (i, o) = (0.2, 0.6);
    assert_eq!(lobe.coupling(0.7, i, o), lobe.coupling(0.7, o, i));
}

#[test]
fn the_lobe_is_finite_at_the_horizon_and_dark_below_it() {
    let lobe = CookTorrance::new(1.42, 1e-4);
    assert_eq!(lobe.roughness(), MIN_ROUGHNESS);
    for cos_i in [1e-6f32, 1e-3, 1.0] {
        for cos_o in [1e-6f32, 1e-3, 1.0] {
            for o_dot_h in [1e-6f32, 0.5, 1.0] {
                let value = lobe.pi_brdf_cos(1.0, LobeAngles { cos_i, cos_o, cos_h: 1.0, o_dot_h });
                assert!(value.is_finite() && value >= 0.0);
            }
        }
    }
    let below = LobeAngles { cos_i: -0.1, cos_o: 0.5, cos_h: 0.9, o_dot_h: 0.5 };
    assert_eq!(lobe.pi_brdf_cos(1.0, below), 0.0);
}

fn anisotropic(gamma_along: f64, gamma_across: f64) -> CookTorrance {
    CookTorrance::from_params(&GlossParams { gamma_along, gamma_across, ..GlossParams::default() })
}

fn form(form: GlossForm, gamma: f64) -> CookTorrance {
    CookTorrance::from_params(&GlossParams { form, ..GlossParams::isotropic(CUTICLE_INDEX, gamma) })
}

/// Components of the half vector along x and y, the vein running along x.
fn half_tangent(wi: [f64; 3], wo: [f64; 3]) -> [f32; 2] {
    let sum: [f64; 3] = std::array::from_fn(|k| wi[k] + wo[k]);
    let length = sum.iter().map(|c| c * c).sum::<f64>().sqrt();
    [(sum[0] / length) as f32, (sum[1] / length) as f32]
}

fn pi_brdf_cos_along(lobe: &CookTorrance, wi: [f64; 3], wo: [f64; 3]) -> f64 {
    let angles = angles(wi, wo);
    f64::from(lobe.pi_brdf_cos_along(lobe.fresnel(angles.o_dot_h), angles, half_tangent(wi, wo)))
}

/// Pairs of a light and a view all over the hemisphere.
fn pairs() -> Vec<([f64; 3], [f64; 3])> {
    let mut pairs = Vec::new();
    for (i, theta_i) in [0.0, 20.0, 45.0, 70.0, 85.0].into_iter().enumerate() {
        for (j, theta_o) in [3.0, 30.0, 50.0, 65.0, 80.0].into_iter().enumerate() {
            let turn = 37.0 * i as f64 + 61.0 * j as f64;
            pairs.push((direction(theta_i, turn), direction(theta_o, turn + 180.0 + 11.0 * j as f64)));
        }
    }
    pairs
}

#[test]
fn two_equal_roughnesses_are_one() {
    for gamma in [0.05, 0.3, 1.0] {
        let one = CookTorrance::new(1.42, gamma);
        let two = anisotropic(gamma, gamma);
        assert!(!two.is_anisotropic());
        for (wi, wo) in pairs() {
            let (a, b) = (pi_brdf_cos(&one, wi, wo), pi_brdf_cos_along(&two, wi, wo));
            // h's components are rounded to single precision, and the exponent magnifies that.
            assert!((a - b).abs() <= 1e-4 * a + 1e-6, "{gamma}: {a} {b}");
            let tangent = [wi[0] as f32, wi[1] as f32];
            assert_eq!(one.albedo(wi[2] as f32), two.albedo_along(wi[2] as f32, tangent));
        }
        assert_eq!(one.mean_albedo(), two.mean_albedo());
    }
}

#[test]
fn a_lobe_of_two_roughnesses_is_wide_where_the_facets_are_rough() {
    let lobe = anisotropic(0.1, 0.4);
    let mirror = |tilt: [f64; 2]| {
        // Light from above, facets tilted: the eye where they mirror it.
        let length = (1.0 + tilt[0] * tilt[0] + tilt[1] * tilt[1]).sqrt();
        let h = [tilt[0] / length, tilt[1] / length, 1.0 / length];
        let wo = std::array::from_fn(|k| 2.0 * h[2] * h[k] - if k == 2 { 1.0 } else { 0.0 });
        pi_brdf_cos_along(&lobe, [0.0, 0.0, 1.0], wo)
    };
    let (top, along, across) = (mirror([0.0, 0.0]), mirror([0.2, 0.0]), mirror([0.0, 0.2]));
    // exp(-(0.2/0.1)^2) against exp(-(0.2/0.4)^2); everything else is the same.
    let expected = (-4.0f64 + 0.25).exp();
    assert!((along / across / expected - 1.0).abs() < 1e-4, "{along} {across}");
    assert!(top > across && across > along);
    // Turning the leaf by a right angle swaps them.
    let turned = anisotropic(0.4, 0.1);
    let wo = direction(20.0, 0.0);
    let (a, b) = (pi_brdf_cos_along(&lobe, [0.0, 0.0, 1.0], wo), {
        pi_brdf_cos_along(&turned, [0.0, 0.0, 1.0], direction(20.0, 90.0))
    });
    assert!((a - b).abs() <= 1e-4 * a, "{a} {b}");
}

#[test]
fn swapping_light_and_view_changes_nothing_with_two_roughnesses() {
    let lobe = anisotropic(0.15, 0.5);
    let mut planted = 0f64;
    for (a, b) in pairs() {
        let forward = pi_brdf_cos_along(&lobe, a, b) / a[2];
        let backward = pi_brdf_cos_along(&lobe, b, a) / b[2];
        assert!((forward - backward).abs() <= 1e-4 * forward.abs() + 1e-6, "{forward} {backward}");
        // Planted difference: the cosine left in.
        planted = planted.max((forward * a[2] - backward * b[2]).abs());
    }
    assert!(planted > 1e-2);
}

#[test]
fn a_white_furnace_gains_nothing_with_two_roughnesses() {
    for (gamma_along, gamma_across) in [(0.05, 0.6), (0.6, 0.05), (0.2, 0.4), (1.0, 0.3)] {
        let white = GlossParams { gamma_along, gamma_across, ..GlossParams::isotropic(1e6, 0.3) };
        for theta in [0.0f64, 30.0, 60.0, 80.0, 89.0, 89.9] {
            for azimuth in [0.0f64, 30.0, 90.0] {
                let albedo = white.directional_albedo(theta.to_radians().cos(), azimuth.to_radians());
                assert!(albedo <= 1.0 + 1e-3, "{gamma_along} {gamma_across} {theta} {azimuth}: {albedo}");
                // Planted difference: the printed factor.
                let printed = GlossParams { form: GlossForm::Legacy4x, ..white };
                let four = printed.directional_albedo(theta.to_radians().cos(), azimuth.to_radians());
                assert!((four - 4.0 * albedo).abs() < 1e-12 && four > 1.0 + 1e-3);
            }
        }
    }
}

#[test]
fn the_table_along_the_vein_is_the_integral_of_the_lobe_itself() {
    let lobe = anisotropic(0.2, 0.5);
    let mut swapped = 0f64;
    for (theta, azimuth) in [(10.0, 20.0), (50.0, 0.0), (50.0, 90.0), (70.0, 35.0), (80.0, 90.0)] {
        let (wi, steps) = (direction(theta, azimuth), 400);
        let mut sum = 0.0;
        for i in 0..steps {
            let cos_o: f64 = (f64::from(i) + 0.5) / f64::from(steps);
            let theta_o = cos_o.acos().to_degrees();
            for j in 0..steps {
                let wo = direction(theta_o, 360.0 * (f64::from(j) + 0.5) / f64::from(steps));
                sum += pi_brdf_cos_along(&lobe, wi, wo) / PI / wi[2] * wo[2];
            }
        }
        let integral = sum * 2.0 * PI / f64::from(steps * steps);
        let table = |x: usize, y: usize| f64::from(lobe.albedo_along(wi[2] as f32, [wi[x] as f32, wi[y] as f32]));
        assert!((integral - table(0, 1)).abs() < 2e-3, "{theta} {azimuth}: {integral} {}", table(0, 1));
        // Planted difference: along and across swapped.
        swapped = swapped.max((integral - table(1, 0)).abs());
    }
    assert!(swapped > 1e-2, "{swapped}");
}

#[test]
fn the_tables_steps_are_fine_enough() {
    for (gamma_along, gamma_across, tolerance) in [(0.1, 0.4, 2e-3), (0.05, 0.6, 1e-2)] {
        let params = GlossParams { gamma_along, gamma_across, ..GlossParams::default() };
        let lobe = CookTorrance::from_params(&params);
        for i in 0..40 {
            let root = 0.02 + 0.98 * f64::from(i) / 39.0;
            let azimuth = f64::from(i * 7 % 40) / 39.0 * PI / 2.0;
            let (s, c) = azimuth.sin_cos();
            let table = f64::from(lobe.albedo_along((root * root) as f32, [c as f32, s as f32]));
            let expected = params.directional_albedo(root * root, azimuth);
            assert!((table - expected).abs() < tolerance, "{root} {azimuth}: {table} {expected}");
        }
    }
}

#[test]
fn gloss_of_two_roughnesses_over_a_white_body_reflects_what_it_gets() {
    let lobe = anisotropic(0.1, 0.5);
    let (steps, turns) = (500, 64);
    for gloss in [0.5f32, 1.0] {
        for (theta, azimuth) in [(0.0f64, 0.0f64), (75.0, 0.0), (75.0, 90.0), (89.0, 40.0)] {
            let (cos_i, azimuth) = (theta.to_radians().cos() as f32, azimuth.to_radians());
            let albedo_i = lobe.albedo_along(cos_i, [azimuth.cos() as f32, azimuth.sin() as f32]);
            let mut body = 0f64;
            for i in 0..steps {
                let cos_o = (1.0 - (i as f32 + 0.5) / steps as f32).sqrt();
                for j in 0..turns {
                    let (s, c) = (2.0 * PI * (f64::from(j) + 0.5) / f64::from(turns)).sin_cos();
                    let albedo_o = lobe.albedo_along(cos_o, [c as f32, s as f32]);
                    body += f64::from(lobe.coupling(gloss, albedo_i, albedo_o));
                }
            }
            let total = body / f64::from(steps * turns) + f64::from(gloss * albedo_i);
            assert!((total - 1.0).abs() < 1e-3, "{gloss} {theta} {azimuth}: {total}");
        }
    }
}

#[test]
fn without_coupling_the_gloss_is_added_on_top() {
    let params = GlossParams { coupling: GlossCoupling::None, ..GlossParams::default() };
    let lobe = CookTorrance::from_params(&params);
    assert_eq!(lobe.lets_in(1.0, 0.4), 1.0);
    assert_eq!(lobe.coupling(1.0, 0.4, 0.9), 1.0);
    // The albedo is still told, so that a report can say what is gained.
    assert!(lobe.albedo(0.02) > 0.4);
}

#[test]
fn the_legacy_lobe_is_four_times_the_corrected_one_to_the_bit() {
    for gamma in [0.05, 0.3, 1.0] {
        let (right, legacy) = (CookTorrance::new(CUTICLE_INDEX, gamma), form(GlossForm::Legacy4x, gamma));
        for (wi, wo) in pairs() {
            assert_eq!(pi_brdf_cos(&legacy, wi, wo), 4.0 * pi_brdf_cos(&right, wi, wo));
        }
        // What couples is the corrected albedo, so that the body below stays positive.
        assert_eq!(legacy.albedo(0.02), right.albedo(0.02));
        let cosine = 89.0f64.to_radians().cos();
        let albedo = |lobe: &CookTorrance| lobe.params().directional_albedo(cosine, 0.0);
        assert!((albedo(&legacy) - 4.0 * albedo(&right)).abs() < 1e-12);
    }
    // The figure that shows the slip: at 89 degrees the printed factor makes three lights of one.
    let legacy = GlossParams { form: GlossForm::Legacy4x, ..GlossParams::isotropic(CUTICLE_INDEX, 0.05) };
    let albedo = legacy.directional_albedo(89.0f64.to_radians().cos(), 0.0);
    assert!((albedo - 2.98).abs() < 0.02, "{albedo}");
}

#[test]
fn the_printed_lobe_is_eq_7_to_the_letter() {
    let lobe = form(GlossForm::Printed, 0.3);
    let mut unlike = 0f64;
    for (wi, wo) in pairs() {
        let angles = angles(wi, wo);
        // Every factor as it stands in the paper.
        let (ci, cv, ch) = (f64::from(angles.cos_i), f64::from(angles.cos_o), f64::from(angles.cos_h));
        let theta_h = ch.min(1.0).acos();
        let g = (CUTICLE_INDEX.powi(2) + ch * ch - 1.0).sqrt();
        let f = 0.5 * ((g - ch) / (g + ch)).powi(2) * (1.0 + ((ch * (g + ch) - 1.0) / (ch * (g - ch) + 1.0)).powi(2));
        let masking = 1f64.min(2.0 * ch * cv / theta_h).min(2.0 * ch * ci / theta_h);
        let d = (-(theta_h.tan() / 0.3).powi(2)).exp() / (0.3f64.powi(2) * ch.powi(4));
        let expected = f / PI * d * masking / (ci * cv) * PI * ci;
        let value = pi_brdf_cos(&lobe, wi, wo);
        assert!((value - expected).abs() <= 1e-4 * expected + 1e-6, "{value} {expected}");
        let legacy = pi_brdf_cos(&form(GlossForm::Legacy4x, 0.3), wi, wo);
        unlike = unlike.max((value - legacy).abs());
    }
    assert!(unlike > 1e-2, "{unlike}");
    // Fresnel at n.h loses the rise towards grazing.
    let at_80 = |form: GlossForm| {
        let params = GlossParams { form, ..GlossParams::isotropic(CUTICLE_INDEX, 0.1) };
        params.directional_albedo(80.0f64.to_radians().cos(), 0.0) / form.gain()
    };
    assert!(at_80(GlossForm::Printed) < 0.2 * at_80(GlossForm::Corrected), "{}", at_80(GlossForm::Printed));
}

#[test]
fn extremes_are_finite_in_every_form() {
    for form in GlossForm::ALL {
        for gammas in [[1e-4, 1e-4], [0.0, 0.5], [f64::NAN, 1.0], [1.0, 1.0]] {
            let params =
                GlossParams { gamma_along: gammas[0], gamma_across: gammas[1], form, ..GlossParams::default() };
            let lobe = CookTorrance::from_params(&params);
            assert!(lobe.params().gamma_along >= MIN_ROUGHNESS);
            for theta_i in [0.0f64, 45.0, 89.9, 90.0] {
                for theta_o in [0.0f64, 45.0, 89.9, 90.0] {
                    for phi in [0.0, 90.0, 180.0] {
                        let (wi, wo) = (direction(theta_i, 0.0), direction(theta_o, phi));
                        for value in [pi_brdf_cos(&lobe, wi, wo), pi_brdf_cos_along(&lobe, wi, wo)] {
                            assert!(value.is_finite() && value >= 0.0, "{params:?} {theta_i} {theta_o} {phi}");
                        }
                    }
                }
            }
            // Light and eye opposite: no half vector.
            let wi = direction(90.0, 30.0);
            assert_eq!(pi_brdf_cos(&lobe, wi, wi.map(|c| -c)), 0.0);
            assert_eq!(pi_brdf_cos_along(&lobe, wi, wi.map(|c| -c)), 0.0);
            let nan = LobeAngles { cos_i: 0.5, cos_o: 0.5, cos_h: f32::NAN, o_dot_h: f32::NAN };
            assert_eq!(lobe.pi_brdf_cos(1.0, nan), 0.0);
            let steep = LobeAngles { cos_i: 1e-20, cos_o: 1e-38, cos_h: 1e-3, o_dot_h: 2e-6 };
            for value in [lobe.pi_brdf_cos(1.0, steep), lobe.pi_brdf_cos_along(1.0, steep, [0.6, 0.8])] {
                assert!(value.is_finite());
            }
            assert_eq!(lobe.pi_brdf_cos_along(1.0, LobeAngles { cos_h: 0.9, ..nan }, [f32::NAN, 0.1]), 0.0);
        }
    }
}

#[test]
fn the_vein_frame_is_orthonormal_and_follows_the_vein() {
    for (normal, vein) in [
        ([0.0f32, 0.0, 1.0], [0.0f32, 2.0]),
        ([0.3, -0.4, 0.866_025_4], [1.0, 1.0]),
        ([-0.6, 0.0, 0.8], [-3.0, 0.5]),
        ([0.0, 0.8, 0.6], [0.0, 0.0]),
    ] {
        let [along, across] = vein_frame(normal, vein);
        for (a, b, expected) in [
            (along, along, 1.0),
            (across, across, 1.0),
            (along, across, 0.0),
            (along, normal, 0.0),
            (across, normal, 0.0),
        ] {
            assert!((dot(a, b) - expected).abs() < 1e-6, "{normal:?} {vein:?}");
        }
        // Seen from above, it is the vein's image.
        assert!((along[0] * vein[1] - along[1] * vein[0]).abs() < 1e-6);
        assert!(along[0] * vein[0] + along[1] * vein[1] >= 0.0);
    }
}

//! The leaf that renderers evaluate live against the leaf models of btf-synth: two programs that share no code.

use btf_runtime::testing::{BAND_SHARES, THREE_ROWS, rational_theta, three_piece_theta};
use btf_runtime::{LEAF_ROWS, Leaf, LeafMode, LeafState, LeafTexel, LeafTexture, ViewedLeaf, leaf_spectrum};
use btf_synth::{
    Abm97, CookTorrance, Face, GlossParams, LeafContents, LeafModel, LobeAngles, PROSPECT_CONE_DEG, PlateBody,
    PlateModel, RgbBands, SpecificAbsorption, ThetaForm, TwoHalves, mean_interface_transmittance, plate_spectrum,
    two_sided_spectrum, vein_frame,
};
use btf_tests::leaf::live::{
    back_colour, body_colours, contents_of, random_states, reference_colours, two_sided_reference,
};
use btf_tests::leaf::table::{CONTENTS, FACES, leaf_of, live_colours, table_of, traced_colours, with_contents};
use btf_tests::leaf::trade::{Spread, delta_e00_linear};

/// Returns the absorption of one unit of each content in the tables.
fn coefficients(table: SpecificAbsorption, nm: f64) -> [f64; 6] {
    let none = LeafContents {
        chlorophyll_ug_per_cm2: 0.0,
        carotenoid_ug_per_cm2: 0.0,
        water_cm: 0.0,
        dry_matter_g_per_cm2: 0.0,
        ..LeafContents::default()
    };
    [
        LeafContents { chlorophyll_ug_per_cm2: 1.0, ..none },
        LeafContents { carotenoid_ug_per_cm2: 1.0, ..none },
        LeafContents { anthocyanin_ug_per_cm2: 1.0, ..none },
        LeafContents { brown: 1.0, ..none },
        LeafContents { water_cm: 1.0, ..none },
        LeafContents { dry_matter_g_per_cm2: 1.0, ..none },
    ]
    .map(|contents| table.absorption(&contents, nm))
}

#[test]
fn both_programs_have_the_same_figures() {
    let apart = |x: f32, y: f64| (f64::from(x) - y).abs() > 1e-6 * y.abs() + 1e-9;
    for row in &LEAF_ROWS {
        let nm = f64::from(row.wavelength_nm);
        assert!(!apart(row.index, SpecificAbsorption::ProspectD.index(nm)), "{nm}");
        for (x, y) in row.absorption.iter().zip(coefficients(SpecificAbsorption::ProspectD, nm)) {
            assert!(!apart(*x, y), "{nm}: {x} {y}");
        }
    }
    for row in &THREE_ROWS {
        let nm = f64::from(row.wavelength_nm);
        assert!(!apart(row.index, SpecificAbsorption::Prospect5.index(nm)), "{nm}");
        let mut expected = coefficients(SpecificAbsorption::Prospect5, nm);
        expected[2] = coefficients(SpecificAbsorption::ProspectD, nm)[2];
        assert!(row.absorption.iter().zip(expected).all(|(x, y)| !apart(*x, y)), "{row:?} {expected:?}");
        // Planted: the other table.
        let other = coefficients(SpecificAbsorption::ProspectD, nm);
        assert!(row.absorption.iter().zip(other).any(|(x, y)| apart(*x, y)), "{nm}");
    }
}

#[test]
fn both_programs_have_the_same_forms_of_theta() {
    for i in 0..2000 {
        let k = i as f32 * 0.01;
        let near = |x: f32, form: ThetaForm| (f64::from(x) - form.at(f64::from(k))).abs() < 1e-6;
        assert!(near(rational_theta(k), ThetaForm::RationalP2Q3) && near(three_piece_theta(k), ThetaForm::ThreePiece));
    }
}

/// Largest difference of the spectra of a state's mode and of a model.
fn spectral_error(state: &LeafState, model: PlateModel, cone_deg: f64) -> f64 {
    let spectrum = leaf_spectrum(state);
    let nm: Vec<f64> = spectrum.iter().map(|row| f64::from(row.wavelength_nm)).collect();
    let expected = plate_spectrum(model, model.default_table(), &contents_of(state), cone_deg, &nm).unwrap();
    let apart = |x: f32, y: f64| (f64::from(x) - y).abs();
    spectrum
        .iter()
        .zip(&expected)
        .map(|(x, y)| apart(x.reflectance, y.reflectance).max(apart(x.transmittance, y.transmittance)))
        .fold(0.0, f64::max)
}

#[test]
fn spectra_of_every_mode_are_the_reference_models() {
    for state in random_states(5, 60) {
        let layers = LeafState { mode: LeafMode::NLayers, ..state };
        assert!(spectral_error(&layers, PlateModel::N, PROSPECT_CONE_DEG) < 2e-6, "{state:?}");
        let plain = LeafState { anthocyanin_ug_per_cm2: 0.0, ..state };
        let rational = LeafState { mode: LeafMode::Rational, ..plain };
        // The rational theta's error, up to three times in a plate.
        assert!(spectral_error(&rational, PlateModel::Exact, 0.0) < 2e-4, "{state:?}");
        let printed = LeafState { mode: LeafMode::ThreePiece, ..plain };
        assert!(spectral_error(&printed, PlateModel::Paper, 0.0) < 1e-6, "{state:?}");
        // Planted: another model.
        assert!(spectral_error(&rational, PlateModel::Paper, 0.0) > 1e-3, "{state:?}");
    }
}

#[test]
fn two_halves_have_the_colours_of_the_reference_from_both_faces() {
    let (mut worst, mut planted) = (0f64, 0f64);
    for state in random_states(17, 200) {
        let state = LeafState { mode: LeafMode::TwoSided, ..state };
        let [front, back, behind] = two_sided_reference(&state);
        let live = body_colours(&state, [1.0; 4]);
        let seen_back = back_colour(&state, [1.0; 4]);
        for (live, reference) in [(live[0], front), (seen_back, back), (live[1], behind)] {
            worst = worst.max(delta_e00_linear(live, reference));
        }
        // The spectrum that the panel draws is that of the upper face.
        let spectrum = leaf_spectrum(&state);
        let nm: Vec<f64> = spectrum.iter().map(|row| f64::from(row.wavelength_nm)).collect();
        let (halves, table) = (TwoHalves::default(), SpecificAbsorption::ProspectD);
        let expected =
            two_sided_spectrum(&halves, table, &contents_of(&state), PROSPECT_CONE_DEG, Face::Adaxial, &nm).unwrap();
        for (row, expected) in spectrum.iter().zip(expected) {
            assert!((f64::from(row.reflectance) - expected.reflectance).abs() < 2e-6, "{state:?}");
            assert!((f64::from(row.transmittance) - expected.transmittance).abs() < 2e-6, "{state:?}");
        }
        // Planted: a leaf whose faces are alike.
        let alike = LeafState { mode: LeafMode::NLayers, ..state };
        planted = planted.max(delta_e00_linear(back_colour(&alike, [1.0; 4]), back));
    }
    assert!(worst < 0.35 && planted > 3.0, "{worst} {planted}");
}

#[test]
fn a_table_has_the_light_of_its_algorithmic_model_from_both_faces() {
    let model = LeafModel::Abm97(Abm97::default());
    let table = table_of(&model, 20_000).unwrap();
    let (mut worst, mut planted) = (0f64, 0f64);
    for contents in [CONTENTS[0], CONTENTS[2]] {
        let leaf = leaf_of(&table, contents).unwrap();
        for face in FACES {
            let live = live_colours(&leaf, face, 45.0);
            let traced = traced_colours(&with_contents(&model, contents), face, 45.0, 100_000);
            // Planted: other contents.
            let other = traced_colours(&with_contents(&model, CONTENTS[1]), face, 45.0, 100_000);
            for side in 0..2 {
                worst = worst.max(delta_e00_linear(live[side], traced[side]));
                planted = planted.max(delta_e00_linear(live[side], other[side]));
            }
        }
    }
    assert!(worst < 2.0 && planted > 6.0, "{worst} {planted}");
}

#[test]
fn the_papers_table_1_comes_from_the_rational_mode() {
    // Reflectance and transmittance of red, green and blue from the contents of four samples [Miao, Table 1; contents
    // by least squares]: the exact plate with the paper's indices, of which the third digit at 675 nm is another.
    const SAMPLES: [([f32; 2], [[f64; 3]; 2]); 4] = [
        ([31.683, 10.573], [[0.0437, 0.1252, 0.0436], [0.0632, 0.2875, 0.0095]]),
        ([59.204, 7.284], [[0.0382, 0.0788, 0.0435], [0.0159, 0.1990, 0.0031]]),
        ([0.0, 9.081], [[0.3933, 0.3041, 0.0540], [0.6067, 0.5378, 0.0808]]),
        ([11.622, 3.167], [[0.0940, 0.2329, 0.0578], [0.2034, 0.4464, 0.0942]]),
    ];
    let worst = |mode: LeafMode| {
        let mut worst = 0f64;
        for ([chlorophyll, carotenoid], [reflectance, transmittance]) in SAMPLES {
            let values = [chlorophyll, carotenoid, 0.0, 0.0, 0.0, 0.0, 1.5, 1.42, 0.3, 0.3];
            for (band, row) in leaf_spectrum(&LeafState::from_values(mode, values)).iter().enumerate() {
                worst = worst
                    .max((f64::from(row.reflectance) - reflectance[band]).abs())
                    .max((f64::from(row.transmittance) - transmittance[band]).abs());
            }
        }
        worst
    };
    assert!(worst(LeafMode::Rational) < 1.2e-3, "{}", worst(LeafMode::Rational));
    // As printed it does not come out.
    assert!(worst(LeafMode::ThreePiece) > 0.15, "{}", worst(LeafMode::ThreePiece));
    // With the paper's own indices, exact theta and the interface of the reference the fourth digit does.
    let mut own = 0f64;
    for ([chlorophyll, carotenoid], [reflectance, transmittance]) in SAMPLES {
        for band in 0..3 {
            let [ab, r] = [[0.05914, 0.01221, 0.0716][band], [0.0, 0.0073, 0.1682][band]];
            let k = (ab * f64::from(chlorophyll) + r * f64::from(carotenoid)) / 1.5;
            let whole = btf_synth::plate(k, [1.4830, 1.4310, 1.5267][band], 0.0);
            own = own.max((whole.reflectance - reflectance[band]).abs());
            own = own.max((whole.transmittance - transmittance[band]).abs());
        }
    }
    assert!(own < 1.1e-4, "{own}");
}

#[test]
fn three_band_colours_are_the_references_under_any_textures() {
    let rational = PlateBody::new(PlateModel::Exact, SpecificAbsorption::Prospect5, RgbBands::ThreeWavelength)
        .unwrap()
        .with_theta(ThetaForm::RationalP2Q3);
    let printed = PlateBody::new(PlateModel::Paper, SpecificAbsorption::Prospect5, RgbBands::ThreeWavelength).unwrap();
    for (i, state) in random_states(9, 60).into_iter().enumerate() {
        let state = LeafState { anthocyanin_ug_per_cm2: 0.0, ..state };
        // What their codes hold exactly.
        let factors =
            [(0.5f32 * 254.0 / 127.0).powi(2), (100f32 / 127.0).powi(2), 1.0, [1.0, (139f32 / 127.0).powi(2)][i % 2]];
        let contents = contents_of(&state);
        let scaled = LeafContents {
            chlorophyll_ug_per_cm2: contents.chlorophyll_ug_per_cm2 * f64::from(factors[0]),
            carotenoid_ug_per_cm2: contents.carotenoid_ug_per_cm2 * f64::from(factors[1]),
            ..contents
        };
        for (mode, body) in [(LeafMode::Rational, &rational), (LeafMode::ThreePiece, &printed)] {
            let live = body_colours(&LeafState { mode, ..state }, factors);
            let expected = body.rgb(&scaled, f64::from(factors[3]));
            for channel in 0..3 {
                let (x, y) = (live[0][channel], f64::from(expected.reflectance[channel]));
                assert!((x - y).abs() < 1e-5, "{mode:?} {state:?}: {x} {y}");
                let (x, y) = (live[1][channel], f64::from(expected.transmittance[channel]));
                assert!((x - y).abs() < 1e-5, "{mode:?} {state:?}: {x} {y}");
            }
        }
    }
}

#[test]
fn twelve_bands_from_a_table_have_the_colour_of_the_spectrum() {
    let errors = |shift: f32| {
        Spread::of(random_states(21, 400).iter().flat_map(|state| {
            let state = LeafState { mode: LeafMode::NLayers, ..*state };
            let other = LeafState { chlorophyll_ug_per_cm2: state.chlorophyll_ug_per_cm2 * shift, ..state };
            let (live, reference) = (body_colours(&other, [1.0; 4]), reference_colours(&state));
            [0, 1].map(|side| delta_e00_linear(live[side], reference[side]))
        }))
    };
    let live = errors(1.0);
    assert!(live.mean < 0.05 && live.max < 0.4, "{live:?}");
    // Planted: a tenth more chlorophyll.
    let planted = errors(1.1);
    assert!(planted.mean > 5.0 * live.mean, "{planted:?}");
    assert_eq!(BAND_SHARES.len(), 12);
}

#[test]
fn gloss_and_its_coupling_are_the_references() {
    let unit = |theta_deg: f32, phi_deg: f32| {
        let ((s, c), (sp, cp)) = (theta_deg.to_radians().sin_cos(), phi_deg.to_radians().sin_cos());
        [s * cp, s * sp, c]
    };
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    for [along, across] in [[0.3, 0.3], [0.1, 0.1], [0.5, 0.15], [0.2, 0.6], [1.0, 1.0], [0.05, 0.05]] {
        let state =
            LeafState { gamma_along: along, gamma_across: across, mode: LeafMode::Rational, ..LeafState::default() };
        let veins = [-0.28f32, 0.96];
        // Equal: between unequal ones the live leaf is reciprocal, and the reference is not.
        let gloss = [204.0 / 255.0; 2];
        let texel = LeafTexel { gloss, veins, ..LeafTexel::default() };
        let leaf = Leaf::new(&state, &LeafTexture::uniform(texel)).unwrap();
        let params = GlossParams { gamma_along: along.into(), gamma_across: across.into(), ..GlossParams::default() };
        let lobe = CookTorrance::from_params(&params);
        let [reflected, transmitted] = body_colours(&state, [1.0; 4]);
        // Half the angle that the veins' bytes hold.
        let bytes = veins.map(|x| (x * 127.0).round() / 127.0);
        let angle = 0.5 * bytes[1].atan2(bytes[0]);
        let frame = vein_frame([0.0, 0.0, 1.0], [angle.cos(), angle.sin()]);
        let albedo = |w: [f32; 3]| lobe.albedo_along(w[2], frame.map(|axis| dot(axis, w)));
        for (light, eye) in [
            ((10.0, 30.0), (20.0, 200.0)),
            ((40.0, 100.0), (45.0, 275.0)),
            ((70.0, 10.0), (60.0, 190.0)),
            ((5.0, 0.0), (80.0, 50.0)),
        ] {
            let (wi, wo) = (unit(light.0, light.1), unit(eye.0, eye.1));
            for (side, gloss, far_gloss) in [(1.0, gloss[0], gloss[1]), (-1.0, gloss[1], gloss[0])] {
                let on_side = |w: [f32; 3], side: f32| [w[0], w[1], w[2] * side];
                let viewed = ViewedLeaf::new(leaf.words(), [0.5; 2], 0, [1.0; 4], on_side(wo, side));
                let sum = [0, 1, 2].map(|i| wi[i] + wo[i]);
                let half = sum.map(|c| c / dot(sum, sum).sqrt());
                let angles = LobeAngles { cos_i: wi[2], cos_o: wo[2], cos_h: half[2], o_dot_h: dot(wo, half) };
                let fresnel = lobe.fresnel(angles.o_dot_h);
                let shine = match along == across {
                    true => lobe.pi_brdf_cos(fresnel, angles),
                    false => lobe.pi_brdf_cos_along(fresnel, angles, frame.map(|axis| dot(axis, half))),
                };
                let out = lobe.coupling(gloss, 0.0, albedo(wo));
                let front = viewed.light(on_side(wi, side));
                let behind = viewed.light(on_side(wi, -side));
                for channel in 0..3 {
                    let body = reflected[channel] as f32 * out * lobe.lets_in(gloss, albedo(wi)) * wi[2];
                    let expected = body + gloss * shine;
                    let (x, y) = (front[channel], expected);
                    assert!(
                        (x - y).abs() < 2e-3 * y.abs() + 2e-4,
                        "{along} {across} {light:?} {eye:?} {side}: {x} {y}"
                    );
                    let through = transmitted[channel] as f32 * out * lobe.lets_in(far_gloss, albedo(wi)) * wi[2];
                    let (x, y) = (behind[channel], through);
                    assert!(
                        (x - y).abs() < 2e-3 * y.abs() + 2e-4,
                        "{along} {across} {light:?} {eye:?} {side}: {x} {y}"
                    );
                }
                // Planted: a tenth more roughness.
                if light.0 == 40.0 && along < 0.9 {
                    let rougher = CookTorrance::from_params(&GlossParams {
                        gamma_along: 1.1 * f64::from(along),
                        gamma_across: 1.1 * f64::from(across),
                        ..params
                    });
                    let other = rougher.pi_brdf_cos_along(fresnel, angles, frame.map(|axis| dot(axis, half)));
                    let other = if along == across { rougher.pi_brdf_cos(fresnel, angles) } else { other };
                    assert!((other - shine).abs() > 0.02 * shine, "{other} {shine}");
                }
            }
        }
    }
}

#[test]
fn interfaces_let_in_what_the_closed_form_says() {
    // A leaf so dark that its spectrum is the surface alone.
    let dark = LeafState { brown: 1e6, ..LeafState::default() };
    for row in leaf_spectrum(&dark) {
        let index = SpecificAbsorption::ProspectD.index(f64::from(row.wavelength_nm));
        let surface = 1.0 - mean_interface_transmittance(PROSPECT_CONE_DEG, index);
        assert!((f64::from(row.reflectance) - surface).abs() < 1e-6 && row.transmittance == 0.0, "{row:?} {surface}");
    }
}

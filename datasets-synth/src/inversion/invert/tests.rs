use super::*;
use crate::instruments::spectrophotometer::{Method, Rays, Spectrophotometer};
use crate::inversion::plates::{contents_of, values_of};
use crate::inversion::simulated::{any_contents, normal, simulated_spectra};
use crate::optics::abm::abm_b::AbmB;
use crate::optics::abm::abm97::Abm97;
use crate::optics::plates::two_halves::{TwoHalves, two_sided_spectrum};
use crate::optics::specific_absorption::SpecificAbsorption;
use btf_models::LeafContents;
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use std::ops::ControlFlow;

fn evenly(first: f64, last: f64, step: f64) -> Vec<f64> {
    (0..=((last - first) / step).round() as usize).map(|i| first + step * i as f64).collect()
}

/// Returns the spectra of `contents` with normal noise of standard deviation `noise`.
fn spectra(contents: &LeafContents, nm: &[f64], noise: f64, random: &mut Xoshiro256PlusPlus) -> LeafSpectra {
    simulated_spectra(contents, nm, noise, random).unwrap()
}

#[test]
fn spectra_without_noise_give_the_contents_back() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    let nm = evenly(400.0, 2500.0, 10.0);
    let inverter = Inverter::new(&InversionParams::default(), &nm).unwrap();
    for _ in 0..60 {
        let leaf = any_contents(&mut random);
        let found = inverter.invert(&spectra(&leaf, &nm, 0.0, &mut random));
        for (i, unknown) in inverter.unknowns().iter().enumerate() {
            let apart = (found.values[i] - values_of(&leaf)[i]).abs() / unknown.span();
            assert!(apart < 1e-4, "{}: {} of {leaf:?}", unknown.name, found.values[i]);
        }
        assert!(found.rmse.iter().flatten().all(|rmse| *rmse < 1e-4), "{found:?}");
    }
}

#[test]
fn with_noise_of_a_hundredth_chlorophyll_is_told_within_2_and_standard_errors_are_honest() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(2);
    // A band in 25 nm leaves four on the red edge.
    for (nm, most) in
        [(evenly(400.0, 2500.0, 10.0), 2.0), (evenly(400.0, 800.0, 5.0), 2.0), (evenly(400.0, 2500.0, 25.0), 3.0)]
    {
        let inverter = Inverter::new(&InversionParams::default(), &nm).unwrap();
        let (mut squares, mut within, mut told, count) = (0.0, 0.0, 0.0, 120);
        for _ in 0..count {
            let leaf = any_contents(&mut random);
            let found = inverter.invert(&spectra(&leaf, &nm, 0.01, &mut random));
            squares += (found.values[0] - leaf.chlorophyll_ug_per_cm2).powi(2);
            // Noise is noise: no content is told by its own wavelengths alone.
            assert!(!found.states.contains(&State::FoundByDomain), "{found:?}");
            for i in (0..MAX_UNKNOWNS).filter(|i| found.states[*i] == State::Found) {
                told += 1.0;
                let apart = (found.values[i] - values_of(&leaf)[i]).abs();
                within += f64::from(u8::from(apart < 2.0 * found.standard_errors[i]));
            }
        }
        let rms = f64::sqrt(squares / f64::from(count));
        assert!(rms < most, "{} wavelengths: {rms}", nm.len());
        let share = within / told;
        assert!((0.88..0.99).contains(&share), "{} wavelengths: {share}", nm.len());
    }
}

#[test]
fn what_the_wavelengths_do_not_tell_stays_and_is_named() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(3);
    let nm = evenly(400.0, 780.0, 10.0);
    let inverter = Inverter::new(&InversionParams::default(), &nm).unwrap();
    let leaf = LeafContents { water_cm: 0.03, ..LeafContents::default() };
    let found = inverter.invert(&spectra(&leaf, &nm, 0.002, &mut random));
    assert_eq!((found.states[4], found.values[4]), (State::Untold, inverter.unknowns()[4].start));
    assert!(found.standard_errors[4].is_nan());
    assert!(found.remarks.iter().any(|remark| remark.contains("water cannot be told between 400 and 780 nm")));
    // In the near infrared it is told.
    let nm = evenly(400.0, 1600.0, 10.0);
    let inverter = Inverter::new(&InversionParams::default(), &nm).unwrap();
    let found = inverter.invert(&spectra(&leaf, &nm, 0.002, &mut random));
    assert!((found.values[4] - 0.03).abs() < 0.002 && found.states[4] == State::Found, "{found:?}");
}

#[test]
fn a_sensor_of_a_few_bands_is_not_believed_more_than_it_tells() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(8);
    let nm = [490.0, 560.0, 665.0, 705.0, 740.0, 783.0];
    let inverter = Inverter::new(&InversionParams::default(), &nm).unwrap();
    let (mut within, mut told) = (0.0, 0.0);
    for _ in 0..60 {
        let leaf = any_contents(&mut random);
        let found = inverter.invert(&spectra(&leaf, &nm, 0.005, &mut random));
        for i in (0..MAX_UNKNOWNS).filter(|i| found.states[*i] == State::Found) {
            told += 1.0;
            within +=
                f64::from(u8::from((found.values[i] - values_of(&leaf)[i]).abs() < 2.0 * found.standard_errors[i]));
        }
    }
    assert!(within / told > 0.85, "{}", within / told);
}

#[test]
fn reflectance_alone_tells_chlorophyll_and_less_than_both() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(4);
    let nm = evenly(400.0, 2500.0, 10.0);
    let inverter = Inverter::new(&InversionParams::default(), &nm).unwrap();
    let leaf = LeafContents::default();
    let both = spectra(&leaf, &nm, 0.002, &mut random);
    let alone = LeafSpectra::new("leaf", &nm, &both.shares[0], &[]).unwrap();
    let (both, alone) = (inverter.invert(&both), inverter.invert(&alone));
    assert!((alone.values[0] - 40.0).abs() < 4.0 && alone.rmse[1].is_none(), "{alone:?}");
    assert!(alone.standard_errors[6] > 2.0 * both.standard_errors[6], "{alone:?} {both:?}");
}

#[test]
fn a_model_that_errs_smoothly_is_noticed_and_its_standard_errors_grow() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(5);
    let nm = evenly(400.0, 2400.0, 5.0);
    let leaf = LeafContents::default();
    let mut bent = spectra(&leaf, &nm, 0.001, &mut random);
    for (share, nm) in bent.shares[0].iter_mut().zip(&nm) {
        *share += 0.01 * (nm / 90.0).sin();
    }
    let independent = InversionParams { correlated: false, ..InversionParams::default() };
    let [honest, naive] =
        [InversionParams::default(), independent].map(|params| Inverter::new(&params, &nm).unwrap().invert(&bent));
    for i in [4, 5] {
        assert!(honest.standard_errors[i] > 2.0 * naive.standard_errors[i], "{honest:?} {naive:?}");
    }
    assert!((honest.values[0] - 40.0).abs() < 4.0 * honest.standard_errors[0].max(0.5), "{honest:?}");
    // Contents are told by their own wavelengths, which the bend hardly changes.
    assert_eq!([0, 4, 5].map(|i| honest.states[i]), [State::FoundByDomain; 3]);
    assert!(honest.correlations[0][6] == 0.0 && honest.correlations[4][5].abs() > 0.1, "{honest:?}");
    assert!(naive.states.iter().all(|state| *state != State::FoundByDomain));
    // Of reflectance alone, too, with N as all wavelengths tell it.
    let alone = LeafSpectra::new("leaf", &nm, &bent.shares[0], &[]).unwrap();
    let alone = Inverter::new(&InversionParams::default(), &nm).unwrap().invert(&alone);
    assert!((alone.values[0] - 40.0).abs() < 8.0 && alone.states[0] == State::FoundByDomain, "{alone:?}");
}

#[test]
fn what_is_held_stays_and_what_cannot_be_held_is_refused() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(6);
    let nm = evenly(400.0, 1000.0, 10.0);
    let leaf = LeafContents { brown: 0.2, ..LeafContents::default() };
    let mut params = InversionParams::default();
    params.held[3] = Some(0.2);
    let inverter = Inverter::new(&params, &nm).unwrap();
    let found = inverter.invert(&spectra(&leaf, &nm, 0.002, &mut random));
    assert_eq!((found.values[3], found.states[3]), (0.2, State::Held));
    assert!((found.values[0] - 40.0).abs() < 1.0, "{found:?}");
    assert_eq!(contents_of(&found.values).brown, 0.2);
    params.held[3] = Some(-1.0);
    let refused = Inverter::new(&params, &nm).err().unwrap().to_string();
    assert!(refused.contains("brown") && refused.contains("-1"), "{refused}");
    assert!(Inverter::new(&InversionParams::default(), &[300.0, 350.0]).is_err());
    let exact = InversionParams { model: LeafModel::Plate(PlateModel::Exact), ..InversionParams::default() };
    assert!(Inverter::new(&exact, &nm).err().unwrap().to_string().contains("plate-exact"));
}

#[test]
fn gaps_and_wavelengths_outside_of_the_tables_are_passed_over() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(7);
    let inner = evenly(400.0, 2500.0, 10.0);
    let leaf = spectra(&LeafContents::default(), &inner, 0.001, &mut random);
    let mut nm = vec![350.0];
    nm.extend(&inner);
    nm.push(2600.0);
    let [r, t, ..] = leaf.shares.clone();
    let mut shares = [r, t].map(|inner| [vec![0.9], inner, vec![0.9]].concat());
    shares[0][20..40].fill(f64::NAN);
    let gappy = LeafSpectra::new("leaf", &nm, &shares[0], &shares[1]).unwrap();
    let inverter = Inverter::new(&InversionParams::default(), &nm).unwrap();
    let found = inverter.invert(&gappy);
    assert!((found.values[0] - 40.0).abs() < 1.0, "{found:?}");
    let fitted = inverter.spectra_of(&found.values);
    assert!(fitted[0][0].is_nan() && fitted[0][21].is_finite() && fitted[0].last().unwrap().is_nan());
}

#[test]
fn an_algorithmic_models_own_pigments_are_found_from_either_face() {
    let nm = evenly(420.0, 780.0, 20.0);
    let go_on = |_: usize, _: usize| ControlFlow::Continue(());
    for face in [Face::Adaxial, Face::Abaxial] {
        for model in [LeafModel::Abm97(Abm97::default()), LeafModel::AbmB(AbmB::default())] {
            let own = match &model {
                LeafModel::Abm97(leaf) => leaf.chlorophyll.0,
                LeafModel::AbmB(leaf) => leaf.specimen.chlorophyll_per_area().0,
                _ => unreachable!(),
            };
            let instrument = Spectrophotometer { face, ..Spectrophotometer::parallel() };
            let tissue = model.tissue().unwrap();
            let measured =
                instrument.measure(tissue, &nm, Rays::Count(100_000), Method::PathLengths, 9, &go_on).unwrap();
            let shares = [&measured.reflectance, &measured.transmittance]
                .map(|shares| shares.iter().map(|estimate| estimate.mean).collect::<Vec<f64>>());
            let of = |face: Face| match face {
                Face::Adaxial => LeafSpectra::new("leaf", &nm, &shares[0], &shares[1]).unwrap(),
                Face::Abaxial => LeafSpectra::of_faces("leaf", &nm, [&[], &[], &shares[0], &shares[1]]).unwrap(),
            };
            let params =
                InversionParams { model, faces: [true; 2], rays: 100_000, seed: 3, ..InversionParams::default() };
            let inverter = Inverter::new(&params, &nm).unwrap();
            let found = inverter.invert(&of(face));
            assert!(
                (found.values[0] / own - 1.0).abs() < 0.06,
                "{} {face:?}: {} of {own}",
                model.name(),
                found.values[0]
            );
            // Planted difference: the other face is another leaf.
            let other = if face == Face::Adaxial { Face::Abaxial } else { Face::Adaxial };
            let turned = inverter.invert(&of(other));
            let rmse = |found: &Inversion| found.rmse.into_iter().flatten().next().unwrap();
            assert!(rmse(&turned) > 4.0 * rmse(&found), "{turned:?}");
        }
    }
}

/// Returns a leaf of two halves with noise of standard deviation `noise`, from the faces that are wanted.
fn faces_of(
    halves: &TwoHalves,
    contents: &LeafContents,
    nm: &[f64],
    noise: f64,
    random: &mut Xoshiro256PlusPlus,
) -> LeafSpectra {
    let mut shares: [Vec<f64>; SHARES] = Default::default();
    for (place, face) in FACES.into_iter().enumerate() {
        let table = SpecificAbsorption::ProspectD;
        for optics in two_sided_spectrum(halves, table, contents, PROSPECT_CONE_DEG, face, nm).unwrap() {
            shares[2 * place].push(optics.reflectance + noise * normal(random));
            shares[2 * place + 1].push(optics.transmittance + noise * normal(random));
        }
    }
    LeafSpectra::of_faces("leaf", nm, shares.each_ref().map(Vec::as_slice)).unwrap()
}

#[test]
fn both_faces_tell_how_contents_divide_between_the_halves() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(10);
    let nm = evenly(400.0, 2500.0, 10.0);
    let params = InversionParams { model: LeafModel::TwoSided(TwoHalves::default()), ..InversionParams::default() };
    let inverter = Inverter::new(&params, &nm).unwrap();
    let plain = Inverter::new(&InversionParams::default(), &nm).unwrap();
    let (mut squares, mut by_plates, mut layers, count) = (0.0, 0.0, 0.0, 40);
    for _ in 0..count {
        let leaf = LeafContents { structure: 1.6, ..any_contents(&mut random) };
        let halves = TwoHalves { layers: 0.7, pigments: 0.85, body: 0.7 };
        let exact = inverter.invert(&faces_of(&halves, &leaf, &nm, 0.0, &mut random));
        assert!(exact.rmse.iter().flatten().all(|rmse| *rmse < 2e-3), "{leaf:?} {exact:?}");
        let noisy = faces_of(&halves, &leaf, &nm, 0.01, &mut random);
        let (found, plates) = (inverter.invert(&noisy), plain.invert(&noisy));
        squares += (found.values[0] - leaf.chlorophyll_ug_per_cm2).powi(2);
        by_plates += (plates.values[0] - leaf.chlorophyll_ug_per_cm2).powi(2);
        layers += (found.values[7] - halves.layers).powi(2);
        // The planted difference: one pile cannot be both faces.
        assert!(plates.rmse[2] > found.rmse[2], "{plates:?}");
    }
    let [rms, plates, layers] = [squares, by_plates, layers].map(|x| f64::sqrt(x / f64::from(count)));
    assert!(rms < 2.5 && plates > rms && layers < 0.1, "{rms} {plates} {layers}");
}

#[test]
fn one_face_leaves_the_halves_as_they_are_and_says_so() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(11);
    let nm = evenly(400.0, 2500.0, 10.0);
    let params = InversionParams { model: LeafModel::TwoSided(TwoHalves::default()), ..InversionParams::default() };
    let inverter = Inverter::new(&params, &nm).unwrap();
    let leaf = LeafContents { anthocyanin_ug_per_cm2: 1.0, brown: 0.05, ..LeafContents::default() };
    let both = faces_of(&TwoHalves::default(), &leaf, &nm, 0.001, &mut random);
    let [r, t, back_r, back_t] = &both.shares;
    for shares in [[&r[..], &t[..], &[], &[]], [&[], &[], &back_r[..], &back_t[..]]] {
        let found = inverter.invert(&LeafSpectra::of_faces("leaf", &nm, shares).unwrap());
        assert!((found.values[0] - 40.0).abs() < 1.0, "{found:?}");
        assert_eq!((found.states[7], found.values[7..].to_vec()), (State::Untold, vec![0.9, 0.99, 0.95]));
        let remarks = found.remarks.iter().filter(|remark| remark.contains("both faces")).count();
        assert_eq!((remarks, found.remarks.len()), (1, 1), "{:?}", found.remarks);
    }
}

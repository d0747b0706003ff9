//! Gloss, two-sided diffuse and Fresnel are what Mitsuba 3 says, an implementation that shares nothing with ours.
//!
//! `cargo xtask test` installs it under the target folder; `BTF_PEERS_PYTHON` names another interpreter that has it. Where
//! there is none these tests are skipped, and counted as such.

use btf_synth::{
    CookTorrance, GlossForm, GlossParams, LobeAngles, fresnel_between, plate, refract_cos, two_sided_diffuse,
};
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const INDEX: f64 = 1.42;

/// The interpreter that has Mitsuba, or `None` with a line for the skip count.
pub fn interpreter() -> Option<PathBuf> {
    if std::env::var_os("BTF_SKIP_PEERS").is_some_and(|value| value == "1") {
        btf_tests::skip("Mitsuba comparison (BTF_SKIP_PEERS=1)");
        return None;
    }
    if let Some(named) = std::env::var_os("BTF_PEERS_PYTHON") {
        return Some(PathBuf::from(named));
    }
    let program = if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" };
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("the target folder holds its tmp");
    let folder = target.join("peers/mitsuba");
    // The stamp is written last: without it the environment is half made, with other contents it is an old one.
    let wanted = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/requirements.txt"));
    let present = std::fs::read_to_string(folder.join("requirements-installed.txt"));
    if matches!((wanted, present), (Ok(wanted), Ok(present)) if wanted == present) {
        return Some(folder.join(program));
    }
    btf_tests::absent("Mitsuba is not in target/peers (`cargo xtask test` installs it, or set BTF_PEERS_PYTHON)");
    None
}

/// Returns Mitsuba's answers to `queries`, or `None` where Mitsuba is not there.
fn ask(queries: &Value) -> Option<Value> {
    ask_script("mitsuba_oracle.py", queries)
}

/// Returns the answers of a script in `peers` to `queries`, or `None` where Mitsuba is not there.
pub fn ask_script(script: &str, queries: &Value) -> Option<Value> {
    let python = interpreter()?;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers").join(script);
    let mut child = Command::new(&python)
        .arg(script)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap_or_else(|error| panic!("{} does not start: {error}", python.display()));
    // Dropped at the end of the statement, which ends the script's input.
    child.stdin.take().unwrap().write_all(queries.to_string().as_bytes()).expect("the queries are written");
    let output = child.wait_with_output().expect("the answers are read");
    assert!(output.status.success(), "the Mitsuba script failed: {}", output.status);
    Some(serde_json::from_slice(&output.stdout).expect("the answers are JSON"))
}

/// Returns the numbers under `name`.
fn numbers(answers: &Value, name: &str) -> Vec<f64> {
    answers[name].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
}

fn direction(theta_deg: f64, phi_deg: f64) -> [f64; 3] {
    let (s, c) = theta_deg.to_radians().sin_cos();
    let (sp, cp) = phi_deg.to_radians().sin_cos();
    [s * cp, s * sp, c]
}

/// A light and an eye in front of a gloss.
#[derive(Clone, Copy)]
struct Pair {
    light: [f64; 3],
    eye: [f64; 3],
}

/// All pairs of these polar angles under several azimuths between and around them.
fn pairs(thetas_deg: &[f64]) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for &theta_i in thetas_deg {
        for &theta_o in thetas_deg {
            for (turn, between) in [(0.0, 180.0), (25.0, 180.0), (70.0, 150.0), (130.0, 90.0), (10.0, 0.0)] {
                pairs.push(Pair { light: direction(theta_i, turn), eye: direction(theta_o, turn + between) });
            }
        }
    }
    pairs
}

/// Our lobe's BRDF times cosine at the light, the vein running along x.
fn ours(lobe: &CookTorrance, pair: Pair) -> f64 {
    let sum: [f64; 3] = std::array::from_fn(|k| pair.light[k] + pair.eye[k]);
    let length = sum.iter().map(|c| c * c).sum::<f64>().sqrt();
    let half = sum.map(|c| c / length);
    let o_dot_h: f64 = (0..3).map(|k| pair.eye[k] * half[k]).sum();
    let angles = LobeAngles {
        cos_i: pair.light[2] as f32,
        cos_o: pair.eye[2] as f32,
        cos_h: half[2] as f32,
        o_dot_h: o_dot_h as f32,
    };
    let fresnel = lobe.fresnel(angles.o_dot_h);
    let sample = match lobe.is_anisotropic() {
        true => lobe.pi_brdf_cos_along(fresnel, angles, [half[0] as f32, half[1] as f32]),
        false => lobe.pi_brdf_cos(fresnel, angles),
    };
    f64::from(sample) / std::f64::consts::PI
}

/// Our lobe over Mitsuba's for every pair where there is any light; `None` without Mitsuba.
fn ratios(params: &GlossParams, pairs: &[Pair]) -> Option<Vec<(Pair, f64)>> {
    let query = |pair: &Pair| {
        json!({"index": params.index, "gamma_along": params.gamma_along, "gamma_across": params.gamma_across,
            "light": pair.light, "eye": pair.eye})
    };
    let answers = ask(&json!({"roughdielectric": pairs.iter().map(query).collect::<Vec<_>>()}))?;
    let theirs = numbers(&answers, "roughdielectric");
    assert_eq!(theirs.len(), pairs.len());
    let lobe = CookTorrance::from_params(params);
    let seen = pairs.iter().zip(theirs).filter(|(_, theirs)| *theirs > 1e-9);
    Some(seen.map(|(pair, theirs)| (*pair, ours(&lobe, *pair) / theirs)).collect())
}

/// Smallest and largest.
fn range(ratios: &[(Pair, f64)]) -> (f64, f64) {
    ratios.iter().fold((f64::MAX, f64::MIN), |(low, high), (_, ratio)| (low.min(*ratio), high.max(*ratio)))
}

fn is_one(ratios: &[(Pair, f64)]) -> bool {
    let (low, high) = range(ratios);
    low > 1.0 - 1e-3 && high < 1.0 + 1e-3
}

#[test]
fn gloss_within_45_degrees_is_mitsuba_s_rough_dielectric() {
    let pairs = pairs(&[0.0, 10.0, 20.0, 35.0, 45.0]);
    for (gamma_along, gamma_across) in [(0.05, 0.05), (0.1, 0.1), (0.3, 0.3), (0.5, 0.5), (0.15, 0.4), (0.5, 0.1)] {
        let params = GlossParams { gamma_along, gamma_across, ..GlossParams::isotropic(INDEX, 0.3) };
        let Some(right) = ratios(&params, &pairs) else { return };
        assert!(right.len() >= 20, "only {} pairs see the lobe", right.len());
        let (low, high) = range(&right);
        println!(
            "gamma {gamma_along}, {gamma_across}: ours / Mitsuba {low:.6} to {high:.6} over {} pairs",
            right.len()
        );
        assert!(is_one(&right), "{gamma_along} {gamma_across}: {low} to {high}");
    }
}

#[test]
fn the_printed_factor_and_swapped_vein_directions_are_told_from_mitsuba() {
    let pairs = pairs(&[0.0, 20.0, 45.0]);
    let legacy = GlossParams { form: GlossForm::Legacy4x, ..GlossParams::isotropic(INDEX, 0.3) };
    let Some(four) = ratios(&legacy, &pairs) else { return };
    assert!(!is_one(&four));
    let (low, high) = range(&four);
    println!("legacy-4x: ours / Mitsuba {low:.6} to {high:.6}");
    assert!(low > 3.996 && high < 4.004, "{low} to {high}");

    let printed = GlossParams { form: GlossForm::Printed, ..legacy };
    assert!(!is_one(&ratios(&printed, &pairs).unwrap()));

    // Ask for one order of the roughnesses, compare with the other.
    let asked = GlossParams { gamma_along: 0.15, gamma_across: 0.4, ..GlossParams::isotropic(INDEX, 0.3) };
    let turned: Vec<Pair> = pairs
        .iter()
        .map(|pair| {
            let turn = |[x, y, z]: [f64; 3]| [-y, x, z];
            Pair { light: turn(pair.light), eye: turn(pair.eye) }
        })
        .collect();
    let lobe = CookTorrance::from_params(&asked);
    let exchanged = CookTorrance::from_params(&GlossParams { gamma_along: 0.4, gamma_across: 0.15, ..asked });
    let right = ratios(&asked, &pairs).unwrap();
    assert!(is_one(&right));
    // The leaf turned by a right angle is the same; the leaf turned without its veins is not.
    let unlike = pairs.iter().zip(&turned).map(|(pair, turned)| {
        let own = ours(&lobe, *pair);
        ((ours(&exchanged, *turned) / own - 1.0).abs(), (ours(&exchanged, *pair) / own - 1.0).abs())
    });
    let (same, other) = unlike.fold((0f64, 0f64), |worst, next| (worst.0.max(next.0), worst.1.max(next.1)));
    assert!(same < 1e-3 && other > 0.5, "{same} {other}");
}

/// Returns Smith's shadowing of a direction on Beckmann facets with the roughnesses `[along, across]` the vein, in the
/// rational form of [Walter 2007, eq. 27] with the slope's deviation towards the direction [Heitz 2014, eq. 80].
fn smith([x, y, z]: [f64; 3], [along, across]: [f64; 2]) -> f64 {
    let a = z / (along * x).hypot(across * y);
    if a >= 1.6 { 1.0 } else { (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a) }
}

#[test]
fn beyond_45_degrees_gloss_differs_from_mitsuba_by_its_masking_alone() {
    let mut largest = 0f64;
    let pairs = pairs(&[45.0, 60.0, 75.0, 85.0, 88.0]);
    for roughness in [[0.1, 0.1], [0.3, 0.3], [0.5, 0.5], [0.15, 0.4], [0.5, 0.1]] {
        let [gamma_along, gamma_across] = roughness;
        let params = GlossParams { gamma_along, gamma_across, ..GlossParams::isotropic(INDEX, 0.3) };
        let Some(ratios) = ratios(&params, &pairs) else { return };
        assert!(ratios.len() >= 30, "only {} pairs see the lobe", ratios.len());
        let mut exchanged = 0f64;
        for (pair, ratio) in ratios {
            let sum: [f64; 3] = std::array::from_fn(|k| pair.light[k] + pair.eye[k]);
            let length = sum.iter().map(|c| c * c).sum::<f64>().sqrt();
            let (cos_h, o_dot_h) = (sum[2] / length, 0.5 * length);
            let cavities = 1f64.min(2.0 * cos_h * pair.light[2].min(pair.eye[2]) / o_dot_h);
            let expected = |roughness| cavities / (smith(pair.light, roughness) * smith(pair.eye, roughness));
            assert!(
                (ratio / expected(roughness) - 1.0).abs() < 1e-3,
                "{roughness:?} {:?} {:?}: {ratio} {}",
                pair.light,
                pair.eye,
                expected(roughness)
            );
            largest = largest.max((ratio - 1.0).abs());
            exchanged = exchanged.max((ratio / expected([gamma_across, gamma_along]) - 1.0).abs());
            if pair.light == direction(75.0, 0.0) && pair.eye == direction(75.0, 180.0) {
                println!("gamma {roughness:?} at 75 degrees in the mirror direction: ours / Mitsuba {ratio:.4}");
            }
        }
        // Planted difference: the roughnesses of the masking exchanged.
        assert_eq!(exchanged > 0.1, gamma_along != gamma_across, "{roughness:?}: {exchanged}");
    }
    // Planted difference: taking both maskings for the same.
    assert!(largest > 0.3, "{largest}");
}

#[test]
fn two_sided_diffuse_is_mitsuba_s_bilambertian_on_either_side() {
    let thetas: [f64; 6] = [0.0, 30.0, 75.0, 105.0, 150.0, 180.0];
    let mut places = Vec::new();
    for k in [0.0, 0.5, 3.0] {
        let leaf = plate(k, INDEX, 40.0);
        for light in thetas {
            for eye in thetas {
                places.push((leaf, direction(light, 20.0), direction(eye, 170.0)));
            }
        }
    }
    let queries: Vec<Value> = places
        .iter()
        .map(|(leaf, light, eye)| {
            // Its energy check is strict, and 1 by rounding is more than 1.
            json!({"reflectance": leaf.reflectance, "transmittance": leaf.transmittance.min(1.0 - leaf.reflectance),
                "light": light, "eye": eye})
        })
        .collect();
    let Some(answers) = ask(&json!({"bilambertian": queries})) else { return };
    let mut swapped = 0f64;
    for ((leaf, light, eye), theirs) in places.iter().zip(numbers(&answers, "bilambertian")) {
        let (rho, tau) = (leaf.reflectance as f32, leaf.transmittance as f32);
        let sample =
            |a: f32, b: f32| f64::from(two_sided_diffuse(a, b, light[2] as f32, eye[2] as f32)) / std::f64::consts::PI;
        assert!((sample(rho, tau) - theirs).abs() < 1e-6, "{light:?} {eye:?}: {} {theirs}", sample(rho, tau));
        // Planted difference: the sides taken for each other.
        swapped = swapped.max((sample(tau, rho) - theirs).abs());
    }
    assert!(swapped > 1e-2, "{swapped}");
}

#[test]
fn fresnel_and_snell_are_mitsuba_s_between_any_media() {
    let indices = [1.0, 1.33, 1.41, 1.42, 1.6, 3.0];
    let mut interfaces = Vec::new();
    for n_incident in indices {
        for n_transmitted in indices {
            for theta in [0.0f64, 10.0, 30.0, 45.0, 60.0, 75.0, 85.0, 89.0, 89.9] {
                interfaces.push((n_incident, n_transmitted, theta.to_radians().cos()));
            }
        }
    }
    let queries: Vec<Value> = interfaces
        .iter()
        .map(|(i, t, cos)| json!({"n_incident": i, "n_transmitted": t, "cos_incident": cos}))
        .collect();
    let Some(answers) = ask(&json!({"fresnel": queries})) else { return };
    let answers = answers["fresnel"].as_array().unwrap();
    assert_eq!(answers.len(), interfaces.len());
    let (mut worst, mut worst_cos, mut swapped, mut total) = (0f64, 0f64, 0f64, 0);
    for (&(i, t, cos), theirs) in interfaces.iter().zip(answers) {
        let (reflectance, cos_transmitted) = (theirs[0].as_f64().unwrap(), theirs[1].as_f64().unwrap());
        worst = worst.max((fresnel_between(i, t, cos) - reflectance).abs());
        swapped = swapped.max((fresnel_between(t, i, cos) - reflectance).abs());
        match refract_cos(i, t, cos) {
            Some(ours) => worst_cos = worst_cos.max((ours - cos_transmitted).abs()),
            None => {
                assert_eq!(reflectance, 1.0, "total internal reflection: {i} {t} {cos}");
                total += 1;
            }
        }
    }
    println!("Fresnel: worst {worst:e}, refracted cosine {worst_cos:e}, {total} of {} reflect all", answers.len());
    assert!(worst < 1e-12 && worst_cos < 1e-12, "{worst:e} {worst_cos:e}");
    // Planted difference: the media swapped.
    assert!(swapped > 0.1 && total > 20, "{swapped} {total}");
}

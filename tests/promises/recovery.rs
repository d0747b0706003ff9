//! Known materials are found again. The reflectance here is written out once more (and the leaf's
//! gloss is btf-synth's): generator and fitter share no reflectance code.

use btf_capture::{Capture, DirectionSet, ImageFormat};
use btf_fit::{FitOutcome, FitParams, MeasureParams, Monitor, measure};
use btf_runtime::{LobeFamily, weight_from_byte};
use btf_tests::{capture_of, fitted, resident, small_fit};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// A Beckmann gloss of slope `m` over a diffuse body, about the macroscopic normal, plain f64.
fn glossy(body: [f64; 3], gloss: f64, m: f64, wi: [f32; 3], wo: [f32; 3]) -> [f32; 3] {
    let (wi, wo) = (wi.map(f64::from), wo.map(f64::from));
    let sum: Vec<f64> = (0..3).map(|i| wi[i] + wo[i]).collect();
    let length = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
    let nh = sum[2] / length;
    let vh = (0..3).map(|i| wo[i] * sum[i] / length).sum::<f64>();
    let tan2 = (1.0 - nh * nh) / (nh * nh);
    let d = (-tan2 / (m * m)).exp() / (std::f64::consts::PI * m * m * nh.powi(4));
    let g = (2.0 * nh * wo[2] / vh).min(2.0 * nh * wi[2] / vh).min(1.0);
    let specular = std::f64::consts::PI * gloss * d * g / (4.0 * wo[2]);
    [0, 1, 2].map(|c| (body[c] * wi[2] + specular) as f32)
}

fn rings() -> DirectionSet {
    use btf_capture::Direction;
    let ring = |theta: f64, count: usize| {
        (0..count).map(move |i| Direction { theta_deg: theta, phi_deg: 360.0 * i as f64 / count as f64 })
    };
    let all = ring(0.0, 1).chain(ring(20.0, 6)).chain(ring(40.0, 10)).chain(ring(60.0, 12)).chain(ring(75.0, 12));
    DirectionSet::new(all.collect()).unwrap()
}

fn lobes_only(folder: &std::path::Path) -> FitParams {
    FitParams { components: Some(0), clusters: 2, ..small_fit(folder) }
}

fn psnr(capture: &Capture, outcome: &FitOutcome) -> f64 {
    let loaded = resident(&outcome.asset);
    measure(capture, &outcome.asset, &loaded, &MeasureParams::default(), &Monitor::default()).unwrap().metrics().psnr_db
}

#[test]
fn a_known_gloss_and_body_are_recovered_under_noise() {
    let folder = tempfile::tempdir().unwrap();
    let (roughness, gloss) = (0.25, 0.08);
    let set = rings();
    let body = |texel: usize| [0.1 + 0.02 * (texel % 8) as f64, 0.3, 0.15];
    let noise = |texel: usize, wi: [f32; 3], wo: [f32; 3]| -> f32 {
        let key = u64::from(wi[0].to_bits())
            ^ u64::from(wo[1].to_bits()) << 20
            ^ (texel as u64) << 40
            ^ u64::from(wi[1].to_bits()) << 8;
        1.0 + 0.01 * Xoshiro256PlusPlus::seed_from_u64(key).gen_range(-1.0f32..1.0)
    };
    let capture = capture_of(&folder.path().join("gloss"), 8, &set, &set, ImageFormat::Exr, |texel, wi, wo| {
        glossy(body(texel), gloss, roughness, wi, wo).map(|x| x * noise(texel, wi, wo))
    });
    let outcome = fitted(&capture, &lobes_only(folder.path()));
    let db = psnr(&capture, &outcome);
    assert!(db > 40.0, "{db} dB");

    // The lobes that carry the gloss are narrow ones, of about the right width; the body is what the
    // wide ones sum to. The weights of the texels tell which are used.
    let layer = &outcome.asset.layers[0];
    let mut weighted = 0.0;
    let mut total = 0.0;
    let mut at = 0;
    for (texel, count) in layer.texel_lobe_counts.iter().enumerate() {
        for reference in &layer.lobe_refs[at..at + usize::from(*count)] {
            let entry = &layer.dictionary[usize::from(layer.texel_clusters[texel])][usize::from(reference.lobe)];
            // Every family's width as the slope at which it has fallen to 1/e.
            let width = match entry.lobe.family {
                LobeFamily::CookTorrance | LobeFamily::Ward | LobeFamily::Ggx => entry.lobe.params[0],
                LobeFamily::BlinnPhong | LobeFamily::AshikhminShirley => (2.0 / entry.lobe.params[0]).sqrt(),
                _ => continue,
            };
            if width < 0.6 {
                let weight = f64::from(weight_from_byte(reference.weight[1].into(), entry.weight_scale));
                weighted += weight * f64::from(width);
                total += weight;
            }
        }
        at += usize::from(*count);
    }
    assert!(total > 0.0, "no narrow lobe is used");
    let found = weighted / total;
    assert!((found / roughness).ln().abs() < 1.5f64.ln(), "roughness {found}, made with {roughness}");
}

#[test]
fn a_lambertian_texel_needs_one_lobe_and_a_wrong_material_is_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let set = rings();
    let flat = |folder: &std::path::Path, albedo: f32| {
        capture_of(folder, 6, &set, &set, ImageFormat::Exr, move |texel, wi, _| {
            [albedo, 0.2, 0.1 + 0.01 * (texel % 6) as f32].map(|x| x * wi[2])
        })
    };
    let capture = flat(&folder.path().join("a"), 0.5);
    let outcome = fitted(&capture, &lobes_only(folder.path()));
    let db = psnr(&capture, &outcome);
    assert!(db > 45.0, "{db} dB");
    assert!(outcome.lobe_use.per_texel_mean < 2.0, "{}", outcome.lobe_use);
    // Planted difference: another red.
    let other = flat(&folder.path().join("b"), 0.4);
    assert!(psnr(&other, &outcome) < db - 10.0);
}

#[test]
fn held_back_pairs_are_predicted() {
    let folder = tempfile::tempdir().unwrap();
    let set = rings();
    let capture = capture_of(&folder.path().join("c"), 8, &set, &set, ImageFormat::Png, |texel, wi, wo| {
        glossy([0.3 + 0.01 * (texel % 8) as f64, 0.2, 0.1], 0.05, 0.35, wi, wo)
    });
    let params = FitParams { leave_out: 0.2, ..small_fit(folder.path()) };
    let outcome = fitted(&capture, &params);
    let pairs = set.len() * set.len();
    assert_eq!(outcome.left_out.len(), (pairs as f64 * 0.2).round() as usize);
    let loaded = resident(&outcome.asset);
    let comparison =
        measure(&capture, &outcome.asset, &loaded, &MeasureParams::default(), &Monitor::default()).unwrap();
    let held = comparison.psnr_of_pairs(outcome.left_out.iter().copied()).unwrap();
    let seen = comparison.psnr_of_pairs((0..pairs).filter(|pair| !outcome.left_out.contains(pair))).unwrap();
    assert!(held > 30.0, "held back {held} dB, seen {seen} dB");
    assert!(held < seen, "held-back pairs cannot be better than seen ones: {held} {seen}");
}

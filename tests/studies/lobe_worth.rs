//! Prints what an asset's lobes are worth beside its error, as Markdown: how much of the texels' contrast stays under
//! edits, and how much less light that is drawn by the lobes scatters than light that is drawn by the cosine:
//! `cargo run --release -p btf-tests -- lobe_worth ASSET.spmm...`.

use btf_fit::load_asset;
use btf_runtime::{Asset, DecodeOptions, Edit, Edits, Resident, ViewedTexel, decode};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use std::error::Error;
use std::f32::consts::{PI, TAU};
use std::path::Path;

/// Pairs and texels that contrast is taken over.
const PAIRS: usize = 48;
const TEXELS: usize = 4096;
/// Places and eyes whose light is estimated, and directions that each estimate's variance is taken over.
const EYES: usize = 1024;
const DRAWN: usize = 256;
/// Largest angle of lights and eyes from the normal, in degrees.
const MAX_THETA_DEG: f32 = 70.0;

/// Direction of the sun, its radiance and the size of its glow: a sixth of the irradiance comes from it.
const SUN: [f32; 3] = [0.5, 0.0, 0.866_025_4];
const SUN_RADIANCE: f32 = 100.0;
const GLOW_RAD: f32 = 0.06;

type Unit = [f32; 3];

fn random_direction(random: &mut Xoshiro256PlusPlus) -> Unit {
    let z = random.gen_range(MAX_THETA_DEG.to_radians().cos()..1.0f32);
    let (s, phi) = ((1.0 - z * z).sqrt(), random.gen_range(0.0..TAU));
    [s * phi.cos(), s * phi.sin(), z]
}

/// Returns the radiance of a clear sky, with a sun of `sun` times [`SUN_RADIANCE`].
fn sky(wi: Unit, sun: f32) -> f32 {
    let cosine = (0..3).map(|i| wi[i] * SUN[i]).sum::<f32>().clamp(-1.0, 1.0);
    1.0 + wi[2] + sun * SUN_RADIANCE * (-(cosine.acos() / GLOW_RAD).powi(2)).exp()
}

fn luminance([r, g, b]: [f32; 3]) -> f64 {
    f64::from(0.2126 * r + 0.7152 * g + 0.0722 * b)
}

/// Returns the mean over pairs of the texels' relative contrast: the standard deviation of the luminance over its mean.
fn contrast(asset: &Asset, edit: Option<Edit>) -> f64 {
    let count = asset.texel_count();
    let mut edited = asset.clone();
    edited.edits = edit.map_or(Edits::default(), |edit| Edits { list: vec![edit], texels: vec![1; count] });
    let resident = Resident::from_asset(&edited);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(5);
    let pairs: Vec<[Unit; 2]> = (0..PAIRS).map(|_| [0; 2].map(|_| random_direction(&mut random))).collect();
    let of_pair = |[wi, wo]: &[Unit; 2]| {
        let step = count.div_ceil(TEXELS) | 1;
        let values = (0..count).step_by(step);
        let values: Vec<f64> = values
            .map(|texel| luminance(decode(&resident, 0, texel as u32, *wi, *wo, &DecodeOptions::default())))
            .collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let square = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / values.len() as f64;
        square.sqrt() / mean.max(1e-9)
    };
    pairs.par_iter().map(of_pair).sum::<f64>() / PAIRS as f64
}

/// Returns the mean variance of one drawn direction's share of the reflected light, over the squared light, when it is
/// drawn by the texel's lobes, by the cosine, and in proportion to the texel's reflectance for the eye, which is the best
/// that can be done without knowing the sky.
fn variances(resident: &Resident, texels: usize, sun: f32) -> [f64; 3] {
    let one = |number: usize| -> [f64; 3] {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(number as u64);
        let (texel, wo) = (random.gen_range(0..texels) as u32, random_direction(&mut random));
        let viewed = ViewedTexel::new(resident, 0, texel, wo, &DecodeOptions::default());
        let mut estimates = [Vec::with_capacity(DRAWN), Vec::with_capacity(DRAWN)];
        // Means over the cosine's directions: the reflectance, the light, and the light times its radiance.
        let mut ideal = [0.0; 3];
        for _ in 0..DRAWN {
            let at = [0; 3].map(|_| random.gen_range(0.0..1.0f32));
            let wi = viewed.sample_direction(at);
            let density = viewed.sample_density(wi);
            let share = |wi: Unit, density: f32| {
                if density > 0.0 && wi[2] > 0.0 {
                    luminance(viewed.light_alone(wi)) * f64::from(sky(wi, sun) / (PI * density))
                } else {
                    0.0
                }
            };
            estimates[0].push(share(wi, density));
            let (radius, phi) = (at[0].sqrt(), TAU * at[1]);
            let wi = [radius * phi.cos(), radius * phi.sin(), (1.0 - at[0]).max(0.0).sqrt()];
            let light = share(wi, wi[2] / PI);
            estimates[1].push(light);
            let radiance = f64::from(sky(wi, sun));
            ideal.iter_mut().zip([light / radiance, light, light * radiance]).for_each(|(sum, x)| *sum += x);
        }
        let [reflected, light, squared] = ideal;
        let mean = estimates.iter().flatten().sum::<f64>() / (2 * DRAWN) as f64;
        let [lobes, cosine] = estimates.map(|all| {
            let own = all.iter().sum::<f64>() / DRAWN as f64;
            all.iter().map(|x| (x - own).powi(2)).sum::<f64>() / DRAWN as f64 / mean.powi(2).max(1e-12)
        });
        [lobes, cosine, reflected * squared / light.powi(2).max(1e-12) - 1.0]
    };
    let sums: Vec<[f64; 3]> = (0..EYES).into_par_iter().map(one).collect();
    [0, 1, 2].map(|i| sums.iter().map(|of_eye| of_eye[i]).sum::<f64>() / EYES as f64)
}

/// Prints the tables of the assets in `arguments`.
///
/// # Errors
/// If there is none, or a file is no asset.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    if arguments.is_empty() {
        return Err("give at least one asset".into());
    }
    let plain = Edit::default();
    let edits = [
        ("specular 0", Edit { specular: 0.0, ..plain }),
        ("roughness x 2", Edit { roughness: 2.0, ..plain }),
        ("tint", Edit { tint: [0.9, 0.5, 0.3], ..plain }),
        ("normals tilted by 0.2", Edit { tilt: [0.2, 0.0], ..plain }),
    ];
    let names: Vec<&str> = edits.iter().map(|(name, _)| *name).collect();
    println!(
        "| asset | contrast kept: {} | variance under a sky, by lobes / by cosine / by the value | with a sun |",
        names.join(" | ")
    );
    println!("|{}", "---|".repeat(edits.len() + 3));
    for path in arguments {
        let (_, asset) = load_asset(Path::new(path))?;
        let before = contrast(&asset, None);
        let kept: Vec<String> =
            edits.iter().map(|(_, edit)| format!("{:.1} %", 100.0 * contrast(&asset, Some(*edit)) / before)).collect();
        let resident = Resident::from_asset(&asset);
        let [sky, with_sun] = [0.0, 1.0].map(|sun| variances(&resident, asset.texel_count(), sun));
        let text = |all: [f64; 3]| all.map(|x| format!("{x:.3}")).join(" / ");
        println!("| {path} | {} | {} | {} |", kept.join(" | "), text(sky), text(with_sun));
    }
    Ok(())
}

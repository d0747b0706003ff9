//! A fitted asset of the size that users have decodes on the GPU as on the CPU: 32 clusters, 64 components and more, 81
//! x 81 directions. (What holds of random assets of a few components, in every combination of options, is tested in the
//! viewer.)

use btf_capture::{Capture, DirectionSet, ImageFormat};
use btf_fit::FitParams;
use btf_runtime::testing::Random;
use btf_runtime::{DecodeOptions, Interpolation, decode};
use btf_tests::{capture_of, fitted, gpu, resident};
use btf_viewer::GpuTracer;
use btf_viewer::testing::{DecodeQuery, gpu_decode};
use std::path::Path;

/// Direction pairs that are decoded.
const SAMPLES: usize = 20_000;
/// Absolute and relative tolerance of a channel. Both decoders read the same bytes: what is left is the rounding of
/// sums in single precision, and of the driver's powers.
const TOLERANCE: f32 = 1e-3;

/// Returns how many samples differ by more than the tolerance.
fn differences(expected: &[[f32; 3]], found: &[[f32; 3]]) -> usize {
    let near = |(a, b): (&f32, &f32)| (a - b).abs() <= TOLERANCE + TOLERANCE * a.abs();
    expected.iter().zip(found).filter(|(a, b)| !a.iter().zip(*b).all(near)).count()
}

/// Texels along a side: a cluster has 98 of them on average, more than the components that are asked for.
const SIZE: usize = 56;

/// Writes a capture of flakes of glitter, of which no two texels have the same normal, width or colour: a cluster needs
/// as many components as it has texels.
fn glitter_capture(folder: &Path) -> Capture {
    let set = DirectionSet::bonn81();
    let mut random = Random::new(2);
    let flakes: Vec<[f32; 6]> = (0..SIZE * SIZE)
        .map(|_| {
            let mut within = |least, most| random.within(least, most);
            let slopes = [within(-0.8, 0.8), within(-0.8, 0.8)];
            [slopes[0], slopes[1], within(0.05, 0.2), within(0.05, 0.2), within(0.05, 0.3), within(0.05, 0.3)]
        })
        .collect();
    capture_of(folder, SIZE, &set, &set, ImageFormat::Png, |texel, wi, wo| {
        let [slope_x, slope_y, width_x, width_y, red, blue] = flakes[texel];
        let half = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
        let off = [half[0] / half[2] - slope_x, half[1] / half[2] - slope_y];
        let glint = 0.6 * (-(off[0] / width_x).powi(2) - (off[1] / width_y).powi(2)).exp();
        [red + glint, 0.1 + glint, blue + glint].map(|x| x * wi[2])
    })
}

#[test]
fn a_fitted_asset_decodes_on_the_gpu_as_on_the_cpu() {
    let Some(gpu) = gpu("a_fitted_asset_decodes_on_the_gpu_as_on_the_cpu") else { return };
    let folder = tempfile::tempdir().unwrap();
    let capture = glitter_capture(&folder.path().join("glitter"));
    let params =
        FitParams { bytes: Some(3_000_000), cache_directory: folder.path().to_path_buf(), ..FitParams::default() };
    let outcome = fitted(&capture, &params);
    println!("{} clusters, {} components, {} bytes", outcome.clusters, outcome.components, outcome.bytes.len());
    assert!(outcome.clusters == 32 && outcome.components >= 64, "{} {}", outcome.clusters, outcome.components);
    let resident = resident(&outcome.asset);
    let mut random = Random::new(1);
    let queries: Vec<DecodeQuery> = (0..SAMPLES)
        .map(|_| {
            let texel = random.below(outcome.asset.texel_count()) as u32;
            DecodeQuery { layer: 0, texel, wi: random.direction(), wo: random.direction() }
        })
        .collect();
    for interpolation in [Interpolation::Fast, Interpolation::Exact] {
        let options = DecodeOptions { interpolation, ..DecodeOptions::default() };
        let on_cpu = |options: &DecodeOptions| -> Vec<[f32; 3]> {
            queries.iter().map(|q| decode(&resident, q.layer, q.texel, q.wi, q.wo, options)).collect()
        };
        let found = gpu_decode(&gpu, GpuTracer::Bvh, &resident, &options, &queries).unwrap();
        assert_eq!(differences(&on_cpu(&options), &found), 0, "{interpolation:?}");
        // Planted difference: half of the components.
        let fewer = on_cpu(&DecodeOptions { components: outcome.components as u32 / 2, ..options });
        let seen = differences(&fewer, &found);
        assert!(seen > SAMPLES / 20, "{interpolation:?}: {seen}");
    }
}

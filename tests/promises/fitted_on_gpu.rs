//! A fitted asset of the size that users have decodes on the GPU as on the CPU: 32 clusters, 64 components and more, 81
//! x 81 directions. (What holds of random assets of a few components, in every combination of options, is tested in the
//! viewer.)

use btf_capture::DirectionSet;
use btf_fit::FitParams;
use btf_runtime::testing::Random;
use btf_runtime::{DecodeOptions, Interpolation, decode};
use btf_tests::{cloth_capture, fitted, gpu, resident};
use btf_viewer::GpuTracer;
use btf_viewer::testing::{DecodeQuery, gpu_decode};

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

#[test]
fn a_fitted_asset_decodes_on_the_gpu_as_on_the_cpu() {
    let Some(gpu) = gpu("a_fitted_asset_decodes_on_the_gpu_as_on_the_cpu") else { return };
    let folder = tempfile::tempdir().unwrap();
    let set = DirectionSet::bonn81();
    let capture = cloth_capture(&folder.path().join("cloth"), 40, &set, &set);
    let params =
        FitParams { components: Some(64), cache_directory: folder.path().to_path_buf(), ..FitParams::default() };
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

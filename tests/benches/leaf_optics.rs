//! Times leaf optics: `cargo bench -p btf-tests --bench leaf_optics`. What each form loses beside its
//! time is printed by the study `leaf_trade`.

use btf_synth::{LeafContents, PlateBody, PlateModel, RgbBands, SpecificAbsorption, ThetaForm};
use btf_tests::leaf::trade::contents_grid;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

/// Items of one iteration.
const COUNT: u32 = 4096;

fn theta(criterion: &mut Criterion) {
    // Scattered over 0 to 5, so that no branch predictor learns the pieces.
    let ks: Vec<f64> =
        (0..COUNT).map(|i| f64::from(i.wrapping_mul(2_654_435_761)) / f64::from(u32::MAX) * 5.0).collect();
    let mut group = criterion.benchmark_group("theta");
    group.throughput(Throughput::Elements(ks.len() as u64));
    for form in ThetaForm::ALL {
        group.bench_function(form.name(), |bench| bench.iter(|| ks.iter().map(|&k| form.at(k)).sum::<f64>()));
    }
    group.finish();
}

fn texel(criterion: &mut Criterion) {
    let contents: Vec<LeafContents> = contents_grid().into_iter().cycle().take(COUNT as usize).collect();
    let mut group = criterion.benchmark_group("texel");
    group.sample_size(10);
    group.throughput(Throughput::Elements(contents.len() as u64));
    for model in PlateModel::ALL {
        for bands in [RgbBands::ThreeWavelength, RgbBands::Spectral31] {
            let Ok(body) = PlateBody::new(model, SpecificAbsorption::ProspectD, bands) else { continue };
            group.bench_function(format!("{}, {}", model.name(), bands.name()), |bench| {
                bench.iter(|| contents.iter().map(|contents| body.rgb(contents, 1.1).reflectance[1]).sum::<f32>());
            });
        }
    }
    group.finish();
}

criterion_group!(benches, theta, texel);
criterion_main!(benches);

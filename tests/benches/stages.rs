//! Times reading, clustering, fitting and decoding: `cargo xtask bench`.
//!
//! Figures are ratios within one run unless the machine is named. Sizes are small enough for minutes,
//! large enough that the inner loops dominate.

use btf_capture::{Capture, DirectionSet, ImageFormat};
use btf_fit::{FitParams, KMeansEngine, LassoParams, LassoProblem, Monitor, TileCache, kmeans, stagewise_lasso};
use btf_runtime::{Asset, DecodeOptions, Interpolation, Resident, TexelPlace, decode, decode_from_file_form};
use btf_tests::{fitted, leaf_capture, resident};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::hint::black_box;
use std::ops::ControlFlow;

fn read(criterion: &mut Criterion, capture: &Capture, folder: &std::path::Path) {
    let mut group = criterion.benchmark_group("read");
    group.sample_size(10);
    group.throughput(Throughput::Elements((capture.info().pair_count() * capture.info().texel_count()) as u64));
    group.bench_function("images to texel blocks in memory", |bench| {
        bench.iter(|| TileCache::build(capture, 1 << 32, folder, &Monitor::default()).unwrap().tile_count());
    });
    group.finish();
}

fn cluster(criterion: &mut Criterion) {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    let centres = Array2::from_shape_simple_fn((40, 64), || random.gen_range(-3.0..3.0f32));
    let points = Array2::from_shape_fn((16_384, 64), |(i, j)| centres[[i % 40, j]] + random.gen_range(-1.0..1.0f32));
    let mut group = criterion.benchmark_group("cluster");
    group.sample_size(10);
    for (name, engine) in [("product", KMeansEngine::Product), ("linfa", KMeansEngine::Linfa)] {
        group.bench_function(name, |bench| bench.iter(|| kmeans(points.view(), 32, engine, 1).unwrap().inertia));
    }
    group.finish();
}

fn lasso(criterion: &mut Criterion) {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(2);
    let mut design = Array2::from_shape_simple_fn((400, 32), || random.gen_range(0.0..1.0f64));
    for mut atom in design.columns_mut() {
        let norm = atom.dot(&atom).sqrt();
        atom /= norm;
    }
    let gram: Vec<f64> = design.t().dot(&design).iter().copied().collect();
    let response = &design.column(3) * 0.5 + &design.column(9) * 0.3 + &design.column(20) * 0.2;
    let correlation: Vec<f64> = design.t().dot(&response).to_vec();
    let top = correlation.iter().fold(0.0f64, |top, x| top.max(*x));
    criterion.bench_function("lasso/one texel, 32 lobes", |bench| {
        bench.iter(|| {
            let problem = LassoProblem { gram: &gram, correlation: &correlation, non_negative: true };
            let params = LassoParams { epsilon: 0.03 * top, least_penalty: 0.02 * top, most_steps: 400 };
            stagewise_lasso(&problem, &params, |_| ControlFlow::Continue(()))
        });
    });
}

fn whole_fit(criterion: &mut Criterion, capture: &Capture, params: &FitParams) {
    let mut group = criterion.benchmark_group("fit");
    group.sample_size(10);
    group.bench_function("64 x 64 texels, 81 x 81 pairs, 8 clusters", |bench| {
        bench.iter(|| fitted(capture, params).bytes.len())
    });
    group.finish();
}

/// Random directions above the horizon, a texel each.
fn queries(asset: &Asset) -> Vec<(u32, [f32; 3], [f32; 3])> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(3);
    let mut direction = || loop {
        let d = [random.gen_range(-1.0..1.0f32), random.gen_range(-1.0..1.0), random.gen_range(0.01..1.0)];
        let length = d.iter().map(|x| x * x).sum::<f32>().sqrt();
        if length <= 1.0 {
            return d.map(|x| x / length);
        }
    };
    (0..1000).map(|i| ((i * 37 % asset.texel_count()) as u32, direction(), direction())).collect()
}

fn decoding(criterion: &mut Criterion, asset: &Asset) {
    let loaded = resident(asset);
    let queries = queries(asset);
    let mut group = criterion.benchmark_group("decode");
    group.throughput(Throughput::Elements(queries.len() as u64));
    for (name, interpolation) in
        [("resident form, fast", Interpolation::Fast), ("resident form, exact", Interpolation::Exact)]
    {
        for components in [0, 4, u32::MAX] {
            let options = DecodeOptions { components, interpolation, ..DecodeOptions::default() };
            let label = if components == u32::MAX {
                format!("{name}, all components")
            } else {
                format!("{name}, {components} components")
            };
            group.bench_function(label, |bench| {
                bench.iter(|| {
                    for (texel, wi, wo) in &queries {
                        black_box(decode(&loaded, 0, *texel, *wi, *wo, &options));
                    }
                });
            });
        }
    }
    let layer = &asset.layers[0];
    let first: Vec<usize> = layer
        .texel_lobe_counts
        .iter()
        .scan(0, |at, count| {
            let here = *at;
            *at += usize::from(*count);
            Some(here)
        })
        .collect();
    let (views, lights) = (layer.views.len(), layer.lights.len());
    group.bench_function("file form, one measured pair", |bench| {
        bench.iter(|| {
            for (i, (texel, ..)) in queries.iter().enumerate() {
                let texel = *texel as usize;
                black_box(decode_from_file_form(
                    asset,
                    TexelPlace { layer: 0, texel, first_ref: first[texel] },
                    i % views,
                    i % lights,
                ));
            }
        });
    });
    group.finish();
    let mut group = criterion.benchmark_group("load");
    group.sample_size(10);
    let bytes = btf_runtime::pack(asset).unwrap();
    group.bench_function("parse the file form", |bench| bench.iter(|| Asset::parse(&bytes).unwrap().width));
    group.bench_function("file form to resident form, one thread", |bench| {
        bench.iter(|| Resident::from_asset(asset).words().len())
    });
    group.bench_function("file form to resident form, all threads", |bench| {
        bench.iter(|| resident(asset).words().len())
    });
    group.finish();
}

fn stages(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().unwrap();
    let set = DirectionSet::bonn81();
    let capture = leaf_capture(&folder.path().join("leaf"), 64, &set, &set, ImageFormat::Png);
    let params = FitParams { clusters: 8, cache_directory: folder.path().to_path_buf(), ..FitParams::default() };
    read(criterion, &capture, folder.path());
    cluster(criterion);
    lasso(criterion);
    let asset = fitted(&capture, &params).asset;
    decoding(criterion, &asset);
    whole_fit(criterion, &capture, &params);
}

criterion_group!(benches, stages);
criterion_main!(benches);

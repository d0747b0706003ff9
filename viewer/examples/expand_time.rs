//! Times how the bases of assets in file form come into an adapter's memory, expanded by the CPU and uploaded or
//! expanded there: `cargo run --release -p btf-viewer --example expand_time FILE.spmm ...`. The least of five runs
//! each.

use btf_runtime::{Asset, ExpansionInput, Resident};
use btf_viewer::Gpu;
use btf_viewer::testing::{gpu_expand, time_gpu_expand, time_upload};
use half::f16;
use rayon::prelude::*;
use std::time::Instant;

/// The least of five numbers.
fn least(mut run: impl FnMut() -> f64) -> f64 {
    (0..5).map(|_| run()).fold(f64::MAX, f64::min)
}

fn main() {
    let threads = |count: usize, work: &(dyn Fn(usize) + Sync)| (0..count).into_par_iter().for_each(work);
    let gpu = Gpu::headless(None).expect("there is an adapter");
    println!("{} ({}), {} threads", gpu.adapter_name(), gpu.interface(), rayon::current_num_threads());
    for path in std::env::args().skip(1) {
        let bytes = std::fs::read(&path).expect("the file can be read");
        let asset = Asset::parse_on(&bytes, &threads).expect("it is an asset in file form");
        let expected = Resident::from_asset_on(&asset, &threads);
        let cpu = least(|| {
            let start = Instant::now();
            std::hint::black_box(Resident::from_asset_on(&asset, &threads));
            1e3 * start.elapsed().as_secs_f64()
        });
        let upload = least(|| time_upload(&gpu, &expected).expect("the adapter takes it"));
        let here = least(|| time_gpu_expand(&gpu, &asset).expect("the adapter takes it"));
        let found = gpu_expand(&gpu, &asset).expect("the adapter takes it");
        let halves = |words: &[u32]| -> Vec<f32> {
            let halves = words.iter().flat_map(|word| [*word as u16, (*word >> 16) as u16]);
            halves.map(|bits| f16::from_bits(bits).to_f32()).collect()
        };
        let inputs = asset.layers.iter().filter_map(|layer| {
            let input = ExpansionInput::of_layer(layer)?;
            Some(4 * (input.terms.len() + input.factors.len() + input.mixtures.len() + input.nodes.len()))
        });
        let (mut peak, mut worst, mut count, mut other) = (0.0f32, 0.0f32, 0, 0);
        for place in (0..expected.layers()).map(|layer| expected.bases_of(layer)) {
            for (a, b) in halves(&expected.words()[place.clone()]).iter().zip(halves(&found[place])) {
                (peak, worst) = (peak.max(a.abs()), worst.max((a - b).abs()));
                (count, other) = (count + 1, other + usize::from(*a != b));
            }
        }
        println!(
            "{path}: {:.1} MB, the bases made from {:.1}; on the CPU {cpu:.1} ms and uploaded in {upload:.1} ms; on the adapter {here:.1} ms, {:.2} of \
             both; {:.3} % of the halves differ, at most by {:.1e} of the largest",
            4e-6 * expected.words().len() as f64,
            1e-6 * inputs.sum::<usize>() as f64,
            here / (cpu + upload),
            100.0 * other as f64 / f64::from(count.max(1)),
            worst / peak
        );
    }
}

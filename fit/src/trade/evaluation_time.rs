//! Cost of one evaluation of the resident decoder on one thread.

use btf_runtime::{Layer, SurfaceSide};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f32::consts::TAU;
use std::hint::black_box;
use std::time::Instant;

/// Texel, direction to the light, direction to the eye.
pub(crate) type Query = (u32, [f32; 3], [f32; 3]);

/// Returns `count` random texels of `texels`, each with a light and an eye uniform on `layer`'s sides. Equal arguments
/// give equal queries, so that all points of a trade are timed on one set.
pub(crate) fn random_queries(count: usize, texels: usize, layer: &Layer, seed: u64) -> Vec<Query> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x71ae_5eed);
    let direction = |side: SurfaceSide, random: &mut Xoshiro256PlusPlus| {
        // Uniform in solid angle; never quite at the horizon, where nothing is decoded.
        let z: f32 = random.gen_range(1e-3..1.0);
        let phi = random.gen_range(0.0..TAU);
        let r = (1.0 - z * z).sqrt();
        [r * phi.cos(), r * phi.sin(), if side == SurfaceSide::Back { -z } else { z }]
    };
    (0..count)
        .map(|_| {
            let texel = random.gen_range(0..texels.max(1)) as u32;
            (texel, direction(layer.light_side, &mut random), direction(layer.view_side, &mut random))
        })
        .collect()
}

/// Returns the nanoseconds that `eval` takes per query: the least of `repeats` passes after one that is not counted,
/// because other work of the machine can only add to it. Runs on the calling thread.
pub(crate) fn least_nanoseconds(queries: &[Query], repeats: usize, eval: impl Fn(&Query) -> [f32; 3]) -> f64 {
    let pass = || {
        let start = Instant::now();
        let mut sum = 0.0f32;
        for query in queries {
            let [r, g, b] = eval(black_box(query));
            sum += r + g + b;
        }
        black_box(sum);
        start.elapsed().as_secs_f64() * 1e9 / queries.len().max(1) as f64
    };
    pass();
    (0..repeats.max(1)).map(|_| pass()).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_asset::sample_asset;

    #[test]
    fn queries_are_the_same_for_a_seed_unit_and_on_the_layers_sides() {
        let mut layer = sample_asset().layers[0].clone();
        layer.light_side = SurfaceSide::Back;
        let queries = random_queries(500, 35, &layer, 1);
        assert_eq!(queries, random_queries(500, 35, &layer, 1));
        assert_ne!(queries, random_queries(500, 35, &layer, 2));
        for (texel, wi, wo) in &queries {
            let length = |d: &[f32; 3]| d.iter().map(|x| x * x).sum::<f32>();
            assert!(*texel < 35 && wi[2] < 0.0 && wo[2] > 0.0);
            assert!((length(wi) - 1.0).abs() < 1e-5 && (length(wo) - 1.0).abs() < 1e-5);
        }
        let mean = queries.iter().map(|(_, _, wo)| wo[2]).sum::<f32>() / 500.0;
        assert!((mean - 0.5).abs() < 0.05, "uniform in solid angle: mean cosine {mean}");
    }

    #[test]
    fn twice_the_work_takes_longer() {
        let queries = random_queries(200, 35, &sample_asset().layers[0], 1);
        let work = |rounds: usize| {
            move |query: &Query| {
                let mut x = query.1[0];
                for _ in 0..rounds {
                    x = black_box(x).sin();
                }
                [x; 3]
            }
        };
        let (short, long) = (least_nanoseconds(&queries, 5, work(50)), least_nanoseconds(&queries, 5, work(500)));
        assert!(short > 0.0 && long > 2.0 * short, "{short} {long}");
    }
}

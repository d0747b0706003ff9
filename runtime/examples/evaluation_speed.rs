//! Times evaluations of assets on one thread: `cargo run --release -p btf-runtime --example evaluation_speed FILE.spmm
//! ...`.
//!
//! Places, lights and eyes are random, so that no evaluation profits from the cache lines of the one before. Each file
//! is timed as it is, without relief and without heights where it has any, with packed bases of some sizes, and with 8
//! lobes in every texel, all of them part of the value. The floor is a loop that only reads one number of each cache line that an evaluation needs, at
//! places found before. All times are of one run.

use btf_runtime::testing::evaluation_traffic;
use btf_runtime::{
    Asset, DecodeOptions, HeightUse, LobeRef, LobeRole, PackedGoal, Query, Resident, evaluate, evaluate_many, serial,
};
use std::f32::consts::TAU;
use std::hint::black_box;
use std::ops::Range;
use std::time::Instant;

const QUERIES: usize = 1 << 15;
const SLICE: usize = 1 << 10;
const PASSES: usize = 20;
const LOBES: usize = 8;
/// Sizes of resident forms with packed bases, MB.
const PACKED_MB: [u64; 3] = [15, 10, 5];

fn queries() -> Vec<Query> {
    // Powers of the root of x^7 = x + 1: even in all six dimensions, without a generator.
    let root = 1.112_775_684f64;
    let at = |i: usize, dimension: i32| (0.5 + i as f64 * root.powi(-dimension)).fract() as f32;
    let direction = |z: f32, turn: f32| {
        let r = (1.0 - z * z).max(0.0).sqrt();
        [r * (TAU * turn).cos(), r * (TAU * turn).sin(), z]
    };
    (1..=QUERIES)
        .map(|i| {
            let [u, v, a, b, c, d] = [1, 2, 3, 4, 5, 6].map(|dimension| at(i, dimension));
            Query { uv: [u, v], wi: direction(a.max(1e-3), b), wo: direction(c.max(1e-3), d) }
        })
        .collect()
}

/// Returns `asset` with 8 lobes in every texel, all of them part of the value.
fn with_all_lobes(asset: &Asset) -> Asset {
    let mut asset = asset.without_levels();
    for layer in &mut asset.layers {
        layer.lobe_role = LobeRole::Base;
        layer.lobe_refs.clear();
        for (texel, cluster) in layer.texel_clusters.iter().enumerate() {
            let known = layer.dictionary[usize::from(*cluster)].len().max(1);
            layer.texel_lobe_counts[texel] = LOBES as u8;
            let lobe = |slot| LobeRef { lobe: ((texel + slot) % known) as u8, weight: [20, 40, 60] };
            layer.lobe_refs.extend((0..LOBES).map(lobe));
        }
    }
    asset
}

/// Returns the nanoseconds that `work` takes for a query: the least of each slice of queries, so that other work of the
/// machine seldom counts.
fn least_ns(mut work: impl FnMut(Range<usize>)) -> f64 {
    let mut least = vec![f64::MAX; QUERIES / SLICE];
    for _ in 0..=PASSES {
        for (slice, least) in least.iter_mut().enumerate() {
            let start = Instant::now();
            work(slice * SLICE..(slice + 1) * SLICE);
            *least = least.min(start.elapsed().as_secs_f64());
        }
    }
    1e9 * least.iter().sum::<f64>() / QUERIES as f64
}

fn time(name: &str, asset: &Asset, resident: &Resident, queries: &[Query], heights: HeightUse) {
    let options = DecodeOptions { heights, ..DecodeOptions::default() };
    let words = resident.words();
    let (mut needed, mut ends, mut places) = (0, Vec::new(), Vec::new());
    for query in queries {
        let traffic = evaluation_traffic(&asset.layers[0], resident, query, u32::MAX);
        needed += traffic.bytes;
        places.extend(traffic.lines);
        ends.push(places.len());
    }
    let floor = least_ns(|slice| {
        let first = slice.start.checked_sub(1).map_or(0, |before| ends[before]);
        black_box(places[first..ends[slice.end - 1]].iter().fold(0, |all, place| all ^ words[*place as usize]));
    });
    let alone = least_ns(|slice| {
        for query in &queries[slice] {
            black_box(evaluate(resident, 0, black_box(query), &options));
        }
    });
    let mut values = vec![[0.0; 3]; SLICE];
    let many =
        least_ns(|slice| evaluate_many(resident, 0, black_box(&queries[slice]), &options, black_box(&mut values)));
    let layer = &asset.layers[0];
    println!(
        "{name}: {:.1} lobes a texel, {}, {} components, {:.1} MB resident; {:.0} bytes an evaluation in {:.1} lines; \
         floor {floor:.0} ns, one {alone:.0} ns ({:.2} M/s), many {many:.0} ns ({:.2} M/s, {:.1} x the floor)",
        layer.lobe_refs.len() as f64 / layer.texel_clusters.len() as f64,
        if layer.lobe_role != LobeRole::Guide { "part of the value" } else { "which only guide" },
        resident.components(0),
        4e-6 * words.len() as f64,
        needed as f64 / QUERIES as f64,
        places.len() as f64 / QUERIES as f64,
        1e3 / alone,
        1e3 / many,
        many / floor
    );
}

fn main() {
    let queries = queries();
    for path in std::env::args().skip(1) {
        let asset = Asset::parse(&std::fs::read(&path).expect("the file can be read")).expect("it is an asset");
        let resident = Resident::from_asset(&asset);
        time(&path, &asset, &resident, &queries, HeightUse::Relief);
        if asset.layers[0].heights.is_some() {
            time("  without relief", &asset, &resident, &queries, HeightUse::Parallax);
            time("  without heights", &asset, &resident, &queries, HeightUse::None);
        }
        for size in PACKED_MB.into_iter().filter(|size| 1_000_000 * size < 4 * resident.words().len() as u64) {
            let packed = Resident::packed_on(&asset, PackedGoal::Bytes(1_000_000 * size), &serial);
            time(&format!("  packed, {size} MB"), &asset, &packed, &queries, HeightUse::Relief);
        }
        let all_lobes = with_all_lobes(&asset);
        time("  with 8 lobes", &all_lobes, &Resident::from_asset(&all_lobes), &queries, HeightUse::Relief);
    }
}

//! Times the opening of assets of either form and of their tiers on all processors, and the making of levels: `cargo run
//! --release -p btf-runtime --example load_time FILE.spmm ...`. Prints the least of five runs; the file's bytes are in
//! memory.

use btf_runtime::{Asset, PackedGoal, Resident, ResidentFile, read_directory, with_levels};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// Bytes of the packed resident form that is timed.
const PACKED_BYTES: u64 = 15_000_000;

/// Returns the least milliseconds of several runs of `work`.
fn least_ms<T>(mut work: impl FnMut() -> T) -> f64 {
    let times = (0..5).map(|_| {
        let start = Instant::now();
        std::hint::black_box(work());
        1e3 * start.elapsed().as_secs_f64()
    });
    times.fold(f64::MAX, f64::min)
}

fn main() {
    let threads = |count: usize, work: &(dyn Fn(usize) + Sync)| (0..count).into_par_iter().for_each(work);
    for path in std::env::args().skip(1) {
        let bytes = Arc::new(std::fs::read(&path).expect("the file can be read"));
        if ResidentFile::is_one(&bytes) {
            let open = least_ms(|| ResidentFile::open(bytes.clone(), &threads).expect("it is an asset"));
            let read = least_ms(|| bytes.iter().step_by(64).fold(0u8, |all, byte| all ^ byte));
            println!("{path}: opened and checked in {open:.1} ms; touching every line of it takes {read:.1} ms");
        } else {
            let asset = Asset::parse_on(&bytes, &threads).expect("it is an asset");
            let parse = least_ms(|| Asset::parse_on(&bytes, &threads).map(|asset| asset.width));
            let of_tier = |end: &u32| {
                let tier = &bytes[..*end as usize];
                let time =
                    least_ms(|| Asset::parse_on(tier, &threads).map(|asset| Resident::from_asset_on(&asset, &threads)));
                format!("{time:.1} ms ({end} bytes)")
            };
            let tiers = read_directory(&bytes).expect("it is an asset").tiers;
            println!(
                "{path}: tiers parsed and expanded in {}",
                tiers.iter().map(of_tier).collect::<Vec<_>>().join(", ")
            );
            let expand = least_ms(|| Resident::from_asset_on(&asset, &threads));
            let pack = least_ms(|| Resident::packed_on(&asset, PackedGoal::Bytes(PACKED_BYTES), &threads));
            let levels = least_ms(|| with_levels(&asset, &threads));
            println!(
                "{path}: parsed in {parse:.1} ms, expanded in {expand:.1} ms, packed to 15 MB in {pack:.1} ms, levels \
                 made in {levels:.1} ms"
            );
        }
    }
}

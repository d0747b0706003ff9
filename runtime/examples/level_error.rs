//! Compares the mip levels of assets with what they stand for, the means of the finest texels that they cover, at measured
//! directions: `cargo run --release -p btf-runtime --example level_error FILE.spmm ...`. Prints, for each of the first five
//! levels of the first layer, the PSNR of sRGB values and the mean of what a level is too bright, in steps of 8 bits.

use btf_runtime::{Asset, DecodeOptions, HeightUse, Resident, decode, with_levels};
use rayon::prelude::*;

/// Levels that are compared.
const LEVELS: u32 = 5;
/// Texels of a level that are compared at most.
const TEXELS: u32 = 300;
/// Texels along a side of what a coarse texel covers that are averaged at most.
const SIDE: u32 = 16;

/// Returns the sRGB value of a linear one; 1 is white.
fn srgb(x: f32) -> f64 {
    let x = f64::from(x.min(1.0));
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// Returns the number, the squared error and the error of the channels of texel `number` of a level, summed over measured
/// pairs of directions, one in `step`.
fn errors(resident: &Resident, asset: &Asset, level: u32, number: u32, step: usize) -> [f64; 3] {
    let options = DecodeOptions { heights: HeightUse::None, ..DecodeOptions::default() };
    let (layer, width) = (&asset.layers[0], asset.width as u32);
    let [columns, _] = resident.size(level * resident.layers());
    let covered = width / columns;
    let taken = covered.min(SIDE);
    let place = |texel: u32, part: u32| texel * covered + part * covered / taken;
    let (column, row) = (number % columns, number / columns);
    let finest: Vec<u32> =
        (0..taken * taken).map(|part| place(row, part / taken) * width + place(column, part % taken)).collect();
    let mut sums = [0.0; 3];
    for pair in (number as usize % step..layer.views.len() * layer.lights.len()).step_by(step) {
        let wo = layer.views.direction((pair / layer.lights.len()) as u32);
        let wi = layer.lights.direction((pair % layer.lights.len()) as u32);
        let values = finest.iter().map(|texel| decode(resident, 0, *texel, wi, wo, &options));
        let sum = values.fold([0.0f32; 3], |sum, value| [0, 1, 2].map(|c| sum[c] + value[c]));
        let shown = decode(resident, level * resident.layers(), number, wi, wo, &options);
        for c in 0..3 {
            let error = srgb(shown[c]) - srgb(sum[c] / finest.len() as f32);
            sums = [sums[0] + 1.0, sums[1] + error * error, sums[2] + error];
        }
    }
    sums
}

fn main() {
    let threads = |count: usize, work: &(dyn Fn(usize) + Sync)| (0..count).into_par_iter().for_each(work);
    for path in std::env::args().skip(1) {
        let bytes = std::fs::read(&path).expect("the file can be read");
        let asset = with_levels(&Asset::parse_on(&bytes, &threads).expect("it is an asset"), &threads);
        let resident = Resident::from_asset_on(&asset, &threads);
        for level in 1..=LEVELS.min(resident.levels() - 1) {
            let [columns, rows] = resident.size(level * resident.layers());
            let count = (columns * rows).min(TEXELS);
            // Coarse texels cover more, so fewer pairs of each.
            let step = if level > 3 { 97 } else { 13 };
            let of = |i: u32| errors(&resident, &asset, level, i * (columns * rows) / count, step);
            let sums = (0..count).into_par_iter().map(of).reduce(|| [0.0; 3], |a, b| [0, 1, 2].map(|i| a[i] + b[i]));
            let (db, bias) = (-10.0 * (sums[1] / sums[0]).log10(), 255.0 * sums[2] / sums[0]);
            println!("{path}: level {level}, {columns} x {rows}: {db:.2} dB, {bias:+.2} codes");
        }
    }
}

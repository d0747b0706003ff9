//! Fits the figures of the live leaf and prints them: `cargo run --release -p btf-tests -- leaf_fits`.
//!
//! The rational form of theta to the least largest error, by Remez's exchanges; and the bands that stand
//! for a spectrum: from 31 the one whose loss costs least is left out again and again, the others' shares of red, green
//! and blue fitted to the colours of random leaves, each channel's sum held at 1.

use crate::leaf::live::{random_states, reference_spectra};
use crate::leaf::trade::{Spread, delta_e00_linear};
use btf_synth::{RgbBands, RgbFromSpectrum, diffuse_transmission};
use std::error::Error;

/// Solves `a x = b` by elimination with pivots; `a` is square, row after row.
fn solved(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for i in 0..n {
        let pivot = (i..n).max_by(|&x, &y| a[x][i].abs().total_cmp(&a[y][i].abs())).unwrap_or(i);
        a.swap(i, pivot);
        b.swap(i, pivot);
        for row in i + 1..n {
            let factor = a[row][i] / a[i][i];
            for column in i..n {
                a[row][column] -= factor * a[i][column];
            }
            b[row] -= factor * b[i];
        }
    }
    for i in (0..n).rev() {
        let rest: f64 = (i + 1..n).map(|column| a[i][column] * b[column]).sum();
        b[i] = (b[i] - rest) / a[i][i];
    }
    b
}

/// `e^-k P / Q` of [a, q1, q2, q3], and its slope along each of them.
fn rational(k: f64, [a, q1, q2, q3]: [f64; 4]) -> (f64, [f64; 4]) {
    let decay = (-k).exp();
    let q = 1.0 + k * (q1 + k * (q2 + k * q3));
    let value = decay * (1.0 + k * (a + k * 2.0 * q3)) / q;
    let per = [decay * k, -value * k, -value * k * k, 2.0 * decay * k * k - value * k * k * k];
    (value, per.map(|x| x / q))
}

/// The rational form of least largest error over 0 <= k <= 14, and that error: least squares first, then exchanges of
/// the five places where the error is largest, at which it is levelled with alternating signs [Remez 1934].
fn fit_theta() -> ([f64; 4], f64) {
    const POINTS: usize = 20_000;
    const SQUARES: usize = 200;
    const EXCHANGES: usize = 30;
    let points: Vec<(f64, f64)> =
        (1..=POINTS).map(|i| 14.0 * (i as f64 / POINTS as f64).powi(3)).map(|k| (k, diffuse_transmission(k))).collect();
    let mut at = [7.0, 8.0, 9.5, 2.0];
    for round in 1..=SQUARES {
        let (mut a, mut b) = (vec![vec![0.0; 4]; 4], vec![0.0; 4]);
        for (k, exact) in &points {
            let (value, slopes) = rational(*k, at);
            for i in 0..4 {
                b[i] += slopes[i] * (exact - value);
                for j in 0..4 {
                    a[i][j] += slopes[i] * slopes[j];
                }
            }
        }
        // Damped at first: the four are nearly exchangeable.
        (0..4).for_each(|i| a[i][i] *= 1.0 + 0.1 / (round * round) as f64);
        at.iter_mut().zip(solved(a, b)).for_each(|(at, step)| *at += step);
    }
    let error = |at: [f64; 4], (k, exact): (f64, f64)| exact - rational(k, at).0;
    for _ in 0..EXCHANGES {
        // The largest error between each change of sign and the next.
        let mut peaks: Vec<(f64, f64)> = Vec::new();
        for point in &points {
            match peaks.last_mut() {
                Some(peak) if error(at, *peak).signum() == error(at, *point).signum() => {
                    if error(at, *point).abs() > error(at, *peak).abs() {
                        *peak = *point;
                    }
                }
                _ => peaks.push(*point),
            }
        }
        peaks.truncate(5);
        let rows = peaks.iter().zip([1.0, -1.0].into_iter().cycle());
        let a = rows.map(|((k, _), sign)| rational(*k, at).1.into_iter().chain([sign]).collect()).collect();
        let step = solved(a, peaks.iter().map(|peak| error(at, *peak)).collect());
        at.iter_mut().zip(step).for_each(|(at, step)| *at += step);
    }
    (at, points.iter().map(|point| error(at, *point).abs()).fold(0.0, f64::max))
}

/// Spectra and their colours.
struct Leaves {
    spectra: Vec<Vec<f64>>,
    colours: Vec<[f64; 3]>,
}

impl Leaves {
    fn new(seed: u64, count: usize, convert: &RgbFromSpectrum) -> Leaves {
        let spectra: Vec<Vec<f64>> = random_states(seed, count).iter().flat_map(reference_spectra).collect();
        let colours = spectra.iter().map(|spectrum| convert.rgb(spectrum)).collect();
        Leaves { spectra, colours }
    }

    /// Sums over all leaves of the products of two wavelengths, in the channel's weights: dark colours count more.
    fn products(&self, channel: usize) -> Vec<Vec<f64>> {
        const DARK: f64 = 0.02;
        let mut sums = vec![vec![0.0; 31]; 31];
        for (spectrum, colour) in self.spectra.iter().zip(&self.colours) {
            let weight = (colour[channel].abs() + DARK).powi(-2);
            for i in 0..31 {
                for j in 0..31 {
                    sums[i][j] += weight * spectrum[i] * spectrum[j];
                }
            }
        }
        sums
    }

    /// CIEDE2000 of each leaf by some bands.
    fn errors(&self, bands: &[usize], shares: &[[f64; 3]]) -> Vec<f64> {
        let colour = |spectrum: &[f64]| {
            let mut rgb = [0.0; 3];
            for (band, share) in bands.iter().zip(shares) {
                rgb.iter_mut().zip(share).for_each(|(sum, share)| *sum += share * spectrum[*band]);
            }
            rgb
        };
        self.spectra.iter().zip(&self.colours).map(|(s, reference)| delta_e00_linear(colour(s), *reference)).collect()
    }
}

/// Shares of the channels in `bands`, fitted with a sum of 1, rounded to the sixth digit.
fn fit_shares(products: &[Vec<Vec<f64>>; 3], all: &[[f64; 3]], bands: &[usize]) -> Vec<[f64; 3]> {
    let n = bands.len();
    let mut shares = vec![[0.0; 3]; n];
    for channel in 0..3 {
        let (mut a, mut b) = (vec![vec![1.0; n + 1]; n + 1], vec![1.0; n + 1]);
        a[n][n] = 0.0;
        for (i, &band) in bands.iter().enumerate() {
            for (j, &other) in bands.iter().enumerate() {
                a[i][j] = products[channel][band][other];
            }
            b[i] = (0..31).map(|other| products[channel][band][other] * all[other][channel]).sum();
        }
        let mut rest = 1.0;
        for (share, value) in shares.iter_mut().zip(solved(a, b)) {
            share[channel] = (value * 1e6).round() / 1e6;
            rest -= share[channel];
        }
        shares[n - 1][channel] += (rest * 1e6).round() / 1e6;
    }
    shares
}

/// Runs the study.
pub fn run(_: &[String]) -> Result<(), Box<dyn Error>> {
    let ([a, q1, q2, q3], error) = fit_theta();
    println!("theta: P {a:.5}, Q {q1:.6} {q2:.6} {q3:.6}, largest error {error:.2e}\n");

    let convert = RgbFromSpectrum::new(RgbBands::Spectral31);
    let one_each = |band: usize| convert.rgb(&(0..31).map(|i| if i == band { 1.0 } else { 0.0 }).collect::<Vec<f64>>());
    let all: Vec<[f64; 3]> = (0..31).map(one_each).collect();
    let (fitted, held_out) = (Leaves::new(1, 2000, &convert), Leaves::new(2, 1500, &convert));
    let products = [0, 1, 2].map(|channel| fitted.products(channel));
    let mut bands: Vec<usize> = (0..31).collect();
    println!("| bands | dE00 mean | max | wavelengths in nm |\n|---|---|---|---|");
    while bands.len() > 6 {
        let without =
            |i: usize| -> Vec<usize> { bands.iter().enumerate().filter(|x| x.0 != i).map(|x| *x.1).collect() };
        let cost = |bands: &[usize]| -> f64 {
            fitted.errors(bands, &fit_shares(&products, &all, bands)).iter().map(|error| error.powi(4)).sum()
        };
        let costs: Vec<f64> = (0..bands.len()).map(|i| cost(&without(i))).collect();
        let least = (0..bands.len()).min_by(|&x, &y| costs[x].total_cmp(&costs[y])).unwrap_or(0);
        bands = without(least);
        let shares = fit_shares(&products, &all, &bands);
        let Spread { mean, max } = Spread::of(held_out.errors(&bands, &shares));
        let nm: Vec<String> = bands.iter().map(|band| (400 + 10 * band).to_string()).collect();
        if bands.len() <= 16 {
            println!("| {} | {mean:.3} | {max:.2} | {} |", bands.len(), nm.join(" "));
        }
        if bands.len() == btf_runtime::testing::BAND_SHARES.len() {
            let lines = nm.iter().zip(&shares).map(|(nm, share)| format!("    ({nm}.0, {share:?}),"));
            eprintln!("{}", lines.collect::<Vec<_>>().join("\n"));
        }
    }
    Ok(())
}

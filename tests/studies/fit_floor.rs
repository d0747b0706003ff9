//! What a fit takes beside the least that it could: `cargo run --release -p btf-tests -- fit_floor CAPTURE...`
//!
//! The floor of a capture is one decode of all its images and `4 texels x samples x 128` floating-point operations (a
//! randomised singular value decomposition of rank 128) at the rate that a matrix product of that shape reaches, both
//! measured here, on the same threads as the fit. Captures of several sizes in one run show how the cost grows.

use btf_capture::Capture;
use btf_fit::{FitParams, Monitor, fit_and_measure, peak_memory_bytes};
use ndarray::Array2;
use rayon::prelude::*;
use std::error::Error;
use std::time::Instant;

/// Bytes a texel: 2 MB for 256 x 256.
const BYTES_PER_TEXEL: f64 = 2e6 / 65_536.0;
/// Rank of the floor's decomposition.
const RANK: usize = 128;
/// Texels that are multiplied at a time.
const BLOCK: usize = 256;

/// Measures the seconds of reading every image once.
fn decode_seconds(capture: &Capture) -> f64 {
    let (start, lights) = (Instant::now(), capture.info().lights.len());
    let pairs = capture.info().pair_count();
    let read = (0..pairs).into_par_iter().filter(|pair| capture.read(pair / lights, pair % lights).is_ok()).count();
    assert_eq!(read, pairs, "every image can be read");
    start.elapsed().as_secs_f64()
}

/// Measures the floating-point operations a second of `[texels, samples] x [samples, rank]`, block by block on all
/// threads.
fn product_rate(samples: usize) -> f64 {
    let directions = Array2::<f32>::from_shape_fn((samples, RANK), |(i, j)| ((i * 7 + j * 13) % 101) as f32 * 0.01);
    let rows = Array2::<f32>::from_shape_fn((BLOCK, samples), |(i, j)| ((i * 11 + j * 5) % 97) as f32 * 0.01);
    let blocks = 8 * rayon::current_num_threads();
    let run = || (0..blocks).into_par_iter().map(|_| f64::from(rows.dot(&directions)[[0, 0]])).sum::<f64>();
    let warm = run();
    let start = Instant::now();
    assert_eq!(run(), warm);
    2.0 * (blocks * BLOCK * samples * RANK) as f64 / start.elapsed().as_secs_f64()
}

/// Runs the study.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    if arguments.is_empty() {
        return Err("fit_floor takes CAPTURE...".into());
    }
    println!(
        "| capture | texels | pairs | decode s | GFLOP/s | floor s | fit s | fit / floor | ns a sample | peak GB |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for path in arguments {
        let capture = Capture::open(path)?;
        let (texels, pairs) = (capture.info().texel_count(), capture.info().pair_count());
        let samples = 3 * pairs;
        let (decode, rate) = (decode_seconds(&capture), product_rate(samples));
        let floor = decode + (4 * texels * samples * RANK) as f64 / rate;
        let params = FitParams {
            bytes: Some((texels as f64 * BYTES_PER_TEXEL) as u64),
            cache_directory: std::env::temp_dir(),
            ..FitParams::default()
        };
        let (start, monitor) = (Instant::now(), Monitor::default());
        let fitted = params.check().and_then(|params| fit_and_measure(&[capture], &params, &monitor));
        fitted.map_err(|error| format!("{path}: {error}"))?;
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "| {path} | {texels} | {pairs} | {decode:.1} | {:.0} | {floor:.1} | {seconds:.1} | {:.1} | {:.1} | {:.2} |",
            rate / 1e9,
            seconds / floor,
            seconds * 1e9 / (texels * samples) as f64,
            peak_memory_bytes().unwrap_or(0) as f64 / 1e9
        );
        let stages: Vec<String> = monitor.stages().iter().map(|s| format!("{} {:.1}", s.name, s.seconds)).collect();
        println!("<!-- {} -->", stages.join(", "));
    }
    Ok(())
}

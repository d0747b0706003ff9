//! A look at a few images of a capture: how long they take to decode, and how much detail they have.

use crate::error::FitError;
use btf_capture::{Capture, Pixels};
use cpu_time::ThreadTime;

/// Views of which images are decoded, and images of each.
const VIEWS: usize = 3;
const IMAGES: usize = 3;
/// Images of a view that a container decodes together at most.
const TOGETHER: usize = 256;
/// Values that a code of 8 bits tells apart.
const CODES: f64 = 255.0;

/// What a few images tell of all of a capture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageProbe {
    /// Seconds of a processor that all images take to decode once.
    pub decoding_s: f64,
    /// Root mean square of the difference between neighbouring texels of a row, gamma-encoded, above 0: about the rounding of 8
    /// bits at least.
    pub detail: f64,
    /// Bytes in which a sample of a decoded image is kept: 1 for a file's own codes, else 2.
    pub sample_bytes: usize,
}

impl ImageProbe {
    /// Decodes a few images of `capture`.
    ///
    /// # Errors
    /// If one of them cannot be read.
    pub fn of_capture(capture: &Capture) -> Result<ImageProbe, FitError> {
        let info = capture.info();
        let lights = info.lights.len();
        let present: Vec<usize> = info.present_pairs().collect();
        let container = capture.container().is_some();
        let run = if container { TOGETHER.min(lights) } else { IMAGES };
        let (mut seconds, mut images, mut sample_bytes) = (0.0, 0, 1);
        let (mut squares, mut differences) = (0.0, 0);
        for number in 0..VIEWS {
            let middle = (2 * number + 1) * present.len() / (2 * VIEWS);
            // A container decodes the lights of a view together, from the first on.
            let first = if container { middle / lights * lights } else { middle };
            for (count, pair) in present[first..].iter().take(run).enumerate() {
                let start = ThreadTime::now();
                let pixels = capture.read(pair / lights, pair % lights)?;
                seconds += start.elapsed().as_secs_f64();
                images += 1;
                if matches!(pixels, Pixels::Linear(_)) {
                    sample_bytes = 2;
                }
                if count < IMAGES {
                    let (sum, some) = squared_differences(&pixels, info.width);
                    (squares, differences) = (squares + sum, differences + some);
                }
            }
        }
        let mean = squares / differences.max(1) as f64;
        Ok(ImageProbe {
            decoding_s: seconds / images.max(1) as f64 * present.len() as f64,
            detail: (mean + CODES.powi(-2)).sqrt(),
            sample_bytes,
        })
    }
}

/// Returns the sum of the squared differences between neighbours along rows, and their number.
fn squared_differences(pixels: &Pixels, width: usize) -> (f64, usize) {
    let codes: Vec<f64> = match pixels {
        Pixels::Encoded8(codes) => codes.iter().map(|code| f64::from(*code) / CODES).collect(),
        Pixels::Linear(values) => values.iter().map(|value| f64::from(value.clamp(0.0, 1.0)).powf(1.0 / 2.2)).collect(),
    };
    let mut found = (0.0, 0);
    for row in codes.chunks_exact(3 * width) {
        for (left, right) in row.iter().zip(&row[3..]) {
            found = (found.0 + (left - right).powi(2), found.1 + 1);
        }
    }
    found
}

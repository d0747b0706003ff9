//! The error of a decoded asset against the capture it was fitted from.
//!
//! Image by image: each image of the capture is read once, the same pair is decoded for all texels, and
//! the differences are summed. Memory: a batch of images beside one number per texel and per pair.

use crate::ciede::{LabConverter, delta_e00};
use crate::error::FitError;
use crate::image_decoder::{ImageDecoder, PairPlan, Spot};
use crate::material::sides_of_capture;
use crate::metrics::{ErrorSums, Metrics, psnr_db_from_codes};
use crate::monitor::Monitor;
use btf_capture::{Capture, CaptureInfo, Encoder8, ImageFormat, Pixels};
use btf_runtime::{Asset, DecodeOptions, Interpolation, Resident};
use rayon::prelude::*;
use std::ops::Range;

/// Texels that one thread works on at a time. Sums are taken per block and then in the order of the
/// blocks, so this number, not the number of threads, decides how they round.
const BLOCK_TEXELS: usize = 1024;

/// About how many pairs the colour difference is taken over.
const COLOUR_PAIRS: usize = 256;

/// Most images held at a time.
const MOST_BATCH: usize = 64;

/// What [`measure`] should do.
#[derive(Debug, Clone)]
pub struct MeasureParams {
    /// Layer of the asset.
    pub layer: usize,
    /// Components, lobes and, for directions that the asset has not measured, the interpolation rule.
    pub options: DecodeOptions,
    /// The pairs to measure (`view * lights + light`, ascending); `None` for all.
    pub pairs: Option<Vec<usize>>,
    /// Memory limit in bytes; the batch of images takes at most an eighth of it.
    pub memory_bytes: u64,
}

impl Default for MeasureParams {
    /// Layer 0 as well as it can be decoded, all pairs, 4 GB.
    fn default() -> MeasureParams {
        MeasureParams {
            layer: 0,
            options: DecodeOptions { interpolation: Interpolation::Exact, ..DecodeOptions::default() },
            pairs: None,
            memory_bytes: 4_000_000_000,
        }
    }
}

/// Error of one layer, whole and by texel and pair.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Texels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Number of views of the capture.
    pub views: usize,
    /// Number of lights of the capture.
    pub lights: usize,
    /// The pairs that were measured.
    pub pairs: Vec<usize>,
    /// True where the capture has directions that the asset has not measured.
    pub interpolated: bool,
    /// Everything summed.
    pub sums: ErrorSums,
    /// Per texel the sum of squared differences of 8-bit values.
    pub texel_code_error: Vec<u64>,
    /// Per texel the sum of squared linear differences.
    pub texel_linear_error: Vec<f64>,
    /// Per pair the sum of squared differences of 8-bit values; 0 for a pair that was not measured.
    pub pair_code_error: Vec<u64>,
}

impl Comparison {
    /// The figures.
    pub fn metrics(&self) -> Metrics {
        self.sums.metrics()
    }

    /// `psnr_db` of the measured pairs among `pairs`; `None` if there are none.
    pub fn psnr_of_pairs(&self, pairs: impl IntoIterator<Item = usize>) -> Option<f64> {
        let measured = self.is_measured();
        let (mut count, mut error) = (0, 0);
        for pair in pairs.into_iter().filter(|pair| measured[*pair]) {
            count += 1;
            error += self.pair_code_error[pair];
        }
        (count > 0).then(|| psnr_db_from_codes(error, count * self.texel_code_error.len() as u64 * 3))
    }

    /// `psnr_db` of each view over its lights.
    pub fn psnr_by_view(&self) -> Vec<Option<f64>> {
        let lights = self.lights;
        (0..self.views).map(|view| self.psnr_of_pairs(view * lights..(view + 1) * lights)).collect()
    }

    /// `psnr_db` of each light over its views.
    pub fn psnr_by_light(&self) -> Vec<Option<f64>> {
        (0..self.lights).map(|light| self.psnr_of_pairs((light..self.views * self.lights).step_by(self.lights))).collect()
    }

    /// Root mean square error per texel, in steps of 8-bit values.
    pub fn texel_rmse_codes(&self) -> Vec<f32> {
        let samples = self.samples_per_texel();
        self.texel_code_error.iter().map(|error| (*error as f64 / samples).sqrt() as f32).collect()
    }

    /// Root mean square error per texel, linear.
    pub fn texel_rmse_linear(&self) -> Vec<f32> {
        let samples = self.samples_per_texel();
        self.texel_linear_error.iter().map(|error| (error / samples).sqrt() as f32).collect()
    }

    /// Root mean square error per pair, in steps of 8-bit values; `None` for pairs not measured.
    pub fn pair_rmse_codes(&self) -> Vec<Option<f32>> {
        let samples = (self.texel_code_error.len() * 3) as f64;
        let measured = self.is_measured();
        let rmse = |pair: usize| (self.pair_code_error[pair] as f64 / samples).sqrt() as f32;
        (0..self.views * self.lights).map(|pair| measured[pair].then(|| rmse(pair))).collect()
    }

    fn samples_per_texel(&self) -> f64 {
        (self.pairs.len() * 3) as f64
    }

    fn is_measured(&self) -> Vec<bool> {
        let mut measured = vec![false; self.views * self.lights];
        self.pairs.iter().for_each(|pair| measured[*pair] = true);
        measured
    }
}

/// The colour difference is taken over the pairs whose index is a multiple of this: about 256 of them,
/// and, the stride being prime to the number of lights, over all lights and views alike.
pub fn colour_pair_stride(views: usize, lights: usize) -> usize {
    let least = (views * lights / COLOUR_PAIRS).max(1);
    let common = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    (least..).find(|stride| common(*stride, lights) == 1).unwrap_or(least)
}

/// The layer of `asset` whose sides of light and eye are those of the capture.
///
/// # Errors
/// One sentence if it has none.
pub fn layer_for_capture(info: &CaptureInfo, asset: &Asset) -> Result<usize, FitError> {
    let sides = sides_of_capture(info.side);
    asset.layers.iter().position(|layer| (layer.light_side, layer.view_side) == sides).ok_or_else(|| {
        FitError::Params(format!(
            "the asset has no layer for the capture's side `{}`; compare it with a capture of a side that it holds",
            info.side
        ))
    })
}

/// Measures the asset against `capture`, reading each of its images once.
///
/// `resident` must be `asset`'s. Directions of the capture within 0.01 degrees of the asset's are
/// decoded as measured ones, others are interpolated. Cost: about 20 ns a sample and core beside the
/// reading of the images.
///
/// # Errors
/// If the sizes differ, an image cannot be read, or the monitor was cancelled.
pub fn measure(
    capture: &Capture,
    asset: &Asset,
    resident: &Resident,
    params: &MeasureParams,
    monitor: &Monitor,
) -> Result<Comparison, FitError> {
    measure_images(capture.info(), &|view, light| Ok(capture.read(view, light)?), asset, resident, params, monitor)
}

/// The same with the images from `read(view, light)`, which threads call at the same time: for images
/// that are at hand already.
///
/// # Errors
/// As [`measure`].
pub fn measure_images(
    info: &CaptureInfo,
    read: &(dyn Fn(usize, usize) -> Result<Pixels, FitError> + Sync),
    asset: &Asset,
    resident: &Resident,
    params: &MeasureParams,
    monitor: &Monitor,
) -> Result<Comparison, FitError> {
    if (info.width, info.height) != (asset.width, asset.height) {
        return Err(FitError::Params(format!(
            "the capture {} has {} x {} texels and the asset {} x {}; compare an asset with the capture that it was fitted from",
            info.name, info.width, info.height, asset.width, asset.height
        )));
    }
    let layer = &asset.layers[params.layer];
    let (texels, lights) = (info.texel_count(), info.lights.len());
    let view_spots = Spot::of_set(&layer.views, &info.views);
    let light_spots = Spot::of_set(&layer.lights, &info.lights);
    let decoder = ImageDecoder::new(asset, resident, params.layer, &params.options);
    let coding = Coding::new(info);
    let pairs: Vec<usize> = params.pairs.clone().unwrap_or_else(|| (0..info.pair_count()).collect());
    let stride = colour_pair_stride(info.views.len(), lights);

    let mut blocks: Vec<Block> = (0..texels)
        .step_by(BLOCK_TEXELS)
        .map(|first| Block::new(first..(first + BLOCK_TEXELS).min(texels)))
        .collect();
    let mut pair_code_error = vec![0; info.pair_count()];
    // A linear image is held in single precision.
    let batch = ((params.memory_bytes / 8) as usize / (texels * 12)).clamp(1, MOST_BATCH);
    for (done, batch_pairs) in pairs.chunks(batch).enumerate() {
        monitor.report("measure", done * batch, pairs.len())?;
        let work: Vec<Work> = batch_pairs
            .par_iter()
            .map(|&pair| {
                monitor.check()?;
                let (view, light) = (pair / lights, pair % lights);
                let plan = decoder.plan(view_spots[view], light_spots[light]);
                Ok(Work { light, plan, pixels: read(view, light)?, colour: pair % stride == 0 })
            })
            .collect::<Result<_, FitError>>()?;
        let errors: Vec<Vec<u64>> = blocks.par_iter_mut().map(|block| block.take(&decoder, &coding, &work)).collect();
        for block_errors in errors {
            for (pair, error) in batch_pairs.iter().zip(block_errors) {
                pair_code_error[*pair] += error;
            }
        }
    }
    monitor.report("measure", pairs.len(), pairs.len())?;

    let per_texel = (pairs.len() * 3) as f64;
    let mut sums = ErrorSums { samples: (texels * pairs.len() * 3) as u64, ..ErrorSums::default() };
    for block in &blocks {
        sums.add(&block.sums);
    }
    let texel_linear_error: Vec<f64> = blocks.iter().flat_map(|block| block.linear_error.iter().copied()).collect();
    sums.linear_error = texel_linear_error.iter().sum();
    sums.worst_texel = texel_linear_error.iter().fold(0.0f64, |worst, error| worst.max(error / per_texel));
    sums.code_error = pair_code_error.iter().sum();
    Ok(Comparison {
        width: info.width,
        height: info.height,
        views: info.views.len(),
        lights,
        pairs,
        interpolated: view_spots.iter().chain(&light_spots).any(|spot| matches!(spot, Spot::Other(_))),
        sums,
        texel_code_error: blocks.iter().flat_map(|block| block.code_error.iter().copied()).collect(),
        texel_linear_error,
        pair_code_error,
    })
}

/// One pair of a batch.
struct Work {
    light: usize,
    plan: PairPlan,
    pixels: Pixels,
    /// Whether the colour difference is taken here.
    colour: bool,
}

/// How samples become 8-bit values and back, and those colours.
struct Coding {
    encoder: Encoder8,
    /// Per light.
    tables: Vec<[f32; 256]>,
    lab: LabConverter,
}

impl Coding {
    fn new(info: &CaptureInfo) -> Coding {
        // Linear images have no 8-bit values of their own; they get those of a PNG of the same capture.
        let info = if info.format == ImageFormat::Exr { info.in_format(ImageFormat::Png) } else { info.clone() };
        Coding {
            encoder: Encoder8::new(&info),
            tables: (0..info.lights.len()).map(|light| info.linear_from_encoded8(light)).collect(),
            lab: LabConverter::new(info.transfer),
        }
    }
}

/// A block of texels with its sums so far.
struct Block {
    texels: Range<usize>,
    code_error: Vec<u64>,
    linear_error: Vec<f64>,
    sums: ErrorSums,
}

impl Block {
    fn new(texels: Range<usize>) -> Block {
        let count = texels.len();
        Block { texels, code_error: vec![0; count], linear_error: vec![0.0; count], sums: ErrorSums::default() }
    }

    /// Adds a batch; the squared differences of 8-bit values of each of its pairs come back.
    fn take(&mut self, decoder: &ImageDecoder, coding: &Coding, batch: &[Work]) -> Vec<u64> {
        let count = self.texels.len();
        let block = decoder.block(self.texels.clone());
        let mut decoded = vec![0.0; count * 3];
        let mut decoded_codes = vec![0; count * 3];
        let mut original = vec![0.0; count * 3];
        let mut original_codes = vec![0; count * 3];
        let samples = self.texels.start * 3..self.texels.end * 3;
        batch
            .iter()
            .map(|work| {
                decoder.decode(&block, &work.plan, &mut decoded);
                coding.encoder.encode_slice(work.light, &decoded, &mut decoded_codes);
                match &work.pixels {
                    Pixels::Encoded8(codes) => {
                        original_codes.copy_from_slice(&codes[samples.clone()]);
                        let table = &coding.tables[work.light];
                        for (linear, code) in original.iter_mut().zip(&original_codes) {
                            *linear = table[usize::from(*code)];
                        }
                    }
                    Pixels::Linear(values) => {
                        original.copy_from_slice(&values[samples.clone()]);
                        coding.encoder.encode_slice(work.light, &original, &mut original_codes);
                    }
                }
                if work.colour {
                    self.add_colours(&coding.lab, &original_codes, &decoded_codes);
                }
                self.add_linear(&original, &decoded);
                self.add_codes(&original_codes, &decoded_codes)
            })
            .collect()
    }

    fn add_codes(&mut self, original: &[u8], decoded: &[u8]) -> u64 {
        let mut total = 0;
        for ((sum, x), y) in self.code_error.iter_mut().zip(original.chunks_exact(3)).zip(decoded.chunks_exact(3)) {
            let error: u32 = (0..3).map(|c| u32::from(x[c].abs_diff(y[c])).pow(2)).sum();
            *sum += u64::from(error);
            total += u64::from(error);
        }
        total
    }

    fn add_linear(&mut self, original: &[f32], decoded: &[f32]) {
        let mut peak = 0.0f32;
        let mut square = 0.0;
        for ((sum, x), y) in self.linear_error.iter_mut().zip(original.chunks_exact(3)).zip(decoded.chunks_exact(3)) {
            for c in 0..3 {
                let error = f64::from(y[c]) - f64::from(x[c]);
                *sum += error * error;
                square += f64::from(x[c]) * f64::from(x[c]);
                peak = peak.max(x[c]);
            }
        }
        self.sums.linear_square += square;
        self.sums.linear_peak = self.sums.linear_peak.max(peak.into());
    }

    fn add_colours(&mut self, lab: &LabConverter, original: &[u8], decoded: &[u8]) {
        for (x, y) in original.chunks_exact(3).zip(decoded.chunks_exact(3)) {
            if x != y {
                self.sums.delta_e00 += delta_e00(lab.lab([x[0], x[1], x[2]]), lab.lab([y[0], y[1], y[2]]));
            }
            self.sums.colours += 1;
        }
    }
}

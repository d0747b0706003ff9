//! Error of a decoded asset against the capture it was fitted from.
//!
//! Batch by batch: each image of the capture is read once and cut into the decoder's tiles; then every tile is
//! decoded at all pairs of the batch and the differences are summed. Memory: a batch of images beside a few numbers
//! per texel and per pair, and a byte per texel and component.

use crate::error::FitError;
use crate::gpu::fit_gpu::FitGpu;
use crate::input::layer_frame::{side_of_layer, sides_of_capture, turn_channels, turn_map};
use crate::input::pair_stride::stride_over_pairs;
use crate::input::tone_curve::ToneCurve;
use crate::measure::batch_errors::BatchErrors;
use crate::measure::batch_sizes::BatchSizes;
use crate::measure::gpu_errors::MAX_PAIRS;
use crate::measure::image_decoder::{ImageDecoder, Spot};
use crate::measure::tile_errors::{Coding, PairWork, TiledImage};
use crate::metrics::{ErrorSums, Metrics, psnr_db_from_codes};
use crate::monitor::Monitor;
use crate::resume::stored::stored_structs;
use btf_capture::{Capture, CaptureInfo, Pixels};
use btf_runtime::{Asset, DecodeOptions, Interpolation, Resident, SingleBases};
use rayon::prelude::*;
use std::sync::Arc;

/// Number of pairs that the colour difference is taken over, about.
const COLOUR_PAIRS: usize = 256;
/// Number of colours that the colour difference is taken over at least, or all of the chosen pairs' colours: every n-th
/// texel of a tile.
const COLOURS: usize = 4_000_000;

/// Parameters of [`measure`].
#[derive(Debug, Clone)]
pub struct MeasureParams {
    /// Layer of the asset.
    pub layer: usize,
    /// Stride of the pairs whose colour differences are taken; `None`: [`colour_pair_stride`]; 0: no pairs.
    pub colour_stride: Option<usize>,
    /// Components and lobes to decode and, for directions that the asset has not measured, the interpolation rule.
    pub options: DecodeOptions,
    /// The pairs to measure (`view * lights + light`, ascending); `None` for all. Pairs without an image are left out.
    pub pairs: Option<Vec<usize>>,
    /// Memory limit in bytes; the batch of images takes at most an eighth of it.
    pub memory_bytes: u64,
    /// Bases of the same asset to decode with, in place of those of the resident form.
    pub bases: Option<Arc<SingleBases>>,
}

impl MeasureParams {
    /// Returns the decoder of what is measured. `resident` must be `asset`'s.
    pub(crate) fn decoder<'a>(&'a self, asset: &'a Asset, resident: &'a Resident) -> ImageDecoder<'a> {
        let decoder = ImageDecoder::new(asset, resident, self.layer, &self.options);
        match &self.bases {
            Some(bases) => decoder.with_single_bases(bases),
            None => decoder,
        }
    }
}

impl Default for MeasureParams {
    /// Returns the parameters that measure all pairs of layer 0, decoded as well as possible, within 4 GB.
    fn default() -> MeasureParams {
        MeasureParams {
            layer: 0,
            colour_stride: None,
            options: DecodeOptions { interpolation: Interpolation::Exact, ..DecodeOptions::default() },
            pairs: None,
            memory_bytes: 4_000_000_000,
            bases: None,
        }
    }
}

/// Error of one layer, in all and by texel and pair. Texels, views and lights are numbered as in the capture, also
/// where that is turned over.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Texels per row.
    pub width: usize,
    /// Number of rows of texels.
    pub height: usize,
    /// Number of views of the capture.
    pub views: usize,
    /// Number of lights of the capture.
    pub lights: usize,
    /// Pairs that were measured, `view * lights + light`.
    pub pairs: Vec<usize>,
    /// Whether the capture has directions that the asset has not measured.
    pub interpolated: bool,
    /// Sums of all errors.
    pub sums: ErrorSums,
    /// Sum of squared differences of 8-bit values, per texel.
    pub texel_code_error: Vec<u64>,
    /// Sum of squared linear differences, per texel.
    pub texel_linear_error: Vec<f64>,
    /// Sum of squared differences of 8-bit values, per pair; 0 for a pair that was not measured.
    pub pair_code_error: Vec<u64>,
    /// Samples of a texel at a pair: three channels, or bands.
    pub channels: usize,
}

stored_structs! {
    Comparison {
        width, height, views, lights, pairs, interpolated, sums, texel_code_error, texel_linear_error, pair_code_error, channels,
    }
}

impl Comparison {
    /// Returns the figures of all measured pairs.
    pub fn metrics(&self) -> Metrics {
        self.sums.metrics()
    }

    /// Returns `psnr_db` of the measured pairs among `pairs`; `None` if there are none.
    pub fn psnr_of_pairs(&self, pairs: impl IntoIterator<Item = usize>) -> Option<f64> {
        let measured = self.is_measured();
        let (mut count, mut error) = (0, 0);
        for pair in pairs.into_iter().filter(|pair| measured[*pair]) {
            count += 1;
            error += self.pair_code_error[pair];
        }
        (count > 0).then(|| psnr_db_from_codes(error, count * (self.texel_code_error.len() * self.channels) as u64))
    }

    /// Returns `psnr_db` of each view over its lights.
    pub fn psnr_by_view(&self) -> Vec<Option<f64>> {
        let lights = self.lights;
        (0..self.views).map(|view| self.psnr_of_pairs(view * lights..(view + 1) * lights)).collect()
    }

    /// Returns `psnr_db` of each light over its views.
    pub fn psnr_by_light(&self) -> Vec<Option<f64>> {
        (0..self.lights)
            .map(|light| self.psnr_of_pairs((light..self.views * self.lights).step_by(self.lights)))
            .collect()
    }

    /// Returns the root mean square error of each texel in steps of 8-bit values.
    pub fn texel_rmse_codes(&self) -> Vec<f32> {
        let samples = self.samples_per_texel();
        self.texel_code_error.iter().map(|error| (*error as f64 / samples).sqrt() as f32).collect()
    }

    /// Returns the root mean square error of each texel, linear.
    pub fn texel_rmse_linear(&self) -> Vec<f32> {
        let samples = self.samples_per_texel();
        self.texel_linear_error.iter().map(|error| (error / samples).sqrt() as f32).collect()
    }

    /// Returns the root mean square error of each pair in steps of 8-bit values; `None` for pairs not measured.
    pub fn pair_rmse_codes(&self) -> Vec<Option<f32>> {
        let samples = (self.texel_code_error.len() * self.channels) as f64;
        let measured = self.is_measured();
        let rmse = |pair: usize| (self.pair_code_error[pair] as f64 / samples).sqrt() as f32;
        (0..self.views * self.lights).map(|pair| measured[pair].then(|| rmse(pair))).collect()
    }

    fn samples_per_texel(&self) -> f64 {
        (self.pairs.len() * self.channels) as f64
    }

    fn is_measured(&self) -> Vec<bool> {
        let mut measured = vec![false; self.views * self.lights];
        self.pairs.iter().for_each(|pair| measured[*pair] = true);
        measured
    }
}

/// Returns the stride of the pairs that the colour difference is taken over: about 256 pairs and, because the stride is
/// coprime to the number of lights, all lights and views alike.
pub fn colour_pair_stride(views: usize, lights: usize) -> usize {
    stride_over_pairs((views * lights / COLOUR_PAIRS).max(1), lights)
}

/// Returns the layer of `asset` whose sides of light and eye are those of the capture.
///
/// # Errors
/// One sentence if it has none.
pub fn layer_for_capture(info: &CaptureInfo, asset: &Asset) -> Result<usize, FitError> {
    let sides = sides_of_capture(info.side);
    asset.layers.iter().position(|layer| (layer.light_side, layer.view_side) == sides).ok_or_else(|| {
        FitError::Params(format!(
            "the asset has no layer for the side `{}` of the capture {}, it holds {}; compare it with a capture of a side that it holds, or correct `side` in capture.toml",
            info.side,
            info.name,
            side_words(asset)
        ))
    })
}

/// Returns the sides of an asset's layers, in the words of `capture.toml`.
pub fn side_words(asset: &Asset) -> String {
    asset.layers.iter().map(|layer| format!("`{}`", side_of_layer(layer))).collect::<Vec<_>>().join(", ")
}

/// Measures the asset against `capture`, reading each of its images once.
///
/// `resident` must be `asset`'s. Directions of the capture within 0.01 degrees of the asset's are
/// decoded as measured ones, others are interpolated. Cost: about 3 ns and 0.1 ns per component
/// a sample and core beside the reading of the images.
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

/// Measures the asset with images from `read(view, light)`, which threads call at the same time: for images that are in
/// memory already. [`measure`] reads the files.
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
    measure_decoder(&CaptureImages::new(info, read)?, asset, &params.decoder(asset, resident), params, None, monitor)
}

/// A capture whose images come from a function.
pub(crate) struct CaptureImages<'a> {
    /// Directions, size and format.
    pub info: &'a CaptureInfo,
    /// Function that returns the image of a view and a light, with the values of a texel that the decoder gives.
    pub read: &'a (dyn Fn(usize, usize) -> Result<Pixels, FitError> + Sync),
    /// Tone curve of the capture.
    pub tone_curve: Option<ToneCurve>,
}

impl<'a> CaptureImages<'a> {
    /// Finds the tone curve of the capture.
    ///
    /// # Errors
    /// If an image cannot be read.
    pub fn new(
        info: &'a CaptureInfo,
        read: &'a (dyn Fn(usize, usize) -> Result<Pixels, FitError> + Sync),
    ) -> Result<CaptureImages<'a>, FitError> {
        Ok(CaptureImages { info, read, tone_curve: ToneCurve::of_capture(info, read)? })
    }
}

/// Measures with a `decoder` of layer `params.layer` of `asset`, on `gpu` where that is quicker; the decoder's options count
/// instead of `params.options`. Images of pairs that are not measured are not read.
pub(crate) fn measure_decoder(
    images: &CaptureImages,
    asset: &Asset,
    decoder: &ImageDecoder,
    params: &MeasureParams,
    gpu: Option<&FitGpu>,
    monitor: &Monitor,
) -> Result<Comparison, FitError> {
    let CaptureImages { info, read, tone_curve } = *images;
    if (info.width, info.height) != (asset.width, asset.height) {
        return Err(FitError::Params(format!(
            "the capture {} has {} x {} texels and the asset {} x {}; compare an asset with the capture that it was fitted from",
            info.name, info.width, info.height, asset.width, asset.height
        )));
    }
    let layer = &asset.layers[params.layer];
    let (texels, lights, values) = (info.texel_count(), info.lights.len(), decoder.values());
    let view_spots = Spot::of_set(&layer.views, &info.views, info.side);
    let light_spots = Spot::of_set(&layer.lights, &info.lights, info.side);
    let coding = Coding::new(info, tone_curve);
    let pairs: Vec<usize> = match &params.pairs {
        Some(pairs) => pairs.iter().copied().filter(|pair| info.has_image(*pair)).collect(),
        None => info.present_pairs().collect(),
    };
    let stride = params.colour_stride.unwrap_or_else(|| colour_pair_stride(info.views.len(), lights));
    let texel_stride = (texels * pairs.len().div_ceil(stride.max(1)) / COLOURS).max(1);

    // A linear image is held in single precision.
    let batch_bytes = (params.memory_bytes / 8) as usize;
    let batch = (batch_bytes / (texels * 12 * decoder.sets())).clamp(1, MAX_PAIRS).min(pairs.len().max(1));
    let sizes = BatchSizes {
        lights,
        pairs: info.pair_count(),
        measured: pairs.len(),
        batch,
        memory_bytes: params.memory_bytes / 4,
    };
    // An adapter gives the channels as they are.
    let mut errors = BatchErrors::new(decoder, &coding, sizes, gpu.filter(|_| !decoder.is_spectral()));
    for (done, batch_pairs) in pairs.chunks(batch).enumerate() {
        monitor.report("measure", done * batch, pairs.len())?;
        let work: Vec<PairWork> = batch_pairs
            .par_iter()
            .map(|&pair| {
                monitor.check()?;
                let (view, light) = (pair / lights, pair % lights);
                let plan = decoder.plan(view_spots[view], light_spots[light]);
                let mut pixels = read(view, light)?;
                match &mut pixels {
                    Pixels::Encoded8(codes) => turn_channels(codes, values, info.width, info.side),
                    Pixels::Linear(linear) => turn_channels(linear, values, info.width, info.side),
                }
                let images = TiledImage::sets_of(&pixels, values, decoder.tiles());
                let colour_every = (stride > 0 && pair % stride == 0).then_some(texel_stride);
                Ok(PairWork { pair, light, plan, images, colour_every })
            })
            .collect::<Result<_, FitError>>()?;
        errors.take(work);
    }
    let (tile_errors, pair_code_error) = errors.finish();
    monitor.report("measure", pairs.len(), pairs.len())?;

    let per_texel = (pairs.len() * values) as f64;
    let mut sums = ErrorSums { samples: (texels * pairs.len() * values) as u64, tone_curve, ..ErrorSums::default() };
    let (mut texel_linear_error, mut texel_code_error) = (vec![0.0; texels], vec![0; texels]);
    for (tile, errors) in decoder.tiles().iter().zip(&tile_errors) {
        sums.add(&errors.sums());
        for (i, texel) in tile.texels.iter().enumerate() {
            texel_linear_error[*texel as usize] = errors.linear_error[i];
            texel_code_error[*texel as usize] = errors.code_error[i];
        }
    }
    sums.linear_error = texel_linear_error.iter().sum();
    sums.worst_texel = texel_linear_error.iter().fold(0.0f64, |worst, error| worst.max(error / per_texel));
    sums.code_error = pair_code_error.iter().sum();
    turn_map(&mut texel_linear_error, info.width, info.side);
    turn_map(&mut texel_code_error, info.width, info.side);
    Ok(Comparison {
        width: info.width,
        height: info.height,
        views: info.views.len(),
        lights,
        pairs,
        interpolated: view_spots.iter().chain(&light_spots).any(|spot| matches!(spot, Spot::Other(_))),
        sums,
        texel_code_error,
        texel_linear_error,
        pair_code_error,
        channels: values,
    })
}

#[cfg(test)]
mod tests;

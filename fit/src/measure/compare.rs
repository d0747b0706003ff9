//! The error of a decoded asset against the capture it was fitted from.
//!
//! Batch by batch: each image of the capture is read once and cut into the decoder's tiles; then every tile is
//! decoded at all pairs of the batch and the differences are summed. Memory: a batch of images beside a few numbers
//! per texel and per pair, and a byte per texel and component.

use crate::error::FitError;
use crate::input::layer_frame::{side_of_layer, sides_of_capture, turn_image, turn_map};
use crate::input::pair_stride::stride_over_pairs;
use crate::measure::image_decoder::{ImageDecoder, Spot};
use crate::measure::tile_errors::{Coding, PairWork, TileErrors, TiledImage};
use crate::metrics::{ErrorSums, Metrics, psnr_db_from_codes};
use crate::monitor::Monitor;
use crate::resume::stored::stored_structs;
use btf_capture::{Capture, CaptureInfo, Pixels};
use btf_runtime::{Asset, DecodeOptions, Interpolation, Resident};
use rayon::prelude::*;

/// About how many pairs the colour difference is taken over.
const COLOUR_PAIRS: usize = 256;
/// At least so many colours it is taken over, or all of those pairs': every n-th texel of a tile.
const COLOURS: usize = 4_000_000;

/// Most images held at a time.
const MAX_BATCH: usize = 64;

/// What [`measure`] should do.
#[derive(Debug, Clone)]
pub struct MeasureParams {
    /// Layer of the asset.
    pub layer: usize,
    /// Colour differences are taken of pairs whose index is a multiple of this; `None`: of
    /// [`colour_pair_stride`]; 0: of none.
    pub colour_stride: Option<usize>,
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
            colour_stride: None,
            options: DecodeOptions { interpolation: Interpolation::Exact, ..DecodeOptions::default() },
            pairs: None,
            memory_bytes: 4_000_000_000,
        }
    }
}

/// Error of one layer, whole and by texel and pair. Texels, views and lights are numbered as the capture
/// has them, also where it is turned over.
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

stored_structs! {
    Comparison {
        width, height, views, lights, pairs, interpolated, sums, texel_code_error, texel_linear_error, pair_code_error,
    }
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
        (0..self.lights)
            .map(|light| self.psnr_of_pairs((light..self.views * self.lights).step_by(self.lights)))
            .collect()
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
    stride_over_pairs((views * lights / COLOUR_PAIRS).max(1), lights)
}

/// The layer of `asset` whose sides of light and eye are those of the capture.
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

/// The sides of an asset's layers, in the words of `capture.toml`.
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
    let decoder = ImageDecoder::new(asset, resident, params.layer, &params.options);
    measure_decoder(info, read, asset, &decoder, params, monitor)
}

/// The same with a decoder of layer `params.layer` of `asset`, whose options count instead of `params.options`.
pub(crate) fn measure_decoder(
    info: &CaptureInfo,
    read: &(dyn Fn(usize, usize) -> Result<Pixels, FitError> + Sync),
    asset: &Asset,
    decoder: &ImageDecoder,
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
    let view_spots = Spot::of_set(&layer.views, &info.views, info.side);
    let light_spots = Spot::of_set(&layer.lights, &info.lights, info.side);
    let coding = Coding::new(info);
    let pairs: Vec<usize> = params.pairs.clone().unwrap_or_else(|| (0..info.pair_count()).collect());
    let stride = params.colour_stride.unwrap_or_else(|| colour_pair_stride(info.views.len(), lights));
    let texel_stride = (texels * pairs.len().div_ceil(stride.max(1)) / COLOURS).max(1);

    let mut tile_errors = vec![TileErrors::default(); decoder.tiles().len()];
    let mut pair_code_error = vec![0; info.pair_count()];
    // A linear image is held in single precision.
    let batch = ((params.memory_bytes / 8) as usize / (texels * 12)).clamp(1, MAX_BATCH);
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
                    Pixels::Encoded8(codes) => turn_image(codes, info.width, info.side),
                    Pixels::Linear(values) => turn_image(values, info.width, info.side),
                }
                let image = TiledImage::new(&pixels, decoder.tiles());
                let colour_every = (stride > 0 && pair % stride == 0).then_some(texel_stride);
                Ok(PairWork { light, plan, image, colour_every })
            })
            .collect::<Result<_, FitError>>()?;
        let errors: Vec<Vec<u64>> = tile_errors
            .par_iter_mut()
            .enumerate()
            .map(|(number, errors)| errors.take(decoder, number, &coding, &work))
            .collect();
        for errors in errors {
            for (pair, error) in batch_pairs.iter().zip(errors) {
                pair_code_error[*pair] += error;
            }
        }
    }
    monitor.report("measure", pairs.len(), pairs.len())?;

    let per_texel = (pairs.len() * 3) as f64;
    let mut sums = ErrorSums { samples: (texels * pairs.len() * 3) as u64, ..ErrorSums::default() };
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
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_asset::{number, sample_asset_with};
    use btf_capture::{CaptureWriter, DirectionSet, ImageFormat, Transfer};
    use btf_capture::{LabConverter, delta_e00};
    use btf_runtime::{ResidualKind, decode, pack};
    use std::path::Path;

    const WIDTH: usize = 41;
    const HEIGHT: usize = 30;

    fn sets() -> (DirectionSet, DirectionSet) {
        (DirectionSet::random(4, 3).unwrap(), DirectionSet::random(5, 4).unwrap())
    }

    /// More texels than one tile of a cluster holds.
    fn asset() -> Asset {
        let (views, lights) = sets();
        let asset = sample_asset_with(WIDTH, HEIGHT, &views, &lights, ResidualKind::Root);
        Asset::parse(&pack(&asset).unwrap()).unwrap()
    }

    /// What the asset decodes to, disturbed.
    fn capture(dir: &Path, format: ImageFormat, views: &DirectionSet, lights: &DirectionSet) -> Capture {
        let (asset, options) = (asset(), DecodeOptions::default());
        let resident = Resident::from_asset(&asset);
        let mut info = CaptureInfo::new("sample", WIDTH, HEIGHT, views.clone(), lights.clone(), format);
        info.scale = 1.25;
        if format == ImageFormat::Png {
            info.transfer = Transfer::Gamma(2.2);
        }
        let writer = CaptureWriter::create(dir, info).unwrap();
        for (v, wo) in views.units().into_iter().enumerate() {
            for (l, wi) in lights.units().into_iter().enumerate() {
                let image: Vec<f32> = (0..WIDTH * HEIGHT)
                    .flat_map(|texel| {
                        let noise = 0.1 * number(texel * 100 + v * 10 + l).abs();
                        decode(&resident, 0, texel as u32, wi, wo, &options).map(|x| x + noise)
                    })
                    .collect();
                writer.write(v, l, &image).unwrap();
            }
        }
        writer.finish().unwrap();
        Capture::open(dir).unwrap()
    }

    /// Linear samples `[pair][texel, channel]` of the capture, and its 8-bit values.
    fn samples(capture: &Capture) -> (Vec<Vec<f32>>, Vec<Vec<u8>>) {
        let info = capture.info();
        let coding = info.in_format(ImageFormat::Png);
        let mut all = (Vec::new(), Vec::new());
        for pair in 0..info.pair_count() {
            let (view, light) = (pair / info.lights.len(), pair % info.lights.len());
            let (linear, codes) = match capture.read(view, light).unwrap() {
                Pixels::Encoded8(codes) => {
                    let table = info.linear_from_encoded8(light);
                    (codes.iter().map(|code| table[usize::from(*code)]).collect::<Vec<_>>(), codes)
                }
                Pixels::Linear(linear) => {
                    let codes = linear.iter().map(|x| coding.encoded8_from_linear(light, *x)).collect();
                    (linear, codes)
                }
            };
            all.0.push(linear);
            all.1.push(codes);
        }
        all
    }

    #[test]
    fn the_figures_are_those_of_the_plain_definitions() {
        let folder = tempfile::tempdir().unwrap();
        let (views, lights) = sets();
        let (asset, options) = (asset(), DecodeOptions::default());
        let resident = Resident::from_asset(&asset);
        for format in [ImageFormat::Png, ImageFormat::Exr] {
            let capture = capture(&folder.path().join(format.extension()), format, &views, &lights);
            let info = capture.info().in_format(ImageFormat::Png);
            let (linear, codes) = samples(&capture);
            let lab = LabConverter::new(info.transfer);
            let (mut code_error, mut error, mut square, mut peak) = (0.0, 0.0, 0.0, 0.0f64);
            let mut texel_error = vec![0.0; WIDTH * HEIGHT];
            let (mut colour, mut colours) = (0.0, 0);
            for pair in 0..20 {
                let (wi, wo) = (lights.units()[pair % 5], views.units()[pair / 5]);
                for texel in 0..WIDTH * HEIGHT {
                    let decoded = decode(&resident, 0, texel as u32, wi, wo, &options);
                    let at = texel * 3;
                    let decoded_codes = decoded.map(|x| info.encoded8_from_linear(pair % 5, x));
                    for c in 0..3 {
                        let x = f64::from(linear[pair][at + c]);
                        code_error += (f64::from(decoded_codes[c]) - f64::from(codes[pair][at + c])).powi(2);
                        let e = (f64::from(decoded[c]) - x).powi(2);
                        texel_error[texel] += e;
                        error += e;
                        square += x * x;
                        peak = peak.max(x);
                    }
                    let original = [codes[pair][at], codes[pair][at + 1], codes[pair][at + 2]];
                    colour += delta_e00(lab.lab(original), lab.lab(decoded_codes));
                    colours += 1;
                }
            }
            let count = (20 * WIDTH * HEIGHT * 3) as f64;
            let worst = texel_error.iter().copied().fold(0.0, f64::max) / 60.0;
            let found = measure(&capture, &asset, &resident, &MeasureParams::default(), &Monitor::default()).unwrap();
            let metrics = found.metrics();
            let near = |a: f64, b: f64| (a - b).abs() <= 1e-5 * b.abs();
            assert!(near(metrics.psnr_db, 10.0 * (255.0 * 255.0 * count / code_error).log10()), "{metrics:?}");
            assert!(near(metrics.psnr_linear_db, 10.0 * (peak * peak * count / error).log10()), "{metrics:?}");
            assert!(near(metrics.rel_rmse, (error / square).sqrt()), "{metrics:?}");
            assert!(near(metrics.worst_texel_rmse, worst.sqrt()), "{metrics:?}");
            assert!(near(metrics.delta_e00_mean.unwrap(), colour / f64::from(colours)), "{metrics:?}");
            // Planted difference: the figures of fewer components are others.
            let options = DecodeOptions { components: 0, ..DecodeOptions::default() };
            let fewer = MeasureParams { options, ..MeasureParams::default() };
            let fewer = measure(&capture, &asset, &resident, &fewer, &Monitor::default()).unwrap().metrics();
            assert!(!near(fewer.psnr_db, metrics.psnr_db) && !near(fewer.rel_rmse, metrics.rel_rmse));
            assert!(!near(fewer.delta_e00_mean.unwrap(), metrics.delta_e00_mean.unwrap()));
        }
    }

    #[test]
    fn threads_and_memory_do_not_change_a_bit_of_the_result() {
        let folder = tempfile::tempdir().unwrap();
        let (views, lights) = sets();
        let asset = asset();
        let resident = Resident::from_asset(&asset);
        let capture = capture(&folder.path().join("png"), ImageFormat::Png, &views, &lights);
        let run = |threads: usize, memory_bytes: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let params = MeasureParams { memory_bytes, ..MeasureParams::default() };
            pool.install(|| measure(&capture, &asset, &resident, &params, &Monitor::default()).unwrap())
        };
        let one = run(1, 4_000_000_000);
        assert_eq!(one, run(3, 4_000_000_000));
        assert_eq!(one, run(2, 1));
    }

    #[test]
    fn parts_add_up_to_the_whole() {
        let folder = tempfile::tempdir().unwrap();
        let (views, lights) = sets();
        let asset = asset();
        let resident = Resident::from_asset(&asset);
        let capture = capture(&folder.path().join("png"), ImageFormat::Png, &views, &lights);
        let whole = measure(&capture, &asset, &resident, &MeasureParams::default(), &Monitor::default()).unwrap();
        assert_eq!(whole.psnr_of_pairs(0..20), Some(whole.metrics().psnr_db));
        assert_eq!(whole.texel_code_error.iter().sum::<u64>(), whole.sums.code_error);
        let held_back = vec![3, 4, 11];
        let params = MeasureParams { pairs: Some(held_back.clone()), ..MeasureParams::default() };
        let part = measure(&capture, &asset, &resident, &params, &Monitor::default()).unwrap();
        assert_eq!(whole.psnr_of_pairs(held_back), Some(part.metrics().psnr_db));
        assert_ne!(part.metrics().psnr_db, whole.metrics().psnr_db);
        assert_eq!(part.psnr_of_pairs([5]), None);
        let by_view = whole.psnr_by_view();
        assert_eq!((by_view.len(), whole.psnr_by_light().len()), (4, 5));
        assert_eq!(by_view[2], whole.psnr_of_pairs(10..15));
        assert_eq!(whole.psnr_by_light()[1], whole.psnr_of_pairs([1, 6, 11, 16]));
    }

    #[test]
    fn directions_that_were_not_measured_are_interpolated() {
        let folder = tempfile::tempdir().unwrap();
        let (views, _) = sets();
        let lights = DirectionSet::random(3, 50).unwrap();
        let asset = asset();
        let resident = Resident::from_asset(&asset);
        let capture = capture(&folder.path().join("exr"), ImageFormat::Exr, &views, &lights);
        let fast = MeasureParams { options: DecodeOptions::default(), ..MeasureParams::default() };
        let found = measure(&capture, &asset, &resident, &fast, &Monitor::default()).unwrap();
        assert!(found.interpolated);
        // The noise alone: its mean square is a third of 0.1 squared.
        let rmse = (found.sums.linear_error / found.sums.samples as f64).sqrt();
        assert!((rmse - 0.1 / 3f64.sqrt()).abs() < 0.003, "{rmse}");
    }

    #[test]
    fn another_size_or_side_is_refused_in_one_sentence() {
        let (views, lights) = sets();
        let asset = asset();
        let info = CaptureInfo::new("small", 8, 8, views, lights, ImageFormat::Png);
        let read = |_: usize, _: usize| -> Result<Pixels, FitError> { panic!("nothing is read") };
        let resident = Resident::from_asset(&asset);
        let params = MeasureParams::default();
        let error = measure_images(&info, &read, &asset, &resident, &params, &Monitor::default()).unwrap_err();
        assert!(error.to_string().contains("8 x 8 texels and the asset 41 x 30"), "{error}");
        let back = CaptureInfo { side: btf_capture::Side::Back, ..info };
        let message = layer_for_capture(&back, &asset).unwrap_err().to_string();
        assert!(message.contains("side `back` of the capture small") && message.contains("holds `front`"), "{message}");
        let mut through = asset.clone();
        through.layers.push(through.layers[0].clone());
        through.layers[1].light_side = btf_runtime::SurfaceSide::Back;
        for (side, layer) in [(btf_capture::Side::Front, 0), (btf_capture::Side::TransmissionBack, 1)] {
            assert_eq!(layer_for_capture(&CaptureInfo { side, ..back.clone() }, &through).unwrap(), layer);
        }
    }

    #[test]
    fn the_colour_stride_meets_every_light() {
        for (views, lights) in [(81, 81), (1, 81), (151, 151), (3, 1), (64, 64)] {
            let stride = colour_pair_stride(views, lights);
            let picked: Vec<usize> = (0..views * lights).step_by(stride).collect();
            assert!(picked.len() >= (views * lights).min(COLOUR_PAIRS) / 2, "{views} x {lights}: {}", picked.len());
            let met: std::collections::BTreeSet<usize> = picked.iter().map(|pair| pair % lights).collect();
            assert_eq!(met.len(), lights, "{views} x {lights}");
        }
    }
}

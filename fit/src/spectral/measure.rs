//! Error of an asset in bands: three bands at a time, as if they were colours.

use crate::error::FitError;
use crate::measure::compare::{CaptureImages, Comparison, MeasureParams, colour_pair_stride, measure, measure_decoder};
use crate::measure::image_decoder::ImageDecoder;
use crate::monitor::Monitor;
use btf_capture::Capture;
use btf_runtime::{Asset, Channels, Resident, Spectrum};

/// Returns the bands of `asset` that `capture` has, too: those of both if they are the same.
fn common_bands<'a>(capture: &Capture, asset: &'a Asset) -> Option<&'a Spectrum> {
    let spectrum = asset.spectrum.as_ref()?;
    let same = |(own, nm): (&f32, &f64)| *own == *nm as f32;
    let wavelengths = &capture.info().wavelengths_nm;
    let are_same =
        wavelengths.len() == spectrum.wavelengths_nm.len() && spectrum.wavelengths_nm.iter().zip(wavelengths).all(same);
    are_same.then_some(spectrum)
}

/// Measures the asset against `capture`: in bands where both have the same, else in colours. `resident` must be `asset`'s.
///
/// # Errors
/// As [`crate::measure`], and those of [`Capture::through`].
pub fn measure_capture(
    capture: &Capture,
    asset: &Asset,
    resident: &Resident,
    params: &MeasureParams,
    monitor: &Monitor,
) -> Result<Comparison, FitError> {
    match common_bands(capture, asset) {
        Some(spectrum) => measure_bands(capture, asset, resident, spectrum, params, monitor),
        None => measure(capture, asset, resident, params, monitor),
    }
}

/// Measures the asset, which has a spectrum, against `capture` in the bands of both, all bands alike; colour differences are
/// those under D65. `resident` must be `asset`'s. Reads every image once for three bands.
///
/// # Errors
/// As [`crate::measure`], and those of [`Capture::through`].
fn measure_bands(
    capture: &Capture,
    asset: &Asset,
    resident: &Resident,
    spectrum: &Spectrum,
    params: &MeasureParams,
    monitor: &Monitor,
) -> Result<Comparison, FitError> {
    let bands = spectrum.wavelengths_nm.len();
    let mut whole: Option<Comparison> = None;
    for first in (0..bands).step_by(3) {
        let count = (bands - first).min(3);
        // Weights of the capture's bands, and of the channels that tell them.
        let mut of_bands = vec![[0.0; 3]; bands];
        let mut shown = [Channels::default(); 3];
        for i in 0..count {
            of_bands[first + i][i] = 1.0;
            shown[i] = spectrum.weights[first + i];
        }
        let params = MeasureParams { colour_stride: Some(0), ..params.clone() };
        let seen = capture.through(&of_bands)?;
        let mut part = measured(&seen, asset, resident, shown, &params, monitor)?;
        part.keep_channels(count);
        match &mut whole {
            None => whole = Some(part),
            Some(whole) => whole.add_channels(&part),
        }
    }
    let mut whole = whole.ok_or_else(|| FitError::Params("the asset has no bands".into()))?;
    let info = capture.info();
    let stride = params.colour_stride.unwrap_or_else(|| colour_pair_stride(info.views.len(), info.lights.len()));
    if stride > 0 {
        let pairs: Vec<usize> = whole.pairs.iter().copied().filter(|pair| pair % stride == 0).collect();
        let params = MeasureParams { colour_stride: Some(stride), pairs: Some(pairs), ..params.clone() };
        let colours = measured(capture, asset, resident, spectrum.shown, &params, monitor)?;
        (whole.sums.delta_e00, whole.sums.colours) = (colours.sums.delta_e00, colours.sums.colours);
    }
    Ok(whole)
}

/// Measures three values that follow from the channels by `shown`.
fn measured(
    capture: &Capture,
    asset: &Asset,
    resident: &Resident,
    shown: [Channels; 3],
    params: &MeasureParams,
    monitor: &Monitor,
) -> Result<Comparison, FitError> {
    let mut decoder = ImageDecoder::new(asset, resident, params.layer, &params.options).showing(shown);
    if let Some(bases) = &params.bases {
        decoder = decoder.with_single_bases(bases);
    }
    let read = |view: usize, light: usize| Ok(capture.read(view, light)?);
    measure_decoder(&CaptureImages::new(capture.info(), &read)?, asset, &decoder, params, None, monitor)
}

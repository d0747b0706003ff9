//! Error of an asset in bands.

use crate::error::FitError;
use crate::measure::compare::{CaptureImages, Comparison, MeasureParams, colour_pair_stride, measure, measure_decoder};
use crate::monitor::Monitor;
use btf_capture::{Capture, Pixels};
use btf_runtime::{Asset, Resident, Spectrum};

/// Captures in bands, and what their bands are of the channels that are fitted in their place.
pub(crate) struct BandedCaptures<'a> {
    /// Captures, one for each layer, in the asset's order.
    pub captures: &'a [Capture],
    /// Bands of the channels.
    pub spectrum: &'a Spectrum,
}

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
/// As [`crate::measure`], and those of [`Capture::read_bands`].
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

/// Measures the asset, which has `spectrum`, against `capture` in the bands of both, all bands alike; colour differences are
/// those under D65, for which some images are read twice. `resident` must be `asset`'s.
///
/// # Errors
/// As [`crate::measure`], and those of [`Capture::read_bands`].
pub(crate) fn measure_bands(
    capture: &Capture,
    asset: &Asset,
    resident: &Resident,
    spectrum: &Spectrum,
    params: &MeasureParams,
    monitor: &Monitor,
) -> Result<Comparison, FitError> {
    let decoder = params.decoder(asset, resident);
    let info = capture.info();
    let stride = params.colour_stride.unwrap_or_else(|| colour_pair_stride(info.views.len(), info.lights.len()));
    let colours = match stride {
        0 => None,
        _ => {
            let is_picked = |pair: &usize| pair.is_multiple_of(stride);
            let asked = params.pairs.clone().unwrap_or_else(|| (0..info.pair_count()).collect());
            let pairs = asked.into_iter().filter(is_picked).collect();
            let params = MeasureParams { colour_stride: Some(stride), pairs: Some(pairs), ..params.clone() };
            let read = |view: usize, light: usize| Ok(capture.read(view, light)?);
            Some(measure_decoder(&CaptureImages::new(info, &read)?, asset, &decoder, &params, None, monitor)?)
        }
    };
    let decoder = decoder.showing(&spectrum.weights);
    let read = |view: usize, light: usize| Ok(Pixels::Linear(capture.read_bands(view, light)?));
    let params = MeasureParams { colour_stride: Some(0), ..params.clone() };
    let mut found = measure_decoder(&CaptureImages::new(info, &read)?, asset, &decoder, &params, None, monitor)?;
    if let Some(colours) = colours {
        (found.sums.delta_e00, found.sums.colours) = (colours.sums.delta_e00, colours.sums.colours);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::{FitParams, Priors};
    use crate::pipeline::fitted::{Fitted, fit_and_measure};
    use crate::spectral::basis::tests::capture;
    use btf_capture::CaptureWriter;
    use btf_runtime::{DecodeOptions, Query, evaluate_bands};

    fn fitted(captures: &[Capture], params: FitParams) -> Fitted {
        fit_and_measure(captures, &params.check().unwrap(), &Monitor::default()).unwrap()
    }

    #[test]
    fn the_error_of_bands_is_that_of_every_band_decoded_on_its_own() {
        let captures = [capture(31)];
        let info = captures[0].info();
        let found = fitted(&captures, FitParams { components: Some(2), ..FitParams::default() });
        let (spectrum, options) = (found.asset.spectrum.as_ref().unwrap(), DecodeOptions::default());
        let (mut error, mut peak, mut bands) = (0.0, 0.0f32, vec![0.0; 31]);
        for (v, wo) in info.views.units().into_iter().enumerate() {
            for (l, wi) in info.lights.units().into_iter().enumerate() {
                let image = captures[0].read_bands(v, l).unwrap();
                for (texel, truth) in image.chunks(31).enumerate() {
                    let (column, row) = (texel % info.width, texel / info.width);
                    let u = (column as f32 + 0.5) / info.width as f32;
                    let uv = [u, 1.0 - (row as f32 + 0.5) / info.height as f32];
                    evaluate_bands(&found.resident, spectrum, 0, &Query { uv, wi, wo }, &options, &mut bands);
                    error += bands.iter().zip(truth).map(|(x, y)| f64::from(x - y).powi(2)).sum::<f64>();
                    peak = truth.iter().fold(peak, |peak, x| peak.max(*x));
                }
            }
        }
        let comparison = &found.comparisons[0];
        assert_eq!((comparison.channels, comparison.sums.samples), (31, 31 * 48 * 16));
        assert!((comparison.sums.linear_error - error).abs() < 1e-3 * error, "{error} {comparison:?}");
        assert_eq!(comparison.sums.linear_peak, f64::from(peak));
        assert!(comparison.metrics().delta_e00_mean.is_some_and(|mean| mean > 0.0));
        // Planted difference: with one channel less every band is another.
        let mut other = found.asset.clone();
        other.spectrum.as_mut().unwrap().weights.iter_mut().for_each(|weights| weights[1] = 0.0);
        let (params, monitor) = (MeasureParams::default(), Monitor::default());
        let wrong = measure_capture(&captures[0], &other, &found.resident, &params, &monitor).unwrap();
        assert!(wrong.sums.linear_error > 10.0 * error);
    }

    #[test]
    fn what_is_missing_in_bands_is_predicted_in_every_group_of_channels_also_by_priors_in_bands() {
        let folder = tempfile::tempdir().unwrap();
        let leaf = capture(31);
        let (info, spectra) = (leaf.info().clone(), leaf.read_bands(0, 0).unwrap());
        // Lit as directions have it, so that pairs follow from one another.
        let lit = &|pair: usize| info.lights.units()[pair % 4][2] * (0.5 + info.views.units()[pair / 4][2]);
        let values = (0..16).flat_map(|pair| spectra.iter().map(move |x| x * lit(pair))).collect();
        let whole = [Capture::from_linear(info.clone(), values).unwrap()];
        let prior = fitted(&whole, FitParams::default());
        assert!(prior.asset.spectrum.as_ref().is_some_and(|spectrum| spectrum.groups > 1));
        let path = folder.path().join("prior.spmm");
        std::fs::write(&path, &prior.bytes).unwrap();
        let dir = folder.path().join("thinned");
        let writer = CaptureWriter::create(&dir, whole[0].info().clone()).unwrap();
        for pair in 0..16 {
            writer.write(pair / 4, pair % 4, &whole[0].read_bands(pair / 4, pair % 4).unwrap()).unwrap();
        }
        writer.finish().unwrap();
        let complete = Capture::open(&dir).unwrap();
        [2, 9].iter().for_each(|pair| std::fs::remove_file(complete.path_of(pair / 4, pair % 4)).unwrap());
        let manifest = dir.join("capture.toml");
        let text = std::fs::read_to_string(&manifest).unwrap();
        std::fs::write(&manifest, format!("incomplete = true\n{text}")).unwrap();
        let thinned = [Capture::open(&dir).unwrap()];
        let params = FitParams { priors: Priors::Assets(vec![path]), leave_out: 0.1, ..FitParams::default() };
        let found = fitted(&thinned, params);
        assert_eq!(found.comparisons[0].pairs.len(), 14);
        assert!(found.psnr_left_out_db.is_some_and(|db| db > 15.0), "{:?}", found.psnr_left_out_db);
        let (params, monitor) = (MeasureParams::default(), Monitor::default());
        let psnr = |asset, resident| {
            measure_capture(&whole[0], asset, resident, &params, &monitor).unwrap().psnr_of_pairs([2, 9]).unwrap()
        };
        let predicted = psnr(&found.asset, &found.resident);
        // Planted difference: black in place of a prediction.
        let mut black = found.asset.clone();
        black.spectrum.as_mut().unwrap().weights.iter_mut().for_each(|weights| *weights = Default::default());
        assert!(predicted > psnr(&black, &found.resident) + 3.0, "{predicted}");
    }

    #[test]
    fn a_goal_in_decibels_is_one_of_bands() {
        let captures = [capture(31)];
        for db in [34.0, 42.0] {
            let found = fitted(&captures, FitParams { psnr_db: Some(db), ..FitParams::default() });
            let reached = found.metrics.psnr_db;
            assert!((db..db + 2.0).contains(&reached), "{db} {reached}");
        }
    }
}

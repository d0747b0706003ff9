//! The basis along wavelength of a capture in bands: three spectra of which all others are sums. The capture is fitted in
//! their shares, as three channels of one matrix; bands follow from these.
//!
//! The spectra are those of least squares in the root curve, to first order, and none is negative
//! ([`crate::spectral::non_negative`]), so that shares are not negative either and may be fitted like colours. The shares of a
//! measured spectrum are linear in its bands: what matrix tells them best is found by least squares over the same spectra.

use crate::error::FitError;
use crate::monitor::Monitor;
use crate::spectral::non_negative::factorise;
use btf_capture::{Capture, MAX_BANDS, rgb_weights};
use btf_runtime::{MAX_BAND_WEIGHT, ROOT, Spectrum};
use nalgebra::DMatrix;
use ndarray::{Array2, Axis};
use rayon::prelude::*;

/// Images that spectra are taken from, of all captures together, and spectra of each.
const IMAGES: usize = 64;
const SPECTRA: usize = 192;
/// Reflectance below which a relative error does not count.
const EPSILON: f32 = 1e-3;
/// Ridge of the least squares, relative to the mean of the diagonal.
const RIDGE: f64 = 1e-6;

/// Basis along wavelength.
#[derive(Debug, Clone)]
pub struct SpectralBasis {
    /// Wavelengths of the bands in nanometres, ascending.
    pub wavelengths_nm: Vec<f64>,
    /// What each channel is of the bands, `[band][channel]`: for [`Capture::through`].
    pub analysis: Vec<[f32; 3]>,
    /// What each band is of the channels, `[band][channel]`.
    pub synthesis: Vec<[f32; 3]>,
    /// Root mean square error of the spectra that the basis was found from, in the curve `x^(1 / 2.4)`: what remains if the
    /// channels are exact.
    pub root_rmse: f64,
}

impl SpectralBasis {
    /// Finds the basis of `captures`; `None` where they are colours.
    ///
    /// # Errors
    /// Captures of which some have other bands than others, corrected ones ([`Capture::through`]), and images that cannot be
    /// read.
    ///
    /// Cost: reading 64 images.
    pub fn of_captures(captures: &[Capture], monitor: &Monitor) -> Result<Option<SpectralBasis>, FitError> {
        let Some(first) = captures.first() else { return Ok(None) };
        let wavelengths_nm = first.info().wavelengths_nm.clone();
        if let Some(other) = captures.iter().find(|other| other.info().wavelengths_nm != wavelengths_nm) {
            return Err(FitError::Params(format!(
                "{} and {} have different bands; fit captures of the same bands together, or give --colours",
                first.info().name,
                other.info().name
            )));
        }
        if wavelengths_nm.is_empty() {
            return Ok(None);
        }
        let samples = monitor.stage("spectra", || spectra_of(captures, monitor))?;
        Ok(Some(SpectralBasis::of_spectra(wavelengths_nm, &samples)))
    }

    /// Finds the basis of spectra, `[sample, band]`.
    fn of_spectra(wavelengths_nm: Vec<f64>, samples: &Array2<f32>) -> SpectralBasis {
        let bands = wavelengths_nm.len();
        if bands <= 3 {
            let own: Vec<[f32; 3]> =
                (0..bands).map(|band| std::array::from_fn(|channel| f32::from(u8::from(channel == band)))).collect();
            return SpectralBasis { wavelengths_nm, analysis: own.clone(), synthesis: own, root_rmse: 0.0 };
        }
        // The square of the curve's derivative.
        let weight = |x: f32| (x + EPSILON).powf(2.0 / ROOT - 2.0);
        let [mut spectra, mut shares] = factorise(samples, &samples.mapv(weight), 3);
        order_by_wavelength(&mut spectra, &mut shares);
        let of_row: Vec<f32> = samples.rows().into_iter().map(|row| weight(row.mean().unwrap_or(0.0))).collect();
        let analysis = least_squares(samples, &shares, &of_row);
        let told = samples.dot(&analysis).mapv(|x| x.max(0.0)).dot(&spectra.t());
        let curve = |x: f32| f64::from((x.max(0.0) + EPSILON).powf(1.0 / ROOT));
        let squares: f64 = told.iter().zip(samples).map(|(x, y)| (curve(*x) - curve(*y)).powi(2)).sum();
        let rows = |matrix: &Array2<f32>| -> Vec<[f32; 3]> {
            let held = |x: f32| x.clamp(-MAX_BAND_WEIGHT, MAX_BAND_WEIGHT);
            matrix.rows().into_iter().map(|row| [0, 1, 2].map(|channel| held(row[channel]))).collect()
        };
        SpectralBasis {
            wavelengths_nm,
            analysis: rows(&analysis),
            synthesis: rows(&spectra),
            root_rmse: (squares / samples.len().max(1) as f64).sqrt(),
        }
    }

    /// Returns the captures in the channels of this basis.
    ///
    /// # Errors
    /// Those of [`Capture::through`].
    pub fn channels(&self, captures: &[Capture]) -> Result<Vec<Capture>, FitError> {
        captures.iter().map(|capture| Ok(capture.through(&self.analysis)?)).collect()
    }

    /// Returns what an asset in these channels says of its bands; colours are those under D65.
    pub fn spectrum(&self) -> Spectrum {
        let mut spectrum = Spectrum {
            wavelengths_nm: self.wavelengths_nm.iter().map(|nm| *nm as f32).collect(),
            weights: self.synthesis.clone(),
            shown: [[0.0; 3]; 3],
        };
        spectrum.shown = spectrum.shown_through(&rgb_weights(&self.wavelengths_nm).unwrap_or_default());
        spectrum
    }
}

/// Returns spectra of `captures`, evenly over their images and texels, `[sample, band]`, none negative.
fn spectra_of(captures: &[Capture], monitor: &Monitor) -> Result<Array2<f32>, FitError> {
    let each = (IMAGES / captures.len()).max(1);
    let chosen: Vec<(&Capture, usize)> = captures
        .iter()
        .flat_map(|capture| {
            let pairs: Vec<usize> = capture.info().present_pairs().collect();
            let count = each.min(pairs.len());
            (0..count).map(move |i| (capture, pairs[(2 * i + 1) * pairs.len() / (2 * count)]))
        })
        .collect();
    let bands = captures[0].info().wavelengths_nm.len().min(MAX_BANDS);
    let rows = chosen.par_iter().enumerate().map(|(number, (capture, pair))| {
        monitor.check()?;
        let info = capture.info();
        let image = capture.read_bands(pair / info.lights.len(), pair % info.lights.len())?;
        let (texels, count) = (info.texel_count(), SPECTRA.min(info.texel_count()));
        // Another place in each image.
        let of = |i: usize| (i * texels / count + number * 7919) % texels;
        let values = (0..count).flat_map(|i| image[of(i) * bands..(of(i) + 1) * bands].iter().map(|x| x.max(0.0)));
        Ok(values.collect::<Vec<f32>>())
    });
    let rows = rows.collect::<Result<Vec<Vec<f32>>, FitError>>()?.concat();
    Array2::from_shape_vec((rows.len() / bands, bands), rows)
        .map_err(|error| FitError::Params(format!("the spectra have no even shape ({error})")))
}

/// Orders channels by the wavelength of their mean, the longest first, as red is before blue, and scales each so that its
/// largest band is 1.
fn order_by_wavelength(spectra: &mut Array2<f32>, shares: &mut Array2<f32>) {
    let middle = |column: usize| {
        let column = spectra.column(column);
        let weighted: f32 = column.iter().enumerate().map(|(band, x)| band as f32 * x).sum();
        weighted / column.sum().max(1e-12)
    };
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| middle(*b).total_cmp(&middle(*a)));
    *spectra = spectra.select(Axis(1), &order);
    *shares = shares.select(Axis(1), &order);
    for (mut spectrum, mut share) in spectra.columns_mut().into_iter().zip(shares.columns_mut()) {
        let largest = spectrum.fold(1e-6f32, |most, x| most.max(*x));
        spectrum /= largest;
        share *= largest;
    }
}

/// Returns the matrix `[band, channel]` that tells `shares` of `samples` with the least squares, each row times its weight.
fn least_squares(samples: &Array2<f32>, shares: &Array2<f32>, weights: &[f32]) -> Array2<f32> {
    // In double precision: smooth spectra hardly span more than a few dimensions.
    let [samples, shares] = [samples, shares].map(|numbers| numbers.mapv(f64::from));
    let mut weighted = samples.clone();
    weighted.rows_mut().into_iter().zip(weights).for_each(|(mut row, weight)| row *= f64::from(*weight));
    let (gram, cross) = (weighted.t().dot(&samples), weighted.t().dot(&shares));
    let bands = samples.ncols();
    let ridge = RIDGE * gram.diag().sum() / bands as f64 + 1e-12;
    let matrix = DMatrix::from_fn(bands, bands, |i, j| gram[[i, j]] + if i == j { ridge } else { 0.0 });
    let right = DMatrix::from_fn(bands, 3, |i, j| cross[[i, j]]);
    let solved = matrix.cholesky().map_or_else(|| DMatrix::zeros(bands, 3), |cholesky| cholesky.solve(&right));
    Array2::from_shape_fn((bands, 3), |(i, j)| solved[(i, j)] as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_capture::{CaptureInfo, DirectionSet, ImageFormat};

    /// Reflectance of a made-up leaf: a green hump and a rise to the infrared, by its pigment.
    fn reflectance(nm: f64, pigment: f64) -> f64 {
        let absorbed =
            pigment * ((-((nm - 450.0) / 60.0).powi(2)).exp() + (-((nm - 670.0) / 30.0).powi(2)).exp() + 0.1);
        let end = 1.0 / (1.0 + ((nm - 715.0) / 15.0).exp());
        0.45 * (-3.0 * absorbed * end).exp() + 0.03
    }

    fn capture(bands: usize) -> Capture {
        let set = DirectionSet::random(4, 1).unwrap();
        let wavelengths_nm: Vec<f64> = (0..bands).map(|i| 400.0 + 600.0 * i as f64 / bands as f64).collect();
        let info = CaptureInfo::new("leaf", 8, 6, set.clone(), set, ImageFormat::Exr);
        let info = CaptureInfo { wavelengths_nm: wavelengths_nm.clone(), ..info };
        let value = |i: usize| {
            let (sample, band) = (i / bands, i % bands);
            let pigment = 0.3 + (sample * 37 % 101) as f64 / 80.0;
            let light = 0.2 + (sample * 53 % 89) as f64 / 100.0;
            (light * reflectance(wavelengths_nm[band], pigment)) as f32
        };
        let values = (0..16 * 48 * bands).map(value).collect();
        Capture::from_linear(info, values).unwrap()
    }

    #[test]
    fn channels_are_not_negative_and_bands_follow_from_them() {
        let captures = [capture(31)];
        let basis = SpectralBasis::of_captures(&captures, &Monitor::default()).unwrap().unwrap();
        assert!(basis.root_rmse < 0.01, "{}", basis.root_rmse);
        assert!(basis.synthesis.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
        let channels = &basis.channels(&captures).unwrap()[0];
        let (spectrum, bands) = (basis.spectrum(), captures[0].read_bands(1, 2).unwrap());
        let btf_capture::Pixels::Linear(values) = channels.read(1, 2).unwrap() else { panic!("not linear") };
        for (x, bands) in values.as_chunks::<3>().0.iter().zip(bands.chunks(31)) {
            assert!(x.iter().all(|x| *x > -0.01), "{x:?}");
            for (told, band) in spectrum.bands(*x).zip(bands) {
                assert!((told - band).abs() < 0.02, "{told} {band}");
            }
        }
        // White is white, and the colours are those that the capture itself has.
        let btf_capture::Pixels::Linear(colours) = captures[0].read(1, 2).unwrap() else { panic!("not linear") };
        for (x, colour) in values.as_chunks::<3>().0.iter().zip(colours.as_chunks::<3>().0) {
            let told = spectrum.shown.map(|row| row[0] * x[0] + row[1] * x[1] + row[2] * x[2]);
            assert!((0..3).all(|c| (told[c] - colour[c]).abs() < 0.01), "{told:?} {colour:?}");
        }
    }

    #[test]
    fn few_bands_are_channels_themselves_and_colours_have_no_basis() {
        let basis = SpectralBasis::of_captures(&[capture(2)], &Monitor::default()).unwrap().unwrap();
        assert_eq!((&basis.analysis, basis.root_rmse), (&vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], 0.0));
        let set = DirectionSet::random(2, 1).unwrap();
        let info = CaptureInfo::new("grey", 1, 1, set.clone(), set, ImageFormat::Exr);
        let grey = Capture::from_linear(info, vec![0.5; 12]).unwrap();
        assert!(SpectralBasis::of_captures(&[grey], &Monitor::default()).unwrap().is_none());
        let other = SpectralBasis::of_captures(&[capture(31), capture(5)], &Monitor::default()).unwrap_err();
        assert!(other.to_string().contains("different bands"), "{other}");
    }
}

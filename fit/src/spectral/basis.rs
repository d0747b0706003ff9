//! The basis along wavelength of a capture in bands: a few sensors whose values tell all bands. The capture is fitted in these
//! channels, of which each texel has one set of coefficients, as one matrix; bands follow by weighted sums.
//!
//! The first three channels are the colours under D65 where the bands are those that an eye sees, so that a renderer of
//! colours decodes no others. Each further channel is the sensor that leaves the least error together with those before it
//! (forward selection), of sensors about each wavelength. Channels of sensors are not negative and are fitted like colours.

use crate::error::FitError;
use crate::monitor::Monitor;
use btf_capture::{Capture, rgb_weights};
use btf_runtime::{Channels, MAX_BAND_WEIGHT, MAX_GROUPS, ROOT, Spectrum};
use nalgebra::DMatrix;
use ndarray::{Array1, Array2, s};
use rayon::prelude::*;

/// Images that spectra are taken from, of all captures together, and spectra of each.
const IMAGES: usize = 64;
const SPECTRA: usize = 192;
/// Reflectance below which a relative error does not count.
const EPSILON: f32 = 1e-3;
/// Ridge of the least squares, relative to the mean of the diagonal.
const RIDGE: f64 = 1e-7;
/// Width of a sensor in nanometres: the standard deviation of its Gaussian, or the distance of bands if that is larger.
const MIN_WIDTH_NM: f64 = 15.0;
/// Root mean square error in the root curve, 48 dB, that no further group of channels is needed for.
const FINE: f64 = 0.004;
/// Bands up to these, or from them on, are not seen by an eye.
const SEEN_NM: [f64; 2] = [480.0, 620.0];

/// Basis along wavelength.
#[derive(Debug, Clone)]
pub struct SpectralBasis {
    /// Wavelengths of the bands in nanometres, ascending.
    pub wavelengths_nm: Vec<f64>,
    /// What each channel is of the bands, `[group][band][channel]`: for [`Capture::in_groups`].
    pub analysis: Vec<Vec<[f32; 3]>>,
    /// What each band is of the channels.
    pub synthesis: Vec<Channels>,
    /// Whether the first group is the colours under D65.
    pub has_colours: bool,
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
        let has_colours = bands > 3 && wavelengths_nm[0] < SEEN_NM[0] && wavelengths_nm[bands - 1] > SEEN_NM[1];
        let mut sensors: Vec<Array1<f32>> = match rgb_weights(&wavelengths_nm).filter(|_| has_colours) {
            Some(rgb) => (0..3).map(|channel| rgb.iter().map(|weights| weights[channel]).collect()).collect(),
            None => Vec::new(),
        };
        let candidates = sensors_of(&wavelengths_nm);
        let task = Task::new(samples);
        let mut basis = task.told(&sensors);
        while basis.root_rmse > FINE && sensors.len() < bands.min(3 * MAX_GROUPS) {
            let first = sensors.len();
            while sensors.len() < (first + 3).min(bands) {
                let with = |sensor: &Array1<f32>| [&sensors[..], std::slice::from_ref(sensor)].concat();
                let errors: Vec<f64> = candidates.par_iter().map(|sensor| task.told(&with(sensor)).root_rmse).collect();
                let best = (0..errors.len()).fold(0, |best, i| if errors[i] < errors[best] { i } else { best });
                sensors.push(candidates[best].clone());
            }
            // The longest wavelength first, as red is before blue: lobes have one weight for the channels of a place.
            let middle = |sensor: &Array1<f32>| sensor.iter().enumerate().map(|(band, x)| band as f32 * x).sum::<f32>();
            sensors[first..].sort_by(|a, b| middle(b).total_cmp(&middle(a)));
            basis = task.told(&sensors);
        }
        SpectralBasis::of_sensors(wavelengths_nm, &sensors, &basis, has_colours)
    }

    fn of_sensors(wavelengths_nm: Vec<f64>, sensors: &[Array1<f32>], told: &Told, has_colours: bool) -> SpectralBasis {
        let bands = wavelengths_nm.len();
        let analysis = sensors.chunks(3).map(|group| {
            let of_band = |band: usize| std::array::from_fn(|i| group.get(i).map_or(0.0, |sensor| sensor[band]));
            (0..bands).map(of_band).collect()
        });
        let synthesis = told.synthesis.columns().into_iter().map(|weights| {
            let held = |weight: &f32| weight.clamp(-MAX_BAND_WEIGHT, MAX_BAND_WEIGHT);
            std::array::from_fn(|channel| weights.get(channel).map_or(0.0, held))
        });
        SpectralBasis {
            analysis: analysis.collect(),
            synthesis: synthesis.collect(),
            wavelengths_nm,
            has_colours,
            root_rmse: told.root_rmse,
        }
    }

    /// Returns the captures in the channels of this basis.
    ///
    /// # Errors
    /// Those of [`Capture::in_groups`].
    pub fn channels(&self, captures: &[Capture]) -> Result<Vec<Capture>, FitError> {
        captures.iter().map(|capture| Ok(capture.in_groups(&self.analysis)?)).collect()
    }

    /// Returns what an asset in these channels says of its bands; colours are those under D65.
    pub fn spectrum(&self) -> Spectrum {
        let mut spectrum = Spectrum {
            wavelengths_nm: self.wavelengths_nm.iter().map(|nm| *nm as f32).collect(),
            groups: self.analysis.len(),
            weights: self.synthesis.clone(),
            shown: std::array::from_fn(|value| std::array::from_fn(|channel| f32::from(u8::from(channel == value)))),
        };
        if !self.has_colours {
            spectrum.shown = spectrum.shown_through(&rgb_weights(&self.wavelengths_nm).unwrap_or_default());
        }
        spectrum
    }
}

/// Returns a sensor about each band, its weights for all bands: a Gaussian of unit sum.
fn sensors_of(wavelengths_nm: &[f64]) -> Vec<Array1<f32>> {
    let count = wavelengths_nm.len();
    let step = (wavelengths_nm[count - 1] - wavelengths_nm[0]) / (count - 1).max(1) as f64;
    let width = if count <= 3 { 1e-3 } else { step.max(MIN_WIDTH_NM) };
    let about = |middle: &f64| {
        let weights: Array1<f64> =
            wavelengths_nm.iter().map(|nm| (-0.5 * ((nm - middle) / width).powi(2)).exp()).collect();
        (&weights / weights.sum()).mapv(|x| x as f32)
    };
    wavelengths_nm.iter().map(about).collect()
}

/// Spectra with the weights by which least squares are those of the root curve, to first order.
struct Task<'a> {
    samples: &'a Array2<f32>,
    weights: Vec<f64>,
    encoded: Array2<f32>,
}

/// What sensors tell of the spectra.
struct Told {
    /// Weights of the sensors in each band, `[sensor, band]`.
    synthesis: Array2<f32>,
    root_rmse: f64,
}

/// Returns the curve in which errors count.
fn encoded(x: f32) -> f32 {
    (x.max(0.0) + EPSILON).powf(1.0 / ROOT)
}

impl<'a> Task<'a> {
    fn new(samples: &'a Array2<f32>) -> Task<'a> {
        let mean = |row: ndarray::ArrayView1<f32>| f64::from(row.mean().unwrap_or(0.0) + EPSILON);
        let weight = |row| mean(row).powf(2.0 / f64::from(ROOT) - 2.0);
        let weights = samples.rows().into_iter().map(weight).collect();
        Task { samples, weights, encoded: samples.mapv(encoded) }
    }

    /// Finds what `sensors` tell of the spectra. What one of them sees below 0 counts as 0, as it does in an asset.
    fn told(&self, sensors: &[Array1<f32>]) -> Told {
        let bands = self.samples.ncols();
        let mut matrix = Array2::<f32>::zeros((bands, sensors.len()));
        sensors.iter().enumerate().for_each(|(i, sensor)| matrix.slice_mut(s![.., i]).assign(sensor));
        let channels = self.samples.dot(&matrix).mapv(|x| x.max(0.0));
        // In double precision: smooth spectra hardly span more than a few dimensions.
        let mut weighted = channels.mapv(f64::from);
        weighted.rows_mut().into_iter().zip(&self.weights).for_each(|(mut row, weight)| row *= *weight);
        let gram = weighted.t().dot(&channels.mapv(f64::from));
        let cross = weighted.t().dot(&self.samples.mapv(f64::from));
        let count = sensors.len();
        let ridge = RIDGE * gram.diag().sum() / count.max(1) as f64 + 1e-12;
        let square = DMatrix::from_fn(count, count, |i, j| gram[[i, j]] + if i == j { ridge } else { 0.0 });
        let right = DMatrix::from_fn(count, bands, |i, j| cross[[i, j]]);
        let solved = square.cholesky().map_or_else(|| DMatrix::zeros(count, bands), |cholesky| cholesky.solve(&right));
        let synthesis = Array2::from_shape_fn((count, bands), |(i, j)| solved[(i, j)] as f32);
        let told = channels.dot(&synthesis).mapv(encoded);
        let squares: f64 = told.iter().zip(&self.encoded).map(|(x, y)| f64::from(x - y).powi(2)).sum();
        Told { synthesis, root_rmse: (squares / self.samples.len().max(1) as f64).sqrt() }
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
    let bands = captures[0].info().wavelengths_nm.len();
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

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use btf_capture::{CaptureInfo, DirectionSet, ImageFormat, Pixels};

    /// Reflectance of a made-up leaf: a green hump by its pigment and a rise to the infrared, which no colour tells.
    fn reflectance(nm: f64, pigment: f64, infrared: f64) -> f64 {
        let absorbed =
            pigment * ((-((nm - 450.0) / 60.0).powi(2)).exp() + (-((nm - 670.0) / 30.0).powi(2)).exp() + 0.1);
        let end = 1.0 / (1.0 + ((nm - 715.0) / 15.0).exp());
        (0.45 + infrared * (1.0 - end)) * (-3.0 * absorbed * end).exp() + 0.03
    }

    /// Returns 8 x 6 texels of a leaf under 4 lights from 4 views, with bands from 400 to 1000 nm.
    pub(crate) fn capture(bands: usize) -> Capture {
        let set = DirectionSet::random(4, 1).unwrap();
        let wavelengths_nm: Vec<f64> = (0..bands).map(|i| 400.0 + 600.0 * i as f64 / bands as f64).collect();
        let info = CaptureInfo::new("leaf", 8, 6, set.clone(), set, ImageFormat::Exr);
        let info = CaptureInfo { wavelengths_nm: wavelengths_nm.clone(), ..info };
        let value = |i: usize| {
            let (sample, band) = (i / bands, i % bands);
            let pigment = 0.3 + (sample * 37 % 101) as f64 / 80.0;
            let light = 0.2 + (sample * 53 % 89) as f64 / 100.0;
            let infrared = 0.4 * (sample * 29 % 97) as f64 / 97.0;
            (light * reflectance(wavelengths_nm[band], pigment, infrared)) as f32
        };
        let values = (0..16 * 48 * bands).map(value).collect();
        Capture::from_linear(info, values).unwrap()
    }

    fn linear(capture: &Capture, view: usize, light: usize) -> Vec<f32> {
        match capture.read(view, light).unwrap() {
            Pixels::Linear(values) => values,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_first_channels_are_colours_and_bands_follow_from_all() {
        let captures = [capture(31)];
        let basis = SpectralBasis::of_captures(&captures, &Monitor::default()).unwrap().unwrap();
        let groups = basis.analysis.len();
        assert!(basis.has_colours && groups >= 2 && basis.root_rmse < FINE, "{groups} {}", basis.root_rmse);
        let channels = &basis.channels(&captures).unwrap()[0];
        assert_eq!(channels.info().lights.len(), 4 * groups);
        let (spectrum, bands) = (basis.spectrum(), captures[0].read_bands(1, 2).unwrap());
        assert!(spectrum.is_valid());
        assert_eq!(linear(channels, 1, 2), linear(&captures[0], 1, 2));
        let parts: Vec<Vec<f32>> = (0..groups).map(|group| linear(channels, 1, 4 * group + 2)).collect();
        for (texel, bands) in bands.chunks(31).enumerate() {
            let mut x: Channels = Default::default();
            parts.iter().enumerate().for_each(|(g, part)| x[3 * g..3 * g + 3].copy_from_slice(&part[3 * texel..][..3]));
            for (told, band) in spectrum.bands(x).zip(bands) {
                assert!((told - band).abs() < 0.01, "{told} {band}");
            }
        }
        // Planted difference: colours alone do not tell the infrared.
        let task = spectra_of(&captures, &Monitor::default()).unwrap();
        let rgb = rgb_weights(&basis.wavelengths_nm).unwrap();
        let colours: Vec<Array1<f32>> = (0..3).map(|c| rgb.iter().map(|weights| weights[c]).collect()).collect();
        assert!(Task::new(&task).told(&colours).root_rmse > 5.0 * FINE);
    }

    #[test]
    fn few_bands_are_channels_themselves_and_colours_have_no_basis() {
        let basis = SpectralBasis::of_captures(&[capture(2)], &Monitor::default()).unwrap().unwrap();
        assert!(basis.analysis.len() == 1 && basis.root_rmse < 1e-3, "{basis:?}");
        let set = DirectionSet::random(2, 1).unwrap();
        let info = CaptureInfo::new("grey", 1, 1, set.clone(), set, ImageFormat::Exr);
        let grey = Capture::from_linear(info, vec![0.5; 12]).unwrap();
        assert!(SpectralBasis::of_captures(&[grey], &Monitor::default()).unwrap().is_none());
        let other = SpectralBasis::of_captures(&[capture(31), capture(5)], &Monitor::default()).unwrap_err();
        assert!(other.to_string().contains("different bands"), "{other}");
    }
}

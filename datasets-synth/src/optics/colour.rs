//! Converts spectra to linear sRGB: 31 wavelengths under D65, or the three of the paper.

use crate::error::SynthError;
use crate::optics::tables::interpolated;
use btf_capture::cie;

/// Wavelengths of the paper in nanometres for red, green and blue.
pub const PAPER_WAVELENGTHS_NM: [f64; 3] = [675.0, 546.0, 435.0];

/// First and last wavelength in nanometres that a colour can be made of: those that both the leaf's and the observer's
/// table have.
const VISIBLE_NM: [f64; 2] = [400.0, 780.0];

/// Wavelengths at which a colour is computed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum RgbBands {
    /// Wavelengths 400, 410, ... 700 nm under D65, CIE 1931 2-degree observer.
    #[default]
    Spectral31,
    /// Red at 675 nm, green at 546 and blue at 435 [Miao, after eq. 5]: no colour that an eye would see. 675 nm is
    /// where chlorophyll absorbs most, so red comes out too dark.
    ThreeWavelength,
    /// Three bands of a spectral capture in nanometres, one for each channel.
    Three([f64; 3]),
}

impl RgbBands {
    /// Returns the name: `spectral`, `three-wavelength` or `bands`.
    pub fn name(self) -> &'static str {
        match self {
            RgbBands::Spectral31 => "spectral",
            RgbBands::ThreeWavelength => "three-wavelength",
            RgbBands::Three(_) => "bands",
        }
    }
}

/// Converter of spectra of reflectance or transmittance to linear sRGB.
///
/// Under D65 each channel is divided by what a perfect reflector gives, so that a perfect reflector is (1, 1, 1)
/// exactly; for [`RgbBands::Spectral31`] that corrects the cut at 400 and 700 nm and the 10 nm steps by below 0.3 % in
/// every channel. Colours outside the gamut keep their negative values.
#[derive(Debug, Clone)]
pub struct RgbFromSpectrum {
    wavelengths_nm: Vec<f64>,
    /// Weights `[band][channel]`.
    weights: Vec<[f64; 3]>,
    /// Linear sRGB of a perfect reflector before the correction.
    uncorrected_white: [f64; 3],
}

impl RgbFromSpectrum {
    /// Returns the converter of spectra at `bands`.
    pub fn new(bands: RgbBands) -> RgbFromSpectrum {
        match bands {
            RgbBands::Spectral31 => RgbFromSpectrum::under_d65((0..31).map(|i| 400.0 + 10.0 * f64::from(i)).collect()),
            RgbBands::ThreeWavelength => RgbFromSpectrum::channel_by_channel(PAPER_WAVELENGTHS_NM),
            RgbBands::Three(wavelengths_nm) => RgbFromSpectrum::channel_by_channel(wavelengths_nm),
        }
    }

    /// Returns what takes each channel from one wavelength.
    fn channel_by_channel(wavelengths_nm: [f64; 3]) -> RgbFromSpectrum {
        RgbFromSpectrum {
            wavelengths_nm: wavelengths_nm.to_vec(),
            weights: vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            uncorrected_white: [1.0; 3],
        }
    }

    /// Returns the converter of spectra under D65 at `count` (2 or more) evenly spaced wavelengths from `first_nm` to
    /// `last_nm`, both included and within 400 to 780 nm.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for wavelengths out of range or fewer than 2.
    pub fn evenly_spaced(first_nm: f64, last_nm: f64, count: usize) -> Result<RgbFromSpectrum, SynthError> {
        if count < 2 {
            let allowed = "2 wavelengths or more".to_owned();
            return Err(SynthError::BadParameter { name: "a spectrum", value: count.to_string(), allowed });
        }
        let at = |i: usize| first_nm + (last_nm - first_nm) * i as f64 / (count - 1) as f64;
        let wavelengths_nm: Vec<f64> = (0..count).map(at).collect();
        if let Some(nm) = wavelengths_nm.iter().find(|nm| !(VISIBLE_NM[0]..=VISIBLE_NM[1]).contains(*nm)) {
            let allowed = format!("wavelengths from {} to {} nm", VISIBLE_NM[0], VISIBLE_NM[1]);
            return Err(SynthError::BadParameter { name: "a wavelength", value: format!("{nm} nm"), allowed });
        }
        Ok(RgbFromSpectrum::under_d65(wavelengths_nm))
    }

    /// Returns the converter of evenly spaced wavelengths inside the tables.
    fn under_d65(wavelengths_nm: Vec<f64>) -> RgbFromSpectrum {
        let at = |column: &[f64], nm: f64| interpolated(column, cie::FIRST_NM, cie::STEP_NM, nm);
        let luminance: f64 = wavelengths_nm.iter().map(|&nm| at(&cie::D65, nm) * at(&cie::Y, nm)).sum();
        let mut weights: Vec<[f64; 3]> = wavelengths_nm
            .iter()
            .map(|&nm| {
                let xyz = [at(&cie::X, nm), at(&cie::Y, nm), at(&cie::Z, nm)];
                let power = at(&cie::D65, nm) / luminance;
                cie::RGB_FROM_XYZ.map(|row| power * (row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2]))
            })
            .collect();
        let uncorrected_white = std::array::from_fn(|channel| weights.iter().map(|w| w[channel]).sum());
        for weight in &mut weights {
            for channel in 0..3 {
                weight[channel] /= uncorrected_white[channel];
            }
        }
        RgbFromSpectrum { wavelengths_nm, weights, uncorrected_white }
    }

    /// Returns the wavelengths in nanometres that spectra are given at.
    pub fn wavelengths_nm(&self) -> &[f64] {
        &self.wavelengths_nm
    }

    /// Returns the mean wavelength of each channel in nanometres, weighted by its positive weights.
    pub fn mean_wavelengths_nm(&self) -> [f64; 3] {
        let mean = |channel: usize| {
            let terms = self.wavelengths_nm.iter().zip(&self.weights);
            let (sum, total) = terms.fold((0.0, 0.0), |(sum, total), (nm, weights)| {
                let weight = weights[channel].max(0.0);
                (sum + nm * weight, total + weight)
            });
            sum / f64::max(total, 1e-12)
        };
        [0, 1, 2].map(mean)
    }

    /// Returns linear sRGB of a spectrum at [`RgbFromSpectrum::wavelengths_nm`], signed.
    ///
    /// # Panics
    /// If the spectrum has another number of wavelengths.
    pub fn rgb(&self, spectrum: &[f64]) -> [f64; 3] {
        assert_eq!(spectrum.len(), self.weights.len(), "a value per wavelength");
        let mut rgb = [0.0; 3];
        for (weight, value) in self.weights.iter().zip(spectrum) {
            for channel in 0..3 {
                rgb[channel] += weight[channel] * value;
            }
        }
        rgb
    }

    /// Returns linear sRGB of a perfect reflector before the correction that makes it (1, 1, 1).
    pub fn uncorrected_white(&self) -> [f64; 3] {
        self.uncorrected_white
    }

    /// Returns the weights `[band][channel]` of [`RgbFromSpectrum::rgb`].
    pub(crate) fn weights(&self) -> &[[f64; 3]] {
        &self.weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_perfect_reflector_is_white_and_the_correction_is_small() {
        let convert = RgbFromSpectrum::new(RgbBands::Spectral31);
        assert_eq!(convert.wavelengths_nm().len(), 31);
        for channel in convert.rgb(&[1.0; 31]) {
            assert!((channel - 1.0).abs() < 1e-12);
        }
        for channel in convert.uncorrected_white() {
            assert!((channel - 1.0).abs() < 3e-3, "{:?}", convert.uncorrected_white());
        }
        assert_eq!(RgbFromSpectrum::new(RgbBands::ThreeWavelength).rgb(&[0.1, 0.2, 0.3]), [0.1, 0.2, 0.3]);
    }

    #[test]
    fn a_band_of_green_light_lies_outside_the_gamut_and_stays_signed() {
        let convert = RgbFromSpectrum::new(RgbBands::Spectral31);
        let green = |nm: &f64| if (nm - 520.0).abs() < 25.0 { 1.0 } else { 0.0 };
        let spectrum: Vec<f64> = convert.wavelengths_nm().iter().map(green).collect();
        let [r, g, b] = convert.rgb(&spectrum);
        assert!(g > 0.2 && r < 0.0, "{r} {g} {b}");
    }

    #[test]
    fn spectra_at_other_steps_give_the_same_colour_and_too_few_wavelengths_are_refused() {
        // A smooth edge, as a leaf's at 700 nm and a flower's at 500.
        let edge = |nm: &f64| 1.0 / (1.0 + (-(nm - 580.0) / 30.0).exp());
        let colour =
            |convert: &RgbFromSpectrum| convert.rgb(&convert.wavelengths_nm().iter().map(edge).collect::<Vec<f64>>());
        let fine = colour(&RgbFromSpectrum::evenly_spaced(400.0, 780.0, 381).unwrap());
        let coarse = colour(&RgbFromSpectrum::new(RgbBands::Spectral31));
        let three = colour(&RgbFromSpectrum::new(RgbBands::ThreeWavelength));
        let apart = |x: [f64; 3]| (0..3).map(|c| (x[c] - fine[c]).abs()).fold(0.0, f64::max);
        assert!(apart(coarse) < 3e-3, "{fine:?} {coarse:?}");
        // Planted difference.
        assert!(apart(three) > 0.03, "{fine:?} {three:?}");
        assert!(RgbFromSpectrum::evenly_spaced(390.0, 780.0, 10).is_err());
        assert!(RgbFromSpectrum::evenly_spaced(400.0, 780.0, 1).is_err());
    }
}

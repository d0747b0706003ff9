//! What the sun sends in the visible, and what an eye makes of it: sixteen bands to linear sRGB.

use btf_capture::cie;

/// Bands of the spectrum.
pub(crate) const BANDS: usize = 16;
/// Middle of the first band.
const FIRST_BAND_NM: f64 = 400.0;
/// Width from one band's middle to the next, nm: the last is at 700 nm.
const BAND_STEP_NM: f64 = 20.0;

/// A number for each band.
pub(crate) type Spectrum = [f32; BANDS];

/// A white diffuser (BRDF 1 / pi) under this illuminance has the linear sRGB radiance 1. A round number near what a
/// clear noon gives: exposures stay ordinary, and sun, sky and twilight keep their ratios.
pub const WHITE_ILLUMINANCE_LUX: f64 = 100_000.0;

/// Luminous efficacy of radiation at 540 THz, lm/W [CIE 015:2018].
const LUMENS_PER_WATT: f64 = 683.0;

/// First bin of [`SOLAR_IRRADIANCE`].
const FIRST_BIN_NM: f64 = 380.0;
/// Width of its bins.
const BIN_NM: f64 = 10.0;

/// Irradiance outside the atmosphere at 1 astronomical unit, W / (m^2 nm): the mean of each 10 nm from 380 nm on
/// [ASTM G173-03, extraterrestrial column].
#[rustfmt::skip]
const SOLAR_IRRADIANCE: [f64; 41] = [
    1.01249, 1.14716, 1.72765, 1.73054, 1.6887, 1.61253, 1.91198, 2.03474, 2.02042, 2.02212, 1.93377, 1.95809, 1.91686,
    1.8298, 1.8685, 1.8931, 1.85149, 1.8504, 1.8341, 1.8345, 1.8147, 1.78158, 1.7533, 1.6965, 1.68194, 1.64654, 1.6048,
    1.52143, 1.55622, 1.5113, 1.474, 1.4482, 1.41018, 1.36775, 1.34188, 1.31429, 1.28303, 1.26758, 1.2367, 1.2082,
    1.18737,
];

/// Returns the middle of each band in nanometres.
pub(crate) fn band_nm() -> [f64; BANDS] {
    std::array::from_fn(|band| FIRST_BAND_NM + BAND_STEP_NM * band as f64)
}

/// From what becomes of the sun's light in each band (radiance over irradiance outside the atmosphere, 1/sr, or a share
/// of the irradiance) to linear sRGB.
#[derive(Debug, Clone)]
pub(crate) struct RgbFromSunlight {
    /// `[band][channel]`, for radiance.
    weights: [[f64; 3]; BANDS],
}

impl RgbFromSunlight {
    /// Returns the spectrum at `distance_au` from the sun. A spectrum is taken as linear between the bands and constant
    /// beyond the first and the last, so that the sun's own lines keep their weight; CIE 1931, 380 to 780 nm in steps
    /// of 5 nm [CIE 015:2018].
    pub(crate) fn new(distance_au: f64) -> RgbFromSunlight {
        let scale = LUMENS_PER_WATT * std::f64::consts::PI / WHITE_ILLUMINANCE_LUX / distance_au.powi(2);
        let mut weights = [[0.0; 3]; BANDS];
        for row in 0..cie::ROWS {
            let nm = cie::FIRST_NM + cie::STEP_NM * row as f64;
            // A row at the border of two bins has half of each.
            let bin = |nm: f64| SOLAR_IRRADIANCE[((nm - FIRST_BIN_NM) / BIN_NM).max(0.0) as usize];
            let power = scale * cie::STEP_NM * 0.5 * (bin(nm - 1.0) + bin(nm + 1.0));
            let rgb = linear_srgb([cie::X[row], cie::Y[row], cie::Z[row]]);
            let at = ((nm - FIRST_BAND_NM) / BAND_STEP_NM).clamp(0.0, (BANDS - 1) as f64);
            let below = (at as usize).min(BANDS - 2);
            let share = at - below as f64;
            for channel in 0..3 {
                weights[below][channel] += (1.0 - share) * power * rgb[channel];
                weights[below + 1][channel] += share * power * rgb[channel];
            }
        }
        RgbFromSunlight { weights }
    }

    /// Converts to linear sRGB, in the gamut.
    pub(crate) fn rgb(&self, spectrum: &Spectrum) -> [f32; 3] {
        let mut rgb = [0.0; 3];
        for (weight, value) in self.weights.iter().zip(spectrum) {
            for channel in 0..3 {
                rgb[channel] += weight[channel] * f64::from(*value);
            }
        }
        in_gamut(rgb)
    }
}

fn linear_srgb(xyz: [f64; 3]) -> [f64; 3] {
    cie::RGB_FROM_XYZ.map(|row| row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2])
}

/// Returns the luminance of linear sRGB as a share of white's [IEC 61966-2-1].
pub fn luminance(rgb: [f64; 3]) -> f64 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

/// Makes a colour that sRGB does not hold (a negative channel) paler until it does; its luminance stays.
fn in_gamut(rgb: [f64; 3]) -> [f32; 3] {
    let grey = luminance(rgb).max(0.0);
    let least = rgb.into_iter().fold(f64::MAX, f64::min);
    let keep = if least < 0.0 { grey / (grey - least) } else { 1.0 };
    rgb.map(|x| (grey + keep * (x - grey)).max(0.0) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Illuminance of a spectrum of irradiance.
    fn lux(spectrum: &Spectrum) -> f64 {
        let rgb = RgbFromSunlight::new(1.0).rgb(spectrum).map(f64::from);
        luminance(rgb) * WHITE_ILLUMINANCE_LUX / std::f64::consts::PI
    }

    #[test]
    fn the_sun_outside_the_atmosphere_is_as_bright_and_as_yellow_as_published() {
        // 133.1 klx [Darula 2005: solar illuminance constant 133.3 klx].
        let found = lux(&[1.0; BANDS]);
        assert!((found / 133_300.0 - 1.0).abs() < 0.01, "{found}");
        let rgb = RgbFromSunlight::new(1.0).rgb(&[1.0; BANDS]);
        // 5,900 K or so: redder than D65.
        assert!(rgb[0] > rgb[1] && rgb[1] > rgb[2] && rgb[2] > 0.8 * rgb[0], "{rgb:?}");
        // In January the earth is nearer.
        let near = RgbFromSunlight::new(0.9833).rgb(&[1.0; BANDS]);
        assert!((near[1] / rgb[1] - 1.0343).abs() < 1e-3);
    }

    #[test]
    fn colours_outside_the_gamut_become_paler_at_the_same_luminance() {
        for rgb in [[0.5, 0.4, -0.2], [1.0, -0.1, -0.1], [-1e-9, 1e-9, 0.0], [-0.2, 0.3, 0.9]] {
            let found = in_gamut(rgb).map(f64::from);
            assert!(found.iter().all(|x| *x >= 0.0), "{found:?}");
            assert!((luminance(found) / luminance(rgb) - 1.0).abs() < 1e-5, "{rgb:?} {found:?}");
        }
        assert_eq!(in_gamut([0.25, 0.5, 0.75]), [0.25, 0.5, 0.75]);
        assert_eq!(in_gamut([-1.0, -1.0, -1.0]), [0.0; 3]);
    }
}

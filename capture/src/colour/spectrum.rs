//! Converts reflectance spectra to linear sRGB.

use crate::colour::cie;

/// Range of wavelengths in nanometres that a channel's name may stand for: what optical instruments measure.
pub(crate) const PLAUSIBLE_NM: std::ops::RangeInclusive<f64> = 100.0..=20_000.0;

/// Returns the wavelength in nanometres that a channel's name states: a number, with or without `nm` behind it, or as
/// spectral EXR files name reflectances, `T.550,5nm` [Fichet 2021].
pub(crate) fn wavelength_nm(name: &str) -> Option<f64> {
    let name = name.trim_matches(|c: char| c.is_whitespace() || c == '\0');
    let (name, decimal) =
        name.strip_prefix("T.").map_or((name, name.to_owned()), |rest| (rest, rest.replace(',', ".")));
    let name = if decimal == name { name } else { &decimal };
    let number = name.strip_suffix("nm").unwrap_or(name).trim_end();
    let plain = number.starts_with(|c: char| c.is_ascii_digit())
        && number.len() <= 24
        && number.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
    number.parse().ok().filter(|nm| plain && PLAUSIBLE_NM.contains(nm))
}

/// Returns the weights of the reflectances at `wavelengths_nm`, `[wavelength][channel]`, that sum to linear sRGB.
///
/// A spectrum is linear between its wavelengths and constant beyond the first and the last. The weights integrate it
/// with the CIE 1931 2-degree observer under D65, 380 to 780 nm in steps of 5 nm [CIE 015:2018]. Each channel is
/// divided by what a perfect reflector gives, so that a reflectance of 1 everywhere is (1, 1, 1) exactly. Wavelengths
/// outside the visible have weights near 0.
///
/// Returns `None` if two wavelengths are equal or there is none.
pub fn rgb_weights(wavelengths_nm: &[f64]) -> Option<Vec<[f32; 3]>> {
    let mut order: Vec<usize> = (0..wavelengths_nm.len()).collect();
    order.sort_by(|&a, &b| wavelengths_nm[a].total_cmp(&wavelengths_nm[b]));
    let (&first, &last) = (order.first()?, order.last()?);
    if order.windows(2).any(|pair| wavelengths_nm[pair[0]] == wavelengths_nm[pair[1]]) {
        return None;
    }
    let mut weights = vec![[0f64; 3]; wavelengths_nm.len()];
    for row in 0..cie::ROWS {
        let nm = cie::FIRST_NM + cie::STEP_NM * row as f64;
        let xyz = [cie::X[row], cie::Y[row], cie::Z[row]];
        let rgb = cie::RGB_FROM_XYZ.map(|m| cie::D65[row] * (m[0] * xyz[0] + m[1] * xyz[1] + m[2] * xyz[2]));
        let above = order.partition_point(|&i| wavelengths_nm[i] <= nm);
        let shares = match (above.checked_sub(1).map(|below| order[below]), order.get(above)) {
            (None, _) => [(first, 1.0), (first, 0.0)],
            (Some(_), None) => [(last, 1.0), (last, 0.0)],
            (Some(below), Some(&above)) => {
                let share = (nm - wavelengths_nm[below]) / (wavelengths_nm[above] - wavelengths_nm[below]);
                [(below, 1.0 - share), (above, share)]
            }
        };
        for (at, share) in shares {
            for channel in 0..3 {
                weights[at][channel] += share * rgb[channel];
            }
        }
    }
    let white: [f64; 3] = std::array::from_fn(|channel| weights.iter().map(|weight| weight[channel]).sum());
    Some(weights.iter().map(|weight| std::array::from_fn(|c| (weight[c] / white[c]) as f32)).collect())
}

/// Returns linear sRGB of the spectrum `values`, one value for each of `weights`.
pub fn rgb_of(weights: &[[f32; 3]], values: &[f32]) -> [f32; 3] {
    let mut rgb = [0f32; 3];
    for (weight, value) in weights.iter().zip(values) {
        for channel in 0..3 {
            rgb[channel] += weight[channel] * value;
        }
    }
    rgb
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns linear sRGB of a reflectance given as a function of nanometres, integrated slowly: every nanometre, with
    /// interpolated tables.
    fn slow(reflectance: impl Fn(f64) -> f64) -> [f64; 3] {
        let at = |table: &[f64], nm: f64| {
            let position = (nm - cie::FIRST_NM) / cie::STEP_NM;
            let row = (position as usize).min(cie::ROWS - 2);
            table[row] + (table[row + 1] - table[row]) * (position - row as f64)
        };
        let (mut sum, mut white) = ([0.0; 3], [0.0; 3]);
        for nm in 380..=780 {
            let nm = f64::from(nm);
            let xyz = [&cie::X, &cie::Y, &cie::Z].map(|table| at(table, nm) * at(&cie::D65, nm));
            for channel in 0..3 {
                let m = cie::RGB_FROM_XYZ[channel];
                let value = m[0] * xyz[0] + m[1] * xyz[1] + m[2] * xyz[2];
                sum[channel] += value * reflectance(nm);
                white[channel] += value;
            }
        }
        std::array::from_fn(|channel| sum[channel] / white[channel])
    }

    #[test]
    fn a_perfect_reflector_is_white_at_any_wavelengths_and_grey_stays_grey() {
        for wavelengths in [vec![400.0, 700.0], vec![550.0], (0..31).map(|i| 400.0 + 10.0 * f64::from(i)).collect()] {
            let weights = rgb_weights(&wavelengths).unwrap();
            let rgb = rgb_of(&weights, &vec![0.5; wavelengths.len()]);
            assert!(rgb.iter().all(|value| (value - 0.5).abs() < 1e-5), "{rgb:?}");
        }
        assert!(rgb_weights(&[]).is_none() && rgb_weights(&[500.0, 400.0, 500.0]).is_none());
    }

    #[test]
    fn smooth_spectra_agree_with_the_fine_integral_in_any_order_of_channels() {
        let reflectance = |nm: f64| 0.5 + 0.45 * ((nm - 380.0) / 57.0).sin();
        let mut wavelengths: Vec<f64> = (0..41).map(|i| 380.0 + 10.0 * f64::from(i)).collect();
        for reversed in [false, true] {
            if reversed {
                wavelengths.reverse();
            }
            let values: Vec<f32> = wavelengths.iter().map(|&nm| reflectance(nm) as f32).collect();
            let rgb = rgb_of(&rgb_weights(&wavelengths).unwrap(), &values);
            let expected = slow(reflectance);
            for channel in 0..3 {
                let error = f64::from(rgb[channel]) - expected[channel];
                assert!(error.abs() < 3e-3, "channel {channel}: {} against {}", rgb[channel], expected[channel]);
            }
        }
        // A planted difference: the same spectrum 20 nm off.
        let values: Vec<f32> = wavelengths.iter().map(|&nm| reflectance(nm + 20.0) as f32).collect();
        let shifted = rgb_of(&rgb_weights(&wavelengths).unwrap(), &values);
        assert!((f64::from(shifted[1]) - slow(reflectance)[1]).abs() > 0.02);
    }

    #[test]
    fn the_tables_give_the_white_of_d65_and_known_colours() {
        // Chromaticity of D65 for the 2-degree observer is (0.3127, 0.3290) [CIE 015:2018].
        let sum = |table: &[f64]| -> f64 { table.iter().zip(&cie::D65).map(|(a, b)| a * b).sum() };
        let (x, y, z) = (sum(&cie::X), sum(&cie::Y), sum(&cie::Z));
        assert!((x / (x + y + z) - 0.3127).abs() < 1e-4 && (y / (x + y + z) - 0.3290).abs() < 1e-4);
        let weights = rgb_weights(&(0..81).map(|i| 380.0 + 5.0 * f64::from(i)).collect::<Vec<_>>()).unwrap();
        let band = |low: usize, high: usize| {
            rgb_of(&weights, &(0..81).map(|i| f32::from(u8::from((low..high).contains(&i)))).collect::<Vec<_>>())
        };
        // 600 nm and above is red, 500 to 560 nm green out of gamut, below 470 nm blue.
        let (red, green, blue) = (band(44, 81), band(24, 36), band(0, 18));
        assert!(red[0] > 0.6 && red[1] < 0.1 && red[2].abs() < 0.1, "{red:?}");
        assert!(green[1] > 0.4 && green[0] < 0.0, "{green:?}");
        assert!(blue[2] > 0.5 && blue[0] < 0.2 && blue[1] < 0.05, "{blue:?}");
    }

    #[test]
    fn channel_names_that_are_wavelengths_are_told_from_others() {
        for (name, nm) in [("450", 450.0), ("450nm", 450.0), ("412.5 nm", 412.5), ("700\0", 700.0), (" 380 ", 380.0)] {
            assert_eq!(wavelength_nm(name), Some(nm), "{name:?}");
        }
        for name in ["R", "", "nm", "-450", "4e2", "inf", "NaN", "450.5.5", "0", "1", "S0.400"] {
            assert_eq!(wavelength_nm(name), None, "{name:?}");
        }
    }
}

//! Converts the channels of a UBO2014 file to linear sRGB, from the colour models that its factorisations work in or
//! from spectra.

use super::header::Header;
use crate::colour::spectrum::{rgb_of, rgb_weights, wavelength_nm};

/// Offset that is added before a logarithm is taken.
const LOG_OFFSET: f32 = 1e-5;

/// Matrix from YUV to RGB, as the files' own readers have it.
const RGB_FROM_YUV: [[f32; 3]; 3] = [[1.0, 0.0, 1.13983], [1.0, -0.39465, -0.5806], [1.0, 2.03211, 0.0]];

/// Matrix from YCoCg to RGB.
const RGB_FROM_YCOCG: [[f32; 3]; 3] = [[1.0, 1.0, -1.0], [1.0, 0.0, 1.0], [1.0, -1.0, -1.0]];

/// XYZ of the white point D50, 2-degree observer, that Lab values of colour profiles are relative to [CIE 015:2018].
const XYZ_OF_D50: [f32; 3] = [0.964_22, 1.0, 0.825_21];

/// Matrix from XYZ relative to D50 to linear sRGB, with Bradford adaptation of the white point [IEC 61966-2-1, ICC.1].
const RGB_FROM_XYZ_D50: [[f32; 3]; 3] = [
    [3.133_856, -1.616_866_7, -0.490_614_6],
    [-0.978_768_4, 1.916_141_5, 0.033_454],
    [0.071_945_3, -0.228_991_4, 1.405_242_7],
];

/// Colour model by which colours became the values of the channels; numbers are those of the files.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Model {
    /// Model 0: colours or reflectances without conversion.
    Plain,
    /// Model 1: YUV.
    Yuv,
    /// Model 2: CIE L*a*b*.
    Lab,
    /// Model 3: principal axes of the colours, row by row, and their mean.
    Axes { matrix: [f32; 9], mean: [f32; 3] },
    /// Model 4: YCoCg.
    YCoCg,
    /// Model 5: the sum, then each other channel's share of it.
    Shares,
    /// Model 6: the mean, then each other channel's relative difference from it.
    Differences,
    /// Model 9: YUV with the logarithm of Y.
    LogYuv,
    /// Model 10: YUV with the logarithms of all three, with their signs.
    AllLogYuv,
    /// Model 11: the logarithm of Y, U/Y and V/Y.
    LogYuvRatios,
    /// Model 12: the logarithm of each channel.
    Log,
}

/// Meaning of the channels after the colour model is undone.
#[derive(Debug, Clone, PartialEq)]
enum Channels {
    /// Indices of red, green and blue.
    Rgb([usize; 3]),
    /// One channel for red, green and blue.
    Grey,
    /// Spectrum with the weights of its wavelengths, `[channel][rgb]`.
    Spectrum(Vec<[f32; 3]>),
}

/// Dynamic range reduction of all values, beneath the colour model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reduction {
    /// No reduction.
    None,
    /// Logarithm of every value.
    Logarithm,
}

/// Converter of the values of one texel's channels to linear sRGB.
#[derive(Debug, Clone)]
pub(super) struct ToRgb {
    model: Model,
    reduction: Reduction,
    channels: Channels,
}

impl ToRgb {
    /// Returns the converter of a file that names no colour model.
    pub(super) fn plain(header: &Header, reduction: Reduction) -> Result<ToRgb, String> {
        Ok(ToRgb { model: Model::Plain, reduction, channels: channels_of(header)? })
    }

    /// Returns the converter of colour model `number` with its `mean` and `matrix`.
    pub(super) fn of_model(header: &Header, number: i32, mean: [f32; 3], matrix: [f32; 9]) -> Result<ToRgb, String> {
        let model = match number {
            0 => Model::Plain,
            1 => Model::Yuv,
            2 => Model::Lab,
            3 => Model::Axes { matrix, mean },
            4 => Model::YCoCg,
            5 => Model::Shares,
            6 => Model::Differences,
            9 => Model::LogYuv,
            10 => Model::AllLogYuv,
            11 => Model::LogYuvRatios,
            12 => Model::Log,
            _ => return Err(format!("its colour model {number} is none of 0 to 6 and 9 to 12")),
        };
        let count = header.channels.len();
        let any_count = matches!(model, Model::Plain | Model::Shares | Model::Differences | Model::Log);
        if !any_count && count != 3 {
            return Err(format!("its colour model {number} needs 3 channels and it has {count}"));
        }
        if let Model::Axes { matrix, mean } = model
            && matrix.iter().chain(&mean).any(|number| !number.is_finite())
        {
            return Err("its colour matrix is not finite".into());
        }
        Ok(ToRgb { model, reduction: Reduction::None, channels: channels_of(header)? })
    }

    /// Returns linear sRGB of one texel. `values`, one per channel, are overwritten.
    #[inline]
    pub(super) fn rgb(&self, values: &mut [f32]) -> [f32; 3] {
        undo(self.model, values);
        if self.reduction == Reduction::Logarithm {
            values.iter_mut().for_each(|value| *value = value.exp() - LOG_OFFSET);
        }
        match &self.channels {
            Channels::Rgb(places) => places.map(|place| values[place]),
            Channels::Grey => [values[0]; 3],
            Channels::Spectrum(weights) => rgb_of(weights, values),
        }
    }
}

fn channels_of(header: &Header) -> Result<Channels, String> {
    let names = &header.channels;
    let wavelengths: Option<Vec<f64>> = names.iter().map(|name| wavelength_nm(name)).collect();
    if let Some(wavelengths) = wavelengths {
        return rgb_weights(&wavelengths)
            .map(Channels::Spectrum)
            .ok_or_else(|| "two of its channels are named by one wavelength".into());
    }
    let place = |letter: &str| names.iter().position(|name| name.eq_ignore_ascii_case(letter));
    match (names.len(), place("R"), place("G"), place("B")) {
        (1, ..) => Ok(Channels::Grey),
        (3, Some(r), Some(g), Some(b)) => Ok(Channels::Rgb([r, g, b])),
        // Named after a colour model or not at all.
        (3, ..) => Ok(Channels::Rgb([0, 1, 2])),
        (count, ..) => Err(format!("its {count} channels are not named by wavelengths in nanometres")),
    }
}

fn product(matrix: &[[f32; 3]; 3], values: &mut [f32]) {
    let v = [values[0], values[1], values[2]];
    for (value, row) in values.iter_mut().zip(matrix) {
        *value = row[0] * v[0] + row[1] * v[1] + row[2] * v[2];
    }
}

#[inline]
fn undo(model: Model, values: &mut [f32]) {
    match model {
        Model::Plain => {}
        Model::Yuv => product(&RGB_FROM_YUV, values),
        Model::Lab => {
            // [CIE 015:2018, section 8.2.1].
            let y = (values[0] + 16.0) / 116.0;
            let roots = [y + values[1] / 500.0, y, y - values[2] / 200.0];
            const KNEE: f32 = 6.0 / 29.0;
            for i in 0..3 {
                let root = roots[i];
                let ratio = if root > KNEE { root.powi(3) } else { 3.0 * KNEE * KNEE * (root - 4.0 / 29.0) };
                values[i] = ratio * XYZ_OF_D50[i];
            }
            product(&RGB_FROM_XYZ_D50, values);
        }
        Model::Axes { matrix, mean } => {
            let v = [values[0], values[1], values[2]];
            for i in 0..3 {
                values[i] = v[0] * matrix[i] + v[1] * matrix[3 + i] + v[2] * matrix[6 + i] + mean[i];
            }
        }
        Model::YCoCg => product(&RGB_FROM_YCOCG, values),
        Model::Shares => {
            let sum = values[0];
            let mut first = 1.0;
            for value in &mut values[1..] {
                first -= *value;
                *value *= sum;
            }
            values[0] = first * sum;
        }
        Model::Differences => {
            // The first channel is scaled by the number of channels.
            let count = values.len() as f32;
            let sum = values[0] * count;
            let others: f32 = values[1..].iter().sum();
            values[0] = sum - others / count;
            for value in &mut values[1..] {
                *value = sum + *value * sum;
            }
        }
        Model::LogYuv => {
            values[0] = values[0].exp() - LOG_OFFSET;
            product(&RGB_FROM_YUV, values);
        }
        Model::AllLogYuv => {
            values[0] = values[0].exp() - LOG_OFFSET;
            for value in &mut values[1..3] {
                // Zero is neither positive nor negative.
                let size = if *value == 0.0 { 0.0 } else { value.abs().exp() * LOG_OFFSET };
                *value = size.copysign(*value);
            }
            product(&RGB_FROM_YUV, values);
        }
        Model::LogYuvRatios => {
            let luma = values[0].exp();
            values[0] = luma - LOG_OFFSET;
            values[1] *= luma;
            values[2] *= luma;
            product(&RGB_FROM_YUV, values);
        }
        Model::Log => values.iter_mut().for_each(|value| *value = value.exp() - LOG_OFFSET),
    }
}

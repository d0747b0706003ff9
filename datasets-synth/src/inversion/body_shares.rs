//! Body of `plate-n` as a camera sees it: in colours under D65, or in bands, with exact derivatives.

use crate::inversion::forward::{MAX_UNKNOWNS, Unknown, Values};
use crate::inversion::least_squares::{Minimum, Normal, minimum};
use crate::inversion::plates::{PLATE_UNKNOWNS, PlateBand, plate_unknowns};
use crate::optics::colour::{RgbBands, RgbFromSpectrum};

/// Standard error of the model's shares: what the coupling with the gloss and the margin of the paper's cone leave open.
const MODEL_ERROR: f64 = 5e-3;
/// Distance in nanometres over which errors of bands hang together: bands that are nearer count as one, by shares.
const TOGETHER_NM: f64 = 60.0;

/// Shares of the light that come back or through, `[channel]` each, as far as there is a capture of them: light and eye on one
/// side, on two sides.
pub(crate) type Shares<'a> = [Option<&'a [f32]>; 2];

/// Body of `plate-n`, asked for the channels of a capture.
pub(crate) struct BodyShares {
    unknowns: [Unknown; PLATE_UNKNOWNS],
    channels: usize,
    /// Pile of each wavelength, and what it adds to channels.
    bands: Vec<(PlateBand, Vec<(usize, f64)>)>,
    /// Measurements that a channel counts as, at most 1.
    counts: f64,
}

/// Unknowns that a search finds, and how far they vary about what is known.
pub(crate) struct Sought {
    /// Unknowns that are looked for.
    pub(crate) free: [bool; MAX_UNKNOWNS],
    /// Values about which they vary, and those of the others.
    pub(crate) about: Values,
    /// Standard deviations.
    pub(crate) spread: Values,
}

impl BodyShares {
    /// Prepares linear red, green and blue under D65.
    pub(crate) fn colours() -> BodyShares {
        let convert = RgbFromSpectrum::new(RgbBands::Spectral31);
        let bands = convert.wavelengths_nm().iter().zip(convert.weights());
        let band =
            |(nm, weights): (&f64, &[f64; 3])| (PlateBand::entered(*nm), weights.iter().copied().enumerate().collect());
        BodyShares { unknowns: plate_unknowns(), channels: 3, bands: bands.map(band).collect(), counts: 1.0 }
    }

    /// Prepares bands at wavelengths within the table of plates, ascending.
    pub(crate) fn bands(wavelengths_nm: &[f64]) -> BodyShares {
        let band = |(channel, nm): (usize, &f64)| (PlateBand::entered(*nm), vec![(channel, 1.0)]);
        let range = wavelengths_nm.last().copied().unwrap_or(0.0) - wavelengths_nm.first().copied().unwrap_or(0.0);
        let channels = wavelengths_nm.len();
        BodyShares {
            unknowns: plate_unknowns(),
            channels,
            bands: wavelengths_nm.iter().enumerate().map(band).collect(),
            counts: ((1.0 + range / TOGETHER_NM) / channels.max(1) as f64).min(1.0),
        }
    }

    /// Returns the number of channels.
    pub(crate) fn channels(&self) -> usize {
        self.channels
    }

    /// Returns the unknowns of the model.
    pub(crate) fn unknowns(&self) -> &[Unknown] {
        &self.unknowns
    }

    /// Returns the contents that are likeliest for `seen` with their standard `errors`.
    pub(crate) fn fitted(&self, seen: &Shares, errors: &Shares, sought: &Sought) -> Minimum {
        let Sought { free, about, spread } = sought;
        let spans = self.unknowns.map(|unknown| unknown.span());
        let free_ones = || (0..PLATE_UNKNOWNS).filter(|i| free[*i]);
        minimum(&self.unknowns, free, *about, |values| {
            let mut normal = Normal::new(PLATE_UNKNOWNS);
            let told = self.at(values);
            for side in 0..2 {
                let (Some(seen), Some(errors)) = (seen[side], errors[side]) else { continue };
                for (channel, (value, by)) in told[side].iter().enumerate() {
                    let error = f64::from(errors[channel]).hypot(MODEL_ERROR) / self.counts.sqrt();
                    let mut scaled = [0.0; MAX_UNKNOWNS];
                    free_ones().for_each(|i| scaled[i] = by[i] * spans[i] / error);
                    normal.add((value - f64::from(seen[channel])) / error, &scaled);
                }
            }
            for i in free_ones() {
                let mut by = [0.0; MAX_UNKNOWNS];
                by[i] = spans[i] / spread[i];
                normal.add((values[i] - about[i]) / spread[i], &by);
            }
            normal.mirrored()
        })
    }

    /// Returns the standard errors of what was free where [`BodyShares::fitted`] has ended; 0 for the others.
    pub(crate) fn standard_errors(&self, found: &Minimum, free: &[bool; MAX_UNKNOWNS]) -> Values {
        let covariance = found.covariance(free);
        let mut errors = [0.0; MAX_UNKNOWNS];
        for (i, unknown) in self.unknowns.iter().enumerate().filter(|(i, _)| free[*i]) {
            errors[i] = covariance[(i, i)].sqrt() * unknown.span();
        }
        errors
    }

    /// Returns the shares `[side][channel]` with their derivatives by the unknowns.
    pub(crate) fn at(&self, values: &Values) -> [Vec<(f64, Values)>; 2] {
        let mut told = [(); 2].map(|()| vec![(0.0, [0.0; MAX_UNKNOWNS]); self.channels]);
        for (band, channels) in &self.bands {
            let here = band.at(values);
            for (told, (share, by_unknown)) in told.iter_mut().zip(here.shares.iter().zip(&here.by)) {
                for (channel, weight) in channels {
                    let (value, by) = &mut told[*channel];
                    *value += weight * share;
                    by[..PLATE_UNKNOWNS].iter_mut().zip(by_unknown).for_each(|(by, own)| *by += weight * own);
                }
            }
        }
        told
    }

    /// Returns the sum of squared differences between `seen` and the shares of `values`.
    pub(crate) fn squares(&self, seen: &Shares, values: &Values) -> f64 {
        let told = self.at(values);
        let sides = seen.iter().zip(&told).filter_map(|(seen, told)| Some(((*seen)?, told)));
        sides.flat_map(|(seen, told)| seen.iter().zip(told).map(|(x, (y, _))| (f64::from(*x) - y).powi(2))).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inversion::plates::values_of;
    use crate::optics::plates::body::PlateBody;
    use crate::optics::plates::model::PlateModel;
    use crate::optics::specific_absorption::SpecificAbsorption;
    use btf_models::LeafContents;

    #[test]
    fn the_body_has_the_colour_of_the_capture_and_its_derivatives() {
        let leaf = LeafContents { brown: 0.1, anthocyanin_ug_per_cm2: 2.0, ..LeafContents::default() };
        let plates = PlateBody::new(PlateModel::N, SpecificAbsorption::ProspectD, RgbBands::Spectral31).unwrap();
        let rgb = plates.rgb(&leaf, 1.0);
        let body = BodyShares::colours();
        for (told, rgb) in body.at(&values_of(&leaf)).iter().zip([rgb.reflectance, rgb.transmittance]) {
            assert!(told.iter().zip(rgb).all(|((value, _), rgb)| (value - f64::from(rgb)).abs() < 1e-6));
        }
        for body in [body, BodyShares::bands(&[450.0, 550.0, 705.0, 1450.0, 2200.0])] {
            let told = body.at(&values_of(&leaf));
            for (i, unknown) in plate_unknowns().iter().enumerate() {
                let step = 1e-4 * unknown.span();
                let moved = |by: f64, side: usize, channel: usize| {
                    let mut values = values_of(&leaf);
                    values[i] += by;
                    body.at(&values)[side][channel].0
                };
                for side in 0..2 {
                    for channel in 0..body.channels() {
                        let rise = (moved(step, side, channel) - moved(-step, side, channel)) / (2.0 * step);
                        let by = told[side][channel].1[i];
                        assert!(
                            (rise - by).abs() < 2e-3 * rise.abs() + 1e-6 / unknown.span(),
                            "{side} {channel} {i}: {rise} {by}"
                        );
                        // Planted difference: the other side's slope is another.
                        let other = told[1 - side][channel].1[i];
                        assert!(i != 0 || rise.abs() < 1e-9 || (other - rise).abs() > 1e-3 * rise.abs());
                    }
                }
            }
        }
    }
}

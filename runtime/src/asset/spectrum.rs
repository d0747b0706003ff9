//! Wavelengths of an asset whose channels are no colours alone. A band's value is a weighted sum of the channels, and so is
//! what decoders give ([`crate::decode::shown`]). Channels come in groups of three: each measured light is there once for
//! each group, one group after the other, and everything else is shared.

/// Most bands of an asset.
pub const MAX_BANDS: usize = 256;
/// Most groups of three channels.
pub const MAX_GROUPS: usize = 4;
/// Wavelengths in nanometres that a band may have.
pub const BAND_RANGE_NM: std::ops::RangeInclusive<f32> = 100.0..=20_000.0;
/// Largest weight of a channel.
pub const MAX_BAND_WEIGHT: f32 = 1000.0;
/// Largest value of a channel that is weighted, so that a finite value stays finite.
pub const MAX_CHANNEL: f32 = 1e30;
/// Number of words before the weights: of bands, and of groups.
pub const SPECTRUM_HEAD: usize = 2;

/// Values of all channels of an asset, group after group; those beyond its groups stay 0.
pub type Channels = [f32; 3 * MAX_GROUPS];

/// The bands of an asset, and how they follow from its channels.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// Wavelengths in nanometres within [`BAND_RANGE_NM`], ascending, at most [`MAX_BANDS`].
    pub wavelengths_nm: Vec<f32>,
    /// Groups of three channels, 1 to [`MAX_GROUPS`].
    pub groups: usize,
    /// Weights of the channels in each band, of at most [`MAX_BAND_WEIGHT`]; those of channels that are not there are 0.
    pub weights: Vec<Channels>,
    /// Weights of the channels in each of the three values that decoders give. In a file they give linear sRGB under D65; a
    /// program may ask for another illuminant, other eyes, or three of the bands.
    pub shown: [Channels; 3],
}

impl Spectrum {
    /// Returns whether all numbers are in their ranges.
    pub fn is_valid(&self) -> bool {
        let bands = self.wavelengths_nm.len();
        let weights = || self.weights.iter().chain(&self.shown);
        (1..=MAX_BANDS).contains(&bands)
            && (1..=MAX_GROUPS).contains(&self.groups)
            && self.weights.len() == bands
            && self.wavelengths_nm.iter().all(|nm| BAND_RANGE_NM.contains(nm))
            && self.wavelengths_nm.windows(2).all(|pair| pair[0] < pair[1])
            && weights().flatten().all(|weight| weight.abs() <= MAX_BAND_WEIGHT)
            && weights().all(|weights| weights[3 * self.groups..].iter().all(|weight| *weight == 0.0))
    }

    /// Returns the values of all bands, at least 0, for values of the channels.
    pub fn bands(&self, channels: Channels) -> impl Iterator<Item = f32> + '_ {
        self.weights.iter().map(move |weights| weighted_channels(weights, &channels))
    }

    /// Returns the weights by which decoders give what a spectrum with weights `of_bands`, `[band][value]`, gives: those of
    /// colours under an illuminant, say, or 1 for three bands.
    pub fn shown_through(&self, of_bands: &[[f32; 3]]) -> [Channels; 3] {
        let sum = |value: usize, channel: usize| {
            let products =
                self.weights.iter().zip(of_bands).map(|(weights, of)| f64::from(weights[channel] * of[value]));
            products.sum::<f64>() as f32
        };
        std::array::from_fn(|value| std::array::from_fn(|channel| sum(value, channel)))
    }

    /// Returns the words of the file's section, which are those of the resident form.
    pub(crate) fn to_words(&self) -> Vec<u32> {
        let used = 3 * self.groups;
        let rows = |rows: &[Channels]| rows.iter().flat_map(|row| row[..used].to_vec()).collect::<Vec<f32>>();
        let numbers = [rows(&self.shown), self.wavelengths_nm.clone(), rows(&self.weights)].concat();
        let head = [self.wavelengths_nm.len() as u32, self.groups as u32];
        head.into_iter().chain(numbers.into_iter().map(f32::to_bits)).collect()
    }

    /// Reads the words of [`Spectrum::to_words`], which may be followed by others, with their number; `None` for words that
    /// are none.
    pub(crate) fn from_words(words: &[u32]) -> Option<(Spectrum, usize)> {
        let [bands, groups] = [*words.first()? as usize, *words.get(1)? as usize];
        if !(1..=MAX_BANDS).contains(&bands) || !(1..=MAX_GROUPS).contains(&groups) {
            return None;
        }
        let used = 3 * groups;
        let length = SPECTRUM_HEAD + used * 3 + bands + used * bands;
        let numbers: Vec<f32> = words.get(SPECTRUM_HEAD..length)?.iter().map(|word| f32::from_bits(*word)).collect();
        let row = |row: &[f32]| {
            let mut channels = [0.0; 3 * MAX_GROUPS];
            channels[..used].copy_from_slice(row);
            channels
        };
        let (shown, rest) = numbers.split_at(3 * used);
        let (wavelengths_nm, weights) = rest.split_at(bands);
        let spectrum = Spectrum {
            wavelengths_nm: wavelengths_nm.to_vec(),
            groups,
            weights: weights.chunks(used).map(row).collect(),
            shown: std::array::from_fn(|value| row(&shown[value * used..(value + 1) * used])),
        };
        spectrum.is_valid().then_some((spectrum, length))
    }
}

/// Returns a weighted sum of the channels of a spectrum, at least 0: a band, or one of the values that decoders give.
#[inline]
pub fn weighted_channels(weights: &Channels, channels: &Channels) -> f32 {
    let sum: f32 = weights.iter().zip(channels).map(|(weight, x)| weight * x.min(MAX_CHANNEL)).sum();
    sum.max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(weights: &[f32]) -> Channels {
        std::array::from_fn(|i| weights.get(i).copied().unwrap_or(0.0))
    }

    fn six() -> Spectrum {
        Spectrum {
            wavelengths_nm: vec![450.0, 550.0, 650.0, 850.0],
            groups: 2,
            weights: vec![
                row(&[0.0, 0.1, 0.9]),
                row(&[0.1, 0.9, 0.0]),
                row(&[0.8, 0.2, -0.1]),
                row(&[0.0, 0.0, 0.0, 1.5, -0.5]),
            ],
            shown: [row(&[1.0]), row(&[0.0, 1.0]), row(&[0.0, 0.0, 1.0])],
        }
    }

    #[test]
    fn words_come_back_and_what_is_out_of_range_is_refused() {
        let spectrum = six();
        let mut words = spectrum.to_words();
        words.push(7);
        assert_eq!(Spectrum::from_words(&words), Some((spectrum.clone(), words.len() - 1)));
        assert_eq!(Spectrum::from_words(&words[..words.len() - 2]), None);
        let first_nm = SPECTRUM_HEAD + 18;
        for (word, value) in [
            (0, 0),
            (0, 300),
            (1, 0),
            (1, 5),
            (2, f32::NAN.to_bits()),
            (first_nm, 50.0f32.to_bits()),
            (first_nm + 1, 450.0f32.to_bits()),
        ] {
            let mut broken = spectrum.to_words();
            broken[word] = value;
            assert_eq!(Spectrum::from_words(&broken), None, "{word}");
        }
        assert!(!Spectrum { weights: vec![[2000.0; 12]; 4], ..spectrum.clone() }.is_valid());
        // A weight of a channel that is not there.
        assert!(!Spectrum { groups: 1, ..spectrum }.is_valid());
    }

    #[test]
    fn bands_are_sums_that_are_never_negative_and_always_finite() {
        let bands: Vec<f32> = six().bands(row(&[1.0, 0.5, 2.0, 1.0, 1.0])).collect();
        for (band, expected) in bands.iter().zip([1.85, 0.55, 0.7, 1.0]) {
            assert!((band - expected).abs() < 1e-6, "{bands:?}");
        }
        assert_eq!(six().bands(row(&[0.0, 0.0, 9.0])).nth(2), Some(0.0));
        assert!(six().bands([f32::MAX; 12]).all(f32::is_finite));
        // Three bands, the last one first.
        let mut picked = [[0.0; 3]; 4];
        (picked[3][0], picked[1][1], picked[0][2]) = (1.0, 1.0, 1.0);
        assert_eq!(six().shown_through(&picked), [six().weights[3], six().weights[1], six().weights[0]]);
    }
}

//! Wavelengths of an asset whose channels are no colours. A band's value is a weighted sum of the three channels, and so
//! is what decoders give ([`crate::decode::shown`]).

/// Most bands of an asset.
pub const MAX_BANDS: usize = 256;
/// Wavelengths in nanometres that a band may have.
pub const BAND_RANGE_NM: std::ops::RangeInclusive<f32> = 100.0..=20_000.0;
/// Largest weight of a channel.
pub const MAX_BAND_WEIGHT: f32 = 1000.0;
/// Largest value of a channel that is weighted, so that a finite value stays finite.
pub const MAX_CHANNEL: f32 = 1e30;
/// Number of words before the wavelengths: their number and the matrix.
pub(crate) const SPECTRUM_HEAD: usize = 10;

/// The bands of an asset, and how they follow from its channels.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// Wavelengths in nanometres within [`BAND_RANGE_NM`], ascending, at most [`MAX_BANDS`].
    pub wavelengths_nm: Vec<f32>,
    /// Weights of the channels in each band, `[band][channel]`, of at most [`MAX_BAND_WEIGHT`].
    pub weights: Vec<[f32; 3]>,
    /// Weights of the channels in each of the three values that decoders give, `[value][channel]`. In a file they give
    /// linear sRGB under D65; a program may ask for another illuminant, other eyes, or three of the bands.
    pub shown: [[f32; 3]; 3],
}

impl Spectrum {
    /// Returns whether all numbers are in their ranges.
    pub fn is_valid(&self) -> bool {
        let weights = self.weights.iter().chain(&self.shown).flatten();
        (1..=MAX_BANDS).contains(&self.wavelengths_nm.len())
            && self.weights.len() == self.wavelengths_nm.len()
            && self.wavelengths_nm.iter().all(|nm| BAND_RANGE_NM.contains(nm))
            && self.wavelengths_nm.windows(2).all(|pair| pair[0] < pair[1])
            && weights.into_iter().all(|weight| weight.abs() <= MAX_BAND_WEIGHT)
    }

    /// Returns the values of all bands, at least 0, for values of the channels.
    pub fn bands(&self, channels: [f32; 3]) -> impl Iterator<Item = f32> + '_ {
        self.weights.iter().map(move |weights| weighted_channels(weights, channels))
    }

    /// Returns the weights by which decoders give what a spectrum with weights `of_bands`, `[band][value]`, gives: those of
    /// colours under an illuminant, say, or 1 for three bands.
    pub fn shown_through(&self, of_bands: &[[f32; 3]]) -> [[f32; 3]; 3] {
        let sum = |value: usize, channel: usize| {
            let products =
                self.weights.iter().zip(of_bands).map(|(weights, of)| f64::from(weights[channel] * of[value]));
            products.sum::<f64>() as f32
        };
        std::array::from_fn(|value| std::array::from_fn(|channel| sum(value, channel)))
    }

    /// Returns the words of the file's section, which are those of the resident form.
    pub(crate) fn to_words(&self) -> Vec<u32> {
        let numbers = self.shown.as_flattened().iter().chain(&self.wavelengths_nm).chain(self.weights.as_flattened());
        std::iter::once(self.wavelengths_nm.len() as u32).chain(numbers.map(|x| x.to_bits())).collect()
    }

    /// Reads the words of [`Spectrum::to_words`], which may be followed by others, with their number; `None` for words that
    /// are none.
    pub(crate) fn from_words(words: &[u32]) -> Option<(Spectrum, usize)> {
        let count = *words.first()? as usize;
        if count == 0 || count > MAX_BANDS || words.len() < SPECTRUM_HEAD + 4 * count {
            return None;
        }
        let floats = |from: usize, count: usize| words[from..from + count].iter().map(|word| f32::from_bits(*word));
        let rows = |from: usize, count: usize| -> Vec<[f32; 3]> {
            let floats: Vec<f32> = floats(from, 3 * count).collect();
            floats.as_chunks().0.to_vec()
        };
        let shown = rows(1, 3);
        let spectrum = Spectrum {
            wavelengths_nm: floats(SPECTRUM_HEAD, count).collect(),
            weights: rows(SPECTRUM_HEAD + count, count),
            shown: [shown[0], shown[1], shown[2]],
        };
        spectrum.is_valid().then_some((spectrum, SPECTRUM_HEAD + 4 * count))
    }
}

/// Returns a weighted sum of the channels of a spectrum, at least 0: a band, or one of the values that decoders give.
#[inline]
pub fn weighted_channels(weights: &[f32; 3], channels: [f32; 3]) -> f32 {
    let [a, b, c] = channels.map(|x| x.min(MAX_CHANNEL));
    (weights[0] * a + weights[1] * b + weights[2] * c).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn three() -> Spectrum {
        Spectrum {
            wavelengths_nm: vec![450.0, 550.0, 650.0, 850.0],
            weights: vec![[0.0, 0.1, 0.9], [0.1, 0.9, 0.0], [0.8, 0.2, -0.1], [1.5, 0.0, 0.0]],
            shown: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        }
    }

    #[test]
    fn words_come_back_and_what_is_out_of_range_is_refused() {
        let spectrum = three();
        let mut words = spectrum.to_words();
        words.push(7);
        assert_eq!(Spectrum::from_words(&words), Some((spectrum.clone(), words.len() - 1)));
        assert_eq!(Spectrum::from_words(&words[..words.len() - 2]), None);
        for (word, value) in
            [(0, 0), (0, 300), (1, f32::NAN.to_bits()), (10, 50.0f32.to_bits()), (11, 450.0f32.to_bits())]
        {
            let mut broken = spectrum.to_words();
            broken[word] = value;
            assert_eq!(Spectrum::from_words(&broken), None, "{word}");
        }
        let heavy = Spectrum { weights: vec![[2000.0; 3]; 4], ..spectrum };
        assert!(!heavy.is_valid());
    }

    #[test]
    fn bands_are_sums_that_are_never_negative_and_always_finite() {
        let bands: Vec<f32> = three().bands([1.0, 0.5, 2.0]).collect();
        for (band, expected) in bands.iter().zip([1.85, 0.55, 0.7, 1.5]) {
            assert!((band - expected).abs() < 1e-6, "{bands:?}");
        }
        assert_eq!(three().bands([0.0, 0.0, 9.0]).nth(2), Some(0.0));
        assert!(three().bands([f32::MAX; 3]).all(f32::is_finite));
        // Three bands, the last one first.
        let mut picked = [[0.0; 3]; 4];
        (picked[3][0], picked[1][1], picked[0][2]) = (1.0, 1.0, 1.0);
        assert_eq!(three().shown_through(&picked), [three().weights[3], three().weights[1], three().weights[0]]);
    }
}

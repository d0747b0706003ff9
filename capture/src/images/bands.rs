//! How the bands of a spectral image become the channels that a reader asks for.

use std::sync::Arc;

use crate::colour::spectrum::rgb_weights;
use crate::images::decoded::ImageFault;

/// Most bands of an image.
pub const MAX_BANDS: usize = 256;

/// What becomes of bands.
#[derive(Debug, Clone, Default)]
pub(crate) enum Weighing {
    /// Turns bands into linear sRGB under D65.
    #[default]
    Colour,
    /// Turns bands into three channels, weighted sums of them.
    Sums(Arc<BandSums>),
    /// Keeps bands as they are, by ascending wavelength.
    Bands,
}

/// How the bands of a file are read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BandReading<'a> {
    /// What becomes of them.
    pub weighing: &'a Weighing,
    /// Wavelengths in nanometres that `capture.toml` tells, one for each band in the file's order; empty where it tells
    /// none.
    pub told_nm: &'a [f64],
}

impl BandReading<'static> {
    /// Bands whose wavelengths the file tells, as colours.
    pub(crate) const COLOUR: BandReading<'static> = BandReading { weighing: &Weighing::Colour, told_nm: &[] };
}

/// Weighted sums of bands.
#[derive(Debug, Clone)]
pub(crate) struct BandSums {
    /// Wavelengths in nanometres, ascending.
    pub wavelengths_nm: Vec<f64>,
    /// `[band][channel]`.
    pub weights: Vec<[f32; 3]>,
}

/// Bands of an image, ordered and weighed.
pub(crate) struct WeighedBands {
    /// Wavelengths in nanometres, ascending.
    pub wavelengths_nm: Vec<f64>,
    /// Number of channels of a texel.
    pub channels: usize,
    /// For each band in the file's order, its channels with their weights.
    weights: Vec<Vec<(usize, f32)>>,
}

impl Weighing {
    /// Prepares the bands of an image whose file has them at `wavelengths_nm`, in any order.
    pub(crate) fn of(&self, wavelengths_nm: &[f64]) -> Result<WeighedBands, ImageFault> {
        let mut order: Vec<usize> = (0..wavelengths_nm.len()).collect();
        order.sort_by(|a, b| wavelengths_nm[*a].total_cmp(&wavelengths_nm[*b]));
        let sorted: Vec<f64> = order.iter().map(|i| wavelengths_nm[*i]).collect();
        if sorted.windows(2).any(|pair| pair[0] == pair[1]) {
            return Err(ImageFault::damaged("two of its channels are named by one wavelength"));
        }
        if sorted.is_empty() || sorted.len() > MAX_BANDS {
            return Err(ImageFault::damaged(format!("it has {} bands; 1 to {MAX_BANDS} are allowed", sorted.len())));
        }
        let of_three = |weights: &[[f32; 3]]| {
            weights.iter().map(|weights| weights.iter().copied().enumerate().collect()).collect()
        };
        let by_band: Vec<Vec<(usize, f32)>> = match self {
            Weighing::Colour => of_three(&rgb_weights(&sorted).unwrap_or_default()),
            Weighing::Bands => (0..sorted.len()).map(|band| vec![(band, 1.0)]).collect(),
            Weighing::Sums(sums) if sums.wavelengths_nm == sorted => of_three(&sums.weights),
            Weighing::Sums(_) => {
                return Err(ImageFault::damaged("its wavelengths are not those of the capture's first image"));
            }
        };
        let mut weights = vec![Vec::new(); sorted.len()];
        order.into_iter().zip(by_band).for_each(|(file, of_band)| weights[file] = of_band);
        let channels = if matches!(self, Weighing::Bands) { sorted.len() } else { 3 };
        Ok(WeighedBands { wavelengths_nm: sorted, channels, weights })
    }
}

impl WeighedBands {
    /// Adds a band, the one of index `band` in the file, to `values`, `[texel, channel]`.
    pub(crate) fn add(&self, band: usize, samples: impl Iterator<Item = f32>, values: &mut [f32]) {
        for (value, texel) in samples.zip(values.chunks_exact_mut(self.channels)) {
            for (channel, weight) in &self.weights[band] {
                texel[*channel] += weight * value;
            }
        }
    }
}

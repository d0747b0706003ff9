//! Error of a tile of texels, pair by pair, in loops that run over neighbouring texels in vectors.
//!
//! A sum belongs to a texel or a tile and grows in the order of the pairs, so that no number depends on threads.

use crate::input::tone_curve::ToneCurve;
use crate::measure::image_decoder::{ImageDecoder, PairPlan, TileChannels};
use crate::measure::texel_tiles::{BasisWeights, TILE_TEXELS, TexelTile, TileRgb};
use crate::metrics::ErrorSums;
use btf_capture::{CaptureInfo, Cosine, Encoder8, ImageFormat, LabConverter, Pixels, delta_e00};
use btf_runtime::MAX_GROUPS;
use pulp::{Arch, Simd, WithSimd};

/// 8-bit values per channel and texel of a tile; 0 behind the tile's last texel.
pub type TileCodes = [[u8; TILE_TEXELS]; 3];

/// Conversion of samples to 8-bit values and back, and the colours of those values.
pub struct Coding {
    tone_curve: Option<ToneCurve>,
    /// Whether the files hold 8-bit values.
    is_encoded: bool,
    encoder: Encoder8,
    /// Per light.
    tables: Vec<[f32; 256]>,
    lab: LabConverter,
}

impl Coding {
    /// Returns the coding of the files of `info`. Linear images have no 8-bit values of their own and get those of a
    /// PNG of the same capture or, with a tone curve, of what that makes of them.
    pub fn new(info: &CaptureInfo, tone_curve: Option<ToneCurve>) -> Coding {
        let is_encoded = info.format != ImageFormat::Exr;
        let mut info = if info.format == ImageFormat::Exr { info.in_format(ImageFormat::Png) } else { info.clone() };
        if tone_curve.is_some() {
            (info.scale, info.cosine) = (1.0, Cosine::Included);
        }
        Coding {
            tone_curve,
            is_encoded,
            encoder: Encoder8::new(&info),
            tables: (0..info.lights.len()).map(|light| info.linear_from_encoded8(light)).collect(),
            lab: LabConverter::new(info.transfer),
        }
    }

    /// Encodes linear values under light `light`.
    #[inline(always)]
    fn encode(&self, light: usize, linear: &TileRgb, codes: &mut TileCodes) {
        let Some(curve) = &self.tone_curve else {
            return self.encoder.encode_slice(light, linear.as_flattened(), codes.as_flattened_mut());
        };
        let mut shown = *linear;
        curve.apply(shown.as_flattened_mut());
        self.encoder.encode_slice(light, shown.as_flattened(), codes.as_flattened_mut());
    }

    /// Returns whether the files hold 8-bit values, which no tone curve changes.
    pub fn is_of_codes(&self) -> bool {
        self.is_encoded && self.tone_curve.is_none()
    }

    /// Returns for a light the linear value of each 8-bit value, then the smallest linear value above each but the last, and
    /// infinity.
    pub fn light_table(&self, light: usize) -> Vec<f32> {
        let above = |code: u8| {
            // Floats order like their bits.
            let (mut low, mut high) = (0u32, f32::INFINITY.to_bits());
            while low + 1 < high {
                let middle = low + (high - low) / 2;
                let is_above = self.encoder.encode(light, f32::from_bits(middle)) > code;
                if is_above { high = middle } else { low = middle }
            }
            f32::from_bits(high)
        };
        self.tables[light].into_iter().chain((0..255).map(above)).chain([f32::INFINITY]).collect()
    }
}

/// Three values of each texel of an image, in the order of the tiles.
pub enum TiledImage {
    /// 8-bit values.
    Codes(Vec<TileCodes>),
    /// Linear reflectance x cosine.
    Linear(Vec<TileRgb>),
}

impl TiledImage {
    /// Returns `pixels`, `[texel, value]` with `values` of each texel, cut into `tiles`, in sets of three values.
    pub fn sets_of(pixels: &Pixels, values: usize, tiles: &[TexelTile]) -> Vec<TiledImage> {
        let of_set = |first: usize| match pixels {
            Pixels::Encoded8(codes) => TiledImage::Codes(cut(codes, values, first, tiles)),
            Pixels::Linear(linear) => TiledImage::Linear(cut(linear, values, first, tiles)),
        };
        (0..values).step_by(3).map(of_set).collect()
    }
}

/// Returns three values of `values` from the `first` on, 0 for those that are not there.
fn cut<T: Copy + Default>(image: &[T], values: usize, first: usize, tiles: &[TexelTile]) -> Vec<[[T; TILE_TEXELS]; 3]> {
    let of_tile = |tile: &TexelTile| {
        let mut planes = [[T::default(); TILE_TEXELS]; 3];
        for (i, texel) in tile.texels.iter().enumerate() {
            let texel = &image[*texel as usize * values..][first..values.min(first + 3)];
            planes.iter_mut().zip(texel).for_each(|(plane, value)| plane[i] = *value);
        }
        planes
    };
    tiles.iter().map(of_tile).collect()
}

/// One pair to be measured.
pub struct PairWork {
    /// Number of the pair in the capture.
    pub pair: usize,
    /// Light of the capture.
    pub light: usize,
    /// Plan of the decoder for the pair.
    pub plan: PairPlan,
    /// The capture's image: the sets of three values that the decoder gives.
    pub images: Vec<TiledImage>,
    /// Step between the texels whose colour difference is taken here; `None` for no colour difference.
    pub colour_every: Option<usize>,
}

/// Sums of a tile's errors so far.
#[derive(Clone)]
pub struct TileErrors {
    /// Sum of squared differences of 8-bit values, per texel.
    pub code_error: [u64; TILE_TEXELS],
    /// Sum of squared linear differences, per texel.
    pub linear_error: [f64; TILE_TEXELS],
    /// Sum of squared linear samples of the capture, per texel.
    linear_square: [f64; TILE_TEXELS],
    /// Sums of the linear samples of the capture and of the decoder, per texel.
    linear_sum: [f64; TILE_TEXELS],
    decoded_sum: [f64; TILE_TEXELS],
    linear_peak: f32,
    delta_e00: f64,
    colours: u64,
}

impl Default for TileErrors {
    fn default() -> TileErrors {
        TileErrors {
            code_error: [0; TILE_TEXELS],
            linear_error: [0.0; TILE_TEXELS],
            linear_square: [0.0; TILE_TEXELS],
            linear_sum: [0.0; TILE_TEXELS],
            decoded_sum: [0.0; TILE_TEXELS],
            linear_peak: 0.0,
            delta_e00: 0.0,
            colours: 0,
        }
    }
}

/// Body of [`TileErrors::take`] as a type: a closure would not be inlined where the wide vectors are.
struct TakePairs<'a> {
    errors: &'a mut TileErrors,
    decoder: &'a ImageDecoder<'a>,
    number: usize,
    coding: &'a Coding,
    batch: &'a [PairWork],
}

impl WithSimd for TakePairs<'_> {
    type Output = Vec<u64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<u64> {
        self.errors.take_pairs(simd, self.decoder, self.number, self.coding, self.batch)
    }
}

impl TileErrors {
    /// Adds the pairs of `batch` for tile number `number` of `decoder`; returns the squared differences of 8-bit values
    /// of each pair.
    ///
    /// Compiled for the processor's widest vectors: the operations and their order, and so the bits, stay the same.
    pub fn take(&mut self, decoder: &ImageDecoder, number: usize, coding: &Coding, batch: &[PairWork]) -> Vec<u64> {
        Arch::new().dispatch(TakePairs { errors: self, decoder, number, coding, batch })
    }

    #[inline(always)]
    fn take_pairs<S: Simd>(
        &mut self,
        simd: S,
        decoder: &ImageDecoder,
        number: usize,
        coding: &Coding,
        batch: &[PairWork],
    ) -> Vec<u64> {
        let tile = &decoder.tiles()[number];
        let count = tile.texels.len();
        let mut weights = BasisWeights::default();
        tile.unpack(&mut weights);
        let mut channels: TileChannels = [[[0.0; TILE_TEXELS]; 3]; MAX_GROUPS];
        let mut decoded: TileRgb = [[0.0; TILE_TEXELS]; 3];
        let mut code_sums = [0u32; TILE_TEXELS];
        // Loops, not an iterator's closures: those would be compiled for the narrow vectors.
        let mut errors = Vec::with_capacity(batch.len());
        for work in batch {
            decoder.decode_channels(simd, tile, &weights, &work.plan, &mut channels);
            let mut error = 0;
            for (set, image) in work.images.iter().enumerate() {
                decoder.show(&channels, set, &mut decoded);
                error += self.take_image([number, count], coding, (work, image), &mut decoded, &mut code_sums);
            }
            errors.push(error);
        }
        self.code_error.iter_mut().zip(code_sums).for_each(|(sum, batch)| *sum += u64::from(batch));
        errors
    }

    /// Adds the differences of `decoded`, of which `count` texels are there, from tile number `number` of `image` of `work`;
    /// returns the sum of the squared differences of 8-bit values, and adds those of each texel to `code_sums`.
    #[inline(always)]
    fn take_image(
        &mut self,
        [number, count]: [usize; 2],
        coding: &Coding,
        (work, image): (&PairWork, &TiledImage),
        decoded: &mut TileRgb,
        code_sums: &mut [u32; TILE_TEXELS],
    ) -> u64 {
        let mut decoded_codes: TileCodes = [[0; TILE_TEXELS]; 3];
        let mut original_codes = decoded_codes;
        let mut original: TileRgb = [[0.0; TILE_TEXELS]; 3];
        coding.encode(work.light, decoded, &mut decoded_codes);
        match image {
            TiledImage::Codes(codes) => {
                original_codes = codes[number];
                let table = &coding.tables[work.light];
                for c in 0..3 {
                    for i in 0..count {
                        original[c][i] = table[usize::from(original_codes[c][i])];
                    }
                }
            }
            TiledImage::Linear(values) => {
                original = values[number];
                coding.encode(work.light, &original, &mut original_codes);
            }
        }
        for c in 0..3 {
            // Behind the last texel nothing differs.
            decoded[c][count..].fill(0.0);
            decoded_codes[c][count..].fill(0);
            original[c][count..].fill(0.0);
            original_codes[c][count..].fill(0);
        }
        if let Some(every) = work.colour_every {
            let texels = (number % every..count).step_by(every);
            self.add_colours(&coding.lab, texels, &original_codes, &decoded_codes);
        }
        self.add_linear(&original, decoded);
        add_codes(&original_codes, &decoded_codes, code_sums)
    }

    /// Adds sums of texel `i`: squared differences of 8-bit values; squared linear differences, squared linear samples of the
    /// capture, these samples, and those of the decoder; and the largest sample.
    pub fn add_sums(&mut self, i: usize, code_error: u32, [error, square, sum, decoded, peak]: [f32; 5]) {
        self.code_error[i] += u64::from(code_error);
        self.linear_error[i] += f64::from(error);
        self.linear_square[i] += f64::from(square);
        self.linear_sum[i] += f64::from(sum);
        self.decoded_sum[i] += f64::from(decoded);
        self.linear_peak = self.linear_peak.max(peak);
    }

    /// Adds the colour differences of `work`'s image, of 8-bit values, from `decoded` in tile number `number` of `decoder`.
    pub fn add_colours_of(
        &mut self,
        work: &PairWork,
        number: usize,
        decoder: &ImageDecoder,
        coding: &Coding,
        decoded: &TileCodes,
    ) {
        if let (Some(every), TiledImage::Codes(original)) = (work.colour_every, &work.images[0]) {
            let texels = (number % every..decoder.tiles()[number].texels.len()).step_by(every);
            self.add_colours(&coding.lab, texels, &original[number], decoded);
        }
    }

    /// Returns the sums that add up over tiles; the linear errors per texel are not among them.
    pub fn sums(&self) -> ErrorSums {
        ErrorSums {
            linear_square: self.linear_square.iter().sum(),
            linear_sum: self.linear_sum.iter().sum(),
            decoded_sum: self.decoded_sum.iter().sum(),
            linear_peak: self.linear_peak.into(),
            delta_e00: self.delta_e00,
            colours: self.colours,
            ..ErrorSums::default()
        }
    }

    #[inline(always)]
    fn add_linear(&mut self, original: &TileRgb, decoded: &TileRgb) {
        // A peak per place: one for all would make every comparison wait for the one before.
        let mut peaks = [self.linear_peak; TILE_TEXELS];
        for c in 0..3 {
            for i in 0..TILE_TEXELS {
                let (x, y) = (f64::from(original[c][i]), f64::from(decoded[c][i]));
                self.linear_error[i] += (y - x) * (y - x);
                self.linear_square[i] += x * x;
                self.linear_sum[i] += x;
                self.decoded_sum[i] += y;
            }
            for i in 0..TILE_TEXELS {
                peaks[i] = if original[c][i] > peaks[i] { original[c][i] } else { peaks[i] };
            }
        }
        self.linear_peak = peaks.into_iter().fold(0.0, f32::max);
    }

    fn add_colours(
        &mut self,
        lab: &LabConverter,
        texels: impl Iterator<Item = usize>,
        original: &TileCodes,
        decoded: &TileCodes,
    ) {
        for i in texels {
            self.colours += 1;
            let [x, y] = [original, decoded].map(|codes| [codes[0][i], codes[1][i], codes[2][i]]);
            if x != y {
                self.delta_e00 += delta_e00(lab.lab(x), lab.lab(y));
            }
        }
    }
}

/// Adds the squared differences of one pair to `sums` and returns their total.
#[inline(always)]
fn add_codes(original: &TileCodes, decoded: &TileCodes, sums: &mut [u32; TILE_TEXELS]) -> u64 {
    let mut total = [0u32; TILE_TEXELS];
    for c in 0..3 {
        for i in 0..TILE_TEXELS {
            // 255 squared fits in 16 bits without sign.
            let difference = i16::from(original[c][i]) - i16::from(decoded[c][i]);
            total[i] += u32::from(difference.wrapping_mul(difference) as u16);
        }
    }
    sums.iter_mut().zip(total).for_each(|(sum, error)| *sum += error);
    total.iter().map(|error| u64::from(*error)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squared_differences_of_codes_are_exact_up_to_the_largest() {
        let (mut original, mut decoded) = ([[0u8; TILE_TEXELS]; 3], [[0u8; TILE_TEXELS]; 3]);
        let mut by_hand = [0u64; TILE_TEXELS];
        for c in 0..3 {
            for i in 0..TILE_TEXELS {
                original[c][i] = (i * 97 + c * 31) as u8;
                decoded[c][i] = (i * 41 + c * 77) as u8;
            }
            (original[c][5], decoded[c][5], original[c][6], decoded[c][6]) = (255, 0, 0, 255);
            for i in 0..TILE_TEXELS {
                by_hand[i] += u64::from(original[c][i].abs_diff(decoded[c][i])).pow(2);
            }
        }
        let mut sums = [7u32; TILE_TEXELS];
        assert_eq!(add_codes(&original, &decoded, &mut sums), by_hand.iter().sum::<u64>());
        assert!(sums.iter().zip(by_hand).all(|(sum, error)| u64::from(*sum) == error + 7));
        assert_eq!((by_hand[5], by_hand[6]), (3 * 65_025, 3 * 65_025));
    }
}

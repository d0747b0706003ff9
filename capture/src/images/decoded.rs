//! A decoded image, the reasons why a file is not one, and the largest size that any decoder accepts.

/// Largest number of texels of an image: 8192 x 8192. Larger claims are refused before anything
/// is allocated.
pub(crate) const MAX_TEXELS: usize = 1 << 26;

/// Largest number of samples of a file with bands, over all of them.
const MAX_SPECTRAL_SAMPLES: usize = 4 * MAX_TEXELS;

/// Most negative linear value that is accepted as a colour outside the gamut; an image with a lower value is refused.
pub const MIN_LINEAR: f32 = -0.1;

/// File values of a decoded image, `[texel, channel]`.
#[derive(Debug)]
pub(crate) enum Samples {
    U8(Vec<u8>),
    /// 16-bit PNG and TIFF, 0 to 65535.
    U16(Vec<u16>),
    /// EXR, Radiance, TIFF of floats.
    F32(Vec<f32>),
    /// Linear RGB computed from a spectrum or a factorisation. A negative value is then no sign of a damaged file:
    /// values below what captures hold are clamped, not refused.
    Computed(Vec<f32>),
}

#[derive(Debug)]
pub(crate) struct DecodedImage {
    pub width: usize,
    pub height: usize,
    /// Channels of a texel: three, or as many as there are bands where these were asked for.
    pub channels: usize,
    /// Wavelengths of the file's bands in nanometres, ascending; empty for colours.
    pub wavelengths_nm: Vec<f64>,
    pub samples: Samples,
}

impl DecodedImage {
    /// Returns an image of three channels that are no bands.
    pub(crate) fn rgb(width: usize, height: usize, samples: Samples) -> DecodedImage {
        DecodedImage { width, height, channels: 3, wavelengths_nm: Vec::new(), samples }
    }
}

/// Reason why an image was not decoded.
#[derive(Debug, PartialEq)]
pub(crate) enum ImageFault {
    /// Damaged file, with the decoder's reason.
    Damaged(String),
    /// Header with another size than was asked for.
    WrongSize { width: usize, height: usize },
    /// Whole file that is of a kind which is not read, or that something is missing for: what it has or lacks, as a verb
    /// phrase, and the remedy.
    Unfit(String),
}

impl ImageFault {
    pub(crate) fn damaged(reason: impl ToString) -> ImageFault {
        // Decoders' reasons come with line breaks, quotes and a full stop; an error message is
        // one sentence.
        let reason = reason.to_string();
        let one_line: Vec<&str> = reason.split_whitespace().collect();
        ImageFault::Damaged(one_line.join(" ").trim_end_matches('.').to_string())
    }
}

/// Checks the size in a header against the one that was asked for and against the largest allowed.
pub(crate) fn check_size(width: usize, height: usize, expected: Option<(usize, usize)>) -> Result<(), ImageFault> {
    if expected.is_some_and(|size| size != (width, height)) {
        return Err(ImageFault::WrongSize { width, height });
    }
    if width == 0 || height == 0 || width.checked_mul(height).is_none_or(|texels| texels > MAX_TEXELS) {
        let reason = format!("it claims {width} x {height} texels; 1 to {MAX_TEXELS} texels are allowed");
        return Err(ImageFault::damaged(reason));
    }
    Ok(())
}

/// Checks the number of samples that a file with bands claims against the largest allowed.
pub(crate) fn check_samples(samples: Option<usize>) -> Result<usize, ImageFault> {
    samples.filter(|samples| *samples <= MAX_SPECTRAL_SAMPLES).ok_or_else(|| {
        let claim = samples.map_or("countless".into(), |samples| samples.to_string());
        ImageFault::damaged(format!("it claims {claim} samples; at most {MAX_SPECTRAL_SAMPLES} are allowed"))
    })
}

/// Returns the bytes of number `at` of those in `bytes`, the lowest first.
///
/// # Panics
/// If `bytes` has fewer numbers.
pub(crate) fn little_endian<const N: usize>(bytes: &[u8], at: usize, is_big_endian: bool) -> [u8; N] {
    let mut number = [0; N];
    number.copy_from_slice(&bytes[at * N..][..N]);
    if is_big_endian {
        number.reverse();
    }
    number
}

/// Repeats grey, drops alpha, and passes RGB through without a copy.
pub(crate) fn three_channels<T: Copy>(values: Vec<T>, channels: usize) -> Vec<T> {
    match channels {
        1 => values.iter().flat_map(|&grey| [grey; 3]).collect(),
        2 => values.chunks_exact(2).flat_map(|texel| [texel[0]; 3]).collect(),
        4 => values.chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).collect(),
        _ => values,
    }
}

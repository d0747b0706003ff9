//! What decoders give for values of an asset's channels. Twin: `decode/shown.wgsl`.

use crate::asset::spectrum::weighted_channels;
use crate::resident::layout::SPECTRUM;

/// Returns what decoders give for values of the channels of the asset with these words: the values themselves for an asset
/// of colours, else the weighted sums that its spectrum asks for ([`crate::Spectrum::shown`]), at least 0.
#[inline]
pub(crate) fn shown(words: &[u32], channels: [f32; 3]) -> [f32; 3] {
    let at = words[SPECTRUM] as usize;
    if at == 0 {
        return channels;
    }
    std::array::from_fn(|value| {
        let row = &words[at + 1 + 3 * value..];
        weighted_channels(&[row[0], row[1], row[2]].map(f32::from_bits), channels)
    })
}

//! What decoders give for values of an asset's channels. Twin: `decode/shown.wgsl`.

use crate::asset::spectrum::{Channels, MAX_CHANNEL, MAX_GROUPS, SPECTRUM_HEAD};
use crate::resident::layout::SPECTRUM;

/// Returns the number of groups of channels of the asset with these words.
#[inline]
pub(crate) fn groups(words: &[u32]) -> usize {
    match words[SPECTRUM] as usize {
        0 => 1,
        at => words[at + 1] as usize,
    }
}

/// Returns the weights of a group's channels in the three values, `[value][channel]`.
#[inline]
fn weights(words: &[u32], group: usize) -> [[f32; 3]; 3] {
    let at = words[SPECTRUM] as usize;
    let groups = words[at + 1] as usize;
    std::array::from_fn(|value| {
        let row = at + SPECTRUM_HEAD + 3 * (groups * value + group);
        std::array::from_fn(|channel| f32::from_bits(words[row + channel]))
    })
}

/// Returns whether any of a group's channels has a weight.
#[inline]
fn asks(weights: &[[f32; 3]; 3]) -> bool {
    weights.iter().flatten().any(|weight| *weight != 0.0)
}

/// Returns whether decoders give the first group's channels as they are: those of an asset of colours, and the colours under
/// D65 of one in bands.
pub(crate) fn shows_first_channels(words: &[u32]) -> bool {
    let as_they_are = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    words[SPECTRUM] == 0
        || (weights(words, 0) == as_they_are && (1..groups(words)).all(|group| !asks(&weights(words, group))))
}

/// Returns what decoders give for the values that `channels` returns of a group: those of the only group for an asset of
/// colours, else the weighted sums that its spectrum asks for ([`crate::Spectrum::shown`]), at least 0. Groups without a
/// weight are not asked for.
#[inline]
pub(crate) fn shown(words: &[u32], mut channels: impl FnMut(usize) -> [f32; 3]) -> [f32; 3] {
    if words[SPECTRUM] == 0 {
        return channels(0);
    }
    let mut sums = [0.0f32; 3];
    for group in 0..groups(words) {
        let weights = weights(words, group);
        if !asks(&weights) {
            continue;
        }
        let held = channels(group).map(|x| x.min(MAX_CHANNEL));
        for (sum, row) in sums.iter_mut().zip(&weights) {
            *sum += row[0] * held[0] + row[1] * held[1] + row[2] * held[2];
        }
    }
    sums.map(|sum| sum.max(0.0))
}

/// Returns the values of all channels of an asset of `groups` groups.
pub(crate) fn all_channels(groups: usize, mut channels: impl FnMut(usize) -> [f32; 3]) -> Channels {
    let mut all = [0.0; 3 * MAX_GROUPS];
    for group in 0..groups {
        all[3 * group..3 * group + 3].copy_from_slice(&channels(group));
    }
    all
}

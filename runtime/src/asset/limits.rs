//! The limits of an asset. Normative text: docs/reference/format.md.

/// Largest physical side of an asset, millimetres.
pub const MAX_SIDE_MM: f32 = 1e6;
/// Largest number of layers in a file: front, back, and the two transmissions.
pub const MAX_LAYERS: usize = 4;
/// Largest width or height of an asset in texels.
pub const MAX_SIDE: u32 = 16_384;
/// Largest number of levels: down to one texel from the widest asset.
pub const MAX_LEVELS: usize = 15;
/// Largest number of clusters in a layer: a cluster id is one byte.
pub const MAX_CLUSTERS: usize = 256;
/// Largest number of lobes in one cluster's dictionary: a lobe id is one byte.
pub const MAX_DICTIONARY: usize = 256;
/// Largest number of directions in a set.
pub const MAX_DIRECTIONS: usize = 4096;
/// Largest number of coefficients that lobe weights depend on.
pub const MAX_WEIGHT_INPUTS: usize = 16;
/// Largest number of nodes of a cluster.
pub const MAX_NODES: usize = 64;
/// Largest number of lobes that the texels of a layer may refer to by predicted weights together, for each byte of its
/// cluster ids, dictionary and lobe weights: so no short file takes much memory.
pub const MAX_REFS_PER_BYTE: usize = 4096;
/// Largest number of coefficients by which one is predicted.
pub const MAX_INPUTS: usize = 256;
/// Largest number of residual components of a layer.
pub const MAX_COMPONENTS: usize = 128;
/// Largest number of shared bases of a layer.
pub const MAX_SHARED: usize = 1024;
/// Largest step of a shared basis or of a cluster's mixture: bounded, so that no expanded basis overflows to NaN.
pub const MAX_BASIS_STEP: f32 = 1e4;
/// Largest step of a coefficient.
pub const MAX_COEFFICIENT_STEP: f32 = 1e9;
/// Largest rank of a factor matrix.
pub const MAX_RANK: usize = 256;
/// Largest number of words that one layer's expanded bases may take (1 GiB): a few hundred bytes of factors must not
/// make a reader allocate without bound.
pub const MAX_BASIS_WORDS: u64 = 1 << 28;
/// Largest step of a height code, texel widths.
pub const MAX_HEIGHT_STEP: f32 = 16.0;
/// Allowed epsilon of a residual's curve.
pub const EPSILON_RANGE: std::ops::RangeInclusive<f32> = 1e-6..=1.0;

/// Returns the number of words of a layer's expanded bases: halves `[cluster, view, light, channel, basis]`, bases padded to
/// [`channel_words`]. `shape` is the number of views and of lights.
pub fn basis_words(shape: [usize; 2], clusters: usize, bases: usize) -> u64 {
    [shape[0], shape[1], 3, clusters, channel_words(bases)].iter().map(|n| *n as u64).product()
}

/// Largest number of words of a pair's bases of one channel: those of [`MAX_COMPONENTS`] and the mean.
pub(crate) const MAX_CHANNEL_WORDS: usize = (1 + MAX_COMPONENTS).div_ceil(2);

/// Returns the number of words of a pair's bases of one channel, two bases a word: a multiple of four, because GPUs read four
/// words as fast as one, unless that takes more than an eighth more memory.
pub(crate) fn channel_words(bases: usize) -> usize {
    let least = bases.div_ceil(2);
    let padded = least.next_multiple_of(4);
    let most = (least + least / 8).min(MAX_CHANNEL_WORDS);
    if padded <= most { padded } else { least }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_whole_quads_where_that_takes_little_more() {
        let cases = [(0, 0), (1, 1), (7, 4), (25, 13), (44, 24), (45, 24), (82, 44), (85, 44), (128, 64), (129, 65)];
        assert_eq!(cases.map(|(bases, _)| channel_words(bases)), cases.map(|(_, words)| words));
        for bases in 0..=1 + MAX_COMPONENTS {
            let (least, words) = (bases.div_ceil(2), channel_words(bases));
            assert!((least..=MAX_CHANNEL_WORDS).contains(&words) && 8 * words <= 9 * least, "{bases}");
        }
    }
}

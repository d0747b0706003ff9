//! The lobes of a cluster, and the references of texels to them.

use crate::asset::lobe::Lobe;

/// A reference of a texel to a lobe of its cluster's dictionary.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LobeRef {
    /// Index into the cluster's dictionary.
    pub lobe: u8,
    /// RGB weight codes, see [`crate::weight_from_byte`].
    pub weight: [u8; 3],
}

/// A lobe of a dictionary with the scale of the weights that refer to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DictionaryLobe {
    /// The lobe.
    pub lobe: Lobe,
    /// Largest weight that a texel can give the lobe.
    pub weight_scale: f32,
}

/// Returns whether every reference names a lobe that the cluster of its texel has.
pub(crate) fn refs_exist(clusters: &[u8], counts: &[u8], refs: &[LobeRef], dictionary: &[Vec<DictionaryLobe>]) -> bool {
    let mut refs = refs.iter();
    clusters.iter().zip(counts).all(|(cluster, count)| {
        let lobes = dictionary[usize::from(*cluster)].len();
        refs.by_ref().take(usize::from(*count)).all(|reference| usize::from(reference.lobe) < lobes)
    })
}

/// Marks the lobes that texels refer to in `used`, `[cluster][lobe]`. The texels have the clusters `clusters`, as many
/// references as `counts` says, and the references `refs`, one texel after the other.
pub fn mark_used_lobes(used: &mut [Vec<bool>], clusters: &[u8], counts: &[u8], refs: &[LobeRef]) {
    let mut refs = refs.iter();
    for (cluster, count) in clusters.iter().zip(counts) {
        for reference in refs.by_ref().take(usize::from(*count)) {
            used[usize::from(*cluster)][usize::from(reference.lobe)] = true;
        }
    }
}

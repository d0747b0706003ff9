//! Codes the texels of the file form: cluster, number of lobes, lobe references. One routine serves encoder and
//! decoder, as in [`crate::container::entropy`].

use crate::asset::dictionary::LobeRef;
use crate::container::entropy::{BinaryCoder, Bit, Encoder, Signed, Tree, bounded};

/// Codes one cluster id per texel, rows of `width`: as equal to the left one, else to the one above, else to the one
/// above right, else by itself.
pub(crate) fn code_clusters(coder: &mut impl BinaryCoder, ids: &mut [u8], width: usize) {
    let mut same = [[Bit::NEW; 8]; 3];
    let mut tree = Tree::<8>::new();
    for i in 0..ids.len() {
        let column = i % width;
        let west = if column > 0 { ids[i - 1] } else { 0 };
        let north = if i >= width { ids[i - width] } else { west };
        let north_west = if i >= width && column > 0 { ids[i - width - 1] } else { north };
        let north_east = if i >= width && column + 1 < width { ids[i - width + 1] } else { north };
        let alike =
            usize::from(west == north) | usize::from(north == north_east) << 1 | usize::from(west == north_west) << 2;
        let id = ids[i];
        ids[i] = if coder.bit(&mut same[0][alike], id == west) {
            west
        } else if north != west && coder.bit(&mut same[1][alike], id == north) {
            north
        } else if north_east != north && north_east != west && coder.bit(&mut same[2][alike], id == north_east) {
            north_east
        } else {
            tree.code(coder, u32::from(id)) as u8
        };
    }
}

/// Codes one lobe count per texel: as that of the last texel of its cluster, else by itself.
pub(crate) fn code_counts(coder: &mut impl BinaryCoder, counts: &mut [u8], clusters: &[u8]) {
    let mut same = [Bit::NEW; 2];
    let mut tree = Tree::<8>::new();
    let mut last = [0u8; 256];
    let mut before = 0;
    for (count, cluster) in counts.iter_mut().zip(clusters) {
        let last = &mut last[usize::from(*cluster)];
        let alike = coder.bit(&mut same[before], *count == *last);
        if !alike {
            *last = tree.code(coder, u32::from(*count)) as u8;
        }
        *count = *last;
        before = usize::from(alike);
    }
}

/// Interval at which an encoder first writes references out afresh, texels; a power of 4.
pub(crate) const MAX_FRESH: usize = 1 << 20;

/// Codes all lobe references, texel after texel: as those of the last texel of the cluster with as many lobes; else
/// lobe by lobe, with weights as differences from the last weights of the same lobe of the cluster.
///
/// The encoder writes the references of every `fresh_every`-th texel out even if they equal the last texel's; the
/// decoder ignores the number.
pub(crate) fn code_refs(
    coder: &mut impl BinaryCoder,
    refs: &mut [LobeRef],
    clusters: &[u8],
    counts: &[u8],
    fresh_every: usize,
) {
    let most = clusters.iter().map(|id| usize::from(*id) + 1).max().unwrap_or(0);
    let mut same = [Bit::NEW; 2];
    let mut lobes = vec![Tree::<8>::new(); most];
    let mut last: Vec<([u8; 3], u32)> = vec![([128; 3], 8); most * 256];
    let mut models = [Signed::new(), Signed::new(), Signed::new()];
    // Where the last texel of each cluster has its references, and how many.
    let mut before: Vec<(usize, usize)> = vec![(0, 0); most];
    let (mut at, mut alike_before) = (0, 0);
    for (texel, (cluster, count)) in clusters.iter().zip(counts).enumerate() {
        let (cluster, count) = (usize::from(*cluster), usize::from(*count));
        let (from, of) = std::mem::replace(&mut before[cluster], (at, count));
        let own = at..at + count;
        at += count;
        if count == 0 {
            continue;
        }
        if of == count {
            let alike = (texel + 1) % fresh_every > 0 && refs[from..from + of] == refs[own.clone()];
            let alike = coder.bit(&mut same[alike_before], alike);
            alike_before = usize::from(alike);
            if alike {
                refs.copy_within(from..from + of, own.start);
                continue;
            }
        }
        for reference in &mut refs[own] {
            reference.lobe = lobes[cluster].code(coder, u32::from(reference.lobe)) as u8;
            let (weight, size) = &mut last[cluster * 256 + usize::from(reference.lobe)];
            let mut first = 0;
            let mut sizes = 0;
            for (channel, model) in models.iter_mut().enumerate() {
                // Green and blue mostly follow red.
                let expected = i32::from(weight[channel]) + first;
                let difference = model.code(coder, i32::from(reference.weight[channel]) - expected, *size, 0);
                reference.weight[channel] = (expected + difference) as u8;
                if channel == 0 {
                    first = difference;
                }
                sizes += difference.unsigned_abs();
            }
            *size = (*size + sizes) / 2;
            *weight = reference.weight;
        }
    }
}

/// Encodes references with [`code_refs`] into at least so many bytes as bound the number of references: without that,
/// one decision could stand for 255 of them.
pub(crate) fn encode_refs(refs: &[LobeRef], clusters: &[u8], counts: &[u8]) -> Vec<u8> {
    let mut fresh_every = MAX_FRESH;
    loop {
        let mut coder = Encoder::new();
        code_refs(&mut coder, &mut refs.to_vec(), clusters, counts, fresh_every);
        let bytes = coder.finish();
        if fresh_every == 1 || bounded(refs.len(), &bytes).is_ok() {
            return bytes;
        }
        fresh_every /= 4;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::container::entropy::Decoder;
    use crate::testing::Random;

    #[test]
    fn cluster_ids_come_back_and_patches_of_equal_ones_are_cheap() {
        let mut random = Random::new(6);
        let patches: Vec<u8> = (0..64 * 64).map(|i| ((i % 64) / 16 + (i / 64) / 16 * 7) as u8).collect();
        let noise: Vec<u8> = (0..64 * 64).map(|_| random.below(256) as u8).collect();
        let mut sizes = Vec::new();
        for ids in [patches, noise] {
            let mut coder = Encoder::new();
            code_clusters(&mut coder, &mut ids.clone(), 64);
            let bytes = coder.finish();
            let mut back = vec![0; ids.len()];
            let mut decoder = Decoder::new(&bytes);
            code_clusters(&mut decoder, &mut back, 64);
            assert!(decoder.ended().is_ok() && back == ids);
            sizes.push(bytes.len());
        }
        assert!(sizes[0] < 200 && sizes[1] > 4096, "{sizes:?}");
    }

    #[test]
    fn references_of_any_weights_come_back() {
        let mut random = Random::new(7);
        let clusters: Vec<u8> = (0..500).map(|_| random.below(3) as u8).collect();
        let counts: Vec<u8> = (0..500).map(|_| random.below(4) as u8).collect();
        let total = counts.iter().map(|count| usize::from(*count)).sum();
        let refs: Vec<LobeRef> = (0..total)
            .map(|_| LobeRef { lobe: random.below(256) as u8, weight: [0; 3].map(|_| random.below(256) as u8) })
            .collect();
        let mut coder = Encoder::new();
        code_counts(&mut coder, &mut counts.clone(), &clusters);
        code_refs(&mut coder, &mut refs.clone(), &clusters, &counts, usize::MAX);
        let bytes = coder.finish();
        let mut decoder = Decoder::new(&bytes);
        let mut back = vec![0; 500];
        code_counts(&mut decoder, &mut back, &clusters);
        assert_eq!(back, counts);
        let mut back = vec![LobeRef { lobe: 0, weight: [0; 3] }; total];
        code_refs(&mut decoder, &mut back, &clusters, &counts, 1);
        assert!(decoder.ended().is_ok());
        assert_eq!(back, refs);
        // Planted difference: other clusters read something else.
        let mut decoder = Decoder::new(&bytes);
        let mut other = vec![0; 500];
        code_counts(&mut decoder, &mut other, &[0; 500]);
        assert_ne!(other, counts);
        // What a cluster's texels have in common costs next to nothing.
        let refs = vec![LobeRef { lobe: 3, weight: [9, 200, 77] }; 1000];
        let mut coder = Encoder::new();
        code_refs(&mut coder, &mut refs.clone(), &clusters, &[2; 500], usize::MAX);
        let bytes = coder.finish();
        assert!(bytes.len() < 60, "{}", bytes.len());
        let mut back = vec![LobeRef { lobe: 0, weight: [0; 3] }; 1000];
        code_refs(&mut Decoder::new(&bytes), &mut back, &clusters, &[2; 500], 1);
        assert_eq!(back, refs);
    }
    #[test]
    fn a_stream_bounds_its_references_however_alike_they_are() {
        for count in [1u8, 12, 255] {
            let (clusters, counts) = ([0; 30_000], [count; 30_000]);
            let refs = vec![LobeRef { lobe: 0, weight: [128; 3] }; 30_000 * usize::from(count)];
            let bytes = encode_refs(&refs, &clusters, &counts);
            assert!(bounded(refs.len(), &bytes).is_ok() && bytes.len() < refs.len() / 100 + 100, "{}", bytes.len());
            let mut back = vec![LobeRef { lobe: 9, weight: [0; 3] }; refs.len()];
            let mut decoder = Decoder::new(&bytes);
            code_refs(&mut decoder, &mut back, &clusters, &counts, usize::MAX);
            assert!(decoder.ended().is_ok() && back == refs);
            // Planted difference: written out once only, many of them are more than the bytes may promise.
            let mut coder = Encoder::new();
            code_refs(&mut coder, &mut refs.clone(), &clusters, &counts, usize::MAX);
            assert_eq!(bounded(refs.len(), &coder.finish()).is_ok(), count == 1);
        }
    }
}

//! What an evaluation reads and computes, counted from the layout of the resident form.

use crate::asset::asset::{Layer, LobeRole};
use crate::asset::lobe::RESIDENT_WORDS as LOBE_RESIDENT_WORDS;
use crate::decode::evaluate::Query;
use crate::resident::layout::{ASSET_LAYERS, block};
use crate::resident::packed_part::{PACKED_PLACES, PLACE_WORDS, PackedBasis, code_words, row_words};
use crate::resident::resident::Resident;

/// Words of a cache line, 64 bytes.
const LINE_WORDS: usize = 16;
/// Words of a lobe that every evaluation of it reads.
const LOBE_READ_WORDS: usize = 12;

/// What one evaluation takes, alone and without caches.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EvaluationTraffic {
    /// The first word of each cache line in which data of the evaluation lie, ascending.
    pub lines: Vec<u32>,
    /// Bytes needed of those lines.
    pub bytes: usize,
    /// Multiply-adds of the residual's sum: 3 channels of the mean and each component, for each pair of directions.
    pub multiply_adds: usize,
}

/// Counts what an evaluation of the first layer at `query` takes with at most `components` components: the texel's record
/// and codes, rows of bases at the pairs of measured directions around, and lobes unless they only guide. `layer` is the
/// same layer in the file form.
pub fn evaluation_traffic(layer: &Layer, resident: &Resident, query: &Query, components: u32) -> EvaluationTraffic {
    let words = resident.words();
    let at = words[ASSET_LAYERS] as usize;
    let field = |field: usize| words[at + field] as usize;
    let texel = resident.texel(0, query.uv) as usize;
    let record = field(block::RECORDS) + 2 * texel;
    let cluster = (words[record] & 0xff) as usize;
    let (refs, basis) = (field(block::REFS) + words[record + 1] as usize, field(block::BASIS));
    let bases = field(block::BASES).min(components as usize + 1);
    let mut parts = vec![(record, 2)];
    // First word of the cluster's rows, words of a row, and the parts of a row that are read.
    let (first_row, row, read) = if resident.is_packed(0) {
        let place = basis + PACKED_PLACES + PLACE_WORDS * cluster;
        let stride = words[basis + 1] as usize;
        let first = basis + words[basis + 2] as usize + cluster * stride;
        let known: Vec<PackedBasis> = words[first..first + bases].iter().map(|w| PackedBasis::from_word(*w)).collect();
        parts.extend([(place, PLACE_WORDS), (first, bases)]);
        parts.push((refs - words[place + 2] as usize, code_words(&known)));
        (words[place] as usize, words[place + 1] as usize, vec![(0, row_words(&known))])
    } else {
        let channel = field(block::CHANNEL_WORDS);
        let codes = field(block::CODE_WORDS).min((bases.saturating_sub(1)).div_ceil(4));
        parts.push((field(block::CODES) + texel * field(block::CODE_WORDS), codes));
        let read = (0..3).map(|c| (c * channel, bases.div_ceil(2))).collect();
        (cluster * field(block::PAIRS) * 3 * channel, 3 * channel, read)
    };
    if layer.lobe_role != LobeRole::Guide {
        let count = (words[record] >> 16) as usize;
        parts.push((refs, count));
        let dictionary = words[field(block::DICTIONARIES) + cluster] as usize;
        let lobe = |reference: &u32| dictionary + (reference & 0xff) as usize * LOBE_RESIDENT_WORDS;
        parts.extend(words[refs..refs + count].iter().map(|reference| (lobe(reference), LOBE_READ_WORDS)));
    }
    let (views, lights) = (layer.views.locate(query.wo), layer.lights.locate(query.wi));
    let mut pairs = 0;
    for (view, _) in views.ids.iter().zip(views.weights).filter(|(_, weight)| *weight > 0.0) {
        for (light, _) in lights.ids.iter().zip(lights.weights).filter(|(_, weight)| *weight > 0.0) {
            pairs += 1;
            let pair = *view as usize * field(block::LIGHT_COUNT) + *light as usize;
            parts.extend(read.iter().map(|(from, count)| (basis + first_row + pair * row + from, *count)));
        }
    }
    let bytes = parts.iter().map(|(_, count)| 4 * count).sum();
    let of_part = |(first, count): &(usize, usize)| first / LINE_WORDS..(first + count).div_ceil(LINE_WORDS);
    let mut lines: Vec<u32> =
        parts.iter().filter(|(_, count)| *count > 0).flat_map(of_part).map(|line| (LINE_WORDS * line) as u32).collect();
    lines.sort_unstable();
    lines.dedup();
    EvaluationTraffic { lines, bytes, multiply_adds: 3 * bases * pairs }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::resident::packed_widths::PackedGoal;
    use crate::serial;
    use crate::testing::dense_asset;

    #[test]
    fn fewer_components_and_packed_bases_take_fewer_bytes() {
        let asset = dense_asset(2, 16, 24);
        let whole = Resident::from_asset(&asset);
        let packed = Resident::packed_on(&asset, PackedGoal::Noise(0.02), &serial);
        let query = Query { uv: [0.3, 0.6], wi: [0.1, 0.2, 0.97], wo: [-0.3, 0.4, 0.866] };
        let count =
            |resident: &Resident, components| evaluation_traffic(&asset.layers[0], resident, &query, components);
        let (all, eight) = (count(&whole, u32::MAX), count(&whole, 8));
        // Nine pairs of 3 channels with 25 bases; 13 words of two halves a channel.
        assert_eq!(all.multiply_adds, 9 * 3 * 25);
        assert!(all.bytes > 9 * 3 * 13 * 4 && all.bytes < 9 * 3 * 13 * 4 + 1000, "{}", all.bytes);
        assert_eq!(all.bytes - eight.bytes, 9 * 3 * 8 * 4 + 16);
        assert!(count(&packed, u32::MAX).bytes < all.bytes / 2 && count(&packed, 8).bytes < count(&packed, 24).bytes);
        assert!(all.lines.len() * 64 >= all.bytes && all.lines.windows(2).all(|pair| pair[0] < pair[1]));
    }
}

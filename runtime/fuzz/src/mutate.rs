//! Changes files behind their checksums: a mutator changes the bytes of a section, the table or the order of sections,
//! and the parts are put together to a file with correct offsets, lengths and checksums.

use btf_runtime::read_directory;
use btf_runtime::testing::{FileParts, Random, SectionPart, repair_header_checksum};
use btf_runtime::voltex::read_voltex_directory;

/// Interval of inputs that are changed as plain bytes, so that the first checks of a reader are tried as well.
const RAW_ONE_IN: usize = 16;
/// Interval of inputs that are cut to one of their tiers.
const TIER_ONE_IN: usize = 16;

/// Returns a changed file. `bytes` that are no file are changed as they are. `change_bytes` is the caller's mutator: it
/// gets the bytes and the largest number there may be.
pub fn mutate(bytes: &[u8], seed: u64, most: usize, change_bytes: &mut dyn FnMut(&mut Vec<u8>, usize)) -> Vec<u8> {
    let mut random = Random::new(seed);
    let parts = FileParts::from_bytes(bytes).ok().or_else(|| FileParts::from_voltex_bytes(bytes).ok());
    let parts = parts.filter(|_| random.below(RAW_ONE_IN) > 0);
    let Some(mut parts) = parts else {
        let mut raw = bytes.to_vec();
        change_bytes(&mut raw, most);
        // Half of them with a header whose checksum is right.
        if random.below(2) == 0 && raw.len() >= 80 {
            repair_header_checksum(&mut raw);
        }
        return raw;
    };
    for _ in 0..1 + random.below(3) {
        change(&mut parts, &mut random, bytes.len(), most, change_bytes);
    }
    let mut changed = parts.to_bytes();
    if random.below(TIER_ONE_IN) == 0
        && let Some(tiers) = tiers_of(&changed)
    {
        changed.truncate(tiers[random.below(tiers.len())] as usize);
    }
    if changed.len() <= most { changed } else { bytes.to_vec() }
}

/// Returns the lengths of the tiers of a file of either format.
fn tiers_of(bytes: &[u8]) -> Option<Vec<u32>> {
    let of_asset = read_directory(bytes).ok().map(|directory| directory.tiers);
    of_asset.or_else(|| Some(read_voltex_directory(bytes).ok()?.tiers))
}

/// Mutates like [`mutate`] in the form of libFuzzer: within `data`, of which `size` bytes are the input and `most` may
/// be used. `change_bytes` is libFuzzer's own mutator, which has the same arguments. Both return the new size.
pub fn mutate_in_place(
    data: &mut [u8],
    size: usize,
    most: usize,
    seed: u32,
    change_bytes: impl Fn(&mut [u8], usize, usize) -> usize,
) -> usize {
    let changed = mutate(&data[..size], seed.into(), most, &mut |bytes, most| {
        let (size, most) = (bytes.len(), most.max(bytes.len()));
        bytes.resize(most, 0);
        let changed = change_bytes(bytes, size, most);
        bytes.truncate(changed);
    });
    data[..changed.len()].copy_from_slice(&changed);
    changed.len()
}

fn change(
    parts: &mut FileParts,
    random: &mut Random,
    length: usize,
    most: usize,
    change_bytes: &mut dyn FnMut(&mut Vec<u8>, usize),
) {
    if parts.sections.is_empty() {
        return;
    }
    let at = random.below(parts.sections.len());
    match random.below(20) {
        0 => {
            let other = random.below(parts.sections.len());
            parts.sections.swap(at, other);
        }
        1 => {
            parts.sections.remove(at);
            // The last section always ends a tier.
            if let Some(last) = parts.sections.last_mut() {
                last.ends_tier = true;
            }
        }
        2 => parts.sections.insert(at, parts.sections[at].clone()),
        3 => {
            let head = [[999, 0, 0, 0], [999, 0, 0, 1]][random.below(2)];
            parts.sections.insert(at, SectionPart { head, bytes: vec![7; random.below(20)], ends_tier: false });
        }
        4 => {
            let field = random.below(4);
            parts.sections[at].head[field] = random.below(17) as u32;
        }
        5 => parts.sections[at].ends_tier ^= at + 1 < parts.sections.len(),
        6 => {
            // Layers, width, height, flags, form, sizes, or levels and materials: what `to_bytes` does not set by
            // itself.
            let word = [6, 7, 8, 9, 10, 11, 14, 15, 16, 17][random.below(10)];
            parts.header[word] = number(random);
        }
        7..=11 => {
            let bytes = &mut parts.sections[at].bytes;
            if bytes.len() >= 4 {
                let word = random.below(bytes.len() / 4) * 4;
                bytes[word..word + 4].copy_from_slice(&number(random).to_le_bytes());
            }
        }
        _ => {
            let bytes = &mut parts.sections[at].bytes;
            let room = most.saturating_sub(length).max(16);
            change_bytes(bytes, bytes.len() + room);
        }
    }
}

/// Returns a number that is likely to be interesting: small and huge counts, floats, and bits that are no number.
fn number(random: &mut Random) -> u32 {
    match random.below(6) {
        0 | 1 => random.below(9) as u32,
        2 => random.below(300) as u32,
        3 => random.within(-4.0, 4.0).to_bits(),
        4 => 0x7f80_0000 | random.below(2) as u32,
        _ => random.bits() as u32,
    }
}

// The part of packed bases in the words of a resident form. Twin: resident/packed_part.rs.

const PACKED_PLACES: u32 = 4u;
const PLACE_WORDS: u32 = 3u;

// Returns how much the levels of numbers of `width` bits spread: 3/2 over the number of levels, exactly.
fn packed_bend(width: u32) -> f32 {
    return 1.5 * bitcast<f32>((127u - width) << 23u);
}

// Returns the number of `width` bits, at least 1, that follows the first `bit` bits of the words from `at` on.
fn packed_bits(at: u32, bit: u32, width: u32) -> i32 {
    let first = bit % 32u;
    var bits = asset_word(at + bit / 32u) >> first;
    if first + width > 32u {
        bits |= asset_word(at + bit / 32u + 1u) << (32u - first);
    }
    return bitcast<i32>(bits << (32u - width)) >> (32u - width);
}

//! Blocks of one channel in BC4 (RGTC1, unsigned): two endpoints of 8 bits and 16 indices of 3 bits. The search for
//! endpoints leaves a quarter less error than the least and the greatest value, which encoders take.

/// Bytes of a block.
pub const BLOCK_BYTES: usize = 8;
/// Shares of the range by which endpoints are moved inwards, and their number.
const STEP: f32 = 0.035;
const STEPS: usize = 7;

/// Returns the block of 16 values, row by row, each 0 to 255 and not rounded, of least squared error among those that
/// are tried: eight levels between endpoints at most a fifth of the range inside it.
pub fn encode_block(values: &[f32; 16]) -> [u8; BLOCK_BYTES] {
    let least = values.iter().fold(255.0f32, |least, x| least.min(*x)).max(0.0);
    let most = values.iter().fold(0.0f32, |most, x| most.max(*x)).min(255.0);
    let range = most - least;
    let mut best = (f32::INFINITY, [0u8; 2]);
    let mut tried = [[255u8, 0]; STEPS * STEPS];
    for (number, tried) in tried.iter_mut().enumerate() {
        let [high, low] = [number / STEPS, number % STEPS].map(|step| step as f32 * STEP * range);
        *tried = [(most - high).round() as u8, (least + low).round() as u8];
    }
    for (number, ends) in tried.iter().enumerate() {
        // Small ranges give the same endpoints again and again.
        if number > 0 && tried[number - 1] == *ends {
            continue;
        }
        let error = error_of(values, *ends);
        if error < best.0 {
            best = (error, *ends);
        }
    }
    block(values, best.1)
}

/// Returns the sum of squared errors of the nearest levels.
fn error_of(values: &[f32; 16], [high, low]: [u8; 2]) -> f32 {
    let (low, step) = (f32::from(low), (f32::from(high) - f32::from(low)) / 7.0);
    let per_step = if step > 0.0 { 1.0 / step } else { 0.0 };
    values
        .iter()
        .map(|x| {
            let level = ((x - low) * per_step).round_ties_even().clamp(0.0, 7.0);
            (x - low - level * step).powi(2)
        })
        .sum()
}

fn block(values: &[f32; 16], [high, low]: [u8; 2]) -> [u8; BLOCK_BYTES] {
    let per_step = if high > low { 7.0 / (f32::from(high) - f32::from(low)) } else { 0.0 };
    let mut indices = 0u64;
    // Equal endpoints mean six levels, of which index 0 is the first endpoint.
    for (i, x) in values.iter().enumerate().filter(|_| high > low) {
        let below = 7 - (((x - f32::from(low)) * per_step).round_ties_even().clamp(0.0, 7.0) as u64);
        // The endpoints have the first two indices, the levels between them the others, from the first to the second.
        let index = match below {
            0 => 0,
            7 => 1,
            below => below + 1,
        };
        indices |= index << (3 * i);
    }
    let mut bytes = [0; BLOCK_BYTES];
    bytes[0] = high;
    bytes[1] = low;
    bytes[2..].copy_from_slice(&indices.to_le_bytes()[..6]);
    bytes
}

/// Returns the 16 values of a block, 0 to 255.
pub fn decode_block(bytes: &[u8; BLOCK_BYTES]) -> [f32; 16] {
    let [high, low] = [bytes[0], bytes[1]].map(f32::from);
    let mut indices = [0; 8];
    indices[..6].copy_from_slice(&bytes[2..]);
    let indices = u64::from_le_bytes(indices);
    std::array::from_fn(|i| match (indices >> (3 * i)) & 7 {
        0 => high,
        1 => low,
        index if high > low => high + (low - high) * (index - 1) as f32 / 7.0,
        6 => 0.0,
        7 => 255.0,
        index => high + (low - high) * (index - 1) as f32 / 5.0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use block_compression::CompressionVariant;
    use rand::{Rng, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// Returns a block by the crate's decoder.
    fn by_crate(bytes: &[u8; 8]) -> [f32; 16] {
        let mut rgba = [0; 64];
        block_compression::decode::decompress_blocks_as_rgba8(CompressionVariant::BC4, 4, 4, bytes, &mut rgba);
        std::array::from_fn(|i| f32::from(rgba[4 * i]))
    }

    fn error(values: &[f32; 16], decoded: &[f32; 16]) -> f32 {
        values.iter().zip(decoded).map(|(a, b)| (a - b).powi(2)).sum()
    }

    #[test]
    fn blocks_decode_as_others_decode_them_and_have_less_error_than_theirs() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(4);
        let (mut ours, mut theirs) = (0.0, 0.0);
        for _ in 0..500 {
            let (middle, width) = (random.gen_range(60.0..190.0f32), random.gen_range(0.0..20.0f32));
            let values: [f32; 16] = std::array::from_fn(|_| {
                middle + width * (0..6).map(|_| random.gen_range(-1.0..1.0f32)).sum::<f32>() / 2.0
            })
            .map(|x: f32| x.clamp(0.0, 255.0));
            let bytes = encode_block(&values);
            let decoded = decode_block(&bytes);
            assert!(decoded.iter().zip(by_crate(&bytes)).all(|(a, b)| (a - b).abs() <= 1.0), "{decoded:?}");
            let rgba: Vec<u8> = values.iter().flat_map(|x| [x.round() as u8, 0, 0, 255]).collect();
            let mut others = [0; 8];
            block_compression::encode::compress_rgba8(CompressionVariant::BC4, &rgba, &mut others, 4, 4, 16);
            ours += error(&values, &decoded);
            theirs += error(&values, &by_crate(&others));
        }
        assert!(ours < 0.85 * theirs, "{ours} {theirs}");
    }

    #[test]
    fn flat_blocks_and_the_ends_of_the_range_are_kept() {
        for value in [0.0, 17.0, 255.0] {
            assert_eq!(decode_block(&encode_block(&[value; 16])), [value; 16]);
        }
        let mut steps = [0.0; 16];
        steps[3] = 255.0;
        let decoded = decode_block(&encode_block(&steps));
        assert!(error(&steps, &decoded) < 1.0, "{decoded:?}");
        // Planted: indices of another block.
        let mut bytes = encode_block(&steps);
        bytes[3] ^= 0x18;
        assert!(error(&steps, &decode_block(&bytes)) > 1000.0);
    }

    #[test]
    fn six_levels_with_the_ends_of_the_range_decode() {
        let bytes = [10, 60, 0b1100_0001, 0b1, 0b1110_0000, 0, 0, 0];
        assert!(decode_block(&bytes).iter().zip(by_crate(&bytes)).all(|(a, b)| (a - b).abs() <= 1.0));
    }
}

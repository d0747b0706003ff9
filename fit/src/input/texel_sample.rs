//! A sample of texels that repeats no period of the material.

use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Returns at most `count` of `texels` texels in ascending order: one drawn from each of `count` equal runs.
///
/// Every n-th texel would be the same few columns again and again, and miss what lies between them; drawn freely, some
/// places would have no texel at all.
pub fn texel_sample(texels: usize, count: usize, seed: u64) -> Vec<usize> {
    let count = count.clamp(1, texels.max(1)).min(texels);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x7e8e_15a3);
    (0..count).map(|i| random.gen_range(i * texels / count..(i + 1) * texels / count)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_run_has_one_and_every_column_of_a_picture_is_met() {
        let sample = texel_sample(256 * 256, 8192, 1);
        assert!(sample.windows(2).all(|pair| pair[0] < pair[1]));
        assert!(sample.iter().enumerate().all(|(i, texel)| texel / 8 == i));
        let mut columns = [0; 256];
        sample.iter().for_each(|texel| columns[texel % 256] += 1);
        assert!(columns.iter().all(|count| (8..64).contains(count)), "{columns:?}");
        assert_eq!(texel_sample(5, 100, 2), [0, 1, 2, 3, 4]);
        assert!(texel_sample(0, 3, 2).is_empty());
        assert_ne!(texel_sample(1000, 10, 1), texel_sample(1000, 10, 2));
    }
}

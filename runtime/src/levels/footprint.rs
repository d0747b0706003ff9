//! Footprints of coarse cells on a finer grid, and the choice of samples.

/// Returns sample `i` of `count` from the numbers 0 to `all`: one from each of as many equal parts, at a hashed place
/// in it. Evenly spaced samples would be in step with the rows of a grid.
pub(super) fn spread(i: usize, count: usize, all: usize) -> usize {
    // Knuth's multiplicative hash, its upper bits.
    let part = ((i as u32).wrapping_mul(0x9e37_79b1) ^ 0x5bd1_e995).wrapping_mul(0x85eb_ca6b) >> 8;
    // Products are longer than the words of some machines.
    let (at, of_all) = (i as u64 * all as u64, (u64::from(part) * all as u64) >> 24);
    if count == all { i } else { ((at + of_all) / count as u64) as usize }
}

/// Returns the cells of a line of `finer` cells that cell `index` of `count` covers, with their shares, which sum up to
/// 1.
pub(super) fn footprint(index: usize, count: usize, finer: usize) -> Vec<(usize, f32)> {
    // In cells of the finer line times `count`, so that everything is whole.
    let (begin, end) = (index * finer, (index + 1) * finer);
    (begin / count..end.div_ceil(count))
        .map(|cell| {
            let covered = end.min((cell + 1) * count) - begin.max(cell * count);
            (cell, covered as f32 / finer as f32)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn footprints_cover_every_cell_once() {
        for (count, finer) in [(1, 1), (3, 6), (3, 7), (2, 5), (1, 9)] {
            let mut covered = vec![0.0; finer];
            for index in 0..count {
                let cells = footprint(index, count, finer);
                let sum: f32 = cells.iter().map(|(_, share)| share).sum();
                assert!((sum - 1.0).abs() < 1e-6);
                cells.iter().for_each(|(cell, share)| covered[*cell] += share);
            }
            let even = count as f32 / finer as f32;
            assert!(covered.iter().all(|x| (x - even).abs() < 1e-6), "{covered:?}");
        }
        assert_eq!(footprint(1, 2, 5), [(2, 0.2), (3, 0.4), (4, 0.4)]);
    }

    #[test]
    fn what_is_chosen_keeps_no_step_with_rows() {
        for (count, all, row) in
            [(384, 64 * 64, 64), (384, 128 * 128, 128), (256, 256 * 256, 256), (640, 128 * 128, 128)]
        {
            let chosen: Vec<usize> = (0..count).map(|i| spread(i, count, all)).collect();
            assert!(chosen.windows(2).all(|pair| pair[0] < pair[1]) && chosen[count - 1] < all);
            let columns: std::collections::BTreeSet<usize> = chosen.iter().map(|at| at % row).collect();
            assert!(columns.len() > row / 2, "{} of {row} columns", columns.len());
            // Planted difference: even steps.
            let even: std::collections::BTreeSet<usize> = (0..count).map(|i| i * all / count % row).collect();
            assert!(even.len() < row / 2, "{}", even.len());
        }
        assert_eq!((0..5).map(|i| spread(i, 5, 5)).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
    }
}

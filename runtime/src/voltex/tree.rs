//! Lookup in the tree of voxels. Each node covers 4 x 4 x 4 cells of an even level and has their voxels and those of
//! the 2 x 2 x 2 cells of the odd level above. Where a brick is not loaded, its parents are met. Twin:
//! `voltex/tree.wgsl`.

use super::node::{NO_VOXEL, cell_number, node_depth};
use super::words::Voltex;

/// The cell around a point: at the level asked for or, where that is empty, at the coarsest level at which the cell is
/// empty; where that is not loaded, at the finest level that is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cell {
    /// Binary logarithm of the cell's side in finest voxels.
    pub size: u32,
    /// Number of the cell's voxel, or [`NO_VOXEL`].
    pub voxel: u32,
    /// Number of the voxel of the cell twice as large around it, or [`NO_VOXEL`].
    pub parent: u32,
}

impl Voltex {
    /// Returns the cell at `level` around the finest voxel `q`. Twin: `voltex_cell`.
    pub fn cell(&self, q: [u32; 3], level: u32) -> Cell {
        let target = level / 2;
        let mut node = self.node(0);
        let mut parent = NO_VOXEL;
        let mut j = node_depth(self.level_count()) - 1;
        loop {
            let number = cell_number(q.map(|x| x >> (2 * j) & 3));
            let coarse = number >> 3;
            if j == target {
                let above =
                    if node.has_coarse(coarse) { node.first_voxel + node.coarse_rank(coarse) } else { NO_VOXEL };
                if level & 1 == 1 {
                    return Cell { size: level, voxel: above, parent };
                }
                if node.has(number) {
                    let own = node.first_voxel + node.coarse_rank(8) + node.rank(number);
                    return Cell { size: level, voxel: own, parent: above };
                }
                let size = level + u32::from(above == NO_VOXEL);
                return Cell { size, voxel: NO_VOXEL, parent: above };
            }
            if !node.has(number) {
                let size = 2 * j + u32::from(!node.has_coarse(coarse));
                return Cell { size, voxel: NO_VOXEL, parent: NO_VOXEL };
            }
            let rank = node.rank(number);
            parent = node.first_voxel + node.coarse_rank(8) + rank;
            let child = self.node(node.first_child + rank);
            if child.first_voxel == NO_VOXEL {
                return Cell { size: 2 * j, voxel: parent, parent: node.first_voxel + node.coarse_rank(coarse) };
            }
            node = child;
            j -= 1;
        }
    }

    /// Returns the numbers of the voxels of a level, in ascending order of [`super::volume::order`].
    pub fn numbers_at(&self, level: u32) -> Vec<u32> {
        let mut layer = vec![0u32];
        for _ in 0..node_depth(self.level_count()) - 1 - level / 2 {
            let children = |number: &u32| {
                let node = self.node(*number);
                node.first_child..node.first_child + node.cells()
            };
            layer = layer.iter().flat_map(children).collect();
        }
        let voxels = |number: &u32| {
            let node = self.node(*number);
            let fine = node.first_voxel + node.coarse_rank(8);
            if level % 2 == 1 { node.first_voxel..fine } else { fine..fine + node.cells() }
        };
        layer.iter().flat_map(voxels).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, random_volume, take_children};
    use crate::voltex::{Volume, Voxel};
    use std::collections::BTreeMap;

    /// Returns how many cells of `voltex` are those of `volume`, or the first that is not.
    fn first_wrong(volume: &Volume, voltex: &Voltex, random: &mut Random) -> Result<usize, String> {
        let count = volume.level_count();
        let levels: Vec<BTreeMap<[u32; 3], &Voxel>> =
            volume.levels.iter().map(|level| level.voxels.iter().map(|(at, voxel)| (*at, voxel)).collect()).collect();
        let at = |q: [u32; 3], level: u32| levels.get(level as usize)?.get(&q.map(|x| x >> level)).copied();
        let side = 1usize << count;
        let all = side.pow(3).min(4096);
        for i in 0..all {
            let number = if all < side.pow(3) { random.below(side.pow(3)) } else { i };
            let q = [0, 1, 2].map(|axis| (number / side.pow(axis) % side) as u32);
            for level in 0..=count {
                let cell = voltex.cell(q, level);
                let words = |number: u32| (number != NO_VOXEL).then(|| voltex.voxel(number).words());
                let empty_to = (level..=count).take_while(|level| at(q, *level).is_none()).last();
                let own = at(q, level).map(|voxel| Voxel::at(&voxel.words(), 0).words());
                let above = at(q, level + 1).map(|voxel| Voxel::at(&voxel.words(), 0).words());
                let parent = if level < count { words(cell.parent) } else { above };
                if words(cell.voxel) != own || parent != above || cell.size != empty_to.unwrap_or(level) {
                    return Err(format!("{q:?} at {level} of {count}: {cell:?}, empty to {empty_to:?}"));
                }
            }
        }
        Ok(all)
    }

    #[test]
    fn where_children_are_not_loaded_their_parents_are_met() {
        let mut random = Random::new(9);
        let mut met = 0;
        for level_count in 2..8 {
            let whole = random_volume(&mut random, level_count, 0.4);
            let mut part = whole.clone();
            take_children(&mut random, &mut part, 0.3);
            let [whole, part] = [whole, part].map(|volume| Voltex::new(&volume));
            assert!(part.words().len() < whole.words().len());
            let words = |voltex: &Voltex, cell: Cell| {
                let of = |number: u32| (number != NO_VOXEL).then(|| voltex.voxel(number).words());
                (cell.size, of(cell.voxel), of(cell.parent))
            };
            for _ in 0..4096 {
                let q = [0; 3].map(|_| random.below(1 << level_count) as u32);
                for level in 0..=level_count {
                    let [own, found] = [whole.cell(q, level), part.cell(q, level)];
                    if words(&part, found) == words(&whole, own) {
                        continue;
                    }
                    // Coarser, and what the whole volume has there.
                    met += 1;
                    assert!(found.size > level && found.size % 2 == 0 && found.voxel != NO_VOXEL, "{found:?}");
                    assert_eq!(words(&part, found), words(&whole, whole.cell(q, found.size)), "{q:?} at {level}");
                }
            }
        }
        assert!(met > 10_000, "{met}");
    }

    #[test]
    fn the_tree_finds_the_voxels_of_the_volume_and_no_others() {
        let mut random = Random::new(5);
        for level_count in 0..8 {
            for share in [0.0, 0.2, 0.6, 1.0] {
                if level_count > 5 && share > 0.5 {
                    continue;
                }
                let mut volume = random_volume(&mut random, level_count, share);
                let voltex = Voltex::new(&volume);
                first_wrong(&volume, &voltex, &mut random).unwrap();
                for (level, voxels) in volume.levels.iter().enumerate() {
                    let found: Vec<Voxel> =
                        voltex.numbers_at(level as u32).iter().map(|number| voltex.voxel(*number)).collect();
                    let expected: Vec<Voxel> =
                        voxels.voxels.iter().map(|(_, voxel)| Voxel::at(&voxel.words(), 0)).collect();
                    assert_eq!(found, expected, "level {level} of {level_count}");
                }
                // Planted differences: other microflakes in a voxel, which all finest voxels are under, and one voxel
                // elsewhere.
                volume.levels[level_count as usize].voxels[0].1 = Voxel::default();
                assert!(first_wrong(&volume, &voltex, &mut random).is_err());
            }
        }
        let mut volume = random_volume(&mut random, 3, 0.3);
        let voltex = Voltex::new(&volume);
        assert_eq!(first_wrong(&volume, &voltex, &mut random), Ok(512));
        volume.levels[0].voxels[0].0[0] ^= 1;
        assert!(first_wrong(&volume, &voltex, &mut random).is_err());
    }
}

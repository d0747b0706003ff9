//! Codes a level of a file: which children the voxels of the coarser level have, then the codes of those children. One
//! routine serves encoder and decoder, as in [`crate::container::entropy`]. Normative text: docs/reference/voltex.md, chapter
//! "Levels".

use super::codes::{ANGLE_BITS, DENSITY_STEPS, RATIO_BITS, VoxelCodes};
use crate::container::entropy::{BinaryCoder, Bit, Signed, Tree};

/// Least number of decisions that a voxel takes besides its bit of a mask: its density, axis and ratios, and where its
/// material is from.
pub const MIN_DECISIONS: usize = 3 + 2 * RATIO_BITS + 1;

/// The codes of a voxel with its material.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CodedVoxel {
    /// Codes of the voxel's extinction.
    pub codes: VoxelCodes,
    /// Number of its material, at most 65535.
    pub material: u32,
}

/// Codes which of the eight children each voxel of a level has: bit c of a mask stands for the child whose Morton
/// number ends in c.
pub fn code_masks(coder: &mut impl BinaryCoder, masks: &mut [u8]) {
    let mut tree = Tree::<8>::new();
    masks.iter_mut().for_each(|mask| *mask = tree.code(coder, u32::from(*mask)) as u8);
}

/// Returns the expected density of one of `count` children relative to its parent, as a code: all children together are
/// expected to have the parent's density.
pub fn density_of_children(count: u32) -> i32 {
    (f64::from(DENSITY_STEPS) * (8.0 / f64::from(count)).log2()).round() as i32
}

/// A model of angles: a magnitude below `2^ANGLE_BITS` and a sign.
struct AngleModel {
    magnitude: Vec<Tree<ANGLE_BITS>>,
    sign: Bit,
}

impl AngleModel {
    fn new(contexts: usize) -> AngleModel {
        AngleModel { magnitude: vec![Tree::new(); contexts], sign: Bit::NEW }
    }

    fn code(&mut self, coder: &mut impl BinaryCoder, angle: i8, context: usize) -> i8 {
        let magnitude = self.magnitude[context].code(coder, u32::from(angle.unsigned_abs())) as i8;
        if magnitude > 0 && coder.bit(&mut self.sign, angle < 0) { -magnitude } else { magnitude }
    }
}

/// Codes which of a level's voxels have a second sort of microflakes in their cells.
pub fn code_others(coder: &mut impl BinaryCoder, have: &mut [bool]) {
    // By what the one before has.
    let mut bits = [Bit::NEW; 2];
    let mut before = false;
    for has in have {
        *has = coder.bit(&mut bits[usize::from(before)], *has);
        before = *has;
    }
}

/// Codes voxels. `alike` has for each the voxel by which it is predicted, and by how much denser than that it is
/// expected to be. Returns false if the decoder met a number that is out of its range.
pub fn code_voxels(
    coder: &mut impl BinaryCoder,
    alike: impl Iterator<Item = (CodedVoxel, i32)>,
    voxels: &mut [CodedVoxel],
) -> bool {
    let mut fits = true;
    let mut density = Signed::new();
    let mut axes = vec![Tree::<2>::new(); 3];
    let mut ratios = vec![Tree::<RATIO_BITS>::new(); 2];
    let (mut angles, mut partial) = (AngleModel::new(2), AngleModel::new(ANGLE_BITS + 1));
    let mut same = [[Bit::NEW; 2]; 2];
    let mut bytes = [Tree::<8>::new(), Tree::<8>::new()];
    // Differences of the last two densities; the last material, and whether it was the parent's.
    let (mut last, mut last_material, mut was_same) = ([0i32; 2], 0, 0);
    for (voxel, (parent, more)) in voxels.iter_mut().zip(alike) {
        let codes = &mut voxel.codes;
        let expected = parent.codes.density + more;
        let around = 2 * last[0].unsigned_abs() + last[1].unsigned_abs();
        let difference = density.code(coder, codes.density - expected, around, last[0].signum() + last[1].signum());
        last = [difference, last[0]];
        codes.density = expected + difference;
        fits &= codes.density_in_range();

        codes.axis = axes[usize::from(parent.codes.axis)].code(coder, u32::from(codes.axis)) as u8;
        if codes.axis > 2 {
            fits = false;
            codes.axis = 0;
        }
        for (model, ratio) in ratios.iter_mut().zip(&mut codes.ratios) {
            *ratio = model.code(coder, u32::from(*ratio)) as u8;
        }
        fits &= codes.axis_is_first();
        for slot in 0..2 {
            let coded = codes.ratios[slot] > 0;
            codes.angles[slot] = if coded { angles.code(coder, codes.angles[slot], slot) } else { 0 };
        }
        let right = codes.partial_right_angle();
        let digits = (32 - right.leading_zeros()) as usize;
        codes.angles[2] = if right > 0 { partial.code(coder, codes.angles[2], digits) } else { 0 };
        fits &= i32::from(codes.angles[2].unsigned_abs()) <= right;

        let material = voxel.material;
        voxel.material = if coder.bit(&mut same[0][was_same], material == parent.material) {
            was_same = 1;
            parent.material
        } else {
            let again = coder.bit(&mut same[1][was_same], material == last_material);
            was_same = 0;
            if again {
                last_material
            } else {
                let high = bytes[0].code(coder, material >> 8);
                high << 8 | bytes[1].code(coder, material & 255)
            }
        };
        last_material = voxel.material;
    }
    fits
}

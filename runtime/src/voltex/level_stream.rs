//! The stream of a level, or of one brick of it: which children the voxels of the coarser level have, and their codes.
//! Normative text: docs/reference/voltex.md, chapter "Level".

use super::codes::{DENSITY_STEPS, VoxelCodes};
use super::coding::{CodedVoxel, MIN_DECISIONS, code_masks, code_others, code_voxels, density_of_children};
use super::rule;
use super::volume::order;
use crate::container::entropy::{Decoder, Encoder, bounded};
use crate::rule::Rule;

/// A voxel by its coordinates.
pub(super) type PlacedVoxel = ([u32; 3], CodedVoxel);

/// The voxels of a level, or of one brick of it.
#[derive(Debug, Clone, Default)]
pub(super) struct CodedVoxels {
    /// Coordinates and codes, in ascending order of [`order`].
    pub voxels: Vec<PlacedVoxel>,
    /// Second sorts of microflakes: index in `voxels` of the voxel whose cell they share, ascending, and the codes.
    pub others: Vec<(u32, CodedVoxel)>,
}

impl CodedVoxels {
    /// Adds the voxels of the next brick.
    pub(super) fn append(&mut self, brick: CodedVoxels) {
        let first = self.voxels.len() as u32;
        self.voxels.extend(brick.voxels);
        self.others.extend(brick.others.into_iter().map(|(number, voxel)| (first + number, voxel)));
    }
}

/// Codes voxels whose parents are `coarser`, those of the coarsest level [`ROOT_PARENT`] for an empty slice. `others`
/// are numbered from `first` on.
pub(super) fn code_stream(
    coarser: &[PlacedVoxel],
    voxels: &[PlacedVoxel],
    others: &[(u32, CodedVoxel)],
    first: u32,
) -> Vec<u8> {
    let mut coder = Encoder::new();
    let parents = if coarser.is_empty() {
        ROOT_PARENT.to_vec()
    } else {
        let mut children = voxels.iter().map(|(at, _)| order(*at)).peekable();
        let mut masks: Vec<u8> = coarser
            .iter()
            .map(|(at, _)| {
                let number = order(*at);
                let own = std::iter::from_fn(|| children.next_if(|child| child >> 3 == number));
                own.fold(0, |mask, child| mask | 1 << (child & 7))
            })
            .collect();
        code_masks(&mut coder, &mut masks);
        coarser.iter().map(|(_, voxel)| *voxel).zip(masks).collect()
    };
    let mut voxels: Vec<CodedVoxel> = voxels.iter().map(|(_, voxel)| *voxel).collect();
    code_voxels(&mut coder, children(&parents), &mut voxels);
    let mut have = vec![false; voxels.len()];
    others.iter().for_each(|(number, _)| have[(*number - first) as usize] = true);
    code_others(&mut coder, &mut have);
    let beside = others.iter().map(|(number, _)| (voxels[(*number - first) as usize], 0));
    let mut others: Vec<CodedVoxel> = others.iter().map(|(_, voxel)| *voxel).collect();
    code_voxels(&mut coder, beside, &mut others);
    coder.finish()
}

/// Reads the voxels whose parents are `coarser`, of one of so many `materials` each. The error is the rule that does
/// not hold.
///
/// Allocates for voxels what `stream` can hold.
pub(super) fn read_stream(stream: &[u8], coarser: &[PlacedVoxel], materials: u32) -> Result<CodedVoxels, Rule> {
    let mut decoder = Decoder::new(stream);
    let (parents, places) = if coarser.is_empty() {
        (ROOT_PARENT.to_vec(), vec![[0; 3]])
    } else {
        bounded(8 * coarser.len(), stream)?;
        let mut masks = vec![0; coarser.len()];
        code_masks(&mut decoder, &mut masks);
        if masks.contains(&0) {
            return Err(rule::NO_CHILD);
        }
        let count: usize = masks.iter().map(|mask| mask.count_ones() as usize).sum();
        bounded(MIN_DECISIONS * count, stream)?;
        let places: Vec<[u32; 3]> =
            coarser.iter().zip(&masks).flat_map(|((at, _), mask)| children_of(*at, *mask)).collect();
        (coarser.iter().map(|(_, voxel)| *voxel).zip(masks).collect(), places)
    };
    let mut voxels = vec![CodedVoxel::default(); places.len()];
    let mut fits = code_voxels(&mut decoder, children(&parents), &mut voxels);
    let mut have = vec![false; voxels.len()];
    code_others(&mut decoder, &mut have);
    let shared: Vec<u32> = (0..voxels.len() as u32).filter(|number| have[*number as usize]).collect();
    bounded(MIN_DECISIONS * (voxels.len() + shared.len()), stream)?;
    let mut others = vec![CodedVoxel::default(); shared.len()];
    fits &= code_voxels(&mut decoder, shared.iter().map(|number| (voxels[*number as usize], 0)), &mut others);
    decoder.ended()?;
    if !fits {
        return Err(rule::VOXEL_RANGE);
    }
    if voxels.iter().chain(&others).any(|voxel| voxel.material >= materials) {
        return Err(rule::NO_MATERIAL);
    }
    Ok(CodedVoxels {
        voxels: places.into_iter().zip(voxels).collect(),
        others: shared.into_iter().zip(others).collect(),
    })
}

/// Returns for each child its parent, and by how much denser than that it is expected to be.
fn children(parents: &[(CodedVoxel, u8)]) -> impl Iterator<Item = (CodedVoxel, i32)> {
    parents.iter().flat_map(|(parent, mask)| {
        let count = mask.count_ones();
        std::iter::repeat_n((*parent, density_of_children(count)), count as usize)
    })
}

/// Parent of the coarsest level's voxel, its only child, of which density 1 is expected.
const ROOT_PARENT: [(CodedVoxel, u8); 1] = [(
    CodedVoxel {
        codes: VoxelCodes { density: -3 * DENSITY_STEPS, axis: 0, ratios: [0; 2], angles: [0; 3] },
        material: 0,
    },
    1,
)];

/// Returns the places of a voxel's children, in order.
fn children_of(at: [u32; 3], mask: u8) -> impl Iterator<Item = [u32; 3]> {
    let numbers = (0..8u32).filter(move |child| mask >> child & 1 == 1);
    numbers.map(move |child| std::array::from_fn(|axis| 2 * at[axis] + (child >> axis & 1)))
}

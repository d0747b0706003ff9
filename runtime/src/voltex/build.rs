//! Lays a volume out as words: header, materials, levels, the tree's nodes, the voxels.

use super::matrix::Sym3;
use super::node::{NO_VOXEL, Node, cell_number, node_depth};
use super::volume::{Volume, VolumeLevel};
use super::voxel::{OTHER_AT, VOXEL_WORDS, Voxel};
use super::words::{
    EXTENT_AT, FLAGS_AT, HEADER_WORDS, LEVEL_COUNT_AT, LEVELS_AT, MATERIALS_AT, NODES_AT, SIDE_AT, VOXELS_AT, Voltex,
};
use crate::numeric::quantize::word_from_halves;
use std::collections::BTreeMap;

impl Voltex {
    /// Lays out a volume for decoders.
    pub fn new(volume: &Volume) -> Voltex {
        let level_count = volume.level_count();
        let mut words = vec![0; HEADER_WORDS];
        words[LEVEL_COUNT_AT] = level_count;
        words[FLAGS_AT] = u32::from(volume.cyclic[0]) | u32::from(volume.cyclic[1]) << 1;
        for axis in 0..3 {
            words[EXTENT_AT + axis] = volume.extent[axis].to_bits();
        }
        words[SIDE_AT] = volume.side_m.to_bits();
        words[MATERIALS_AT] = words.len() as u32;
        for m in &volume.materials {
            let ([a, b, c], [d, e, f]) = (m.reflectance, m.transmittance);
            words.extend([(a, b), (c, d), (e, f), (m.specular, m.roughness)].map(|(x, y)| word_from_halves(x, y)));
        }
        words[LEVELS_AT] = words.len() as u32;
        for level in &volume.levels {
            words.push(level.shadow.offset.to_bits());
            words.extend(level.shadow.shared.map(f32::to_bits));
            words.extend(level.clumping.0.map(f32::to_bits));
            words.extend(level.facets.0.map(f32::to_bits));
        }
        let (nodes, voxels) = tree_of(volume);
        words[NODES_AT] = words.len() as u32;
        words.extend_from_slice(bytemuck::cast_slice(&nodes));
        words[VOXELS_AT] = words.len() as u32;
        words.extend(voxels);
        Voltex::from_words(words)
    }
}

/// The microflakes of a cell, of one sort or of two.
type Microflakes<'a> = (&'a Voxel, Option<&'a Voxel>);

/// Builds the tree: nodes and the words of their voxels, layer by layer from the root.
fn tree_of<'a>(volume: &'a Volume) -> (Vec<Node>, Vec<u32>) {
    let levels: Vec<BTreeMap<[u32; 3], Microflakes>> = volume.levels.iter().map(microflakes_by_place).collect();
    let (mut nodes, mut voxels) = (Vec::new(), Vec::new());
    // What stands behind all voxels of the tree, which are numbered by it.
    let mut others: Vec<&Voxel> = Vec::new();
    // Corners of the cells that have a node, in cells of the layer above.
    let mut layer: Vec<[u32; 3]> = vec![[0; 3]];
    for j in (0..node_depth(volume.level_count())).rev() {
        let at_level = |level: u32, at: &[u32; 3]| levels.get(level as usize).and_then(|l| l.get(at).copied());
        let mut next = Vec::new();
        let first_of_next = nodes.len() + layer.len();
        for origin in &layer {
            let mut node = Node {
                mask: [0; 2],
                first_voxel: (voxels.len() / VOXEL_WORDS) as u32,
                first_child: if j == 0 { 0 } else { (first_of_next + next.len()) as u32 },
            };
            // Cells by their numbers.
            let mut cells: Vec<[u32; 3]> = vec![[0; 3]; 64];
            for i in 0..64u32 {
                let part = [i & 3, i >> 2 & 3, i >> 4];
                cells[cell_number(part) as usize] = std::array::from_fn(|axis| 4 * origin[axis] + part[axis]);
            }
            let mut push = |(voxel, other): Microflakes<'a>| {
                voxels.extend(voxel.words());
                voxels.push(other.map_or(NO_VOXEL, |_| others.len() as u32));
                others.extend(other);
            };
            let fine: Vec<_> = (0..64).filter_map(|number| Some((number, at_level(2 * j, &cells[number])?))).collect();
            fine.iter().for_each(|(number, _)| node.mask[number / 32] |= 1 << (number % 32));
            for coarse in (0..8).filter(|coarse| node.has_coarse(*coarse)) {
                let at = cells[8 * coarse as usize].map(|x| x / 2);
                push(at_level(2 * j + 1, &at).unwrap_or((&NOTHING, None)));
            }
            for (number, microflakes) in fine {
                push(microflakes);
                if j > 0 {
                    next.push(cells[number]);
                }
            }
            nodes.push(node);
        }
        layer = next;
    }
    let count = (voxels.len() / VOXEL_WORDS) as u32;
    let numbers = voxels.iter_mut().skip(OTHER_AT).step_by(VOXEL_WORDS);
    numbers.filter(|number| **number != NO_VOXEL).for_each(|number| *number += count);
    for other in others {
        voxels.extend(other.words());
        voxels.push(NO_VOXEL);
    }
    (nodes, voxels)
}

/// A voxel without microflakes.
const NOTHING: Voxel = Voxel { extinction: Sym3([0.0; 6]), moment: Sym3([0.0; 6]), material: 0 };

/// Returns a level's voxels by place, with the second sort of microflakes in their cells.
fn microflakes_by_place(level: &VolumeLevel) -> BTreeMap<[u32; 3], Microflakes<'_>> {
    let mut others = level.others.iter().peekable();
    let voxels = level.voxels.iter().enumerate();
    voxels
        .map(|(i, (at, voxel))| {
            let other = others.next_if(|(number, _)| *number as usize == i);
            (*at, (voxel, other.map(|(_, other)| other)))
        })
        .collect()
}

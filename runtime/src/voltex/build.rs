//! Lays a volume out as words: header, materials, levels, the tree's nodes, the voxels.

use super::matrix::Sym3;
use super::node::{NO_VOXEL, Node, node_depth};
use super::volume::{Volume, order};
use super::voxel::{OTHER_AT, VOXEL_WORDS, Voxel};
use super::words::{
    EXTENT_AT, FLAGS_AT, HEADER_WORDS, LEVEL_COUNT_AT, LEVELS_AT, MATERIALS_AT, NODES_AT, SIDE_AT, VOXELS_AT, Voltex,
};
use crate::numeric::quantize::word_from_halves;

impl Voltex {
    /// Lays out a volume for decoders. Voxels of an even level may lack their children, as those of bricks that are not
    /// loaded: they are met in the place of these. Cost: a pass over the voxels.
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
            words.extend(level.light_correction.0.map(f32::to_bits));
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

/// The tree as it is laid out.
#[derive(Default)]
struct Tree<'a> {
    nodes: Vec<Node>,
    /// Words of the voxels.
    voxels: Vec<u32>,
    /// Voxels that will stand behind those of the nodes, and are numbered by the tree.
    others: Vec<&'a Voxel>,
}

impl<'a> Tree<'a> {
    /// Returns the number of the next voxel.
    fn next_voxel(&self) -> u32 {
        (self.voxels.len() / VOXEL_WORDS) as u32
    }

    fn push(&mut self, (voxel, other): Microflakes<'a>) {
        self.voxels.extend(voxel.words());
        self.voxels.push(other.map_or(NO_VOXEL, |_| self.others.len() as u32));
        self.others.extend(other);
    }
}

/// Builds the tree: nodes and the words of their voxels, layer by layer from the root. Cells without children have an
/// absent node in their place.
fn tree_of(volume: &Volume) -> (Vec<Node>, Vec<u32>) {
    let mut tree = Tree::default();
    // Morton numbers of the cells that have a node.
    let mut layer = vec![0u64];
    for j in (0..node_depth(volume.level_count())).rev() {
        let [mut fine, mut coarse] = [2 * j, 2 * j + 1].map(|level| Cells::of(volume, level));
        let mut next = Vec::new();
        let first_of_next = tree.nodes.len() + layer.len();
        for number in &layer {
            let mut above = [(&NOTHING, None); 8];
            while let Some((cell, microflakes)) = coarse.next_within(*number, 3) {
                above[(cell & 7) as usize] = microflakes;
            }
            let own: Vec<(u64, Microflakes)> = std::iter::from_fn(|| fine.next_within(*number, 6)).collect();
            if own.is_empty() && !tree.nodes.is_empty() {
                tree.nodes.push(Node::ABSENT);
                continue;
            }
            let first_child = if j == 0 { 0 } else { (first_of_next + next.len()) as u32 };
            let mut node = Node { mask: [0; 2], first_voxel: tree.next_voxel(), first_child };
            own.iter().for_each(|(cell, _)| node.mask[(cell >> 5 & 1) as usize] |= 1 << (cell & 31));
            (0..8).filter(|cell| node.has_coarse(*cell)).for_each(|cell| tree.push(above[cell as usize]));
            for (cell, microflakes) in own {
                tree.push(microflakes);
                next.push(cell);
            }
            tree.nodes.push(node);
        }
        layer = next;
    }
    let count = tree.next_voxel();
    let numbers = tree.voxels.iter_mut().skip(OTHER_AT).step_by(VOXEL_WORDS);
    numbers.filter(|number| **number != NO_VOXEL).for_each(|number| *number += count);
    for other in tree.others {
        tree.voxels.extend(other.words());
        tree.voxels.push(NO_VOXEL);
    }
    (tree.nodes, tree.voxels)
}

/// A voxel without microflakes.
const NOTHING: Voxel = Voxel { extinction: Sym3([0.0; 6]), moment: Sym3([0.0; 6]), material: 0 };

/// The cells of a level in Morton order, front to back.
struct Cells<'a> {
    voxels: &'a [([u32; 3], Voxel)],
    others: &'a [(u32, Voxel)],
    /// Number of the next voxel in the level.
    number: u32,
}

impl<'a> Cells<'a> {
    /// Begins at a level's first cell; a level that the volume has not has none.
    fn of(volume: &'a Volume, level: u32) -> Cells<'a> {
        match volume.levels.get(level as usize) {
            Some(level) => Cells { voxels: &level.voxels, others: &level.others, number: 0 },
            None => Cells { voxels: &[], others: &[], number: 0 },
        }
    }

    /// Returns the next cell, by its Morton number, if that begins with `parent` before its last `bits`.
    fn next_within(&mut self, parent: u64, bits: u32) -> Option<(u64, Microflakes<'a>)> {
        let ((at, voxel), rest) = self.voxels.split_first()?;
        let cell = order(*at);
        if cell >> bits != parent {
            return None;
        }
        let other = self.others.split_first().filter(|((number, _), _)| *number == self.number);
        if let Some((_, rest)) = other {
            self.others = rest;
        }
        (self.voxels, self.number) = (rest, self.number + 1);
        Some((cell, (voxel, other.map(|((_, other), _)| other))))
    }
}

//! A volume's words, as decoders bind them: a header, then materials, levels, nodes and voxels. Twin:
//! `shaders/voltex_words.wgsl`.

use super::gloss::{FACETS, Facets};
use super::matrix::{Sym3, dot};
use super::tree::{NO_VOXEL, NODE_WORDS, Node, cell_number, node_depth};
use super::volume::{HOTSPOT_DEG, LevelShadow, MicroflakeMaterial, Volume, VolumeLevel};
use super::voxel::{OTHER_AT, VOXEL_WORDS, Voxel};
use crate::numeric::quantize::{half_at, word_from_halves};
use std::collections::BTreeMap;

/// Words of the header.
pub const HEADER_WORDS: usize = 16;
/// Header word: binary logarithm of the finest level's voxels a side.
pub const LEVEL_COUNT_AT: usize = 0;
/// Header word: where the nodes begin.
pub const NODES_AT: usize = 1;
/// Header word: where the voxels begin.
pub const VOXELS_AT: usize = 2;
/// Header word: where the materials begin.
pub const MATERIALS_AT: usize = 3;
/// Header word: where the levels' numbers begin, finest first.
pub const LEVELS_AT: usize = 4;
/// Header word: bit 0 cyclic in x, bit 1 in y.
pub const FLAGS_AT: usize = 5;
/// Header words: three numbers, the part of the unit cube that is used.
pub const EXTENT_AT: usize = 6;
/// Header word: metres per side of the unit cube.
pub const SIDE_AT: usize = 9;
/// Words of a material: eight halves.
pub const MATERIAL_WORDS: usize = 4;
/// First word of a level's clumping, behind its shadows: offset, then shares.
pub const CLUMPING_AT: usize = 1 + HOTSPOT_DEG.len();
/// First word of a level's facets, behind its clumping.
pub const FACETS_AT: usize = CLUMPING_AT + 6;
/// Words of a level's numbers.
pub const LEVEL_WORDS: usize = FACETS_AT + FACETS;

/// A volume made ready for decoders.
#[derive(Debug, Clone, PartialEq)]
pub struct Voltex {
    words: Vec<u32>,
}

impl Voltex {
    /// Lays a volume out.
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
        Voltex { words }
    }

    /// The words.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// Side of a voxel of a level, sides of the unit cube.
    pub fn voxel_side(&self, level: u32) -> f32 {
        (1u32 << level) as f32 / (1u32 << self.level_count()) as f32
    }

    /// Binary logarithm of the finest level's voxels a side. Twin: `voltex_level_count`.
    pub fn level_count(&self) -> u32 {
        self.words[LEVEL_COUNT_AT]
    }

    /// Whether what leaves at one end in x, and in y, comes in at the other. Twin: `voltex_cyclic`.
    pub fn cyclic(&self) -> [bool; 2] {
        [0, 1].map(|axis| self.words[FLAGS_AT] >> axis & 1 == 1)
    }

    /// The part of the unit cube that is used. Twin: `voltex_extent`.
    pub fn extent(&self) -> [f32; 3] {
        std::array::from_fn(|axis| f32::from_bits(self.words[EXTENT_AT + axis]))
    }

    /// Metres per side of the unit cube. Twin: `voltex_side_m`.
    pub fn side_m(&self) -> f32 {
        f32::from_bits(self.words[SIDE_AT])
    }

    /// A node by its number. Twin: `voltex_node`.
    pub(super) fn node(&self, number: u32) -> Node {
        let at = self.words[NODES_AT] as usize + number as usize * NODE_WORDS;
        bytemuck::pod_read_unaligned(bytemuck::cast_slice(&self.words[at..at + NODE_WORDS]))
    }

    /// A voxel by its number. Twin: `voltex_voxel`.
    pub fn voxel(&self, number: u32) -> Voxel {
        Voxel::at(&self.words, self.words[VOXELS_AT] as usize + number as usize * VOXEL_WORDS)
    }

    /// Number of the voxel with the second sort of microflakes in the cell of another, or [`NO_VOXEL`]. Twin: `voltex_other`.
    pub fn other(&self, number: u32) -> u32 {
        self.words[self.words[VOXELS_AT] as usize + number as usize * VOXEL_WORDS + OTHER_AT]
    }

    /// The microflakes of a cell by its voxel's number: of one sort or of two. Of [`NO_VOXEL`] none.
    pub fn microflakes(&self, number: u32) -> impl Iterator<Item = (u32, Voxel)> {
        let is_there = |number: &u32| *number != NO_VOXEL;
        let numbers = std::iter::successors(Some(number).filter(is_there), move |number| {
            Some(self.other(*number)).filter(is_there)
        });
        numbers.map(|number| (number, self.voxel(number)))
    }

    /// Optical depth per length of all microflakes of a cell along d, which need not be unit, before the level's clumping.
    /// Twin: `voltex_extinction_along`.
    pub fn extinction_along(&self, number: u32, d: [f32; 3]) -> f32 {
        self.microflakes(number).map(|(_, voxel)| voxel.extinction_along(d)).sum()
    }

    /// Puts other microflakes in the place of some.
    pub fn set_voxel(&mut self, number: u32, voxel: &Voxel) {
        let at = self.words[VOXELS_AT] as usize + number as usize * VOXEL_WORDS;
        self.words[at..at + OTHER_AT].copy_from_slice(&voxel.words());
    }

    /// How many voxels all levels have, those of the second sort among them.
    pub fn voxel_count(&self) -> usize {
        (self.words.len() - self.words[VOXELS_AT] as usize) / VOXEL_WORDS
    }

    /// What microflakes of a material are made of. Twin: `voltex_material`.
    pub fn material(&self, number: u32) -> MicroflakeMaterial {
        let at = self.words[MATERIALS_AT] as usize + number as usize * MATERIAL_WORDS;
        let half = |i: usize| half_at(self.words[at + i / 2], i as u32 % 2);
        MicroflakeMaterial {
            reflectance: [half(0), half(1), half(2)],
            transmittance: [half(3), half(4), half(5)],
            specular: half(6),
            roughness: half(7),
        }
    }

    /// Where a level's numbers begin.
    fn level_at(&self, level: u32) -> usize {
        self.words[LEVELS_AT] as usize + level as usize * LEVEL_WORDS
    }

    /// How a level's shadows fall. Twin: `voltex_shadow`, where their words begin.
    pub fn shadow(&self, level: u32) -> LevelShadow {
        let at = self.level_at(level);
        let number = |i: usize| f32::from_bits(self.words[at + i]);
        LevelShadow { offset: number(0), shared: std::array::from_fn(|i| number(1 + i)) }
    }

    /// Replaces them.
    pub fn set_shadow(&mut self, level: u32, shadow: &LevelShadow) {
        let at = self.level_at(level);
        self.words[at] = shadow.offset.to_bits();
        (0..HOTSPOT_DEG.len()).for_each(|i| self.words[at + 1 + i] = shadow.shared[i].to_bits());
    }

    /// A level's clumping.
    pub fn clumping(&self, level: u32) -> Sym3 {
        let at = self.level_at(level) + CLUMPING_AT;
        Sym3(std::array::from_fn(|i| f32::from_bits(self.words[at + i])))
    }

    /// Replaces it.
    pub fn set_clumping(&mut self, level: u32, clumping: &Sym3) {
        let at = self.level_at(level) + CLUMPING_AT;
        (0..6).for_each(|i| self.words[at + i] = clumping.0[i].to_bits());
    }

    /// What depths along d, of any length, are multiplied by for a level's clumping; for levels beyond the coarsest by that one's.
    /// Twin: `voltex_clumping_along`.
    pub fn clumping_along(&self, level: u32, d: [f32; 3]) -> f32 {
        let level = level.min(self.level_count());
        (self.clumping(level).form(d, d) / dot(d, d).max(1e-30)).exp()
    }

    /// How a level's facets are spread, beyond what ellipsoids know.
    pub fn facets(&self, level: u32) -> Facets {
        let at = self.level_at(level) + FACETS_AT;
        Facets(std::array::from_fn(|i| f32::from_bits(self.words[at + i])))
    }

    /// What the gloss of a level's microflakes is multiplied by, of which facets along `half` are seen; for levels beyond the coarsest by
    /// that one's. Twin: `voltex_facets_along`.
    pub fn facets_along(&self, level: u32, half: [f32; 3]) -> f32 {
        self.facets(level.min(self.level_count())).denser(half)
    }
}

/// A cell's microflakes, of one sort or of two.
type Microflakes<'a> = (&'a Voxel, Option<&'a Voxel>);

/// Nodes and the words of their voxels, layer by layer from the root.
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

/// A level's voxels with the second sort of microflakes in their cells.
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

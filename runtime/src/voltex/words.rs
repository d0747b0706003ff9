//! The words of a volume, as decoders bind them: a header, then materials, levels, nodes and voxels.
//! Twin: `voltex/words.wgsl`.

use super::corrections::facets::{FACETS, Facets};
use super::corrections::light_correction::{LIGHT_TERMS, LightCorrection};
use super::matrix::Sym3;
use super::node::{NO_VOXEL, NODE_WORDS, Node};
use super::volume::{HOTSPOT_DEG, LevelShadow, MicroflakeMaterial};
use super::voxel::{OTHER_AT, VOXEL_WORDS, Voxel};
use crate::numeric::quantize::half_at;
use crate::numeric::vector::dot;

/// Number of words of the header.
pub const HEADER_WORDS: usize = 16;
/// Header word: binary logarithm of the number of the finest level's voxels a side.
pub const LEVEL_COUNT_AT: usize = 0;
/// Header word: first word of the nodes.
pub const NODES_AT: usize = 1;
/// Header word: first word of the voxels.
pub const VOXELS_AT: usize = 2;
/// Header word: first word of the materials.
pub const MATERIALS_AT: usize = 3;
/// Header word: first word of the levels' numbers, finest first.
pub const LEVELS_AT: usize = 4;
/// Header word: bit 0 cyclic in x, bit 1 in y.
pub const FLAGS_AT: usize = 5;
/// Header words: three numbers, the used part of the unit cube.
pub const EXTENT_AT: usize = 6;
/// Header word: side of the unit cube in metres.
pub const SIDE_AT: usize = 9;
/// Number of words of a material: eight halves.
pub const MATERIAL_WORDS: usize = 4;
/// First word of a level's clumping, counted from the level's first; before it stand its shadows: offset, then shares.
pub const CLUMPING_AT: usize = 1 + HOTSPOT_DEG.len();
/// First word of a level's SGGX correction of fourth degree, counted from the level's first.
pub const FACETS_AT: usize = CLUMPING_AT + 6;
/// First word of a level's correction of light, counted from the level's first.
pub const LIGHT_CORRECTION_AT: usize = FACETS_AT + FACETS;
/// Number of words of a level.
pub const LEVEL_WORDS: usize = LIGHT_CORRECTION_AT + LIGHT_TERMS;

/// A volume ready for decoders.
#[derive(Debug, Clone, PartialEq)]
pub struct Voltex {
    words: Vec<u32>,
}

impl Voltex {
    /// Takes words that are laid out as [`Voltex::new`] does it.
    pub(super) fn from_words(words: Vec<u32>) -> Voltex {
        Voltex { words }
    }

    /// Returns the words, which a renderer copies to its buffer.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// Returns the side of a voxel of a level, in sides of the unit cube.
    pub fn voxel_side(&self, level: u32) -> f32 {
        (1u32 << level) as f32 / (1u32 << self.level_count()) as f32
    }

    /// Returns the binary logarithm of the number of the finest level's voxels a side. Twin: `voltex_level_count`.
    pub fn level_count(&self) -> u32 {
        self.words[LEVEL_COUNT_AT]
    }

    /// Returns whether rays that leave at one end in x, and in y, come in at the other. Twin: `voltex_cyclic`.
    pub fn cyclic(&self) -> [bool; 2] {
        [0, 1].map(|axis| self.words[FLAGS_AT] >> axis & 1 == 1)
    }

    /// Returns the used part of the unit cube. Twin: `voltex_extent`.
    pub fn extent(&self) -> [f32; 3] {
        std::array::from_fn(|axis| f32::from_bits(self.words[EXTENT_AT + axis]))
    }

    /// Returns the side of the unit cube in metres. Twin: `voltex_side_m`.
    pub fn side_m(&self) -> f32 {
        f32::from_bits(self.words[SIDE_AT])
    }

    /// Returns a node by its number. Twin: `voltex_node`.
    pub(super) fn node(&self, number: u32) -> Node {
        let at = self.words[NODES_AT] as usize + number as usize * NODE_WORDS;
        bytemuck::pod_read_unaligned(bytemuck::cast_slice(&self.words[at..at + NODE_WORDS]))
    }

    /// Returns a voxel by its number. Twin: `voltex_voxel`.
    pub fn voxel(&self, number: u32) -> Voxel {
        Voxel::at(&self.words, self.words[VOXELS_AT] as usize + number as usize * VOXEL_WORDS)
    }

    /// Returns the number of the voxel with the second sort of microflakes in the cell of another voxel, or
    /// [`NO_VOXEL`]. Twin: `voltex_other`.
    pub fn other(&self, number: u32) -> u32 {
        self.words[self.words[VOXELS_AT] as usize + number as usize * VOXEL_WORDS + OTHER_AT]
    }

    /// Returns the microflakes of a cell by its voxel's number, of one sort or of two; none for [`NO_VOXEL`].
    pub fn microflakes(&self, number: u32) -> impl Iterator<Item = (u32, Voxel)> {
        let is_there = |number: &u32| *number != NO_VOXEL;
        let numbers = std::iter::successors(Some(number).filter(is_there), move |number| {
            Some(self.other(*number)).filter(is_there)
        });
        numbers.map(|number| (number, self.voxel(number)))
    }

    /// Returns the optical depth per length of all microflakes of a cell along d, which need not be unit, before the
    /// level's clumping. Twin: `voltex_extinction_along`.
    pub fn extinction_along(&self, number: u32, d: [f32; 3]) -> f32 {
        self.microflakes(number).map(|(_, voxel)| voxel.extinction_along(d)).sum()
    }

    /// Replaces the microflakes of a voxel.
    pub fn set_voxel(&mut self, number: u32, voxel: &Voxel) {
        let at = self.words[VOXELS_AT] as usize + number as usize * VOXEL_WORDS;
        self.words[at..at + OTHER_AT].copy_from_slice(&voxel.words());
    }

    /// Returns the number of voxels of all levels, those of the second sort included.
    pub fn voxel_count(&self) -> usize {
        (self.words.len() - self.words[VOXELS_AT] as usize) / VOXEL_WORDS
    }

    /// Returns a material by its number. Twin: `voltex_material`.
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

    /// Returns the first word of a level.
    fn level_at(&self, level: u32) -> usize {
        self.words[LEVELS_AT] as usize + level as usize * LEVEL_WORDS
    }

    /// Returns the shadows of a level. Twin: `voltex_shadow`, which returns their first word.
    pub fn shadow(&self, level: u32) -> LevelShadow {
        let at = self.level_at(level);
        let number = |i: usize| f32::from_bits(self.words[at + i]);
        LevelShadow { offset: number(0), shared: std::array::from_fn(|i| number(1 + i)) }
    }

    /// Replaces the shadows of a level.
    pub fn set_shadow(&mut self, level: u32, shadow: &LevelShadow) {
        let at = self.level_at(level);
        self.words[at] = shadow.offset.to_bits();
        (0..HOTSPOT_DEG.len()).for_each(|i| self.words[at + 1 + i] = shadow.shared[i].to_bits());
    }

    /// Returns the clumping of a level.
    pub fn clumping(&self, level: u32) -> Sym3 {
        let at = self.level_at(level) + CLUMPING_AT;
        Sym3(std::array::from_fn(|i| f32::from_bits(self.words[at + i])))
    }

    /// Replaces the clumping of a level.
    pub fn set_clumping(&mut self, level: u32, clumping: &Sym3) {
        let at = self.level_at(level) + CLUMPING_AT;
        (0..6).for_each(|i| self.words[at + i] = clumping.0[i].to_bits());
    }

    /// Returns the factor on optical depths along d, of any length, for a level's clumping; a level beyond the coarsest
    /// has the coarsest's. Twin: `voltex_clumping_along`.
    pub fn clumping_along(&self, level: u32, d: [f32; 3]) -> f32 {
        let level = level.min(self.level_count());
        (self.clumping(level).form(d, d) / dot(d, d).max(1e-30)).exp()
    }

    /// Returns the SGGX correction of fourth degree of a level.
    pub fn facets(&self, level: u32) -> Facets {
        let at = self.level_at(level) + FACETS_AT;
        Facets(std::array::from_fn(|i| f32::from_bits(self.words[at + i])))
    }

    /// Replaces the SGGX correction of fourth degree of a level.
    pub fn set_facets(&mut self, level: u32, facets: &Facets) {
        let at = self.level_at(level) + FACETS_AT;
        (0..FACETS).for_each(|i| self.words[at + i] = facets.0[i].to_bits());
    }

    /// Returns the factor on the specular lobe of a level's microflakes for facets along `half`, of any length; a level
    /// beyond the coarsest has the coarsest's. Twin: `voltex_facets_along`.
    pub fn facets_along(&self, level: u32, half: [f32; 3]) -> f32 {
        self.facets(level.min(self.level_count())).denser(half)
    }

    /// Returns the correction of a level's light.
    pub fn light_correction(&self, level: u32) -> LightCorrection {
        let at = self.level_at(level) + LIGHT_CORRECTION_AT;
        LightCorrection(std::array::from_fn(|i| f32::from_bits(self.words[at + i])))
    }

    /// Returns the factor on the light that a level's microflakes send from `light` to `eye`, vectors towards them of
    /// any length; a level beyond the coarsest has the coarsest's. Twin: `voltex_brighter_between`.
    pub fn brighter_between(&self, level: u32, eye: [f32; 3], light: [f32; 3]) -> f32 {
        self.light_correction(level.min(self.level_count())).brighter(eye, light)
    }
}

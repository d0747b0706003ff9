//! A volume as it is built and stored: levels of voxels over the unit cube.

use super::facets::Facets;
use super::matrix::Sym3;
use super::voxel::Voxel;

/// Most voxels a side are 2 to this.
pub const MAX_LEVELS: u32 = 12;
/// Largest entry of a level's clumping.
pub const MAX_CLUMPING: f32 = 4.0;
/// Least share of gaps that eye and light see both ([`LevelShadow::shared`]).
pub const MIN_SHARED: f32 = -16.0;
/// Angles between light and eye, degrees, for which a level has its shadows' shares.
pub const HOTSPOT_DEG: [f32; 10] = [0.0, 2.0, 5.0, 10.0, 20.0, 40.0, 70.0, 110.0, 150.0, 180.0];

/// A volumetric texture.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Volume {
    /// UTF-8 JSON: name, source, how it was built.
    pub description: String,
    /// Metres that a side of the unit cube stands for.
    pub side_m: f32,
    /// How much of the unit cube is used, or repeated where [`Volume::cyclic`] says so.
    pub extent: [f32; 3],
    /// Whether what leaves at one end in x, and in y, comes in at the other.
    pub cyclic: [bool; 2],
    /// What microflakes are made of.
    pub materials: Vec<MicroflakeMaterial>,
    /// The finest first; the last has one voxel, the whole cube.
    pub levels: Vec<VolumeLevel>,
}

/// The voxels of a level that are not empty.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct VolumeLevel {
    /// How shadows fall within it.
    pub shadow: LevelShadow,
    /// How much microflakes stand behind each other, by direction: along a unit vector d of texture space depths are `exp(d' C d)` times
    /// those of microflakes that lie anywhere in their voxels. Entries of at most [`MAX_CLUMPING`] either way.
    pub clumping: Sym3,
    /// How their facets are spread, beyond what ellipsoids know.
    pub facets: Facets,
    /// Coordinates and voxel, in ascending order of [`order`]. The parent of each is in the next level, and each voxel of that
    /// has a child in this one.
    pub voxels: Vec<([u32; 3], Voxel)>,
    /// Microflakes of a second sort, which lie otherwise than those in `voxels` or are of another material, as bark among leaves: number in
    /// `voxels` of the one whose cell they share, ascending, and they themselves.
    pub others: Vec<(u32, Voxel)>,
}

/// What a level's shadows need, fitted to the model that the volume was built from.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LevelShadow {
    /// How far from the microflakes a ray to the light begins, voxels of the level.
    pub offset: f32,
    /// For each of [`HOTSPOT_DEG`] the share c by which eye and light see the same gaps: light is weakened by
    /// `exp(-(1 - c) depth)`. 1 where they see the same, 0 where gaps lie anywhere, less where eyes see what light does not
    /// reach: all of a plant in one voxel. [`MIN_SHARED`] to 1.
    pub shared: [f32; HOTSPOT_DEG.len()],
}

/// What microflakes are made of, linear sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MicroflakeMaterial {
    /// Share of light that leaves on the side where it came from.
    pub reflectance: [f32; 3],
    /// Share that leaves on the other.
    pub transmittance: [f32; 3],
    /// Reflectance of the smooth surface at normal incidence; 0 for none.
    pub specular: f32,
    /// Its roughness, GGX alpha.
    pub roughness: f32,
}

/// Morton number of a voxel: bit i of it is bit i / 3 of coordinate i % 3. Voxels of one parent follow each other.
pub fn order(at: [u32; 3]) -> u64 {
    (0..MAX_LEVELS).fold(0, |sum, bit| {
        (0..3).fold(sum, |sum, axis| sum | u64::from(at[axis] >> bit & 1) << (3 * bit as usize + axis))
    })
}

impl Volume {
    /// Binary logarithm of the finest level's voxels a side.
    pub fn level_count(&self) -> u32 {
        self.levels.len() as u32 - 1
    }
}

impl VolumeLevel {
    /// All microflakes, of both sorts.
    pub fn microflakes(&self) -> impl Iterator<Item = &Voxel> {
        self.voxels.iter().map(|(_, voxel)| voxel).chain(self.others.iter().map(|(_, voxel)| voxel))
    }
}

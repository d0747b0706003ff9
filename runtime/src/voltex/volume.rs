//! A volume as it is built and stored: levels of voxels over the unit cube.

use super::corrections::facets::Facets;
use super::corrections::light_correction::LightCorrection;
use super::matrix::Sym3;
use super::voxel::Voxel;

/// Largest binary logarithm of the number of voxels a side.
pub const MAX_LEVELS: u32 = 12;
/// Largest entry of a level's clumping.
pub const MAX_CLUMPING: f32 = 4.0;
/// Least share of gaps that eye and light have in common ([`LevelShadow::shared`]).
pub const MIN_SHARED: f32 = -16.0;
/// Angles between light and eye in degrees for which a level has shares of common gaps ([`LevelShadow::shared`]).
pub const HOTSPOT_DEG: [f32; 10] = [0.0, 2.0, 5.0, 10.0, 20.0, 40.0, 70.0, 110.0, 150.0, 180.0];

/// A volumetric texture: levels of voxels, the finest first.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Volume {
    /// Description as UTF-8 JSON: name, source, how it was built.
    pub description: String,
    /// Side of the unit cube in metres.
    pub side_m: f32,
    /// Used part of the unit cube; it repeats along the axes of [`Volume::cyclic`].
    pub extent: [f32; 3],
    /// Whether rays that leave at one end in x, and in y, come in at the other.
    pub cyclic: [bool; 2],
    /// Materials of the microflakes.
    pub materials: Vec<MicroflakeMaterial>,
    /// Levels, the finest first; the last has one voxel, the whole cube.
    pub levels: Vec<VolumeLevel>,
}

/// A level: the voxels that are not empty, and numbers for all of them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct VolumeLevel {
    /// Shadows within the level.
    pub shadow: LevelShadow,
    /// Clumping C of the microflakes, by direction: along a unit vector d of texture space optical depths are `exp(d' C
    /// d)` times those of microflakes that lie anywhere in their voxels. Entries are at most [`MAX_CLUMPING`] either
    /// way.
    pub clumping: Sym3,
    /// SGGX correction of fourth degree for the specular lobe.
    pub facets: Facets,
    /// Correction of the light by the directions of eye and light.
    pub light_correction: LightCorrection,
    /// Coordinates and voxel, in ascending order of [`order`]. The next level has the parent of each voxel, and each
    /// voxel of the next level has a child here.
    pub voxels: Vec<([u32; 3], Voxel)>,
    /// Second sorts of microflakes, with another orientation or material than those in `voxels`, such as bark among
    /// leaves: index in `voxels` of the voxel whose cell they share, ascending, and the microflakes.
    pub others: Vec<(u32, Voxel)>,
}

/// The shadows of a level, fitted to the model from which the volume was built.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LevelShadow {
    /// Distance from the microflakes at which a ray to the light begins, voxels of the level.
    pub offset: f32,
    /// Share c of gaps that eye and light have in common, for each of [`HOTSPOT_DEG`]: light is attenuated by `exp(-(1
    /// - c) depth)`. 1 where they see the same gaps, 0 where gaps lie anywhere, less where eyes see what light does not
    /// reach, as in a voxel that holds a whole plant. [`MIN_SHARED`] to 1.
    pub shared: [f32; HOTSPOT_DEG.len()],
}

/// A material of microflakes, linear sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MicroflakeMaterial {
    /// Share of the light that leaves on the side from which it came.
    pub reflectance: [f32; 3],
    /// Share of the light that leaves on the other side.
    pub transmittance: [f32; 3],
    /// Reflectance of the smooth surface at normal incidence; 0 for no specular lobe.
    pub specular: f32,
    /// Roughness of the smooth surface, GGX alpha.
    pub roughness: f32,
}

/// Returns the Morton number of a voxel: bit i of it is bit i / 3 of coordinate i % 3. Voxels of one parent follow each
/// other.
pub fn order(at: [u32; 3]) -> u64 {
    // A coordinate's bits spread to every third: halves of its bits are moved apart, then halves of these.
    let spread = |x: u32| {
        let x = u64::from(x);
        let x = (x | x << 16) & 0x0f00_00ff;
        let x = (x | x << 8) & 0x0f00_f00f;
        let x = (x | x << 4) & 0xc30c_30c3;
        (x | x << 2) & 0x2_4924_9249
    };
    spread(at[0]) | spread(at[1]) << 1 | spread(at[2]) << 2
}

impl Volume {
    /// Returns the binary logarithm of the number of the finest level's voxels a side.
    pub fn level_count(&self) -> u32 {
        self.levels.len() as u32 - 1
    }
}

impl VolumeLevel {
    /// Returns all microflakes, of both sorts.
    pub fn microflakes(&self) -> impl Iterator<Item = &Voxel> {
        self.voxels.iter().map(|(_, voxel)| voxel).chain(self.others.iter().map(|(_, voxel)| voxel))
    }
}

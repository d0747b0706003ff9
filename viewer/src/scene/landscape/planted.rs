//! What lawn, grove and forest have in common: the landscape before it is a scene, and the constants of its trees.

use super::counts::LandscapeCounts;
use super::terrain::Terrain;
use crate::sampler::hash;
use crate::scene::camera::Camera;
use crate::volume::skin::{DiscreteJitter, Pattern, Skin, Wind};
use glam::Vec3;

/// Branches and leaves of a tree: 2,154 and 6,336.
pub(super) const TREE_SHAPES: u64 = 2154 + 6336;
/// Jitter that shows every texel in one of eight ways, so that repetition is not seen.
pub(super) const TURNED: DiscreteJitter =
    DiscreteJitter { empty: 0.0, scale: [1.0; 2], displacement: 0.0, margin: 0.0, turns: true, mirrors: true };
/// Wind in which a tree would lean by 45 degrees: a storm leans it by some.
pub(super) const TREE_LEANING_M_PER_S: f32 = 35.0;
/// Amplitude of the swinging of twigs, texels.
pub(super) const TREE_FLUTTER: f32 = 0.03;

/// A plant of which there may be a model.
pub(super) struct Plant {
    /// Number of the first volume that holds the plant.
    pub volume: u32,
    /// Size of the plant in the volume, over that of its model.
    pub scale: f32,
    /// Foot of the plant, from the middle of the volume's floor, metres.
    pub foot_m: Vec3,
    /// Factors on the colours of the plant, in this volume and in the next ones.
    pub tints: &'static [[f32; 3]],
}

/// A landscape before it is a scene.
pub(super) struct Planted {
    /// The land.
    pub terrain: Terrain,
    /// The thick skin over the land, at rest.
    pub skin: Skin,
    /// Which volumes the texels of the skin show.
    pub patterns: Vec<Pattern>,
    /// Diffuse reflectance of the ground, linear sRGB.
    pub soil: [f32; 3],
    /// Cameras from afar, nearer and from close by.
    pub cameras: [Camera; 3],
    /// A wind of any speed over what grows there.
    pub wind: Wind,
    /// How much there is of what grows, but for what the scene adds.
    pub counts: LandscapeCounts,
}

/// Tells whether a patch is the chosen one of its pair: of two neighbours from west to east one is, by chance, so that
/// exactly half of the patches are where their number of columns is even.
pub(super) fn half_of_pairs([column, row]: [u32; 2], seed: u32) -> bool {
    let drawn = hash(hash(hash(seed) ^ (column / 2)) ^ row) >> 16 & 1;
    column & 1 == drawn
}

/// Returns a camera at `eye` that looks at `target`, upright.
pub(super) fn look(eye: Vec3, target: Vec3, fov_deg: f32) -> Camera {
    Camera { eye, target, up: Vec3::Y, fov_deg }
}

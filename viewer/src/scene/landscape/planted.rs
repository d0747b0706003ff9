//! What lawn, grove and forest have in common: the landscape before it is a scene, and the constants of its trees.

use super::counts::LandscapeCounts;
use super::terrain::{Terrain, smooth_step};
use crate::sampler::{hash, one};
use crate::scene::camera::Camera;
use crate::volume::skin::{DiscreteJitter, Pattern, Skin, Wind};
use glam::{Vec2, Vec3};

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

impl Plant {
    /// Returns the plant that fills a volume as its model is.
    pub const fn alone(volume: u32, tints: &'static [[f32; 3]]) -> Plant {
        Plant { volume, scale: 1.0, foot_m: Vec3::ZERO, tints }
    }
}

/// Volumes and models that a landscape grows of.
pub(super) struct Flora {
    /// What the volumes and models show, for messages.
    pub told: &'static str,
    /// Volumes that come with the program.
    pub built_in: &'static [&'static [u8]],
    /// Tints of each volume.
    pub tints: &'static [&'static [[f32; 3]]],
    /// Plants that there are models of, in the order of the models.
    pub plants: &'static [Plant],
}

/// Ground between the plants and beyond them.
pub(super) struct Soil {
    /// Diffuse reflectance, linear sRGB.
    pub reflectance: [f32; 3],
    /// Factors on it where the ground differs most.
    pub noise: [f32; 3],
    /// Size of the widest patches of one colour.
    pub unit_m: f32,
}

/// A landscape before it is a scene.
pub(super) struct Planted {
    /// The land.
    pub terrain: Terrain,
    /// The thick skin over the land, at rest.
    pub skin: Skin,
    /// Which volumes the texels of the skin show.
    pub patterns: Vec<Pattern>,
    /// What the ground is made of.
    pub soil: Soil,
    /// Cameras from afar, nearer and from close by.
    pub cameras: [Camera; 3],
    /// A wind of any speed over what grows there.
    pub wind: Wind,
    /// How much there is of what grows, but for what the scene adds.
    pub counts: LandscapeCounts,
}

/// Tells of each place whether something grows there: on the `count` places where what grows is densest, so that there is
/// exactly as much of it as asked for.
pub(super) fn densest(count: usize, densities: &[f32]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..densities.len()).collect();
    order.sort_by(|a, b| densities[*b].total_cmp(&densities[*a]).then(a.cmp(b)));
    let mut grows = vec![false; densities.len()];
    order.iter().take(count).for_each(|place| grows[*place] = true);
    grows
}

/// Returns a number of a place by chance, 0 to 1.
pub(super) fn chance([column, row]: [u32; 2], seed: u32) -> f32 {
    one(hash(hash(seed) ^ column) ^ row)
}

/// Returns how dense what grows is at a place, as far as it is the border that thins it: from 0 there to 1 at `width` and
/// further inside.
pub(super) fn inland(at: Vec2, size: Vec2, width: f32) -> f32 {
    smooth_step((0.5 * size - at.abs()).min_element() / width)
}

/// Returns a camera at `eye` that looks at `target`, upright.
pub(super) fn look(eye: Vec3, target: Vec3, fov_deg: f32) -> Camera {
    Camera { eye, target, up: Vec3::Y, fov_deg }
}

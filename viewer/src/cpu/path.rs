//! The path of a pixel's sample, and its random numbers. Twin: `path.wgsl`.

use crate::sampler;
use glam::Vec3;

/// Minimum probability with which Russian roulette keeps a path.
const MIN_KEPT: f32 = 0.05;

/// The constant that the shader has too.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] = &[("MIN_KEPT", MIN_KEPT)];

/// The purposes of random numbers. Twins: `AMBIENT_NUMBERS` and the like.
#[derive(Clone, Copy)]
pub(crate) enum Numbers {
    Ambient = 0,
    Scatter = 1,
    Choice = 2,
    Light = 3,
    Sun = 4,
    VolumeChoice = 5,
    VolumeScatter = 6,
    VolumeLight = 7,
    Texel = 8,
}

/// A vertex of the path through a pixel.
#[derive(Clone, Copy)]
pub(crate) struct PathVertex {
    pub pixel: [u32; 2],
    /// Rays up to the vertex.
    pub depth: u32,
}

/// Returns the seed of a vertex's random numbers for one purpose.
pub(crate) fn seed_of(PathVertex { pixel: [x, y], depth }: PathVertex, purpose: Numbers) -> u32 {
    let hashed = sampler::hash(depth.wrapping_add((purpose as u32) << 16));
    sampler::hash(x.wrapping_add(sampler::hash(y.wrapping_add(hashed))))
}

/// The path of a pixel's sample: its latest ray and what that counts for. Twin: `Path` in `scene.wgsl`.
pub(crate) struct Path {
    pub origin: Vec3,
    pub direction: Vec3,
    /// Factor by which radiance along the latest ray contributes to the pixel.
    pub throughput: Vec3,
    /// Whether the path left a surface in another way than by a mirror.
    pub scattered: bool,
    /// Density with which the latest ray was drawn, per steradian; 0 from eye and mirrors.
    pub density: f32,
    /// Length of all rays of the path.
    pub travelled: f32,
}

impl Path {
    /// Returns the path of a ray from the eye.
    pub(crate) fn from_eye(eye: Vec3, direction: Vec3) -> Path {
        Path { origin: eye, direction, throughput: Vec3::ONE, scattered: false, density: 0.0, travelled: 0.0 }
    }
}

/// Plays Russian roulette with the number `at` in [0, 1): dim paths end, the others carry the share of those. Returns
/// the throughput of a path that goes on.
pub(crate) fn roulette(throughput: Vec3, at: f32) -> Option<Vec3> {
    let kept = throughput.max_element().clamp(MIN_KEPT, 1.0);
    if at >= kept || throughput.max_element() <= 0.0 { None } else { Some(throughput / kept) }
}

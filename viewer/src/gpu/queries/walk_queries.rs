//! Walks a list of rays through a shell and its texels, on the GPU by the text that draws and on the CPU: for
//! comparison.

use crate::error::ViewerError;
use crate::gpu::arena::{Arena, ArenaAsset};
use crate::gpu::device::Gpu;
use crate::gpu::modules::walk_module;
use crate::gpu::queries::shader_queries::gpu_queries;
use crate::volume::skin::{CellWalk, Pattern, Shell, pattern_words};
use glam::Vec3;

/// A ray that enters a shell. Twin: `WalkQuery` in `walk_queries.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct WalkQuery {
    /// Origin of the ray, world units.
    pub origin: [f32; 3],
    /// The face by which the ray enters, 4 x the tetrahedron + its face.
    pub link: u32,
    /// Direction of the ray, not necessarily unit.
    pub direction: [f32; 3],
    /// Distance at which the ray begins.
    pub t_min: f32,
    /// Distance at which the ray ends.
    pub t_max: f32,
    /// Zero.
    pub pad0: u32,
    /// Zero.
    pub pad1: u32,
    /// Zero.
    pub pad2: u32,
}

/// Sums over what a ray met. Twin: `WalkSum`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct WalkSum {
    /// Integral of the place in the volumes over t, where texels have content.
    pub volume: [f32; 3],
    /// Sum of all intervals' lengths in t.
    pub length: f32,
    /// Length of the ray in texels.
    pub texels: f32,
    /// Integral over t of 1 + first volume + 8 x set of materials, where texels have content.
    pub chosen: f32,
    /// Intervals.
    pub intervals: u32,
    /// Texels with content.
    pub spans: u32,
    /// Integral over t of the width in texels of a cone that is one world unit wide.
    pub width: f32,
    /// Zero.
    pub pad0: u32,
    /// Zero.
    pub pad1: u32,
    /// Zero.
    pub pad2: u32,
}

/// The first words of shell and patterns, and the number of queries. Twin: `WalkPlace`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuWalkPlace {
    pub shell: u32,
    pub patterns: u32,
    pub count: u32,
    pub pad0: u32,
}

/// Walks `query` on the CPU. The pattern numbers of the shell's faces are indices into `patterns`.
pub fn cpu_walk(shell: &Shell, patterns: &[Pattern], query: &WalkQuery) -> WalkSum {
    let (origin, direction) = (Vec3::from(query.origin), Vec3::from(query.direction));
    let mut sum = WalkSum::default();
    let mut volume = Vec3::ZERO;
    for interval in shell.enter(origin, direction, query.link, query.t_min, query.t_max) {
        sum.intervals += 1;
        sum.length += interval.t1 - interval.t0;
        let map = shell.map(interval.tet);
        let ray = map.ray(origin, direction, interval.t0);
        sum.texels += ray.direction.length() * (interval.t1 - interval.t0);
        sum.width += map.width(direction, 1.0) * (interval.t1 - interval.t0);
        let pattern = &patterns[shell.tets()[interval.tet as usize].pattern as usize];
        for span in CellWalk::new(ray, interval.t0, interval.t1) {
            let Some(variant) = pattern.variant(span.cell) else { continue };
            sum.spans += 1;
            let along = span.t1 - span.t0;
            let content = variant.ray(ray);
            let middle = 0.5 * (span.t0 + span.t1) - interval.t0;
            volume += along * (content.point + middle * content.direction);
            let chosen = 1 + pattern.alternatives[variant.alternative as usize][0];
            sum.chosen += along * chosen as f32;
        }
    }
    WalkSum { volume: volume.to_array(), ..sum }
}

/// Walks `queries` on a GPU and returns the sums in their order.
///
/// # Errors
/// [`ViewerError::Gpu`] where the shell is larger than the adapter binds.
pub fn gpu_walk(
    gpu: &Gpu,
    shell: &Shell,
    patterns: &[Pattern],
    queries: &[WalkQuery],
) -> Result<Vec<WalkSum>, ViewerError> {
    let shell_words = shell.words().map_err(|reason| gpu.error(reason))?;
    let pattern_words = pattern_words(patterns);
    let arena = Arena::new(gpu, &[ArenaAsset::whole(&shell_words), ArenaAsset::whole(&pattern_words)], |_| 0)?;
    let place = GpuWalkPlace { shell: arena.bases[0], patterns: arena.bases[1], count: queries.len() as u32, pad0: 0 };
    gpu_queries(gpu, "walk", walk_module(arena.pieces.layout), &arena, &place, queries)
}

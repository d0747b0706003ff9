//! How fine the voxels of each brick have to be for what cameras see.

use crate::geometry::lod_transition::MESH_PIXELS;
use crate::volume::skin::{NO_VOLUME, Pattern};
use crate::volume::volumes::{Proxy, SceneSkin, Volumes};
use glam::{Mat3, Vec3};
use std::collections::HashMap;

/// Width of the voxels that only rays to lights and mirrored ones meet, since no camera sees them, over that of those
/// that cameras see as far away.
const UNSEEN: f32 = 4.0;

/// The volume of a picture that a camera sees.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BrickView {
    /// Eye, in world space.
    pub eye: Vec3,
    /// Unit vector into the picture.
    pub forward: Vec3,
    /// From the picture's middle to its right edge, at distance 1.
    pub right: Vec3,
    /// From the picture's middle to its top edge, at distance 1.
    pub up: Vec3,
    /// Width of a pixel at distance 1.
    pub pixel_width: f32,
    /// Width of the voxels that rays ask for at distance 1.
    pub voxel_width: f32,
}

impl BrickView {
    /// Tells whether a part of a ball is in the picture.
    fn sees(&self, centre: Vec3, radius: f32) -> bool {
        let way = centre - self.eye;
        let depth = way.dot(self.forward);
        let within = |edge: Vec3| {
            let half = edge.length();
            way.dot(edge / half).abs() <= depth * half + radius * (1.0 + half * half).sqrt()
        };
        depth >= -radius && within(self.right) && within(self.up)
    }

    /// Returns the width in the world that voxels in a ball should have, of a volume that stands in for leaves of a
    /// width, 0 for none.
    fn width_in(&self, centre: Vec3, radius: f32, leaf_width: f32) -> f32 {
        // Nearer there are meshes.
        let least = leaf_width / (MESH_PIXELS * self.pixel_width);
        let nearest = ((centre - self.eye).length() - radius).max(least).max(0.0);
        let unseen = if self.sees(centre, radius) { 1.0 } else { UNSEEN };
        unseen * nearest * self.voxel_width
    }
}

/// Returns the width of the voxels that the views need of each of `bricks`, in sides of the volume: 0 for the finest
/// that there are, infinity where none is seen. Cost: a few operations a brick of each place and a tetrahedron of each
/// skin, for each view.
pub(super) fn widths_needed(volumes: &Volumes, volume: usize, bricks: &[[u32; 3]], views: &[BrickView]) -> Vec<f32> {
    let mut widths = vec![f32::INFINITY; bricks.len()];
    for (number, instance) in volumes.proxies().instances().iter().enumerate() {
        if volumes.proxy(number) != Proxy::Box(volume) {
            continue;
        }
        let rows = instance.object_from_world.map(|[x, y, z, _]| Vec3::new(x, y, z));
        let world_from_volume = Mat3::from_cols(rows[0], rows[1], rows[2]).transpose().inverse();
        let scale = world_from_volume.determinant().abs().cbrt().recip();
        let radius = [world_from_volume.x_axis, world_from_volume.y_axis, world_from_volume.z_axis]
            .map(Vec3::length)
            .iter()
            .sum::<f32>()
            / 16.0;
        let origin = instance.object_from_world(Vec3::ZERO, 1.0);
        for (width, brick) in widths.iter_mut().zip(bricks) {
            let middle = (Vec3::from(brick.map(|x| x as f32)) + 0.5) / 8.0;
            let centre = world_from_volume * (middle - origin);
            for view in views {
                *width = width.min(scale * view.width_in(centre, radius, instance.leaf_width));
            }
        }
    }
    let of_skins = volumes.skins().iter().map(|skin| width_in_skin(skin, volume, views));
    let least = of_skins.fold(f32::INFINITY, f32::min);
    widths.iter_mut().for_each(|width| *width = width.min(least));
    widths
}

/// Returns the width that the views need of the voxels of a volume that a skin has in its texels, whichever its brick.
fn width_in_skin(skin: &SceneSkin, volume: usize, views: &[BrickView]) -> f32 {
    let has_it = |pattern: &Pattern| {
        let named = pattern.alternatives.as_flattened().iter();
        named.filter(|named| **named != NO_VOLUME).any(|named| *named as usize == volume)
    };
    // Content that is larger than its texel has larger voxels.
    let largest = |pattern: &Pattern| pattern.jitter.as_ref().map_or(1.0, |jitter| jitter.scale[1].max(1e-6));
    let scales: HashMap<u32, f32> =
        (0..).zip(&skin.patterns).filter(|(_, own)| has_it(own)).map(|(i, own)| (i, largest(own).recip())).collect();
    let shell = skin.shell();
    let mut least = f32::INFINITY;
    for (number, tet) in (0u32..).zip(shell.tets()) {
        let Some(content) = scales.get(&tet.pattern) else { continue };
        let [u, v, w] = shell.map(number).gradients;
        let scale = u.dot(v.cross(w)).abs().cbrt() * content;
        let corners = tet.positions.map(|i| shell.positions()[i as usize]);
        let centre = corners.iter().sum::<Vec3>() / 4.0;
        let radius = corners.iter().map(|corner| (*corner - centre).length()).fold(0.0, f32::max);
        if scale > 0.0 {
            for view in views {
                least = least.min(scale * view.width_in(centre, radius, skin.leaf_width));
            }
        }
    }
    least
}

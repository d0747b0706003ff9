//! Rays through one level of a volume.

use crate::model::microflakes::luminance;
use btf_runtime::voltex::{MicroflakeMaterial, NO_VOXEL, Segment, Voltex, VoltexRay, Walk, gloss, seen_at, shade};
use glam::Vec3;

/// Transmittance below which a ray ends.
const END: f32 = 1.0 / 255.0;
/// Optical depth beyond which light is gone.
const DARK: f32 = 14.0;
/// Length after which rays that begin beside or in the unit cube have left it.
const BEYOND: f32 = 4.0;

/// One cell on a ray from the eye.
pub(crate) struct Seen {
    /// Number of the cell's voxel.
    pub number: u32,
    /// Extinction of the microflakes along the ray.
    pub sigma: f32,
    /// Middle of the part of them that is seen.
    pub at: Vec3,
    /// Share of the ray that they hide.
    pub weight: f32,
}

impl Seen {
    /// Returns the sum of the microflakes' normals on the side of the light from `l`, whose length is their area
    /// towards `l`.
    pub fn towards(&self, voltex: &Voltex, l: Vec3) -> Vec3 {
        voltex.microflakes(self.number).map(|(_, voxel)| Vec3::from(voxel.moment.times(l.into()))).sum()
    }

    /// Returns the luminance that the microflakes send on evenly to `eye` from `light` (unit vectors towards them),
    /// before shadows and the level's correction of light.
    pub fn diffuse(&self, voltex: &Voltex, eye: Vec3, light: Vec3) -> f32 {
        let value = voltex.microflakes(self.number).map(|(_, voxel)| {
            let material = voltex.material(voxel.material);
            let [same, other] = shade(&voxel.moment, eye.into(), light.into());
            luminance(material.reflectance) * same + luminance(material.transmittance) * other
        });
        value.sum::<f32>() / self.sigma
    }

    /// Returns the light of the microflakes' specular lobes likewise.
    pub fn specular(&self, voltex: &Voltex, level: u32, eye: Vec3, light: Vec3) -> f32 {
        let lobes = voltex.microflakes(self.number).map(|(_, voxel)| {
            let MicroflakeMaterial { specular, roughness, .. } = voltex.material(voxel.material);
            match specular > 0.0 {
                true => gloss(&voxel.extinction, specular, roughness, eye.into(), light.into()),
                false => 0.0,
            }
        });
        let sum = lobes.sum::<f32>();
        if sum > 0.0 { sum * voltex.facets_along(level, (eye + light).into()) / self.sigma } else { 0.0 }
    }
}

/// Calls `each` for the voxels of `level` that are not empty, until it returns that it has enough.
fn filled(voltex: &Voltex, level: u32, origin: Vec3, direction: Vec3, mut each: impl FnMut(Segment) -> bool) {
    let ray = VoltexRay { origin: origin.into(), direction: direction.into() };
    let mut walk = Walk::new(ray, 0.0, BEYOND, voltex.level_count());
    while let Some(segment) = walk.next(voltex, level) {
        if segment.cell.voxel != NO_VOXEL && !each(segment) {
            return;
        }
    }
}

/// Calls `each` with the cells that an eye sees along a ray, front to back; returns the share of light that passes.
pub(crate) fn seen_along(
    voltex: &Voltex,
    level: u32,
    origin: Vec3,
    direction: Vec3,
    mut each: impl FnMut(&Seen),
) -> f32 {
    let mut through = 1.0;
    let clumping = voltex.clumping_along(level, direction.into());
    filled(voltex, level, origin, direction, |segment| {
        let sigma = voltex.extinction_along(segment.cell.voxel, direction.into());
        let length = segment.t1 - segment.t0;
        let depth = clumping * sigma * length;
        let alpha = 1.0 - (-depth).exp();
        if alpha > 0.0 {
            let at = origin + direction * (segment.t0 + seen_at(depth, length));
            each(&Seen { number: segment.cell.voxel, sigma, at, weight: through * alpha });
            through *= 1.0 - alpha;
        }
        through >= END
    });
    if through < END { 0.0 } else { through }
}

/// Returns the optical depth from a point on.
pub(crate) fn depth_along(voltex: &Voltex, level: u32, origin: Vec3, direction: Vec3) -> f32 {
    let clumping = voltex.clumping_along(level, direction.into());
    let mut depth = 0.0;
    filled(voltex, level, origin, direction, |segment| {
        let sigma = voltex.extinction_along(segment.cell.voxel, direction.into());
        depth += clumping * sigma * (segment.t1 - segment.t0);
        depth <= DARK
    });
    depth
}

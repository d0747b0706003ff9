//! Light of volumetric textures along a ray: one filtered ray, from level to level by what a pixel sees. Twin:
//! `shaders/volume_light.wgsl`.

use crate::volumes::{Stretch, Volumes};
use btf_runtime::voltex::{NO_VOXEL, Segment, Voltex, VoltexRay, Voxel, Walk, seen_at, shade};
use glam::{Mat3, Vec3};

/// Transmittance below which a ray ends.
const END: f32 = 1.0 / 255.0;
/// Transmittance below which a ray to a light does.
const DARK: f32 = 0.02;
/// Levels below the pixel's: voxels are half as wide as a pixel.
const BIAS: f32 = -1.0;
/// Share of a pixel that must be hidden before light is asked for anew.
const SHADOW_STEP: f32 = 1.0 / 16.0;
/// The constants that the shader has too, by name.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] =
    &[("VOLUME_END", END), ("VOLUME_DARK", DARK), ("VOLUME_BIAS", BIAS), ("VOLUME_SHADOW_STEP", SHADOW_STEP)];

/// What a ray sees at one place of a volume.
pub struct VolumePoint {
    /// Along the ray.
    pub t: f32,
    /// Share of the pixel that it is.
    pub weight: f32,
    volume: usize,
    map: Mat3,
    level: Level,
    parts: [(f32, Voxel); 2],
    sigma: f32,
    view: Vec3,
}

/// Which levels a pixel sees.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Level {
    finer: u32,
    /// Share of the next coarser one.
    part: f32,
}

impl Level {
    /// Where a pixel is `width` wide in the world.
    fn of(voltex: &Voltex, map: &Mat3, width: f32) -> Level {
        let scale = map.determinant().abs().cbrt();
        let voxels = width * scale * (1u32 << voltex.level_count()) as f32;
        let level = (voxels.clamp(1e-9, 1e9).log2() + BIAS).clamp(0.0, voltex.level_count() as f32);
        let finer = level.floor();
        Level { finer: finer as u32, part: level - finer }
    }
}

impl VolumePoint {
    /// Light that it reflects and transmits of what comes from `light` (a unit vector towards it) with irradiance pi, without
    /// shadow.
    pub fn reflected(&self, volumes: &Volumes, light: Vec3) -> Vec3 {
        let voltex = volumes.volume(self.volume);
        let l = self.map * light * self.map.determinant().abs().cbrt().recip();
        let mut sum = Vec3::ZERO;
        for (share, voxel) in &self.parts {
            if *share > 0.0 {
                let material = voltex.material(voxel.material);
                let [same, other] = shade(&voxel.moment, (-self.view).into(), l.into());
                sum += *share * (Vec3::from(material.reflectance) * same + Vec3::from(material.transmittance) * other);
            }
        }
        sum / self.sigma
    }

    /// From where a ray to a light begins, relative to the point, in the world.
    pub fn shadow_offset(&self, volumes: &Volumes, light: Vec3) -> Vec3 {
        let voltex = volumes.volume(self.volume);
        let l = self.map * light;
        let side = (1u32 << self.level.finer) as f32 / (1u32 << voltex.level_count()) as f32;
        let towards = self
            .parts
            .iter()
            .fold(Vec3::ZERO, |sum, (share, voxel)| sum + *share * Vec3::from(voxel.moment.times(l.into())));
        let inverse = self.map.inverse();
        inverse * (towards.normalize_or_zero() * (voltex.shadow(self.level.finer).offset * side))
    }

    /// The share c by which eye and light see the same gaps, where the angle between them has this cosine.
    pub fn shared(&self, volumes: &Volumes, cos: f32) -> f32 {
        let voltex = volumes.volume(self.volume);
        let at = |level: u32| voltex.shadow(level.min(voltex.level_count())).shared_at(cos);
        at(self.level.finer) + (at(self.level.finer + 1) - at(self.level.finer)) * self.level.part
    }
}

/// Extinction of a segment along the ray, and its two voxels with the share that each counts for.
fn parts_of(voltex: &Voltex, segment: &Segment, part: f32, d: [f32; 3]) -> (f32, [(f32, Voxel); 2]) {
    let one = |number: u32, share: f32| {
        if number == NO_VOXEL || share <= 0.0 {
            return (0.0, Voxel::default());
        }
        (share, voltex.voxel(number))
    };
    let parts = [one(segment.cell.voxel, 1.0 - part), one(segment.cell.parent, part)];
    let sigma = parts.iter().map(|(share, voxel)| share * voxel.extinction.form(d, d).max(0.0).sqrt()).sum();
    (sigma, parts)
}

/// The ray of a stretch, t counted from its own start.
fn walk_of(voltex: &Voltex, stretch: &Stretch) -> Walk {
    let VoltexRay { origin, direction } = stretch.ray;
    Walk::new(
        VoltexRay { origin, direction },
        stretch.t0 - stretch.start,
        stretch.t1 - stretch.start,
        voltex.level_count(),
    )
}

impl Volumes {
    /// Goes along a ray from the eye and calls `each` for the places that hide a share of the pixel together; returns what
    /// passes. `width_at` is a pixel's width at a distance.
    pub fn see(
        &self,
        origin: Vec3,
        direction: Vec3,
        t_max: f32,
        width_at: impl Fn(f32) -> f32,
        mut each: impl FnMut(VolumePoint),
    ) -> f32 {
        let mut through = 1.0;
        for stretch in self.stretches(origin, direction, t_max) {
            let voltex = self.volume(stretch.volume);
            let map = stretch.volume_from_world;
            let level = Level::of(voltex, &map, width_at(0.5 * (stretch.t0 + stretch.t1)));
            let d = stretch.ray.direction;
            let mut walk = walk_of(voltex, &stretch);
            while let Some(segment) = walk.next(voltex, level.finer) {
                let (sigma, parts) = parts_of(voltex, &segment, level.part, d);
                let length = segment.t1 - segment.t0;
                let depth = sigma * length;
                let hidden = 1.0 - (-depth).exp();
                if hidden <= 0.0 {
                    continue;
                }
                each(VolumePoint {
                    t: stretch.start + segment.t0 + seen_at(depth, length),
                    weight: through * hidden,
                    volume: stretch.volume,
                    map,
                    level,
                    parts,
                    sigma,
                    view: d.into(),
                });
                through *= 1.0 - hidden;
                if through < END {
                    return 0.0;
                }
            }
        }
        through
    }

    /// Optical depth along a ray, as far as it matters for a pixel `width` wide.
    pub fn depth(&self, origin: Vec3, direction: Vec3, t_max: f32, width: f32) -> f32 {
        let mut sum = 0.0;
        let dark = -DARK.ln();
        for stretch in self.stretches(origin, direction, t_max) {
            let voltex = self.volume(stretch.volume);
            let level = Level::of(voltex, &stretch.volume_from_world, width);
            let d = stretch.ray.direction;
            let mut walk = walk_of(voltex, &stretch);
            while let Some(segment) = walk.next(voltex, level.finer) {
                sum += parts_of(voltex, &segment, level.part, d).0 * (segment.t1 - segment.t0);
                if sum > 2.0 * dark {
                    return f32::INFINITY;
                }
            }
        }
        sum
    }
}

/// Whether light must be asked for anew, after so much was hidden since it last was.
pub(crate) fn asks_anew(hidden: f32) -> bool {
    hidden > SHADOW_STEP
}

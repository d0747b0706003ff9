//! What pixels show besides the light that was drawn by chance: without noise but for the places that they are seen at.

use crate::cpu::path::Path;
use crate::cpu::shader::{FAR, Shader};
use crate::geometry::bvh::NO_HIT;
use crate::options::ShadeOptions;
use crate::scene::scene::Scene;
use crate::volume::light::AROUND_ROUGHNESS;
use btf_runtime::LightRows;
use glam::Vec3;
use rayon::prelude::*;

/// Samples a pixel at most: with as many as the picture has, both cover the edges of things alike.
const MAX_SAMPLES: u32 = 16;

/// What a pixel shows, the mean of its samples.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Features {
    /// The share of light that is sent back to where it comes from, without shadow: an albedo that all materials and volumes
    /// have.
    pub albedo: Vec3,
    /// Normal of surfaces; 0 for volumes and where nothing is seen. Not unit where several are.
    pub normal: Vec3,
    /// One over the distance; 0 where nothing is seen.
    pub nearness: f32,
    /// Radiance that takes no chance: that of the sky behind everything, and of the air.
    pub own: Vec3,
}

/// Returns the features of all pixels, row by row from the top left, of a picture of so many samples. Cost: that of the eye's rays
/// of as many samples, 16 at most.
pub(crate) fn features_of(
    scene: &Scene,
    [width, height]: [u32; 2],
    options: &ShadeOptions,
    samples: u32,
) -> Vec<Features> {
    let count = samples.clamp(1, MAX_SAMPLES);
    let camera = scene.camera.frame(width, height);
    let row = |y: u32| {
        (0..width).map(move |x| {
            let mut sum = Features::default();
            for sample in 0..count {
                Shader::of_first_hit(scene, camera, *options, [x, y], sample).add_features([x, y], &mut sum);
            }
            let share = 1.0 / count as f32;
            Features {
                albedo: share * sum.albedo,
                normal: share * sum.normal,
                nearness: share * sum.nearness,
                own: share * sum.own,
            }
        })
    };
    (0..height).into_par_iter().flat_map_iter(row).collect()
}

impl Shader<'_> {
    /// Adds what the eye's ray through a pixel meets first.
    fn add_features(&self, [x, y]: [u32; 2], sum: &mut Features) {
        let path = Path::from_eye(self.camera.eye, self.camera.direction(x, y, self.jitter));
        let back = -path.direction;
        let haze = self.air_radiance(path.direction);
        let (hit, sunk) = self.trace_closest(path.origin, path.direction);
        let mut left = 1.0;
        if let Some(volumes) = &self.scene.volumes {
            let width_at = |t: f32| t * self.voxel_width();
            let t_max = if hit.primitive == NO_HIT { FAR } else { hit.t };
            left = volumes.march(path.origin, path.direction, t_max, &self.lod_transition, width_at, |point| {
                let passed = self.air_passed(&path, point.t);
                sum.albedo += point.weight * passed * point.reflected(volumes, back, AROUND_ROUGHNESS);
                sum.nearness += point.weight / point.t;
                sum.own += point.weight * (1.0 - passed) * haze;
            });
        }
        if hit.primitive == NO_HIT {
            sum.own += left * self.miss_radiance(&path);
            return;
        }
        let (s, _) = self.surface_of(&hit, sunk, path.direction);
        let material = &self.scene.materials[s.material];
        let level = self.level_of(&s, material, hit.t, self.sample);
        let leaf = self.viewed_leaf(&s, material, &hit, level);
        let viewed = self.viewed_body(&s, material, leaf.as_ref(), level, s.view_back);
        // Without the cosine of the light, which is that of the eye.
        let body = viewed.map_or(Vec3::ZERO, |body| body.body_light(&mut LightRows::default(), s.wo) / s.wo.z.abs());
        let passed = self.air_passed(&path, hit.t);
        sum.albedo += left * passed * (body + Vec3::from(material.mirror));
        sum.normal += left * if s.view_back { -s.normal } else { s.normal };
        sum.nearness += left / hit.t.max(f32::MIN_POSITIVE);
        sum.own += left * (1.0 - passed) * haze;
    }
}

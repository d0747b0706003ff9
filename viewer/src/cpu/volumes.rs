//! Volumetric textures on the CPU: what a ray sees in them, and what of a light passes them. Twin:
//! `shaders/volume_shade.wgsl`.

use crate::cpu::cpu::{FAR, MIN_LIGHT_DISTANCE2, Numbers, SPHERE_DENSITY, Shader, seed_of};
use crate::geometry::bvh::{AnyHit, NO_HIT};
use crate::gpu::tracer::PixelHit;
use crate::options::RenderMode;
use crate::sampler;
use crate::volume::light::{AROUND_ROUGHNESS, VolumePoint, asks_anew};
use crate::volume::volumes::Volumes;
use glam::Vec3;
use std::f32::consts::PI;

/// Rays along a pixel's side, for more of which voxels do not grow narrower: it was not measured for more.
const MAX_RAYS_ACROSS: f32 = 4.0;
/// The constant that the shader has too.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] = &[("MAX_RAYS_ACROSS", MAX_RAYS_ACROSS)];

/// What a ray sees in volumes.
pub(crate) struct SeenInVolumes {
    /// Light from them.
    pub radiance: Vec3,
    /// Share of what is behind them that passes.
    pub through: f32,
    /// One of the places that are seen, as likely as its share of the pixel.
    pub point: Option<VolumePoint>,
}

/// Places along a ray that hide a part of the pixel together. How much light passes to them is asked for at one, as likely as
/// what it hides: the first would be too bright where light comes from the eye's side and too dark where it comes from behind.
struct NearPoints {
    /// Share of the pixel that they hide.
    weight: f32,
    /// The one that is asked.
    drawn: Option<VolumePoint>,
    /// Their light without shadow, of each light and of the sun.
    unshadowed: Vec<Vec3>,
}

impl NearPoints {
    fn new(lights: usize) -> NearPoints {
        NearPoints { weight: 0.0, drawn: None, unshadowed: vec![Vec3::ZERO; lights] }
    }

    fn clear(&mut self) {
        (self.weight, self.drawn) = (0.0, None);
        self.unshadowed.fill(Vec3::ZERO);
    }
}

impl Shader<'_> {
    /// The scene's lights, then `sun` (towards it, and irradiance over pi): direction, distance and irradiance over pi at a
    /// place; none of a light that is too near, and of a sun that is not there.
    fn lights_at(&self, position: Vec3, sun: Option<(Vec3, Vec3)>) -> impl Iterator<Item = (Vec3, f32, Vec3)> {
        let lamps = self.scene.lights.iter().map(move |light| {
            let way = light.position - position;
            let distance2 = way.length_squared();
            if distance2 <= MIN_LIGHT_DISTANCE2 {
                return (Vec3::Z, 0.0, Vec3::ZERO);
            }
            let distance = distance2.sqrt();
            (way / distance, distance, Vec3::from(light.intensity) / (distance2 * PI))
        });
        let (towards, incident) = sun.unwrap_or((Vec3::Z, Vec3::ZERO));
        lamps.chain([(towards, FAR, incident)])
    }

    /// How wide voxels should be at distance 1 of the eye: as far as a pixel's rays are apart, of which it has had so many. Rays miss
    /// narrower ones, and wider ones blur (docs/results/voltex.md).
    pub(crate) fn ray_width(&self) -> f32 {
        self.camera.pixel_width() / ((self.sample + 1) as f32).sqrt().min(MAX_RAYS_ACROSS)
    }

    /// Share of light that passes the scene's volumes on the way from a surface.
    pub(crate) fn past_volumes(&self, origin: Vec3, direction: Vec3, distance: f32, width: f32) -> f32 {
        match &self.scene.volumes {
            Some(volumes) if distance > 0.0 => {
                (-volumes.depth(origin, direction, distance, &self.lod_transition, width)).exp()
            }
            _ => 1.0,
        }
    }

    /// What a ray sees in the scene's volumes up to `t_max`, `travelled` from the eye.
    pub(crate) fn seen_in_volumes(
        &self,
        volumes: &Volumes,
        origin: Vec3,
        direction: Vec3,
        t_max: f32,
        travelled: f32,
        pixel: [u32; 2],
        depth: u32,
        done: &mut PixelHit,
    ) -> SeenInVolumes {
        let scene = self.scene;
        let ray_width = self.ray_width();
        let [sun_at, sky_at] =
            [Numbers::Sun, Numbers::Ambient].map(|numbers| sampler::two(self.sample, seed_of(pixel, depth, numbers)));
        let seed = sampler::hash(seed_of(pixel, depth, Numbers::VolumeLight).wrapping_add(self.sample));
        let sun = scene.sun.as_ref().map(|sun| (sun.sun_sample(sun_at), Vec3::from(sun.irradiance) / PI));
        let mut radiance = Vec3::ZERO;
        let mut near = NearPoints::new(scene.lights.len() + 1);
        let (mut total, mut chosen, mut draws) = (0.0, None, 0u32);
        // Whether a point that counts `weight` of `sum` is the one that is drawn.
        let mut is_drawn = |weight: f32, sum: f32| {
            draws += 1;
            sampler::one(seed.wrapping_add(draws)) * sum < weight
        };
        // Light of the points that were gathered, through what one of them is shadowed by.
        let lit = |near: &mut NearPoints, done: &mut PixelHit| {
            let mut sum = Vec3::ZERO;
            if let Some(point) = near.drawn.take() {
                let position = origin + direction * point.t;
                let width = (travelled + point.t) * ray_width;
                for ((towards, distance, _), unshadowed) in self.lights_at(position, sun).zip(&near.unshadowed) {
                    if unshadowed.max_element() > 0.0 {
                        done.rays += 1;
                        sum += *unshadowed
                            * self.light_passed(volumes, &point, position, -direction, towards, distance, width);
                    }
                }
            }
            near.clear();
            sum
        };
        let through = volumes.see(
            origin,
            direction,
            t_max,
            &self.lod_transition,
            |t| (travelled + t) * ray_width,
            |point| {
                if asks_anew(near.weight) {
                    radiance += lit(&mut near, done);
                }
                let position = origin + direction * point.t;
                for ((towards, _, incident), unshadowed) in self.lights_at(position, sun).zip(&mut near.unshadowed) {
                    if incident.max_element() > 0.0 {
                        *unshadowed += point.weight * incident * point.reflected(volumes, towards, 0.0);
                    }
                }
                near.weight += point.weight;
                if is_drawn(point.weight, near.weight) {
                    near.drawn = Some(point);
                }
                // One place for everything that takes a ray of its own.
                total += point.weight;
                if is_drawn(point.weight, total) {
                    chosen = Some(point);
                }
            },
        );
        radiance += lit(&mut near, done);
        if let Some(point) = &chosen {
            let path = self.options.mode == RenderMode::Path;
            let position = origin + direction * point.t;
            let width = (travelled + point.t) * ray_width;
            let around = match &scene.environment {
                Some(sky) => {
                    let towards = sky.sample(sky_at);
                    let density = sky.density(towards) + if path { SPHERE_DENSITY } else { 0.0 };
                    let distance = if path { FAR } else { scene.ambient.distance };
                    (density > 0.0).then(|| (towards, sky.radiance(towards) / (PI * density), distance))
                }
                None if path => None,
                None => {
                    let incident = Vec3::from(scene.ambient.radiance) / (PI * SPHERE_DENSITY);
                    Some((sampler::sphere(sky_at), incident, scene.ambient.distance))
                }
            };
            if let Some((towards, incident, distance)) = around.filter(|(_, incident, _)| incident.max_element() > 0.0)
            {
                done.rays += 1;
                let passed = self.light_passed(volumes, point, position, -direction, towards, distance, width);
                radiance += total * passed * incident * point.reflected(volumes, towards, AROUND_ROUGHNESS);
            }
        }
        SeenInVolumes { radiance, through, point: chosen }
    }

    /// Share of light from a direction that reaches a place within a volume and is seen from another.
    fn light_passed(
        &self,
        volumes: &Volumes,
        point: &VolumePoint,
        position: Vec3,
        to_eye: Vec3,
        towards: Vec3,
        distance: f32,
        width: f32,
    ) -> f32 {
        let origin = position + point.shadow_offset(volumes, towards);
        if self.trace(origin, towards, distance, AnyHit::Yes).primitive != NO_HIT {
            return 0.0;
        }
        let shared = point.shared(volumes, to_eye.dot(towards));
        (-(1.0 - shared) * volumes.depth(origin, towards, distance, &self.lod_transition, width)).exp()
    }
}

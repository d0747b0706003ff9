//! Volumetric textures on the CPU: what a ray sees in them, and what of a light passes them. Twin:
//! `shaders/volume_shade.wgsl`.

use crate::bvh::{AnyHit, NO_HIT};
use crate::cpu::{FAR, LEAST_LIGHT_DISTANCE2, Numbers, SPHERE_DENSITY, Shader, seed_of};
use crate::options::RenderMode;
use crate::sampler;
use crate::trace::PixelHit;
use crate::volume_light::{VolumePoint, asks_anew};
use crate::volumes::Volumes;
use glam::Vec3;
use std::f32::consts::PI;

/// What a ray sees in volumes.
pub(crate) struct SeenInVolumes {
    /// Light from them.
    pub radiance: Vec3,
    /// Share of what is behind them that passes.
    pub through: f32,
    /// One of the places that are seen, as likely as its share of the pixel.
    pub point: Option<VolumePoint>,
}

impl Shader<'_> {
    /// Share of light that passes the scene's volumes on the way from a surface.
    pub(crate) fn past_volumes(&self, origin: Vec3, direction: Vec3, distance: f32, width: f32) -> f32 {
        match &self.scene.volumes {
            Some(volumes) if distance > 0.0 => (-volumes.depth(origin, direction, distance, width)).exp(),
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
        let pixel_width = self.camera.pixel_width();
        let [sun_at, sky_at] =
            [Numbers::Sun, Numbers::Ambient].map(|numbers| sampler::two(self.sample, seed_of(pixel, depth, numbers)));
        let seed = sampler::hash(seed_of(pixel, depth, Numbers::VolumeLight).wrapping_add(self.sample));
        let sun = scene.sun.as_ref().map(|sun| (sun.sun_sample(sun_at), Vec3::from(sun.irradiance) / PI));
        // What passes to the sun and each light, asked for anew now and then.
        let mut passed = vec![0.0f32; scene.lights.len() + 1];
        let mut hidden = f32::INFINITY;
        let mut radiance = Vec3::ZERO;
        let (mut total, mut chosen, mut draws) = (0.0, None, 0u32);
        let through = volumes.see(
            origin,
            direction,
            t_max,
            |t| (travelled + t) * pixel_width,
            |point| {
                let position = origin + direction * point.t;
                let width = (travelled + point.t) * pixel_width;
                let anew = asks_anew(hidden);
                hidden = if anew { point.weight } else { hidden + point.weight };
                let mut add = |passed: &mut f32, towards: Vec3, distance: f32, incident: Vec3| {
                    if anew {
                        done.rays += 1;
                        *passed = self.light_passed(volumes, &point, position, -direction, towards, distance, width);
                    }
                    if *passed > 0.0 {
                        radiance += point.weight * *passed * incident * point.reflected(volumes, towards);
                    }
                };
                for (light, passed) in scene.lights.iter().zip(&mut passed) {
                    let way = light.position - position;
                    let distance2 = way.length_squared();
                    if distance2 > LEAST_LIGHT_DISTANCE2 {
                        let distance = distance2.sqrt();
                        add(passed, way / distance, distance, Vec3::from(light.intensity) / (distance2 * PI));
                    }
                }
                if let Some((towards, incident)) = sun {
                    add(&mut passed[scene.lights.len()], towards, FAR, incident);
                }
                // One place for everything that takes a ray of its own.
                total += point.weight;
                draws += 1;
                if sampler::one(seed.wrapping_add(draws)) * total < point.weight {
                    chosen = Some(point);
                }
            },
        );
        if let Some(point) = &chosen {
            let path = self.options.mode == RenderMode::Path;
            let position = origin + direction * point.t;
            let width = (travelled + point.t) * pixel_width;
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
                radiance += total * passed * incident * point.reflected(volumes, towards);
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
        (-(1.0 - shared) * volumes.depth(origin, towards, distance, width)).exp()
    }
}

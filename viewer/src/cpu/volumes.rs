//! Volumetric textures on the CPU: the light that a ray meets in them, and what of a light passes them. Twin:
//! `volumes.wgsl`.

use crate::cpu::direct_light::roulette_seed;
use crate::cpu::path::{Numbers, Path, PathVertex, roulette};
use crate::cpu::shader::{FAR, MIN_LIGHT_DISTANCE2, Shader};
use crate::geometry::bvh::{AnyHit, NO_HIT};
use crate::light::irradiance_volume::radiance_from;
use crate::options::RenderMode;
use crate::picture::PixelHit;
use crate::sampler;
use crate::volume::light::{AROUND_ROUGHNESS, LightRay, VolumePoint, asks_anew};
use crate::volume::volumes::Volumes;
use glam::{Vec3, Vec4};
use std::f32::consts::{PI, TAU};

/// Density of directions that are drawn over the whole sphere, per steradian.
const SPHERE_DENSITY: f32 = 0.25 / PI;
/// Directions of what surrounds the scene from which one is drawn. 4 halve the variance of a lawn's picture for 4 % of its time; 8 and 16
/// gain little more. Twin: `SKY_CANDIDATES`.
pub(crate) const SKY_CANDIDATES: u32 = 4;
/// Steps from one of them to the next, in turns: a lattice over the table of the sky.
const SKY_STEPS: [f32; 2] = [1.0 / SKY_CANDIDATES as f32, 0.618_034];
/// Sets apart the number by which the axes of light after one bounce are turned. Twin: `BOUNCE_TURN`.
pub(crate) const BOUNCE_TURN: u32 = 0x7feb_352d;
/// The constants that the shader has too, by name.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] =
    &[("SPHERE_DENSITY", SPHERE_DENSITY), ("SKY_STEP_X", SKY_STEPS[0]), ("SKY_STEP_Y", SKY_STEPS[1])];

/// The light that a ray meets in volumes.
struct VolumeRadiance {
    /// Light from them.
    radiance: Vec3,
    /// Share of what is behind them that passes.
    transmittance: f32,
    /// One of the places that are met, as likely as its share of the pixel.
    point: Option<VolumePoint>,
}

/// The fate of a path's latest ray in volumes.
pub(crate) enum AfterVolumes {
    /// The ray goes on to what it hit.
    Passed,
    /// The path goes on from a place within.
    Scattered,
    /// The path ends.
    Ended,
}

/// Places along a ray that hide a part of the pixel together.
struct NearPoints {
    /// Seed of the numbers that places and rays to lights draw.
    seed: u32,
    /// Numbers that the places have drawn.
    draws: u32,
    /// Share of the pixel that the places hide together, 0 to 1.
    weight: f32,
    points: Vec<VolumePoint>,
    /// An entry for each light and one for the sun; none before the ray meets a place.
    lit: Vec<NearLight>,
}

/// What places along a ray reflect and transmit of one light. How much of it passes to them is asked for at one, as likely as what it
/// adds without shadow, so that the mean is as bright as all of them [Talbot 2005]: the first would be too bright where light comes from
/// the eye's side and too dark where it comes from behind.
#[derive(Clone, Copy, Default)]
struct NearLight {
    /// Light of all places without shadow.
    unshadowed: Vec3,
    /// Number of the place at which shadow is asked for.
    drawn: u32,
}

/// Light from one direction as a volume meets it.
#[derive(Clone, Copy)]
struct VolumeSource {
    towards: Vec3,
    distance: f32,
    /// Irradiance over pi; 0 for none.
    incident: Vec3,
}

/// A place within a volume that a ray along `direction` meets.
struct MetPoint<'a> {
    volumes: &'a Volumes,
    point: &'a VolumePoint,
    direction: Vec3,
    position: Vec3,
    /// Width of voxels for shadow rays.
    width: f32,
}

/// Returns three directions at right angles, turned at random by numbers in [0, 1).
fn turned_axes([x, y]: [f32; 2], turn: f32) -> [Vec3; 3] {
    let first = sampler::sphere([x, y]);
    let (sin, cos) = (TAU * y).sin_cos();
    let level = Vec3::new(-sin, cos, 0.0);
    let upright = first.cross(level);
    let (sin, cos) = (TAU * turn).sin_cos();
    [first, cos * level + sin * upright, cos * upright - sin * level]
}

/// Returns the light that a place reflects and transmits of what comes after one bounce: from six directions, to and fro along three
/// axes, each for a sixth of the sphere.
fn reflected_bounce(volumes: &Volumes, point: &VolumePoint, light: &[Vec4; 3], axes: [Vec3; 3]) -> Vec3 {
    let of = |towards: Vec3| radiance_from(light, towards) * point.reflected(volumes, towards, AROUND_ROUGHNESS);
    let sum: Vec3 = axes.into_iter().map(|axis| of(axis) + of(-axis)).sum();
    // 4 pi of the sphere, over pi.
    sum * (4.0 / 6.0)
}

impl Shader<'_> {
    /// Returns the share of light that passes the scene's volumes on the way from a surface, in the mean over `chance`.
    pub(crate) fn past_volumes(&self, ray: &LightRay, chance: f32) -> f32 {
        match &self.scene.volumes {
            Some(volumes) if ray.t_max > 0.0 => volumes.light_share(ray, &self.lod_transition, 1.0, chance),
            _ => 1.0,
        }
    }

    /// Returns the light that a path's ray meets in the scene's volumes up to `t_max`.
    fn trace_volumes(
        &self,
        volumes: &Volumes,
        path: &Path,
        t_max: f32,
        vertex: PathVertex,
        done: &mut PixelHit,
    ) -> VolumeRadiance {
        let voxel_width = self.voxel_width();
        let [sun_at, sky_at] = [Numbers::Sun, Numbers::Ambient].map(|numbers| self.two_numbers(vertex, numbers));
        let seed = self.light_seed(vertex, Numbers::VolumeLight);
        let sun = self.scene.sun.as_ref();
        let sun = sun.map_or(VolumeSource { towards: Vec3::Z, distance: FAR, incident: Vec3::ZERO }, |sun| {
            VolumeSource { towards: sun.sun_sample(sun_at), distance: FAR, incident: Vec3::from(sun.irradiance) / PI }
        });
        let mut radiance = Vec3::ZERO;
        let mut near = NearPoints { seed, draws: 0, weight: 0.0, points: Vec::new(), lit: Vec::new() };
        let (mut total, mut chosen) = (0.0, None);
        // What the air before the places hides of them.
        let mut hazed = Vec3::ZERO;
        let transmittance = volumes.march(
            path.origin,
            path.direction,
            t_max,
            &self.lod_transition,
            |t| (path.travelled + t) * voxel_width,
            |point| {
                if asks_anew(near.weight) {
                    radiance += self.shadowed_light(volumes, path, sun, &mut near, done);
                }
                let position = path.origin + path.direction * point.t;
                let passed = self.air_passed(path, point.t);
                hazed += point.weight * (1.0 - passed);
                let first_draw = near.draws;
                // Whether a place that counts `weight` of `sum` is the one that is drawn.
                let is_drawn = |draw: u32, weight: f32, sum: f32| {
                    sampler::one(seed.wrapping_add(first_draw).wrapping_add(draw)) * sum < weight
                };
                near.lit.resize(self.scene.lights.len() + 1, NearLight::default());
                for (light, lit) in self.lights_at(position, sun).zip(&mut near.lit) {
                    if light.incident.max_element() > 0.0 {
                        let own = passed * point.weight * light.incident * point.reflected(volumes, light.towards, 0.0);
                        lit.unshadowed += own;
                        if is_drawn(1, own.element_sum(), lit.unshadowed.element_sum()) {
                            lit.drawn = near.points.len() as u32;
                        }
                    }
                }
                near.weight += point.weight;
                near.points.push(point);
                // One place for everything that takes a ray of its own.
                total += point.weight;
                if is_drawn(2, point.weight, total) {
                    chosen = Some(point);
                }
                near.draws += 2;
            },
        );
        radiance += self.shadowed_light(volumes, path, sun, &mut near, done);
        if let Some(point) = &chosen
            && let Some((light, reflected)) = self.draw_surroundings(volumes, point, sky_at, seed)
        {
            done.rays += 1;
            let chance = sampler::one(roulette_seed(seed, self.scene.lights.len() + 1));
            let passed = self.light_passed(&self.met_point(volumes, path, point), &light, chance);
            radiance += total * self.air_passed(path, point.t) * passed * reflected;
        }
        if let (Some(point), Some(cached)) = (&chosen, self.irradiance_volume) {
            let light = cached.at(path.origin + path.direction * point.t);
            let axes = turned_axes(sky_at, sampler::one(seed ^ BOUNCE_TURN));
            radiance += total * self.air_passed(path, point.t) * reflected_bounce(volumes, point, &light, axes);
        }
        if hazed != Vec3::ZERO {
            radiance += hazed * self.air_radiance(path.direction);
        }
        VolumeRadiance { radiance, transmittance, point: chosen }
    }

    /// Returns the light of the points that were gathered, of each light through what one of them is shadowed by, and
    /// forgets the points.
    fn shadowed_light(
        &self,
        volumes: &Volumes,
        path: &Path,
        sun: VolumeSource,
        near: &mut NearPoints,
        done: &mut PixelHit,
    ) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for (number, lit) in near.lit.iter_mut().enumerate() {
            let NearLight { unshadowed, drawn } = std::mem::take(lit);
            if unshadowed.max_element() > 0.0 {
                done.rays += 1;
                let met = self.met_point(volumes, path, &near.points[drawn as usize]);
                // Of all sources the sun is the first.
                let source = (number + 1) % (self.scene.lights.len() + 1);
                let chance = sampler::one(roulette_seed(near.seed.wrapping_add(near.draws), source));
                sum += unshadowed * self.light_passed(&met, &self.light_at(number, met.position, sun), chance);
            }
        }
        near.points.clear();
        near.weight = 0.0;
        sum
    }

    fn met_point<'a>(&self, volumes: &'a Volumes, path: &Path, point: &'a VolumePoint) -> MetPoint<'a> {
        let position = path.origin + path.direction * point.t;
        let width = (path.travelled + point.t) * self.voxel_width();
        MetPoint { volumes, point, direction: path.direction, position, width }
    }

    /// Returns the share of a light that reaches a place within a volume and is seen from where the path's ray begins, in the mean over
    /// `chance`.
    fn light_passed(&self, met: &MetPoint, light: &VolumeSource, chance: f32) -> f32 {
        let MetPoint { volumes, point, direction, position, width } = *met;
        let origin = position + point.shadow_offset(volumes, light.towards);
        if self.trace(origin, light.towards, light.distance, AnyHit::Yes).primitive != NO_HIT {
            return 0.0;
        }
        let shared = point.shared(volumes, (-direction).dot(light.towards));
        let ray = LightRay { origin, direction: light.towards, t_max: light.distance, width };
        volumes.light_share(&ray, &self.lod_transition, 1.0 - shared, chance)
    }

    /// Iterates over the scene's lights as a place meets them, then over `sun`; a light that is too near gives none.
    fn lights_at(&self, position: Vec3, sun: VolumeSource) -> impl Iterator<Item = VolumeSource> {
        (0..=self.scene.lights.len()).map(move |number| self.light_at(number, position, sun))
    }

    /// Returns a light of the scene as a place meets it, or the sun behind the last one.
    fn light_at(&self, number: usize, position: Vec3, sun: VolumeSource) -> VolumeSource {
        let Some(light) = self.scene.lights.get(number) else { return sun };
        let way = light.position - position;
        let distance2 = way.length_squared();
        if distance2 <= MIN_LIGHT_DISTANCE2 {
            return VolumeSource { towards: Vec3::Z, distance: 0.0, incident: Vec3::ZERO };
        }
        let distance = distance2.sqrt();
        let incident = Vec3::from(light.intensity) / (distance2 * PI);
        VolumeSource { towards: way / distance, distance, incident }
    }

    /// Returns the light of what surrounds the scene, from the direction that the numbers `at` draw; `None` where a
    /// path meets that by itself.
    fn surroundings(&self, at: [f32; 2]) -> Option<VolumeSource> {
        let path = self.options.mode == RenderMode::Path;
        let distance = if path { FAR } else { self.scene.ambient.distance };
        match &self.scene.environment {
            Some(sky) => {
                let towards = sky.sample(at);
                let density = sky.density(towards) + if path { SPHERE_DENSITY } else { 0.0 };
                let incident = || sky.radiance(towards) / (PI * density);
                (density > 0.0).then(|| VolumeSource { towards, distance, incident: incident() })
            }
            None if path => None,
            None => {
                let incident = Vec3::from(self.scene.ambient.radiance) / (PI * SPHERE_DENSITY);
                Some(VolumeSource { towards: sampler::sphere(at), distance, incident })
            }
        }
    }

    /// Draws a direction of what surrounds the scene: of some candidates one, as likely as what it adds without shadow, so that the mean
    /// is that of all directions [Talbot 2005]. Returns it, and the light that the point reflects and transmits of it; `None` where
    /// there is nothing.
    fn draw_surroundings(
        &self,
        volumes: &Volumes,
        point: &VolumePoint,
        at: [f32; 2],
        seed: u32,
    ) -> Option<(VolumeSource, Vec3)> {
        let (mut sum, mut kept) = (0.0, None);
        for k in 0..SKY_CANDIDATES {
            let own: [f32; 2] = std::array::from_fn(|axis| (at[axis] + k as f32 * SKY_STEPS[axis]).fract());
            let Some(light) = self.surroundings(own).filter(|light| light.incident.max_element() > 0.0) else {
                continue;
            };
            let reflected = light.incident * point.reflected(volumes, light.towards, AROUND_ROUGHNESS);
            let weight = reflected.element_sum();
            sum += weight;
            // Places draw numbers above the seed.
            if sampler::one(seed.wrapping_sub(k)) * sum < weight {
                kept = Some((light, reflected / weight));
            }
        }
        kept.map(|(light, reflected)| (light, reflected * (sum / SKY_CANDIDATES as f32)))
    }

    /// Adds the light that a path's ray meets in volumes before `t_max`, and lets the path pass them, scatter or end.
    pub(crate) fn pass_volumes(
        &self,
        volumes: &Volumes,
        path: &mut Path,
        t_max: f32,
        vertex: PathVertex,
        radiance: &mut Vec3,
        done: &mut PixelHit,
    ) -> AfterVolumes {
        let met = self.trace_volumes(volumes, path, t_max, vertex, done);
        *radiance += path.throughput * met.radiance;
        if self.options.mode != RenderMode::Path {
            path.throughput *= met.transmittance;
            return if met.transmittance <= 0.0 { AfterVolumes::Ended } else { AfterVolumes::Passed };
        }
        let [choice, kept_at] = self.two_numbers(vertex, Numbers::VolumeChoice);
        if choice < met.transmittance {
            return AfterVolumes::Passed;
        }
        let Some(point) = met.point else { return AfterVolumes::Ended };
        let next = sampler::sphere(self.two_numbers(vertex, Numbers::VolumeScatter));
        let passed = self.air_passed(path, point.t);
        let throughput = path.throughput * passed * (4.0 * point.reflected(volumes, next, AROUND_ROUGHNESS));
        let Some(throughput) = roulette(throughput, kept_at) else { return AfterVolumes::Ended };
        path.throughput = throughput;
        (path.scattered, path.density) = (true, SPHERE_DENSITY);
        path.travelled += point.t;
        path.origin += path.direction * point.t + point.shadow_offset(volumes, next);
        path.direction = next;
        AfterVolumes::Scattered
    }
}

//! The reference renderer: the CPU decoder and BVH, the same formulas as the shaders. Twin: `shaders/shade.wgsl`.

use crate::geometry::bvh::{AnyHit, Hit, NO_HIT};
use crate::geometry::lod_transition::LodTransition;
use crate::geometry::surface::{MIN_EYE_COS, Surface};
use crate::options::{RenderMode, ShadeOptions, SkyLight};
use crate::picture::PixelHit;
use crate::sampler;
use crate::scene::camera::{CameraFrame, jitter};
use crate::scene::material::{Body, Material};
use crate::scene::scene::Scene;
use crate::shading::relief::Relief;
use crate::shading::viewed_body::ViewedBody;
use crate::volume::light::AROUND_ROUGHNESS;
use btf_models::DiffuseColour;
use btf_runtime::{LightRows, ViewedLeaf, ViewedTexel};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::PI;

/// Distance to which rays reach. Twin: `TRACE_FAR`.
pub(crate) const FAR: f32 = 1e30;
/// A light nearer than this (squared) to the surface is left out.
pub(crate) const MIN_LIGHT_DISTANCE2: f32 = 1e-12;
/// Rays whose radiance counts for less than this in the pixel are not followed.
const MIN_THROUGHPUT: f32 = 1e-3;

/// Sets apart the numbers of a light's seed.
const ENVIRONMENT_CHOICE: u32 = 0x68bc_21eb;
const LOBE_CHOICE: u32 = 0x02e5_be93;
const LEVEL_CHOICE: u32 = 0x967a_889b;
const SIDE_CHOICE: u32 = 0x1b87_3593;
/// Lights that are looked at for each that is drawn.
pub(crate) const LIGHT_CANDIDATES: usize = 8;
/// Shells that a ray may pass.
const SHELL_TRIES: usize = 8;
/// Density of directions that are drawn over the whole sphere, per steradian.
pub(crate) const SPHERE_DENSITY: f32 = 0.25 / PI;
/// Least chance of a path to go on.
const MIN_KEPT: f32 = 0.05;

/// The constants that the shader has too, by name.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] = &[
    ("TRACE_FAR", FAR),
    ("TRACE_PI", PI),
    ("MIN_LIGHT_DISTANCE2", MIN_LIGHT_DISTANCE2),
    ("MIN_THROUGHPUT", MIN_THROUGHPUT),
    ("MIN_KEPT", MIN_KEPT),
    ("SPHERE_DENSITY", SPHERE_DENSITY),
];

/// A picture in the making: the sum of its samples.
#[derive(Debug, Clone)]
pub struct CpuPicture {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Sum of linear radiance, row-major from the top left.
    pub sums: Vec<[f32; 3]>,
    /// Samples in the sums.
    pub samples: u32,
    /// What the last sample did.
    pub hits: Vec<PixelHit>,
}

impl CpuPicture {
    /// A picture without samples.
    pub fn new([width, height]: [u32; 2]) -> CpuPicture {
        let pixels = width as usize * height as usize;
        let nothing = PixelHit { primitive: NO_HIT, rays: 0, evaluations: 0 };
        CpuPicture { width, height, sums: vec![[0.0; 3]; pixels], samples: 0, hits: vec![nothing; pixels] }
    }

    /// Adds one sample to every pixel, rows in parallel. `row_done` is called after every row; once it returns
    /// `false` the remaining rows are left out.
    pub fn add_sample(&mut self, scene: &Scene, options: &ShadeOptions, row_done: &(dyn Fn() -> bool + Sync)) {
        // Before the rows, so that no two expand the same.
        scene.assets.iter().for_each(|asset| {
            asset.resident();
        });
        let shader = Shader {
            scene,
            camera: scene.camera.frame(self.width, self.height),
            jitter: jitter(self.samples),
            sample: self.samples,
            options: *options,
            lod_transition: LodTransition::MESHES,
        };
        let width = self.width as usize;
        let rows = self.sums.par_chunks_mut(width).zip(self.hits.par_chunks_mut(width)).enumerate();
        // An early end is not an error here; the caller knows that it asked for it.
        let _ = rows.try_for_each(|(y, (sums, hits))| {
            for x in 0..width {
                let pixel = [x as u32, y as u32];
                let eye = shader.camera.eye;
                let lod_transition = LodTransition::of_path(eye, shader.camera.pixel_width(), pixel, shader.sample);
                let (radiance, hit) = Shader { lod_transition, ..shader }.pixel(pixel);
                for channel in 0..3 {
                    sums[x][channel] += radiance[channel];
                }
                hits[x] = hit;
            }
            row_done().then_some(())
        });
        self.samples += 1;
    }

    /// Mean linear radiance per pixel.
    pub fn radiance(&self) -> Vec<[f32; 3]> {
        let count = self.samples.max(1) as f32;
        self.sums.iter().map(|sum| sum.map(|x| x / count)).collect()
    }
}

/// What random numbers are for.
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
}

/// Random numbers for the light at one point.
pub(crate) struct LightNumbers {
    pub(crate) ambient_at: [f32; 2],
    pub(crate) sun_at: [f32; 2],
    pub(crate) seed: u32,
}

/// Seed of the pixel's random numbers at a depth of its path, for one purpose.
pub(crate) fn seed_of([x, y]: [u32; 2], depth: u32, purpose: Numbers) -> u32 {
    let hashed = sampler::hash(depth.wrapping_add((purpose as u32) << 16));
    sampler::hash(x.wrapping_add(sampler::hash(y.wrapping_add(hashed))))
}

/// How a path goes on from a surface.
struct Scattered {
    direction: Vec3,
    /// It leaves on the back.
    back: bool,
    /// Reflected over density.
    weight: Vec3,
    /// Per steradian; 0 from a mirror.
    density: f32,
}

/// One sample of every pixel.
pub(crate) struct Shader<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) camera: CameraFrame,
    jitter: [f32; 2],
    pub(crate) sample: u32,
    pub(crate) options: ShadeOptions,
    /// What is a mesh and what a volume.
    pub(crate) lod_transition: LodTransition,
}

impl Shader<'_> {
    /// A sample of the middle of each pixel, with meshes wherever one is seen in any.
    fn of_middles<'a>(scene: &'a Scene, [width, height]: [u32; 2], options: ShadeOptions) -> Shader<'a> {
        let camera = scene.camera.frame(width, height);
        let lod_transition = LodTransition::new(camera.eye, camera.pixel_width(), 1.0);
        Shader { scene, camera, jitter: [0.0; 2], sample: 0, options, lod_transition }
    }

    pub(crate) fn trace(&self, origin: Vec3, direction: Vec3, t_max: f32, any: AnyHit) -> Hit {
        self.scene.geometry.trace_handed_over(origin, direction, t_max, any, &self.lod_transition)
    }

    /// What a ray meets, relief included, and its way below the surface to the relief, texels. Twin: `trace_seen`.
    fn seen(&self, origin: Vec3, direction: Vec3) -> (Hit, f32) {
        let (mut start, mut gone) = (origin, 0.0);
        // Length of the way through the shell just before.
        let mut through = 0.0;
        for _ in 0..SHELL_TRIES {
            let mut hit = self.trace(start, direction, FAR, AnyHit::No);
            if hit.primitive == NO_HIT {
                return (hit, 0.0);
            }
            gone += hit.t;
            let s = Surface::surface_at(&self.scene.geometry, &hit, direction);
            let relief = Relief::relief_new(self.scene, &hit, &s);
            // What was entered between the hills is left through its lid.
            let leaving = s.view_back && hit.t < through;
            hit.t = gone;
            let Some(relief) = relief.filter(|_| !s.view_back || leaving) else {
                return (hit, 0.0);
            };
            if leaving {
                (start, through) = (s.above, 0.0);
                continue;
            }
            let way = relief.relief_enter(-s.wo);
            if way >= 0.0 {
                return (hit, way);
            }
            through = -way / relief.texels_per_unit;
            start = s.position + direction * through;
            gone += through;
        }
        (Hit::none(FAR), 0.0)
    }

    /// The surface that a ray hit and, with relief, that and the point that is met. Twin: `surface_of`.
    fn surface_of(&self, hit: &Hit, sunk: f32, direction: Vec3) -> (Surface, Option<(Relief<'_>, Vec3)>) {
        let mut s = Surface::surface_at(&self.scene.geometry, hit, direction);
        let relief = Relief::relief_new(self.scene, hit, &s).filter(|_| !s.view_back);
        let relief = relief.map(|relief| (relief, relief.relief_point(-s.wo, sunk)));
        if let Some((relief, point)) = &relief {
            s.uv = relief.relief_uv(&self.scene.materials[s.material], *point, s.wo);
        }
        (s, relief)
    }

    /// Draws the light of stratum `stratum` of `strata`, which divide the lights in their order among them: of some
    /// candidates spread over the stratum one, as likely as what it could add unshadowed [Talbot 2005]. Its number and how
    /// many lights' share it stands for; `None` where none could add anything.
    fn choose_light(
        &self,
        s: &Surface,
        light_back: bool,
        stratum: usize,
        strata: usize,
        seed: u32,
    ) -> Option<(usize, f32)> {
        let lights = &self.scene.lights;
        let cell = lights.len() as f32 / (strata * LIGHT_CANDIDATES) as f32;
        let (mut total, mut kept, mut chosen) = (0.0f32, 0.0f32, 0);
        for k in 0..LIGHT_CANDIDATES {
            let number = stratum * LIGHT_CANDIDATES + k;
            let own = seed.wrapping_add(2 * number as u32);
            let at = (number as f32 + sampler::one(own)) * cell;
            let index = (at as usize).min(lights.len() - 1);
            let to_light = lights[index].position - s.position;
            let distance2 = to_light.length_squared().max(MIN_LIGHT_DISTANCE2);
            let cosine = s.normal.dot(to_light) * (1.0 / distance2.sqrt());
            let towards = if light_back { -cosine } else { cosine };
            let could_add = Vec3::from(lights[index].intensity).max_element() * towards.max(0.0) / distance2;
            total += could_add;
            if sampler::one(own.wrapping_add(1)) * total < could_add {
                (chosen, kept) = (index, could_add);
            }
        }
        (kept > 0.0).then(|| (chosen, total * cell / kept))
    }

    /// Level of the material's asset or leaf whose texels are about as large as what a pixel sees of the surface, `travelled`
    /// from the eye.
    fn level_of(&self, s: &Surface, material: &Material, travelled: f32, seed: u32) -> u32 {
        if !self.options.uses_levels() {
            return 0;
        }
        let (size, levels) = match material.body {
            Body::Plain(_) => return 0,
            Body::Asset(asset) => {
                let head = self.scene.assets[asset].head();
                ([head.width() as f32, head.height() as f32], head.levels())
            }
            Body::Leaf(leaf) => {
                let leaf = &self.scene.leaves[leaf].leaf;
                (leaf.size().map(|side| side as f32), leaf.levels())
            }
        };
        // Side of a square of the area that the pixel sees.
        let width = travelled * self.camera.pixel_width() / s.wo.z.abs().sqrt();
        let tiles = Vec2::from(size) * Vec2::from(material.uv_scale).abs();
        let texels = width * s.texture_per_unit * (tiles.x * tiles.y).sqrt();
        let part = if self.sample > 0 { sampler::one(seed ^ LEVEL_CHOICE) } else { 0.5 };
        let level = (texels.clamp(1e-6, 1e6).log2() + part).floor();
        (level.max(0.0) as u32).min(levels - 1)
    }

    /// The leaf that a material shows at a point.
    fn viewed_leaf(&self, s: &Surface, material: &Material, hit: &Hit, level: u32) -> Option<ViewedLeaf<'_>> {
        let Body::Leaf(number) = material.body else { return None };
        let factors = self.scene.geometry.instances()[hit.instance as usize].factors;
        let uv = (s.uv * Vec2::from(material.uv_scale)).to_array();
        let words = self.scene.leaves[number].leaf.words();
        Some(ViewedLeaf::new(words, uv, level, factors, s.wo.to_array()).tinted(material.tint))
    }

    /// What the eye sees there by light on one side, `None` where that is nothing.
    fn viewed_body<'a>(
        &'a self,
        s: &Surface,
        material: &Material,
        leaf: Option<&'a ViewedLeaf<'a>>,
        level: u32,
        light_back: bool,
    ) -> Option<ViewedBody<'a>> {
        match material.body {
            Body::Plain(colour) if light_back == s.view_back => Some(ViewedBody::Plain(colour.reflectance.into())),
            Body::Plain(colour) => {
                Some(Vec3::from(colour.transmittance)).filter(|share| share.max_element() > 0.0).map(ViewedBody::Plain)
            }
            Body::Asset(asset) => {
                let resident = self.scene.assets[asset].resident();
                let layer = resident.layer_for_sides(level, light_back, s.view_back)?;
                let texel = resident.texel(layer, (s.uv * Vec2::from(material.uv_scale)).to_array());
                let viewed = ViewedTexel::new(resident, layer, texel, s.wo.to_array(), &self.options.decode);
                Some(ViewedBody::Asset(Box::new(viewed), material.tint.into()))
            }
            Body::Leaf(_) => leaf.map(ViewedBody::Leaf),
        }
    }

    /// Light of one side of the surface: point lights and the sun with their shadows, then what surrounds along one ray.
    fn light_from_side(
        &self,
        s: &Surface,
        relief: Option<(&Relief, Vec3)>,
        material: &Material,
        viewed: &ViewedBody,
        light_back: bool,
        width: f32,
        numbers: &LightNumbers,
        done: &mut PixelHit,
    ) -> Vec3 {
        let (scene, seed) = (self.scene, numbers.seed);
        // Values without a residual hold no shadows.
        let bare = viewed.is_bare();
        let mut rows = LightRows::default();
        let origin = if light_back { s.below } else { s.above };
        let mut radiance = Vec3::ZERO;
        let mut add = |wi: Vec3, incident: Vec3, direction: Vec3, distance: f32| {
            done.rays += 1;
            if distance > 0.0 && self.trace(origin, direction, distance, AnyHit::Yes).primitive != NO_HIT {
                return;
            }
            if relief.is_some_and(|(relief, point)| !light_back && relief.relief_shadowed(point, wi, bare)) {
                return;
            }
            let passed = self.past_volumes(origin, direction, distance, width);
            if passed <= 0.0 {
                return;
            }
            done.evaluations += u32::from(viewed.is_evaluated());
            radiance += passed * incident * viewed.body_light(&mut rows, wi);
        };
        let drawn = (self.options.light_samples as usize) < scene.lights.len();
        let asked = scene.lights.len().min(self.options.light_samples as usize);
        for i in 0..asked {
            let chosen = if drawn { self.choose_light(s, light_back, i, asked, seed) } else { Some((i, 1.0)) };
            let Some((index, scale)) = chosen else { continue };
            let light = &scene.lights[index];
            let to_light = light.position - s.position;
            let distance2 = to_light.length_squared();
            if distance2 < MIN_LIGHT_DISTANCE2 {
                continue;
            }
            let wi = s.local_from_world(to_light * (1.0 / distance2.sqrt()));
            if (wi.z < 0.0) != light_back {
                continue;
            }
            // The decoded value holds the cosine already.
            let incident = Vec3::from(light.intensity) * scale / (distance2 * PI);
            let lifted = light.position - origin;
            let distance = lifted.length();
            add(wi, incident, lifted / distance.max(1e-30), distance);
        }
        if let Some(sun) = &scene.sun {
            let direction = sun.sun_sample(numbers.sun_at);
            let wi = s.local_from_world(direction);
            if (wi.z < 0.0) == light_back {
                add(wi, Vec3::from(sun.irradiance) / PI, direction, FAR);
            }
        }
        let path = self.options.mode == RenderMode::Path;
        let by_normal = scene.environment.as_ref().filter(|_| !path && self.options.sky == SkyLight::Irradiance);
        let uniform = match (by_normal, &scene.environment) {
            (Some(sky), _) => {
                let normal = if light_back { -s.normal } else { s.normal };
                Some(sky.irradiance(normal) / PI)
            }
            (None, Some(_)) => None,
            (None, None) => Some(Vec3::from(scene.ambient.radiance)).filter(|_| !path),
        };
        if let Some(incident) = uniform.filter(|incident| incident.max_element() > 0.0) {
            // A leaf has two sides and takes them in turn.
            let turns = matches!(viewed, ViewedBody::Leaf(..));
            if !turns || (sampler::one(seed ^ SIDE_CHOICE) < 0.5) == light_back {
                let mut wi = sampler::cosine(numbers.ambient_at);
                // The density of wi is its cosine over pi.
                let incident = incident * if turns { 2.0 } else { 1.0 } / wi.z.max(1e-6);
                wi.z = if light_back { -wi.z } else { wi.z };
                add(wi, incident, s.world_from_local(wi), scene.ambient.distance);
            }
        } else if let (Some(sky), None) = (&scene.environment, by_normal) {
            // Drawn from the picture or, where no path goes on to it, from the surface as often. A path meets the picture by
            // itself, but seldom where it is small and bright.
            let wi = if path || sampler::one(seed ^ ENVIRONMENT_CHOICE) < 0.5 {
                s.local_from_world(sky.sample(numbers.ambient_at))
            } else {
                let [x, y] = numbers.ambient_at;
                viewed.body_sample([x, y, sampler::one(seed ^ LOBE_CHOICE)], light_back)
            };
            let direction = s.world_from_local(wi);
            let own = viewed.body_density(wi);
            // Balance heuristic [Veach 1995].
            let density = if path {
                sky.density(direction) + side_share(scene, s, material, light_back) * own
            } else {
                0.5 * (sky.density(direction) + own)
            };
            if (wi.z < 0.0) == light_back && density > 0.0 {
                let distance = if path { FAR } else { scene.ambient.distance };
                add(wi, sky.radiance(direction) / (PI * density), direction, distance);
            }
        }
        radiance
    }

    /// `None` where the path ends.
    fn scatter(
        &self,
        s: &Surface,
        material: &Material,
        leaf: Option<&ViewedLeaf>,
        direction: Vec3,
        at: [f32; 2],
        choice: f32,
    ) -> Option<Scattered> {
        let glossy = Vec3::from(material.mirror).max_element();
        let body = body_share(material);
        if glossy + body <= 0.0 {
            return None;
        }
        let mirror_share = glossy / (glossy + body);
        if choice < mirror_share {
            let weight = Vec3::from(material.mirror) / mirror_share;
            return Some(Scattered {
                direction: mirror_direction(s, direction),
                back: s.view_back,
                weight,
                density: 0.0,
            });
        }
        let mut rest = (choice - mirror_share) / (1.0 - mirror_share);
        let mut back = s.view_back;
        if let Body::Plain(colour) = material.body {
            back ^= rest < share_through(&colour);
        }
        if let Body::Asset(asset) = material.body {
            let head = self.scene.assets[asset].head();
            if head.layer_for_sides(0, !s.view_back, s.view_back).is_some() {
                // Either side of the surface is as likely, where light comes from both.
                let both = head.layer_for_sides(0, s.view_back, s.view_back).is_some();
                if !both || rest < 0.5 {
                    back = !back;
                }
                rest = if both { (2.0 * rest).fract() } else { rest };
            }
        }
        let viewed = self.viewed_body(s, material, leaf, 0, back)?;
        let wi = viewed.body_sample([at[0], at[1], rest], back);
        if matches!(viewed, ViewedBody::Leaf(..)) {
            back = wi.z < 0.0;
        }
        let density = side_share(self.scene, s, material, back) * viewed.body_density(wi);
        if density <= 0.0 || (wi.z < 0.0) != back {
            return None;
        }
        let weight = viewed.body_light(&mut LightRows::default(), wi) / (PI * density);
        Some(Scattered { direction: s.world_from_local(wi), back, weight, density })
    }

    /// Radiance towards the eye through a pixel, and what it took.
    fn pixel(&self, pixel: [u32; 2]) -> ([f32; 3], PixelHit) {
        let scene = self.scene;
        let (mut origin, mut direction) = (self.camera.eye, self.camera.direction(pixel[0], pixel[1], self.jitter));
        let mut done = PixelHit { primitive: NO_HIT, rays: 0, evaluations: 0 };
        let (mut radiance, mut throughput, mut scattered) = (Vec3::ZERO, Vec3::ONE, false);
        let (mut density, mut travelled) = (0.0, 0.0);
        for depth in 1..=self.options.depth {
            let (hit, sunk) = self.seen(origin, direction);
            done.rays += 1;
            if depth == 1 {
                done.primitive = hit.primitive;
            }
            let before = travelled;
            if let Some(volumes) = &scene.volumes {
                let seen = self.seen_in_volumes(volumes, origin, direction, hit.t, before, pixel, depth, &mut done);
                radiance += throughput * seen.radiance;
                if self.options.mode == RenderMode::Path {
                    let at = sampler::two(self.sample, seed_of(pixel, depth, Numbers::VolumeChoice));
                    if at[0] >= seen.through {
                        let Some(point) = seen.point else { break };
                        let way = sampler::two(self.sample, seed_of(pixel, depth, Numbers::VolumeScatter));
                        let next = sampler::sphere(way);
                        throughput *= 4.0 * point.reflected(volumes, next, AROUND_ROUGHNESS);
                        let kept = throughput.max_element().clamp(MIN_KEPT, 1.0);
                        if at[1] >= kept || throughput.max_element() <= 0.0 {
                            break;
                        }
                        throughput /= kept;
                        (scattered, density) = (true, SPHERE_DENSITY);
                        travelled += point.t;
                        origin += direction * point.t + point.shadow_offset(volumes, next);
                        direction = next;
                        continue;
                    }
                } else {
                    throughput *= seen.through;
                    if seen.through <= 0.0 {
                        break;
                    }
                }
            }
            if hit.primitive == NO_HIT {
                radiance += throughput
                    * match &scene.environment {
                        // The rest was drawn from the picture.
                        Some(sky) if density > 0.0 => {
                            sky.radiance(direction) * (density / (density + sky.density(direction)))
                        }
                        Some(sky) => sky.radiance(direction),
                        None if scattered => scene.ambient.radiance.into(),
                        None => scene.background.into(),
                    };
                // What scattered has met it already.
                if let (Some(sun), false) = (&scene.sun, scattered) {
                    radiance += throughput * sun.sun_radiance(direction);
                }
                break;
            }
            travelled += hit.t;
            let (s, relief) = self.surface_of(&hit, sunk, direction);
            let material = &scene.materials[s.material];
            let relief = relief.as_ref().map(|(relief, point)| (relief, *point));
            let numbers = LightNumbers {
                ambient_at: sampler::two(self.sample, seed_of(pixel, depth, Numbers::Ambient)),
                sun_at: sampler::two(self.sample, seed_of(pixel, depth, Numbers::Sun)),
                seed: sampler::hash(seed_of(pixel, depth, Numbers::Light).wrapping_add(self.sample)),
            };
            let level = self.level_of(&s, material, travelled, numbers.seed);
            let leaf = self.viewed_leaf(&s, material, &hit, level);
            for light_back in [false, true] {
                if let Some(viewed) = self.viewed_body(&s, material, leaf.as_ref(), level, light_back) {
                    radiance += throughput
                        * self.light_from_side(
                            &s,
                            relief,
                            material,
                            &viewed,
                            light_back,
                            travelled * self.ray_width(),
                            &numbers,
                            &mut done,
                        );
                }
            }
            if self.options.mode == RenderMode::Path {
                let at = sampler::two(self.sample, seed_of(pixel, depth, Numbers::Scatter));
                let [choice, roulette] = sampler::two(self.sample, seed_of(pixel, depth, Numbers::Choice));
                let Some(next) = self.scatter(&s, material, leaf.as_ref(), direction, at, choice) else { break };
                throughput *= next.weight;
                // Russian roulette: dim paths end, the others carry their share on.
                let kept = throughput.max_element().clamp(MIN_KEPT, 1.0);
                if roulette >= kept || throughput.max_element() <= 0.0 {
                    break;
                }
                throughput /= kept;
                scattered |= next.density > 0.0;
                density = next.density;
                direction = next.direction;
                origin = if next.back { s.below } else { s.above };
                continue;
            }
            throughput *= Vec3::from(material.mirror);
            if throughput.max_element() < MIN_THROUGHPUT {
                break;
            }
            direction = mirror_direction(&s, direction);
            origin = if s.view_back { s.below } else { s.above };
        }
        (radiance.to_array(), done)
    }
}

/// What a pixel's middle shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Picked {
    /// Number of the asset.
    pub asset: usize,
    /// Texel of its finest level.
    pub texel: u32,
    /// Where the surface is.
    pub position: Vec3,
}

/// The asset that the eye sees in a pixel of a picture of `size`, at `pixel` from its top left corner, if any.
pub fn pick(scene: &Scene, [width, height]: [u32; 2], pixel: [f32; 2]) -> Option<Picked> {
    let [x, y] = pixel;
    if !(0.0..width as f32).contains(&x) || !(0.0..height as f32).contains(&y) {
        return None;
    }
    let shader = Shader::of_middles(scene, [width, height], ShadeOptions::default());
    let direction = shader.camera.direction(x as u32, y as u32, [x.fract() - 0.5, y.fract() - 0.5]);
    let (hit, sunk) = shader.seen(shader.camera.eye, direction);
    if hit.primitive == NO_HIT {
        return None;
    }
    let (s, _) = shader.surface_of(&hit, sunk, direction);
    let material = &scene.materials[s.material];
    let asset = material.asset()?;
    let texel = scene.assets[asset].head().texel(0, (s.uv * Vec2::from(material.uv_scale)).to_array());
    Some(Picked { asset, texel, position: s.position })
}

/// Of each asset of a scene, how many pixels of its picture ask for each level, the finest first: those in which the eye
/// sees it, directly or in mirrors.
pub(crate) fn levels_seen(scene: &Scene, [width, height]: [u32; 2], options: &ShadeOptions) -> Vec<Vec<u64>> {
    let shader = Shader::of_middles(scene, [width, height], *options);
    let empty = || scene.assets.iter().map(|asset| vec![0u64; asset.head().levels() as usize]).collect::<Vec<_>>();
    let row = |y: u32| {
        let mut seen = empty();
        for x in 0..width {
            let (mut origin, mut direction) = (shader.camera.eye, shader.camera.direction(x, y, [0.0; 2]));
            let mut travelled = 0.0;
            for _ in 0..options.depth {
                let hit = shader.trace(origin, direction, FAR, AnyHit::No);
                if hit.primitive == NO_HIT {
                    break;
                }
                travelled += hit.t;
                let s = Surface::surface_at(&scene.geometry, &hit, direction);
                let material = &scene.materials[s.material];
                if let Some(asset) = material.asset() {
                    seen[asset][shader.level_of(&s, material, travelled, 0) as usize] += 1;
                }
                if material.mirror == [0.0; 3] {
                    break;
                }
                direction = mirror_direction(&s, direction);
                origin = if s.view_back { s.below } else { s.above };
            }
        }
        seen
    };
    let add = |mut sum: Vec<Vec<u64>>, other: Vec<Vec<u64>>| {
        sum.iter_mut().flatten().zip(other.into_iter().flatten()).for_each(|(a, b)| *a += b);
        sum
    };
    (0..height).into_par_iter().map(row).reduce(empty, add)
}

/// Share of a path's directions that leave on a side in another way than by the mirror.
fn side_share(scene: &Scene, s: &Surface, material: &Material, back: bool) -> f32 {
    let body = body_share(material);
    let share = body / (Vec3::from(material.mirror).max_element() + body).max(1e-6);
    match material.body {
        Body::Plain(colour) if back == s.view_back => share * (1.0 - share_through(&colour)),
        Body::Plain(colour) => share * share_through(&colour),
        Body::Asset(asset) if scene.assets[asset].head().layer_for_sides(0, !back, s.view_back).is_some() => {
            0.5 * share
        }
        // A leaf's density is over both sides.
        _ => share,
    }
}

/// How often a path goes on from the body, in proportion to the mirror's reflectance.
fn body_share(material: &Material) -> f32 {
    match material.body {
        Body::Plain(DiffuseColour { reflectance, transmittance }) => {
            Vec3::from(reflectance).max_element() + Vec3::from(transmittance).max_element()
        }
        Body::Asset(_) | Body::Leaf(_) => 1.0,
    }
}

/// Of the directions that a diffuse surface sends a path in, the share that leaves on the other side.
fn share_through(colour: &DiffuseColour) -> f32 {
    let [reflected, passed] = [colour.reflectance, colour.transmittance].map(|share| Vec3::from(share).max_element());
    passed / (reflected + passed).max(1e-6)
}

/// The mirror direction about the shading normal, kept above the triangle.
fn mirror_direction(s: &Surface, direction: Vec3) -> Vec3 {
    let side = if s.view_back { -1.0 } else { 1.0 };
    let mirrored = direction - 2.0 * s.normal.dot(direction) * s.normal;
    let above = mirrored.dot(s.flat) * side;
    (mirrored + s.flat * (side * (MIN_EYE_COS - above).max(0.0))).normalize()
}

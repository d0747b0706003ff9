//! One sample of every pixel: its random numbers, what its rays meet, and what they see there. Twin: `shader.wgsl`.

use crate::cpu::path::{Numbers, PathVertex, seed_of};
use crate::geometry::bvh::{AnyHit, Hit, NO_HIT};
use crate::geometry::lod_transition::LodTransition;
use crate::geometry::surface::Surface;
use crate::light::irradiance_volume::IrradianceVolume;
use crate::light::light_grid::LightGrid;
use crate::options::{Filter, RenderMode, ShadeOptions};
use crate::sampler;
use crate::scene::camera::{CameraFrame, jitter};
use crate::scene::material::{Body, Material, NOISE_OCTAVES};
use crate::scene::scene::Scene;
use crate::shading::fractal_noise::fractal_noise;
use crate::shading::relief::Relief;
use crate::shading::viewed_body::ViewedBody;
use btf_runtime::{ViewedLeaf, ViewedTexel};
use glam::{Vec2, Vec3};

/// Distance to which rays reach. Twin: `TRACE_FAR`.
pub(crate) const FAR: f32 = 1e30;
/// A light nearer than this (squared) to the surface is left out.
pub(crate) const MIN_LIGHT_DISTANCE2: f32 = 1e-12;
/// Sets apart the number that a level is drawn with from the others of a light's seed. Twin: `LEVEL_CHOICE`.
pub(crate) const LEVEL_CHOICE: u32 = 0x967a_889b;
/// Shells that a ray may pass. Twin: `SHELL_TRIES`.
pub(crate) const SHELL_TRIES: usize = 8;
/// Rays along a pixel's side, for more of which voxels do not grow narrower: it was not measured for more.
pub(crate) const MAX_RAYS_ACROSS: f32 = 4.0;
/// Texels that a place between them is interpolated from. Twin: `TEXEL_TAPS`.
pub(crate) const TEXEL_TAPS: u32 = 4;

/// The constants that the shader has too, by name.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] = &[
    ("TRACE_FAR", FAR),
    ("TRACE_PI", std::f32::consts::PI),
    ("MIN_LIGHT_DISTANCE2", MIN_LIGHT_DISTANCE2),
    ("MAX_RAYS_ACROSS", MAX_RAYS_ACROSS),
];

/// One of the texels whose light is summed at a vertex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TexelTap {
    /// The numbers that take it.
    pub at: [f32; 2],
    pub weight: f32,
}

/// Widths at distance 1 of the eye by which levels of detail are chosen, where a picture's own pixels do not choose them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetailWidths {
    /// Of a pixel.
    pub pixel: f32,
    /// How far the rays of a pixel are apart.
    pub ray: f32,
}

/// One sample of every pixel.
pub(crate) struct Shader<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) camera: CameraFrame,
    pub(crate) jitter: [f32; 2],
    pub(crate) sample: u32,
    pub(crate) options: ShadeOptions,
    /// What draws the lights, where there are more than a sample has candidates for.
    pub(crate) light_grid: Option<&'a LightGrid>,
    /// The light after one bounce, where that is not traced.
    pub(crate) irradiance_volume: Option<&'a IrradianceVolume>,
    /// The level-of-detail transition of the sample's path.
    pub(crate) lod_transition: LodTransition,
    /// What levels of detail are chosen by; `None` for the camera's pixels.
    pub(crate) widths: Option<DetailWidths>,
}

impl Shader<'_> {
    /// Returns the sample of the middle of each pixel, with meshes wherever one is seen in any.
    pub(crate) fn of_middles<'a>(scene: &'a Scene, [width, height]: [u32; 2], options: ShadeOptions) -> Shader<'a> {
        let camera = scene.camera.frame(width, height);
        let lod_transition = LodTransition::new(camera.eye, camera.pixel_width(), 1.0);
        Shader { lod_transition, ..Shader::with_camera(scene, camera, options) }
    }

    /// Returns the first sample, without what draws its lights and what they have lit, with every mesh one.
    pub(crate) fn with_camera(scene: &Scene, camera: CameraFrame, options: ShadeOptions) -> Shader<'_> {
        Shader {
            scene,
            camera,
            jitter: [0.0; 2],
            sample: 0,
            options,
            light_grid: None,
            irradiance_volume: None,
            lod_transition: LodTransition::MESHES,
            widths: None,
        }
    }

    /// Returns a sample of a pixel that finds what its eye's ray meets first, without its lights.
    pub(crate) fn of_first_hit<'a>(
        scene: &'a Scene,
        camera: CameraFrame,
        options: ShadeOptions,
        pixel: [u32; 2],
        sample: u32,
    ) -> Shader<'a> {
        let lod_transition = LodTransition::of_path(camera.eye, camera.pixel_width(), pixel, sample);
        Shader { jitter: jitter(sample), sample, lod_transition, ..Shader::with_camera(scene, camera, options) }
    }

    /// Returns two numbers in [0, 1) for a purpose at a vertex.
    pub(crate) fn two_numbers(&self, vertex: PathVertex, purpose: Numbers) -> [f32; 2] {
        sampler::two(self.sample, seed_of(vertex, purpose))
    }

    /// Returns the seed of numbers without order for the light at a vertex.
    pub(crate) fn light_seed(&self, vertex: PathVertex, purpose: Numbers) -> u32 {
        sampler::hash(seed_of(vertex, purpose).wrapping_add(self.sample))
    }

    /// Returns how far a pixel's rays are apart at distance 1 of the eye, of which it has had so many.
    fn ray_width(&self) -> f32 {
        self.widths.map_or(self.camera.pixel_width() / ((self.sample + 1) as f32).sqrt(), |widths| widths.ray)
    }

    /// Returns how wide a pixel is at distance 1 of the eye.
    pub(crate) fn pixel_width(&self) -> f32 {
        self.widths.map_or(self.camera.pixel_width(), |widths| widths.pixel)
    }

    /// Returns the width of voxels at distance 1 of the eye: that of rays. These miss narrower ones, and wider ones blur
    /// (docs/results/voltex.md).
    pub(crate) fn voxel_width(&self) -> f32 {
        self.ray_width().max(self.pixel_width() / MAX_RAYS_ACROSS)
    }

    /// Returns the numbers by which one of the texels around a vertex is taken, `travelled` from the eye: the nearest where
    /// texels are as small as pixels or smaller, any of the four from two pixels a texel on. The first sample of a picture
    /// takes the nearest, but for traced paths.
    pub(crate) fn texel_numbers(&self, s: &Surface, travelled: f32, vertex: PathVertex) -> [f32; 2] {
        let material = &self.scene.materials[s.material];
        let drawn = self.sample > 0 || self.options.mode == RenderMode::Path;
        let Body::Asset(asset) = material.body else { return [0.5; 2] };
        if self.options.filter == Filter::Nearest || !drawn {
            return [0.5; 2];
        }
        let size = self.scene.assets[asset].head().size(0).map(|side| side as f32);
        let texels = texels_across(s, material, size, travelled * self.camera.pixel_width());
        let part = (-texels.log2()).clamp(0.0, 1.0);
        self.two_numbers(vertex, Numbers::Texel).map(|at| 0.5 + part * (at - 0.5))
    }

    /// Returns how many texels are summed at a vertex.
    pub(crate) fn texel_taps(&self, material: &Material, vertex: PathVertex) -> u32 {
        let linear = self.options.filter == Filter::Linear && vertex.depth == 1;
        if linear && matches!(material.body, Body::Asset(_)) { TEXEL_TAPS } else { 1 }
    }

    /// Returns texel number `tap` of the four of a level that are summed at a vertex on an asset.
    pub(crate) fn texel_tap(&self, s: &Surface, level: u32, tap: u32) -> TexelTap {
        let material = &self.scene.materials[s.material];
        let Body::Asset(asset) = material.body else { return TexelTap { at: [0.5; 2], weight: 1.0 } };
        let head = self.scene.assets[asset].head();
        let size = head.size(level * head.layers()).map(|side| side as f32);
        let uv = s.uv * Vec2::from(material.uv_scale);
        let upper = [(tap & 1) as f32, (tap >> 1) as f32];
        let fract = |x: f32| x - x.floor();
        let along = |x: f32, axis: usize| {
            // Place between the middles of two texels.
            let place = fract(fract(x) * size[axis] + 0.5);
            if upper[axis] > 0.0 { place } else { 1.0 - place }
        };
        TexelTap { at: upper, weight: along(uv.x, 0) * along(1.0 - uv.y, 1) }
    }

    /// Returns the nearest hit of a mesh, or any hit, before `t_max`.
    pub(crate) fn trace(&self, origin: Vec3, direction: Vec3, t_max: f32, any: AnyHit) -> Hit {
        self.scene.geometry.trace_with_lod(origin, direction, t_max, any, &self.lod_transition)
    }

    /// Returns what a ray meets, displacement included, and the way below the surface to the displaced one, texels.
    pub(crate) fn trace_closest(&self, origin: Vec3, direction: Vec3) -> (Hit, f32) {
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

    /// Returns the surface that a ray hit and, where it is displaced, the relief and the point of that which is met.
    pub(crate) fn surface_of(&self, hit: &Hit, sunk: f32, direction: Vec3) -> (Surface, Option<(Relief<'_>, Vec3)>) {
        let mut s = Surface::surface_at(&self.scene.geometry, hit, direction);
        let relief = Relief::relief_new(self.scene, hit, &s).filter(|_| !s.view_back);
        let relief = relief.map(|relief| (relief, relief.relief_point(-s.wo, sunk)));
        if let Some((relief, point)) = &relief {
            s.uv = relief.relief_uv(&self.scene.materials[s.material], *point, s.wo);
        }
        (s, relief)
    }

    /// Returns the level of the material's asset, leaf or noise whose texels are about as large as what a ray stands for on the
    /// surface, `travelled` from the eye: first all that a pixel sees, and less with every further ray of the pixel.
    pub(crate) fn level_of(&self, s: &Surface, material: &Material, travelled: f32, seed: u32) -> u32 {
        if !self.options.uses_levels() {
            return 0;
        }
        let Some(size) = self.scene.texels_of(material) else { return 0 };
        let levels = match material.body {
            Body::Plain(_) => NOISE_OCTAVES + 1,
            Body::Asset(asset) => self.scene.assets[asset].head().levels(),
            Body::Leaf(leaf) => self.scene.leaves[leaf].leaf.levels(),
        };
        let texels = texels_across(s, material, size, travelled * self.ray_width());
        let part = if self.sample > 0 { sampler::one(seed ^ LEVEL_CHOICE) } else { 0.5 };
        let level = (texels.log2() + part).floor();
        (level.max(0.0) as u32).min(levels - 1)
    }

    /// Returns the view-dependent half of the leaf that a material shows at a point, if it shows one.
    pub(crate) fn viewed_leaf(
        &self,
        s: &Surface,
        material: &Material,
        hit: &Hit,
        level: u32,
    ) -> Option<ViewedLeaf<'_>> {
        let Body::Leaf(number) = material.body else { return None };
        let factors = self.scene.geometry.instances()[hit.instance as usize].factors;
        let uv = (s.uv * Vec2::from(material.uv_scale)).to_array();
        let words = self.scene.leaves[number].leaf.words();
        Some(ViewedLeaf::new(words, uv, level, factors, s.wo.to_array()).tinted(material.tint))
    }

    /// Returns the view-dependent half of a point's shading for light on one side, `None` where nothing of that reaches
    /// the eye.
    pub(crate) fn viewed_body<'a>(
        &'a self,
        s: &Surface,
        material: &Material,
        leaf: Option<&'a ViewedLeaf<'a>>,
        level: u32,
        light_back: bool,
    ) -> Option<ViewedBody<'a>> {
        match material.body {
            Body::Plain(colour) if light_back == s.view_back => {
                let noise = material.noise.map_or(Vec3::ONE, |noise| {
                    Vec3::ONE.lerp(noise.into(), fractal_noise(s.uv * Vec2::from(material.uv_scale), level))
                });
                Some(ViewedBody::Plain(noise * Vec3::from(colour.reflectance)))
            }
            Body::Plain(colour) => {
                Some(Vec3::from(colour.transmittance)).filter(|share| share.max_element() > 0.0).map(ViewedBody::Plain)
            }
            Body::Asset(asset) => {
                let resident = self.scene.assets[asset].resident();
                let layer = resident.layer_for_sides(level, light_back.into(), s.view_back.into())?;
                let uv = (s.uv * Vec2::from(material.uv_scale)).to_array();
                let texel = resident.texel_between(layer, uv, s.texel_at);
                let viewed = ViewedTexel::new(resident, layer, texel, s.wo.to_array(), &self.options.decode);
                Some(ViewedBody::Asset(Box::new(viewed), material.tint.into()))
            }
            Body::Leaf(_) => leaf.map(ViewedBody::Leaf),
        }
    }
}

/// Returns how many of the finest texels, `size` a picture, lie along a square of the area that a ray of `width` covers on
/// the surface; 1e-6 to 1e6.
fn texels_across(s: &Surface, material: &Material, size: [f32; 2], width: f32) -> f32 {
    (width / s.wo.z.abs().sqrt() * texels_per_unit(s, material, size)).clamp(1e-6, 1e6)
}

/// Returns how many texels of a body, `size` a picture, lie on a unit of length of a surface.
pub(crate) fn texels_per_unit(s: &Surface, material: &Material, size: [f32; 2]) -> f32 {
    let tiles = Vec2::from(size) * Vec2::from(material.uv_scale).abs();
    s.texture_per_unit * (tiles.x * tiles.y).sqrt()
}

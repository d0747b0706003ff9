//! What the middle of a pixel shows, and which levels of assets a picture asks for.

use crate::cpu::scatter::mirror_direction;
use crate::cpu::shader::{FAR, Shader, texels_per_unit};
use crate::geometry::bvh::{AnyHit, NO_HIT};
use crate::geometry::surface::Surface;
use crate::options::ShadeOptions;
use crate::scene::material::Material;
use crate::scene::scene::Scene;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Texels along the way to the nearest eye of a surface with texels: about as many fill the picture.
const NEAREST_TEXELS: f32 = 4.0;
/// Distance of the nearest eye from a surface without texels, in the scene's radii.
const NEAREST_RADII: f32 = 1e-4;
/// Least distance of an eye from a surface as a share of the largest coordinate: nearer, the places of single-precision
/// numbers are seen between the pixels.
const NEAREST_IN_COORDINATE: f32 = 2e-4;

/// A point of an asset that a pixel shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Picked {
    /// Number of the asset.
    pub asset: usize,
    /// Texel of its finest level.
    pub texel: u32,
    /// Position of the point, world.
    pub position: Vec3,
}

/// Returns the asset that the eye sees at `pixel`, pixels from the top left corner of a picture of this size, if any.
pub fn pick(scene: &Scene, size: [u32; 2], pixel: [f32; 2]) -> Option<Picked> {
    let Seen { surface, material } = see(scene, size, pixel)?;
    let asset = material.asset()?;
    let texel = scene.assets[asset].head().texel(0, (surface.uv * Vec2::from(material.uv_scale)).to_array());
    Some(Picked { asset, texel, position: surface.position })
}

/// A point of a surface of meshes, and how near an eye may come to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SurfacePoint {
    /// Position, world.
    pub(crate) position: Vec3,
    /// Distance at which a few texels fill the picture, or that is short in the scene where there are no texels.
    pub(crate) nearest: f32,
}

/// Returns the point of a surface that the eye sees at `pixel` of a picture of this size, if any; see [`pick`]. Volumetric
/// textures have no surface.
pub(crate) fn pick_surface(scene: &Scene, size: [u32; 2], pixel: [f32; 2]) -> Option<SurfacePoint> {
    let Seen { surface, material } = see(scene, size, pixel)?;
    let position = surface.position;
    let density = scene.texels_of(material).map(|size| texels_per_unit(&surface, material, size));
    let nearest = match density.filter(|density| *density > 0.0) {
        Some(density) => NEAREST_TEXELS / density,
        None => NEAREST_RADII * scene.geometry.bounding_sphere().1,
    };
    Some(SurfacePoint { position, nearest: nearest.max(NEAREST_IN_COORDINATE * position.abs().max_element()) })
}

/// What the eye sees of meshes.
struct Seen<'a> {
    surface: Surface,
    material: &'a Material,
}

fn see(scene: &Scene, [width, height]: [u32; 2], pixel: [f32; 2]) -> Option<Seen<'_>> {
    let [x, y] = pixel;
    if !(0.0..width as f32).contains(&x) || !(0.0..height as f32).contains(&y) {
        return None;
    }
    let shader = Shader::of_middles(scene, [width, height], ShadeOptions::default());
    let direction = shader.camera.direction(x as u32, y as u32, [x.fract() - 0.5, y.fract() - 0.5]);
    let (hit, sunk) = shader.trace_closest(shader.camera.eye, direction);
    if hit.primitive == NO_HIT {
        return None;
    }
    let (surface, _) = shader.surface_of(&hit, sunk, direction);
    Some(Seen { surface, material: &scene.materials[surface.material] })
}

/// Counts for each asset of a scene how many pixels of a picture ask for each level, the finest first: those in which
/// the eye sees the asset, directly or in mirrors. `[asset][level]`.
pub(crate) fn count_levels(scene: &Scene, [width, height]: [u32; 2], options: &ShadeOptions) -> Vec<Vec<u64>> {
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

//! The reference renderer: the CPU decoder and BVH, the same formulas as the shaders. Twin: `shaders/shade.wgsl`.

use crate::bvh::{AnyHit, NO_HIT};
use crate::camera::{CameraFrame, jitter};
use crate::geometry::Vertex;
use crate::scene::Scene;
use crate::trace::PixelHit;
use btf_runtime::{DecodeOptions, decode};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::PI;

/// Distance to which primary rays reach. Twin: `TRACE_FAR`.
const FAR: f32 = 1e30;
/// Cosine to which an eye below the shading horizon is lifted; interpolated normals turn away at silhouettes.
const LEAST_EYE_COS: f32 = 1e-3;
/// A light nearer than this (squared) to the surface is left out.
const LEAST_LIGHT_DISTANCE2: f32 = 1e-12;

/// The constants that the shader has too, by name.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] = &[
    ("TRACE_FAR", FAR),
    ("TRACE_PI", PI),
    ("LEAST_EYE_COS", LEAST_EYE_COS),
    ("LEAST_LIGHT_DISTANCE2", LEAST_LIGHT_DISTANCE2),
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
        let nothing = PixelHit { primitive: NO_HIT, rays: 0, evaluations: 0, pad: 0 };
        CpuPicture { width, height, sums: vec![[0.0; 3]; pixels], samples: 0, hits: vec![nothing; pixels] }
    }

    /// Adds one sample to every pixel, rows in parallel. `row_done` is called after every row; once it returns
    /// `false` the remaining rows are left out.
    pub fn add_sample(&mut self, scene: &Scene, options: &DecodeOptions, row_done: &(dyn Fn() -> bool + Sync)) {
        let camera = scene.camera.frame(self.width, self.height);
        let offset = jitter(self.samples);
        let width = self.width as usize;
        let rows = self.sums.par_chunks_mut(width).zip(self.hits.par_chunks_mut(width)).enumerate();
        // An early end is not an error here; the caller knows that it asked for it.
        let _ = rows.try_for_each(|(y, (sums, hits))| {
            for x in 0..width {
                let (radiance, hit) = shade_pixel(scene, &camera, [x as u32, y as u32], offset, options);
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

fn normalize_or(v: Vec3, other: Vec3) -> Vec3 {
    let length2 = v.length_squared();
    if length2 > 1e-20 { v * (1.0 / length2.sqrt()) } else { other }
}

/// A vector perpendicular to the unit `n`.
fn perpendicular(n: Vec3) -> Vec3 {
    if n.x.abs() < 0.9 { Vec3::new(0.0, -n.z, n.y).normalize() } else { Vec3::new(n.z, 0.0, -n.x).normalize() }
}

/// Moves a point off a surface by some units in the last place [Waechter and Binder 2019].
fn offset_along(p: Vec3, n: Vec3) -> Vec3 {
    let component = |p: f32, n: f32| {
        if p.abs() < 1.0 / 32.0 {
            return p + n / 65536.0;
        }
        let steps = (n * 256.0) as i32;
        let bits = p.to_bits() as i32;
        f32::from_bits((if p < 0.0 { bits - steps } else { bits + steps }) as u32)
    };
    Vec3::new(component(p.x, n.x), component(p.y, n.y), component(p.z, n.z))
}

/// Lifts a point of a flat triangle onto the curved surface that its normals mean, which keeps the shadow's edge on a
/// curved object smooth [Hanika 2021]. `side` is 1 or -1, the side of the light.
fn lift(p: Vec3, weights: Vec3, corners: &[&Vertex; 3], side: f32) -> Vec3 {
    let mut at = Vec3::ZERO;
    for i in 0..3 {
        let normal = Vec3::from(corners[i].normal) * side;
        at += weights[i] * (p - normal * (p - Vec3::from(corners[i].position)).dot(normal).min(0.0));
    }
    at
}

/// Nearest texel of a texture coordinate. Twin: `btf_texel` of the decoder's WGSL.
fn texel_at(width: u32, height: u32, uv: Vec2) -> u32 {
    let wrap = |x: f32| x - x.floor();
    let x = ((wrap(uv.x) * width as f32) as u32).min(width - 1);
    let y = ((wrap(1.0 - uv.y) * height as f32) as u32).min(height - 1);
    y * width + x
}

fn shade_pixel(
    scene: &Scene,
    camera: &CameraFrame,
    [x, y]: [u32; 2],
    offset: [f32; 2],
    options: &DecodeOptions,
) -> ([f32; 3], PixelHit) {
    let geometry = &scene.geometry;
    let trace = |origin, direction, t_max, any| {
        geometry.bvh().trace(geometry.vertices(), geometry.triangles(), origin, direction, t_max, any)
    };
    let direction = camera.direction(x, y, offset);
    let hit = trace(camera.eye, direction, FAR, AnyHit::No);
    let mut done = PixelHit { primitive: hit.primitive, rays: 1, evaluations: 0, pad: 0 };
    if hit.primitive == NO_HIT {
        return (scene.background, done);
    }
    let triangle = geometry.triangles()[hit.primitive as usize];
    let corners = triangle.vertices.map(|index| &geometry.vertices()[index as usize]);
    let weights = Vec3::new(1.0 - hit.u - hit.v, hit.u, hit.v);
    let mix = |value: fn(&Vertex) -> Vec3| {
        value(corners[0]) * weights.x + value(corners[1]) * weights.y + value(corners[2]) * weights.z
    };
    let p = mix(|vertex| vertex.position.into());
    let uv = mix(|vertex| Vec3::new(vertex.u, vertex.v, 0.0)).truncate();

    // The flat normal, on the side of the shading normal; the frame of the texel.
    let [a, b, c] = corners.map(|vertex| Vec3::from(vertex.position));
    let mut flat = normalize_or((b - a).cross(c - a), Vec3::Z);
    let normal = normalize_or(mix(|vertex| vertex.normal.into()), flat);
    if flat.dot(normal) < 0.0 {
        flat = -flat;
    }
    let slanted = mix(|vertex| Vec3::from_slice(&vertex.tangent));
    let tangent = normalize_or(slanted - normal * normal.dot(slanted), perpendicular(normal));
    let bitangent = normal.cross(tangent) * corners[0].tangent[3];

    let wo_world = -direction;
    let view_back = flat.dot(wo_world) < 0.0;
    let mut wo = Vec3::new(tangent.dot(wo_world), bitangent.dot(wo_world), normal.dot(wo_world));
    wo.z = if view_back { wo.z.min(-LEAST_EYE_COS) } else { wo.z.max(LEAST_EYE_COS) };
    wo = wo.normalize();

    let material = &scene.materials[triangle.material as usize];
    let asset = material.asset.map(|asset| {
        let resident = &scene.assets[asset].resident;
        (resident, texel_at(resident.width(), resident.height(), uv * Vec2::from(material.uv_scale)))
    });

    let mut radiance = Vec3::ZERO;
    for light in &scene.lights {
        let to_light = light.position - p;
        let distance2 = to_light.length_squared();
        if distance2 < LEAST_LIGHT_DISTANCE2 {
            continue;
        }
        let wi_world = to_light * (1.0 / distance2.sqrt());
        let wi = Vec3::new(tangent.dot(wi_world), bitangent.dot(wi_world), normal.dot(wi_world));
        let light_back = wi.z < 0.0;
        let mut layer = 0;
        match asset {
            Some((resident, _)) => match resident.layer_for_sides(light_back, view_back) {
                Some(found) => layer = found,
                None => continue,
            },
            None if light_back != view_back => continue,
            None => {}
        }
        let side = if light_back { -1.0 } else { 1.0 };
        let origin = offset_along(lift(p, weights, &corners, side), flat * side);
        let to_light_lifted = light.position - origin;
        let distance = to_light_lifted.length();
        done.rays += 1;
        if distance > 0.0 && trace(origin, to_light_lifted / distance, distance, AnyHit::Yes).primitive != NO_HIT {
            continue;
        }
        let reflected = match asset {
            Some((resident, texel)) => {
                done.evaluations += 1;
                Vec3::from(decode(resident, layer, texel, wi.to_array(), wo.to_array(), options))
            }
            None => Vec3::from(material.diffuse) * wi.z.abs(),
        };
        // The decoded value holds the cosine already.
        radiance += Vec3::from(light.intensity) * reflected / (distance2 * PI);
    }
    (radiance.to_array(), done)
}

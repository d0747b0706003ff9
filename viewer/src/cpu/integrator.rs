//! Follows the path of a pixel's sample from the eye. Twin: `integrator.wgsl`, which goes pass by pass over all pixels
//! where this follows a whole path.

use crate::cpu::direct_light::{LightNumbers, LitPoint};
use crate::cpu::path::{Numbers, Path, PathVertex, roulette};
use crate::cpu::scatter::mirror_direction;
use crate::cpu::shader::{Shader, TexelTap};
use crate::cpu::volumes::AfterVolumes;
use crate::geometry::bvh::{Hit, NO_HIT};
use crate::geometry::surface::Surface;
use crate::options::RenderMode;
use crate::picture::PixelHit;
use crate::scene::material::{Body, Material};
use crate::shading::relief::Relief;
use btf_runtime::ViewedLeaf;
use glam::Vec3;

/// Paths whose radiance counts for less than this in the pixel end at a mirror.
const MIN_THROUGHPUT: f32 = 1e-3;

/// The constant that the shader has too.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] = &[("MIN_THROUGHPUT", MIN_THROUGHPUT)];

impl Shader<'_> {
    /// Returns the radiance that comes along a path's latest ray from beyond everything, but for the sun's.
    pub(crate) fn miss_radiance(&self, path: &Path) -> Vec3 {
        match &self.scene.environment {
            // The rest was drawn from the picture.
            Some(sky) if path.density > 0.0 => {
                sky.radiance(path.direction) * (path.density / (path.density + sky.density(path.direction)))
            }
            Some(sky) => sky.radiance(path.direction),
            None if path.scattered => self.scene.ambient.radiance.into(),
            None => self.scene.background.into(),
        }
    }

    /// Returns the radiance towards the eye through a pixel, and what it took.
    pub(crate) fn path_radiance(&self, pixel: [u32; 2]) -> ([f32; 3], PixelHit) {
        let direction = self.camera.direction(pixel[0], pixel[1], self.jitter);
        let mut path = Path::from_eye(self.camera.eye, direction);
        let mut done = PixelHit { primitive: NO_HIT, rays: 0, evaluations: 0 };
        let mut radiance = Vec3::ZERO;
        for depth in 1..=self.options.depth {
            let vertex = PathVertex { pixel, depth };
            let (hit, sunk) = self.trace_closest(path.origin, path.direction);
            done.rays += 1;
            if depth == 1 {
                done.primitive = hit.primitive;
            }
            if let Some(volumes) = &self.scene.volumes {
                match self.pass_volumes(volumes, &mut path, hit.t, vertex, &mut radiance, &mut done) {
                    AfterVolumes::Passed => {}
                    AfterVolumes::Scattered => continue,
                    AfterVolumes::Ended => break,
                }
            }
            if hit.primitive == NO_HIT {
                radiance += path.throughput * self.miss_radiance(&path);
                // What scattered has met the sun already.
                if let (Some(sun), false) = (&self.scene.sun, path.scattered) {
                    radiance += path.throughput * sun.sun_radiance(path.direction);
                }
                break;
            }
            path.travelled += hit.t;
            let passed = self.air_passed(&path, hit.t);
            if passed != Vec3::ONE {
                radiance += path.throughput * (1.0 - passed) * self.air_radiance(path.direction);
                path.throughput *= passed;
            }
            let (mut s, relief) = self.surface_of(&hit, sunk, path.direction);
            let material = &self.scene.materials[s.material];
            let leaf = self.leaf_at(&s, &hit, &path, vertex);
            radiance += path.throughput * self.surface_light(&mut s, &relief, &leaf, &path, vertex, &mut done);
            let goes_on = match self.options.mode {
                RenderMode::Path => self.scatter_path(&mut path, &s, material, leaf.as_ref(), vertex),
                RenderMode::Direct => mirror_path(&mut path, &s, material),
            };
            if !goes_on {
                break;
            }
        }
        (radiance.to_array(), done)
    }

    /// Returns the level of what a vertex of a path shows.
    fn level_at(&self, s: &Surface, path: &Path, vertex: PathVertex) -> u32 {
        let seed = self.light_seed(vertex, Numbers::Light);
        self.level_of(s, &self.scene.materials[s.material], path.travelled, seed)
    }

    /// Returns the view-dependent half of the leaf that a vertex of a path is on, if it is on one.
    pub(crate) fn leaf_at(&self, s: &Surface, hit: &Hit, path: &Path, vertex: PathVertex) -> Option<ViewedLeaf<'_>> {
        let material = &self.scene.materials[s.material];
        let Body::Leaf(_) = material.body else { return None };
        self.viewed_leaf(s, material, hit, self.level_at(s, path, vertex))
    }

    /// Returns the light that a vertex of a path sends back along its latest ray; the surface then shows the texel that
    /// the path goes on from.
    pub(crate) fn surface_light(
        &self,
        s: &mut Surface,
        relief: &Option<(Relief<'_>, Vec3)>,
        leaf: &Option<ViewedLeaf<'_>>,
        path: &Path,
        vertex: PathVertex,
        done: &mut PixelHit,
    ) -> Vec3 {
        let material = &self.scene.materials[s.material];
        let numbers = LightNumbers {
            ambient_at: self.two_numbers(vertex, Numbers::Ambient),
            sun_at: self.two_numbers(vertex, Numbers::Sun),
            seed: self.light_seed(vertex, Numbers::Light),
        };
        let level = self.level_at(s, path, vertex);
        let drawn = self.texel_numbers(s, path.travelled, vertex);
        let taps = self.texel_taps(material, vertex);
        let mut radiance = Vec3::ZERO;
        for tap in 0..taps {
            let tap = match taps {
                1 => TexelTap { at: drawn, weight: 1.0 },
                _ => self.texel_tap(s, level, tap),
            };
            s.texel_at = tap.at;
            for light_back in [false, true] {
                if let Some(viewed) = &self.viewed_body(s, material, leaf.as_ref(), level, light_back) {
                    let relief = relief.as_ref().map(|(relief, point)| (relief, *point));
                    let width = path.travelled * self.voxel_width();
                    let lit = LitPoint { s, relief, material, viewed, light_back, width, numbers: &numbers };
                    radiance += tap.weight * self.direct_light(&lit, done);
                }
            }
        }
        s.texel_at = drawn;
        radiance
    }

    /// Draws the next ray of a traced path from a surface; `false` where the path ends.
    fn scatter_path(
        &self,
        path: &mut Path,
        s: &Surface,
        material: &Material,
        leaf: Option<&ViewedLeaf>,
        vertex: PathVertex,
    ) -> bool {
        let at = self.two_numbers(vertex, Numbers::Scatter);
        let [choice, kept_at] = self.two_numbers(vertex, Numbers::Choice);
        let Some(next) = self.scatter(s, material, leaf, path.direction, at, choice) else { return false };
        let Some(throughput) = roulette(path.throughput * next.weight, kept_at) else { return false };
        path.throughput = throughput;
        path.scattered |= next.density > 0.0;
        path.density = next.density;
        path.direction = next.direction;
        path.origin = if next.back { s.below } else { s.above };
        true
    }
}

/// Makes the mirrored ray the next one of a path; `false` where there is no mirror or too little is left.
fn mirror_path(path: &mut Path, s: &Surface, material: &Material) -> bool {
    path.throughput *= Vec3::from(material.mirror);
    if path.throughput.max_element() < MIN_THROUGHPUT {
        return false;
    }
    path.direction = mirror_direction(s, path.direction);
    path.origin = if s.view_back { s.below } else { s.above };
    true
}

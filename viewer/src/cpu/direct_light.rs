//! Light that comes to a surface straight from lamps, from the sun and from what surrounds the scene. Twin:
//! `direct_light.wgsl`.

use crate::cpu::scatter::side_share;
use crate::cpu::shader::{FAR, MIN_LIGHT_DISTANCE2, Shader};
use crate::geometry::bvh::{AnyHit, NO_HIT};
use crate::geometry::surface::Surface;
use crate::light::environment::Environment;
use crate::light::irradiance_volume::irradiance_of;
use crate::light::light_grid::{BELOW_ONE, DrawnLight, LIGHT_CANDIDATES};
use crate::light::light_tree::TreeLight;
use crate::options::{RenderMode, SkyLight};
use crate::picture::PixelHit;
use crate::sampler;
use crate::scene::material::Material;
use crate::shading::relief::Relief;
use crate::shading::viewed_body::ViewedBody;
use crate::volume::light::LightRay;
use btf_runtime::LightRows;
use glam::Vec3;
use std::f32::consts::PI;

/// Set apart the numbers that are drawn from a light's seed. Twins of the same names.
pub(crate) const ENVIRONMENT_CHOICE: u32 = 0x68bc_21eb;
pub(crate) const LOBE_CHOICE: u32 = 0x02e5_be93;
pub(crate) const SIDE_CHOICE: u32 = 0x1b87_3593;
pub(crate) const ROULETTE_CHANCE: u32 = 0x2c1b_3c6d;

/// Random numbers for the light at one point.
pub(crate) struct LightNumbers {
    pub ambient_at: [f32; 2],
    pub sun_at: [f32; 2],
    pub seed: u32,
}

/// A point of a surface that light reaches from one side.
pub(crate) struct LitPoint<'a> {
    pub s: &'a Surface,
    /// The displaced surface there, and the point of it that is met.
    pub relief: Option<(&'a Relief<'a>, Vec3)>,
    pub material: &'a Material,
    /// View-dependent half of the shading, for light on this side.
    pub viewed: &'a ViewedBody<'a>,
    /// Whether light comes from the back.
    pub light_back: bool,
    /// Width of voxels for shadow rays.
    pub width: f32,
    pub numbers: &'a LightNumbers,
}

/// Light from one direction.
struct LightSample {
    /// Unit direction to the light, texel frame.
    wi: Vec3,
    /// Irradiance at normal incidence over pi, over the density of the direction where that was drawn: decoded values
    /// hold the cosine.
    incident: Vec3,
    /// Unit direction to the light, world.
    direction: Vec3,
    /// Distance up to which something may be in the way; 0 for none.
    distance: f32,
}

/// Returns the seed of the number by which a ray to one of the light's sources ends early.
pub(crate) fn roulette_seed(seed: u32, source: usize) -> u32 {
    seed ^ ROULETTE_CHANCE.wrapping_mul(source as u32 + 1)
}

impl Shader<'_> {
    /// Draws the light of stratum `stratum` of `strata`, which divide among them what the lights add around the place: of
    /// some candidates spread over the stratum one, as likely as what it could add unshadowed over its probability as a
    /// candidate [Talbot 2005]. Returns the number of the light and the factor on what it adds; `None` where
    /// none could add anything. Where candidates are enough for all lights, the strata divide these in their order.
    fn choose_light(
        &self,
        s: &Surface,
        light_back: bool,
        stratum: usize,
        strata: usize,
        seed: u32,
    ) -> Option<(usize, f32)> {
        let lights = &self.scene.lights;
        let part = 1.0 / (strata * LIGHT_CANDIDATES) as f32;
        let mut drawn = DrawnLight { range: 0, index: 0, weight: lights.len() as f32 };
        if let Some(grid) = self.light_grid {
            drawn.range = grid.range(grid.cell(s.position), (stratum * LIGHT_CANDIDATES) as f32 * part);
        }
        let (mut total, mut kept, mut chosen) = (0.0f32, 0.0f32, 0);
        for k in 0..LIGHT_CANDIDATES {
            let number = stratum * LIGHT_CANDIDATES + k;
            let own = seed.wrapping_add(2 * number as u32);
            let x = ((number as f32 + sampler::one(own)) * part).min(BELOW_ONE);
            let TreeLight { position, power } = match self.light_grid {
                Some(grid) => {
                    drawn = grid.draw(drawn.range, x);
                    grid.ordered()[drawn.index]
                }
                None => {
                    drawn.index = (x * lights.len() as f32) as usize;
                    lights[drawn.index].as_drawn()
                }
            };
            let to_light = position - s.position;
            let nearness = 1.0 / to_light.length_squared().max(MIN_LIGHT_DISTANCE2).sqrt();
            let cosine = s.normal.dot(to_light) * nearness;
            let towards = if light_back { -cosine } else { cosine };
            let could_add = power * towards.max(0.0) * (nearness * nearness);
            total += could_add * drawn.weight;
            if sampler::one(own.wrapping_add(1)) * total < could_add * drawn.weight {
                (chosen, kept) = (drawn.index, could_add);
            }
        }
        let number = self.light_grid.map_or(chosen, |grid| grid.number(chosen));
        (kept > 0.0).then(|| (number, total * part / kept))
    }

    /// Samples point light `i` of `asked`; `None` where it adds nothing.
    fn sample_point_light(&self, lit: &LitPoint, i: usize, asked: usize) -> Option<LightSample> {
        let (s, lights) = (lit.s, &self.scene.lights);
        let (index, scale) = match asked < lights.len() {
            true => self.choose_light(s, lit.light_back, i, asked, lit.numbers.seed)?,
            false => (i, 1.0),
        };
        let light = &lights[index];
        let to_light = light.position - s.position;
        let distance2 = to_light.length_squared();
        if distance2 < MIN_LIGHT_DISTANCE2 {
            return None;
        }
        let wi = s.local_from_world(to_light * (1.0 / distance2.sqrt()));
        if (wi.z < 0.0) != lit.light_back {
            return None;
        }
        // The decoded value holds the cosine already.
        let incident = Vec3::from(light.intensity) * scale / (distance2 * PI);
        let lifted = light.position - lit.origin();
        let distance = lifted.length();
        Some(LightSample { wi, incident, direction: lifted / distance.max(1e-30), distance })
    }

    /// Samples the sun's disc; `None` where the sun is not on this side.
    fn sample_sun_light(&self, lit: &LitPoint) -> Option<LightSample> {
        let sun = self.scene.sun.as_ref()?;
        let direction = sun.sun_sample(lit.numbers.sun_at);
        let wi = lit.s.local_from_world(direction);
        let incident = Vec3::from(sun.irradiance) / PI;
        ((wi.z < 0.0) == lit.light_back).then_some(LightSample { wi, incident, direction, distance: FAR })
    }

    /// Returns the radiance that comes from everywhere alike, if anything does; a sky counts where it lights by its
    /// irradiance.
    fn uniform_light(&self, lit: &LitPoint) -> Vec3 {
        let path = self.options.mode == RenderMode::Path;
        match &self.scene.environment {
            Some(sky) if !path && self.options.sky == SkyLight::Irradiance => {
                sky.irradiance(if lit.light_back { -lit.s.normal } else { lit.s.normal }) / PI
            }
            None if !path => Vec3::from(self.scene.ambient.radiance),
            _ => Vec3::ZERO,
        }
    }

    /// Samples light of the radiance `uniform` from everywhere.
    fn sample_uniform_light(&self, lit: &LitPoint, uniform: Vec3) -> Option<LightSample> {
        // A leaf has two sides and takes them in turn.
        let turns = matches!(lit.viewed, ViewedBody::Leaf(..));
        if turns && (sampler::one(lit.numbers.seed ^ SIDE_CHOICE) < 0.5) != lit.light_back {
            return None;
        }
        let mut wi = sampler::cosine(lit.numbers.ambient_at);
        // The density of wi is its cosine over pi.
        let incident = uniform * if turns { 2.0 } else { 1.0 } / wi.z.max(1e-6);
        wi.z = if lit.light_back { -wi.z } else { wi.z };
        let direction = lit.s.world_from_local(wi);
        Some(LightSample { wi, incident, direction, distance: self.scene.ambient.distance })
    }

    /// Samples the picture that surrounds the scene; `None` where the direction is not on this side.
    fn sample_environment_light(&self, lit: &LitPoint, sky: &Environment) -> Option<LightSample> {
        let (s, viewed, numbers) = (lit.s, lit.viewed, lit.numbers);
        let path = self.options.mode == RenderMode::Path;
        // Drawn from the picture or, where no path goes on to it, from the surface as often. A path meets the picture
        // by itself, but seldom where it is small and bright.
        let wi = if path || sampler::one(numbers.seed ^ ENVIRONMENT_CHOICE) < 0.5 {
            s.local_from_world(sky.sample(numbers.ambient_at))
        } else {
            let [x, y] = numbers.ambient_at;
            viewed.body_sample([x, y, sampler::one(numbers.seed ^ LOBE_CHOICE)], lit.light_back)
        };
        let direction = s.world_from_local(wi);
        let own = viewed.body_density(wi);
        // Balance heuristic [Veach 1995].
        let density = if path {
            sky.density(direction) + side_share(self.scene, s, lit.material, lit.light_back) * own
        } else {
            0.5 * (sky.density(direction) + own)
        };
        let distance = if path { FAR } else { self.scene.ambient.distance };
        ((wi.z < 0.0) == lit.light_back && density > 0.0).then(|| LightSample {
            wi,
            incident: sky.radiance(direction) / (PI * density),
            direction,
            distance,
        })
    }

    /// Samples what surrounds the scene along one ray; `None` where nothing does.
    fn sample_surroundings(&self, lit: &LitPoint) -> Option<LightSample> {
        let uniform = self.uniform_light(lit);
        if uniform.max_element() > 0.0 {
            return self.sample_uniform_light(lit, uniform);
        }
        let by_normal = self.options.mode != RenderMode::Path && self.options.sky == SkyLight::Irradiance;
        self.scene.environment.as_ref().filter(|_| !by_normal).and_then(|sky| self.sample_environment_light(lit, sky))
    }

    /// Samples the light that comes to a surface after one bounce, as if it were the same from everywhere on this side: nothing is in
    /// the way of it. `None` where that is not cached.
    fn sample_bounced_light(&self, lit: &LitPoint) -> Option<LightSample> {
        let light = self.irradiance_volume?.at(lit.s.position);
        let mut wi = sampler::cosine(lit.numbers.ambient_at);
        let irradiance = irradiance_of(&light, if lit.light_back { -lit.s.normal } else { lit.s.normal });
        // The density of wi is its cosine over pi.
        let incident = irradiance / wi.z.max(1e-6);
        wi.z = if lit.light_back { -wi.z } else { wi.z };
        Some(LightSample { wi, incident, direction: lit.s.world_from_local(wi), distance: 0.0 })
    }

    /// Returns the light that a point sends to the eye of what reaches it from one side: of point lights and the sun
    /// with their shadows, then of what surrounds the scene along one ray, then what is cached of one bounce.
    pub(crate) fn direct_light(&self, lit: &LitPoint, done: &mut PixelHit) -> Vec3 {
        let (origin, viewed) = (lit.origin(), lit.viewed);
        // Values without a residual hold no shadows.
        let bare = viewed.is_bare();
        let mut rows = LightRows::default();
        let mut radiance = Vec3::ZERO;
        let asked = self.scene.lights.len().min(self.options.light_samples as usize);
        let lamps = (0..asked).filter_map(|i| Some((i, self.sample_point_light(lit, i, asked)?)));
        let sun = self.sample_sun_light(lit).map(|light| (asked, light));
        let behind_sun = asked + usize::from(self.scene.sun.is_some());
        let around = self.sample_surroundings(lit).into_iter().chain(self.sample_bounced_light(lit));
        for (number, light) in lamps.chain(sun).chain(around.map(|light| (behind_sun, light))) {
            let LightSample { wi, incident, direction, distance } = light;
            done.rays += u32::from(distance > 0.0);
            if distance > 0.0 && self.trace(origin, direction, distance, AnyHit::Yes).primitive != NO_HIT {
                continue;
            }
            if lit.relief.is_some_and(|(relief, point)| !lit.light_back && relief.relief_shadowed(point, wi, bare)) {
                continue;
            }
            let ray = LightRay { origin, direction, t_max: distance, width: lit.width };
            let passed = self.past_volumes(&ray, sampler::one(roulette_seed(lit.numbers.seed, number)));
            if passed <= 0.0 {
                continue;
            }
            done.evaluations += u32::from(viewed.is_evaluated());
            radiance += passed * incident * viewed.body_light(&mut rows, wi);
        }
        radiance
    }
}

impl LitPoint<'_> {
    /// Returns where rays to lights begin.
    fn origin(&self) -> Vec3 {
        if self.light_back { self.s.below } else { self.s.above }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::ShadeOptions;
    use crate::scene::mesh;
    use crate::scene::scene::{PointLight, Scene, SceneObject};
    use glam::Vec2;
    use std::path::Path;
    use std::sync::Arc;

    /// Numbers in [0, 1), by their number.
    fn draw3(number: u32) -> Vec3 {
        Vec3::from([0, 1, 2].map(|axis| sampler::one(3 * number + axis)))
    }

    /// A cube under coloured lights of uneven power, some of them far away.
    fn scene(count: u32) -> Scene {
        let cube = SceneObject { part: mesh::cube("cube"), material: Material::plain([0.5; 3]) };
        let mut scene = Scene::from_objects(Path::new("cube"), vec![cube], Vec::new()).unwrap();
        let light = |number: u32| {
            let scale = if number.is_multiple_of(9) { 40.0 } else { 2.0 };
            let power = if number.is_multiple_of(7) { 10.0 } else { 1.0 };
            let position = (draw3(2 * number) - 0.5) * scale;
            PointLight { position, intensity: (draw3(2 * number + 1) * power).to_array() }
        };
        scene.lights = (0..count).map(light).collect();
        scene
    }

    fn surface(position: Vec3, normal: Vec3) -> Surface {
        let tangent = normal.any_orthonormal_vector();
        Surface {
            position,
            material: 0,
            flat: normal,
            view_back: false,
            tangent,
            bitangent: normal.cross(tangent),
            normal,
            wo: Vec3::Z,
            uv: Vec2::ZERO,
            texel_at: [0.5; 2],
            texture_per_unit: 1.0,
            above: position,
            below: position,
        }
    }

    /// Returns whether the mean of `estimates` may be `expected`, by their standard error.
    fn agrees(estimates: &[f64], expected: f64) -> bool {
        let count = estimates.len() as f64;
        let mean = estimates.iter().sum::<f64>() / count;
        let variance = estimates.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
        (mean - expected).abs() < 5.0 * (variance / count).sqrt() + 1e-3 * expected
    }

    #[test]
    fn drawn_lights_add_what_all_lights_do_wherever_a_surface_is() {
        const DRAWS: u32 = 8000;
        for (count, strata) in [(300, 1), (300, 4), (20, 3), (2000, 16)] {
            let scene = scene(count);
            let options = ShadeOptions { light_samples: strata as u32, ..ShadeOptions::default() };
            let grid = scene.light_grid(options.light_samples, &mut None);
            assert_eq!(grid.is_some(), count as usize > strata * LIGHT_CANDIDATES);
            let shader = Shader { light_grid: grid.as_deref(), ..Shader::of_middles(&scene, [8, 8], options) };
            let near = scene.lights[1].position;
            let inside = (0..6).map(|i| (draw3(5000 + i) - 0.5) * 2.0);
            let outside = (0..3).map(|i| (draw3(6000 + i) - 0.5) * 60.0);
            let places = inside.chain(outside).chain([near + 0.003, near + Vec3::X * 0.02]);
            let (mut scaled, mut uneven) = (0, 0);
            for (number, place) in places.enumerate() {
                let normal = (draw3(7000 + number as u32) - 0.5).normalize();
                let s = surface(place, normal);
                let light_back = number % 2 == 1;
                let red = |light: &PointLight| {
                    let way = light.position - place;
                    let cosine = normal.dot(way) / way.length() * if light_back { -1.0 } else { 1.0 };
                    f64::from(light.intensity[0] * cosine.max(0.0) / way.length_squared())
                };
                let all: f64 = scene.lights.iter().map(red).sum();
                let estimate = |seed: u32| {
                    let chosen = |stratum| shader.choose_light(&s, light_back, stratum, strata, sampler::hash(seed));
                    let chosen = (0..strata).filter_map(chosen);
                    chosen.map(|(light, scale)| f64::from(scale) * red(&scene.lights[light])).sum::<f64>()
                };
                let estimates: Vec<f64> = (0..DRAWS).map(estimate).collect();
                assert!(agrees(&estimates, all), "{count} {strata} {place}");
                // Planted: candidates that are counted one by one, and such as if all lights were as likely.
                let times: Vec<f64> = estimates.iter().map(|x| x * LIGHT_CANDIDATES as f64).collect();
                scaled += usize::from(!agrees(&times, all));
                let as_likely = |grid: &crate::light::light_grid::LightGrid, i: u32| {
                    let index = grid.draw(grid.cell(place), (i as f32 + 0.5) / DRAWS as f32).index;
                    f64::from(count) * red(&scene.lights[grid.number(index)])
                };
                let wrong = |grid: &Arc<_>| (0..DRAWS).map(|i| as_likely(grid, i)).collect::<Vec<f64>>();
                uneven += usize::from(grid.as_ref().is_none_or(|grid| !agrees(&wrong(grid), all)));
            }
            assert!(scaled == 11 && uneven >= 8, "{count} {strata}: {scaled} {uneven}");
        }
    }
}

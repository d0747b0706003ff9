//! Light that comes to a surface straight from lamps, from the sun and from what surrounds the scene. Twin:
//! `direct_light.wgsl`.

use crate::cpu::scatter::side_share;
use crate::cpu::shader::{FAR, MIN_LIGHT_DISTANCE2, Shader};
use crate::geometry::bvh::{AnyHit, NO_HIT};
use crate::geometry::surface::Surface;
use crate::light::environment::Environment;
use crate::options::{RenderMode, SkyLight};
use crate::picture::PixelHit;
use crate::sampler;
use crate::scene::material::Material;
use crate::shading::relief::Relief;
use crate::shading::viewed_body::ViewedBody;
use btf_runtime::LightRows;
use glam::Vec3;
use std::f32::consts::PI;

/// Set apart the numbers that are drawn from a light's seed. Twins of the same names.
pub(crate) const ENVIRONMENT_CHOICE: u32 = 0x68bc_21eb;
pub(crate) const LOBE_CHOICE: u32 = 0x02e5_be93;
pub(crate) const SIDE_CHOICE: u32 = 0x1b87_3593;
/// Lights that are looked at for each that is drawn. Twin: `LIGHT_CANDIDATES`.
pub(crate) const LIGHT_CANDIDATES: usize = 8;

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

impl Shader<'_> {
    /// Draws the light of stratum `stratum` of `strata`, which divide the lights in their order among them: of some
    /// candidates spread over the stratum one, as likely as what it could add unshadowed [Talbot 2005]. Returns the
    /// number of the light and how many lights' share it stands for; `None` where none could add anything.
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

    /// Returns the light that a point sends to the eye of what reaches it from one side: of point lights and the sun
    /// with their shadows, then of what surrounds the scene along one ray.
    pub(crate) fn direct_light(&self, lit: &LitPoint, done: &mut PixelHit) -> Vec3 {
        let (origin, viewed) = (lit.origin(), lit.viewed);
        // Values without a residual hold no shadows.
        let bare = viewed.is_bare();
        let mut rows = LightRows::default();
        let mut radiance = Vec3::ZERO;
        let asked = self.scene.lights.len().min(self.options.light_samples as usize);
        let lamps = (0..asked).filter_map(|i| self.sample_point_light(lit, i, asked));
        for light in lamps.chain(self.sample_sun_light(lit)).chain(self.sample_surroundings(lit)) {
            let LightSample { wi, incident, direction, distance } = light;
            done.rays += 1;
            if distance > 0.0 && self.trace(origin, direction, distance, AnyHit::Yes).primitive != NO_HIT {
                continue;
            }
            if lit.relief.is_some_and(|(relief, point)| !lit.light_back && relief.relief_shadowed(point, wi, bare)) {
                continue;
            }
            let passed = self.past_volumes(origin, direction, distance, lit.width);
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

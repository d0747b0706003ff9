//! Models that are lit: the light of what a ray past a model meets.

use crate::build::sggx_correction::GlossyMicroflake;
use crate::model::microflakes::{MicroflakeColour, luminance};
use crate::rays::occluder::{Met, Occluder};
use btf_runtime::voltex::{Sym3, gloss};
use glam::Vec3;

/// A model that is lit. Light is luminance; 1 is a white surface lit along its normal.
pub trait Lit: Sync {
    /// Returns the luminance of the reflectance and of the transmittance, and the unit normal, of a triangle.
    fn surface(&self, triangle: usize) -> ([f32; 2], Vec3);

    /// Returns the light that a triangle sends to `eye` from `light`, unit vectors towards them, with its specular lobe
    /// and without shadow.
    fn light(&self, triangle: usize, eye: Vec3, light: Vec3) -> f32;

    /// Returns all triangles with a specular lobe.
    fn glossy_microflakes(&self) -> Vec<GlossyMicroflake>;
}

/// Returns the light of a surface that sends light on evenly, of which it reflects and transmits these shares.
fn even_light(([reflectance, transmittance], normal): ([f32; 2], Vec3), eye: Vec3, light: Vec3) -> f32 {
    let shone = normal.dot(light);
    if normal.dot(eye) * shone > 0.0 { reflectance * shone.abs() } else { transmittance * shone.abs() }
}

/// Returns the light of a surface of one colour.
pub(crate) fn coloured_light(colour: &MicroflakeColour, normal: Vec3, eye: Vec3, light: Vec3) -> f32 {
    let shares = [colour.reflectance, colour.transmittance].map(luminance);
    let even = even_light((shares, normal), eye, light);
    let seen = normal.dot(eye);
    if colour.specular <= 0.0 || seen * normal.dot(light) <= 0.0 {
        return even;
    }
    let own = Sym3::outer(normal.into(), 1.0);
    even + gloss(&own, colour.specular, colour.roughness, eye.into(), light.into()) / seen.abs()
}

/// Returns the light of the model along a ray, lit from `light`.
pub fn model_light(occluder: &Occluder, lit: &impl Lit, origin: Vec3, direction: Vec3, light: Vec3) -> f32 {
    let met = occluder.trace(origin, direction, 4.0);
    met.map_or(0.0, |met| met_light(occluder, lit, &met, origin, direction, light))
}

/// Returns the light of the triangle that a ray has met, lit from `light`.
pub(crate) fn met_light(
    occluder: &Occluder,
    lit: &impl Lit,
    met: &Met,
    origin: Vec3,
    direction: Vec3,
    light: Vec3,
) -> f32 {
    let value = lit.light(met.triangle, -direction, light);
    let (_, normal) = lit.surface(met.triangle);
    if value > 0.0 && is_reached(occluder, origin + direction * met.t, normal, light) { value } else { 0.0 }
}

/// Returns the same without specular lobes and as if every surface sent light on evenly.
pub(crate) fn even_light_along(occluder: &Occluder, lit: &impl Lit, origin: Vec3, direction: Vec3, light: Vec3) -> f32 {
    let Some(met) = occluder.trace(origin, direction, 4.0) else { return 0.0 };
    let surface = lit.surface(met.triangle);
    let value = even_light(surface, -direction, light);
    if value > 0.0 && is_reached(occluder, origin + direction * met.t, surface.1, light) { value } else { 0.0 }
}

/// Tells whether light reaches a place of a surface.
fn is_reached(occluder: &Occluder, place: Vec3, normal: Vec3, light: Vec3) -> bool {
    let lifted = place + normal * (normal.dot(light).signum() * 1e-5);
    !occluder.occluded(lifted, light, 4.0)
}

//! Reflectance of a glTF 2.0 material: the metallic-roughness model as appendix B of the specification defines it, with
//! KHR_materials_specular, KHR_materials_sheen and KHR_materials_diffuse_transmission.

use std::f32::consts::PI;

/// Reflectance of a dielectric of index 1.5 at normal incidence.
pub const DIELECTRIC_F0: f32 = 0.04;
/// Least cosine and roughness that the model divides by, as renderers have them.
const MIN_COS: f32 = 1e-3;
/// Least alpha: a mirror's highlight falls between all measured pairs.
const MIN_ALPHA: f32 = 1e-3;

/// A texel of a material; colours are linear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GltfTexel {
    /// Base colour, 0 to 1.
    pub base_colour: [f32; 3],
    /// Metalness: 0 for a dielectric, 1 for a metal.
    pub metallic: f32,
    /// Perceptual roughness, 0 to 1; alpha is its square.
    pub roughness: f32,
    /// Unit normal in the tangent frame.
    pub normal: [f32; 3],
    /// Strength of the dielectric's specular lobe, 0 to 1.
    pub specular: f32,
    /// Colour of the dielectric's specular lobe at normal incidence, in units of a plain dielectric's 0.04; 0 to 25.
    pub specular_colour: [f32; 3],
    /// Colour of the sheen, 0 to 1.
    pub sheen_colour: [f32; 3],
    /// Share of the diffuse light that comes out at the other side, 0 to 1.
    pub transmission: f32,
    /// Colour of the transmitted light, 0 to 1.
    pub transmission_colour: [f32; 3],
}

impl GltfTexel {
    /// Texel of a material without textures and extensions: white, rough, flat.
    pub const PLAIN: GltfTexel = GltfTexel {
        base_colour: [1.0; 3],
        metallic: 0.0,
        roughness: 1.0,
        normal: [0.0, 0.0, 1.0],
        specular: 1.0,
        specular_colour: [1.0; 3],
        sheen_colour: [0.0; 3],
        transmission: 0.0,
        transmission_colour: [1.0; 3],
    };

    /// Returns the reflectance of the dielectric's specular lobe at normal incidence and at grazing incidence.
    fn dielectric_fresnel(&self) -> ([f32; 3], f32) {
        (self.specular_colour.map(|x| self.specular * (DIELECTRIC_F0 * x).min(1.0)), self.specular)
    }

    /// Returns `pi * BRDF * cosine` for light and eye at unit vectors in the tangent frame, on the front. With `sheen`,
    /// a sheen of that roughness lies on the surface.
    pub fn reflected(&self, sheen: Option<&Sheen>, wi: [f32; 3], wo: [f32; 3]) -> [f32; 3] {
        let half = half_vector(wi, wo);
        let cos = Cosines::new(self.normal, wi, wo, half);
        let grazing = schlick(dot(wo, half));
        let gloss = cos.light * ggx(self.roughness, &cos);
        let (f0, f90) = self.dielectric_fresnel();
        let most = f0.into_iter().fold(0.0, f32::max);
        let kept = 1.0 - (most + (f90 - most) * grazing);
        let fuzz = sheen.map_or(0.0, |sheen| cos.light * sheen.value(&cos));
        let top = self.sheen_colour.into_iter().fold(0.0, f32::max);
        let below = sheen.map_or(1.0, |sheen| 1.0 - top * sheen.albedo_seen(&cos));
        [0, 1, 2].map(|c| {
            let diffuse = (1.0 - self.transmission) * self.base_colour[c] * cos.light;
            let dielectric = kept * diffuse + (f0[c] + (f90 - f0[c]) * grazing) * gloss;
            let metal = (self.base_colour[c] + (1.0 - self.base_colour[c]) * grazing) * gloss;
            let base = dielectric + (metal - dielectric) * self.metallic;
            self.sheen_colour[c] * fuzz + base * below
        })
    }

    /// Returns `pi * BTDF * cosine` for a light on the other side than the eye, whose cosine with the normal is
    /// `cos_light`. The layers above the diffuse one are left out, since the specification does not say what of them a
    /// transmitted ray meets.
    pub fn transmitted(&self, cos_light: f32) -> [f32; 3] {
        self.transmission_colour.map(|x| (1.0 - self.metallic) * self.transmission * x * cos_light)
    }
}

/// Cosines between the normal and light, eye and the vector halfway between them; those of light and eye at least 0.
#[derive(Debug, Clone, Copy)]
pub struct Cosines {
    /// Cosine between normal and light.
    pub light: f32,
    /// Cosine between normal and eye.
    pub eye: f32,
    /// Cosine between normal and half vector.
    pub half: f32,
}

impl Cosines {
    /// Returns the cosines of unit vectors.
    #[inline(always)]
    pub fn new(normal: [f32; 3], wi: [f32; 3], wo: [f32; 3], half: [f32; 3]) -> Cosines {
        Cosines { light: dot(normal, wi).max(0.0), eye: dot(normal, wo).max(0.0), half: dot(normal, half).max(0.0) }
    }
}

/// Returns `(1 - cos)^5`, the term of Schlick's approximation of Fresnel reflectance.
#[inline(always)]
pub fn schlick(cos_half: f32) -> f32 {
    let x = 1.0 - cos_half.clamp(0.0, 1.0);
    x * x * x * x * x
}

/// Returns `pi D V` of GGX with Smith's separable shadowing.
#[inline(always)]
pub fn ggx(roughness: f32, cos: &Cosines) -> f32 {
    let alpha = (roughness * roughness).max(MIN_ALPHA);
    let alpha2 = alpha * alpha;
    let fall = cos.half * cos.half * (alpha2 - 1.0) + 1.0;
    let shadow = |cos: f32| cos.max(MIN_COS) + (alpha2 + (1.0 - alpha2) * cos * cos).sqrt();
    // Where the normal turns away from the light the cosine outside is 0.
    alpha2 / (fall * fall * shadow(cos.light) * shadow(cos.eye))
}

/// Returns the vector halfway between two unit vectors.
pub fn half_vector(wi: [f32; 3], wo: [f32; 3]) -> [f32; 3] {
    let sum = [0, 1, 2].map(|i| wi[i] + wo[i]);
    let length = dot(sum, sum).sqrt().max(1e-6);
    sum.map(|x| x / length)
}

/// Returns the scalar product.
#[inline(always)]
pub fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Entries of a sheen's tables, for cosines from 0 to 1.
const TABLE: usize = 257;
/// Entries of a sheen's albedo table, a smooth function.
const ALBEDOS: usize = 33;
/// Steps per angle of the sums that make the albedo.
const ALBEDO_STEPS: usize = 48;

/// A sheen of one roughness: the "Charlie" distribution with its own shadowing [Kulla 2017], in tables.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheen {
    /// Sheen roughness, 0 to 1.
    pub roughness: f32,
    /// Table of `pi D` over the half vector's squared sine.
    distribution: Vec<f32>,
    /// Table of the shadowing's lambda over the cosine of light or eye.
    lambda: Vec<f32>,
    /// Table of the directional albedo over the cosine.
    albedo: Vec<f32>,
}

impl Sheen {
    /// Tabulates the sheen of a roughness. Cost: some 10^5 evaluations for the albedo.
    pub fn new(roughness: f32) -> Sheen {
        let alpha = (roughness * roughness).max(MIN_ALPHA);
        let mut sheen = Sheen {
            roughness,
            distribution: table(TABLE, |sin2| charlie(alpha, sin2)),
            lambda: table(TABLE, |cos| charlie_lambda(alpha, cos)),
            albedo: Vec::new(),
        };
        sheen.albedo = table(ALBEDOS, |cos| {
            let cos_eye = cos.max(MIN_COS);
            let wo = [(1.0 - cos_eye * cos_eye).max(0.0).sqrt(), 0.0, cos_eye];
            let mut sum = 0.0;
            for row in 0..ALBEDO_STEPS {
                // Even steps of the squared sine are even steps of the projected solid angle, pi in all.
                let sin2 = (row as f32 + 0.5) / ALBEDO_STEPS as f32;
                for column in 0..ALBEDO_STEPS {
                    let (sin, cos) = ((column as f32 + 0.5) / ALBEDO_STEPS as f32 * PI).sin_cos();
                    let wi = [sin2.sqrt() * cos, sin2.sqrt() * sin, (1.0 - sin2).sqrt()];
                    sum += sheen.value(&Cosines::new([0.0, 0.0, 1.0], wi, wo, half_vector(wi, wo)));
                }
            }
            (sum / (ALBEDO_STEPS * ALBEDO_STEPS) as f32).min(1.0)
        });
        sheen
    }

    /// Returns `pi D V` of a white sheen.
    #[inline(always)]
    pub fn value(&self, cos: &Cosines) -> f32 {
        let (light, eye) = (cos.light.max(MIN_COS), cos.eye.max(MIN_COS));
        let shadowed = 1.0 + looked_up(&self.lambda, light) + looked_up(&self.lambda, eye);
        looked_up(&self.distribution, 1.0 - cos.half * cos.half) / (shadowed * 4.0 * light * eye)
    }

    /// Returns the share of the light that the sheen takes from the layers below: the greater of the sheen's albedos
    /// towards light and eye.
    #[inline(always)]
    pub fn albedo_seen(&self, cos: &Cosines) -> f32 {
        looked_up(&self.albedo, cos.light).max(looked_up(&self.albedo, cos.eye))
    }
}

/// Returns `pi D` of the distribution by the squared sine between normal and half vector.
fn charlie(alpha: f32, sin2: f32) -> f32 {
    (2.0 + 1.0 / alpha) * sin2.powf(0.5 / alpha) / 2.0
}

/// Returns the shadowing of the distribution, a fit of [Kulla 2017].
fn charlie_lambda(alpha: f32, cos: f32) -> f32 {
    let part = (1.0 - alpha) * (1.0 - alpha);
    let mix = |x: f32, y: f32| x + (y - x) * part;
    let (a, b, c) = (mix(21.5473, 25.3245), mix(3.82987, 3.32435), mix(0.19823, 0.16801));
    let (d, e) = (mix(-1.97760, -1.27393), mix(-4.32054, -4.85967));
    let curve = |x: f32| a / (1.0 + b * x.powf(c)) + d * x + e;
    if cos < 0.5 { curve(cos).exp() } else { (2.0 * curve(0.5) - curve(1.0 - cos)).exp() }
}

/// Returns the values of a function at even steps of its argument's square root, because the functions change most near
/// 0.
fn table(entries: usize, of: impl Fn(f32) -> f32) -> Vec<f32> {
    (0..entries).map(|i| (i as f32 / (entries - 1) as f32).powi(2)).map(of).collect()
}

#[inline(always)]
fn looked_up(table: &[f32], x: f32) -> f32 {
    let place = x.clamp(0.0, 1.0).sqrt() * (table.len() - 1) as f32;
    let below = (place as usize).min(table.len() - 2);
    table[below] + (table[below + 1] - table[below]) * (place - below as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_runtime::testing::{Random, direction_from_degrees};

    /// Returns the mean of `value` over light directions that are even in projected solid angle: the directional
    /// albedo.
    fn albedo(value: impl Fn([f32; 3]) -> f32) -> f32 {
        let steps = 200;
        let mut sum = 0.0;
        for row in 0..steps {
            let sin2 = (row as f32 + 0.5) / steps as f32;
            for column in 0..steps {
                let (sin, cos) = ((column as f32 + 0.5) / steps as f32 * 2.0 * PI).sin_cos();
                let wi = [sin2.sqrt() * cos, sin2.sqrt() * sin, (1.0 - sin2).sqrt()];
                sum += value(wi) / wi[2];
            }
        }
        sum / (steps * steps) as f32
    }

    #[test]
    fn a_diffuse_dielectric_keeps_what_its_gloss_leaves() {
        let diffuse = GltfTexel { specular: 0.0, base_colour: [0.3, 0.5, 0.7], ..GltfTexel::PLAIN };
        let wi = direction_from_degrees(60.0, 10.0);
        let value = diffuse.reflected(None, wi, direction_from_degrees(20.0, 200.0));
        (0..3).for_each(|c| assert!((value[c] - diffuse.base_colour[c] * 0.5).abs() < 1e-6, "{value:?}"));
        // Gloss at its mirror direction, by hand: D = 1 / (pi alpha^2), V = 1 / 4 and F = 0.04 at normal incidence.
        let gloss = GltfTexel { base_colour: [0.0; 3], roughness: 0.5, ..GltfTexel::PLAIN };
        let up = [0.0, 0.0, 1.0];
        assert!((gloss.reflected(None, up, up)[0] - 0.04 / (4.0 * 0.0625)).abs() < 1e-4);
        assert_eq!(GltfTexel { metallic: 1.0, ..gloss }.reflected(None, up, up), [0.0; 3]);
    }

    #[test]
    fn no_material_reflects_more_than_comes_in_and_white_metal_loses_to_shadowing_alone() {
        let wo = direction_from_degrees(50.0, 0.0);
        for roughness in [0.4, 0.7, 1.0] {
            let metal = GltfTexel { metallic: 1.0, roughness, ..GltfTexel::PLAIN };
            let whole = albedo(|wi| metal.reflected(None, wi, wo)[0]);
            assert!(whole < 1.01 && whole > 0.3, "{roughness}: {whole}");
            let sheen = Sheen::new(roughness);
            let fuzzy = GltfTexel { base_colour: [0.0; 3], specular: 0.0, sheen_colour: [1.0; 3], ..GltfTexel::PLAIN };
            let own = albedo(|wi| fuzzy.reflected(Some(&sheen), wi, wo)[0]);
            let told = sheen.albedo_seen(&Cosines { light: 1.0, eye: wo[2], half: 1.0 });
            assert!((own - told).abs() < 0.02, "{roughness}: {own} {told}");
            let layered = GltfTexel { sheen_colour: [1.0; 3], ..GltfTexel::PLAIN };
            assert!(albedo(|wi| layered.reflected(Some(&sheen), wi, wo)[0]) < 1.01, "{roughness}");
        }
    }

    #[test]
    fn the_tables_of_a_sheen_are_its_functions() {
        for roughness in [0.3, 0.5, 1.0f32] {
            let (sheen, alpha) = (Sheen::new(roughness), roughness * roughness);
            for i in 0..1000 {
                let cos = (0.01 + i as f32 * 0.99 / 999.0).min(1.0);
                let pairs = [
                    (looked_up(&sheen.distribution, cos), charlie(alpha, cos)),
                    (looked_up(&sheen.lambda, cos), charlie_lambda(alpha, cos)),
                ];
                for (fast, slow) in pairs {
                    assert!((fast - slow).abs() <= 1e-2 * (slow + 0.05), "{roughness} {cos}: {fast} {slow}");
                }
            }
            let planted = charlie(0.9 * alpha, 0.3) - charlie(alpha, 0.3);
            assert!(planted.abs() > 1e-2 * (charlie(alpha, 0.3) + 0.05), "{roughness}: {planted}");
        }
    }

    #[test]
    fn gloss_is_reciprocal_and_turns_with_its_normal() {
        let mut random = Random::new(4);
        let sheen = Sheen::new(0.5);
        let texel = GltfTexel { base_colour: [0.2; 3], roughness: 0.4, sheen_colour: [0.3; 3], ..GltfTexel::PLAIN };
        let mut differs = 0;
        for _ in 0..200 {
            let (wi, wo) = (random.direction(), random.direction());
            let there = texel.reflected(Some(&sheen), wi, wo)[0] / wi[2];
            let back = texel.reflected(Some(&sheen), wo, wi)[0] / wo[2];
            assert!((there - back).abs() <= 2e-3 * there, "{there} {back}");
            // Normal and directions turned about x by 20 degrees, where both stay in front.
            let (sin, cos) = 20f32.to_radians().sin_cos();
            let turn = |[x, y, z]: [f32; 3]| [x, cos * y - sin * z, sin * y + cos * z];
            let turned = GltfTexel { normal: turn([0.0, 0.0, 1.0]), ..texel };
            let again = turned.reflected(Some(&sheen), turn(wi), turn(wo))[0] / wi[2];
            assert!((there - again).abs() <= 2e-3 * there, "{there} {again}");
            differs += u32::from((texel.reflected(Some(&sheen), turn(wi), turn(wo))[0] / wi[2] - there).abs() > 0.01);
        }
        assert!(differs > 100, "the planted flat normal must not agree: {differs}");
    }
}

//! Reflectance of OpenPBR Surface 1.1 as MaterialX 1.39 evaluates it: a rough diffuse base under a glossy interface with
//! anisotropy, under a coat with a normal of its own, under fuzz [OpenPBR 2025].
//!
//! Metal, transmission, thin films and what shines by itself are left out. Shading normals are not turned where they face
//! away from the eye, which the specification does not ask for.

use crate::export::openpbr::real::Real;
use std::f32::consts::{FRAC_1_PI, PI};

/// Reflectance of the coat at normal incidence, that of its index [`COAT_IOR`].
const COAT_F0: f32 = 0.04;
/// Index of refraction of the coat.
pub const COAT_IOR: f32 = 1.5;
/// Index of refraction that the document gives to the base: far enough from the coat's that weights stay below about 9.
pub const SPECULAR_IOR: f32 = 3.0;
/// Least cosine that the model divides by, as MaterialX has it.
const MIN_COS: f32 = 1e-6;
/// Least width of a lobe: a mirror's highlight falls between all measured pairs.
const MIN_ALPHA: f32 = 1e-3;

/// Number of a texel's parameters.
pub const PARAMETERS: usize = 27;

/// A texel of a material; colours are linear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpenPbrTexel {
    /// `base_color`, 0 to 1.
    pub base_colour: [f32; 3],
    /// `base_diffuse_roughness`, 0 to 1.
    pub diffuse_roughness: f32,
    /// x and y of the unit vector `geometry_normal` in the tangent frame.
    pub normal: [f32; 2],
    /// `specular_roughness`, 0 to 1.
    pub roughness: f32,
    /// `specular_roughness_anisotropy` times cosine and sine of twice the angle from the tangent to the highlight's long
    /// axis; a vector that a texture can filter.
    pub anisotropy: [f32; 2],
    /// Reflectance of the base at normal incidence without its tint, 0 to 1: `specular_weight` times what the indices say.
    pub f0: f32,
    /// `specular_color`, 0 to 1.
    pub specular_colour: [f32; 3],
    /// `coat_weight`, 0 to 1.
    pub coat: f32,
    /// `coat_color`, 0 to 1.
    pub coat_colour: [f32; 3],
    /// x and y of the unit vector `geometry_coat_normal`.
    pub coat_normal: [f32; 2],
    /// `coat_roughness`, 0 to 1.
    pub coat_roughness: f32,
    /// `coat_roughness_anisotropy`, as `anisotropy` has it.
    pub coat_anisotropy: [f32; 2],
    /// `fuzz_weight`, 0 to 1.
    pub fuzz: f32,
    /// `fuzz_color`, 0 to 1.
    pub fuzz_colour: [f32; 3],
    /// `fuzz_roughness`, 0 to 1.
    pub fuzz_roughness: f32,
}

impl OpenPbrTexel {
    /// Texel that is white, rough, flat and has neither coat nor fuzz.
    pub const PLAIN: OpenPbrTexel = OpenPbrTexel {
        base_colour: [1.0; 3],
        diffuse_roughness: 0.0,
        normal: [0.0; 2],
        roughness: 1.0,
        anisotropy: [0.0; 2],
        f0: 0.04,
        specular_colour: [1.0; 3],
        coat: 0.0,
        coat_colour: [1.0; 3],
        coat_normal: [0.0; 2],
        coat_roughness: 0.5,
        coat_anisotropy: [0.0; 2],
        fuzz: 0.0,
        fuzz_colour: [1.0; 3],
        fuzz_roughness: 0.5,
    };

    /// Returns the parameters in the order of the fields.
    pub fn to_parameters(self) -> [f32; PARAMETERS] {
        let t = self;
        let ([r, g, b], [sr, sg, sb]) = (t.base_colour, t.specular_colour);
        let ([cr, cg, cb], [fr, fg, fb]) = (t.coat_colour, t.fuzz_colour);
        let ([nx, ny], [ax, ay]) = (t.normal, t.anisotropy);
        let ([cx, cy], [ux, uy]) = (t.coat_normal, t.coat_anisotropy);
        [
            r,
            g,
            b,
            t.diffuse_roughness,
            nx,
            ny,
            t.roughness,
            ax,
            ay,
            t.f0,
            sr,
            sg,
            sb,
            t.coat,
            cr,
            cg,
            cb,
            cx,
            cy,
            t.coat_roughness,
            ux,
            uy,
            t.fuzz,
            fr,
            fg,
            fb,
            t.fuzz_roughness,
        ]
    }

    /// Returns the texel of parameters.
    pub fn from_parameters(p: &[f32; PARAMETERS]) -> OpenPbrTexel {
        OpenPbrTexel {
            base_colour: [p[0], p[1], p[2]],
            diffuse_roughness: p[3],
            normal: [p[4], p[5]],
            roughness: p[6],
            anisotropy: [p[7], p[8]],
            f0: p[9],
            specular_colour: [p[10], p[11], p[12]],
            coat: p[13],
            coat_colour: [p[14], p[15], p[16]],
            coat_normal: [p[17], p[18]],
            coat_roughness: p[19],
            coat_anisotropy: [p[20], p[21]],
            fuzz: p[22],
            fuzz_colour: [p[23], p[24], p[25]],
            fuzz_roughness: p[26],
        }
    }

    /// Returns `pi * BRDF * cosine` for light and eye at unit vectors in the tangent frame, on the front.
    pub fn reflected(&self, wi: [f32; 3], wo: [f32; 3]) -> [f32; 3] {
        let pair = Pair::new(wi, wo);
        let base = BaseLobe::new(self).at(&pair);
        let coat = CoatLobe::new(self).at(&pair);
        let fuzz = FuzzLobe::new(self).at(&pair);
        [0, 1, 2].map(|c| self.layered(c, &base, &coat, &fuzz))
    }

    /// Returns what the layers reflect in channel `c`.
    #[inline(always)]
    pub fn layered<R: Real>(&self, c: usize, base: &BaseValues<R>, coat: &CoatValues<R>, fuzz: &FuzzValues<R>) -> R {
        let tint = 1.0 + (self.coat_colour[c] - 1.0) * self.coat;
        let diffuse = diffuse_of(self.base_colour[c], base);
        let below = R::of(self.specular_colour[c]) * base.gloss + base.kept * diffuse;
        let coated = coat.gloss + coat.kept * R::of(tint) * below;
        R::of(self.fuzz_colour[c]) * fuzz.value + fuzz.kept * coated
    }
}

/// Returns what the diffuse base reflects with a colour.
#[inline(always)]
fn diffuse_of<R: Real>(colour: f32, base: &BaseValues<R>) -> R {
    let multiple = colour * colour * base.mean_albedo / (1.0 - colour * (1.0 - base.mean_albedo));
    R::of(colour) * base.single + R::of(multiple) * base.multiple
}

/// A pair of directions, or several side by side.
#[derive(Debug, Clone, Copy)]
pub struct Pair<R> {
    /// Unit vector to the light.
    pub wi: [R; 3],
    /// Unit vector to the eye.
    pub wo: [R; 3],
    /// Unit vector halfway between.
    half: [R; 3],
    /// Cosine between eye and half vector.
    cos_half: R,
    /// Cosine between light and eye, at least 0.
    cos_between: R,
}

impl<R: Real> Pair<R> {
    /// Takes two unit vectors.
    pub fn new(wi: [R; 3], wo: [R; 3]) -> Pair<R> {
        let sum = [0, 1, 2].map(|i| wi[i] + wo[i]);
        let length = dot(sum, sum).root().at_least(R::of(MIN_COS));
        let half = sum.map(|x| x / length);
        Pair {
            wi,
            wo,
            half,
            cos_half: dot(wo, half).within(MIN_COS, 1.0),
            cos_between: dot(wi, wo).within(MIN_COS, 1.0),
        }
    }
}

/// What the base has at a pair.
#[derive(Debug, Clone, Copy)]
pub struct BaseValues<R> {
    /// Gloss without its tint.
    pub gloss: R,
    /// Share of the light that the gloss leaves to the diffuse base.
    pub kept: R,
    /// Factor of the diffuse colour: light that is scattered once.
    pub single: R,
    /// Factor of the light that is scattered more than once.
    pub multiple: R,
    /// Mean albedo of what is scattered once.
    pub mean_albedo: f32,
}

/// What the coat has at a pair.
#[derive(Debug, Clone, Copy)]
pub struct CoatValues<R> {
    /// Gloss, with its weight.
    pub gloss: R,
    /// Share of the light that it leaves to the base.
    pub kept: R,
}

/// What the fuzz has at a pair.
#[derive(Debug, Clone, Copy)]
pub struct FuzzValues<R> {
    /// Reflected by white fuzz, with its weight.
    pub value: R,
    /// Share of the light that it leaves to what is below.
    pub kept: R,
}

/// The base of a texel: diffuse and glossy.
pub struct BaseLobe {
    gloss: Gloss,
    diffuse: RoughDiffuse,
}

impl BaseLobe {
    /// Prepares the base of a texel, as rough as it is seen through the coat.
    pub fn new(texel: &OpenPbrTexel) -> BaseLobe {
        let roughness = seen_roughness(texel.roughness, texel.coat_roughness, texel.coat);
        BaseLobe {
            gloss: Gloss::new(texel.normal, roughness, texel.anisotropy, texel.f0),
            diffuse: RoughDiffuse::new(texel.diffuse_roughness),
        }
    }

    /// Evaluates it at a pair.
    #[inline(always)]
    pub fn at<R: Real>(&self, pair: &Pair<R>) -> BaseValues<R> {
        let (gloss, kept, light, eye) = self.gloss.at(pair);
        let (single, multiple) = self.diffuse.at(light, eye, pair.cos_between);
        BaseValues { gloss, kept, single, multiple, mean_albedo: self.diffuse.mean_albedo }
    }
}

/// The coat of a texel.
pub struct CoatLobe {
    gloss: Gloss,
    weight: f32,
}

impl CoatLobe {
    /// Prepares the coat of a texel.
    pub fn new(texel: &OpenPbrTexel) -> CoatLobe {
        let gloss = Gloss::new(texel.coat_normal, texel.coat_roughness, texel.coat_anisotropy, COAT_F0);
        CoatLobe { gloss, weight: texel.coat }
    }

    /// Evaluates it at a pair.
    #[inline(always)]
    pub fn at<R: Real>(&self, pair: &Pair<R>) -> CoatValues<R> {
        let (gloss, kept, ..) = self.gloss.at(pair);
        let (one, weight) = (R::of(1.0), R::of(self.weight));
        CoatValues { gloss: gloss * weight, kept: one - (one - kept) * weight }
    }
}

/// Returns the roughness of a base that is seen through a coat [OpenPBR 2025, "Roughening"].
fn seen_roughness(roughness: f32, coat_roughness: f32, coat: f32) -> f32 {
    let fourth = |x: f32| x * x * x * x;
    let seen = (fourth(roughness) + 2.0 * fourth(coat_roughness)).min(1.0).sqrt().sqrt();
    roughness + (seen - roughness) * coat
}

/// A lobe of GGX with the Fresnel term of a dielectric, height-correlated shadowing by the mean width, and the light that
/// is reflected between facets [Turquin 2019].
struct Gloss {
    normal: [f32; 3],
    /// Tangent and bitangent over the lobe's widths.
    x: [f32; 3],
    y: [f32; 3],
    /// Squared mean width of the lobe.
    alpha2: f32,
    f0: f32,
    /// Squared index of refraction.
    eta2: f32,
    albedo: AlbedoOfGgx,
}

impl Gloss {
    fn new(normal_xy: [f32; 2], roughness: f32, anisotropy: [f32; 2], f0: f32) -> Gloss {
        let normal = unit_normal(normal_xy);
        let long = anisotropy[0].hypot(anisotropy[1]);
        let (alpha_x, alpha_y) = widths(roughness, long);
        let angle = 0.5 * anisotropy[1].atan2(anisotropy[0]);
        let (sin, cos) = angle.sin_cos();
        let along = cos * normal[0] + sin * normal[1];
        let tangent = [cos - along * normal[0], sin - along * normal[1], -along * normal[2]];
        let length = dot(tangent, tangent).sqrt().max(MIN_COS);
        let tangent = tangent.map(|x| x / length);
        let bitangent = cross(normal, tangent);
        let alpha = (alpha_x * alpha_y).sqrt();
        let root = f0.clamp(0.0, 0.99).sqrt();
        let eta = (1.0 + root) / (1.0 - root);
        Gloss {
            normal,
            x: tangent.map(|x| x / alpha_x),
            y: bitangent.map(|x| x / alpha_y),
            alpha2: alpha * alpha,
            f0,
            eta2: eta * eta,
            albedo: AlbedoOfGgx::new(alpha),
        }
    }

    /// Returns what is reflected, the share that is left to what lies below, and the cosines of light and eye.
    #[inline(always)]
    fn at<R: Real>(&self, pair: &Pair<R>) -> (R, R, R, R) {
        let (one, alpha2) = (R::of(1.0), R::of(self.alpha2));
        let light = dot(everywhere(self.normal), pair.wi).within(MIN_COS, 1.0);
        let eye = dot(everywhere(self.normal), pair.wo).within(MIN_COS, 1.0);
        let along = |axis| dot(pair.half, everywhere(axis));
        let (x, y, z) = (along(self.x), along(self.y), along(self.normal));
        let squares = x * x + y * y + z * z;
        let slope = |cos: R| (alpha2 + (one - alpha2) * cos * cos).root();
        // pi D G2 / (4 eye), where G2 has the factor 2 light eye.
        let below = alpha2 * squares * squares * (slope(light) * eye + slope(eye) * light);
        let shape = R::of(0.5) * light / below;
        let fresnel = dielectric(pair.cos_half, R::of(self.eta2));
        let (part, grazing) = self.albedo.at(eye);
        let single = (part + grazing).at_least(R::of(1e-3));
        let more = one + fresnel * (one - single) / single;
        (shape * fresnel * more, one - (R::of(self.f0) * part + grazing) * more, light, eye)
    }
}

/// Returns the widths of a lobe along its long and its short axis.
fn widths(roughness: f32, anisotropy: f32) -> (f32, f32) {
    let short = 1.0 - anisotropy;
    let alpha_x = roughness * roughness * (2.0 / (1.0 + short * short)).sqrt();
    (alpha_x.clamp(MIN_ALPHA, 1.0), (short * alpha_x).clamp(MIN_ALPHA, 1.0))
}

/// Returns the reflectance of a dielectric by the cosine and the squared index of refraction, unpolarised.
#[inline(always)]
fn dielectric<R: Real>(cos: R, eta2: R) -> R {
    let one = R::of(1.0);
    let g = (eta2 + cos * cos - one).at_least(R::of(0.0)).root();
    let (sum, difference) = (g + cos, g - cos);
    let (first, second) = (difference / sum, (sum * cos - one) / (difference * cos + one));
    R::of(0.5) * first * first * (one + second * second)
}

/// Albedo of a lobe of GGX towards an eye: a rational function that MaterialX fitted, by the cosine for one width.
struct AlbedoOfGgx {
    /// Coefficients of 1, x and x^2 in numerators and denominators.
    terms: [[f32; 3]; 4],
}

impl AlbedoOfGgx {
    fn new(y: f32) -> AlbedoOfGgx {
        const ONE: [f32; 4] = [0.1003, 0.9345, 1.0, 1.0];
        const X: [f32; 4] = [-0.6303, -2.323, -1.765, 0.2281];
        const Y: [f32; 4] = [9.748, 2.229, 8.263, 15.94];
        const XY: [f32; 4] = [-2.038, -3.748, 11.53, -55.83];
        const XX: [f32; 4] = [29.34, 1.424, 28.96, 13.08];
        const YY: [f32; 4] = [-8.245, -0.7684, -7.507, 41.26];
        const XXY: [f32; 4] = [-26.44, 1.436, -36.11, 54.9];
        const XYY: [f32; 4] = [19.99, 0.2913, 15.86, 300.2];
        const XXYY: [f32; 4] = [-5.448, 0.6286, 33.37, -285.1];
        let terms = [0, 1, 2, 3].map(|i| {
            [ONE[i] + Y[i] * y + YY[i] * y * y, X[i] + XY[i] * y + XYY[i] * y * y, XX[i] + XXY[i] * y + XXYY[i] * y * y]
        });
        AlbedoOfGgx { terms }
    }

    /// Returns the factors of the reflectances at normal and at grazing incidence.
    #[inline(always)]
    fn at<R: Real>(&self, x: R) -> (R, R) {
        let [first, second, third, fourth] = &self.terms;
        (
            (quadratic(first, x) / quadratic(third, x)).within(0.0, 1.0),
            (quadratic(second, x) / quadratic(fourth, x)).within(0.0, 1.0),
        )
    }
}

/// A rough diffuse surface that loses no energy [Portsmouth 2024].
struct RoughDiffuse {
    roughness: f32,
    /// Factor of what is scattered once.
    scale: f32,
    mean_albedo: f32,
}

impl RoughDiffuse {
    fn new(roughness: f32) -> RoughDiffuse {
        let scale = 1.0 / (1.0 + (0.5 - 2.0 / 3.0 * FRAC_1_PI) * roughness);
        RoughDiffuse {
            roughness,
            scale,
            mean_albedo: scale * (1.0 + (2.0 / 3.0 - 28.0 / 15.0 * FRAC_1_PI) * roughness),
        }
    }

    /// Returns the factors of what is scattered once and more than once, times the light's cosine.
    #[inline(always)]
    fn at<R: Real>(&self, light: R, eye: R, between: R) -> (R, R) {
        let one = R::of(1.0);
        let s = between - light * eye;
        let part = s.if_positive(s / light.at_least(eye), s);
        let single = light * R::of(self.scale) * (one + R::of(self.roughness) * part);
        let lost = |cos: R| (one - self.albedo(cos)).at_least(R::of(MIN_COS));
        (single, light * lost(eye) * lost(light) / R::of((1.0 - self.mean_albedo).max(MIN_COS)))
    }

    /// Returns the albedo of what is scattered once, a polynomial of [Portsmouth 2024] within 0.1 %.
    #[inline(always)]
    fn albedo<R: Real>(&self, cos: R) -> R {
        let x = R::of(1.0) - cos;
        let of = R::of;
        let g = x * (of(0.057_108_53) + x * (of(0.491_881_87) + x * (of(-0.332_181_44) + x * of(0.071_443))));
        of(self.scale) * (of(1.0) + of(self.roughness) * g)
    }
}

/// Fuzz: a linearly transformed cosine [Zeltner 2022] by MaterialX's fits.
pub struct FuzzLobe {
    normal: [f32; 3],
    roughness: f32,
    weight: f32,
    /// Width, middle and offset of the albedo over the eye's cosine.
    albedo: [f32; 3],
}

impl FuzzLobe {
    /// Prepares the fuzz of a texel.
    pub fn new(texel: &OpenPbrTexel) -> FuzzLobe {
        let y = texel.fuzz_roughness.clamp(0.01, 1.0);
        let width = y * (0.020_660_7 + 1.584_91 * y) / (0.037_942_4 + y * (1.322_27 + y));
        let middle = y * (-0.193_854 + y * (-1.148_85 + y * (1.793_2 - 0.959_43 * y * y))) / (0.046_391 + y);
        let offset = y * (0.000_654_023 + (-0.020_781_8 + 0.119_681 * y) * y) / (1.262_64 + y * (-1.920_21 + y));
        FuzzLobe {
            normal: unit_normal(texel.normal),
            roughness: y,
            weight: texel.fuzz,
            albedo: [width, middle, offset],
        }
    }

    /// Evaluates it at a pair.
    #[inline(always)]
    pub fn at<R: Real>(&self, pair: &Pair<R>) -> FuzzValues<R> {
        let (of, y) = (R::of, self.roughness);
        let n = everywhere(self.normal);
        let x = dot(n, pair.wo).within(MIN_COS, 1.0);
        let [width, middle, offset] = self.albedo;
        let far = (x - of(middle)) / of(width);
        let albedo = (of(-0.5) * far * far).power_of_e() / of(width * (2.0 * PI).sqrt()) + of(offset);
        let a =
            (of(2.581_26) * x + of(0.813_703 * y)) * of(y) / (of(1.0) + of(0.310_327) * x * x + of(2.609_94 * y) * x);
        let b = (of(1.0) - x).root() * of((y - 1.0) * y * y * y)
            / (of(0.000_025_405_3 + 1.341_74 * y * y) + of(1.712_28 - 1.715_06 * y) * x);
        // The light in a frame whose first axis is the eye's, projected.
        let side = [pair.wo[0] - n[0] * x, pair.wo[1] - n[1] * x, pair.wo[2] - n[2] * x];
        let length = dot(side, side).root().at_least(of(1e-4));
        let (along, up) = (dot(pair.wi, side) / length, dot(pair.wi, n));
        let across = (of(1.0) - along * along - up * up).at_least(of(0.0));
        let first = a * along + b * up;
        let squared = first * first + a * a * across + up * up;
        let value = up.at_least(of(0.0)) * (a / squared) * (a / squared);
        let weight = of(self.weight);
        FuzzValues { value: albedo * value * weight, kept: of(1.0) - albedo * weight }
    }
}

/// Returns the unit vector with this x and y.
fn unit_normal([x, y]: [f32; 2]) -> [f32; 3] {
    [x, y, (1.0 - x * x - y * y).max(0.0).sqrt()]
}

#[inline(always)]
fn dot<R: Real>(a: [R; 3], b: [R; 3]) -> R {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns a vector in all places.
#[inline(always)]
fn everywhere<R: Real>([x, y, z]: [f32; 3]) -> [R; 3] {
    [R::of(x), R::of(y), R::of(z)]
}

/// Returns a quadratic polynomial's value; coefficients in ascending order.
#[inline(always)]
fn quadratic<R: Real>([a, b, c]: &[f32; 3], x: R) -> R {
    R::of(*a) + x * (R::of(*b) + x * R::of(*c))
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_runtime::testing::direction_from_degrees;

    /// Returns the albedo towards an eye, by sums over directions that are even in projected solid angle.
    fn albedo(texel: &OpenPbrTexel, wo: [f32; 3]) -> f32 {
        let steps = 160;
        let mut sum = 0.0;
        for row in 0..steps {
            let sin2 = (row as f32 + 0.5) / steps as f32;
            for column in 0..steps {
                let (sin, cos) = ((column as f32 + 0.5) / steps as f32 * 2.0 * PI).sin_cos();
                let wi = [sin2.sqrt() * cos, sin2.sqrt() * sin, (1.0 - sin2).sqrt()];
                sum += texel.reflected(wi, wo)[1] / wi[2];
            }
        }
        sum / (steps * steps) as f32
    }

    #[test]
    fn a_white_surface_reflects_what_comes_in_whatever_lies_on_it() {
        let white = OpenPbrTexel { roughness: 0.6, ..OpenPbrTexel::PLAIN };
        let coated = OpenPbrTexel { coat: 0.8, coat_roughness: 0.4, ..white };
        for texel in [
            white,
            OpenPbrTexel { diffuse_roughness: 1.0, ..white },
            OpenPbrTexel { f0: 0.5, ..white },
            coated,
            OpenPbrTexel { fuzz: 0.7, fuzz_roughness: 0.7, ..coated },
        ] {
            for theta in [0.0, 40.0, 65.0] {
                let whole = albedo(&texel, direction_from_degrees(theta, 30.0));
                // The albedos of the layers are MaterialX's fits, and of light and eye more than 90 degrees apart it cuts the
                // rough diffuse surface's cosine.
                assert!((whole - 1.0).abs() < 0.09, "{theta}: {whole} of {texel:?}");
            }
        }
        let grey = OpenPbrTexel { base_colour: [0.5; 3], ..white };
        assert!(albedo(&grey, [0.0, 0.0, 1.0]) < 0.6, "planted");
    }

    #[test]
    fn the_albedo_of_a_rough_diffuse_surface_is_the_exact_one() {
        for roughness in [0.0, 0.3, 1.0f32] {
            let rough = RoughDiffuse::new(roughness);
            for i in 1..=50 {
                let cos = i as f32 / 50.0;
                let sin = (1.0 - cos * cos).max(0.0).sqrt();
                // [Portsmouth 2024], equation of the albedo.
                let g = sin * (cos.acos() - sin * cos) + 2.0 / 3.0 * ((sin / cos) * (1.0 - sin * sin * sin) - sin);
                let exact = rough.scale * (1.0 + roughness * g / PI);
                assert!((rough.albedo(cos) - exact).abs() < 1e-3, "{roughness} {cos}: {} {exact}", rough.albedo(cos));
            }
        }
    }

    #[test]
    fn parameters_are_those_of_the_texel() {
        let numbers: [f32; PARAMETERS] = std::array::from_fn(|i| (i + 1) as f32 / 128.0);
        let texel = OpenPbrTexel::from_parameters(&numbers);
        assert_eq!(texel.to_parameters(), numbers);
        assert_eq!([texel.f0, texel.coat_roughness, texel.fuzz_roughness], [10.0, 20.0, 27.0].map(|x| x / 128.0));
    }
}

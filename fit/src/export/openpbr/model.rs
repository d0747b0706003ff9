//! Reflectance of OpenPBR Surface 1.1 as MaterialX 1.39 evaluates it: a rough diffuse base under a glossy interface with
//! anisotropy, under a coat with a normal of its own, under fuzz [OpenPBR 2025].
//!
//! Metal, transmission, thin films and what shines by itself are left out. Shading normals are not turned where they face
//! away from the eye, which the specification does not ask for.

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
    pub fn layered(&self, c: usize, base: &BaseValues, coat: &CoatValues, fuzz: &FuzzValues) -> f32 {
        let diffuse = diffuse_of(self.base_colour[c], base);
        let tint = 1.0 + (self.coat_colour[c] - 1.0) * self.coat;
        let below = self.specular_colour[c] * base.gloss + base.kept * diffuse;
        let coated = coat.gloss + coat.kept * tint * below;
        self.fuzz_colour[c] * fuzz.value + fuzz.kept * coated
    }
}

/// Returns what the diffuse base reflects with a colour.
#[inline(always)]
fn diffuse_of(colour: f32, base: &BaseValues) -> f32 {
    let multiple = colour * colour * base.mean_albedo / (1.0 - colour * (1.0 - base.mean_albedo));
    colour * base.single + multiple * base.multiple
}

/// A pair of directions.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pair {
    /// Unit vector to the light.
    pub wi: [f32; 3],
    /// Unit vector to the eye.
    pub wo: [f32; 3],
    /// Unit vector halfway between.
    half: [f32; 3],
    /// Cosine between eye and half vector.
    cos_half: f32,
    /// Cosine between light and eye, at least 0.
    cos_between: f32,
}

impl Pair {
    /// Takes two unit vectors.
    pub fn new(wi: [f32; 3], wo: [f32; 3]) -> Pair {
        let sum = [0, 1, 2].map(|i| wi[i] + wo[i]);
        let length = dot(sum, sum).sqrt().max(MIN_COS);
        let half = sum.map(|x| x / length);
        Pair { wi, wo, half, cos_half: dot(wo, half).clamp(MIN_COS, 1.0), cos_between: dot(wi, wo).clamp(MIN_COS, 1.0) }
    }
}

/// What the base has at a pair.
#[derive(Debug, Clone, Copy, Default)]
pub struct BaseValues {
    /// Gloss without its tint.
    pub gloss: f32,
    /// Share of the light that the gloss leaves to the diffuse base.
    pub kept: f32,
    /// Factor of the diffuse colour: light that is scattered once.
    pub single: f32,
    /// Factor of the light that is scattered more than once.
    pub multiple: f32,
    /// Mean albedo of what is scattered once.
    pub mean_albedo: f32,
}

/// What the coat has at a pair.
#[derive(Debug, Clone, Copy, Default)]
pub struct CoatValues {
    /// Gloss, with its weight.
    pub gloss: f32,
    /// Share of the light that it leaves to the base.
    pub kept: f32,
}

/// What the fuzz has at a pair.
#[derive(Debug, Clone, Copy, Default)]
pub struct FuzzValues {
    /// Reflected by white fuzz, with its weight.
    pub value: f32,
    /// Share of the light that it leaves to what is below.
    pub kept: f32,
}

/// The base of a texel: diffuse and glossy.
pub struct BaseLobe {
    gloss: Gloss,
    /// Roughness of the diffuse base.
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
    pub fn at(&self, pair: &Pair) -> BaseValues {
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
    pub fn at(&self, pair: &Pair) -> CoatValues {
        let (gloss, kept, ..) = self.gloss.at(pair);
        CoatValues { gloss: gloss * self.weight, kept: 1.0 - (1.0 - kept) * self.weight }
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
    /// Squared mean width over 1, and the mean width.
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
    fn at(&self, pair: &Pair) -> (f32, f32, f32, f32) {
        let light = dot(self.normal, pair.wi).clamp(MIN_COS, 1.0);
        let eye = dot(self.normal, pair.wo).clamp(MIN_COS, 1.0);
        let (a, b, c) = (dot(pair.half, self.x), dot(pair.half, self.y), dot(pair.half, self.normal));
        let squares = a * a + b * b + c * c;
        let slope = |cos: f32| (self.alpha2 + (1.0 - self.alpha2) * cos * cos).sqrt();
        // pi D G2 / (4 eye), where G2 has the factor 2 light eye.
        let shape = 0.5 * light / (self.alpha2 * squares * squares * (slope(light) * eye + slope(eye) * light));
        let fresnel = dielectric(pair.cos_half, self.eta2);
        let (part, grazing) = self.albedo.at(eye);
        let single = (part + grazing).max(1e-3);
        let more = 1.0 + fresnel * (1.0 - single) / single;
        (shape * fresnel * more, 1.0 - (self.f0 * part + grazing) * more, light, eye)
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
fn dielectric(cos: f32, eta2: f32) -> f32 {
    let g = (eta2 + cos * cos - 1.0).max(0.0).sqrt();
    let (sum, difference) = (g + cos, g - cos);
    let (first, second) = (difference / sum, (sum * cos - 1.0) / (difference * cos + 1.0));
    0.5 * first * first * (1.0 + second * second)
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
    fn at(&self, x: f32) -> (f32, f32) {
        let value = |[a, b, c]: [f32; 3]| a + x * (b + x * c);
        let ratio = |top: usize, bottom: usize| (value(self.terms[top]) / value(self.terms[bottom])).clamp(0.0, 1.0);
        (ratio(0, 2), ratio(1, 3))
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
    fn at(&self, light: f32, eye: f32, between: f32) -> (f32, f32) {
        let s = between - light * eye;
        let part = if s > 0.0 { s / light.max(eye) } else { s };
        let single = light * self.scale * (1.0 + self.roughness * part);
        let lost = |cos: f32| (1.0 - self.albedo(cos)).max(MIN_COS);
        (single, light * lost(eye) * lost(light) / (1.0 - self.mean_albedo).max(MIN_COS))
    }

    /// Returns the albedo of what is scattered once, a polynomial of [Portsmouth 2024] within 0.1 %.
    #[inline(always)]
    fn albedo(&self, cos: f32) -> f32 {
        let x = 1.0 - cos;
        let g = x * (0.057_108_53 + x * (0.491_881_87 + x * (-0.332_181_44 + x * 0.071_443)));
        self.scale * (1.0 + self.roughness * g)
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
    pub fn at(&self, pair: &Pair) -> FuzzValues {
        let (n, y) = (self.normal, self.roughness);
        let x = dot(n, pair.wo).clamp(MIN_COS, 1.0);
        let [width, middle, offset] = self.albedo;
        let far = (x - middle) / width;
        let albedo = (-0.5 * far * far).exp() / (width * (2.0 * PI).sqrt()) + offset;
        let a = (2.581_26 * x + 0.813_703 * y) * y / (1.0 + 0.310_327 * x * x + 2.609_94 * x * y);
        let b = (1.0 - x).max(0.0).sqrt() * (y - 1.0) * y * y * y
            / (0.000_025_405_3 + 1.712_28 * x - 1.715_06 * x * y + 1.341_74 * y * y);
        // The light in a frame whose first axis is the eye's, projected.
        let side = [0, 1, 2].map(|i| pair.wo[i] - n[i] * x);
        let length = dot(side, side).sqrt().max(1e-4);
        let (along, up) = (dot(pair.wi, side) / length, dot(pair.wi, n));
        let across = (1.0 - along * along - up * up).max(0.0);
        let (first, second) = (a * along + b * up, a * a * across);
        let squared = first * first + second + up * up;
        let value = up.max(0.0) * (a / squared) * (a / squared);
        FuzzValues { value: albedo * value * self.weight, kept: 1.0 - albedo * self.weight }
    }
}

/// Returns the unit vector with this x and y.
fn unit_normal([x, y]: [f32; 2]) -> [f32; 3] {
    [x, y, (1.0 - x * x - y * y).max(0.0).sqrt()]
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
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

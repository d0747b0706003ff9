//! Shading by relief between the measured directions: the heights tell which surface point the eye sees in a texel, and
//! which points the neighbouring views show in its place. Neighbours that show something unlike count less, and the
//! difference of the shading of both points is added to what is interpolated. At measured directions both are the same,
//! and nothing changes. Twin: `decode/relief.wgsl`.
//!
//! A point is shaded by a plain model, of which only differences count: a diffuse body under a light whose shadow comes
//! from the horizon of the heights [Max 1988], a little even light, and a GGX gloss [Walter 2007].

use crate::asset::height_field::HeightField;
use crate::asset::relief::Relief;
use crate::asset::relief::{AZIMUTHS, EVEN_LIGHT, HORIZON_STEP, MAX_ALBEDO, RELIEF_WORDS, SLOPE_STEP};
use crate::asset::residual::ResidualKind;
use crate::decode::texel::Texel;
use crate::numeric::in_vectors::in_vectors;
use crate::numeric::vector::dot;
use crate::resident::layout::block;
use pulp::{Simd, WithSimd};

/// Half of the width of a shadow's edge, as a tangent of elevation.
pub const SHADOW_EDGE: f32 = 0.2;
/// Roughness alpha of the gloss.
pub const GLOSS_ALPHA: f32 = 0.3;
/// Reflectance of the gloss at normal incidence.
pub const GLOSS_NORMAL: f32 = 0.04;
/// Least cosine between the eye and a normal.
pub const MIN_COS_EYE: f32 = 0.02;
/// Least divisor of the terms under a light beyond the measured ones.
pub const MIN_BEYOND: f32 = 0.3;
/// Share of the squared difference of normals in the unlikeness of two points.
pub const NORMAL_SHARE: f32 = 0.1;

/// Bits that turn the signed slopes of a record's first word into numbers from 0 on.
const SLOPE_SIGNS: u32 = 0x8000_8000;

/// A surface point: its normal, its albedo and its horizon, interpolated between texels.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ReliefPoint {
    normal: [f32; 3],
    /// Root of the albedo over [`MAX_ALBEDO`].
    code: [f32; 3],
    /// Tangents of the horizon's elevation.
    horizons: [f32; AZIMUTHS],
}

/// A light as the shading of points needs it.
#[derive(Debug, Clone, Copy)]
struct ReliefLight {
    wi: [f32; 3],
    /// Tangent of the elevation.
    tangent: f32,
    /// The two azimuths of records that the light is between.
    azimuths: [usize; 2],
    /// Way from the first to the second.
    part: f32,
}

/// The surface points of a texel that are seen from one eye: the eye's own, and those that neighbouring views show.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SeenRelief {
    relief: Relief,
    /// Unit vector to the eye, or to the nearest one within the hull of the measured views.
    eye: [f32; 3],
    own: ReliefPoint,
    of_views: [ReliefPoint; 3],
    /// Albedo of an upright plane at the texel of each neighbouring view.
    flat: [[f32; 3]; 3],
}

/// A light for which the eye's own point is shaded.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OwnLight {
    /// Unit vector to the light.
    pub wi: [f32; 3],
    /// The light's nearest direction within the hull of the measured ones.
    pub toward: [f32; 3],
    /// Fall of the value beyond the hull of the measured lights, as in the light's [`crate::Neighbours`].
    pub beyond: f32,
}

/// What relief adds at a light, RGB in the root curve.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ReliefTerms {
    /// Shading over that of an upright plane, times the shares.
    pub added: [f32; 3],
    /// Shading itself, by which points are compared.
    pub shading: [f32; 3],
}

/// Returns the albedo whose root over [`MAX_ALBEDO`] is `code`.
fn albedo(code: f32) -> f32 {
    MAX_ALBEDO * code * code
}

/// Returns the share of a light at `wi`, a unit vector with z > 0, that horizons leave: from 0 in shadow to 1, with a soft
/// edge. [`crate::HeightField::horizons`] gives the horizons.
pub fn lit_share(horizons: &[f32; AZIMUTHS], wi: [f32; 3]) -> f32 {
    ReliefLight::new(wi).share(horizons)
}

/// Encodes values of the root curve in place, in vectors; a type, because a closure would not be inlined where the wide
/// vectors are.
struct Encode<'a> {
    values: &'a mut [f32],
    epsilon: f32,
}

impl WithSimd for Encode<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        ResidualKind::Root.encode_slice(self.values, self.epsilon);
    }
}

/// A point to be shaded: number of the view that shows it or 3 for the eye, light, direction to that eye, and albedo of
/// the upright plane.
type Shaded<'a> = (usize, &'a ReliefLight, [f32; 3], [f32; 3]);

/// Numbers that a point takes in vectors: its body, its whole shading and the upright plane's, RGB.
const NUMBERS: usize = 9;
/// Largest number of points that are shaded together: three views under three lights, and the eye's under the light and
/// under the nearest one within the hull.
const MAX_SHADED: usize = 11;

impl ReliefPoint {
    /// Reads the point at `place`, columns and rows, of the layer of `t`; edges continue outside.
    pub(crate) fn read(t: &Texel, place: [f32; 2]) -> ReliefPoint {
        let size = [t.field(block::WIDTH), t.field(block::ROWS)];
        let place = [0, 1].map(|i| place[i].clamp(0.0, (size[i] - 1) as f32));
        let (c, r) = (place[0] as usize, place[1] as usize);
        let next = [(c + 1).min(size[0] - 1), (r + 1).min(size[1] - 1)];
        let part = [place[0] - c as f32, place[1] - r as f32];
        let rows = [(r, 1.0 - part[1]), (next[1], part[1])];
        let columns = [(c, 1.0 - part[0]), (next[0], part[0])];
        // All bytes at once, in vectors; the sign of the slopes becomes an offset.
        let mut sums = [0.0f32; 4 * RELIEF_WORDS];
        for (row, of_row) in rows {
            for (column, of_column) in columns {
                let at = t.field(block::RELIEF) + RELIEF_WORDS * (row * size[0] + column);
                let words: [u32; RELIEF_WORDS] = std::array::from_fn(|i| t.words[at + i]);
                let bytes: [u8; 4 * RELIEF_WORDS] =
                    bytemuck::cast([words[0] ^ SLOPE_SIGNS, words[1], words[2], words[3]]);
                let weight = of_row * of_column;
                sums.iter_mut().zip(bytes).for_each(|(sum, byte)| *sum += weight * f32::from(byte));
            }
        }
        let slopes = [0, 2].map(|i| SLOPE_STEP * (sums[i] + 256.0 * sums[i + 1] - 32768.0));
        let scale = 1.0 / (1.0 + slopes[0] * slopes[0] + slopes[1] * slopes[1]).sqrt();
        ReliefPoint {
            normal: [-slopes[0] * scale, -slopes[1] * scale, scale],
            code: [4, 5, 6].map(|i| sums[i] * (1.0 / 255.0)),
            horizons: std::array::from_fn(|k| HORIZON_STEP * sums[8 + k]),
        }
    }

    /// Returns how unlike two points are: the mean squared difference of the roots of their albedos, and a share of that
    /// of their normals.
    fn unlikeness(&self, other: &ReliefPoint) -> f32 {
        let square = |a: &[f32; 3], b: &[f32; 3]| (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum::<f32>();
        square(&self.code, &other.code) / 3.0 + NORMAL_SHARE * square(&self.normal, &other.normal)
    }

    fn albedo(&self) -> [f32; 3] {
        self.code.map(albedo)
    }

    /// Returns the factor on the albedo under `light`, and the gloss towards the eye at `wo` where `with_gloss`.
    fn shade(&self, light: &ReliefLight, wo: [f32; 3], with_gloss: bool) -> [f32; 2] {
        let cos_light = dot(self.normal, light.wi).max(0.0);
        let lit = light.share(&self.horizons) * cos_light;
        let body = lit + EVEN_LIGHT * light.wi[2];
        if !with_gloss {
            return [body, 0.0];
        }
        let sum = [0, 1, 2].map(|i| light.wi[i] + wo[i]);
        let half = sum.map(|x| x / dot(sum, sum).max(1e-12).sqrt());
        let cos_eye = dot(self.normal, wo).max(MIN_COS_EYE);
        let cos_half = dot(self.normal, half).max(0.0);
        let alpha2 = GLOSS_ALPHA * GLOSS_ALPHA;
        let around = cos_half * cos_half * (alpha2 - 1.0) + 1.0;
        let masked = cos_light * (cos_eye * cos_eye * (1.0 - alpha2) + alpha2).sqrt()
            + cos_eye * (cos_light * cos_light * (1.0 - alpha2) + alpha2).sqrt();
        let grazing = (1.0 - dot(wo, half)).clamp(0.0, 1.0);
        let grazing2 = grazing * grazing;
        let fresnel = GLOSS_NORMAL + (1.0 - GLOSS_NORMAL) * grazing2 * grazing2 * grazing;
        [body, fresnel * alpha2 / (around * around) * 0.5 / (masked + 1e-6) * lit]
    }
}

/// Light of places in a list that are not used.
const NO_LIGHT: ReliefLight = ReliefLight { wi: [0.0; 3], tangent: 0.0, azimuths: [0; 2], part: 0.0 };

impl ReliefLight {
    fn new(wi: [f32; 3]) -> ReliefLight {
        let [x, y] = [wi[0].abs(), wi[1].abs()];
        let [least, most] = [x.min(y), x.max(y)];
        // The tangent of the angle within an octant stands for the angle, in units of 45 degrees.
        let within = least / most.max(1e-6);
        let quadrant = if y > x { 2.0 - within } else { within };
        let half = if wi[0] < 0.0 { 4.0 - quadrant } else { quadrant };
        let around = if wi[1] < 0.0 { 8.0 - half } else { half };
        let first = around.floor();
        let azimuths = [first as usize % AZIMUTHS, (first as usize + 1) % AZIMUTHS];
        let tangent = wi[2] / (x * x + y * y).sqrt().max(1e-4);
        ReliefLight { wi, tangent, azimuths, part: around - first }
    }

    /// Returns the share of the light that horizons leave.
    fn share(&self, horizons: &[f32; AZIMUTHS]) -> f32 {
        let [near, far] = self.azimuths.map(|azimuth| horizons[azimuth]);
        let clear = self.tangent - (near + (far - near) * self.part);
        (clear / (2.0 * SHADOW_EDGE) + 0.5).clamp(0.0, 1.0)
    }
}

impl SeenRelief {
    /// Finds the surface points of `field` that the eye at `wo` sees in texel `t`, and that the measured `views` show in
    /// the texels `shown`. `eye` is the eye's nearest direction within the hull of the measured views.
    ///
    /// Cost: four rays of at most 64 steps.
    pub(crate) fn new(
        t: &Texel,
        field: &HeightField,
        [wo, eye]: [[f32; 3]; 2],
        views: &[[f32; 3]; 3],
        shown: [usize; 3],
        weights: &[f32; 3],
    ) -> SeenRelief {
        let width = t.field(block::WIDTH);
        let place = |texel: usize| [(texel % width) as f32, (texel / width) as f32];
        let own = ReliefPoint::read(t, field.seen_place(place(t.texel), wo));
        let (mut of_views, mut flat) = ([own; 3], [[0.0; 3]; 3]);
        for v in (0..3).filter(|v| weights[*v] > 0.0) {
            of_views[v] = ReliefPoint::read(t, field.seen_place(place(shown[v]), views[v]));
            let codes = t.words[t.field(block::RELIEF) + RELIEF_WORDS * shown[v] + 1];
            flat[v] = [0, 8, 16].map(|shift| (1.0 + EVEN_LIGHT) * albedo((codes >> shift & 0xff) as f32 / 255.0));
        }
        let [likeness, shading, gloss] = block::RELIEF_NUMBERS.map(|field| t.float(field));
        SeenRelief { relief: Relief { likeness, shading, gloss }, eye, own, of_views, flat }
    }

    /// Returns the weights of the neighbouring views, less where a view shows a point unlike the eye's; they sum up to 1.
    pub(crate) fn view_weights(&self, weights: [f32; 3]) -> [f32; 3] {
        let weigh = |v: usize| weights[v] / (1.0 + self.relief.likeness * self.own.unlikeness(&self.of_views[v]));
        let weighed = [0, 1, 2].map(weigh);
        let sum: f32 = weighed.iter().sum();
        weighed.map(|weight| weight / sum)
    }

    /// Returns the weights of three measured lights, less where the shading `of_lights` of the neighbouring views is unlike
    /// `here`, that at the light and eye asked for; they sum up to 1.
    pub(crate) fn light_weights(&self, weights: [f32; 3], here: [f32; 3], of_lights: [[f32; 3]; 3]) -> [f32; 3] {
        let weighed = [0, 1, 2].map(|l| {
            let square: f32 = (0..3).map(|c| (of_lights[l][c] - here[c]) * (of_lights[l][c] - here[c])).sum();
            weights[l] / (1.0 + self.relief.likeness * square / 3.0)
        });
        let sum: f32 = weighed.iter().sum();
        weighed.map(|weight| weight / sum)
    }

    /// Returns the terms of `points`, [`MAX_SHADED`] at most.
    fn terms(&self, points: &[Shaded], epsilon: f32) -> [ReliefTerms; MAX_SHADED] {
        let Relief { shading, gloss, .. } = self.relief;
        let mut values = [0.0; (NUMBERS * MAX_SHADED).next_multiple_of(16)];
        for ((view, light, wo, flat), values) in points.iter().zip(values.chunks_exact_mut(NUMBERS)) {
            let point = if *view < 3 { &self.of_views[*view] } else { &self.own };
            let [body, shine] = point.shade(light, *wo, gloss > 0.0);
            let albedo = point.albedo();
            for c in 0..3 {
                values[c] = albedo[c] * body;
                values[3 + c] = albedo[c] * body + shine;
                values[6 + c] = flat[c] * light.wi[2];
            }
        }
        let used = (NUMBERS * points.len()).next_multiple_of(16);
        in_vectors(Encode { values: &mut values[..used], epsilon });
        let mut terms = [ReliefTerms::default(); MAX_SHADED];
        for (terms, values) in terms[..points.len()].iter_mut().zip(values.chunks_exact(NUMBERS)) {
            for c in 0..3 {
                let [body, whole, upright] = [values[c], values[3 + c], values[6 + c]];
                terms.added[c] = shading * (body - upright) + gloss * (whole - body);
                terms.shading[c] = whole;
            }
        }
        terms
    }

    /// Returns the terms of what neighbouring `views` show, with their weights, under measured lights at `wis`, and those of
    /// the point that the eye sees under the light `own`, if there is one. The upright plane of the eye's point is that of
    /// the texels of the neighbouring views, with their weights.
    ///
    /// Beyond the measured lights the value falls with the light's cosine, from that at their hull. What relief adds there
    /// is that under the light itself, over what it then loses; points are compared at the hull.
    pub(crate) fn of_lights(
        &self,
        wis: [Option<[f32; 3]>; 3],
        own: Option<OwnLight>,
        views: &[[f32; 3]; 3],
        weights: [f32; 3],
        epsilon: f32,
    ) -> ([ReliefTerms; 3], ReliefTerms) {
        let lights = wis.map(|wi| wi.map(ReliefLight::new));
        let own = own.map(|own| (own.beyond, [own.toward, own.wi].map(ReliefLight::new)));
        let shown = || (0..3).filter(|v| weights[*v] > 0.0);
        let mut points: [Shaded; MAX_SHADED] = [(3, &NO_LIGHT, [0.0; 3], [0.0; 3]); MAX_SHADED];
        let mut count = 0;
        let mut add = |point| {
            points[count] = point;
            count += 1;
        };
        for light in lights.iter().flatten() {
            shown().for_each(|v| add((v, light, views[v], self.flat[v])));
        }
        if let Some((beyond, lights)) = &own {
            let flat = [0, 1, 2].map(|c| shown().map(|v| weights[v] * self.flat[v][c]).sum());
            let asked = if *beyond < 1.0 { 2 } else { 1 };
            lights[..asked].iter().for_each(|light| add((3, light, self.eye, flat)));
        }
        let mut terms = self.terms(&points[..count], epsilon).into_iter();
        let mut of_lights = [ReliefTerms::default(); 3];
        for (light, sum) in lights.iter().zip(&mut of_lights) {
            if light.is_some() {
                for (v, terms) in shown().zip(terms.by_ref()) {
                    for c in 0..3 {
                        sum.added[c] += weights[v] * terms.added[c];
                        sum.shading[c] += weights[v] * terms.shading[c];
                    }
                }
            }
        }
        let Some((beyond, _)) = own else { return (of_lights, ReliefTerms::default()) };
        let mut here = terms.next().unwrap_or_default();
        if beyond < 1.0 {
            here.added = terms.next().unwrap_or_default().added.map(|x| x / beyond.max(MIN_BEYOND));
        }
        (of_lights, here)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::heights::Heights;
    use crate::testing::direction_from_degrees;

    /// A plain with a wall two texel widths high from column 20 on.
    fn wall() -> Heights {
        Heights { step: 1.0, codes: (0..30 * 30).map(|texel| if texel % 30 >= 20 { 2 } else { 0 }).collect() }
    }

    #[test]
    fn a_wall_shadows_the_plain_before_it_and_no_other_place() {
        let heights = wall();
        let field = heights.field([30, 30]);
        let before = field.horizons([16.0, 15.0]);
        // The wall's edge is between columns 19 and 20; steps of the search miss it by less than one.
        assert!((0.4..=0.5).contains(&before[0]), "{before:?}");
        assert!((before[1] - before[0] / 2f32.sqrt()).abs() < 0.08 && before[1] == before[7], "{before:?}");
        assert!(before[2..7].iter().all(|tangent| *tangent == 0.0), "{before:?}");
        assert_eq!(field.horizons([25.0, 15.0]), [0.0; 8]);
        let share = |theta_deg: f64, phi_deg: f64| lit_share(&before, direction_from_degrees(theta_deg, phi_deg));
        // The sun above the wall, at its edge, and behind it; and from the other side.
        assert_eq!([share(40.0, 0.0), share(85.0, 0.0), share(40.0, 180.0)], [1.0, 0.0, 1.0]);
        assert!((0.3..0.7).contains(&share(65.5, 0.0)), "{}", share(65.5, 0.0));
        assert!((0.2..0.4).contains(&share(70.0, 350.0)) && share(70.0, 180.0) == 1.0, "{}", share(70.0, 350.0));
    }

    #[test]
    fn horizons_are_linear_between_azimuths_all_around() {
        let horizons: [f32; AZIMUTHS] = std::array::from_fn(|k| if k % 2 == 0 { 0.0 } else { 1.0 });
        for quarter in 0..8 {
            let at = |offset_deg: f64| {
                ReliefLight::new(direction_from_degrees(45.0, 45.0 * f64::from(quarter) + offset_deg))
            };
            let [near, far] = at(1e-3).azimuths;
            assert_eq!((near, far), (quarter as usize, (quarter as usize + 1) % 8));
            assert!(at(1e-3).part < 1e-4 && at(44.999).part > 0.999, "{quarter}");
            // Halfway the horizon is between both, near the middle.
            let tangent = at(22.5).tangent - at(22.5).share(&horizons);
            assert!(tangent.is_finite() && (0.35..0.65).contains(&at(22.5).part), "{}", at(22.5).part);
        }
    }

    #[test]
    fn gloss_is_brightest_in_the_mirror_direction_and_off_in_the_shadow() {
        let point = ReliefPoint { normal: [0.0, 0.0, 1.0], code: [0.5; 3], horizons: [0.0; AZIMUTHS] };
        let eye = direction_from_degrees(50.0, 180.0);
        let gloss =
            |theta_deg: f64| point.shade(&ReliefLight::new(direction_from_degrees(theta_deg, 0.0)), eye, true)[1];
        assert!(gloss(50.0) > 2.0 * gloss(15.0) && gloss(50.0) > 0.05, "{} {}", gloss(50.0), gloss(15.0));
        let hidden = ReliefPoint { horizons: [4.0; AZIMUTHS], ..point };
        let light = ReliefLight::new(direction_from_degrees(50.0, 0.0));
        assert_eq!(hidden.shade(&light, eye, true), [EVEN_LIGHT * light.wi[2], 0.0]);
        // Without gloss the body is the same.
        assert_eq!(point.shade(&light, eye, false)[0], point.shade(&light, eye, true)[0]);
    }
}

//! A place of a leaf seen from one outgoing direction: the view-dependent half of shading, done once for any number of
//! lights; and directions drawn for a path. Twin: `leaf/viewed.wgsl`.
//!
//! Light on the eye's side: `pi f cos_i = F c(i, o) cos_i + g pi f_s cos_i` with the body's share F of the light that
//! has entered and the coupling `c(i, o) = (1 - g E(i)) (1 - g E(o)) / (1 - g E_mean)`, E the gloss's directional
//! albedo [after Kelemen & Szirmay-Kalos 2001]. Light on the other side: the body's other share, which enters through
//! the gloss of that face and leaves through the gloss of the seen one; no lobe.
//!
//! A leaf of [`LeafMode::Tissue`] has the table of an algorithmic model in place of all this ([`crate::LeafScattering`]).
//!
//! When it is wrong: in modes of plates transmission is diffuse; tilted normals shade, but cast no shadow; light that the lobe of a tilted
//! normal sends below the horizon is lost.

use crate::decode::sample::sample_about_z;
use crate::leaf::body::{LeafBody, between_faces, body};
use crate::leaf::lobe::{LeafFace, LeafLobe, albedo, lobe, lobe_density, lobe_direction};
use crate::leaf::scatter::{WayColours, scattered, way_colours, way_totals};
use crate::leaf::state::LeafMode;
use crate::leaf::texture::{LeafTexel, texel_at};
use crate::leaf::words::CLASSES;
use crate::numeric::vector::{cross, dot};
use std::f32::consts::PI;

/// Least cosine between a tilted normal and the eye.
pub const MIN_EYE: f32 = 1e-3;
/// Least square of the product of two sines whose azimuths have an angle between them.
pub const MIN_SINES: f32 = 1e-12;
/// Least square of the z of a normal.
pub const MIN_UP: f32 = 0.04;
/// Least probability with which either side of the body and the gloss are drawn.
pub const MIN_SHARE: f32 = 0.02;
/// Weights of linear sRGB in the luminance.
pub const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// A place of a leaf seen from one outgoing direction. The head of the file has the equations.
#[derive(Debug, Clone, Copy)]
pub struct ViewedLeaf<'a> {
    words: &'a [u32],
    gloss: LeafLobe,
    /// Side of the eye: 1 for the front, -1 for the back. Multiplies z to change to the frame of the seen face.
    side: f32,
    /// Unit vector to the eye in the seen face's frame.
    wo: [f32; 3],
    cos_o: f32,
    seen: LeafFace,
    far: LeafFace,
    /// Share of the body that is reflected, times the share that the seen gloss transmits to the eye; the transmitted
    /// one follows.
    reflected: [f32; 3],
    transmitted: [f32; 3],
    /// Colours of the classes of ways of an algorithmic model, whose table takes the place of body and gloss: from the seen face back,
    /// and from the far one through the leaf.
    ways: Option<[WayColours; 2]>,
    /// Probabilities with which the body's two sides and the gloss are drawn.
    shares: [f32; 3],
}

/// Makes a face of the x and y of its normal, and of the cosine and sine of twice the angle of its veins.
fn face(tilt: [f32; 2], veins: [f32; 2], gloss: f32) -> LeafFace {
    let [x, y] = tilt;
    let z = (1.0 - x * x - y * y).max(MIN_UP).sqrt();
    let scale = 1.0 / (x * x + y * y + z * z).sqrt();
    let normal = [x * scale, y * scale, z * scale];
    // Half the angle; without a direction, along y.
    let length = (veins[0] * veins[0] + veins[1] * veins[1]).sqrt();
    let cos2 = if length > 1e-6 { veins[0] / length } else { -1.0 };
    let [vx, vy] = [(0.5 + 0.5 * cos2).max(0.0).sqrt(), (0.5 - 0.5 * cos2).max(0.0).sqrt()];
    let vx = if veins[1] < 0.0 { -vx } else { vx };
    // On the surface above the vein's image: it rises with the slope.
    let vz = -(normal[0] * vx + normal[1] * vy) / normal[2];
    let scale = 1.0 / (1.0 + vz * vz).sqrt();
    let along = [vx * scale, vy * scale, vz * scale];
    LeafFace { normal, along, across: cross(normal, along), gloss }
}

/// Returns the share of the light of cosine `cosine` in the direction `w` that a face's gloss reflects.
fn reflected_by(words: &[u32], gloss: &LeafLobe, face: &LeafFace, cosine: f32, w: [f32; 3]) -> f32 {
    face.gloss * albedo(words, gloss, cosine, [dot(face.along, w), dot(face.across, w)])
}

/// Returns the cosine of the azimuth between two directions whose sines have the product of squares `squares`.
fn azimuth(product: f32, squares: f32) -> f32 {
    if squares > MIN_SINES { product / squares.sqrt() } else { -1.0 }
}

/// Turns a direction to the frame of the other face.
fn turned(w: [f32; 3]) -> [f32; 3] {
    [w[0], w[1], -w[2]]
}

impl<'a> ViewedLeaf<'a> {
    /// Prepares a place of the leaf whose words begin `words`: `uv` (u to the right, v up, one repetition a unit) of
    /// `level` (0 the finest; the coarsest if there are fewer), seen from `wo`, a unit vector in the frame of the front
    /// (x along u, y along v; z < 0 sees the back).
    ///
    /// `factors` are those of the plant, on top of the textures': on chlorophyll, on carotenoids, on brown pigment and
    /// anthocyanins, on thickness; at least 0, and 1 for no change.
    ///
    /// # Panics
    /// If `words` are not those of a [`crate::Leaf`].
    pub fn new(words: &'a [u32], uv: [f32; 2], level: u32, factors: [f32; 4], wo: [f32; 3]) -> ViewedLeaf<'a> {
        let float = |i: usize| f32::from_bits(words[i]);
        let gloss = LeafLobe { index: float(6), gamma: [float(7), float(8)], mean_albedo: float(9) };
        let texel = texel_at(words, uv, level);
        let LeafTexel { tilt: [fx, fy, bx, by], .. } = texel;
        let front = face([fx, fy], texel.veins, texel.gloss[0]);
        let back = face([bx, by], texel.veins, texel.gloss[1]);
        let (side, seen, far) = if wo[2] < 0.0 { (-1.0, back, front) } else { (1.0, front, back) };
        let wo = [wo[0], wo[1], wo[2] * side];
        let cos_o = dot(seen.normal, wo).max(MIN_EYE);
        let lost = reflected_by(words, &gloss, &seen, cos_o, wo);
        let lets_out = [seen, far].map(|face| 1.0 - face.gloss * gloss.mean_albedo);
        let out = (1.0 - lost) / lets_out[0];
        let hidden = [seen, far].map(|face| 0.5 - 0.5 * face.normal[2]);
        let factors = [0, 1, 2, 3].map(|i| texel.factors[i] * factors[i]);
        let is_tissue = words[4] == LeafMode::Tissue as u32;
        let face = usize::from(side < 0.0);
        let passages = [(face, 0), (1 - face, 1)];
        let ways = is_tissue.then(|| passages.map(|(face, side)| way_colours(words, factors, face, side)));
        let (reflected, transmitted, shine) = match &ways {
            Some(ways) => {
                let totals = passages.map(|(face, side)| way_totals(words, face, side));
                let [near, through] = [0, 1].map(|i| {
                    let of = |rgb: usize, class: usize| totals[i][class] * ways[i][class][rgb];
                    [0, 1, 2].map(|rgb| (1..CLASSES).map(|class| of(rgb, class)).sum::<f32>())
                });
                (near, through, totals[0][0])
            }
            None => {
                let held = body(words, factors);
                let held = if side < 0.0 { held.swapped() } else { held };
                let LeafBody { reflectance, transmittance, .. } = between_faces(held, lets_out, hidden);
                (reflectance.map(|c| c * out), transmittance.map(|c| c * out), lost)
            }
        };
        let shares = [dot(LUMINANCE, reflected), dot(LUMINANCE, transmitted), shine].map(|x| x.max(MIN_SHARE));
        let total: f32 = shares.iter().sum();
        ViewedLeaf {
            words,
            gloss,
            side,
            wo,
            cos_o,
            seen,
            far,
            reflected,
            transmitted,
            ways,
            shares: shares.map(|share| share / total),
        }
    }

    /// Multiplies the light that leaves the body by `tint`; the gloss, which has no colour, stays as it is.
    pub fn tinted(self, tint: [f32; 3]) -> ViewedLeaf<'a> {
        let by = |light: [f32; 3]| [0, 1, 2].map(|i| light[i] * tint[i]);
        // The first class is the surface.
        let ways = self.ways.map(|both| {
            both.map(|[surface, ways @ ..]| {
                let [a, b, c] = ways.map(by);
                [surface, a, b, c]
            })
        });
        ViewedLeaf { reflected: by(self.reflected), transmitted: by(self.transmitted), ways, ..self }
    }

    /// Returns `pi * BRDF * |cos_i|` for a light at `wi`, a unit vector in the frame of the front, or `pi * BTDF *
    /// |cos_i|` where the light lies on the other side than the eye; linear sRGB, the cosine inside. 0 where either
    /// lies in the leaf's plane.
    pub fn light(&self, wi: [f32; 3]) -> [f32; 3] {
        let wi = [wi[0], wi[1], wi[2] * self.side];
        if wi[2] == 0.0 || self.wo[2] == 0.0 {
            return [0.0; 3];
        }
        if let Some(ways) = &self.ways {
            return self.of_tissue(ways, wi);
        }
        if wi[2] < 0.0 {
            let wi = turned(wi);
            let cos_i = dot(self.far.normal, wi).max(0.0);
            let enters = 1.0 - reflected_by(self.words, &self.gloss, &self.far, cos_i, wi);
            return self.transmitted.map(|c| c * enters * cos_i);
        }
        let cos_i = dot(self.seen.normal, wi).max(0.0);
        let enters = 1.0 - reflected_by(self.words, &self.gloss, &self.seen, cos_i, wi);
        let shine = self.seen.gloss * lobe(&self.gloss, &self.seen, wi, self.wo, cos_i, self.cos_o);
        self.reflected.map(|c| c * enters * cos_i + shine)
    }

    /// Returns [`ViewedLeaf::light`] by the table of an algorithmic model, for a light in the seen face's frame.
    fn of_tissue(&self, ways: &[WayColours; 2], wi: [f32; 3]) -> [f32; 3] {
        let face = usize::from(self.side < 0.0);
        let (cos_i, cos_phi, place) = if wi[2] < 0.0 {
            // The two faces have two normals; the leaf's plane decides.
            let [x, y, ox, oy] = [wi[0], wi[1], self.wo[0], self.wo[1]];
            let cos_phi = azimuth(x * ox + y * oy, (x * x + y * y) * (ox * ox + oy * oy));
            (dot(self.far.normal, turned(wi)).max(0.0), cos_phi, [1 - face, 1])
        } else {
            let (cos_i, cos_o) = (dot(self.seen.normal, wi).max(0.0), self.cos_o.min(1.0));
            let sines = (1.0 - cos_i * cos_i) * (1.0 - cos_o * cos_o);
            (cos_i, azimuth(dot(wi, self.wo) - cos_i * cos_o, sines), [face, 0])
        };
        scattered(self.words, &ways[place[1]], place, [cos_i.min(1.0), self.cos_o.min(1.0), cos_phi])
            .map(|light| light * cos_i)
    }

    /// Draws a direction to light that matters to this eye, on either side, from three numbers in [0, 1): about the
    /// normals by the cosine, on either side as often as the body's luminance there, or by the facets of the gloss. The
    /// value may be 0 in the direction drawn.
    pub fn sample_direction(&self, at: [f32; 3]) -> [f32; 3] {
        let [reflected, transmitted, _] = self.shares;
        let about = |face: &LeafFace| {
            let [x, y, z] = sample_about_z(1.0, [at[0], at[1]]);
            [0, 1, 2].map(|i| x * face.along[i] + y * face.across[i] + z * face.normal[i])
        };
        let wi = if at[2] < reflected {
            about(&self.seen)
        } else if at[2] < reflected + transmitted {
            turned(about(&self.far))
        } else {
            lobe_direction(&self.gloss, &self.seen, self.wo, [at[0], at[1]])
        };
        [wi[0], wi[1], wi[2] * self.side]
    }

    /// Returns the density of [`ViewedLeaf::sample_direction`] at the unit vector `wi`, per steradian; its integral
    /// over the whole sphere is 1.
    pub fn sample_density(&self, wi: [f32; 3]) -> f32 {
        let wi = [wi[0], wi[1], wi[2] * self.side];
        let [reflected, transmitted, shine] = self.shares;
        let sum = reflected * dot(self.seen.normal, wi).max(0.0)
            + transmitted * dot(self.far.normal, turned(wi)).max(0.0)
            + shine * lobe_density(&self.gloss, &self.seen, wi, self.wo);
        sum / PI
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decode::sample::tests::deviation;
    use crate::leaf::leaf::Leaf;
    use crate::leaf::state::{LeafMode, LeafState};
    use crate::leaf::texture::LeafTexture;
    use crate::testing::{Random, direction_from_degrees};
    use std::f32::consts::TAU;

    const NONE: [f32; 4] = [1.0; 4];

    fn leaf(state: &LeafState, texel: LeafTexel) -> Leaf {
        Leaf::new(state, &LeafTexture::uniform(texel)).unwrap()
    }

    fn seen(leaf: &Leaf, wo: [f32; 3]) -> ViewedLeaf<'_> {
        ViewedLeaf::new(leaf.words(), [0.3, 0.6], 0, NONE, wo)
    }

    /// Returns the state of a leaf without absorption.
    fn clear() -> LeafState {
        LeafState::from_values(LeafMode::NLayers, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.5, 1.42, 0.3, 0.3])
    }

    /// Returns the light that the eye receives under a sky of 1 all around, by midpoints over the sphere.
    fn under_white_sky(viewed: &ViewedLeaf) -> [f64; 3] {
        const ROWS: usize = 400;
        const COLUMNS: usize = 360;
        let mut sum = [0.0; 3];
        for row in 0..ROWS {
            let z = -1.0 + 2.0 * (row as f32 + 0.5) / ROWS as f32;
            for column in 0..COLUMNS {
                let (sin, cos) = (TAU * (column as f32 + 0.5) / COLUMNS as f32).sin_cos();
                let r = (1.0 - z * z).sqrt();
                let value = viewed.light([r * cos, r * sin, z]);
                sum.iter_mut().zip(value).for_each(|(sum, value)| *sum += f64::from(value));
            }
        }
        sum.map(|x| x * 4.0 / (ROWS * COLUMNS) as f64)
    }

    #[test]
    fn a_leaf_that_absorbs_nothing_is_invisible_under_a_white_sky() {
        for mode in [LeafMode::NLayers, LeafMode::TwoSided, LeafMode::Rational] {
            for structure in [1.0, 1.5, 3.0] {
                for gammas in [[0.3, 0.3], [0.5, 0.2]] {
                    let [gamma_along, gamma_across] = gammas;
                    let state = LeafState { mode, structure, gamma_along, gamma_across, ..clear() };
                    for gloss in [[0.0, 0.0], [1.0, 1.0], [0.3, 0.9]] {
                        let leaf = leaf(&state, LeafTexel { gloss, veins: [0.6, 0.8], ..LeafTexel::default() });
                        for wo in [[0.0, 0.0], [40.0, 20.0], [75.0, 100.0], [120.0, 70.0]] {
                            let wo = direction_from_degrees(wo[0], wo[1]);
                            let seen = under_white_sky(&seen(&leaf, wo));
                            let near = seen.iter().all(|c| (c - 1.0).abs() < 4e-3);
                            assert!(near, "{mode:?} N {structure} gamma {gammas:?} gloss {gloss:?} {wo:?}: {seen:?}");
                        }
                    }
                }
            }
        }
        // Planted: a trace of pigment shows.
        let brown = leaf(&LeafState { brown: 0.02, ..clear() }, LeafTexel::default());
        assert!(under_white_sky(&seen(&brown, [0.0, 0.0, 1.0]))[1] < 0.99);
    }

    #[test]
    fn slopes_lose_no_light_but_what_their_gloss_sends_below_the_horizon() {
        for tilt in [[0.3, 0.1, 0.0, 0.0], [-0.2, 0.4, 0.5, 0.1]] {
            for (gloss, most_lost) in [(0.0, 3e-3), (1.0, 0.03)] {
                let leaf = leaf(&clear(), LeafTexel { gloss: [gloss; 2], tilt, ..LeafTexel::default() });
                for theta in [0.0, 30.0, 50.0, 130.0] {
                    let seen = under_white_sky(&seen(&leaf, direction_from_degrees(theta, 20.0)));
                    let range = 1.0 - most_lost..1.01;
                    assert!(seen.iter().all(|c| range.contains(c)), "{tilt:?} {gloss} {theta}: {seen:?}");
                }
            }
        }
    }

    #[test]
    fn no_state_makes_light() {
        let mut random = Random::new(3);
        for round in 0..24 {
            let mode = LeafMode::ALL[round % 3];
            let values = std::array::from_fn(|i| {
                let [least, most] = crate::LEAF_QUANTITIES[i].range;
                // Now and then a hundred times too much; lobes as wide as the midpoints that they are summed over.
                let scale = if i < 6 && round % 5 == 4 { 100.0 } else { 1.0 };
                scale * random.within(if i > 7 { 0.25 } else { least }, most)
            });
            let texel = LeafTexel {
                factors: std::array::from_fn(|_| random.within(0.0, 4.0)),
                gloss: [random.within(0.0, 1.0), random.within(0.0, 1.0)],
                veins: [random.within(-1.0, 1.0), random.within(-1.0, 1.0)],
                ..LeafTexel::default()
            };
            let leaf = leaf(&LeafState::from_values(mode, values), texel);
            for theta in [0.0, 60.0, 82.0, 150.0] {
                let wo = direction_from_degrees(theta, 77.0);
                let all = under_white_sky(&seen(&leaf, wo));
                assert!(all.iter().all(|c| (-0.06..1.005).contains(c)), "{values:?} {texel:?} {theta}: {all:?}");
            }
        }
    }

    #[test]
    fn each_face_and_the_way_through_are_reciprocal() {
        let state = LeafState { gamma_along: 0.5, gamma_across: 0.15, ..LeafState::default() };
        let leaf = leaf(&state, LeafTexel { gloss: [1.0, 0.4], veins: [0.3, -0.7], ..LeafTexel::default() });
        for (a, b) in [
            ([20.0, 10.0], [60.0, 150.0]),
            ([50.0, 90.0], [5.0, 0.0]),
            ([140.0, 30.0], [170.0, 200.0]),
            ([20.0, 10.0], [130.0, 80.0]),
        ] {
            let [a, b] = [a, b].map(|[theta, phi]| direction_from_degrees(theta, phi));
            let forward = seen(&leaf, b).light(a).map(|c| c / a[2].abs());
            let backward = seen(&leaf, a).light(b).map(|c| c / b[2].abs());
            for channel in 0..3 {
                let (x, y) = (forward[channel], backward[channel]);
                assert!((x - y).abs() < 1e-4 * x.abs() + 1e-6, "{a:?} {b:?}: {x} {y}");
            }
            // Planted: with the cosine inside it is not.
            let with_cosines = (seen(&leaf, b).light(a)[1] - seen(&leaf, a).light(b)[1]).abs();
            assert!(with_cosines > 1e-3);
        }
    }

    #[test]
    fn light_from_behind_gives_transmission_alone() {
        // So dark that what is left is gloss.
        let dark = LeafState { brown: 1e4, ..LeafState::default() };
        let dark = leaf(&dark, LeafTexel::default());
        let wo = direction_from_degrees(30.0, 0.0);
        let mirror = direction_from_degrees(30.0, 180.0);
        let lobe = seen(&dark, wo).light(mirror);
        assert!(lobe.iter().all(|c| *c > 0.05), "{lobe:?}");
        for wi in [direction_from_degrees(150.0, 180.0), direction_from_degrees(180.0, 0.0)] {
            let value = seen(&dark, wo).light(wi);
            assert!(value.iter().all(|c| c.abs() < 1e-6), "{value:?}");
        }
        // Of a clear one without gloss both sides give their share times the cosine.
        let clear = leaf(&clear(), LeafTexel { gloss: [0.0; 2], ..LeafTexel::default() });
        let front = seen(&clear, wo).light([0.0, 0.0, 1.0]);
        let behind = seen(&clear, wo).light(direction_from_degrees(120.0, 40.0)).map(|c| 2.0 * c);
        for channel in 0..3 {
            assert!((front[channel] + behind[channel] - 1.0).abs() < 1e-4, "{front:?} {behind:?}");
        }
    }

    #[test]
    fn everything_is_finite_at_every_extreme() {
        let directions = [0.0, 30.0, 89.0, 89.999, 90.0, 90.001, 91.0, 150.0, 180.0]
            .map(|theta| direction_from_degrees(theta, 130.0));
        let values = |content: f32, structure, gamma| {
            [content, content, content, content, content, content, structure, 1.42, gamma, 2.0 * gamma]
        };
        for mode in LeafMode::ALL {
            for content in [0.0, 1e-30, 1.0, 1e4, 1e38, -5.0] {
                for structure in [-1.0, 1.0, 1.000_000_1, 3.0, 100.0] {
                    let state = LeafState::from_values(
                        mode,
                        values(content, structure, [0.0, 0.05, 1.0][structure as usize % 3]),
                    );
                    for factor in [0.0, 1.0, 4.0] {
                        let texel =
                            LeafTexel { factors: [factor; 4], tilt: [1.0, 1.0, -0.9, 0.0], ..LeafTexel::default() };
                        let leaf = leaf(&state, texel);
                        for wo in directions {
                            let viewed = seen(&leaf, wo);
                            for wi in directions.into_iter().chain([wo, wo.map(|c| -c)]) {
                                let value = viewed.light(wi);
                                let fine = value.iter().all(|c| (-0.1..1e4).contains(c));
                                assert!(fine, "{state:?} {factor} {wo:?} {wi:?}: {value:?}");
                                let density = viewed.sample_density(wi);
                                assert!(density.is_finite() && density >= 0.0, "{density}");
                            }
                            for at in [[0.0; 3], [0.999_999_94; 3], [0.5, 0.5, 0.999_999_94], [0.0, 0.3, 0.5]] {
                                let wi = viewed.sample_direction(at);
                                assert!((dot(wi, wi) - 1.0).abs() < 1e-4, "{at:?}: {wi:?}");
                            }
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn directions_are_drawn_with_the_density_that_is_told() {
        let state = LeafState { gamma_along: 0.7, gamma_across: 0.4, ..LeafState::default() };
        for (tilt, theta) in [([0.0; 4], 30.0), ([0.2, 0.3, -0.3, 0.1], 50.0), ([0.1, 0.0, 0.2, 0.1], 130.0)] {
            let leaf = leaf(&state, LeafTexel { tilt, veins: [0.2, 0.9], ..LeafTexel::default() });
            let viewed = seen(&leaf, direction_from_degrees(theta, 35.0));
            let (z, sum) = deviation(|at| viewed.sample_direction(at), |wi| viewed.sample_density(wi), 11);
            assert!(z < 4.5 && (sum - 1.0).abs() < 0.01, "{tilt:?} {theta}: {z} sigma, sum {sum}");
            let drawn = |at: [f32; 3]| viewed.sample_direction([at[0], at[1], 0.8 * at[2]]);
            let (z, _) = deviation(drawn, |wi| viewed.sample_density(wi), 11);
            assert!(z > 10.0, "planted: a lobe that is drawn too seldom, {z}");
        }
    }

    #[test]
    fn a_narrow_lobe_over_a_clear_body_sums_up_to_1_by_its_own_sampling() {
        let state = LeafState { gamma_along: 0.05, gamma_across: 0.05, ..clear() };
        let leaf = leaf(&state, LeafTexel::default());
        for theta in [0.0, 45.0, 70.0, 100.0] {
            let viewed = seen(&leaf, direction_from_degrees(theta, 35.0));
            let mut random = Random::new(8);
            let (count, mut sum) = (200_000, 0.0);
            for _ in 0..count {
                let wi = viewed.sample_direction(std::array::from_fn(|_| random.within(0.0, 1.0)));
                sum += f64::from(viewed.light(wi)[1] / viewed.sample_density(wi));
            }
            let mean = sum / f64::from(count) / f64::from(PI);
            assert!((mean - 1.0).abs() < 5e-3, "{theta}: {mean}");
        }
    }

    #[test]
    fn a_plants_factors_multiply_what_the_leaf_holds() {
        let state = LeafState::default();
        let richer = LeafState { chlorophyll_ug_per_cm2: 60.0, carotenoid_ug_per_cm2: 4.0, ..state };
        let [plain, richer] = [state, richer].map(|state| leaf(&state, LeafTexel::default()));
        let (wo, wi) = (direction_from_degrees(20.0, 0.0), direction_from_degrees(140.0, 0.0));
        let by_factor = ViewedLeaf::new(plain.words(), [0.5; 2], 0, [1.5, 0.5, 1.0, 1.0], wo).light(wi);
        let by_state = seen(&richer, wo).light(wi);
        assert!((0..3).all(|i| (by_factor[i] - by_state[i]).abs() < 1e-6), "{by_factor:?} {by_state:?}");
        assert_ne!(seen(&plain, wo).light(wi), by_state);
    }
}

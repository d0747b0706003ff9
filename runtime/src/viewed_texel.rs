//! A texel as an eye sees it: the half of decoding that does not depend on the light, done once however many lights
//! there are. Twin: `shaders/viewed_texel.wgsl`.
//!
//! What a light costs beyond its own place among the measured lights is kept, too: the residual, summed over the
//! views, at a measured light is a row that later lights between the same measured ones find ready. A light alone makes
//! the three rows that it lies between, as many as it needs; sixteen close ones seldom more than a dozen together.

use crate::asset::LobeRole;
use crate::decode::{DecodeOptions, Interpolation, RATIO_EPSILON, RATIO_RANGE};
use crate::edit::EDIT_WORDS;
use crate::parallax::{HeightField, SeenBy};
use crate::resident::{Resident, block};
use crate::residual::ResidualKind;
use crate::single::SingleBases;
use crate::sphere::{direction, locate};
use crate::texel::{Bases, Texel};

/// Largest value that a tint multiplies, so that what is finite stays so.
const MOST_EDITED: f32 = 1e37;
/// Rows that [`LightRows`] keeps. A measured light has one place, its number modulo this.
pub const LIGHT_ROWS: usize = 32;

/// Rows of one [`ViewedTexel`], by measured light; by default none. Start anew for every viewed texel.
#[derive(Debug, Clone, Default)]
pub struct LightRows {
    /// Number of the measured light plus 1; 0 for no row.
    ids: [u32; LIGHT_ROWS],
    rows: [Row; LIGHT_ROWS],
}

/// What the neighbouring views have at a measured light, summed with their weights.
#[derive(Debug, Clone, Copy, Default)]
struct Row {
    /// Fast rule: the residual. Exact rule: decoded linear values.
    value: [f32; 3],
    /// Exact rule: lobe sums.
    lobes: [f32; 3],
}

/// A texel as the eye at one direction sees it.
#[derive(Debug, Clone, Copy)]
pub struct ViewedTexel<'a> {
    t: Texel<'a>,
    bases: Bases<'a>,
    /// In the layer's frame; z <= 0 is on the other side, and everything black.
    wo: [f32; 3],
    views: [u32; 3],
    weights: [f32; 3],
    /// The texel that each of the views shows, where the eye lies outside their hull and the asset has heights.
    shifted: Option<[Texel<'a>; 3]>,
    kind: ResidualKind,
    guide: bool,
    exact: bool,
}

impl<'a> ViewedTexel<'a> {
    /// `texel` of `layer` seen from `wo`, a unit vector towards the eye in the texel's frame. `layer` and `texel` must
    /// be within the asset. Cost: a search among the measured views; with heights and an eye beyond them four rays.
    pub fn new(
        resident: &'a Resident,
        layer: u32,
        texel: u32,
        wo: [f32; 3],
        options: &DecodeOptions,
    ) -> ViewedTexel<'a> {
        let t = Texel::new(resident, layer, texel, options);
        let bases = Bases::Halves(&t.words[t.field(block::BASIS)..]);
        ViewedTexel::of_texel(t, bases, wo, options)
    }

    /// The same with bases in single precision; `bases` must be of the same asset.
    pub fn new_single(
        resident: &'a Resident,
        bases: &'a SingleBases,
        layer: u32,
        texel: u32,
        wo: [f32; 3],
        options: &DecodeOptions,
    ) -> ViewedTexel<'a> {
        let t = Texel::new(resident, layer, texel, options);
        ViewedTexel::of_texel(t, Bases::Singles(bases.layer(layer as usize)), wo, options)
    }

    fn of_texel(t: Texel<'a>, bases: Bases<'a>, wo: [f32; 3], options: &DecodeOptions) -> ViewedTexel<'a> {
        let wo = [wo[0], wo[1], if t.field(block::VIEW_SIDE) == 1 { -wo[2] } else { wo[2] }];
        let view = locate(t.words, t.field(block::VIEWS), wo);
        let mut viewed = ViewedTexel {
            t,
            bases,
            wo,
            views: view.ids,
            weights: view.weights,
            shifted: None,
            kind: ResidualKind::from_number(t.field(block::RESIDUAL_KIND) as u32).unwrap_or(ResidualKind::Additive),
            // Lobes that only guide are not part of the value, and the fast rule does not ask them.
            guide: t.field(block::LOBE_ROLE) == LobeRole::Guide as usize,
            exact: options.interpolation == Interpolation::Exact,
        };
        if options.parallax
            && view.beyond < 1.0
            && wo[2] > 0.0
            && let Some(heights) = HeightField::of_layer(t.words, t.layer)
        {
            let measured = viewed.measured_views();
            let seen: SeenBy = heights.seen_by(t.texel as u32, wo, view.beyond, &measured, &view.weights);
            viewed.weights = seen.weights;
            viewed.shifted = Some(seen.texels.map(|texel| t.at(texel, options)));
        }
        viewed
    }

    /// Whether its values have a residual; without one they are the lobes alone.
    pub fn has_residual(&self) -> bool {
        self.t.field(block::BASES) > 0
    }

    /// The texel itself.
    pub(crate) fn texel(&self) -> &Texel<'a> {
        &self.t
    }

    /// Towards the eye, in the layer's frame.
    pub(crate) fn eye(&self) -> [f32; 3] {
        self.wo
    }

    /// -1 where the layer's light is on the back, else 1.
    pub(crate) fn light_sign(&self) -> f32 {
        if self.t.field(block::LIGHT_SIDE) == 1 { -1.0 } else { 1.0 }
    }

    fn measured_views(&self) -> [[f32; 3]; 3] {
        self.views.map(|id| direction(self.t.words, self.t.field(block::VIEWS), id))
    }

    /// The texel that neighbouring view `v` shows.
    fn shown_by(&self, v: usize) -> &Texel<'a> {
        self.shifted.as_ref().map_or(&self.t, |shifted| &shifted[v])
    }

    /// Sum of the lobes that the eye sees, RGB, as measured or as an edit has them.
    fn lobe_sum(&self, edit: usize, wi: [f32; 3]) -> [f32; 3] {
        if self.shifted.is_none() {
            return self.t.lobe_sum(edit, wi, self.wo);
        }
        let mut sum = [0.0; 3];
        for v in (0..3).filter(|v| self.weights[*v] > 0.0) {
            let lobes = self.shown_by(v).lobe_sum(edit, wi, self.wo);
            (0..3).for_each(|c| sum[c] += self.weights[v] * lobes[c]);
        }
        sum
    }

    /// The rows of three measured `lights`; those not `wanted` stay 0.
    fn rows(&self, lights: [u32; 3], wanted: [bool; 3], epsilon: f32) -> [Row; 3] {
        let mut rows = [Row::default(); 3];
        let measured = self.measured_views();
        for v in (0..3).filter(|v| self.weights[*v] > 0.0) {
            let (texel, weight) = (self.shown_by(v), self.weights[v]);
            let residual = texel.residual(self.bases, self.views[v], lights, wanted);
            for l in (0..3).filter(|l| wanted[*l]) {
                let row = &mut rows[l];
                if self.exact {
                    let wi = direction(self.t.words, self.t.field(block::LIGHTS), lights[l]);
                    let lobes = texel.lobe_sum(0, wi, measured[v]);
                    for c in 0..3 {
                        let base = if self.guide { 0.0 } else { lobes[c] };
                        row.value[c] += weight * self.kind.combine(base, residual[l][c], epsilon, 1.0);
                        row.lobes[c] += weight * lobes[c];
                    }
                } else {
                    (0..3).for_each(|c| row.value[c] += weight * residual[l][c]);
                }
            }
        }
        rows
    }

    /// Reflectance times cosine times pi, linear RGB, at least 0, for the light at `wi`, a unit vector in the texel's
    /// frame; 0 where light or eye are on another side than the layer's. `rows` are those of this viewed texel.
    ///
    /// Cost: a search among the measured lights, the lobes, and three rows of residual less those that are there.
    pub fn light(&self, rows: &mut LightRows, wi: [f32; 3]) -> [f32; 3] {
        let t = &self.t;
        let wi = [wi[0], wi[1], if t.field(block::LIGHT_SIDE) == 1 { -wi[2] } else { wi[2] }];
        if wi[2] <= 0.0 || self.wo[2] <= 0.0 {
            return [0.0; 3];
        }
        let fade = (wi[2] / t.float(block::HORIZON)).min(1.0);
        let asked = !self.guide || self.exact || t.bases == 0 || t.edit > 0;
        let here = if asked { self.lobe_sum(0, wi) } else { [0.0; 3] };
        let mut value = if t.bases == 0 { here.map(|x| x.max(0.0)) } else { self.measured(rows, wi, here) };
        if t.edit > 0 {
            value = self.edited(value, here, self.lobe_sum(t.edit, wi));
        }
        value.map(|x| x * fade)
    }

    /// [`ViewedTexel::light`] for a light that shares its rows with no other.
    pub fn light_alone(&self, wi: [f32; 3]) -> [f32; 3] {
        self.light(&mut LightRows::default(), wi)
    }

    /// A measured value with the lobes' sum `here` and the edited lobes' sum; see edit.rs.
    fn edited(&self, value: [f32; 3], here: [f32; 3], lobes: [f32; 3]) -> [f32; 3] {
        let t = &self.t;
        let at = t.field(block::EDITS) + (t.edit - 1) * EDIT_WORDS;
        let [r, g, b, keep] = [0, 1, 2, 3].map(|i| f32::from_bits(t.words[at + i]));
        let (tint, epsilon) = ([r, g, b], t.float(block::EPSILON));
        [0, 1, 2].map(|c| {
            let left = self.kind.encode(value[c], epsilon) - self.kind.encode(here[c], epsilon);
            tint[c] * self.kind.combine(lobes[c], keep * left, epsilon, 1.0).min(MOST_EDITED)
        })
    }

    /// The measured value in the direction `wi` of the layer's frame, without the fade to the horizon; `here` are the lobes,
    /// where they are asked.
    fn measured(&self, rows: &mut LightRows, wi: [f32; 3], here: [f32; 3]) -> [f32; 3] {
        let t = &self.t;
        let light = locate(t.words, t.field(block::LIGHTS), wi);
        let epsilon = t.float(block::EPSILON);

        let place = light.ids.map(|id| id as usize % LIGHT_ROWS);
        let mut wanted = [0, 1, 2].map(|l| light.weights[l] > 0.0);
        let mut found = [Row::default(); 3];
        for l in 0..3 {
            if wanted[l] && rows.ids[place[l]] == light.ids[l] + 1 {
                found[l] = rows.rows[place[l]];
                wanted[l] = false;
            }
        }
        if wanted.contains(&true) {
            let made = self.rows(light.ids, wanted, epsilon);
            for l in (0..3).filter(|l| wanted[*l]) {
                found[l] = made[l];
                rows.ids[place[l]] = light.ids[l] + 1;
                rows.rows[place[l]] = made[l];
            }
        }
        let mix = |of: fn(&Row) -> [f32; 3]| {
            [0, 1, 2].map(|c| (0..3).map(|l| light.weights[l] * of(&found[l])[c]).sum::<f32>())
        };
        let value = mix(|row| row.value);
        if !self.exact {
            // Beyond the lights' hull the residual falls with the light's cosine; alone, the decoded value does.
            let (base, scaled, falling) =
                if self.guide { ([0.0; 3], 1.0, light.beyond) } else { (here, light.beyond, 1.0) };
            return [0, 1, 2].map(|c| self.kind.combine(base[c], value[c], epsilon, scaled) * falling);
        }
        let lobes = mix(|row| row.lobes);
        [0, 1, 2].map(|c| {
            let ratio = (here[c] + RATIO_EPSILON) / (lobes[c] + RATIO_EPSILON);
            value[c] * ratio.clamp(RATIO_RANGE[0], RATIO_RANGE[1])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decode::decode;
    use crate::parallax::Heights;
    use crate::testing::{Random, sample_asset};

    #[test]
    fn lights_that_share_rows_decode_as_each_would_alone() {
        for (seed, kind) in [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root].into_iter().enumerate() {
            for (role, interpolation) in
                [(LobeRole::Base, Interpolation::Fast), (LobeRole::Guide, Interpolation::Exact)]
            {
                let mut asset = sample_asset(60 + seed as u64, 6, 5, kind);
                asset.layers[0].lobe_role = role;
                asset.layers[0].heights =
                    Some(Heights { step: 0.1, codes: (0..30u8).map(|i| (i * 7 % 11) as i8 - 5).collect() });
                let resident = Resident::from_asset(&asset);
                let options = DecodeOptions { interpolation, ..DecodeOptions::default() };
                let mut random = Random::new(61);
                let mut others = 0;
                for _ in 0..100 {
                    let (texel, wo) = (random.below(30) as u32, random.direction());
                    let viewed = ViewedTexel::new(&resident, 0, texel, wo, &options);
                    let mut rows = LightRows::default();
                    // Rows of another texel are not this one's.
                    let other = ViewedTexel::new(&resident, 0, (texel + 7) % 30, wo, &options);
                    let mut foreign = LightRows::default();
                    for _ in 0..40 {
                        let wi = random.direction();
                        let alone = decode(&resident, 0, texel, wi, wo, &options);
                        assert_eq!(viewed.light(&mut rows, wi), alone, "{kind:?} {interpolation:?}");
                        other.light(&mut foreign, wi);
                        others += u32::from(viewed.light(&mut foreign, wi) != alone);
                    }
                }
                assert!(others > 1000, "{others}");
            }
        }
    }

    #[test]
    fn close_lights_make_few_rows() {
        let asset = sample_asset(70, 6, 5, ResidualKind::Root);
        let resident = Resident::from_asset(&asset);
        let viewed = ViewedTexel::new(&resident, 0, 3, [0.0, 0.0, 1.0], &DecodeOptions::default());
        let mut rows = LightRows::default();
        for i in 0..16 {
            let angle = i as f32 * 0.4;
            let wi = [0.3 + 0.01 * angle.cos(), 0.01 * angle.sin(), 0.95];
            viewed.light(&mut rows, wi);
        }
        assert!(rows.ids.iter().filter(|id| **id != 0).count() <= 4);
    }
}

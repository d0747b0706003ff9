//! A texel seen from one outgoing direction: the view-dependent half of decoding, done once for any number of lights.
//! Twin: `decode/viewed_texel.wgsl`.
//!
//! Lights share work, too. The residual, summed over the views, at a measured light is a row that is kept: later lights
//! between the same measured ones find it ready, and sixteen close lights seldom make more than a dozen rows together.
//! A single light needs no rows: its residual is summed over views and lights at once.

use crate::asset::asset::LobeRole;
use crate::asset::edit::EDIT_WORDS;
use crate::asset::height_field::HeightField;
use crate::asset::lobe::{LobeSetup, ResidentLobe};
use crate::asset::residual::ResidualKind;
use crate::asset::spectrum::Channels;
use crate::asset::sphere::{Neighbours, direction, locate, within_hull};
use crate::decode::options::{DecodeOptions, HeightUse, Interpolation, RATIO_EPSILON, RATIO_RANGE};
use crate::decode::packed_sum::{MAX_PAIRS, packed_sum};
use crate::decode::parallax::SeenBy;
use crate::decode::relief::{OwnLight, ReliefTerms, SeenRelief};
use crate::decode::residual_sum::{Bases, BasisWeights, FEW_BLOCKS, MAX_BLOCKS, fit_blocks, residual_sum};
use crate::decode::shown::{all_channels, groups, shown};
use crate::decode::texel::Texel;
use crate::numeric::in_vectors::in_vectors;
use crate::resident::layout::block;
use crate::resident::resident::Resident;
use crate::resident::single::SingleBases;
use pulp::{Simd, WithSimd};

/// Largest value that a tint multiplies, so that a finite value stays finite.
const MAX_EDITED: f32 = 1e37;
/// Words of a cache line.
const CACHE_LINE_WORDS: usize = 16;
/// Number of rows that [`LightRows`] keeps. A measured light has one place: its number modulo this.
pub const LIGHT_ROWS: usize = 32;

/// The rows of one [`ViewedTexel`], by measured light; empty by default. Each viewed texel needs rows of its own.
#[derive(Debug, Clone, Default)]
pub struct LightRows {
    /// Number of the measured light plus 1; 0 for no row.
    ids: [u32; LIGHT_ROWS],
    rows: [Row; LIGHT_ROWS],
}

impl LightRows {
    /// Returns the rows of those of three measured `lights` that are `wanted`. `make` computes the missing ones, which
    /// are kept.
    fn find_or_make(
        &mut self,
        lights: [u32; 3],
        mut wanted: [bool; 3],
        make: impl Fn([bool; 3]) -> [Row; 3],
    ) -> [Row; 3] {
        let place = lights.map(|id| id as usize % LIGHT_ROWS);
        let mut found = [Row::default(); 3];
        for l in 0..3 {
            if wanted[l] && self.ids[place[l]] == lights[l] + 1 {
                found[l] = self.rows[place[l]];
                wanted[l] = false;
            }
        }
        if wanted.contains(&true) {
            let made = make(wanted);
            for l in (0..3).filter(|l| wanted[*l]) {
                found[l] = made[l];
                self.ids[place[l]] = lights[l] + 1;
                self.rows[place[l]] = made[l];
            }
        }
        found
    }
}

/// The sum over the neighbouring views at a measured light, with their weights.
#[derive(Debug, Clone, Copy, Default)]
struct Row {
    /// Fast rule: the residual, less what relief adds. Exact rule: decoded linear values.
    value: [f32; 3],
    /// Exact rule: sums of the lobes. Fast rule with relief: shading of the points that the views show.
    other: [f32; 3],
}

/// A light on the layer's side.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lit {
    /// Unit vector to the light in the layer's frame.
    wi: [f32; 3],
    /// Direction for which the value is taken: that of the light, or the nearest one within the hull of the measured
    /// lights.
    toward: [f32; 3],
    /// Neighbours of the light among the measured ones, where there is a residual.
    place: Option<Neighbours>,
}

impl Lit {
    /// Returns the direction for which lobes are evaluated.
    pub(crate) fn toward(&self) -> [f32; 3] {
        self.toward
    }
}

/// A value by the fast rule whose lobes and residual are still apart: [`ResidualKind::combine`] makes them one.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Parts {
    pub lobes: [f32; 3],
    pub residual: [f32; 3],
    /// Fall of the combined value beyond the measured lights, and what is multiplied with the value after that.
    pub falls: [f32; 2],
}

/// A texel seen from one outgoing direction.
#[derive(Debug, Clone, Copy)]
pub struct ViewedTexel<'a> {
    t: Texel<'a>,
    bases: Bases<'a>,
    /// Unit vector to the eye in the layer's frame. With z <= 0 the eye is on the other side, and every value is black.
    wo: [f32; 3],
    views: [u32; 3],
    weights: [f32; 3],
    /// Texel that each neighbouring view shows, where the eye lies outside the views' hull and the asset has heights.
    shifted: Option<[Texel<'a>; 3]>,
    /// Points that are seen, where relief corrects the interpolation.
    relief: Option<SeenRelief>,
    kind: ResidualKind,
    role: LobeRole,
    exact: bool,
}

impl<'a> ViewedTexel<'a> {
    /// Prepares `texel` of `layer` for the eye at `wo`, a unit vector in the texel's frame. `layer` and `texel` must be
    /// within the asset. Cost: a search among the measured views; four rays more for an eye outside their hull, where
    /// the layer has heights.
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

    /// Prepares a texel like [`ViewedTexel::new`], with bases in single precision; `bases` must be of the same asset.
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
            relief: None,
            kind: ResidualKind::from_number(t.field(block::RESIDUAL_KIND) as u32).unwrap_or(ResidualKind::Additive),
            role: LobeRole::from_number(t.field(block::LOBE_ROLE) as u32).unwrap_or(LobeRole::Guide),
            exact: options.interpolation == Interpolation::Exact,
        };
        if options.heights != HeightUse::None
            && wo[2] > 0.0
            && let Some(heights) = HeightField::of_layer(t.words, t.layer)
        {
            let measured = viewed.measured_views();
            if view.beyond < 1.0 {
                let seen: SeenBy = heights.seen_by(t.texel as u32, wo, view.beyond, &measured, &view.weights);
                viewed.weights = seen.weights;
                viewed.shifted = Some(seen.texels.map(|texel| t.at(texel, options)));
            }
            if options.heights == HeightUse::Relief && !viewed.exact && t.has_relief() {
                let eyes = [wo, within_hull(t.words, t.field(block::VIEWS), wo, &view)];
                let shown = [0, 1, 2].map(|v| viewed.shown_by(v).texel);
                let relief = SeenRelief::new(&t, &heights, eyes, &measured, shown, &viewed.weights);
                viewed.weights = relief.view_weights(viewed.weights);
                viewed.relief = Some(relief);
            }
        }
        viewed
    }

    /// Returns whether the values have a residual; without one they are the lobes alone.
    pub fn has_residual(&self) -> bool {
        self.t.field(block::BASES) > 0
    }

    /// Returns the texel.
    pub(crate) fn texel(&self) -> &Texel<'a> {
        &self.t
    }

    /// Returns the unit vector to the eye, in the layer's frame.
    pub(crate) fn eye(&self) -> [f32; 3] {
        self.wo
    }

    /// Returns -1 where the layer's light is on the back, else 1.
    pub(crate) fn light_sign(&self) -> f32 {
        if self.t.field(block::LIGHT_SIDE) == 1 { -1.0 } else { 1.0 }
    }

    fn measured_views(&self) -> [[f32; 3]; 3] {
        self.views.map(|id| direction(self.t.words, self.t.field(block::VIEWS), id))
    }

    /// Returns the texel that neighbouring view `v` shows.
    fn shown_by(&self, v: usize) -> &Texel<'a> {
        self.shifted.as_ref().map_or(&self.t, |shifted| &shifted[v])
    }

    /// Sums the lobes that the eye sees, RGB, as measured (`edit` 0) or as an edit has them; `value` evaluates one
    /// lobe.
    fn lobe_sum(&self, edit: usize, value: &mut impl FnMut(&ResidentLobe) -> f32) -> [f32; 3] {
        if self.shifted.is_none() {
            return self.t.lobe_sum(edit, value);
        }
        let mut sum = [0.0; 3];
        for v in (0..3).filter(|v| self.weights[*v] > 0.0) {
            let lobes = self.shown_by(v).lobe_sum(edit, &mut *value);
            (0..3).for_each(|c| sum[c] += self.weights[v] * lobes[c]);
        }
        sum
    }

    /// Adds to a row the value that neighbouring view `v` has at a measured `light` under the exact rule.
    fn add_decoded(&self, row: &mut Row, v: usize, light: u32, residual: [f32; 3], epsilon: f32) {
        let [wi, wo] = [(block::LIGHTS, light), (block::VIEWS, self.views[v])]
            .map(|(set, id)| direction(self.t.words, self.t.field(set), id));
        let lobes = self.shown_by(v).lobe_sum(0, |lobe| LobeSetup::from_resident_words(lobe).eval(wi, wo));
        let value =
            self.kind.combine_rgb(if self.role == LobeRole::Guide { [0.0; 3] } else { lobes }, residual, epsilon);
        for c in 0..3 {
            row.value[c] += self.weights[v] * value[c];
            row.other[c] += self.weights[v] * lobes[c];
        }
    }

    /// Computes the rows of three measured `lights`; those not `wanted` stay 0.
    fn rows(&self, lights: [u32; 3], wanted: [bool; 3], epsilon: f32) -> [Row; 3] {
        let mut rows = [Row::default(); 3];
        if let Some(relief) = &self.relief {
            let (terms, _) = self.relief_terms(relief, lights, wanted, None);
            for (row, terms) in rows.iter_mut().zip(terms) {
                *row = Row { value: terms.added.map(|x| -x), other: terms.shading };
            }
        }
        for l in (0..3).filter(|l| wanted[*l]) {
            let mut shares = [0.0; 3];
            shares[l] = 1.0;
            if !self.exact {
                let residual = self.residual(lights, shares, self.weights);
                (0..3).for_each(|c| rows[l].value[c] += residual[c]);
                continue;
            }
            for v in (0..3).filter(|v| self.weights[*v] > 0.0) {
                let mut of_view = [0.0; 3];
                of_view[v] = 1.0;
                self.add_decoded(&mut rows[l], v, lights[l], self.residual(lights, shares, of_view), epsilon);
            }
        }
        rows
    }

    /// Sums the residual at the measured `lights` and the neighbouring views, RGB, with the shares of the lights and of
    /// the views.
    fn residual(&self, lights: [u32; 3], of_lights: [f32; 3], of_views: [f32; 3]) -> [f32; 3] {
        if self.t.is_packed() && matches!(self.bases, Bases::Halves(_)) {
            return self.packed_residual(lights, of_lights, of_views);
        }
        let sum = Residual { viewed: self, lights, of_lights, of_views };
        match fit_blocks(self.t.field(block::CHANNEL_WORDS), FEW_BLOCKS) {
            true => in_vectors(InBlocks::<'_, '_, FEW_BLOCKS>(sum)),
            false => in_vectors(InBlocks::<'_, '_, MAX_BLOCKS>(sum)),
        }
    }

    /// Sums like [`ViewedTexel::residual`] from packed bases.
    fn packed_residual(&self, lights: [u32; 3], of_lights: [f32; 3], of_views: [f32; 3]) -> [f32; 3] {
        let row = |v: usize, l: usize| self.shown_by(v).packed_row(self.views[v], lights[l]);
        if self.shifted.is_none() {
            let (mut shares, mut rows, mut count) = ([0.0; MAX_PAIRS], [0; MAX_PAIRS], 0);
            for (v, l) in (0..3).flat_map(|v| (0..3).map(move |l| (v, l))) {
                let share = of_views[v] * of_lights[l];
                if share > 0.0 {
                    (shares[count], rows[count]) = (share, row(v, l));
                    count += 1;
                }
            }
            return packed_sum(&self.t, &shares[..count], &rows[..count]);
        }
        let mut sum = [0.0; 3];
        for v in (0..3).filter(|v| of_views[*v] > 0.0) {
            let shares = [0, 1, 2].map(|l| of_views[v] * of_lights[l]);
            let of_view = packed_sum(self.shown_by(v), &shares, &[0, 1, 2].map(|l| row(v, l)));
            (0..3).for_each(|c| sum[c] += of_view[c]);
        }
        sum
    }

    /// Returns reflectance times cosine times pi, linear RGB, at least 0, for the light at `wi`, a unit vector in the
    /// texel's frame. The value is 0 where light or eye are on another side than the layer's. `rows` must be those of
    /// this viewed texel.
    ///
    /// Cost: a search among the measured lights, the lobes, and up to three rows of residual.
    pub fn light(&self, rows: &mut LightRows, wi: [f32; 3]) -> [f32; 3] {
        let Some(lit) = self.lit(wi) else { return [0.0; 3] };
        shown(self.t.words, |group| self.value(Some(rows), &self.of_group(&lit, group), &mut self.lobes(lit.toward)))
    }

    /// Returns the value of [`ViewedTexel::light`] for a light that shares its rows with no other.
    pub fn light_alone(&self, wi: [f32; 3]) -> [f32; 3] {
        let Some(lit) = self.lit(wi) else { return [0.0; 3] };
        shown(self.t.words, |group| self.value(None, &self.of_group(&lit, group), &mut self.lobes(lit.toward)))
    }

    /// Returns the values of all channels where [`ViewedTexel::light_alone`] gives what follows from them; `None` where
    /// that is black.
    pub fn channels_alone(&self, wi: [f32; 3]) -> Option<Channels> {
        let lit = self.lit(wi)?;
        let value = |group| self.value(None, &self.of_group(&lit, group), &mut self.lobes(lit.toward));
        Some(all_channels(groups(self.t.words), value))
    }

    /// Returns `lit` with the measured lights of a group of channels.
    fn of_group(&self, lit: &Lit, group: usize) -> Lit {
        let first = group * (self.t.field(block::LIGHT_COUNT) / groups(self.t.words));
        let place = lit.place.map(|place| Neighbours { ids: place.ids.map(|id| id + first as u32), ..place });
        Lit { place, ..*lit }
    }

    /// Returns a function that evaluates one lobe for the light at `wi`.
    fn lobes(&self, wi: [f32; 3]) -> impl FnMut(&ResidentLobe) -> f32 {
        let wo = self.wo;
        move |lobe| LobeSetup::from_resident_words(lobe).eval(wi, wo)
    }

    /// Prepares the light at `wi`; `None` where light or eye are on another side than the layer's.
    pub(crate) fn lit(&self, wi: [f32; 3]) -> Option<Lit> {
        let wi = [wi[0], wi[1], wi[2] * self.light_sign()];
        (wi[2] > 0.0 && self.wo[2] > 0.0).then(|| {
            let at = self.t.field(block::LIGHTS);
            let place = (self.t.bases > 0).then(|| locate(self.t.words, at, wi));
            let toward = match &place {
                Some(place) if self.falls_at_last() => within_hull(self.t.words, at, wi, place),
                _ => wi,
            };
            Lit { wi, toward, place }
        })
    }

    /// Calls `ask` with every lobe whose value [`ViewedTexel::value`] takes, in that order.
    pub(crate) fn ask_lobes(&self, mut ask: impl FnMut(&ResidentLobe)) {
        for edit in [self.asks_lobes().then_some(0), (self.t.edit > 0).then_some(self.t.edit)].into_iter().flatten() {
            for v in 0..if self.shifted.is_some() { 3 } else { 1 } {
                if self.shifted.is_none() || self.weights[v] > 0.0 {
                    let texel = self.shown_by(v);
                    texel.lobes_of(texel.dictionary(edit)).for_each(|(lobe, _)| ask(lobe));
                }
            }
        }
    }

    /// Returns whether the value is that at the lights' hull, and falls beyond it after all else.
    fn falls_at_last(&self) -> bool {
        self.role == LobeRole::Base && !self.exact
    }

    /// Lobes that only guide are not part of the value, and the fast rule does not ask them.
    fn asks_lobes(&self) -> bool {
        self.role != LobeRole::Guide || self.exact || self.t.bases == 0 || self.t.edit > 0
    }

    /// Calls `take` with the words that [`ViewedTexel::value`] will read far from each other, for prefetching: the
    /// first of the texel's lobes, and a word of each cache line of each pair of a measured view and light.
    pub(crate) fn ahead(&self, lit: &Lit, mut take: impl FnMut(usize)) {
        if self.asks_lobes() {
            take(self.t.first_lobe());
        }
        let Some(light) = &lit.place else { return };
        for (view, _) in self.views.iter().zip(self.weights).filter(|(_, weight)| *weight > 0.0) {
            for (light, _) in light.ids.iter().zip(light.weights).filter(|(_, weight)| *weight > 0.0) {
                let (first, length) = match self.t.is_packed() {
                    true => (self.t.packed_row(*view, *light), self.t.packed().row_words(self.t.cluster)),
                    false => {
                        let first = self.t.field(block::BASIS) + self.t.bases_at(*view, *light);
                        (first, 3 * self.t.field(block::CHANNEL_WORDS))
                    }
                };
                let row = first..first + length;
                row.clone().step_by(CACHE_LINE_WORDS).chain(row.last()).for_each(&mut take);
            }
        }
    }

    /// Returns the value of each channel for `lit`; `lobe` evaluates one lobe.
    pub(crate) fn value(
        &self,
        rows: Option<&mut LightRows>,
        lit: &Lit,
        lobe: &mut impl FnMut(&ResidentLobe) -> f32,
    ) -> [f32; 3] {
        let t = &self.t;
        let here = if self.asks_lobes() { self.lobe_sum(0, lobe) } else { [0.0; 3] };
        let mut value = match &lit.place {
            None => here.map(|x| x.max(0.0)),
            Some(place) => self.measured(rows, place, lit, here),
        };
        if t.edit > 0 {
            value = self.edited(value, here, self.lobe_sum(t.edit, lobe));
        }
        let fall = self.last_fall(lit);
        value.map(|x| x * fall)
    }

    /// Returns the factor of the value that comes after all else: its fade to the horizon, and beyond the lights' hull.
    fn last_fall(&self, lit: &Lit) -> f32 {
        let fade = (lit.wi[2] / self.t.float(block::HORIZON)).min(1.0);
        fade * lit.place.as_ref().filter(|_| self.falls_at_last()).map_or(1.0, |place| place.beyond)
    }

    /// Returns the parts of the value for `lit` alone; `None` where [`ViewedTexel::value`] does more than to combine them,
    /// and has to be asked. `lobe` evaluates one lobe.
    pub(crate) fn parts(&self, lit: &Lit, lobe: &mut impl FnMut(&ResidentLobe) -> f32) -> Option<Parts> {
        let light = lit.place.as_ref().filter(|_| !self.exact && self.t.edit == 0)?;
        let here = if self.asks_lobes() { self.lobe_sum(0, lobe) } else { [0.0; 3] };
        let parts = self.parts_of(here, self.residual_alone(light, lit), light.beyond);
        Some(Parts { falls: [parts.falls[0], self.last_fall(lit)], ..parts })
    }

    /// Returns the curve in which a value's parts are combined.
    pub(crate) fn curve(&self) -> (ResidualKind, f32) {
        (self.kind, self.t.float(block::EPSILON))
    }

    /// Applies the texel's edit to a measured value, given the measured lobe sum `here` and the edited one; the
    /// equation is that of `asset/edit.rs`.
    fn edited(&self, value: [f32; 3], here: [f32; 3], lobes: [f32; 3]) -> [f32; 3] {
        let t = &self.t;
        let at = t.field(block::EDITS) + (t.edit - 1) * EDIT_WORDS;
        let [r, g, b, keep] = [0, 1, 2, 3].map(|i| f32::from_bits(t.words[at + i]));
        let (tint, epsilon) = ([r, g, b], t.float(block::EPSILON));
        [0, 1, 2].map(|c| {
            let left = self.kind.encode(value[c], epsilon) - self.kind.encode(here[c], epsilon);
            tint[c] * self.kind.combine(lobes[c], keep * left, epsilon).min(MAX_EDITED)
        })
    }

    /// Combines the lobes `here` with the interpolated residual by the fast rule. Outside the lights' hull the decoded
    /// value falls with the light's cosine: at last, or here where lobes only guide; the residual does for an old base.
    fn combined(&self, here: [f32; 3], residual: [f32; 3], beyond: f32) -> [f32; 3] {
        let Parts { lobes, residual, falls } = self.parts_of(here, residual, beyond);
        self.kind.combine_rgb(lobes, residual, self.t.float(block::EPSILON)).map(|x| x * falls[0])
    }

    /// Returns the parts that [`ViewedTexel::combined`] combines.
    fn parts_of(&self, here: [f32; 3], residual: [f32; 3], beyond: f32) -> Parts {
        let (lobes, scaled, falling) = match self.role {
            LobeRole::OldBase => (here, beyond, 1.0),
            LobeRole::Guide => ([0.0; 3], 1.0, beyond),
            LobeRole::Base => (here, 1.0, 1.0),
        };
        let scale = self.kind.scale_beyond(scaled);
        Parts { lobes, residual: residual.map(|r| scale * r), falls: [falling, 1.0] }
    }

    /// Returns the interpolated residual by the fast rule for `lit` alone between the measured `light`s.
    fn residual_alone(&self, light: &Neighbours, lit: &Lit) -> [f32; 3] {
        match &self.relief {
            Some(relief) => self.relieved(relief, None, light, lit),
            None => self.residual(light.ids, light.weights, self.weights),
        }
    }

    /// Returns the interpolated residual with the terms of relief by the fast rule, for `lit` between the measured `light`s.
    fn relieved(&self, relief: &SeenRelief, rows: Option<&mut LightRows>, light: &Neighbours, lit: &Lit) -> [f32; 3] {
        let epsilon = self.t.float(block::EPSILON);
        let wanted = light.weights.map(|weight| weight > 0.0);
        let own = OwnLight { wi: lit.wi, toward: lit.toward, beyond: light.beyond };
        let Some(rows) = rows else {
            let (of_lights, here) = self.relief_terms(relief, light.ids, wanted, Some(own));
            let weights = relief.light_weights(light.weights, here.shading, of_lights.map(|terms| terms.shading));
            let mut sum = self.residual(light.ids, weights, self.weights);
            for c in 0..3 {
                sum[c] += here.added[c] - (0..3).map(|l| weights[l] * of_lights[l].added[c]).sum::<f32>();
            }
            return sum;
        };
        let found = rows.find_or_make(light.ids, wanted, |missing| self.rows(light.ids, missing, epsilon));
        let (_, here) = self.relief_terms(relief, light.ids, [false; 3], Some(own));
        let weights = relief.light_weights(light.weights, here.shading, found.map(|row| row.other));
        [0, 1, 2].map(|c| here.added[c] + (0..3).map(|l| weights[l] * found[l].value[c]).sum::<f32>())
    }

    /// Returns the terms of relief at the measured `lights` that are `wanted`, and those of the eye's own point.
    fn relief_terms(
        &self,
        relief: &SeenRelief,
        lights: [u32; 3],
        wanted: [bool; 3],
        own: Option<OwnLight>,
    ) -> ([ReliefTerms; 3], ReliefTerms) {
        let at = self.t.field(block::LIGHTS);
        let wis = [0, 1, 2].map(|l| wanted[l].then(|| direction(self.t.words, at, lights[l])));
        relief.of_lights(wis, own, &self.measured_views(), self.weights, self.t.float(block::EPSILON))
    }

    /// Returns the measured value for `lit` between the measured `light`s, without its fall towards the horizon; `here` are
    /// the lobes, where they are needed.
    fn measured(&self, rows: Option<&mut LightRows>, light: &Neighbours, lit: &Lit, here: [f32; 3]) -> [f32; 3] {
        let epsilon = self.t.float(block::EPSILON);
        if rows.is_none() && !self.exact {
            return self.combined(here, self.residual_alone(light, lit), light.beyond);
        }
        if let Some(relief) = &self.relief {
            return self.combined(here, self.relieved(relief, rows, light, lit), light.beyond);
        }
        let wanted = light.weights.map(|weight| weight > 0.0);
        let found = match rows {
            None => self.rows(light.ids, wanted, epsilon),
            Some(rows) => rows.find_or_make(light.ids, wanted, |missing| self.rows(light.ids, missing, epsilon)),
        };
        let mix = |of: fn(&Row) -> [f32; 3]| {
            [0, 1, 2].map(|c| (0..3).map(|l| light.weights[l] * of(&found[l])[c]).sum::<f32>())
        };
        let value = mix(|row| row.value);
        if !self.exact {
            return self.combined(here, value, light.beyond);
        }
        let lobes = mix(|row| row.other);
        [0, 1, 2].map(|c| {
            let ratio = (here[c] + RATIO_EPSILON) / (lobes[c] + RATIO_EPSILON);
            value[c] * ratio.clamp(RATIO_RANGE[0], RATIO_RANGE[1])
        })
    }
}

/// The arguments of [`ViewedTexel::residual`], for [`pulp`].
struct Residual<'a, 'b> {
    viewed: &'b ViewedTexel<'a>,
    lights: [u32; 3],
    of_lights: [f32; 3],
    of_views: [f32; 3],
}

/// [`Residual`] evaluated with SIMD. `BLOCKS` bounds the scratch array, because clearing a large one costs more than
/// summing a few blocks.
struct InBlocks<'a, 'b, const BLOCKS: usize>(Residual<'a, 'b>);

impl<const BLOCKS: usize> WithSimd for InBlocks<'_, '_, BLOCKS> {
    type Output = [f32; 3];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> [f32; 3] {
        let Residual { viewed, lights, of_lights, of_views } = self.0;
        let own = BasisWeights::<BLOCKS>::of_texel(&viewed.t);
        let shifted = viewed.shifted.as_ref().map(|texels| texels.each_ref().map(BasisWeights::<BLOCKS>::of_texel));
        let weights = shifted.as_ref().map_or([&own; 3], |shifted| shifted.each_ref());
        let (mut pairs, mut count) = ([(0.0, 0, &own); 9], 0);
        for v in 0..3 {
            for l in 0..3 {
                let share = of_views[v] * of_lights[l];
                if share > 0.0 {
                    let first = viewed.shown_by(v).bases_at(viewed.views[v], lights[l]);
                    pairs[count] = (share, first, weights[v]);
                    count += 1;
                }
            }
        }
        residual_sum(simd, viewed.bases, &pairs[..count])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::asset::Asset;
    use crate::asset::heights::Heights;
    use crate::asset::relief::Relief;
    use crate::decode::decode::decode;
    use crate::testing::{Random, sample_asset, sample_relief_asset};

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
                        // Alone, the rows are summed in another order.
                        let close = |value: [f32; 3]| {
                            (0..3).all(|c| (value[c] - alone[c]).abs() <= 1e-5 * (1.0 + alone[c].abs()))
                        };
                        assert!(close(viewed.light(&mut rows, wi)), "{kind:?} {interpolation:?}");
                        other.light(&mut foreign, wi);
                        others += u32::from(!close(viewed.light(&mut foreign, wi)));
                    }
                }
                assert!(others > 1000, "{others}");
            }
        }
    }

    #[test]
    fn relief_changes_nothing_at_measured_directions_and_lights_share_its_rows() {
        let asset = sample_relief_asset(64, 12, 10);
        let resident = Resident::from_asset(&asset);
        let relief = DecodeOptions::default();
        let plain = DecodeOptions { heights: HeightUse::Parallax, ..relief };
        let layer = &asset.layers[0];
        let (lights, views) = (&layer.lights, &layer.views);
        let mut changed = 0;
        let far = |a: [f32; 3], b: [f32; 3], share: f32| (0..3).any(|c| (a[c] - b[c]).abs() > share * (1.0 + b[c]));
        for texel in (0..120).step_by(7) {
            for view in 0..views.len() as u32 {
                let viewed = ViewedTexel::new(&resident, 0, texel, views.direction(view), &relief);
                let mut rows = LightRows::default();
                for light in 0..lights.len() as u32 {
                    let (wi, wo) = (lights.direction(light), views.direction(view));
                    let measured = decode(&resident, 0, texel, wi, wo, &plain);
                    assert!(
                        !far(decode(&resident, 0, texel, wi, wo, &relief), measured, 2e-5),
                        "{texel} {view} {light}"
                    );
                    assert!(!far(viewed.light(&mut rows, wi), measured, 2e-5));
                    // Between the directions.
                    let near = lights.direction((light + 1) % lights.len() as u32);
                    let between = [0, 1, 2].map(|i| wi[i] + 0.8 * near[i]);
                    let length = between.iter().map(|x| x * x).sum::<f32>().sqrt();
                    let wi = between.map(|x| x / length);
                    let alone = decode(&resident, 0, texel, wi, wo, &relief);
                    assert!(!far(viewed.light(&mut rows, wi), alone, 2e-5), "{texel} {view} {light}");
                    changed += u32::from(far(alone, decode(&resident, 0, texel, wi, wo, &plain), 1e-3));
                }
            }
        }
        assert!(changed > 1000, "{changed}");
    }

    #[test]
    fn level_heights_without_gloss_and_likeness_leave_all_values() {
        let mut asset = sample_relief_asset(65, 12, 10);
        let layer = &mut asset.layers[0];
        layer.relief = Some(Relief { likeness: 0.0, shading: 1.0, gloss: 0.0 });
        let moved = |asset: &Asset| {
            let (resident, mut random) = (Resident::from_asset(asset), Random::new(5));
            let relief = DecodeOptions::default();
            let plain = DecodeOptions { heights: HeightUse::None, ..relief };
            let differs = |_: &u32| {
                let (texel, wi, wo) = (random.below(120) as u32, random.direction(), random.direction());
                let [a, b] = [relief, plain].map(|options| decode(&resident, 0, texel, wi, wo, &options));
                // Codes of the albedo are bytes, and albedos above their range are cut.
                (0..3).any(|c| (a[c] - b[c]).abs() > 2e-3 * (1.0 + b[c]))
            };
            (0..500).filter(differs).count()
        };
        let planted = moved(&asset);
        if let Some(heights) = &mut asset.layers[0].heights {
            heights.codes.fill(0);
        }
        assert!(moved(&asset) == 0 && planted > 50, "{} {planted}", moved(&asset));
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

//! The fallback of a glTF export: per texel the glTF material that comes nearest to what an asset decodes to.
//!
//! For a normal and a roughness the model is linear in its colours, but for what its upper layers leave to those below,
//! which is taken from the estimate before. So a texel's fit is a search over normals and roughnesses with non-negative
//! least squares inside. The error is that of gamma-encoded values: least squares over linear ones, weighted by the
//! curve's slope at the estimate before.

use crate::error::FitError;
use crate::export::gltf::brdf::{Cosines, DIELECTRIC_F0, GltfTexel, Sheen, dot, ggx, half_vector, schlick};
use crate::export::pairs::{PairList, front_layer, transmission_layer};
use crate::input::pair_stride::stride_over_pairs;
use crate::monitor::Monitor;
use crate::stages::lasso::non_negative_weights;
use btf_runtime::{Resident, root};
use rayon::prelude::*;
use serde::Serialize;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Pairs of directions that a texel is fitted to.
const FIT_PAIRS: usize = 192;
/// Texels of the sample that decides which parts of the model the material needs.
const TRIAL_TEXELS: usize = 512;
/// Share of the squared error that a part of the model must save to be written.
pub const MIN_SAVED: f64 = 0.05;
/// Added to a linear value under the root, so that the curve has the slope of sRGB at black.
const EPSILON: f32 = 0.003;
/// Roughnesses that a texel tries first.
const ROUGHNESSES: [f32; 7] = [0.2, 0.3, 0.4, 0.5, 0.6, 0.75, 1.0];
/// Range of roughnesses: below, a highlight falls between all measured pairs.
const ROUGHNESS_RANGE: [f32; 2] = [0.1, 1.0];
/// Steps of the search over normals (their x and y) and roughnesses.
const STEPS: [[f32; 2]; 3] = [[0.16, 0.1], [0.08, 0.05], [0.04, 0.03]];
/// Largest length of a normal's x and y.
const MAX_TILT: f32 = 0.75;
/// Sheen roughnesses that a material tries; one serves all its texels.
const SHEEN_ROUGHNESSES: [f32; 4] = [0.3, 0.5, 0.7, 1.0];

/// Choice of the model's optional parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Maps {
    /// Parts that save [`MIN_SAVED`] of the squared error or more.
    #[default]
    Auto,
    /// All.
    All,
}

/// A part of the model that was tried.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TriedPart {
    /// Name of the part: `metal`, `specular` or `sheen`.
    pub name: &'static str,
    /// Share of the squared error of gamma-encoded values that the part saves, on a sample of the texels.
    pub saved: f64,
    /// Whether the part is used.
    pub used: bool,
}

/// The fitted material.
#[derive(Debug, Clone, PartialEq)]
pub struct GltfFit {
    /// Texels a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// All texels, row by row.
    pub texels: Vec<GltfTexel>,
    /// Whether strength and colour of the specular lobe differ from a plain dielectric's.
    pub specular: bool,
    /// The sheen, where there is one.
    pub sheen: Option<Sheen>,
    /// Whether light comes through: the asset has a layer of transmission.
    pub transmission: bool,
    /// Optional parts that the model has.
    pub tried: Vec<TriedPart>,
}

/// Fits a material to the front of `resident`'s finest level. Deterministic on any number of threads.
///
/// Cost: some 30 evaluations of the model at 192 pairs a texel.
///
/// # Errors
/// [`FitError::Params`] for an asset without a layer that is lit and seen from the front; Ctrl-C.
pub fn fit_gltf(resident: &Resident, maps: Maps, monitor: &Monitor) -> Result<GltfFit, FitError> {
    let layer = front_layer(resident)?;
    let pairs = Pairs::new(&PairList::split(resident, layer, FIT_PAIRS)[0]);
    let [width, height] = resident.size(layer).map(|side| side as usize);
    let count = width * height;

    let stride = stride_over_pairs(count / TRIAL_TEXELS, width);
    let trial: Vec<usize> = (0..count.min(TRIAL_TEXELS)).map(|i| i * stride % count).collect();
    let error_of = |model: &Model| -> Result<f64, FitError> {
        let errors = trial.par_iter().map_init(Scratch::default, |scratch, texel| {
            monitor.check()?;
            pairs.list.decode(resident, layer, *texel, &mut scratch.target);
            Ok(Search { pairs: &pairs, model, scratch }.run().error)
        });
        Ok(errors.collect::<Result<Vec<f64>, FitError>>()?.iter().sum())
    };
    let (model, tried) = choose_model(maps, error_of)?;

    let transmission = transmission_layer(resident);
    let through = transmission.map(|layer| PairList::split(resident, layer, FIT_PAIRS).swap_remove(0));
    let done = AtomicUsize::new(0);
    let texels = (0..count).into_par_iter().map_init(Scratch::default, |scratch, texel| {
        let before = done.fetch_add(1, Ordering::Relaxed);
        if before.is_multiple_of(width) {
            monitor.report("fit", before, count)?;
        }
        pairs.list.decode(resident, layer, texel, &mut scratch.target);
        let mut fitted = Search { pairs: &pairs, model: &model, scratch }.run().texel(&model);
        if let (Some(list), Some(layer)) = (&through, transmission) {
            list.decode(resident, layer, texel, &mut scratch.target);
            set_transmission(&mut fitted, list, &scratch.target);
        }
        Ok(fitted)
    });
    let texels = texels.collect::<Result<Vec<GltfTexel>, FitError>>()?;
    let Model { specular, sheen, .. } = model;
    Ok(GltfFit { width, height, texels, specular, sheen, transmission: transmission.is_some(), tried })
}

/// Tries the model's parts one after the other; `error_of` tells a model's squared error.
fn choose_model(
    maps: Maps,
    error_of: impl Fn(&Model) -> Result<f64, FitError>,
) -> Result<(Model, Vec<TriedPart>), FitError> {
    let mut tried = Vec::new();
    let mut model = Model { metal: false, specular: false, sheen: None };
    let mut error = error_of(&model)?;
    let mut take = |name, error: &mut f64, next: f64, all: bool| {
        let saved = if *error > 0.0 { 1.0 - next / *error } else { 0.0 };
        let used = saved >= MIN_SAVED || all;
        tried.push(TriedPart { name, saved, used });
        if used {
            *error = next;
        }
        used
    };
    let all = maps == Maps::All;
    let metal = Model { metal: true, ..model.clone() };
    let glossy = Model { specular: true, ..model.clone() };
    let (error_metal, error_glossy) = (error_of(&metal)?, error_of(&glossy)?);
    // A metal needs no extension, so a coloured gloss has to be better by as much as any part.
    let metallic = error_glossy > (1.0 - MIN_SAVED) * error_metal;
    if metallic && !all && take("metal", &mut error, error_metal, false) {
        model = metal;
    } else if take("specular", &mut error, error_glossy, all) {
        model = glossy;
    }
    let mut best: Option<(Model, f64)> = None;
    for roughness in SHEEN_ROUGHNESSES {
        let fuzzy = Model { sheen: Some(Sheen::new(roughness)), ..model.clone() };
        let next = error_of(&fuzzy)?;
        if best.as_ref().is_none_or(|(_, least)| next < *least) {
            best = Some((fuzzy, next));
        }
    }
    if let Some((fuzzy, next)) = best
        && take("sheen", &mut error, next, all)
    {
        model = fuzzy;
    }
    Ok((model, tried))
}

/// Pairs with the quantities that do not depend on the normal, by component.
struct Pairs {
    list: PairList,
    wi: [Vec<f32>; 3],
    wo: [Vec<f32>; 3],
    half: [Vec<f32>; 3],
    /// Schlick's term of Fresnel reflectance.
    grazing: Vec<f32>,
}

impl Pairs {
    fn new(list: &PairList) -> Pairs {
        let halves: Vec<[f32; 3]> = list.directions.iter().map(|[wi, wo]| half_vector(*wi, *wo)).collect();
        let part = |of: &dyn Fn(usize) -> [f32; 3]| {
            [0, 1, 2].map(|i| (0..halves.len()).map(|pair| of(pair)[i]).collect::<Vec<f32>>())
        };
        Pairs {
            wi: part(&|pair| list.directions[pair][0]),
            wo: part(&|pair| list.directions[pair][1]),
            half: part(&|pair| halves[pair]),
            grazing: (0..halves.len()).map(|pair| schlick(dot(list.directions[pair][1], halves[pair]))).collect(),
            list: list.clone(),
        }
    }

    fn len(&self) -> usize {
        self.grazing.len()
    }
}

/// Optional parts that the model has.
#[derive(Debug, Clone)]
struct Model {
    metal: bool,
    specular: bool,
    sheen: Option<Sheen>,
}

/// First unknowns of the least squares, three each: base colour, specular lobe at normal incidence, specular lobe at
/// grazing incidence, sheen colour.
const BASE: usize = 0;
const F0: usize = 3;
const F90: usize = 6;
const SHEEN: usize = 7;
const UNKNOWNS: usize = 10;

/// A texel under search.
#[derive(Debug, Clone, Copy)]
struct Estimate {
    /// x and y of the unit normal.
    tilt: [f32; 2],
    roughness: f32,
    /// Weight of each unknown.
    weights: [f32; UNKNOWNS],
    /// Squared error of root-encoded values, summed over pairs and channels.
    error: f64,
}

impl Estimate {
    fn normal(&self) -> [f32; 3] {
        let [x, y] = self.tilt;
        [x, y, (1.0 - x * x - y * y).max(0.0).sqrt()]
    }

    /// Returns the greatest reflectance at normal incidence of the three channels.
    fn most_f0(&self) -> f32 {
        most(&self.weights[F0..F0 + 3])
    }

    fn texel(&self, model: &Model) -> GltfTexel {
        let three = |at: usize| [0, 1, 2].map(|c| self.weights[at + c]);
        let f90 = self.weights[F90];
        let colour = if f90 > 0.0 { three(F0).map(|f0| f0 / (f90 * DIELECTRIC_F0)) } else { [1.0; 3] };
        GltfTexel {
            base_colour: three(BASE),
            metallic: if model.metal { 1.0 } else { 0.0 },
            roughness: self.roughness,
            normal: self.normal(),
            specular: f90,
            specular_colour: colour,
            sheen_colour: three(SHEEN),
            ..GltfTexel::PLAIN
        }
    }
}

fn most(numbers: &[f32]) -> f32 {
    numbers.iter().copied().fold(0.0, f32::max)
}

/// Scratch arrays of a texel's search, by pair; kept from texel to texel.
#[derive(Default)]
struct Scratch {
    /// Decoded values, by channel.
    target: [Vec<f32>; 3],
    /// Decoded values on the root curve, cut at white.
    encoded: [Vec<f32>; 3],
    /// Weights of the squared linear differences.
    slopes: [Vec<f32>; 3],
    /// Values of the model.
    values: [Vec<f32>; 3],
    /// Cosine of the light; specular lobe and sheen without colour, times that cosine; share of the light that the
    /// sheen takes.
    cos: Vec<f32>,
    gloss: Vec<f32>,
    fuzz: Vec<f32>,
    taken: Vec<f32>,
    /// Factors of the unknowns, and what is reflected without them.
    atoms: [Vec<f32>; 4],
    fixed: Vec<f32>,
    /// Product of two columns.
    product: Vec<f32>,
}

struct Search<'a> {
    pairs: &'a Pairs,
    model: &'a Model,
    scratch: &'a mut Scratch,
}

impl Search<'_> {
    /// Fits the texel whose values are in `target`.
    fn run(mut self) -> Estimate {
        let scratch = &mut *self.scratch;
        for c in 0..3 {
            let target = &scratch.target[c];
            let mean = target.iter().sum::<f32>() / target.len() as f32;
            refill(&mut scratch.encoded[c], target.iter().map(|x| root(x.min(1.0) + EPSILON)));
            refill(&mut scratch.values[c], target.iter().map(|_| mean));
        }
        self.reweigh();
        let tilt = self.lambert_tilt();
        let mut weights = [0.0; UNKNOWNS];
        weights[F0..F0 + 3].fill(DIELECTRIC_F0);
        weights[F90] = 1.0;
        let start = Estimate { tilt, roughness: 1.0, weights, error: f64::INFINITY };
        let mut best = start;
        for roughness in ROUGHNESSES {
            self.improve(&mut best, Estimate { roughness, ..start });
        }
        for [tilt_step, roughness_step] in STEPS {
            // The curve's slopes and the shares of the layers at what is best so far.
            self.fill_atoms(&best);
            self.fill_values(&best);
            self.reweigh();
            let mut round = Estimate { error: f64::INFINITY, ..best };
            self.improve(&mut round, best);
            for _ in 0..2 {
                let from = round;
                for [x, y] in [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]] {
                    let tilt = [from.tilt[0] + x * tilt_step, from.tilt[1] + y * tilt_step];
                    if tilt[0] * tilt[0] + tilt[1] * tilt[1] <= MAX_TILT * MAX_TILT {
                        self.improve(&mut round, Estimate { tilt, ..from });
                    }
                }
                if round.tilt == from.tilt {
                    break;
                }
            }
            for step in [-roughness_step, roughness_step] {
                let roughness = (round.roughness + step).clamp(ROUGHNESS_RANGE[0], ROUGHNESS_RANGE[1]);
                let next = Estimate { roughness, ..round };
                self.improve(&mut round, next);
            }
            if round.error < best.error {
                best = round;
            }
        }
        best
    }

    /// Solves for the weights at `next`'s normal and roughness, and replaces `best` if the error is smaller.
    fn improve(&mut self, best: &mut Estimate, next: Estimate) {
        self.fill_columns(&next);
        self.fill_atoms(&next);
        let mut next = Estimate { weights: self.solve(), ..next };
        self.fill_atoms(&next);
        self.fill_values(&next);
        let scratch = &*self.scratch;
        next.error = (0..3).map(|c| encoded_error(&scratch.values[c], &scratch.encoded[c])).sum();
        if next.error < best.error {
            *best = next;
        }
    }

    /// Returns x and y of a normal as if the surface were diffuse: least squares for the vector whose product with the
    /// light is the luminance.
    fn lambert_tilt(&self) -> [f32; 2] {
        let (pairs, scratch) = (self.pairs, &*self.scratch);
        let mut matrix = nalgebra::Matrix3::<f64>::zeros();
        let mut right = nalgebra::Vector3::<f64>::zeros();
        for pair in 0..pairs.len() {
            let light = nalgebra::Vector3::from([0, 1, 2].map(|i| f64::from(pairs.wi[i][pair])));
            let grey = (0..3).map(|c| f64::from(scratch.target[c][pair])).sum::<f64>();
            let weight = f64::from(scratch.slopes[1][pair]);
            matrix += light * light.transpose() * weight;
            right += light * (grey * weight);
        }
        let normal = matrix.cholesky().map_or(nalgebra::Vector3::z(), |whole| whole.solve(&right));
        let length = normal.norm();
        if !(length > 0.0 && normal.z > 0.0) {
            return [0.0; 2];
        }
        let tilt = [normal.x / length, normal.y / length].map(|x| x as f32);
        let far = (tilt[0] * tilt[0] + tilt[1] * tilt[1]).sqrt().max(1e-6);
        tilt.map(|x| x * (MAX_TILT / far).min(1.0))
    }

    /// Sets the weights of the squared linear differences to the slopes of the curve between target and values.
    fn reweigh(&mut self) {
        let scratch = &mut *self.scratch;
        for c in 0..3 {
            let between = scratch.target[c].iter().zip(&scratch.values[c]).map(|(x, y)| 0.5 * (x + y) + EPSILON);
            refill(
                &mut scratch.slopes[c],
                between.map(|x| {
                    let slope = root(x) / x;
                    slope * slope
                }),
            );
        }
    }

    /// Computes cosine, specular lobe and sheen at `estimate`'s normal and roughness.
    fn fill_columns(&mut self, estimate: &Estimate) {
        let (pairs, scratch, normal) = (self.pairs, &mut *self.scratch, estimate.normal());
        let n = pairs.len();
        for column in [&mut scratch.cos, &mut scratch.gloss, &mut scratch.fuzz, &mut scratch.taken] {
            column.resize(n, 0.0);
        }
        let at = |of: &[Vec<f32>; 3], pair: usize| {
            (normal[0] * of[0][pair] + normal[1] * of[1][pair] + normal[2] * of[2][pair]).max(0.0)
        };
        for pair in 0..n {
            let cos = Cosines { light: at(&pairs.wi, pair), eye: at(&pairs.wo, pair), half: at(&pairs.half, pair) };
            scratch.cos[pair] = cos.light;
            scratch.gloss[pair] = cos.light * ggx(estimate.roughness, &cos);
        }
        if let Some(sheen) = &self.model.sheen {
            for pair in 0..n {
                let cos = Cosines { light: at(&pairs.wi, pair), eye: at(&pairs.wo, pair), half: at(&pairs.half, pair) };
                scratch.fuzz[pair] = cos.light * sheen.value(&cos);
                scratch.taken[pair] = sheen.albedo_seen(&cos);
            }
        }
    }

    /// Computes the factors of the unknowns, with the upper layers of `estimate`.
    fn fill_atoms(&mut self, estimate: &Estimate) {
        let (pairs, scratch) = (self.pairs, &mut *self.scratch);
        let n = pairs.len();
        let top = if self.model.sheen.is_some() { most(&estimate.weights[SHEEN..]) } else { 0.0 };
        let (f0, f90) = (estimate.most_f0(), estimate.weights[F90]);
        scratch.atoms.iter_mut().chain([&mut scratch.fixed]).for_each(|column| column.resize(n, 0.0));
        let [base, normal, grazing, fuzz] = &mut scratch.atoms;
        for pair in 0..n {
            let below = 1.0 - top * scratch.taken[pair];
            let (p, gloss) = (pairs.grazing[pair], scratch.gloss[pair] * below);
            normal[pair] = gloss * (1.0 - p);
            grazing[pair] = gloss * p;
            base[pair] = scratch.cos[pair] * below * (1.0 - f0 - (f90 - f0) * p);
            fuzz[pair] = scratch.fuzz[pair];
        }
        if self.model.metal {
            base.copy_from_slice(normal);
            scratch.fixed.copy_from_slice(grazing);
        } else if !self.model.specular {
            for pair in 0..n {
                scratch.fixed[pair] = DIELECTRIC_F0 * normal[pair] + grazing[pair];
            }
        } else {
            scratch.fixed.fill(0.0);
        }
    }

    /// Computes the model's values with `estimate`'s weights; the factors must be those of `estimate`.
    fn fill_values(&mut self, estimate: &Estimate) {
        let (w, n) = (&estimate.weights, self.pairs.len());
        let (gloss, f90) = if self.free_gloss() { (1.0, w[F90]) } else { (0.0, 0.0) };
        let scratch = &mut *self.scratch;
        let [base, normal, grazing, fuzz] = &scratch.atoms;
        for c in 0..3 {
            let (colour, f0, sheen) = (w[BASE + c], gloss * w[F0 + c], w[SHEEN + c]);
            let values = &mut scratch.values[c];
            values.resize(n, 0.0);
            for pair in 0..n {
                values[pair] = scratch.fixed[pair]
                    + colour * base[pair]
                    + f0 * normal[pair]
                    + f90 * grazing[pair]
                    + sheen * fuzz[pair];
            }
        }
    }

    fn free_gloss(&self) -> bool {
        self.model.specular && !self.model.metal
    }

    /// Solves the weighted non-negative least squares and clamps the solution to the ranges of a material.
    fn solve(&mut self) -> [f32; UNKNOWNS] {
        let (free_gloss, fuzzy) = (self.free_gloss(), self.model.sheen.is_some());
        let scratch = &mut *self.scratch;
        let mut gram = [0.0f64; UNKNOWNS * UNKNOWNS];
        let mut right = [0.0f64; UNKNOWNS];
        // The atoms in use; of each channel an unknown of its own, but for the gloss at grazing incidence.
        let used: &[usize] = match (free_gloss, fuzzy) {
            (false, false) => &[0],
            (true, false) => &[0, 1, 2],
            (false, true) => &[0, 3],
            (true, true) => &[0, 1, 2, 3],
        };
        let unknown = |atom: usize, c: usize| [BASE + c, F0 + c, F90, SHEEN + c][atom];
        for c in 0..3 {
            for (i, atom) in used.iter().enumerate() {
                let weighted = scratch.atoms[*atom].iter().zip(&scratch.slopes[c]).map(|(x, w)| x * w);
                refill(&mut scratch.product, weighted);
                let row = unknown(*atom, c);
                right[row] += sum_of_products(&scratch.product, &scratch.target[c])
                    - sum_of_products(&scratch.product, &scratch.fixed);
                for other in &used[..=i] {
                    let column = unknown(*other, c);
                    let sum = sum_of_products(&scratch.product, &scratch.atoms[*other]);
                    gram[row * UNKNOWNS + column] += sum;
                    if row != column {
                        gram[column * UNKNOWNS + row] += sum;
                    }
                }
            }
        }
        let mut active: Vec<usize> = used.iter().flat_map(|atom| [0, 1, 2].map(|c| unknown(*atom, c))).collect();
        active.dedup();
        let found = non_negative_weights(&gram, UNKNOWNS, &right, &active);
        let mut weights = [0.0; UNKNOWNS];
        active.iter().zip(found).for_each(|(unknown, weight)| weights[*unknown] = (weight as f32).min(1.0));
        if free_gloss {
            // Gloss grows towards grazing incidence, at most to its strength.
            weights[F90] = weights[F90].max(most(&weights[F0..F0 + 3]));
        } else {
            weights[F0..F0 + 3].fill(DIELECTRIC_F0);
            weights[F90] = 1.0;
        }
        weights
    }
}

fn refill(column: &mut Vec<f32>, numbers: impl Iterator<Item = f32>) {
    column.clear();
    column.extend(numbers);
}

/// Number of lanes in which sums run.
const LANES: usize = 8;

fn sum_of_products(a: &[f32], b: &[f32]) -> f64 {
    let mut lanes = [0.0f32; LANES];
    let (a8, b8) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f32 = a8.remainder().iter().zip(b8.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a8.zip(b8) {
        (0..LANES).for_each(|i| lanes[i] += x[i] * y[i]);
    }
    f64::from(lanes.iter().sum::<f32>() + rest)
}

/// Returns the squared difference between linear `values`, encoded by the curve, and `encoded`.
fn encoded_error(values: &[f32], encoded: &[f32]) -> f64 {
    let mut lanes = [0.0f32; LANES];
    let square = |x: f32, y: f32| {
        let difference = root(x.min(1.0) + EPSILON) - y;
        difference * difference
    };
    let (a8, b8) = (values.chunks_exact(LANES), encoded.chunks_exact(LANES));
    let rest: f32 = a8.remainder().iter().zip(b8.remainder()).map(|(x, y)| square(*x, *y)).sum();
    for (x, y) in a8.zip(b8) {
        (0..LANES).for_each(|i| lanes[i] += square(x[i], y[i]));
    }
    f64::from(lanes.iter().sum::<f32>() + rest)
}

/// Splits the diffuse light of `texel` so that the transmitted light is, in the mean over the pairs, what `values` say.
fn set_transmission(texel: &mut GltfTexel, list: &PairList, values: &[Vec<f32>; 3]) {
    let colour = [0, 1, 2].map(|c| {
        let (mut sum, mut square) = (0.0f32, 0.0f32);
        for ([wi, _], value) in list.directions.iter().zip(&values[c]) {
            sum += value * wi[2].abs();
            square += wi[2] * wi[2];
        }
        if square > 0.0 { (sum / square).clamp(0.0, 1.0) } else { 0.0 }
    });
    // The least share will do: the more, the brighter must the base colour be for those who do not know the extension.
    let share = most(&colour).min(1.0 - most(&texel.base_colour).min(MAX_REFLECTED));
    texel.transmission = share;
    texel.transmission_colour = colour.map(|x| if share > 0.0 { (x / share).min(1.0) } else { 1.0 });
    texel.base_colour = texel.base_colour.map(|x| (x / (1.0 - share)).min(1.0));
}

/// Base colour above which nothing is left to be transmitted.
const MAX_REFLECTED: f32 = 0.98;

#[cfg(test)]
mod tests;

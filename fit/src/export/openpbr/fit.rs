//! The fit of an OpenPBR material: per texel the parameters that come nearest to what an asset decodes to.
//!
//! Damped least squares (Levenberg and Marquardt) on gamma-encoded values, within the ranges of the parameters, from the
//! glTF material of the texel.

use crate::error::FitError;
use crate::export::gltf::brdf::{DIELECTRIC_F0, GltfTexel};
use crate::export::gltf::fit::{GltfFit, MIN_SAVED, Maps, TriedPart};
use crate::export::openpbr::model::{
    BaseLobe, BaseValues, CoatLobe, CoatValues, FuzzLobe, FuzzValues, OpenPbrTexel, PARAMETERS, Pair,
};
use crate::export::pairs::{PairList, front_layer};
use crate::input::pair_stride::stride_over_pairs;
use crate::monitor::Monitor;
use btf_runtime::{Resident, root};
use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Pairs of directions that a texel is fitted to, first and at last, and the most steps with them: few pairs find the way,
/// many keep the model from following what is peculiar to a few.
const STAGES: [(usize, usize); 2] = [(192, 12), (1536, 4)];
/// Texels of the sample that decides which parts of the model the material needs.
const TRIAL_TEXELS: usize = 256;
/// Added to a linear value under the root, so that the curve has the slope of sRGB at black.
const EPSILON: f32 = 0.003;
/// The root curve is the power 1 / 2.4, sRGB's.
const ROOT: f32 = 2.4;
/// Share of the error that a step must save for the next one to be tried.
const LEAST_STEP: f64 = 2e-3;
/// Difference of a parameter by which slopes are computed.
const DIFFERENCE: f32 = 2e-3;
/// Largest length of a normal's x and y.
const MAX_TILT: f32 = 0.9;
/// Largest anisotropy.
const MAX_ANISOTROPY: f32 = 0.9;
/// Pairs that are evaluated side by side.
const LANES: usize = 8;

/// A fitted OpenPBR material.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenPbrFit {
    /// Texels a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// All texels, row by row.
    pub texels: Vec<OpenPbrTexel>,
    /// Whether there is a coat.
    pub coat: bool,
    /// Whether there is fuzz.
    pub fuzz: bool,
    /// Of each texel what comes through: the share of the diffuse light and its colour; empty where the asset has no layer
    /// of transmission.
    pub transmission: Vec<(f32, [f32; 3])>,
    /// Optional parts that were tried.
    pub tried: Vec<TriedPart>,
}

/// Fits a material to the front of `resident`'s finest level, from the texels of a glTF material. Deterministic on any
/// number of threads.
///
/// Cost: some 10 steps a texel with 192 pairs and 4 with 1536, each with 15 evaluations of the model.
///
/// # Errors
/// [`FitError::Params`] for an asset without a layer that is lit and seen from the front; Ctrl-C.
pub fn fit_openpbr(
    resident: &Resident,
    start: &GltfFit,
    maps: Maps,
    monitor: &Monitor,
) -> Result<OpenPbrFit, FitError> {
    let layer = front_layer(resident)?;
    let stages: Vec<Stage> = STAGES.iter().map(|(pairs, steps)| Stage::new(resident, layer, *pairs, *steps)).collect();
    let (width, height, count) = (start.width, start.height, start.texels.len());
    let fitted = |texel: usize, parts: Parts, scratch: &mut Scratch| {
        let mut found = (0.0, start_of(&start.texels[texel], parts));
        for stage in &stages {
            stage.list.decode(resident, layer, texel, &mut scratch.decoded);
            found = fit_texel(&stage.pairs, stage.steps, &found.1, parts, scratch);
        }
        found
    };

    let stride = stride_over_pairs(count / TRIAL_TEXELS, width);
    let trial: Vec<usize> = (0..count.min(TRIAL_TEXELS)).map(|i| i * stride % count).collect();
    let error_of = |parts: Parts| -> Result<f64, FitError> {
        let errors = trial.par_iter().map_init(Scratch::default, |scratch, texel| {
            monitor.check()?;
            Ok(fitted(*texel, parts, scratch).0)
        });
        Ok(errors.collect::<Result<Vec<f64>, FitError>>()?.iter().sum())
    };
    let (parts, tried) = choose_parts(maps, error_of)?;

    let done = AtomicUsize::new(0);
    let texels = (0..count).into_par_iter().map_init(Scratch::default, |scratch, texel| {
        let before = done.fetch_add(1, Ordering::Relaxed);
        if before.is_multiple_of(width) {
            monitor.report("fit OpenPBR", before, count)?;
        }
        Ok(fitted(texel, parts, scratch).1)
    });
    let mut texels = texels.collect::<Result<Vec<OpenPbrTexel>, FitError>>()?;
    let mut transmission = Vec::new();
    if start.transmission {
        transmission = start.texels.iter().map(|texel| (texel.transmission, texel.transmission_colour)).collect();
        // Of the diffuse light that share comes through.
        for (texel, (share, _)) in texels.iter_mut().zip(&transmission) {
            texel.base_colour = texel.base_colour.map(|x| (x / (1.0 - share)).min(1.0));
        }
    }
    let Parts { coat, fuzz } = parts;
    Ok(OpenPbrFit { width, height, texels, coat, fuzz, transmission, tried })
}

/// A part of the search: the pairs that it looks at, and its most steps.
struct Stage {
    list: PairList,
    pairs: Pairs,
    steps: usize,
}

impl Stage {
    fn new(resident: &Resident, layer: u32, pairs: usize, steps: usize) -> Stage {
        let list = PairList::split(resident, layer, pairs).swap_remove(0);
        Stage { pairs: Pairs::new(&list), list, steps }
    }
}

/// Parts of the model that a material may lack.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Parts {
    coat: bool,
    fuzz: bool,
}

impl Parts {
    /// Returns whether the model lacks parameter `p`.
    fn without(self, p: usize) -> bool {
        (!self.coat && (13..=21).contains(&p)) || (!self.fuzz && p >= 22)
    }
}

/// Tries coat and fuzz; `error_of` tells a model's squared error. A part must save [`MIN_SAVED`] of it.
fn choose_parts(
    maps: Maps,
    error_of: impl Fn(Parts) -> Result<f64, FitError>,
) -> Result<(Parts, Vec<TriedPart>), FitError> {
    let mut parts = Parts { coat: false, fuzz: false };
    let mut error = error_of(parts)?;
    let mut tried = Vec::new();
    for (name, with) in [("coat", Parts { coat: true, ..parts }), ("fuzz", Parts { fuzz: true, ..parts })] {
        let with = Parts { coat: with.coat || parts.coat, fuzz: with.fuzz || parts.fuzz };
        let next = error_of(with)?;
        let saved = if error > 0.0 { 1.0 - next / error } else { 0.0 };
        let used = saved >= MIN_SAVED || maps == Maps::All;
        tried.push(TriedPart { name, saved, used });
        if used {
            (parts, error) = (with, next);
        }
    }
    Ok((parts, tried))
}

/// Returns the texel from which the search starts.
fn start_of(texel: &GltfTexel, parts: Parts) -> OpenPbrTexel {
    let [x, y, _] = texel.normal;
    let (f0, colour, base) = if texel.metallic > 0.5 {
        (0.5, texel.base_colour, [0.05; 3])
    } else {
        let f0 = texel.specular_colour.map(|x| (DIELECTRIC_F0 * x).min(1.0));
        let top = f0.into_iter().fold(1e-3, f32::max);
        (top, f0.map(|x| texel.specular * x / top), texel.base_colour)
    };
    OpenPbrTexel {
        base_colour: base,
        diffuse_roughness: 0.2,
        normal: [x, y],
        roughness: texel.roughness,
        anisotropy: [0.1, 0.0],
        f0,
        specular_colour: colour,
        coat: if parts.coat { 0.1 } else { 0.0 },
        coat_colour: [0.9; 3],
        coat_normal: [-0.5 * x, -0.5 * y],
        coat_roughness: 0.6,
        coat_anisotropy: [0.1, 0.0],
        fuzz: if parts.fuzz { 0.05 } else { 0.0 },
        fuzz_colour: [0.5; 3],
        fuzz_roughness: 0.5,
    }
}

/// What a parameter changes.
#[derive(Clone, Copy)]
struct Reach {
    base: bool,
    coat: bool,
    fuzz: bool,
    /// The one channel that changes, or all.
    channel: Option<usize>,
}

/// Ranges of the parameters, in their order.
const RANGES: [[f32; 2]; PARAMETERS] = {
    let (colour, tilt, turn) = ([0.0, 0.98], [-MAX_TILT, MAX_TILT], [-MAX_ANISOTROPY, MAX_ANISOTROPY]);
    let rough = [0.1, 1.0];
    [
        colour,
        colour,
        colour,
        [0.0, 1.0],
        tilt,
        tilt,
        rough,
        turn,
        turn,
        [1e-4, 0.95],
        [0.0, 1.0],
        [0.0, 1.0],
        [0.0, 1.0],
        [0.0, 1.0],
        [0.0, 1.0],
        [0.0, 1.0],
        [0.0, 1.0],
        tilt,
        tilt,
        rough,
        turn,
        turn,
        [0.0, 1.0],
        [0.0, 1.0],
        [0.0, 1.0],
        [0.0, 1.0],
        [0.05, 1.0],
    ]
};

/// Returns what parameter `p` changes.
fn reach(p: usize) -> Reach {
    let channel = match p {
        0..=2 => Some(p),
        10..=12 => Some(p - 10),
        14..=16 => Some(p - 14),
        23..=25 => Some(p - 23),
        _ => None,
    };
    Reach {
        base: matches!(p, 3..=9 | 13 | 19),
        coat: matches!(p, 13 | 17..=21),
        fuzz: matches!(p, 4 | 5 | 22 | 26),
        channel,
    }
}

/// Shortens the vectors among the parameters that are too long, and cuts the others to their ranges.
fn within_ranges(parameters: &mut [f32; PARAMETERS]) {
    for (value, [least, most]) in parameters.iter_mut().zip(RANGES) {
        *value = value.clamp(least, most);
    }
    for (at, most) in [(4, MAX_TILT), (17, MAX_TILT), (7, MAX_ANISOTROPY), (20, MAX_ANISOTROPY)] {
        let length = parameters[at].hypot(parameters[at + 1]);
        if length > most {
            parameters[at] *= most / length;
            parameters[at + 1] *= most / length;
        }
    }
}

/// Numbers of the same kind at some pairs.
type Lane = [f32; LANES];

/// Pairs of directions, side by side.
struct Pairs {
    blocks: Vec<[Pair; LANES]>,
    /// Number of pairs; the last block is filled up with others.
    count: usize,
}

impl Pairs {
    fn new(list: &PairList) -> Pairs {
        let pairs: Vec<Pair> = list.directions.iter().map(|[wi, wo]| Pair::new(*wi, *wo)).collect();
        let blocks = pairs.chunks(LANES).map(|part| std::array::from_fn(|lane| part[lane.min(part.len() - 1)]));
        Pairs { blocks: blocks.collect(), count: pairs.len() }
    }
}

/// What the layers of a texel have at all pairs.
#[derive(Default, Clone)]
struct Layers {
    base: Vec<[BaseValues; LANES]>,
    coat: Vec<[CoatValues; LANES]>,
    fuzz: Vec<[FuzzValues; LANES]>,
}

impl Layers {
    /// Evaluates the layers of a texel that `reach` names; those that it does not name stay.
    fn fill(&mut self, pairs: &Pairs, texel: &OpenPbrTexel, reach: Reach) {
        fn each<T>(out: &mut Vec<[T; LANES]>, pairs: &Pairs, at: impl Fn(&Pair) -> T) {
            out.clear();
            out.extend(pairs.blocks.iter().map(|block| std::array::from_fn(|lane| at(&block[lane]))));
        }
        if reach.base {
            let lobe = BaseLobe::new(texel);
            each(&mut self.base, pairs, |pair| lobe.at(pair));
        }
        if reach.coat {
            let lobe = CoatLobe::new(texel);
            each(&mut self.coat, pairs, |pair| lobe.at(pair));
        }
        if reach.fuzz {
            let lobe = FuzzLobe::new(texel);
            each(&mut self.fuzz, pairs, |pair| lobe.at(pair));
        }
    }
}

/// Scratch arrays of a texel's search; kept from texel to texel.
#[derive(Default)]
struct Scratch {
    /// Decoded values, by channel.
    decoded: [Vec<f32>; 3],
    /// Decoded values on the root curve, cut at white; 0 beyond the pairs.
    target: [Vec<Lane>; 3],
    layers: Layers,
    /// Layers of a texel of which one parameter differs.
    moved: Layers,
    /// Values of the model.
    values: [Vec<Lane>; 3],
    /// What is left of the target, on the root curve.
    rest: [Vec<Lane>; 3],
    /// Slope of the root curve at the values.
    slopes: [Vec<Lane>; 3],
    /// Slopes of the residuals, by parameter and channel.
    columns: Vec<[Vec<Lane>; 3]>,
}

type Gram = SMatrix<f64, PARAMETERS, PARAMETERS>;
type Vector = SVector<f64, PARAMETERS>;

/// Everything changes.
const ALL: Reach = Reach { base: true, coat: true, fuzz: true, channel: None };

/// Fits the texel whose values are decoded, from a start; returns the squared error on the root curve and the texel.
fn fit_texel(
    pairs: &Pairs,
    steps: usize,
    start: &OpenPbrTexel,
    parts: Parts,
    scratch: &mut Scratch,
) -> (f64, OpenPbrTexel) {
    for c in 0..3 {
        let encoded = |i: usize| scratch.decoded[c].get(i).map_or(0.0, |x| root(x.min(1.0) + EPSILON));
        let blocks = (0..pairs.blocks.len()).map(|block| std::array::from_fn(|lane| encoded(block * LANES + lane)));
        scratch.target[c] = blocks.collect();
    }
    let mut here = start.to_parameters();
    within_ranges(&mut here);
    let mut error = evaluate(pairs, &here, scratch);
    let mut damping = 1e-2;
    for _ in 0..steps {
        let (gram, right) = equations(pairs, &here, parts, scratch);
        let mut saved = 0.0;
        for _ in 0..4 {
            let mut next = here;
            let step = solve(&gram, &right, &here, parts, damping);
            next.iter_mut().zip(step.iter()).for_each(|(value, step)| *value += *step as f32);
            within_ranges(&mut next);
            let error_next = evaluate(pairs, &next, scratch);
            if error_next < error {
                saved = 1.0 - error_next / error;
                (here, error) = (next, error_next);
                damping = (damping * 0.3).max(1e-6);
                break;
            }
            damping *= 6.0;
        }
        if saved < LEAST_STEP {
            break;
        }
    }
    (error, OpenPbrTexel::from_parameters(&here))
}

/// Solves for a step of the parameters. Those that the model has not, and those at an end of their range that pull outwards,
/// stay.
fn solve(gram: &Gram, right: &Vector, here: &[f32; PARAMETERS], parts: Parts, damping: f64) -> Vector {
    let mut matrix = *gram;
    let mut wanted = *right;
    for p in 0..PARAMETERS {
        let [least, most] = RANGES[p];
        let held = parts.without(p) || (here[p] <= least && right[p] < 0.0) || (here[p] >= most && right[p] > 0.0);
        if held {
            matrix.row_mut(p).fill(0.0);
            matrix.column_mut(p).fill(0.0);
            matrix[(p, p)] = 1.0;
            wanted[p] = 0.0;
        } else {
            // A part that does not depend on the slopes: parameters of what a texel has not do not run away.
            matrix[(p, p)] += damping * (matrix[(p, p)] + 1e-3) + 1e-6;
        }
    }
    matrix.cholesky().map_or(Vector::zeros(), |whole| whole.solve(&wanted))
}

/// Evaluates the model; returns the squared error on the root curve.
fn evaluate(pairs: &Pairs, parameters: &[f32; PARAMETERS], scratch: &mut Scratch) -> f64 {
    let texel = OpenPbrTexel::from_parameters(parameters);
    scratch.layers.fill(pairs, &texel, ALL);
    let mut error = 0.0;
    for c in 0..3 {
        fill_values(&mut scratch.values[c], &texel, c, &scratch.layers);
        let (values, target) = (&scratch.values[c], &scratch.target[c]);
        let rest = &mut scratch.rest[c];
        rest.clear();
        rest.extend(values.iter().zip(target).map(|(values, target)| {
            std::array::from_fn(|lane| target[lane] - root(values[lane].clamp(0.0, 1.0) + EPSILON))
        }));
        cut(rest, pairs.count);
        error += rest.iter().flatten().map(|x| f64::from(x * x)).sum::<f64>();
    }
    error
}

/// Sets what stands beyond `count` numbers to 0.
fn cut(lanes: &mut [Lane], count: usize) {
    lanes.as_flattened_mut()[count..].fill(0.0);
}

fn fill_values(out: &mut Vec<Lane>, texel: &OpenPbrTexel, c: usize, layers: &Layers) {
    out.clear();
    let blocks = layers.base.iter().zip(&layers.coat).zip(&layers.fuzz);
    out.extend(blocks.map(|((base, coat), fuzz)| {
        std::array::from_fn(|lane| texel.layered(c, &base[lane], &coat[lane], &fuzz[lane]))
    }));
}

/// Returns the normal equations at the parameters `here`, which must be those that were evaluated last.
fn equations(pairs: &Pairs, here: &[f32; PARAMETERS], parts: Parts, scratch: &mut Scratch) -> (Gram, Vector) {
    for c in 0..3 {
        let (values, slopes) = (&scratch.values[c], &mut scratch.slopes[c]);
        slopes.clear();
        slopes.extend(values.iter().map(|values| values.map(slope)));
        cut(slopes, pairs.count);
    }
    scratch.columns.resize_with(PARAMETERS, Default::default);
    for p in 0..PARAMETERS {
        scratch.columns[p].iter_mut().for_each(Vec::clear);
        if parts.without(p) {
            continue;
        }
        let reach = reach(p);
        let mut moved = *here;
        let step = if here[p] + DIFFERENCE > RANGES[p][1] { -DIFFERENCE } else { DIFFERENCE };
        moved[p] += step;
        let texel = OpenPbrTexel::from_parameters(&moved);
        scratch.moved.fill(pairs, &texel, reach);
        let (layers, moved) = (&scratch.layers, &scratch.moved);
        let base = if reach.base { &moved.base } else { &layers.base };
        let coat = if reach.coat { &moved.coat } else { &layers.coat };
        let fuzz = if reach.fuzz { &moved.fuzz } else { &layers.fuzz };
        for c in 0..3 {
            let column = &mut scratch.columns[p][c];
            if reach.channel.is_some_and(|one| one != c) {
                continue;
            }
            let (values, slopes) = (&scratch.values[c], &scratch.slopes[c]);
            column.extend((0..values.len()).map(|block| {
                let (base, coat, fuzz) = (&base[block], &coat[block], &fuzz[block]);
                let (values, slopes) = (&values[block], &slopes[block]);
                std::array::from_fn(|lane| {
                    let value = texel.layered(c, &base[lane], &coat[lane], &fuzz[lane]);
                    (value - values[lane]) * slopes[lane] / step
                })
            }));
        }
    }
    let mut gram = Gram::zeros();
    let mut right = Vector::zeros();
    for c in 0..3 {
        for p in 0..PARAMETERS {
            let column = &scratch.columns[p][c];
            if column.is_empty() {
                continue;
            }
            right[p] += sum_of_products(column, &scratch.rest[c]);
            for q in 0..=p {
                let other = &scratch.columns[q][c];
                if !other.is_empty() {
                    gram[(p, q)] += sum_of_products(column, other);
                }
            }
        }
    }
    gram.fill_upper_triangle_with_lower_triangle();
    (gram, right)
}

/// Returns the slope of the root curve, 0 where values are cut.
#[inline(always)]
fn slope(value: f32) -> f32 {
    let inside = if value > 0.0 && value < 1.0 { 1.0 } else { 0.0 };
    let x = value.clamp(0.0, 1.0) + EPSILON;
    inside * root(x) / (ROOT * x)
}

fn sum_of_products(a: &[Lane], b: &[Lane]) -> f64 {
    let mut lanes = [0.0f32; LANES];
    for (x, y) in a.iter().zip(b) {
        (0..LANES).for_each(|lane| lanes[lane] += x[lane] * y[lane]);
    }
    f64::from(lanes.iter().sum::<f32>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_runtime::testing::direction_from_degrees;

    /// Returns a grid of directions as a capture has.
    fn list() -> PairList {
        let mut directions = Vec::new();
        for view in [[0, 0], [30, 0], [30, 120], [30, 240], [60, 60], [60, 180], [60, 300], [75, 20]] {
            for theta in [0, 15, 30, 45, 60, 75] {
                for phi in (0..360).step_by(45) {
                    let at = |d: [i32; 2]| direction_from_degrees(d[0].into(), d[1].into());
                    directions.push([at([theta, phi]), at(view)]);
                }
            }
        }
        PairList { directions }
    }

    const PARTS: Parts = Parts { coat: true, fuzz: true };

    /// Fits a texel to another's values; returns the error per value on the root curve, and what was found.
    fn found(made: &OpenPbrTexel, start: &OpenPbrTexel, parts: Parts) -> (f64, OpenPbrTexel) {
        let list = list();
        let pairs = Pairs::new(&list);
        let mut scratch = Scratch::default();
        for [wi, wo] in &list.directions {
            let value = made.reflected(*wi, *wo);
            (0..3).for_each(|c| scratch.decoded[c].push(value[c]));
        }
        let (error, texel) = fit_texel(&pairs, 40, start, parts, &mut scratch);
        ((error / (3 * pairs.count) as f64).sqrt(), texel)
    }

    fn gltf() -> GltfTexel {
        GltfTexel { base_colour: [0.4, 0.3, 0.2], roughness: 0.6, normal: [0.1, 0.0, 0.995], ..GltfTexel::PLAIN }
    }

    #[test]
    fn a_material_of_the_model_is_found_again() {
        let start = start_of(&gltf(), Parts { coat: false, fuzz: false });
        let made = OpenPbrTexel {
            base_colour: [0.5, 0.3, 0.1],
            diffuse_roughness: 0.6,
            normal: [0.2, -0.15],
            roughness: 0.5,
            anisotropy: [0.2, 0.4],
            f0: 0.08,
            specular_colour: [0.9, 0.8, 0.7],
            ..start
        };
        let (error, again) = found(&made, &start, Parts { coat: false, fuzz: false });
        assert!(error < 1e-3, "{error} {again:?}");
        assert!((again.diffuse_roughness - 0.6).abs() < 0.02 && (again.roughness - 0.5).abs() < 0.01, "{again:?}");
        assert!((0..2).all(|i| (again.anisotropy[i] - made.anisotropy[i]).abs() < 0.02), "{again:?}");
        // What the model has not stays what it was.
        assert_eq!(
            (again.coat, again.fuzz_colour, again.coat_normal),
            (start.coat, start.fuzz_colour, start.coat_normal)
        );

        // Planted: a coat that faces elsewhere is no base.
        let coated = OpenPbrTexel { coat: 0.8, coat_normal: [-0.4, 0.3], coat_roughness: 0.3, ..made };
        let (without, _) = found(&coated, &start, Parts { coat: false, fuzz: false });
        let (with, _) = found(&coated, &start_of(&gltf(), PARTS), PARTS);
        assert!(with < 0.5 * without, "{with} {without}");
    }

    #[test]
    fn slopes_are_those_of_the_error_and_no_step_leaves_the_ranges() {
        let list = list();
        let pairs = Pairs::new(&list);
        let mut scratch = Scratch::default();
        let start = start_of(&gltf(), PARTS);
        let made = OpenPbrTexel { base_colour: [0.6, 0.1, 0.3], f0: 0.2, normal: [0.3, 0.2], fuzz: 0.6, ..start };
        let _ = found(&made, &start, PARTS);
        for [wi, wo] in &list.directions {
            let value = made.reflected(*wi, *wo);
            (0..3).for_each(|c| scratch.decoded[c].push(value[c]));
        }
        fit_texel(&pairs, 0, &start, PARTS, &mut scratch);
        let here = start.to_parameters();
        let error = evaluate(&pairs, &here, &mut scratch);
        let (_, right) = equations(&pairs, &here, PARTS, &mut scratch);
        for p in 0..PARAMETERS {
            let mut there = here;
            there[p] += 1e-3;
            // The derivative of the squared error is twice the right-hand side, negative.
            let slope = (evaluate(&pairs, &there, &mut scratch) - error) / 1e-3;
            assert!((slope + 2.0 * right[p]).abs() < 0.05 * slope.abs() + 0.1, "{p}: {slope} {}", right[p]);
        }
        let mut wild = [9.0; PARAMETERS];
        within_ranges(&mut wild);
        for (value, [least, most]) in wild.iter().zip(RANGES) {
            assert!(*value >= least && *value <= most, "{value}");
        }
        assert!(wild[4].hypot(wild[5]) < MAX_TILT + 1e-5 && wild[20].hypot(wild[21]) < MAX_ANISOTROPY + 1e-5);
    }

    #[test]
    fn parts_are_used_where_they_help() {
        let choose = |maps, coat: f64, fuzz: f64| {
            let error_of =
                |parts: Parts| Ok(100.0 - if parts.coat { coat } else { 0.0 } - if parts.fuzz { fuzz } else { 0.0 });
            choose_parts(maps, error_of).unwrap().0
        };
        assert_eq!(choose(Maps::Auto, 10.0, 1.0), Parts { coat: true, fuzz: false });
        assert_eq!(choose(Maps::Auto, 1.0, 10.0), Parts { coat: false, fuzz: true });
        assert_eq!(choose(Maps::All, -1.0, 0.0), PARTS);
    }
}

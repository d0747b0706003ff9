//! The search for a texel's parameters: damped least squares (Levenberg and Marquardt) on gamma-encoded values, within the ranges of
//! the parameters.

use crate::export::openpbr::model::{
    BaseLobe, BaseValues, CoatLobe, CoatValues, FuzzLobe, FuzzValues, OpenPbrTexel, PARAMETERS, Pair,
};
use crate::export::openpbr::real::Real;
use crate::export::pairs::PairList;
use nalgebra::{SMatrix, SVector};
use wide::f32x8;

/// Added to a linear value under the root, so that the curve has the slope of sRGB at black.
const EPSILON: f32 = 0.003;
/// The root curve is the power 1 / 2.4, sRGB's.
const ROOT: f32 = 2.4;
/// Share of the error that a step must save for the next one to be tried.
const MIN_STEP_SAVED: f64 = 2e-3;
/// Difference of a parameter by which slopes are computed.
const DIFFERENCE: f32 = 2e-3;
/// Largest length of a normal's x and y.
const MAX_TILT: f32 = 0.9;
/// Largest anisotropy.
const MAX_ANISOTROPY: f32 = 0.8;
/// Least roughness of a gloss: narrower highlights fall between measured directions, where nothing says how bright they are.
const MIN_ROUGHNESS: f32 = 0.25;
/// Pairs that are evaluated side by side.
const LANES: usize = 8;

/// Parts of the model that a material may lack.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parts {
    /// Whether there is a coat.
    pub coat: bool,
    /// Whether there is fuzz.
    pub fuzz: bool,
}

impl Parts {
    /// Returns whether the model lacks parameter `p`.
    fn without(self, p: usize) -> bool {
        (!self.coat && (13..=21).contains(&p)) || (!self.fuzz && p >= 22)
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

impl Reach {
    /// Everything changes.
    const ALL: Reach = Reach { base: true, coat: true, fuzz: true, channel: None };
}

/// Ranges of the parameters, in their order.
const RANGES: [[f32; 2]; PARAMETERS] = {
    let (colour, tilt, turn) = ([0.0, 0.98], [-MAX_TILT, MAX_TILT], [-MAX_ANISOTROPY, MAX_ANISOTROPY]);
    let rough = [MIN_ROUGHNESS, 1.0];
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

/// Returns what parameter `p` changes in a model of these parts.
fn reach(p: usize, parts: Parts) -> Reach {
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
        fuzz: parts.fuzz && matches!(p, 4 | 5 | 22 | 26),
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
type Lane = f32x8;

/// Pairs of directions.
pub struct Pairs {
    blocks: Vec<Pair<Lane>>,
    /// Number of pairs; the last block is filled up with others.
    count: usize,
}

impl Pairs {
    /// Arranges a list.
    pub fn new(list: &PairList) -> Pairs {
        let block = |part: &[[[f32; 3]; 2]]| {
            let lanes = |of: usize, axis: usize| {
                Lane::new(std::array::from_fn(|lane| part[lane.min(part.len() - 1)][of][axis]))
            };
            Pair::new([0, 1, 2].map(|axis| lanes(0, axis)), [0, 1, 2].map(|axis| lanes(1, axis)))
        };
        Pairs { blocks: list.directions.chunks(LANES).map(block).collect(), count: list.directions.len() }
    }
}

/// What the layers of a texel have at all pairs.
#[derive(Default)]
struct Layers {
    base: Vec<BaseValues<Lane>>,
    coat: Vec<CoatValues<Lane>>,
    fuzz: Vec<FuzzValues<Lane>>,
}

impl Layers {
    /// Evaluates the layers of a texel that `reach` names; those that it does not name stay.
    fn fill(&mut self, pairs: &Pairs, texel: &OpenPbrTexel, reach: Reach) {
        if reach.base {
            let lobe = BaseLobe::new(texel);
            refill(&mut self.base, pairs.blocks.iter().map(|pair| lobe.at(pair)));
        }
        if reach.coat {
            let lobe = CoatLobe::new(texel);
            refill(&mut self.coat, pairs.blocks.iter().map(|pair| lobe.at(pair)));
        }
        if reach.fuzz {
            let lobe = FuzzLobe::new(texel);
            refill(&mut self.fuzz, pairs.blocks.iter().map(|pair| lobe.at(pair)));
        }
    }
}

fn refill<T>(out: &mut Vec<T>, items: impl Iterator<Item = T>) {
    out.clear();
    out.extend(items);
}

/// Scratch arrays of a texel's search; kept from texel to texel.
#[derive(Default)]
pub struct Scratch {
    /// Decoded values, by channel.
    pub decoded: [Vec<f32>; 3],
    /// Decoded values on the root curve, cut at white.
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

/// Fits the texel whose values are decoded, from a start; returns the squared error on the root curve and the texel.
pub fn fit_texel(
    pairs: &Pairs,
    steps: usize,
    start: &OpenPbrTexel,
    parts: Parts,
    scratch: &mut Scratch,
) -> (f64, OpenPbrTexel) {
    for c in 0..3 {
        let target = |i: usize| scratch.decoded[c].get(i).copied().unwrap_or(0.0);
        let blocks = (0..pairs.blocks.len())
            .map(|block| encoded(Lane::new(std::array::from_fn(|lane| target(block * LANES + lane)))));
        scratch.target[c] = blocks.collect();
    }
    let mut here = start.to_parameters();
    within_ranges(&mut here);
    let own = Reach { coat: parts.coat, fuzz: parts.fuzz, ..Reach::ALL };
    let mut error = evaluate(pairs, &here, Reach::ALL, scratch);
    let mut damping = 1e-2;
    for _ in 0..steps {
        let (gram, right) = equations(pairs, &here, parts, scratch);
        let mut saved = 0.0;
        for _ in 0..4 {
            let mut next = here;
            let step = solve(&gram, &right, &here, parts, damping);
            next.iter_mut().zip(step.iter()).for_each(|(value, step)| *value += *step as f32);
            within_ranges(&mut next);
            let error_next = evaluate(pairs, &next, own, scratch);
            if error_next < error {
                saved = 1.0 - error_next / error;
                (here, error) = (next, error_next);
                damping = (damping * 0.3).max(1e-6);
                break;
            }
            damping *= 6.0;
        }
        if saved < MIN_STEP_SAVED {
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

/// Evaluates the model, of its layers those that `reach` names; returns the squared error on the root curve.
fn evaluate(pairs: &Pairs, parameters: &[f32; PARAMETERS], reach: Reach, scratch: &mut Scratch) -> f64 {
    let texel = OpenPbrTexel::from_parameters(parameters);
    scratch.layers.fill(pairs, &texel, reach);
    let mut error = 0.0;
    for c in 0..3 {
        fill_values(&mut scratch.values[c], &texel, c, &scratch.layers);
        let (values, target) = (&scratch.values[c], &scratch.target[c]);
        let rest = &mut scratch.rest[c];
        refill(rest, values.iter().zip(target).map(|(values, target)| *target - encoded(*values)));
        cut(rest, pairs.count);
        error += sum_of_products(rest, rest);
    }
    error
}

/// Sets what stands beyond `count` numbers to 0.
fn cut(lanes: &mut [Lane], count: usize) {
    let beyond = lanes.iter_mut().flat_map(|lane| lane.as_array_mut()).skip(count);
    beyond.for_each(|x| *x = 0.0);
}

fn fill_values(out: &mut Vec<Lane>, texel: &OpenPbrTexel, c: usize, layers: &Layers) {
    let blocks = layers.base.iter().zip(&layers.coat).zip(&layers.fuzz);
    refill(out, blocks.map(|((base, coat), fuzz)| texel.layered(c, base, coat, fuzz)));
}

/// Returns the normal equations at the parameters `here`, which must be those that were evaluated last.
fn equations(pairs: &Pairs, here: &[f32; PARAMETERS], parts: Parts, scratch: &mut Scratch) -> (Gram, Vector) {
    for c in 0..3 {
        let (slopes, rest) = (&mut scratch.slopes[c], &scratch.rest[c]);
        let shown = scratch.values[c].iter().zip(&scratch.target[c]).zip(rest);
        refill(slopes, shown.map(|((values, target), rest)| slope(*values, *target - *rest)));
        cut(slopes, pairs.count);
    }
    scratch.columns.resize_with(PARAMETERS, Default::default);
    for p in 0..PARAMETERS {
        scratch.columns[p].iter_mut().for_each(Vec::clear);
        if parts.without(p) {
            continue;
        }
        let reach = reach(p, parts);
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
            let (shown, layers) = (values.iter().zip(slopes), base.iter().zip(coat).zip(fuzz));
            column.extend(shown.zip(layers).map(|((values, slopes), ((base, coat), fuzz))| {
                (texel.layered(c, base, coat, fuzz) - *values) * *slopes / Lane::splat(step)
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

/// Returns values on the root curve, cut at white.
#[inline(always)]
fn encoded(values: Lane) -> Lane {
    (values.within(0.0, 1.0) + Lane::splat(EPSILON)).powf(1.0 / ROOT)
}

/// Returns the slope of the root curve, by values and what they are on it; 0 where values are cut.
#[inline(always)]
fn slope(values: Lane, encoded: Lane) -> Lane {
    let (zero, one) = (Lane::ZERO, Lane::splat(1.0));
    let inside = values.if_positive((one - values).if_positive(one, zero), zero);
    inside * encoded / (Lane::splat(ROOT) * (values.within(0.0, 1.0) + Lane::splat(EPSILON)))
}

fn sum_of_products(a: &[Lane], b: &[Lane]) -> f64 {
    let sum = a.iter().zip(b).fold(Lane::ZERO, |sum, (x, y)| sum + *x * *y);
    f64::from(sum.reduce_add())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::gltf::brdf::GltfTexel;
    use crate::export::openpbr::fit::start_of;
    use crate::export::pairs::grid_of_pairs;

    const PARTS: Parts = Parts { coat: true, fuzz: true };

    /// Fits a texel to another's values; returns the error per value on the root curve, and what was found.
    fn found(made: &OpenPbrTexel, start: &OpenPbrTexel, parts: Parts) -> (f64, OpenPbrTexel) {
        let list = grid_of_pairs();
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
        let list = grid_of_pairs();
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
        let error = evaluate(&pairs, &here, Reach::ALL, &mut scratch);
        let (_, right) = equations(&pairs, &here, PARTS, &mut scratch);
        for p in 0..PARAMETERS {
            let mut there = here;
            there[p] += 1e-3;
            // The derivative of the squared error is twice the right-hand side, negative.
            let slope = (evaluate(&pairs, &there, Reach::ALL, &mut scratch) - error) / 1e-3;
            assert!((slope + 2.0 * right[p]).abs() < 0.05 * slope.abs() + 0.1, "{p}: {slope} {}", right[p]);
        }
        let mut wild = [9.0; PARAMETERS];
        within_ranges(&mut wild);
        for (value, [least, most]) in wild.iter().zip(RANGES) {
            assert!(*value >= least && *value <= most, "{value}");
        }
        assert!(wild[4].hypot(wild[5]) < MAX_TILT + 1e-5 && wild[20].hypot(wild[21]) < MAX_ANISOTROPY + 1e-5);
    }
}

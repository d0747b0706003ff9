//! Predicts the pairs of a capture that are not seen from those that are: the best linear prediction (simple kriging) under
//! a covariance between pairs.

use crate::input::rounds::Rounds;
use crate::matrix_product::product;
use crate::priors::covariance::PairCovariance;
use crate::resume::stored::stored_structs;
use nalgebra::{DMatrix, DVector};
use ndarray::{Array2, ArrayViewMut2, Axis, s};
use rayon::prelude::*;

/// Seen pairs up to which every one takes part in every prediction.
pub const MAX_WHOLE: usize = 1800;
/// Seen pairs that take part in a prediction where there are more.
const NEAR: usize = 128;
/// Missing pairs that are predicted together where all seen pairs take part.
const BLOCK: usize = 256;

/// Returns the number of seen pairs that take part in a prediction, of `seen`.
pub fn predicting_pairs(seen: usize) -> usize {
    if seen <= MAX_WHOLE { seen } else { NEAR }
}

/// How missing pairs follow from seen ones.
#[derive(Debug, Clone)]
pub struct Prediction {
    /// Rounds of the lights. Pairs are numbered with the lights of one, and follow from one another alike in all.
    rounds: Rounds,
    seen: Vec<usize>,
    missing: Vec<usize>,
    /// Weight of every seen pair for every missing one, `[seen, missing]`; without columns where only near ones predict.
    whole: Array2<f32>,
    /// For each missing pair the seen pairs that predict it, with weights; empty where all do.
    near: Vec<Vec<(usize, f32)>>,
}

stored_structs! {
    Prediction { rounds, seen, missing, whole, near }
}

impl Prediction {
    /// Finds the weights by which `missing` pairs follow from `seen` ones under `covariance`, numbered as of one of `rounds`.
    ///
    /// Cost: with up to 1800 seen pairs the factorisation of their covariances, `seen (seen + functions)` operations for each
    /// missing pair, and later `3 seen missing` for each texel; with more, `128^3 / 3 + functions (128^2 + seen)` operations for
    /// each missing pair, and `3 x 128 missing` for each texel.
    pub fn new(covariance: &PairCovariance, rounds: Rounds, seen: Vec<usize>, missing: Vec<usize>) -> Prediction {
        let whole = if seen.len() <= MAX_WHOLE { whole_weights(covariance, &seen, &missing) } else { None };
        let near = if whole.is_some() { Vec::new() } else { near_weights(covariance, &seen, &missing) };
        Prediction { rounds, seen, missing, whole: whole.unwrap_or_default(), near }
    }

    /// Fills the missing pairs of texels' rows, `[texel, pair x channel]`, from their seen pairs.
    pub fn fill(&self, mut rows: ArrayViewMut2<f32>) {
        (0..self.rounds.count).for_each(|round| self.fill_round(round, rows.view_mut()));
    }

    fn fill_round(&self, round: usize, mut rows: ArrayViewMut2<f32>) {
        let at = |pair: usize| 3 * self.rounds.place(pair, round);
        if !self.near.is_empty() {
            for mut row in rows.rows_mut() {
                for (pair, sources) in self.missing.iter().zip(&self.near) {
                    let mut sum = [0.0f32; 3];
                    for (source, weight) in sources {
                        (0..3).for_each(|channel| sum[channel] += weight * row[at(*source) + channel]);
                    }
                    (0..3).for_each(|channel| row[at(*pair) + channel] = sum[channel]);
                }
            }
            return;
        }
        // Channels are rows of their own in one product.
        let mut seen = Array2::zeros((3 * rows.nrows(), self.seen.len()));
        for (row, mut seen) in rows.rows().into_iter().zip(seen.axis_chunks_iter_mut(Axis(0), 3)) {
            for (number, pair) in self.seen.iter().enumerate() {
                (0..3).for_each(|channel| seen[[channel, number]] = row[at(*pair) + channel]);
            }
        }
        let found = product(&seen, &self.whole);
        for (mut row, found) in rows.rows_mut().into_iter().zip(found.axis_chunks_iter(Axis(0), 3)) {
            for (number, pair) in self.missing.iter().enumerate() {
                (0..3).for_each(|channel| row[at(*pair) + channel] = found[[channel, number]]);
            }
        }
    }
}

/// Returns the weights of all seen pairs; `None` where their covariances cannot be factored.
fn whole_weights(covariance: &PairCovariance, seen: &[usize], missing: &[usize]) -> Option<Array2<f32>> {
    let among = covariance.between(seen, seen);
    let factor = DMatrix::from_fn(seen.len(), seen.len(), |i, j| f64::from(among[[i, j]])).cholesky()?;
    let mut weights = Array2::zeros((seen.len(), missing.len()));
    let blocks: Vec<_> = weights.axis_chunks_iter_mut(Axis(1), BLOCK).zip(missing.chunks(BLOCK)).collect();
    blocks.into_par_iter().for_each(|(mut weights, missing)| {
        let across = covariance.between(seen, missing);
        for (number, mut weights) in weights.columns_mut().into_iter().enumerate() {
            let found = factor.solve(&DVector::from_fn(seen.len(), |i, _| f64::from(across[[i, number]])));
            weights.iter_mut().zip(found.iter()).for_each(|(weight, found)| *weight = *found as f32);
        }
    });
    Some(weights)
}

/// Returns for each missing pair the seen pairs that tell most about it, each by itself, and their weights together.
fn near_weights(covariance: &PairCovariance, seen: &[usize], missing: &[usize]) -> Vec<Vec<(usize, f32)>> {
    let variances = covariance.variances(seen);
    let predicted = missing.par_chunks(64).flat_map_iter(|missing| {
        let across = covariance.between(missing, seen);
        let predict = |number: usize| {
            let across = across.slice(s![number, ..]);
            let told: Vec<f32> = across.iter().zip(&variances).map(|(c, v)| c * c / v.max(1e-30)).collect();
            let mut order: Vec<usize> = (0..seen.len()).collect();
            order.sort_unstable_by(|a, b| told[*b].total_cmp(&told[*a]).then(a.cmp(b)));
            order.truncate(NEAR);
            let near: Vec<usize> = order.iter().map(|i| seen[*i]).collect();
            let among = covariance.between(&near, &near);
            let matrix = DMatrix::from_fn(near.len(), near.len(), |i, j| f64::from(among[[i, j]]));
            match matrix.cholesky() {
                Some(factor) => {
                    let weights = factor.solve(&DVector::from_fn(near.len(), |i, _| f64::from(across[order[i]])));
                    near.into_iter().zip(weights.iter().map(|weight| *weight as f32)).collect()
                }
                None => near.into_iter().take(1).map(|pair| (pair, 1.0)).collect(),
            }
        };
        (0..missing.len()).map(predict).collect::<Vec<_>>()
    });
    predicted.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_capture::DirectionSet;
    use btf_runtime::Sphere;

    const VIEWS: usize = 12;
    const LIGHTS: usize = 14;
    const PAIRS: usize = VIEWS * LIGHTS;

    /// Returns rows that are smooth in view and light, other for each texel, `[texel, pair x channel]`.
    fn rows(views: &Sphere, lights: &Sphere, texels: usize) -> Array2<f32> {
        Array2::from_shape_fn((texels, 3 * PAIRS), |(texel, i)| {
            let (view, light) = (views.direction((i / 3 / LIGHTS) as u32), lights.direction((i / 3 % LIGHTS) as u32));
            let tilt = [0.7, 1.3, 2.1].map(|k| ((texel + 1) as f32 * k).sin());
            let half = [0, 1, 2].map(|axis| view[axis] + light[axis]);
            0.5 + 0.2 * (tilt[0] * half[0] + tilt[1] * half[1] + tilt[2] * light[2]) + 0.02 * (i % 3) as f32
        })
    }

    #[test]
    fn missing_pairs_follow_from_seen_ones_which_stay_and_priors_of_the_kind_predict_better() {
        let sphere = |count, seed| Sphere::new(&DirectionSet::random(count, seed).unwrap().units()).unwrap();
        let (views, lights) = (sphere(VIEWS, 3), sphere(LIGHTS, 4));
        let exact = rows(&views, &lights, 60);
        let missing: Vec<usize> = (0..PAIRS).filter(|pair| pair % 6 != 0).collect();
        let seen: Vec<usize> = (0..PAIRS).filter(|pair| pair % 6 == 0).collect();
        let samples = exact.slice(s![.., 0..;3]).to_owned();
        let hidden = || {
            let mut rows = exact.clone();
            // What is missing is not looked at.
            missing.iter().for_each(|pair| rows.slice_mut(s![.., 3 * pair..3 * pair + 3]).fill(f32::NAN));
            rows
        };
        let error = |prediction: &Prediction| {
            let mut filled = hidden();
            prediction.fill(filled.view_mut());
            for pair in &seen {
                let own = s![.., 3 * pair..3 * pair + 3];
                assert_eq!(filled.slice(own), exact.slice(own));
            }
            (&filled - &exact).iter().map(|x| f64::from(x * x)).sum::<f64>() / exact.len() as f64
        };
        let once = Rounds { lights: LIGHTS, count: 1 };
        let predicted = |parts: Vec<Array2<f32>>| {
            let covariance = PairCovariance::adapted(&views, &lights, parts, hidden().slice(s![.., 0..;3]), &seen);
            (error(&Prediction::new(&covariance, once, seen.clone(), missing.clone())), covariance)
        };
        let mean = samples.mean().unwrap();
        let spread = samples.iter().map(|x| f64::from((x - mean) * (x - mean))).sum::<f64>() / samples.len() as f64;
        let (by_nearness, covariance) = predicted(Vec::new());
        assert!(by_nearness < 0.2 * spread, "{by_nearness} {spread}");
        let (by_kind, _) = predicted(vec![samples.slice(s![..30, ..]).to_owned()]);
        assert!(by_kind < 0.7 * by_nearness, "{by_kind} {by_nearness}");
        // Planted difference: priors of noise are left aside.
        let noise = Array2::from_shape_fn((8, PAIRS), |(i, j)| ((i * 7919 + j * 104_729) % 1000) as f32 / 500.0 - 1.0);
        let (by_noise, _) = predicted(vec![noise]);
        assert!(by_noise < 3.0 * by_nearness, "{by_noise} {by_nearness}");
        // Where not all seen pairs take part, those that do predict nearly as well.
        let near = near_weights(&covariance, &seen, &missing);
        let near = error(&Prediction {
            rounds: once,
            seen: seen.clone(),
            missing: missing.clone(),
            whole: Array2::default((0, 0)),
            near,
        });
        assert!((near / by_nearness - 1.0).abs() < 0.1, "{near} {by_nearness}");
    }

    #[test]
    fn each_round_of_lights_is_filled_from_its_own_pairs() {
        let rounds = Rounds { lights: 3, count: 2 };
        // Two views; light 1 of view 0 is missing, and follows from light 0 and light 2 by half.
        let (seen, missing, halves) = (vec![0, 2, 3, 4, 5], vec![1], vec![vec![(0, 0.5), (2, 0.5)]]);
        let mut whole = Array2::zeros((5, 1));
        (whole[[0, 0]], whole[[1, 0]]) = (0.5, 0.5);
        for (whole, near) in [(whole, Vec::new()), (Array2::zeros((0, 0)), halves)] {
            let prediction = Prediction { rounds, seen: seen.clone(), missing: missing.clone(), whole, near };
            let mut rows = Array2::from_shape_fn((2, 36), |(texel, i)| (100 * texel + i) as f32);
            for round in [0, 1] {
                rows.slice_mut(s![.., 3 * (1 + 3 * round)..3 * (2 + 3 * round)]).fill(f32::NAN);
            }
            prediction.fill(rows.view_mut());
            for ((texel, i), found) in rows.indexed_iter() {
                assert_eq!(*found, (100 * texel + i) as f32, "{texel} {i}");
            }
        }
    }
}

//! Direction pairs that a fit does not use, and how they are predicted from the pairs that it uses: those that are held back so
//! that their error can be measured (`--leave-out`), and those that have no image.

use btf_capture::CaptureInfo;
use btf_runtime::Sphere;
use nalgebra::{DMatrix, DVector};
use ndarray::{Array2, ArrayView2, s};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

/// Number of measured pairs that predict a held-back one.
const SOURCES: usize = 64;
/// Rounds of predicting held-back samples and estimating covariances.
const ROUNDS: usize = 4;
/// Variance of a sample's own noise, relative to the samples' mean square.
const NOISE: f64 = 1e-3;

/// Held-back and missing pairs and how their samples are filled from the others.
#[derive(Debug, Clone, Default)]
pub struct Holdout {
    /// Held-back and missing pairs, ascending (`view * lights + light`).
    pub pairs: Vec<usize>,
    /// For each held-back pair the pairs, with weights, whose weighted sum stands in for it.
    pub sources: Vec<Vec<(usize, f32)>>,
    /// Number of views and of lights.
    shape: [usize; 2],
}

impl Holdout {
    /// Holds back `share` of the pairs that have an image, chosen by `seed`, beside those that have none. Such a pair is at first
    /// filled with the mean of its neighbours that are seen: the pairs of the same view and a neighbouring light, or of the same
    /// light and a neighbouring view (Delaunay neighbours); without these, with the nearest pair that is seen.
    pub fn new(info: &CaptureInfo, lights: &Sphere, views: &Sphere, share: f64, seed: u64) -> Holdout {
        let mut all: Vec<usize> = info.present_pairs().collect();
        let count = (all.len() as f64 * share).round() as usize;
        if count == 0 && info.missing.is_empty() {
            return Holdout::default();
        }
        all.shuffle(&mut Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x5eed_0f0e));
        let mut pairs = [&all[..count], &info.missing].concat();
        pairs.sort_unstable();
        let held = flags(&pairs, info.pair_count());
        let (light_near, view_near) = (lights.neighbours(), views.neighbours());
        let light_count = lights.len();
        let nearest = CaptureInfo { missing: pairs.clone(), ..info.clone() }.stand_ins();
        let sources = pairs
            .iter()
            .map(|pair| {
                let (view, light) = (pair / light_count, pair % light_count);
                let by_light = light_near[light].iter().map(|other| view * light_count + other);
                let by_view = view_near[view].iter().map(|other| other * light_count + light);
                let mut seen: Vec<usize> = by_light.chain(by_view).filter(|source| !held[*source]).collect();
                if seen.is_empty() {
                    seen.push(nearest[*pair]);
                }
                let weight = 1.0 / seen.len().max(1) as f32;
                seen.into_iter().map(|source| (source, weight)).collect()
            })
            .collect();
        Holdout { pairs, sources, shape: [views.len(), light_count] }
    }

    /// Returns the pairs and weights that predict each held-back pair, learnt from rows `[texel, pair x channel]` that
    /// are filled already: the best linear prediction from the nearest pairs (simple kriging). Nearness and weights
    /// come from covariances separable in view and light, which are estimated from the rows and their fill in turns
    /// (expectation-maximisation).
    ///
    /// Cost: `4 rounds x (6 texels views lights (views + lights) + held pairs x 64^3 / 3)` operations.
    pub fn learn(&self, mut rows: Array2<f32>) -> Vec<Vec<(usize, f32)>> {
        let mut learnt = self.clone();
        let [views, lights] = self.shape;
        let held = flags(&self.pairs, views * lights);
        for _ in 0..ROUNDS {
            let (view, light) = covariances(rows.view(), self.shape);
            let covariance = |a: usize, b: usize| view[[a / lights, b / lights]] * light[[a % lights, b % lights]];
            let seen: Vec<usize> = (0..views * lights).filter(|pair| !held[*pair]).collect();
            learnt.sources = self
                .pairs
                .par_iter()
                .map(|pair| {
                    let nearness =
                        |other: &usize| covariance(*pair, *other).abs() / covariance(*other, *other).max(1e-30).sqrt();
                    let mut near: Vec<(f64, usize)> = seen.iter().map(|other| (nearness(other), *other)).collect();
                    near.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
                    near.truncate(SOURCES);
                    weights(&near.iter().map(|(_, other)| *other).collect::<Vec<_>>(), *pair, &covariance)
                })
                .collect();
            let fill = |mut row: ndarray::ArrayViewMut1<f32>| learnt.fill(row.as_slice_mut().unwrap_or_default());
            rows.rows_mut().into_iter().for_each(fill);
        }
        learnt.sources
    }

    /// Replaces the held-back samples of a texel's row `[pair, channel]`; a pair without sources becomes 0.
    pub fn fill(&self, row: &mut [f32]) {
        for (pair, sources) in self.pairs.iter().zip(&self.sources) {
            let mut sum = [0.0f32; 3];
            for (source, weight) in sources {
                for (channel, sum) in sum.iter_mut().enumerate() {
                    *sum += weight * row[source * 3 + channel];
                }
            }
            row[pair * 3..pair * 3 + 3].copy_from_slice(&sum);
        }
    }

    /// Sets the held-back pairs of a per-pair array to 0.
    pub fn zero(&self, weights: &mut [f32]) {
        self.pairs.iter().for_each(|pair| weights[*pair] = 0.0);
    }
}

fn flags(pairs: &[usize], count: usize) -> Vec<bool> {
    let mut flags = vec![false; count];
    pairs.iter().for_each(|pair| flags[*pair] = true);
    flags
}

/// Returns the second moments between views and between lights over all texels and channels, each scaled to a mean
/// diagonal of 1.
fn covariances(rows: ArrayView2<f32>, [views, lights]: [usize; 2]) -> (Array2<f64>, Array2<f64>) {
    let mut view = Array2::<f64>::zeros((views, views));
    let mut light = Array2::<f64>::zeros((lights, lights));
    // Sums of a few texels in single precision, then in double.
    for block in rows.axis_chunks_iter(ndarray::Axis(0), 16) {
        let mut wide = Array2::<f32>::zeros((views, block.nrows() * 3 * lights));
        let mut tall = Array2::<f32>::zeros((block.nrows() * 3 * views, lights));
        for (texel, row) in block.rows().into_iter().enumerate() {
            for channel in 0..3 {
                let matrix = row.slice(s![channel..;3]).into_shape_with_order((views, lights)).map(|m| m.to_owned());
                let matrix = matrix.unwrap_or_else(|_| {
                    Array2::from_shape_fn((views, lights), |(v, l)| row[(v * lights + l) * 3 + channel])
                });
                let number = texel * 3 + channel;
                wide.slice_mut(s![.., number * lights..(number + 1) * lights]).assign(&matrix);
                tall.slice_mut(s![number * views..(number + 1) * views, ..]).assign(&matrix);
            }
        }
        view += &wide.dot(&wide.t()).mapv(f64::from);
        light += &tall.t().dot(&tall).mapv(f64::from);
    }
    for moments in [&mut view, &mut light] {
        let mean = moments.diag().sum() / moments.nrows().max(1) as f64;
        *moments /= mean.max(1e-30);
    }
    (view, light)
}

/// Returns the weights of the pairs `near` that predict `pair` with least expected squared error.
fn weights(near: &[usize], pair: usize, covariance: &impl Fn(usize, usize) -> f64) -> Vec<(usize, f32)> {
    let n = near.len();
    let among = DMatrix::from_fn(n, n, |i, j| covariance(near[i], near[j]) + if i == j { NOISE } else { 0.0 });
    let across = DVector::from_fn(n, |i, _| covariance(near[i], pair));
    match among.cholesky() {
        Some(factor) => near.iter().zip(factor.solve(&across).iter()).map(|(other, w)| (*other, *w as f32)).collect(),
        None => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_capture::{DirectionSet, ImageFormat};

    /// Returns the rows of rank one in view and light for each texel, with a common shape.
    fn rows(texels: usize, views: usize, lights: usize) -> Array2<f32> {
        let wave = |i: usize, j: usize, k: f32| 1.5 + (i as f32 * 0.7 + j as f32 * k).sin();
        Array2::from_shape_fn((texels, views * lights * 3), |(texel, i)| {
            let (v, l, c) = (i / 3 / lights, i / 3 % lights, i % 3);
            wave(texel % 3, v, 0.3) * wave(texel % 5, l, 0.4) + c as f32 * 0.1
        })
    }

    #[test]
    fn what_is_learnt_predicts_better_than_neighbours_means_and_seen_samples_stay() {
        let (views, lights) = (DirectionSet::random(12, 3).unwrap(), DirectionSet::random(14, 4).unwrap());
        let info = CaptureInfo::new("test", 1, 1, views.clone(), lights.clone(), ImageFormat::Png);
        let sphere = |set: &DirectionSet| Sphere::new(&set.units()).unwrap();
        let mut holdout = Holdout::new(&info, &sphere(&lights), &sphere(&views), 0.2, 1);
        assert_eq!(holdout.pairs.len(), 34);
        let exact = rows(60, 12, 14);
        let filled = |holdout: &Holdout| {
            let mut rows = exact.clone();
            // What is held back is not looked at.
            for mut row in rows.rows_mut() {
                holdout.pairs.iter().for_each(|pair| row.slice_mut(s![pair * 3..pair * 3 + 3]).fill(f32::NAN));
                holdout.fill(row.as_slice_mut().unwrap());
            }
            rows
        };
        let error = |rows: &Array2<f32>| (rows - &exact).iter().map(|x| f64::from(x * x)).sum::<f64>();
        let start = filled(&holdout);
        let before = error(&start);
        holdout.sources = holdout.learn(start);
        let after = filled(&holdout);
        assert!(error(&after) < 0.01 * before, "{} {before}", error(&after));
        let held = flags(&holdout.pairs, 12 * 14);
        for (i, (a, b)) in after.iter().zip(&exact).enumerate() {
            assert!(held[i % (12 * 14 * 3) / 3] || a == b);
        }
    }
}

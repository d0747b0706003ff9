//! Proposes which direction pairs to photograph: those that tell most about all pairs under the priors.

use crate::error::FitError;
use crate::input::layer_frame::layer_directions;
use crate::input::residual_curve::Curve;
use crate::params::{ErrorMeasure, Priors};
use crate::priors::covariance::PairCovariance;
use crate::priors::functions::condensed;
use crate::priors::parts::prior_parts;
use btf_capture::{DirectionSet, Side};
use btf_runtime::{Sphere, SurfaceSide};
use ndarray::{Array1, Array2, ArrayView1};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Dimensions in which the covariance is represented.
const RANK: usize = 300;
/// Variance that a photograph leaves unexplained at its own pair, relative to the mean variance of a pair.
const NOISE: f32 = 1e-3;

/// Pairs to choose from at most: 200 x 200, for which some gigabytes are needed.
const MAX_PAIRS: usize = 40_000;
/// Polar angle of a direction that is not in front of the surface any more, degrees.
const MAX_THETA_DEG: f64 = 89.9;

/// Sides of light and eye for which pairs are proposed.
const FRONT: (SurfaceSide, SurfaceSide) = (SurfaceSide::Front, SurfaceSide::Front);

/// What directions are proposed for.
#[derive(Debug, Clone)]
pub struct ProposeParams {
    /// Number of pairs to propose.
    pub count: usize,
    /// What is known of materials.
    pub priors: Priors,
}

/// Returns pairs of `views` and `lights`, `view * lights + light`, that tell most about all pairs under the priors, the most
/// telling first.
///
/// # Errors
/// Priors that cannot be read; [`FitError::Params`] without any, or for fewer pairs than are to be proposed.
pub fn propose_directions(
    views: &DirectionSet,
    lights: &DirectionSet,
    params: &ProposeParams,
) -> Result<Vec<usize>, FitError> {
    let pairs = views.len() * lights.len();
    if pairs > MAX_PAIRS {
        return Err(FitError::Params(format!(
            "{} x {} directions are {pairs} pairs, more than the {MAX_PAIRS} that are chosen from; give fewer directions",
            views.len(),
            lights.len()
        )));
    }
    let steep = |set: &DirectionSet| set.directions().iter().any(|direction| direction.theta_deg >= MAX_THETA_DEG);
    if steep(views) || steep(lights) {
        return Err(FitError::Params(
            "pairs are proposed for lights and views in front of the surface; give --directions below 90 degrees"
                .into(),
        ));
    }
    if params.count > pairs {
        return Err(FitError::Params(format!(
            "{} pairs were asked for, and these directions have {pairs}",
            params.count
        )));
    }
    let sphere = |set: &DirectionSet| Sphere::new(&layer_directions(set, Side::Front));
    let (views, lights) = (sphere(views)?, sphere(lights)?);
    let (kind, epsilon) = ErrorMeasure::Gamma.residual();
    let parts = prior_parts(&params.priors, FRONT, [&views, &lights], &Curve::new(kind, epsilon))?;
    if parts.is_empty() {
        return Err(FitError::Params("pairs cannot be proposed without priors; leave --priors out".into()));
    }
    Ok(propose_pairs(&PairCovariance::before_samples(&views, &lights, parts), params.count))
}

/// Returns `count` pairs in the order in which they tell most: each lowers the sum of the variances that remain at all pairs
/// by as much as any other could (greedy A-optimal design).
///
/// Cost: a factorisation of the functions, then a few hundred scores of `RANK^2` operations for each pair proposed.
fn propose_pairs(covariance: &PairCovariance, count: usize) -> Vec<usize> {
    let mut remaining = Remaining::new(covariance);
    let mut heap: BinaryHeap<Candidate> =
        (0..remaining.features.nrows()).map(|pair| Candidate { gain: remaining.gain(pair), pair, round: 0 }).collect();
    let mut proposed = Vec::new();
    while proposed.len() < count {
        let Some(best) = heap.pop() else { break };
        // A gain hardly ever grows when more is seen, so one that is up to date and on top is the greatest.
        if best.round < proposed.len() {
            heap.push(Candidate { gain: remaining.gain(best.pair), round: proposed.len(), ..best });
            continue;
        }
        remaining.see(best.pair);
        proposed.push(best.pair);
    }
    proposed
}

/// What is not yet known: features `[pair, dimension]` whose products are the covariances that remain.
struct Remaining {
    features: Array2<f32>,
    /// Sum of the outer products of all features.
    moments: Array2<f32>,
    noise: f32,
}

impl Remaining {
    fn new(covariance: &PairCovariance) -> Remaining {
        let features = condensed(&covariance.functions().t().to_owned(), RANK).reversed_axes();
        let moments = features.t().dot(&features);
        let noise = NOISE * moments.diag().sum() / features.nrows().max(1) as f32;
        Remaining { features, moments, noise }
    }

    /// Returns by how much the sum of the variances falls once `pair` is seen.
    fn gain(&self, pair: usize) -> f32 {
        let own = self.features.row(pair);
        own.dot(&self.moments.dot(&own)) / (own.dot(&own) + self.noise)
    }

    /// Takes out what `pair` tells.
    fn see(&mut self, pair: usize) {
        let own = self.features.row(pair).to_owned();
        let square = own.dot(&own);
        if square <= 0.0 {
            return;
        }
        // I - own own^T / (square + noise) is the square of I - share u u^T with u = own / |own|.
        let share = (1.0 - (self.noise / (square + self.noise)).sqrt()) / square;
        let along: Array1<f32> = self.features.dot(&own);
        subtract_outer(&mut self.features, along.view(), own.view(), share);
        let left = self.moments.dot(&own);
        let twice = own.dot(&left);
        subtract_outer(&mut self.moments, left.view(), own.view(), share);
        subtract_outer(&mut self.moments, own.view(), left.view(), share);
        subtract_outer(&mut self.moments, own.view(), own.view(), -share * share * twice);
    }
}

/// Subtracts `scale a b^T`.
fn subtract_outer(matrix: &mut Array2<f32>, a: ArrayView1<f32>, b: ArrayView1<f32>, scale: f32) {
    for (mut row, a) in matrix.rows_mut().into_iter().zip(a) {
        row.scaled_add(-scale * a, &b);
    }
}

#[derive(Debug, PartialEq)]
struct Candidate {
    gain: f32,
    pair: usize,
    /// Number of pairs that were proposed when the gain was computed.
    round: usize,
}

impl Eq for Candidate {}

impl Ord for Candidate {
    fn cmp(&self, other: &Candidate) -> Ordering {
        self.gain.total_cmp(&other.gain).then(other.pair.cmp(&self.pair)).then(self.round.cmp(&other.round))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Candidate) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn proposed_pairs_are_distinct_and_leave_less_unknown_than_others() {
        let set = DirectionSet::random(9, 5).unwrap();
        let sphere = Sphere::new(&set.units()).unwrap();
        let (kind, epsilon) = ErrorMeasure::Gamma.residual();
        let parts = prior_parts(&Priors::BuiltIn, FRONT, [&sphere, &sphere], &Curve::new(kind, epsilon)).unwrap();
        let covariance = PairCovariance::before_samples(&sphere, &sphere, parts);
        let proposed = propose_pairs(&covariance, 12);
        let mut distinct = proposed.clone();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!((distinct.len(), distinct[11] < 81), (12, true));
        // The list may be cut short anywhere.
        assert_eq!(propose_pairs(&covariance, 5), proposed[..5]);
        let left = |seen: &[usize]| {
            let mut remaining = Remaining::new(&covariance);
            seen.iter().for_each(|pair| remaining.see(*pair));
            let sum: f32 = remaining.features.iter().map(|x| x * x).sum();
            // The moments are kept up to date.
            assert!((remaining.moments.diag().sum() / sum - 1.0).abs() < 1e-2);
            sum
        };
        let others: Vec<usize> = (0..12).map(|i| i * 81 / 12).collect();
        assert!(left(&proposed) < 0.8 * left(&others), "{} {}", left(&proposed), left(&others));
        let told = propose_directions(&set, &set, &ProposeParams { count: 82, priors: Priors::BuiltIn })
            .unwrap_err()
            .to_string();
        assert!(told.contains("have 81"), "{told}");
        let behind = set.behind().unwrap();
        let told = propose_directions(&set, &behind, &ProposeParams { count: 2, priors: Priors::BuiltIn });
        assert!(told.unwrap_err().to_string().contains("in front of the surface"));
        let none = ProposeParams { count: 2, priors: Priors::Assets(Vec::new()) };
        assert!(propose_directions(&set, &set, &none).unwrap_err().to_string().contains("without priors"));
    }
}

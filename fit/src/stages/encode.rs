//! Quantisation of a residual's model into what the format stores. One step size decides on everything: coefficients,
//! the clusters' mixtures and the shared bases are each quantised so that a code's error moves the samples by as much
//! as a coefficient's does. Equal slopes of error against bytes follow from that [Shoham 1988], within a layer and
//! between layers.

use crate::numeric::principal_directions::sorted_eigen;
use crate::stages::factor::{Rotated, RoundedFactors};
use crate::stages::local_pca::LocalPca;
use crate::stages::texel_coordinates::Coordinates;
use btf_runtime::{
    Basis, Coefficients, MAX_BASIS_STEP, MAX_COEFFICIENT_STEP, MAX_COMPONENTS, PredictedGroup, Residual, SharedBases,
    choose_coefficients, plane_bytes,
};
use nalgebra::DMatrix;
use ndarray::{Array1, Array2, Axis, s};
use rayon::prelude::*;

/// Shift of the rounding towards 0, in steps, of coefficients that are coded by themselves, and of bases: what a code near
/// 0 costs in bytes, its small gain does not pay.
const DEAD_ZONE: f32 = 0.1;
const BASIS_DEAD_ZONE: f32 = 0.2;
/// Steps of the shared bases, of mixtures and of factors, relative to those of equal error. Larger ones for what many
/// values hang on: their errors average out (found by search, cloth at 128 kB and 2 MB).
const SHARED_STEP: f64 = 1.25;
const MIXTURE_STEP: f64 = 1.15;
const FACTOR_STEP: f64 = 1.5;
/// Bytes of an entry of a factor, about.
const FACTOR_BYTES: f64 = 0.7;
/// Squared error that a byte must remove to be worth it, in squared steps: the slope of an entropy-coded uniform
/// quantiser, `2 ln 2 / 12` a bit, 8 bits.
const SQUARED_STEPS_PER_BYTE: f64 = 0.92;
/// Squared error that a byte of a component must remove, in squared steps: more than that, because every component takes
/// memory and time of a renderer (cloth of 2 MB: 84 components in place of 128 for the same PSNR).
const COMPONENT_WORTH: f64 = 2.2;
/// Root mean square, in steps, of a component's coefficients in a cluster below which the component is left out there:
/// nearly all of its codes would be 0.
const MIN_RMS: f64 = 0.4;
/// Energy of a direction, in squared steps, below which it is dropped.
const MIN_DIRECTION: f64 = 0.1;
/// Energy that a coefficient's rounding loses on average, in squared steps.
const LOST_BY_ROUNDING: f64 = 0.15;
/// Ridge of the refit, relative to the mean diagonal of the bases' Gram matrix.
const RIDGE: f64 = 1e-6;
/// Bytes of predicted coefficients relative to those of components that are coded by themselves, roughly.
const PREDICTED_SHARE: f64 = 0.7;
/// Squared error, in squared steps, that a bit of a predicted coefficient must remove.
const SQUARED_STEPS_PER_BIT: f32 = 0.1;
/// Components of the first group of predicted coefficients, which lobes of the first tiers depend on.
const FIRST_GROUP: usize = 3;
/// Numbers of components of the left, upper, upper left and upper right neighbour by which a coefficient is predicted.
const INPUTS: [usize; 4] = [64, 64, 8, 16];
/// Largest code of a shared basis or a mixture.
const MAX_CODE: f32 = 32_000.0;

/// A layer's residual before the choice of a step.
pub struct Model {
    /// Every texel's coordinates, without the directions (`rotated` holds them).
    pub coordinates: Coordinates,
    /// Factored directions.
    pub rotated: Rotated,
    /// Models of the clusters in coordinates.
    pub clusters: Vec<LocalPca>,
    /// Texels per row.
    pub width: usize,
}

/// Ways to quantise coefficients.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// Each component by itself: quick, for a first idea of error and size.
    Draft,
    /// Predicted from the neighbouring texels, each code chosen by its error and its bits.
    Predicted,
}

/// A quantised residual with its predicted error.
pub struct Encoded {
    /// Number of bytes of each group of predicted coefficients.
    pub group_bytes: Vec<usize>,
    /// The residual.
    pub residual: Residual,
    /// Predicted sum over texels and samples of the squared error, in the residual's curve.
    pub error: f64,
}

/// Returns the code nearest to `value / step`, with a dead zone around 0.
fn code(value: f32, step: f32, dead_zone: f32) -> f32 {
    let steps = value / step;
    (steps.abs() + 0.5 - dead_zone).floor().copysign(steps)
}

/// Returns the codes of `values` and their step: about `step`, larger where the codes would need more than 16 bits.
fn quantize(values: &[f32], step: f64) -> (f32, Vec<i16>) {
    let peak = values.iter().fold(0.0f32, |peak, x| peak.max(x.abs()));
    let step = (step as f32).max(peak / MAX_CODE).clamp(1e-20, MAX_BASIS_STEP);
    (step, values.iter().map(|x| code(*x, step, BASIS_DEAD_ZONE).clamp(-MAX_CODE, MAX_CODE) as i16).collect())
}

impl Model {
    /// Quantises everything with the step `step` (in the residual's curve, of orthonormal coefficients), with at
    /// most `most_components` components.
    ///
    /// Cost: some products of `texels x directions x components`; no pass over the capture. Predicted coefficients take
    /// about twice as long as a file with them takes to load, on one core.
    pub fn encode(&self, step: f64, most_components: usize, coding: Coding) -> Encoded {
        let shared = self.shared_bases(step);
        let on = self.products(&shared);
        let count = self.clusters.iter().map(|cluster| cluster.variances.len()).max().unwrap_or(0);
        let count = count.min(most_components).min(MAX_COMPONENTS);
        let fitted: Vec<Fitted> = self.clusters.par_iter().map(|cluster| self.fit(cluster, &on, step, count)).collect();

        let texels = self.coordinates.scores.nrows();
        let mut bases = vec![collect_basis(&fitted, 0)];
        let mut coefficients = Vec::new();
        // Components in order, as long as they are worth their bytes.
        let batch = 2 * rayon::current_num_threads();
        'components: for first in (0..count).step_by(batch) {
            let planes: Vec<(Coefficients, Basis, bool)> = (first..(first + batch).min(count))
                .into_par_iter()
                .map(|j| {
                    let (plane, gain) = self.plane(&fitted, j, texels, step);
                    let basis = collect_basis(&fitted, j + 1);
                    let codes: Vec<i32> = plane.codes.iter().map(|code| i32::from(*code)).collect();
                    let values: Vec<i32> = basis.values.iter().map(|code| i32::from(*code)).collect();
                    let of_basis = plane_bytes(&values, shared.bases.steps.len()) + 4 * self.clusters.len();
                    let bytes = PREDICTED_SHARE * plane_bytes(&codes, self.width) as f64 + of_basis as f64;
                    let worth = gain > COMPONENT_WORTH * step * step * bytes;
                    (plane, basis, worth)
                })
                .collect();
            for (plane, basis, worth) in planes {
                if !worth {
                    break 'components;
                }
                bases.push(basis);
                coefficients.push(plane);
            }
        }
        let factors = shared.factors.factors();
        let mut residual = Residual { factors, shared: shared.bases, bases, coefficients, groups: Vec::new() };
        let group_bytes = match coding {
            Coding::Predicted => self.predict(&mut residual, &fitted, step),
            Coding::Draft => Vec::new(),
        };
        let error = self.error(&fitted, &residual.coefficients, &on);
        Encoded { residual, error, group_bytes }
    }

    /// Chooses the codes of the components of `residual` anew, in groups of predicted ones. Returns the groups' bytes.
    fn predict(&self, residual: &mut Residual, fitted: &[Fitted], step: f64) -> Vec<usize> {
        let count = residual.coefficients.len();
        let texels = self.coordinates.scores.nrows();
        let mut wanted = vec![0.0f32; texels * count];
        let mut labels = vec![0u8; texels];
        let mut peaks = vec![0.0f32; count];
        for (cluster, fitted) in fitted.iter().enumerate() {
            let used = fitted.coefficients.ncols().min(count);
            for (texel, row) in fitted.members.iter().zip(fitted.coefficients.rows()) {
                labels[*texel] = cluster as u8;
                let row = row.slice(s![..used]);
                wanted[texel * count..][..used].iter_mut().zip(row).for_each(|(x, y)| *x = *y);
                peaks.iter_mut().zip(row).for_each(|(peak, y)| *peak = peak.max(y.abs()));
            }
        }
        for (plane, peak) in residual.coefficients.iter_mut().zip(&peaks) {
            plane.step = (step as f32).max(peak / 127.0).clamp(1e-20, MAX_COEFFICIENT_STEP);
        }
        for row in wanted.chunks_exact_mut(count.max(1)) {
            row.iter_mut().zip(&residual.coefficients).for_each(|(x, plane)| *x /= plane.step);
        }
        let ends = [FIRST_GROUP.min(count), count];
        let mut first = 0;
        for end in ends {
            if end > first {
                let inputs = INPUTS.map(|inputs| inputs.min(end) as u8);
                residual.groups.push(PredictedGroup { components: end - first, inputs, own: first as u8 });
            }
            first = end;
        }
        choose_coefficients(residual, (self.width, &labels), &wanted, SQUARED_STEPS_PER_BIT)
    }

    /// Turns the directions to the principal ones of what the clusters' means and components hold at `step`, most important
    /// first, and drops those that hold next to nothing.
    ///
    /// Cost: some products of `texels x directions^2` and of the directions' cores with as many directions, and the
    /// eigenvectors of one matrix of all directions.
    pub fn turn_to(&mut self, step: f64) {
        let count = self.rotated.count();
        let mut gram = Array2::<f32>::zeros((count, count));
        for cluster in &self.clusters {
            let told = self.told(cluster, step);
            let mut rows = Array2::<f32>::zeros((1 + told.len(), count));
            rows.row_mut(0).assign(&(&cluster.mean * (cluster.members.len() as f32).sqrt()));
            for (j, energy) in told.iter().enumerate() {
                rows.row_mut(1 + j).assign(&(&cluster.components.column(j) * energy.sqrt() as f32));
            }
            gram += &rows.t().dot(&rows);
        }
        let (energies, vectors) = sorted_eigen(&gram.mapv(f64::from));
        let kept = energies.iter().take_while(|energy| **energy > MIN_DIRECTION * step * step).count();
        let turn = vectors.slice(s![.., ..kept]).mapv(|x| x as f32);
        self.coordinates.scores = self.coordinates.scores.dot(&turn);
        self.coordinates.energies = energies[..kept].to_vec();
        for cluster in &mut self.clusters {
            cluster.mean = turn.t().dot(&cluster.mean);
            cluster.components = turn.t().dot(&cluster.components);
        }
        self.rotated.mix(&turn);
    }

    /// Returns the energy that each of the components of `cluster` that are worth their codes at `step` holds.
    fn told(&self, cluster: &LocalPca, step: f64) -> Vec<f64> {
        let texels = cluster.members.len() as f64;
        let told = cluster.variances.iter().take_while(|variance| (**variance / texels).sqrt() > MIN_RMS * step);
        told.map(|variance| (variance - LOST_BY_ROUNDING * texels * step * step).max(0.0)).collect()
    }

    /// Returns the energy along each direction of what the clusters' means and components hold at `step`.
    fn represented(&self, step: f64) -> Vec<f64> {
        let mut energies = vec![0.0f64; self.rotated.count()];
        for cluster in &self.clusters {
            let texels = cluster.members.len() as f64;
            energies.iter_mut().zip(&cluster.mean).for_each(|(sum, x)| *sum += texels * f64::from(*x).powi(2));
            for (component, energy) in cluster.components.columns().into_iter().zip(self.told(cluster, step)) {
                energies.iter_mut().zip(component).for_each(|(sum, x)| *sum += energy * f64::from(*x).powi(2));
            }
        }
        energies
    }

    /// Quantises the shared bases' cores and cuts the factors to the ranks that are worth their bytes.
    fn shared_bases(&self, step: f64) -> Shared {
        let [views, lights] = self.rotated.shape;
        let energies = self.represented(step);
        let steps: Vec<f64> = energies.iter().map(|energy| SHARED_STEP * step / energy.max(1e-30).sqrt()).collect();
        // Squared error, in squared steps, that each rank takes away.
        let mut ranks = [[0; 2]; 3];
        for (channel, ranks) in ranks.iter_mut().enumerate() {
            let mut gains = [vec![0.0f64; views], vec![0.0f64; lights]];
            for (basis, step) in steps.iter().enumerate() {
                for ((v, l), x) in self.rotated.core(basis, channel).indexed_iter() {
                    if code(*x, *step as f32, BASIS_DEAD_ZONE) != 0.0 {
                        let gain = (f64::from(*x) / step).powi(2);
                        gains[0][v] += gain;
                        gains[1][l] += gain;
                    }
                }
            }
            let cut = |gains: &[f64], height: usize| {
                // A rank costs its column of halves; its codes were judged one by one.
                let price = SQUARED_STEPS_PER_BYTE * FACTOR_BYTES * height as f64;
                gains.iter().rposition(|gain| *gain > price).map_or(0, |last| last + 1)
            };
            *ranks = [cut(&gains[0], views), cut(&gains[1], lights)];
            if ranks.contains(&0) {
                *ranks = [0, 0];
            }
        }
        // Energy that each column of the factors carries.
        let mut carried = ranks.map(|ranks| ranks.map(|rank| vec![0.0f64; rank]));
        for (channel, carried) in carried.iter_mut().enumerate() {
            for (basis, energy) in energies.iter().enumerate() {
                let core = self.rotated.core(basis, channel);
                for ((v, l), x) in core.slice(s![..ranks[channel][0], ..ranks[channel][1]]).indexed_iter() {
                    let energy = energy * f64::from(*x).powi(2);
                    carried[0][v] += energy;
                    carried[1][l] += energy;
                }
            }
        }
        let factor_steps = carried.map(|sides| {
            sides.map(|side| side.iter().map(|energy| FACTOR_STEP * step / energy.max(1e-30).sqrt()).collect())
        });
        let rounded = self.rotated.rounded_factors(ranks, &factor_steps);
        let coded: Vec<(f32, Vec<i16>)> = (0..self.rotated.count())
            .into_par_iter()
            .map(|basis| {
                let core = |channel: usize| rounded.nearest_core(self.rotated.core(basis, channel), channel);
                let values: Vec<f32> =
                    (0..3).flat_map(|channel| core(channel).into_iter().collect::<Vec<_>>()).collect();
                quantize(&values, steps[basis])
            })
            .collect();
        let used = coded.iter().rposition(|(_, values)| values.iter().any(|q| *q != 0)).map_or(0, |last| last + 1);
        let bases = SharedBases {
            steps: coded[..used].iter().map(|(step, _)| *step).collect(),
            values: coded[..used].iter().flat_map(|(_, values)| values.iter().copied()).collect(),
        };
        Shared { bases, ranks, factors: rounded }
    }

    /// Returns the products of the decoded shared bases among themselves and with the exact directions.
    fn products(&self, shared: &Shared) -> Products {
        let used = shared.bases.steps.len();
        let len: usize = shared.ranks.iter().map(|[rv, rl]| rv * rl).sum();
        let [views, lights] = self.rotated.shape;
        // Both in the exact frame, `[basis, channel x view x light]`.
        let mut decoded = Array2::<f32>::zeros((used, 3 * views * lights));
        decoded.axis_iter_mut(Axis(0)).into_par_iter().enumerate().for_each(|(basis, mut row)| {
            let step = shared.bases.steps[basis];
            let mut at = basis * len;
            for (channel, [rv, rl]) in shared.ranks.iter().enumerate() {
                let core =
                    Array2::from_shape_fn((*rv, *rl), |(r, s)| step * f32::from(shared.bases.values[at + r * rl + s]));
                at += rv * rl;
                let exact = shared.factors.exact_core(core.view(), channel);
                row.slice_mut(s![channel * views * lights..(channel + 1) * views * lights])
                    .iter_mut()
                    .zip(&exact)
                    .for_each(|(x, y)| *x = *y);
            }
        });
        let mut exact = Array2::<f32>::zeros((self.rotated.count(), 3 * views * lights));
        for (basis, mut row) in exact.rows_mut().into_iter().enumerate() {
            let values = (0..3).flat_map(|channel| self.rotated.core(basis, channel));
            row.iter_mut().zip(values).for_each(|(x, y)| *x = *y);
        }
        let gram = decoded.dot(&decoded.t());
        let cross = exact.dot(&decoded.t());
        let mixtures = ridged_inverse(&gram).dot(&cross.t().mapv(f64::from)).mapv(|x| x as f32);
        Products { mixtures, cross, gram }
    }

    /// Returns a cluster's mean and components on the decoded shared bases, and its texels' coefficients on those.
    fn fit(&self, cluster: &LocalPca, on: &Products, step: f64, count: usize) -> Fitted {
        let Products { gram, cross, mixtures } = on;
        let used = gram.nrows();
        let texels = cluster.members.len();
        let kept = cluster
            .variances
            .iter()
            .take(count)
            .take_while(|variance| (**variance / texels as f64).sqrt() > MIN_RMS * step)
            .count();
        let nearest = mixtures.dot(&cluster.components.slice(s![.., ..kept]));
        let mut bases = Vec::with_capacity(count + 1);
        bases.push(if texels == 0 {
            (0.0, vec![0; used])
        } else {
            quantize(&mixtures.dot(&cluster.mean).to_vec(), step / (texels as f64).sqrt())
        });
        for j in 0..kept {
            bases.push(quantize(
                &nearest.column(j).to_vec(),
                MIXTURE_STEP * step / cluster.variances[j].max(1e-30).sqrt(),
            ));
        }
        // What quantised to nothing has no coefficients; components are dropped from the end only.
        let kept = (1..=kept).take_while(|j| bases[*j].1.iter().any(|q| *q != 0)).count();
        bases.truncate(kept + 1);
        let decoded = |j: usize| bases[j].1.iter().map(|q| bases[j].0 * f32::from(*q)).collect::<Array1<f32>>();
        let mean = decoded(0);
        let mut components = Array2::<f32>::zeros((used, kept));
        for j in 0..kept {
            components.column_mut(j).assign(&decoded(j + 1));
        }
        bases.resize(count + 1, (0.0, vec![0; used]));
        let own_gram = components.t().dot(&gram.dot(&components));
        // Products of the residual about the mean with the components, then their coefficients.
        let rows = self.coordinates.scores.select(Axis(0), &cluster.members);
        let mut products = rows.dot(&cross.dot(&components));
        products -= &components.t().dot(&gram.dot(&mean));
        let coefficients = products.dot(&ridged_inverse(&own_gram).mapv(|x| x as f32));
        Fitted { members: cluster.members.clone(), bases, mean, own_gram, products, coefficients }
    }

    /// Returns the codes of component `j` for all texels, and the squared error that they take away.
    fn plane(&self, fitted: &[Fitted], j: usize, texels: usize, step: f64) -> (Coefficients, f64) {
        let mut peak = 0.0f32;
        for cluster in fitted.iter().filter(|cluster| j < cluster.coefficients.ncols()) {
            peak = cluster.coefficients.column(j).iter().fold(peak, |peak, x| peak.max(x.abs()));
        }
        let step = (step as f32).max(peak / 127.0).min(MAX_COEFFICIENT_STEP);
        let mut codes = vec![0i8; texels];
        let (mut up, mut down, mut energy, mut left) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
        for cluster in fitted.iter().filter(|cluster| j < cluster.coefficients.ncols()) {
            for (texel, y) in cluster.members.iter().zip(cluster.coefficients.column(j)) {
                let q = code(*y, step, DEAD_ZONE).clamp(-127.0, 127.0);
                codes[*texel] = q as i8;
                let (q, y) = (f64::from(q), f64::from(*y));
                up += q * y;
                down += q * q;
                energy += y * y;
            }
        }
        // The step of least squares for these codes.
        let step = if down > 0.0 { (up / down) as f32 } else { 0.0 };
        left += energy - up * up / down.max(1e-30);
        (Coefficients { step, codes }, energy - left)
    }

    /// Returns the predicted squared error over all texels and samples.
    fn error(&self, fitted: &[Fitted], planes: &[Coefficients], on: &Products) -> f64 {
        let Products { gram, cross, .. } = on;
        let sums: Vec<f64> = fitted
            .par_iter()
            .zip(&self.clusters)
            .map(|(fitted, cluster)| {
                let texels = cluster.members.len() as f64;
                // |x - mean|^2 summed, without |x|^2.
                let along = f64::from(fitted.mean.dot(&cross.t().dot(&cluster.mean)));
                let mut sum = texels * (f64::from(fitted.mean.dot(&gram.dot(&fitted.mean))) - 2.0 * along);
                let used = planes.len().min(fitted.coefficients.ncols());
                let own_gram = fitted.own_gram.slice(s![..used, ..used]);
                let mut y = Array2::<f32>::zeros((fitted.members.len(), used));
                for (mut row, texel) in y.rows_mut().into_iter().zip(&fitted.members) {
                    row.iter_mut().zip(planes).for_each(|(y, plane)| *y = plane.step * f32::from(plane.codes[*texel]));
                }
                // y' G y - 2 y' p, texel by texel.
                let mut slopes = y.dot(&own_gram);
                slopes.scaled_add(-2.0, &fitted.products.slice(s![.., ..used]));
                for (y, slope) in y.rows().into_iter().zip(slopes.rows()) {
                    sum += f64::from(y.dot(&slope));
                }
                sum
            })
            .collect();
        (self.coordinates.squares + sums.iter().sum::<f64>()).max(0.0)
    }
}

struct Shared {
    bases: SharedBases,
    ranks: [[usize; 2]; 3],
    factors: RoundedFactors,
}

/// Products of the decoded shared bases.
struct Products {
    /// Products among the shared bases, `[shared basis, shared basis]`.
    gram: Array2<f32>,
    /// Products with the exact directions, `[direction, shared basis]`.
    cross: Array2<f32>,
    /// `gram^-1 cross'`: times a vector of coordinates, this is the mixture of shared bases nearest to the vector.
    mixtures: Array2<f32>,
}

/// A cluster's model on the decoded shared bases.
struct Fitted {
    members: Vec<usize>,
    /// Step and codes of the mean and of each component; empty for components that the cluster does without.
    bases: Vec<(f32, Vec<i16>)>,
    /// Mean as it is decoded.
    mean: Array1<f32>,
    /// Gram matrix of the decoded components.
    own_gram: Array2<f32>,
    /// Products of each member's residual about the mean with the components, `[member, component]`.
    products: Array2<f32>,
    /// Least-squares coefficients of each member, `[member, component]`.
    coefficients: Array2<f32>,
}

fn collect_basis(fitted: &[Fitted], index: usize) -> Basis {
    Basis {
        steps: fitted.iter().map(|cluster| cluster.bases[index].0).collect(),
        values: fitted.iter().flat_map(|cluster| cluster.bases[index].1.iter().copied()).collect(),
    }
}

/// Returns the inverse of a Gram matrix with a ridge.
fn ridged_inverse(gram: &Array2<f32>) -> Array2<f64> {
    let n = gram.nrows();
    let trace: f64 = (0..n).map(|i| f64::from(gram[[i, i]])).sum();
    let ridge = RIDGE * trace / n.max(1) as f64 + 1e-12;
    let matrix = DMatrix::from_fn(n, n, |i, j| {
        0.5 * (f64::from(gram[[i, j]]) + f64::from(gram[[j, i]])) + if i == j { ridge } else { 0.0 }
    });
    let inverse = matrix.cholesky().map(|cholesky| cholesky.inverse()).unwrap_or_else(|| DMatrix::identity(n, n));
    Array2::from_shape_fn((n, n), |(i, j)| inverse[(i, j)])
}

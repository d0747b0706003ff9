//! Lobe weights as functions of a texel's first coefficients: what the lobes then give is near to the texel's value, and
//! what a decoder subtracts for it, an affine function of the coefficients, is near to what they give.

use crate::error::FitError;
use crate::input::texel_sample::texel_sample;
use crate::resume::stored::stored_structs;
use crate::stages::encode::Model;
use crate::stages::lasso::non_negative_weights;
use crate::stages::local_pca::LocalPca;
use crate::stages::residual_source::ResidualSource;
use crate::stages::sparse::{ClusterLobes, Selection};
use btf_runtime::{
    DictionaryLobe, Layer, Lobe, LobeFamily, LobeWeights, ResidualKind, Sphere, first_lobes, lobe_sum_at_pairs,
    lobe_tables, mark_used_lobes,
};
use half::f16;
use nalgebra::{DMatrix, DVector};
use ndarray::{Array1, Array2, ArrayView1, Axis, s};
use rayon::prelude::*;

/// Coefficients that weights depend on.
const INPUTS: usize = 4;
/// Texels of a cluster over which decoders take the affine part of the lobes.
const NODES: usize = 64;
/// Step of the weights' codes, relative to the lobe's weight scale.
const STEP: f32 = 1.0 / 64.0;
/// Texels of all clusters, and direction pairs, that weights are fitted on.
const TEXELS: usize = 4096;
const PAIRS: usize = 256;
/// Prices of the squared distance of the lobes from the value, beside that from the affine function, which stays as an
/// error at measured directions. The first is the best between the directions (leather of 2 MB: 0.3 and 0.1 lose 0.15
/// and 0.06 dB at measured directions and give nothing); the others are for files that are more exact than lobes are.
const DISTANCE_PRICES: [f64; 3] = [0.03, 0.003, 0.0003];
/// Largest share of the squared error at measured directions that lobes may add: 0.11 dB.
const MAX_ADDED: f64 = 0.025;
/// Gauss-Newton steps, and the ridge on the slopes relative to the number of samples.
const ITERATIONS: usize = 6;
const RIDGE: f64 = 1e-4;

/// Fitted weights of all clusters' lobes, for each of [`DISTANCE_PRICES`].
pub struct FittedWeights {
    /// Root mean square of each coefficient that weights depend on.
    inputs_rms: Vec<f32>,
    /// Texels of each cluster that they were fitted to.
    texels: Vec<Vec<usize>>,
    /// The lobes of each cluster at the pairs that they were fitted to, `[cluster][lobe][pair]`.
    tables: Vec<Vec<Vec<f32>>>,
    /// Weights for each price.
    choices: Vec<WeightCodes>,
}

stored_structs! {
    FittedWeights { inputs_rms, texels, tables, choices }
}

/// Quantised weights.
#[derive(Clone)]
struct WeightCodes {
    /// Weight scale of each lobe, `[cluster][lobe]`.
    scales: Vec<Vec<f32>>,
    /// Constants and slopes in steps of [`STEP`], `[lobe of all clusters][channel][1 + inputs]`.
    codes: Vec<i16>,
}

stored_structs! {
    WeightCodes { scales, codes }
}

impl FittedWeights {
    /// Fits the weights of `clusters`' lobes to the whole values of some texels, which `values` must give, as functions
    /// of their coefficients in `model`.
    ///
    /// Cost: a read of these texels, and [`ITERATIONS`] products of `texels x pairs x inputs^2` for each lobe.
    pub fn new(
        values: &ResidualSource,
        clusters: &[ClusterLobes],
        model: &Model,
        (kind, epsilon): (ResidualKind, f32),
        most_texels: usize,
        seed: u64,
    ) -> Result<FittedWeights, FitError> {
        let components = model.clusters.iter().map(|cluster| cluster.variances.len()).max().unwrap_or(0);
        let inputs_rms = inputs_rms(model, components.min(INPUTS));
        let share = TEXELS.min(most_texels).div_ceil(clusters.len().max(1));
        let pairs = texel_sample(values.cache.pair_count(), PAIRS, seed);
        let chosen: Vec<Vec<usize>> = model
            .clusters
            .iter()
            .map(|cluster| {
                let some = texel_sample(cluster.members.len(), share, seed);
                some.into_iter().map(|i| cluster.members[i]).collect()
            })
            .collect();
        let mut all = chosen.concat();
        all.sort_unstable();
        let block = values.cache.gather(&all)?;
        let found = clusters.par_iter().zip(&chosen).enumerate().map(|(k, (lobes, chosen))| {
            let tables = Array2::from_shape_fn((lobes.lobes.len(), pairs.len()), |(j, p)| lobes.tables[j][pairs[p]]);
            let inputs = inputs(model, &model.clusters[k], chosen, &inputs_rms);
            if tables.is_empty() || inputs.is_empty() {
                return vec![vec![Array2::zeros((tables.nrows(), inputs.ncols())); DISTANCE_PRICES.len()]; 3];
            }
            let mut samples = vec![Array2::<f32>::zeros((chosen.len(), pairs.len())); 3];
            for (t, texel) in chosen.iter().enumerate() {
                let number = all.partition_point(|other| other < texel);
                let row = values.rows(&block, number..number + 1, |_| *texel);
                for (c, p) in (0..3).flat_map(|c| (0..pairs.len()).map(move |p| (c, p))) {
                    samples[c][[t, p]] = row[[0, 3 * pairs[p] + c]];
                }
            }
            let (tables, inputs) = (&tables, &inputs);
            let of_channel =
                |values| Channel { kind, epsilon, tables, inputs, values, directions: orthonormal(inputs) }.fit();
            samples.into_par_iter().map(of_channel).collect()
        });
        // [cluster][channel][price]
        let found: Vec<Vec<Vec<Array2<f64>>>> = found.collect();
        let of_price = |price: usize| {
            let of_price = found.iter().map(|cluster| cluster.iter().map(|channel| &channel[price]).collect());
            WeightCodes::new(&of_price.collect::<Vec<_>>())
        };
        let choices = (0..DISTANCE_PRICES.len()).map(of_price).collect();
        let at_pairs = |table: &Vec<f32>| pairs.iter().map(|pair| table[*pair]).collect();
        let tables = clusters.iter().map(|lobes| lobes.tables.iter().map(at_pairs).collect()).collect();
        Ok(FittedWeights { inputs_rms, texels: chosen, tables, choices })
    }

    /// Makes the lobes of `layer`, whose residual is quantised and holds the whole value, the base of the value. Weight
    /// scales of the dictionaries change. `squared_error` is the residual's mean squared error in its curve: of the
    /// weights those are taken that add little to it; if none do, the texels of a cluster have the same.
    ///
    /// Cost: for each choice one evaluation of the lobes at the texels and pairs that weights were fitted to.
    pub fn put_into(&self, layer: &mut Layer, squared_error: f64) {
        let adds_little = |choice: &WeightCodes| {
            self.put(layer, choice);
            self.added_error(layer) <= MAX_ADDED * squared_error
        };
        if !self.choices.iter().any(adds_little) {
            let Some(mut last) = self.choices.last().cloned() else { return };
            for row in last.codes.chunks_exact_mut(1 + self.inputs_rms.len()) {
                row[1..].fill(0);
            }
            self.put(layer, &last);
        }
        layer.predict_lobes();
        remove_unused_lobes(layer);
    }

    fn put(&self, layer: &mut Layer, choice: &WeightCodes) {
        let Some(residual) = &layer.residual else { return };
        let at_hand = residual.coefficients.iter().zip(&self.inputs_rms).take_while(|(plane, _)| plane.step > 0.0);
        let units: Vec<f32> = at_hand.map(|(plane, rms)| rms / plane.step).collect();
        let (columns, kept) = (1 + self.inputs_rms.len(), 1 + units.len());
        let codes = choice.codes.chunks_exact(columns).flat_map(|row| &row[..kept]).copied().collect();
        for (entry, scale) in layer.dictionary.iter_mut().flatten().zip(choice.scales.iter().flatten()) {
            entry.weight_scale = *scale;
        }
        let mut weights = LobeWeights { step: STEP, units, codes, nodes: Vec::new() };
        weights.nodes = weights.nodes_of_texels(&layer.texel_clusters, &layer.coefficient_planes(), NODES);
        layer.lobe_weights = Some(weights);
    }

    /// Returns the mean squared departure of the lobes of `layer` from what a decoder subtracts for them.
    fn added_error(&self, layer: &Layer) -> f64 {
        let Some(weights) = &layer.lobe_weights else { return 0.0 };
        let planes = layer.coefficient_planes();
        let nothing = layer.residual_kind.encode(0.0, layer.epsilon);
        let first = first_lobes(&layer.dictionary);
        let sums = (0..layer.dictionary.len()).into_par_iter().map(|cluster| {
            let (lobes, tables) = (&layer.dictionary[cluster], &self.tables[cluster]);
            let Some((inputs, taken)) = layer.taken_at(cluster, tables) else { return (0.0, 0) };
            let scales: Vec<f32> = lobes.iter().map(|entry| entry.weight_scale).collect();
            let mut sums = vec![0.0f32; taken.len() / (1 + inputs)];
            let mut error = 0.0;
            for texel in &self.texels[cluster] {
                let codes: Vec<i8> = planes.iter().take(inputs).map(|plane| plane[*texel]).collect();
                let references = weights.references(first[cluster], lobes.len(), &codes);
                lobe_sum_at_pairs(&references, &scales, tables, &mut sums);
                layer.residual_kind.encode_slice(&mut sums, layer.epsilon);
                for (sum, taken) in sums.iter().zip(taken.chunks_exact(1 + inputs)) {
                    let slopes: f32 = taken[1..].iter().zip(&codes).map(|(slope, code)| slope * f32::from(*code)).sum();
                    error += f64::from(sum - nothing - taken[0] - slopes).powi(2);
                }
            }
            // A cluster counts by its texels.
            let members = layer.texel_clusters.iter().filter(|other| usize::from(**other) == cluster).count();
            (error / (sums.len() * self.texels[cluster].len()).max(1) as f64 * members as f64, members)
        });
        let (error, texels) = sums.reduce(|| (0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        error / texels.max(1) as f64
    }
}

impl WeightCodes {
    /// Quantises weights, `[cluster][channel][lobe, 1 + inputs]`.
    fn new(found: &[Vec<&Array2<f64>>]) -> WeightCodes {
        let mut quantized = WeightCodes { scales: Vec::new(), codes: Vec::new() };
        for cluster in found {
            // A weight is hardly ever larger than its constant and twice its slopes.
            let largest = |row: ArrayView1<f64>| {
                let slopes = row.slice(s![1..]);
                row[0].max(0.0) + 2.0 * slopes.dot(&slopes).sqrt()
            };
            let scales = (0..cluster[0].nrows()).map(|lobe| {
                let peak = cluster.iter().map(|channel| largest(channel.row(lobe))).fold(1e-6, f64::max);
                f16::from_f64(peak.min(60_000.0)).to_f32()
            });
            let scales: Vec<f32> = scales.collect();
            for (lobe, scale) in scales.iter().enumerate() {
                let code = |x: &f64| (x / f64::from(scale * STEP)).round().clamp(-32_000.0, 32_000.0) as i16;
                quantized.codes.extend(cluster.iter().flat_map(|channel| channel.row(lobe).map(code)));
            }
            quantized.scales.push(scales);
        }
        quantized
    }
}

/// Removes the lobes that no texel refers to, with their weights.
fn remove_unused_lobes(layer: &mut Layer) {
    let mut used: Vec<Vec<bool>> = layer.dictionary.iter().map(|lobes| vec![false; lobes.len()]).collect();
    mark_used_lobes(&mut used, &layer.texel_clusters, &layer.texel_lobe_counts, &layer.lobe_refs);
    let used = used.concat();
    let Some(weights) = layer.lobe_weights.as_mut().filter(|_| used.contains(&false)) else { return };
    let rows = 3 * (1 + weights.units.len());
    let kept = weights.codes.chunks_exact(rows).zip(&used).filter(|(_, used)| **used);
    weights.codes = kept.flat_map(|(codes, _)| codes).copied().collect();
    let mut used = used.into_iter();
    layer.dictionary.iter_mut().for_each(|lobes| lobes.retain(|_| used.next().unwrap_or(true)));
    layer.predict_lobes();
}

/// Returns the root mean square of the first `count` coefficients over all texels.
fn inputs_rms(model: &Model, count: usize) -> Vec<f32> {
    let texels: usize = model.clusters.iter().map(|cluster| cluster.members.len()).sum();
    let energy = |j: usize| model.clusters.iter().filter_map(|cluster| cluster.variances.get(j)).sum::<f64>();
    (0..count).map(|j| (energy(j) / texels.max(1) as f64).sqrt().max(1e-20) as f32).collect()
}

/// Returns 1 and the coefficients of some texels of a cluster in units of `rms`, `[texel, 1 + input]`.
fn inputs(model: &Model, cluster: &LocalPca, texels: &[usize], rms: &[f32]) -> Array2<f32> {
    let rows = model.coordinates.scores.select(Axis(0), texels) - &cluster.mean;
    let count = rms.len().min(cluster.components.ncols());
    let coefficients = rows.dot(&cluster.components.slice(s![.., ..count]));
    Array2::from_shape_fn((texels.len(), 1 + rms.len()), |(t, i)| match i.checked_sub(1) {
        None => 1.0,
        Some(i) if i < count => coefficients[[t, i]] / rms[i],
        Some(_) => 0.0,
    })
}

/// The weights of a cluster's lobes in one channel, to be fitted.
///
/// With the lobes' sum S, g of it less g(0) as y, and P the projection on the affine functions of the inputs over the
/// texels, what is minimised is `|(1 - P) y|^2 + price |x - y|^2`: a decoder subtracts P y, so the first is an error at
/// measured directions, while the second keeps the lobes near to the value.
struct Channel<'a> {
    kind: ResidualKind,
    epsilon: f32,
    /// Lobes, `[lobe, pair]`.
    tables: &'a Array2<f32>,
    /// `[texel, 1 + input]`.
    inputs: &'a Array2<f32>,
    /// x: g of the values less g(0), `[texel, pair]`.
    values: Array2<f32>,
    /// Orthonormal columns that span those of the inputs: P = Q Q'.
    directions: Array2<f32>,
}

/// The lobes' sums for some weights.
struct Point {
    /// Weights, `[lobe, 1 + input]`.
    slopes: Array2<f64>,
    /// Whether a texel's weight of a lobe is above 0, as 1 or 0, `[texel, lobe]`.
    above: Array2<f32>,
    /// g of the sums less g(0), `[texel, pair]`.
    sums: Array2<f32>,
    /// Derivative of g at the sums.
    derivatives: Array2<f32>,
    cost: f64,
}

impl Channel<'_> {
    /// Returns the weights for each price, `[lobe, 1 + input]`.
    fn fit(&self) -> Vec<Array2<f64>> {
        let mut slopes = self.start();
        let descend = |price: f64| {
            slopes = self.descend(std::mem::take(&mut slopes), price);
            slopes.clone()
        };
        DISTANCE_PRICES.map(descend).into()
    }

    fn descend(&self, slopes: Array2<f64>, price: f64) -> Array2<f64> {
        let mut best = self.at(slopes, price);
        let mut damping = 1e-3;
        for _ in 0..ITERATIONS {
            let (normal, right) = self.normal_equations(&best, price);
            let next = loop {
                if damping > 1e6 {
                    return best.slopes;
                }
                let mut damped = normal.clone();
                (0..damped.nrows()).for_each(|i| damped[(i, i)] *= 1.0 + damping);
                let moved = damped.cholesky().map(|factor| {
                    let step = factor.solve(&right);
                    let step = Array2::from_shape_fn(best.slopes.dim(), |(j, i)| step[j * self.inputs.ncols() + i]);
                    self.at(&best.slopes + &step, price)
                });
                match moved {
                    Some(moved) if moved.cost < best.cost => break moved,
                    _ => damping *= 10.0,
                }
            };
            let gain = best.cost - next.cost;
            best = next;
            damping = (damping * 0.1).max(1e-6);
            if gain < 1e-3 * best.cost {
                break;
            }
        }
        best.slopes
    }

    /// Returns weights that are nearest to the texels' mean, without slopes.
    fn start(&self) -> Array2<f64> {
        let nothing = self.kind.encode(0.0, self.epsilon);
        let linear = self.values.mapv(|y| f64::from(self.kind.decode(y + nothing, self.epsilon).max(0.0)));
        let mean = linear.mean_axis(Axis(0)).unwrap_or_default();
        let tables = self.tables.mapv(f64::from);
        let gram = tables.dot(&tables.t());
        let correlation = tables.dot(&mean);
        let lobes: Vec<usize> = (0..tables.nrows()).collect();
        let gram = gram.as_standard_layout().into_owned();
        let found = non_negative_weights(
            gram.as_slice().unwrap_or_default(),
            lobes.len(),
            correlation.as_slice().unwrap_or_default(),
            &lobes,
        );
        // A weight of 0 would have no derivative.
        let least = |j: usize| 1e-3 * correlation[j].max(0.0) / gram[[j, j]].max(1e-30);
        Array2::from_shape_fn((lobes.len(), self.inputs.ncols()), |(j, i)| match i {
            0 => found[j].max(least(j)),
            _ => 0.0,
        })
    }

    fn at(&self, slopes: Array2<f64>, price: f64) -> Point {
        let weights = self.inputs.dot(&slopes.t().mapv(|x| x as f32));
        let above = weights.mapv(|w| f32::from(u8::from(w > 0.0)));
        let sums = weights.mapv(|w| w.max(0.0)).dot(self.tables);
        let nothing = self.kind.encode(0.0, self.epsilon);
        let derivatives = sums.mapv(|s| match self.kind {
            ResidualKind::Additive => 1.0,
            ResidualKind::Log => 1.0 / (s + self.epsilon),
            ResidualKind::Root => (s + self.epsilon).powf(1.0 / 2.4 - 1.0) / 2.4,
        });
        let sums = sums.mapv(|s| self.kind.encode(s, self.epsilon) - nothing);
        let square = |x: &Array2<f32>| x.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
        let bent = square(&sums) - square(&self.directions.t().dot(&sums));
        let cost = bent + price * square(&(&self.values - &sums));
        Point { slopes, above, sums, derivatives, cost }
    }

    /// Returns the Gauss-Newton matrix and right side for a step from `point`.
    fn normal_equations(&self, point: &Point, price: f64) -> (DMatrix<f64>, DVector<f64>) {
        let (lobes, columns) = (self.tables.nrows(), self.inputs.ncols());
        let (pairs, directions) = (self.tables.ncols(), &self.directions);
        let size = lobes * columns;
        let mut normal = DMatrix::<f64>::zeros(size, size);
        let mut right = DVector::<f64>::zeros(size);
        // What pulls the sums: (1 + price) J'J - (Q'J)'(Q'J), with Q the directions that P projects on.
        let pull = &self.values * price as f32 - &point.sums * (1.0 + price) as f32;
        let texels = self.inputs.nrows();
        // Of each texel the lobes' products, then those of its inputs.
        let mut grams = Array2::<f32>::zeros((texels, lobes * lobes));
        for (t, mut gram) in grams.rows_mut().into_iter().enumerate() {
            let derivative = point.derivatives.row(t);
            let own = Array2::from_shape_fn((lobes, pairs), |(j, k)| {
                point.above[[t, j]] * derivative[k] * self.tables[[j, k]]
            });
            gram.iter_mut().zip(own.dot(&own.t()).iter()).for_each(|(to, x)| *to = *x);
            for (j, x) in own.dot(&pull.row(t)).iter().enumerate() {
                self.inputs
                    .row(t)
                    .iter()
                    .enumerate()
                    .for_each(|(a, input)| right[j * columns + a] += f64::from(x * input));
            }
        }
        let squares = Array2::from_shape_fn((texels, columns * columns), |(t, i)| {
            self.inputs[[t, i / columns]] * self.inputs[[t, i % columns]]
        });
        for ((lobe, input), x) in grams.t().dot(&squares).indexed_iter() {
            let at = |lobe: usize, input: usize| lobe * columns + input;
            normal[(at(lobe / lobes, input / columns), at(lobe % lobes, input % columns))] =
                (1.0 + price) * f64::from(*x);
        }
        // Q'J, [direction and pair, lobe and input].
        let products = Array2::from_shape_fn((directions.ncols() * columns, texels), |(i, t)| {
            directions[[t, i / columns]] * self.inputs[[t, i % columns]]
        });
        let mut projected = Array2::<f32>::zeros((size, directions.ncols() * pairs));
        for j in 0..lobes {
            let steep = &point.derivatives * &point.above.column(j).insert_axis(Axis(1));
            let found = products.dot(&steep);
            for (i, row) in found.rows().into_iter().enumerate() {
                let first = (i / columns) * pairs;
                let mut to = projected.slice_mut(s![j * columns + i % columns, first..first + pairs]);
                to.zip_mut_with(&(&row * &self.tables.row(j)), |to, x| *to = *x);
            }
        }
        let gram = projected.dot(&projected.t());
        let sums: Array1<f32> = directions.t().dot(&point.sums).iter().copied().collect();
        let towards = projected.dot(&sums);
        for i in 0..size {
            right[i] += f64::from(towards[i]);
            (0..size).for_each(|j| normal[(i, j)] -= f64::from(gram[[i, j]]));
        }
        for j in 0..lobes {
            // Slopes that no sample tells stay 0.
            let ridge = RIDGE * (normal[(j * columns, j * columns)].abs() + 1e-9);
            (0..columns).for_each(|a| {
                normal[(j * columns + a, j * columns + a)] += ridge;
                right[j * columns + a] -= if a > 0 { ridge * point.slopes[[j, a]] } else { 0.0 };
            });
        }
        (normal, right)
    }
}

/// Returns orthonormal columns that span those of `inputs`, `[texel, direction]`.
fn orthonormal(inputs: &Array2<f32>) -> Array2<f32> {
    let mut columns: Vec<Array1<f64>> = Vec::new();
    for column in inputs.columns() {
        let mut left = column.mapv(f64::from);
        let before = left.dot(&left);
        for _ in 0..2 {
            columns.iter().for_each(|other| left = &left - &(other * other.dot(&left)));
        }
        let length = left.dot(&left);
        if length > 1e-8 * before.max(1e-30) {
            columns.push(left / length.sqrt());
        }
    }
    Array2::from_shape_fn((inputs.nrows(), columns.len()), |(t, i)| columns[i][t] as f32)
}

/// Puts the Lambertian lobe about the macroscopic normal in front of every dictionary.
///
/// Its cosine is the greater part of what bends between the measured directions. A dictionary's own Lambertian lobe has
/// a tilted normal, whose horizon stands elsewhere: with it, leather of 2 MB gains 0.2 dB at random directions, with the
/// upright one 0.6 dB.
pub fn add_upright_lambertian(
    clusters: &mut [ClusterLobes],
    selection: &mut Selection,
    views: &Sphere,
    lights: &Sphere,
) {
    let lobe = Lobe { family: LobeFamily::Lambertian, normal_xy: [0.0; 2], tangent_rad: 0.0, params: [0.0; 4] };
    let tables = lobe_tables(&[lobe], views, lights);
    for (cluster, dictionary) in clusters.iter_mut().zip(&mut selection.dictionary) {
        let lobes = [&[lobe], &cluster.lobes[..]].concat();
        let tables = tables.iter().cloned().chain(std::mem::take(&mut cluster.tables)).collect();
        *cluster = ClusterLobes::new(lobes, tables, std::mem::take(&mut cluster.weights));
        dictionary.insert(0, DictionaryLobe { lobe, weight_scale: 1.0 });
    }
    selection.refs.iter_mut().for_each(|reference| reference.lobe += 1);
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// Returns inputs of 60 texels, two lobes at 40 pairs, and the weights `[lobe, 1 + input]` of 2 inputs.
    fn problem() -> (Array2<f32>, Array2<f32>, Array2<f64>) {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(3);
        let inputs = Array2::from_shape_fn((60, 3), |(_, i)| if i == 0 { 1.0 } else { random.gen_range(-1.0..1.0) });
        let tables = Array2::from_shape_fn((2, 40), |(j, k)| {
            let cosine = 0.2 + k as f32 / 50.0;
            if j == 0 { cosine } else { cosine.powi(20) }
        });
        let weights = ndarray::array![[0.5, 0.2, -0.1], [0.8, -0.3, 0.3]];
        (inputs, tables, weights)
    }

    fn channel<'a>(
        kind: ResidualKind,
        inputs: &'a Array2<f32>,
        tables: &'a Array2<f32>,
        truth: &Array2<f64>,
    ) -> Channel<'a> {
        let nothing = kind.encode(0.0, 0.01);
        let sums = inputs.dot(&truth.t().mapv(|x| x as f32)).mapv(|w| w.max(0.0)).dot(tables);
        let values = sums.mapv(|s| kind.encode(s, 0.01) - nothing);
        Channel { kind, epsilon: 0.01, tables, inputs, values, directions: orthonormal(inputs) }
    }

    #[test]
    fn weights_that_give_the_values_are_found_where_the_curve_is_a_line() {
        let (inputs, tables, truth) = problem();
        let found = channel(ResidualKind::Additive, &inputs, &tables, &truth).fit().remove(0);
        let off = (&found - &truth).iter().fold(0.0f64, |off, x| off.max(x.abs()));
        assert!(off < 2e-3, "{off}: {found}");
    }

    #[test]
    fn a_smaller_price_of_the_distance_leaves_less_of_the_lobes_in_the_error() {
        let (inputs, tables, truth) = problem();
        let channel = channel(ResidualKind::Root, &inputs, &tables, &truth);
        // With the price 0 a point's cost is the departure from the affine function alone.
        let bent: Vec<f64> = channel.fit().into_iter().map(|weights| channel.at(weights, 0.0).cost).collect();
        assert!(bent[0] > 1.5 * bent[1] && bent[1] > 1.5 * bent[2] && bent[2] > 0.0, "{bent:?}");
        let distance = |price: usize| channel.at(channel.fit().remove(price), 1.0).cost - bent[price];
        assert!(distance(0) < distance(1) && distance(1) < distance(2));
    }

    #[test]
    fn lobes_of_no_texel_are_removed_and_the_others_stay_as_they_were() {
        let mut layer = crate::sample_asset::sample_asset().layers.remove(0);
        let lobes: usize = layer.dictionary.iter().map(Vec::len).sum();
        // Every third lobe has no weight anywhere.
        let code = |lobe: usize, i: usize| if lobe.is_multiple_of(3) { 0 } else { 20 + 5 * (i % 2) as i16 };
        let codes = (0..lobes).flat_map(|lobe| (0..6).map(move |i| code(lobe, i))).collect();
        layer.lobe_weights = Some(LobeWeights { step: STEP, units: vec![50.0], codes, nodes: Vec::new() });
        layer.predict_lobes();
        let seen = |layer: &Layer| -> Vec<(f32, [u8; 3])> {
            let mut references = layer.lobe_refs.iter();
            let texels = layer.texel_clusters.iter().zip(&layer.texel_lobe_counts);
            let of_texel = texels.flat_map(|(cluster, count)| {
                let dictionary = &layer.dictionary[usize::from(*cluster)];
                let own: Vec<_> = references.by_ref().take(usize::from(*count)).collect();
                own.into_iter()
                    .map(|own| (dictionary[usize::from(own.lobe)].weight_scale, own.weight))
                    .collect::<Vec<_>>()
            });
            of_texel.collect()
        };
        let before = seen(&layer);
        remove_unused_lobes(&mut layer);
        assert_eq!(layer.dictionary.iter().map(Vec::len).sum::<usize>(), lobes - lobes.div_ceil(3));
        assert_eq!(seen(&layer), before);
        assert_eq!(layer.lobe_weights.unwrap().codes.len(), 6 * (lobes - lobes.div_ceil(3)));
    }

    #[test]
    fn lobes_that_add_too_much_get_the_same_weights_in_all_texels_of_a_cluster() {
        let mut layer = crate::sample_asset::sample_asset().layers.remove(0);
        let lobes: Vec<Vec<Lobe>> =
            layer.dictionary.iter().map(|lobes| lobes.iter().map(|entry| entry.lobe).collect()).collect();
        let tables: Vec<_> = lobes.iter().map(|lobes| lobe_tables(lobes, &layer.views, &layer.lights)).collect();
        let clusters = 0..layer.dictionary.len();
        let of_cluster =
            |k: usize| (0..layer.texel_clusters.len()).filter(|t| usize::from(layer.texel_clusters[*t]) == k).collect();
        let row = [40, 25];
        let codes = lobes.iter().flatten().flat_map(|_| [row; 3].concat()).collect();
        let scales = lobes.iter().map(|lobes| vec![1.0; lobes.len()]).collect();
        let fitted = FittedWeights {
            inputs_rms: vec![1.0],
            texels: clusters.map(of_cluster).collect(),
            tables,
            choices: vec![WeightCodes { scales, codes }],
        };
        let mut differ = |squared_error: f64| {
            fitted.put_into(&mut layer, squared_error);
            let added = fitted.added_error(&layer);
            let firsts: Vec<_> = layer.lobe_refs.iter().map(|reference| reference.weight).collect();
            (firsts.iter().any(|weight| *weight != firsts[0]), added)
        };
        let (varies, added) = differ(1e9);
        assert!(varies && added > 1e-8, "{added}");
        let (varies, added) = differ(added / 2.0);
        assert!(!varies && added < 1e-12, "{added}");
    }
}

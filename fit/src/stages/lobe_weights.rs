//! Lobe weights as functions of a texel's coefficients: a least-squares fit to the weights that some texels of each
//! cluster would have by themselves.

use crate::error::FitError;
use crate::input::tile_cache::TileCache;
use crate::resume::stored::stored_structs;
use crate::stages::lasso::non_negative_weights;
use crate::stages::sparse::{ClusterLobes, Correlations, Selection};
use btf_runtime::{DictionaryLobe, Layer, Lobe, LobeFamily, LobeWeights, Sphere, lobe_tables};
use half::f16;
use nalgebra::DMatrix;
use ndarray::Array2;
use rayon::prelude::*;

/// Coefficients that weights depend on.
const INPUTS: usize = 8;
/// Texels of a cluster over which decoders take the affine part of the lobes.
const NODES: usize = 64;
/// Step of the weights' codes, relative to the lobe's weight scale.
const STEP: f32 = 1.0 / 64.0;
/// Ridge of the fit, relative to the number of texels: inputs are of unit size.
const RIDGE: f64 = 1e-2;

/// Weights that some texels have without regard to the others.
pub struct FreeWeights {
    /// Texels, ascending.
    pub texels: Vec<usize>,
    /// Cluster of each texel.
    pub labels: Vec<u32>,
    /// Non-negative weights of least squares, `[texel, 3 * lobe + channel]`, lobes padded to the largest dictionary.
    pub weights: Array2<f32>,
}

stored_structs! {
    FreeWeights { texels, labels, weights }
}

impl FreeWeights {
    /// Finds the weights of about `count` texels, as many of each cluster as of any other.
    ///
    /// Cost: a read of these texels, and a product with the lobes' tables.
    pub fn new(
        cache: &TileCache,
        clusters: &[ClusterLobes],
        labels: &[u32],
        count: usize,
        seed: u64,
    ) -> Result<FreeWeights, FitError> {
        let some = Correlations::of_some(cache, clusters, labels, count, seed)?;
        let mut weights = Array2::<f32>::zeros(some.products.dim());
        weights
            .rows_mut()
            .into_iter()
            .zip(some.products.rows())
            .zip(&some.labels)
            .collect::<Vec<_>>()
            .into_par_iter()
            .for_each(|((mut weights, products), label)| {
                let cluster = &clusters[*label as usize];
                let n = cluster.lobes.len();
                let others: Vec<usize> = (1..n).collect();
                for channel in 0..3 {
                    // The Lambertian lobe takes all that it can; the others share what it leaves.
                    let mut correlation: Vec<f64> = (0..n).map(|i| f64::from(products[3 * i + channel])).collect();
                    let first = (correlation[0] / cluster.gram[0].max(1e-30)).max(0.0);
                    correlation.iter_mut().zip(&cluster.gram).for_each(|(x, g)| *x -= first * g);
                    let solved = non_negative_weights(&cluster.gram, n, &correlation, &others);
                    weights[channel] = first as f32;
                    solved.iter().zip(&others).for_each(|(w, i)| weights[3 * i + channel] = *w as f32);
                }
            });
        Ok(FreeWeights { texels: some.texels, labels: some.labels, weights })
    }

    /// Makes the lobes of `layer`, whose residual is quantised and holds the whole value, the base of the value, with
    /// weights that follow from the texels' coefficients. Weight scales of the dictionaries change with them.
    pub fn predict(&self, layer: &mut Layer) {
        let Some(residual) = &layer.residual else { return };
        let planes: Vec<&[i8]> =
            residual.coefficients.iter().take(INPUTS).map(|plane| plane.codes.as_slice()).collect();
        let units: Vec<f32> = planes.iter().map(|codes| root_mean_square(codes)).collect();
        let mut codes = Vec::new();
        let found: Vec<Vec<(f32, [Vec<i16>; 3])>> = (0..layer.dictionary.len())
            .into_par_iter()
            .map(|cluster| {
                let rows: Vec<usize> =
                    (0..self.texels.len()).filter(|row| self.labels[*row] as usize == cluster).collect();
                self.fit_cluster(&rows, layer.dictionary[cluster].len(), &planes, &units)
            })
            .collect();
        for (lobes, found) in layer.dictionary.iter_mut().zip(found) {
            for (entry, (scale, rows)) in lobes.iter_mut().zip(found) {
                entry.weight_scale = scale;
                rows.into_iter().for_each(|row| codes.extend(row));
            }
        }
        let mut weights = LobeWeights { step: STEP, units, codes, nodes: Vec::new() };
        weights.nodes = weights.nodes_of_texels(&layer.texel_clusters, &planes, NODES);
        let planes: Vec<Vec<i8>> = planes.iter().map(|plane| plane.to_vec()).collect();
        layer.lobe_weights = Some(weights);
        layer.predict_lobes(&planes.iter().map(Vec::as_slice).collect::<Vec<_>>());
    }

    /// Returns for each lobe of a cluster, whose texels are `rows` here, the weight scale and the codes of each
    /// channel.
    fn fit_cluster(&self, rows: &[usize], lobes: usize, planes: &[&[i8]], units: &[f32]) -> Vec<(f32, [Vec<i16>; 3])> {
        let columns = 1 + units.len();
        let inputs = DMatrix::from_fn(rows.len(), columns, |row, column| match column.checked_sub(1) {
            None => 1.0,
            Some(i) => f64::from(planes[i][self.texels[rows[row]]]) / f64::from(units[i]),
        });
        let weights = DMatrix::from_fn(rows.len(), 3 * lobes, |row, i| f64::from(self.weights[[rows[row], i]]));
        let mut normal = inputs.transpose() * &inputs;
        (1..columns).for_each(|i| normal[(i, i)] += RIDGE * rows.len() as f64);
        normal[(0, 0)] += 1e-9;
        let slopes = normal
            .cholesky()
            .map(|factor| factor.solve(&(inputs.transpose() * &weights)))
            .unwrap_or_else(|| DMatrix::zeros(columns, 3 * lobes));
        (0..lobes)
            .map(|lobe| {
                let peak = (0..3).flat_map(|c| weights.column(3 * lobe + c).iter().copied().collect::<Vec<_>>());
                let scale = f16::from_f64(peak.fold(1e-6, f64::max).min(60_000.0)).to_f32();
                let code = |x: f64| (x / f64::from(scale * STEP)).round().clamp(-32_000.0, 32_000.0) as i16;
                (scale, [0, 1, 2].map(|c| slopes.column(3 * lobe + c).iter().map(|x| code(*x)).collect()))
            })
            .collect()
    }
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

/// Returns the root mean square of codes, at least a small number.
fn root_mean_square(codes: &[i8]) -> f32 {
    let squares: f64 = codes.iter().map(|code| f64::from(*code).powi(2)).sum();
    (squares / codes.len().max(1) as f64).sqrt().max(1e-3) as f32
}

//! Sparse selection of every texel's lobes from its cluster's dictionary: a stagewise Lasso path in the dictionary's
//! Gram matrix, then non-negative RGB weights on the chosen lobes.

use crate::error::FitError;
use crate::input::texel_sample::texel_sample;
use crate::input::tile_cache::{Tile, TileCache};
use crate::monitor::Monitor;
use crate::resume::stored::stored_structs;
use crate::stages::dictionary::NEGLIGIBLE;
use crate::stages::lasso::{LassoParams, LassoProblem, non_negative_weights, stagewise_lasso};
use btf_runtime::{DictionaryLobe, Lobe, LobeRef, byte_from_weight, weight_from_byte};
use half::f16;
use ndarray::{Array2, s};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// Stagewise step, and end of a texel's path, relative to the texel's strongest correlation.
const STEP: f64 = 0.03;
const MIN_PENALTY: f64 = 0.02;
/// Texels of one matrix product.
const BATCH: usize = 64;

/// A cluster's dictionary tabulated on the measured pairs, under the cluster's tone weights.
pub struct ClusterLobes {
    /// Lobes, as the file form rounds them.
    pub lobes: Vec<Lobe>,
    /// Values `[lobe][pair]`, unweighted.
    pub tables: Vec<Vec<f32>>,
    /// Weight per pair (0 for held-back pairs).
    pub weights: Vec<f32>,
    /// Gram matrix of the dictionary, weighted: the transpose of `A` times `W` times `A`, with a column of `A` for each
    /// lobe and `weights` on the diagonal of `W`; row-major.
    pub gram: Vec<f64>,
}

stored_structs! {
    ClusterLobes { lobes, tables, weights, gram }
}

impl ClusterLobes {
    /// Tabulates a dictionary.
    pub fn new(lobes: Vec<Lobe>, tables: Vec<Vec<f32>>, weights: Vec<f32>) -> ClusterLobes {
        let n = lobes.len();
        let mut gram = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                let sum: f64 = (0..weights.len())
                    .map(|p| f64::from(weights[p]) * f64::from(tables[i][p]) * f64::from(tables[j][p]))
                    .sum();
                gram[i * n + j] = sum;
                gram[j * n + i] = sum;
            }
        }
        ClusterLobes { lobes, tables, weights, gram }
    }
}

/// Texels' correlations with their clusters' lobes.
pub struct Correlations {
    /// Cluster per texel.
    pub labels: Vec<u32>,
    /// `A' W x`, `[texel, 3 * lobe + channel]`, lobes padded to the largest dictionary.
    pub products: Array2<f32>,
    /// `x' W x` of each texel over all channels.
    pub energy: Vec<f64>,
}

impl Correlations {
    /// Computes the correlations of every texel in one pass over the capture.
    pub fn of_all(
        cache: &TileCache,
        clusters: &[ClusterLobes],
        labels: &[u32],
        monitor: &Monitor,
    ) -> Result<Correlations, FitError> {
        let weighted = weighted_tables(clusters);
        let mut all = Correlations::empty(clusters, labels.to_vec());
        for tile in 0..cache.tile_count() {
            let loaded = cache.read(tile)?;
            all.add_block(&loaded, loaded.texels.start, clusters, &weighted);
            monitor.report("weights", tile + 1, cache.tile_count())?;
        }
        Ok(all)
    }

    /// Computes the correlations of about `count` texels, as many of each cluster as of any other: enough for the
    /// clusters' means.
    pub fn of_some(
        cache: &TileCache,
        clusters: &[ClusterLobes],
        labels: &[u32],
        count: usize,
        seed: u64,
    ) -> Result<Correlations, FitError> {
        let mut members: Vec<Vec<usize>> = vec![Vec::new(); clusters.len()];
        labels.iter().enumerate().for_each(|(texel, label)| members[*label as usize].push(texel));
        let share = count.div_ceil(clusters.len().max(1));
        let mut chosen: Vec<usize> = members
            .iter()
            .filter(|members| !members.is_empty())
            .flat_map(|members| texel_sample(members.len(), share, seed).into_iter().map(|i| members[i]))
            .collect();
        chosen.sort_unstable();
        let mut some = Correlations::empty(clusters, chosen.iter().map(|texel| labels[*texel]).collect());
        some.add_block(&cache.gather(&chosen)?, 0, clusters, &weighted_tables(clusters));
        Ok(some)
    }

    fn empty(clusters: &[ClusterLobes], labels: Vec<u32>) -> Correlations {
        let most = clusters.iter().map(|cluster| cluster.lobes.len()).max().unwrap_or(0);
        let count = labels.len();
        Correlations { labels, products: Array2::zeros((count, 3 * most)), energy: vec![0.0; count] }
    }

    /// Computes the correlations of the texels of `block`, whose first is number `first` here.
    fn add_block(&mut self, block: &Tile, first: usize, clusters: &[ClusterLobes], weighted: &[Array2<f32>]) {
        let Correlations { labels, products, energy } = self;
        let mut order: Vec<usize> = (0..block.texels.len()).collect();
        order.sort_by_key(|&i| (labels[first + i], i));
        let batches: Vec<&[usize]> =
            order.chunk_by(|&a, &b| labels[first + a] == labels[first + b]).flat_map(|run| run.chunks(BATCH)).collect();
        let results: Vec<(&[usize], Array2<f32>, Vec<f64>)> = batches
            .into_par_iter()
            .map(|batch| {
                let cluster = labels[first + batch[0]] as usize;
                let weights = &clusters[cluster].weights;
                // One row per texel and channel.
                let mut rows = Array2::<f32>::zeros((3 * batch.len(), weights.len()));
                let mut energies = Vec::with_capacity(batch.len());
                let mut row = vec![0.0; 3 * weights.len()];
                for (i, &index) in batch.iter().enumerate() {
                    block.texel_linear(index, &mut row);
                    let mut energy = 0.0f64;
                    for (p, (rgb, weight)) in row.chunks_exact(3).zip(weights).enumerate() {
                        for c in 0..3 {
                            rows[[3 * i + c, p]] = rgb[c];
                            energy += f64::from(weight * rgb[c] * rgb[c]);
                        }
                    }
                    energies.push(energy);
                }
                (batch, rows.dot(&weighted[cluster]), energies)
            })
            .collect();
        for (batch, result, energies) in results {
            for (i, &index) in batch.iter().enumerate() {
                energy[first + index] = energies[i];
                for c in 0..3 {
                    for (lobe, value) in result.row(3 * i + c).iter().enumerate() {
                        products[[first + index, 3 * lobe + c]] = *value;
                    }
                }
            }
        }
    }
}

/// Returns `W A` of every cluster, `[pair, lobe]`.
fn weighted_tables(clusters: &[ClusterLobes]) -> Vec<Array2<f32>> {
    clusters
        .par_iter()
        .map(|cluster| {
            Array2::from_shape_fn((cluster.weights.len(), cluster.lobes.len()), |(p, i)| {
                // As in the dictionary's own tables: tiny numbers are slow.
                let value = cluster.weights[p] * cluster.tables[i][p];
                if value < NEGLIGIBLE { 0.0 } else { value }
            })
        })
        .collect()
}

/// Nested choices of a texel: lobe sets of growing size and the relative weighted error that each leaves.
struct Choice {
    /// Lobe sets of 1, 2, ... lobes, each with its weights `[lobe][channel]`.
    sets: Vec<(Vec<usize>, Vec<[f64; 3]>)>,
    /// Relative error with 0, 1, ... lobes; never rising.
    errors: Vec<f64>,
}

fn choose(cluster: &ClusterLobes, products: &[f32], energy: f64, most: usize) -> Choice {
    let n = cluster.lobes.len();
    let mut choice = Choice { sets: Vec::new(), errors: vec![1.0] };
    if energy <= 0.0 || most == 0 || n == 0 {
        return choice;
    }
    let norms: Vec<f64> = (0..n).map(|i| cluster.gram[i * n + i].sqrt()).collect();
    let inverse: Vec<f64> = norms.iter().map(|norm| if *norm > 0.0 { 1.0 / norm } else { 0.0 }).collect();
    let gram: Vec<f64> = (0..n * n).map(|k| cluster.gram[k] * inverse[k / n] * inverse[k % n]).collect();
    let grey: Vec<f64> =
        (0..n).map(|i| (0..3).map(|c| f64::from(products[3 * i + c])).sum::<f64>() / 3.0 * inverse[i]).collect();
    let top = grey.iter().fold(0.0f64, |top, x| top.max(*x));
    if top <= 0.0 {
        return choice;
    }
    let problem = LassoProblem { gram: &gram, correlation: &grey, non_negative: true };
    let params = LassoParams { epsilon: STEP * top, least_penalty: MIN_PENALTY * top, most_steps: 400 };
    let mut sets: Vec<Vec<usize>> = Vec::new();
    stagewise_lasso(&problem, &params, |point| {
        if point.active > most {
            return ControlFlow::Break(());
        }
        let active: Vec<usize> = (0..n).filter(|&i| point.beta[i] > 0.0).collect();
        // The last set of each size on the path: the one that the Lasso settled on.
        if active.len() > sets.len() {
            sets.push(active);
        } else if let Some(set) = sets.get_mut(active.len().wrapping_sub(1)) {
            *set = active;
        }
        ControlFlow::Continue(())
    });
    for set in sets {
        let mut weights = vec![[0.0; 3]; set.len()];
        let mut explained = 0.0;
        for c in 0..3 {
            let correlation: Vec<f64> = (0..n).map(|i| f64::from(products[3 * i + c])).collect();
            let solved = non_negative_weights(&cluster.gram, n, &correlation, &set);
            for (i, &a) in set.iter().enumerate() {
                weights[i][c] = solved[i];
                let fitted: f64 = set.iter().zip(&solved).map(|(&b, w)| cluster.gram[a * n + b] * w).sum();
                explained += solved[i] * (2.0 * correlation[a] - fitted);
            }
        }
        let before = choice.errors[choice.errors.len() - 1];
        choice.errors.push((1.0 - explained / energy).max(0.0).min(before));
        choice.sets.push((set, weights));
    }
    choice
}

/// Returns the choice for each cluster's mean function.
fn choose_for_means(clusters: &[ClusterLobes], correlations: &Correlations, most: usize) -> Vec<Choice> {
    let mut sums = vec![(vec![0.0f64; correlations.products.ncols()], 0usize); clusters.len()];
    for (label, products) in correlations.labels.iter().zip(correlations.products.rows()) {
        let (sum, count) = &mut sums[*label as usize];
        sum.iter_mut().zip(products).for_each(|(sum, x)| *sum += f64::from(*x));
        *count += 1;
    }
    clusters
        .par_iter()
        .zip(&sums)
        .map(|(cluster, (sum, count))| {
            let mean: Vec<f32> = sum.iter().map(|x| (x / (*count).max(1) as f64) as f32).collect();
            let n = cluster.lobes.len();
            // The energy that all lobes together explain stands for the mean's own, which is not at hand.
            let every: Vec<usize> = (0..n).collect();
            let mut energy = 0.0;
            for c in 0..3 {
                let correlation: Vec<f64> = (0..n).map(|i| f64::from(mean[3 * i + c])).collect();
                let solved = non_negative_weights(&cluster.gram, n, &correlation, &every);
                energy += solved.iter().zip(&correlation).map(|(w, x)| w * x).sum::<f64>();
            }
            choose(cluster, &mean, energy, most)
        })
        .collect()
}

/// Lobe references of all texels.
pub struct Selection {
    /// Number of lobes of each texel.
    pub counts: Vec<u8>,
    /// References, texel after texel, most important first.
    pub refs: Vec<LobeRef>,
    /// Number of each texel's first reference.
    pub first: Vec<usize>,
    /// Dictionaries with weight scales.
    pub dictionary: Vec<Vec<DictionaryLobe>>,
    /// Mean relative weighted error that the lobes leave.
    pub mean_relative_error: f64,
}

stored_structs! {
    Selection { counts, refs, first, dictionary, mean_relative_error }
}

/// Unit that lobes are chosen for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LobesOf {
    /// Each texel has lobes and weights of its own.
    Texels,
    /// All texels of a cluster have those of its mean: they cost next to no bytes, and leave a residual of the lowest
    /// rank, because all of a cluster is predicted alike.
    Clusters,
}

/// Chooses at most `most` lobes for every texel: one more is taken while it lowers the relative error by more than
/// `price`. `correlations` must be those of all texels, or of some for [`LobesOf::Clusters`].
pub fn select(
    clusters: &[ClusterLobes],
    labels: &[u32],
    correlations: &Correlations,
    of: LobesOf,
    most: usize,
    price: f64,
) -> Selection {
    let choices: Vec<Choice> = match of {
        LobesOf::Clusters => choose_for_means(clusters, correlations, most),
        LobesOf::Texels => (0..labels.len())
            .into_par_iter()
            .map(|texel| {
                let row = correlations.products.slice(s![texel, ..]);
                let cluster = &clusters[labels[texel] as usize];
                choose(cluster, row.as_slice().unwrap_or_default(), correlations.energy[texel], most)
            })
            .collect(),
    };
    let best_size = |choice: &Choice| {
        let errors = &choice.errors;
        let cost = |m: usize| errors[m] + price * m as f64;
        (most.min(1).min(errors.len() - 1)..errors.len())
            .min_by(|&a, &b| cost(a).total_cmp(&cost(b)).then(a.cmp(&b)))
            .unwrap_or(0)
    };
    let chosen_sizes: Vec<usize> = choices.par_iter().map(best_size).collect();
    let choice_of = |texel: usize| match of {
        LobesOf::Clusters => labels[texel] as usize,
        LobesOf::Texels => texel,
    };
    let choices: Vec<&Choice> = (0..labels.len()).map(|texel| &choices[choice_of(texel)]).collect();
    let sizes: Vec<usize> = (0..labels.len()).map(|texel| chosen_sizes[choice_of(texel)]).collect();

    let dictionary = scaled_dictionaries(clusters, labels, &choices, &sizes);
    let error_sum: f64 = choices.iter().zip(&sizes).map(|(choice, size)| choice.errors[*size]).sum();
    let mut selection = Selection {
        counts: Vec::with_capacity(labels.len()),
        refs: Vec::new(),
        first: Vec::with_capacity(labels.len()),
        dictionary,
        mean_relative_error: error_sum / labels.len().max(1) as f64,
    };
    for (texel, &size) in sizes.iter().enumerate() {
        selection.first.push(selection.refs.len());
        let cluster = labels[texel] as usize;
        let own = references(&clusters[cluster], &selection.dictionary[cluster], choices[texel], size);
        selection.counts.push(own.len() as u8);
        selection.refs.extend(own);
    }
    selection
}

/// Returns the dictionaries with the weight scale of each lobe: the largest weight that a texel gives to it.
fn scaled_dictionaries(
    clusters: &[ClusterLobes],
    labels: &[u32],
    choices: &[&Choice],
    sizes: &[usize],
) -> Vec<Vec<DictionaryLobe>> {
    let mut peaks: Vec<Vec<f64>> = clusters.iter().map(|cluster| vec![0.0; cluster.lobes.len()]).collect();
    for (texel, &size) in sizes.iter().enumerate().filter(|(_, size)| **size > 0) {
        let (set, weights) = &choices[texel].sets[size - 1];
        for (lobe, rgb) in set.iter().zip(weights) {
            let peak = &mut peaks[labels[texel] as usize][*lobe];
            *peak = rgb.iter().fold(*peak, |peak, w| peak.max(*w));
        }
    }
    let entry = |(lobe, peak): (&Lobe, &f64)| {
        let rounded = f16::from_f64(peak.min(60_000.0));
        // Rounded up, so that the largest weight still fits.
        let up = if f64::from(rounded.to_f32()) < *peak { f16::from_bits(rounded.to_bits() + 1) } else { rounded };
        DictionaryLobe { lobe: *lobe, weight_scale: up.to_f32() }
    };
    clusters.iter().zip(&peaks).map(|(cluster, peaks)| cluster.lobes.iter().zip(peaks).map(entry).collect()).collect()
}

/// Returns the references of a texel that chose `size` lobes of its cluster, most important first; lobes whose weights
/// are all coded as 0 are left out.
fn references(cluster: &ClusterLobes, dictionary: &[DictionaryLobe], choice: &Choice, size: usize) -> Vec<LobeRef> {
    if size == 0 {
        return Vec::new();
    }
    let n = cluster.lobes.len();
    let (set, weights) = &choice.sets[size - 1];
    let mut own: Vec<(f64, LobeRef)> = Vec::with_capacity(size);
    for (&lobe, rgb) in set.iter().zip(weights) {
        let scale = dictionary[lobe].weight_scale;
        let codes = [0, 1, 2].map(|c| byte_from_weight(rgb[c] as f32, scale));
        if codes != [0; 3] {
            let size2: f64 = codes.iter().map(|q| f64::from(weight_from_byte((*q).into(), scale)).powi(2)).sum();
            own.push((size2 * cluster.gram[lobe * n + lobe], LobeRef { lobe: lobe as u8, weight: codes }));
        }
    }
    own.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.lobe.cmp(&b.1.lobe)));
    own.into_iter().map(|(_, reference)| reference).collect()
}

/// Drops lobes that no texel takes from the dictionaries, and numbers the others anew.
pub fn drop_unused(clusters: &mut [ClusterLobes], selection: &mut Selection, labels: &[u32]) {
    let mut used: Vec<Vec<bool>> = clusters.iter().map(|cluster| vec![false; cluster.lobes.len()]).collect();
    for (texel, &first) in selection.first.iter().enumerate() {
        for reference in &selection.refs[first..first + usize::from(selection.counts[texel])] {
            used[labels[texel] as usize][usize::from(reference.lobe)] = true;
        }
    }
    let mut numbers: Vec<Vec<u8>> = Vec::with_capacity(clusters.len());
    for (cluster, used) in used.iter().enumerate() {
        let kept: Vec<usize> = (0..used.len()).filter(|&lobe| used[lobe]).collect();
        let mut number = vec![0; used.len()];
        kept.iter().enumerate().for_each(|(new, &old)| number[old] = new as u8);
        let old = &clusters[cluster];
        let lobes = kept.iter().map(|&lobe| old.lobes[lobe]).collect();
        let tables = kept.iter().map(|&lobe| old.tables[lobe].clone()).collect();
        let gram = kept.iter().flat_map(|&a| kept.iter().map(move |&b| (a, b)));
        let gram = gram.map(|(a, b)| old.gram[a * used.len() + b]).collect();
        clusters[cluster] = ClusterLobes { lobes, tables, weights: old.weights.clone(), gram };
        let dictionary = &mut selection.dictionary[cluster];
        *dictionary = kept.iter().map(|&lobe| dictionary[lobe]).collect();
        numbers.push(number);
    }
    for (texel, &first) in selection.first.iter().enumerate() {
        for reference in &mut selection.refs[first..first + usize::from(selection.counts[texel])] {
            reference.lobe = numbers[labels[texel] as usize][usize::from(reference.lobe)];
        }
    }
}

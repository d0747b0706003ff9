//! k-means over the texels' features: Lloyd by matrix products with greedy k-means++ seeding [Arthur 2007] and
//! re-seeding of empty clusters, in one level or in two. The k-means of linfa-clustering stands beside it, as an engine and as the oracle that
//! the fast one is tested against.

use crate::error::FitError;
use crate::params::KMeansEngine;
use linfa::DatasetBase;
use linfa::traits::{Fit, Predict};
use linfa_clustering::{KMeans, KMeansInit};
use ndarray::{Array1, Array2, ArrayView2, Axis, s};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

/// Lloyd iterations at most.
const ITERATIONS: usize = 30;
/// Rows of a block whose partial sums are added in order.
const BLOCK: usize = 4096;

/// A clustering.
#[derive(Debug, Clone)]
pub struct Clustering {
    /// Cluster per point.
    pub labels: Vec<u32>,
    /// Centroids, `[cluster, dimension]`.
    pub centroids: Array2<f32>,
    /// Sum of squared distances of the points to their centroids.
    pub inertia: f64,
}

/// Clusters the rows of `points` `[point, dimension]` into at most `clusters` (fewer where there are
/// fewer points). Deterministic for a seed, on any number of threads.
pub fn kmeans(
    points: ArrayView2<f32>,
    clusters: usize,
    engine: KMeansEngine,
    seed: u64,
) -> Result<Clustering, FitError> {
    let clusters = clusters.min(points.nrows()).max(1);
    match engine {
        KMeansEngine::Product => Ok(lloyd(points, seed_greedily(points, clusters, seed))),
        KMeansEngine::Linfa => linfa_kmeans(points, clusters, seed),
        KMeansEngine::Levels => Ok(nested(points, clusters, seed)),
    }
}

/// Clusters in two levels, the finer within the coarser, as the SPMM's paper does: about the root of `clusters` coarse
/// ones, each of which is divided into a number of fine ones that goes with its inertia.
fn nested(points: ArrayView2<f32>, clusters: usize, seed: u64) -> Clustering {
    let coarse = (clusters as f64).sqrt().ceil() as usize;
    let coarse = lloyd(points, seed_greedily(points, coarse, seed));
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); coarse.centroids.nrows()];
    coarse.labels.iter().enumerate().for_each(|(point, label)| members[*label as usize].push(point));
    members.retain(|members| !members.is_empty());
    let parts: Vec<Array2<f32>> = members.iter().map(|members| points.select(Axis(0), members)).collect();
    let inertias: Vec<f64> = parts.iter().map(|part| inertia_about_mean(part.view())).collect();
    let most: Vec<usize> = members.iter().map(Vec::len).collect();
    let shares = shares_of(clusters, &inertias, &most);
    let (mut labels, mut centroids, mut inertia) = (vec![0; points.nrows()], Vec::new(), 0.0);
    for ((part, members), share) in parts.iter().zip(&members).zip(shares) {
        let fine = lloyd(part.view(), seed_greedily(part.view(), share, seed));
        let first = centroids.len() / points.ncols().max(1);
        members.iter().zip(&fine.labels).for_each(|(point, label)| labels[*point] = first as u32 + label);
        centroids.extend(fine.centroids);
        inertia += fine.inertia;
    }
    let rows = centroids.len() / points.ncols().max(1);
    let centroids = Array2::from_shape_vec((rows, points.ncols()), centroids).unwrap_or_default();
    Clustering { labels, centroids, inertia }
}

fn inertia_about_mean(points: ArrayView2<f32>) -> f64 {
    let mean = points.mean_axis(Axis(0)).unwrap_or_default();
    points.rows().into_iter().flat_map(|row| row.to_owned() - &mean).map(|x| f64::from(x * x)).sum()
}

/// Divides `count` into whole numbers, each at least 1 and at most its limit in `most`: one after the other goes where
/// the weight for each of the parts so far is largest.
fn shares_of(count: usize, weights: &[f64], most: &[usize]) -> Vec<usize> {
    let mut shares = vec![1; weights.len()];
    for _ in weights.len()..count {
        let open = (0..shares.len()).filter(|i| shares[*i] < most[*i]);
        let weight = |i: usize| weights[i] / shares[i] as f64;
        let Some(next) = open.max_by(|a, b| weight(*a).total_cmp(&weight(*b)).then(b.cmp(a))) else { break };
        shares[next] += 1;
    }
    shares
}

/// Result of an assignment: labels, inertia, and sum and count of each cluster.
struct Assignment {
    labels: Vec<u32>,
    distances: Vec<f32>,
    inertia: f64,
    sums: Array2<f64>,
    counts: Vec<usize>,
}

fn assign(points: ArrayView2<f32>, centroids: &Array2<f32>) -> Assignment {
    let (k, d) = centroids.dim();
    let norms: Array1<f32> = centroids.map_axis(Axis(1), |row| row.dot(&row));
    let starts: Vec<usize> = (0..points.nrows()).step_by(BLOCK).collect();
    let parts: Vec<Assignment> = starts
        .par_iter()
        .map(|&start| {
            let rows = points.slice(s![start..(start + BLOCK).min(points.nrows()), ..]);
            let products = rows.dot(&centroids.t());
            let mut part = Assignment {
                labels: Vec::with_capacity(rows.nrows()),
                distances: Vec::with_capacity(rows.nrows()),
                inertia: 0.0,
                sums: Array2::zeros((k, d)),
                counts: vec![0; k],
            };
            for (row, products) in rows.rows().into_iter().zip(products.rows()) {
                let (mut best, mut least) = (0, f32::INFINITY);
                for c in 0..k {
                    let distance = norms[c] - 2.0 * products[c];
                    if distance < least {
                        (best, least) = (c, distance);
                    }
                }
                let distance = (least + row.dot(&row)).max(0.0);
                part.labels.push(best as u32);
                part.distances.push(distance);
                part.inertia += f64::from(distance);
                part.counts[best] += 1;
                part.sums.row_mut(best).zip_mut_with(&row, |sum, x| *sum += f64::from(*x));
            }
            part
        })
        .collect();
    let mut all = Assignment {
        labels: Vec::new(),
        distances: Vec::new(),
        inertia: 0.0,
        sums: Array2::zeros((k, d)),
        counts: vec![0; k],
    };
    for part in parts {
        all.labels.extend(part.labels);
        all.distances.extend(part.distances);
        all.inertia += part.inertia;
        all.sums += &part.sums;
        all.counts.iter_mut().zip(part.counts).for_each(|(sum, count)| *sum += count);
    }
    all
}

fn lloyd(points: ArrayView2<f32>, mut centroids: Array2<f32>) -> Clustering {
    let mut assignment = assign(points, &centroids);
    for _ in 0..ITERATIONS {
        // An empty cluster takes the point that is farthest from its own centroid.
        let mut far: Vec<usize> = (0..points.nrows()).collect();
        if assignment.counts.contains(&0) {
            far.sort_by(|&a, &b| assignment.distances[b].total_cmp(&assignment.distances[a]).then(a.cmp(&b)));
        }
        let mut farthest = far.into_iter();
        for c in 0..centroids.nrows() {
            if assignment.counts[c] == 0 {
                if let Some(point) = farthest.next() {
                    centroids.row_mut(c).assign(&points.row(point));
                }
            } else {
                let scale = 1.0 / assignment.counts[c] as f64;
                let sum = assignment.sums.row(c);
                centroids.row_mut(c).zip_mut_with(&sum, |x, sum| *x = (sum * scale) as f32);
            }
        }
        let before = assignment.inertia;
        assignment = assign(points, &centroids);
        if before - assignment.inertia <= 1e-5 * before {
            break;
        }
    }
    Clustering { labels: assignment.labels, centroids, inertia: assignment.inertia }
}

/// Returns centroids by k-means++ with `2 + ln k` trials a step, the best of which is kept.
fn seed_greedily(points: ArrayView2<f32>, clusters: usize, seed: u64) -> Array2<f32> {
    let n = points.nrows();
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut centroids = Array2::zeros((clusters, points.ncols()));
    let distances_to = |index: usize| -> Vec<f32> {
        let centre = points.row(index);
        (0..n)
            .into_par_iter()
            .map(|i| points.row(i).iter().zip(centre.iter()).map(|(a, b)| (a - b) * (a - b)).sum())
            .collect()
    };
    let first = random.gen_range(0..n);
    centroids.row_mut(0).assign(&points.row(first));
    let mut nearest = distances_to(first);
    let trials = 2 + (clusters as f64).ln() as usize;
    for c in 1..clusters {
        let total: f64 = nearest.iter().map(|x| f64::from(*x)).sum();
        let mut best: Option<(f64, usize, Vec<f32>)> = None;
        for _ in 0..trials {
            let mut target = random.r#gen::<f64>() * total;
            let index = nearest.iter().position(|x| {
                target -= f64::from(*x);
                target < 0.0
            });
            let index = index.unwrap_or_else(|| random.gen_range(0..n));
            let mut distances = distances_to(index);
            distances.iter_mut().zip(&nearest).for_each(|(d, old)| *d = d.min(*old));
            let potential = distances.iter().map(|x| f64::from(*x)).sum();
            if best.as_ref().is_none_or(|(least, ..)| potential < *least) {
                best = Some((potential, index, distances));
            }
        }
        if let Some((_, index, distances)) = best {
            centroids.row_mut(c).assign(&points.row(index));
            nearest = distances;
        }
    }
    centroids
}

fn linfa_kmeans(points: ArrayView2<f32>, clusters: usize, seed: u64) -> Result<Clustering, FitError> {
    let dataset = DatasetBase::from(points.to_owned());
    let model = KMeans::params_with_rng(clusters, Xoshiro256PlusPlus::seed_from_u64(seed))
        .init_method(KMeansInit::KMeansPlusPlus)
        // With several runs linfa 0.8 reports the counts of the last run beside the centroids of the best.
        .n_runs(1)
        .max_n_iterations(ITERATIONS as u64)
        .tolerance(1e-3)
        .fit(&dataset)
        .map_err(|error| FitError::Params(format!("k-means by linfa failed ({error}); use --kmeans product")))?;
    let labels: Array1<usize> = model.predict(&points);
    let centroids = model.centroids().to_owned();
    let inertia = assign(points, &centroids).inertia;
    Ok(Clustering { labels: labels.iter().map(|label| *label as u32).collect(), centroids, inertia })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns forty blobs, as DEPENDENCIES-style benchmarks use, with a known best inertia.
    fn blobs(n: usize, d: usize, spread: f32) -> Array2<f32> {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(7);
        let centres = Array2::from_shape_simple_fn((20, d), || random.gen_range(-10.0..10.0f32));
        Array2::from_shape_fn((n, d), |(i, j)| {
            let noise = ((i * 31 + j * 17) % 101) as f32 / 101.0 - 0.5;
            centres[[i % 20, j]] + spread * noise
        })
    }

    #[test]
    fn the_fast_engine_is_as_good_as_linfas() {
        let points = blobs(2000, 12, 1.0);
        let fast = kmeans(points.view(), 20, KMeansEngine::Product, 3).unwrap();
        let oracle = kmeans(points.view(), 20, KMeansEngine::Linfa, 3).unwrap();
        assert!(fast.inertia <= 1.02 * oracle.inertia, "{} against {}", fast.inertia, oracle.inertia);
        // Planted difference: a single Lloyd pass from one repeated seed is much worse.
        let bad = assign(points.view(), &Array2::from_shape_fn((20, 12), |(_, j)| points[[0, j]])).inertia;
        assert!(bad > 2.0 * fast.inertia);
    }

    #[test]
    fn two_levels_divide_each_coarse_cluster_and_are_nearly_as_good_as_one() {
        let points = blobs(2000, 12, 6.0);
        let [one, two] =
            [KMeansEngine::Product, KMeansEngine::Levels].map(|engine| kmeans(points.view(), 36, engine, 3).unwrap());
        assert_eq!(two.centroids.nrows(), 36);
        assert!(two.inertia < 1.2 * one.inertia, "{} against {}", two.inertia, one.inertia);
        // Labels, centroids and inertia belong to each other.
        let to_own = |(row, label): (ndarray::ArrayView1<f32>, &u32)| -> f64 {
            let off = &row - &two.centroids.row(*label as usize);
            off.iter().map(|x| f64::from(x * x)).sum()
        };
        let sum: f64 = points.rows().into_iter().zip(&two.labels).map(to_own).sum();
        assert!((sum - two.inertia).abs() < 1e-3 * sum, "{sum} {}", two.inertia);
        // A point stays within its coarse cluster even where a fine one of another is nearer.
        let nearest = assign(points.view(), &two.centroids);
        assert!(nearest.inertia < two.inertia && nearest.labels != two.labels);
        assert_eq!(kmeans(points.slice(s![..3, ..]), 8, KMeansEngine::Levels, 1).unwrap().centroids.nrows(), 3);
        assert_eq!(shares_of(6, &[9.0, 1.0, 2.0], &[3, 5, 9]), [3, 1, 2]);
    }

    #[test]
    fn the_result_does_not_depend_on_the_number_of_threads() {
        let points = blobs(9000, 8, 6.0);
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| kmeans(points.view(), 17, KMeansEngine::Product, 5).unwrap())
        };
        let (one, three) = (run(1), run(3));
        assert_eq!(one.labels, three.labels);
        assert_eq!(one.centroids, three.centroids);
    }

    #[test]
    fn more_clusters_than_distinct_points_is_fine() {
        let points = Array2::from_shape_fn((10, 3), |(i, _)| (i % 2) as f32);
        let found = kmeans(points.view(), 8, KMeansEngine::Product, 1).unwrap();
        assert!(found.inertia < 1e-9);
        assert!(found.labels.iter().all(|label| *label < 8));
    }
}

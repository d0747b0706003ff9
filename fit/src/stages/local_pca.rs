//! Local PCA [Muller 2003] in coordinates: a mean and principal components per cluster, and texels moved to the cluster
//! whose model leaves the least of them.

use crate::numeric::principal_directions::{orthonormalize, sorted_eigen, transposed_product};
use ndarray::{Array1, Array2, ArrayView2, Axis, s};
use rayon::prelude::*;

/// Subspace iterations for the leading eigenvectors, and columns beyond the eigenvectors that are wanted.
const ITERATIONS: usize = 4;
const OVERSAMPLING: usize = 8;

/// A cluster's model.
#[derive(Debug, Clone)]
pub struct LocalPca {
    /// Texels of the cluster.
    pub members: Vec<usize>,
    /// Mean of the texels' coordinates.
    pub mean: Array1<f32>,
    /// Orthonormal components in columns, most important first.
    pub components: Array2<f32>,
    /// Sum over the texels of each component's squared coefficient.
    pub variances: Vec<f64>,
}

/// Fits at most `components` components to each of `clusters` clusters.
///
/// Cost: `2 texels x dimensions^2` floating-point operations.
pub fn local_pca(scores: ArrayView2<f32>, labels: &[u32], clusters: usize, components: usize) -> Vec<LocalPca> {
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); clusters];
    for (texel, label) in labels.iter().enumerate() {
        members[*label as usize].push(texel);
    }
    members.into_par_iter().map(|members| model(scores, members, components)).collect()
}

fn model(scores: ArrayView2<f32>, members: Vec<usize>, components: usize) -> LocalPca {
    let dimensions = scores.ncols();
    if members.is_empty() {
        return LocalPca {
            members,
            mean: Array1::zeros(dimensions),
            components: Array2::zeros((dimensions, 0)),
            variances: Vec::new(),
        };
    }
    let mut rows = scores.select(Axis(0), &members);
    let mut mean = Array1::<f64>::zeros(dimensions);
    for row in rows.rows() {
        mean.zip_mut_with(&row, |sum, x| *sum += f64::from(*x));
    }
    let mean = mean.mapv(|x| (x / members.len() as f64) as f32);
    rows -= &mean;
    let covariance = transposed_product(rows.view(), rows.view());
    let most = components.min(members.len() - 1).min(dimensions);
    let (vectors, variances) = leading_eigenvectors(&covariance, most);
    LocalPca { members, mean, components: vectors, variances }
}

/// Returns at most `count` leading eigenvectors of a positive semi-definite matrix, and their eigenvalues.
fn leading_eigenvectors(matrix: &Array2<f32>, count: usize) -> (Array2<f32>, Vec<f64>) {
    let n = matrix.nrows();
    let wide = (count + OVERSAMPLING).min(n);
    if count == 0 {
        return (Array2::zeros((n, 0)), Vec::new());
    }
    // The largest diagonal entries first: a good start where coordinates are principal already.
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| matrix[[b, b]].total_cmp(&matrix[[a, a]]));
    let mut q = Array2::<f32>::zeros((n, wide));
    for (column, &row) in order[..wide].iter().enumerate() {
        q[[row, column]] = 1.0;
    }
    if wide < n {
        for _ in 0..ITERATIONS {
            q = orthonormalize(&matrix.dot(&q));
        }
    }
    let (values, vectors) = sorted_eigen(&q.t().dot(&matrix.dot(&q)).mapv(f64::from));
    let top = values.first().copied().unwrap_or(0.0);
    let kept = count.min(values.iter().filter(|value| **value > 1e-9 * top && **value > 0.0).count());
    let rotation = vectors.slice(s![.., ..kept]).mapv(|x| x as f32);
    (q.dot(&rotation), values[..kept].to_vec())
}

/// Moves every texel to the cluster whose mean and `components` components leave the least of it, `rounds` times,
/// refitting in between. Clusters that lose all their texels vanish; the others are numbered anew.
///
/// Cost: `2 texels x dimensions x clusters x components` floating-point operations a round.
pub fn reassign(
    scores: ArrayView2<f32>,
    labels: &mut [u32],
    clusters: usize,
    components: usize,
    rounds: usize,
) -> usize {
    let mut clusters = clusters;
    for _ in 0..rounds {
        let models = local_pca(scores, labels, clusters, components);
        labels.par_chunks_mut(1024).enumerate().for_each(|(chunk, labels)| {
            let first = chunk * 1024;
            let rows = scores.slice(s![first..first + labels.len(), ..]);
            let mut best = vec![f32::INFINITY; labels.len()];
            for (cluster, model) in models.iter().enumerate().filter(|(_, model)| !model.members.is_empty()) {
                let centred = &rows - &model.mean;
                let taken = centred.dot(&model.components);
                for (i, (row, taken)) in centred.rows().into_iter().zip(taken.rows()).enumerate() {
                    let left = row.dot(&row) - taken.dot(&taken);
                    if left < best[i] {
                        best[i] = left;
                        labels[i] = cluster as u32;
                    }
                }
            }
        });
        clusters = renumber(labels, clusters);
    }
    clusters
}

/// Numbers the clusters that have texels anew, in order, and returns how many these are.
pub fn renumber(labels: &mut [u32], clusters: usize) -> usize {
    let mut numbers = vec![u32::MAX; clusters];
    let mut next = 0;
    labels.iter().for_each(|label| numbers[*label as usize] = 0);
    for number in numbers.iter_mut().filter(|number| **number == 0) {
        *number = next;
        next += 1;
    }
    labels.iter_mut().for_each(|label| *label = numbers[*label as usize]);
    next as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    #[test]
    fn the_leading_eigenvectors_of_a_decaying_matrix_are_found() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(2);
        let basis = orthonormalize(&Array2::from_shape_simple_fn((60, 12), || random.gen_range(-1.0..1.0f32)));
        let values: Vec<f32> = (0..12).map(|i| 100.0 * 0.5f32.powi(i)).collect();
        let matrix = basis.dot(&Array2::from_diag(&Array1::from(values.clone()))).dot(&basis.t());
        let (vectors, found) = leading_eigenvectors(&matrix, 4);
        for i in 0..4 {
            assert!((found[i] - f64::from(values[i])).abs() < 0.01 * f64::from(values[i]), "{i}: {found:?}");
            assert!(vectors.column(i).dot(&basis.column(i)).abs() > 0.999, "{i}");
            assert!(vectors.column(i).dot(&basis.column((i + 1) % 12)).abs() < 0.05);
        }
    }

    #[test]
    fn texels_go_to_the_line_that_they_lie_on() {
        // Two crossing lines in the plane: the nearest centre does not tell them apart, the model does.
        let mut random = Xoshiro256PlusPlus::seed_from_u64(3);
        let truth: Vec<u32> = (0..400).map(|i| i % 2).collect();
        let scores = Array2::from_shape_fn((400, 3), |(i, c)| {
            if c as u32 == truth[i] { ((i * 37 % 101) as f32 - 50.0) / 10.0 } else { 0.0 }
        }) + Array2::from_shape_simple_fn((400, 3), || random.gen_range(-0.01..0.01f32));
        let mut labels: Vec<u32> =
            truth.iter().enumerate().map(|(i, label)| if i % 5 == 0 { 1 - label } else { *label }).collect();
        let wrong = |labels: &[u32]| {
            let same =
                labels.iter().zip(&truth).zip(scores.rows()).filter(|((a, b), row)| a == b || row.dot(row) < 0.1);
            let same = same.count();
            same.min(400 - same)
        };
        assert!(wrong(&labels) > 60);
        assert_eq!(reassign(scores.view(), &mut labels, 2, 1, 4), 2);
        assert!(wrong(&labels) < 8, "{}", wrong(&labels));
    }

    #[test]
    fn clusters_that_lose_their_texels_vanish() {
        let scores = Array2::from_shape_fn((50, 2), |(i, c)| if c == 0 { i as f32 } else { 0.0 });
        let mut labels: Vec<u32> = (0..50).map(|i| if i < 48 { 0 } else { 2 }).collect();
        let clusters = reassign(scores.view(), &mut labels, 3, 1, 2);
        assert!(clusters <= 2 && labels.iter().all(|label| (*label as usize) < clusters));
    }
}

//! Local PCA of what the lobes leave [Muller 2003]: per cluster a mean and principal components, by a
//! streamed randomised range finder with one power iteration and a Nystrom step [Halko 2011].

use crate::cache::{Mapping, Tile, TileCache};
use crate::curve::Curve;
use crate::error::FitError;
use crate::holdout::Holdout;
use crate::monitor::Monitor;
use crate::project::{orthonormalize, sorted_eigen, transposed_product};
use crate::sparse::{ClusterLobes, Selection};
use btf_runtime::lobe_sum_at_pairs;
use nalgebra::DMatrix;
use ndarray::{Array1, Array2};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

/// Columns of the range finder beyond the components that are wanted.
pub const OVERSAMPLING: usize = 6;

/// The residual of every texel, made when it is read.
pub struct ResidualSource<'a> {
    /// The capture.
    pub cache: &'a TileCache,
    /// The residual's curve applied to samples.
    pub mapping: &'a Mapping,
    /// The same for lobe sums.
    pub curve: &'a Curve,
    /// Dictionaries on the measured pairs.
    pub clusters: &'a [ClusterLobes],
    /// Lobes of the texels.
    pub selection: &'a Selection,
    /// Cluster per texel.
    pub labels: &'a [u32],
    /// Held-back pairs.
    pub holdout: &'a Holdout,
}

impl ResidualSource<'_> {
    /// Length of a row: pairs times channels.
    pub fn row_len(&self) -> usize {
        self.cache.pair_count() * 3
    }

    /// `g(X) - g(S)` of the block's texel `index`.
    fn row(&self, tile: &Tile, index: usize, row: &mut [f32], scratch: &mut [f32]) {
        let texel = tile.texels.start + index;
        let cluster = self.labels[texel] as usize;
        tile.texel_mapped(index, row, self.mapping);
        let refs = &self.selection.refs[self.selection.first[texel]..][..usize::from(self.selection.counts[texel])];
        let scales: Vec<f32> = self.selection.dictionary[cluster].iter().map(|entry| entry.weight_scale).collect();
        lobe_sum_at_pairs(refs, &scales, &self.clusters[cluster].tables, scratch);
        row.iter_mut().zip(scratch.iter()).for_each(|(x, s)| *x -= self.curve.encode(*s));
        self.holdout.fill(row);
    }

    /// Calls `work(cluster, texels, rows)` for every cluster of every block, clusters in parallel, blocks
    /// in order: sums per cluster are the same on any number of threads. `state` is per cluster.
    pub fn for_each_block<S: Send>(
        &self,
        stage: &str,
        part: (usize, usize),
        monitor: &Monitor,
        state: &mut [S],
        work: impl Fn(usize, &mut S, &[usize], Array2<f32>) + Sync,
    ) -> Result<(), FitError> {
        let tiles = self.cache.tile_count();
        for tile in 0..tiles {
            let loaded = self.cache.read(tile)?;
            let mut members: Vec<Vec<usize>> = vec![Vec::new(); state.len()];
            for index in 0..loaded.texels.len() {
                members[self.labels[loaded.texels.start + index] as usize].push(index);
            }
            state.par_iter_mut().zip(members.par_iter()).enumerate().for_each(|(cluster, (state, members))| {
                if members.is_empty() {
                    return;
                }
                let mut rows = Array2::<f32>::zeros((members.len(), self.row_len()));
                let mut scratch = vec![0.0; self.row_len()];
                for (mut row, &index) in rows.rows_mut().into_iter().zip(members) {
                    self.row(&loaded, index, row.as_slice_mut().unwrap_or_default(), &mut scratch);
                }
                let texels: Vec<usize> = members.iter().map(|index| loaded.texels.start + index).collect();
                work(cluster, state, &texels, rows);
            });
            monitor.report(stage, part.0 * tiles + tile + 1, part.1 * tiles)?;
        }
        Ok(())
    }
}

/// A cluster's residual model before it is factored and quantised.
pub struct LocalPca {
    /// Texels.
    pub count: usize,
    /// Mean residual, `[pair, channel]`.
    pub mean: Array1<f32>,
    /// Orthonormal components in columns, most important first.
    pub components: Array2<f32>,
    /// Sum over texels of each component's squared coefficient.
    pub variances: Vec<f64>,
    /// Sum over texels of the squared residual about the mean.
    pub energy: f64,
}

impl LocalPca {
    /// What planning needs, without mean and components.
    pub fn without_bases(self) -> LocalPca {
        LocalPca { mean: Array1::default(0), components: Array2::default((0, 0)), ..self }
    }
}

#[derive(Default)]
struct Sketch {
    count: usize,
    sum: Array1<f64>,
    squares: f64,
    /// `R' Omega` and the column sums of Omega.
    range: Array2<f32>,
    omega_sum: Vec<f64>,
}

/// Fits `components` principal components (fewer where a cluster has fewer texels) to each cluster.
///
/// Cost: two passes over the capture.
pub fn local_pca(
    source: &ResidualSource,
    components: usize,
    seed: u64,
    monitor: &Monitor,
) -> Result<Vec<LocalPca>, FitError> {
    let len = source.row_len();
    let wide = components + OVERSAMPLING;
    let new = || Sketch {
        sum: Array1::zeros(len),
        range: Array2::zeros((len, wide)),
        omega_sum: vec![0.0; wide],
        ..Sketch::default()
    };
    let mut sketches: Vec<Sketch> = source.clusters.iter().map(|_| new()).collect();
    source.for_each_block("residual", (0, 3), monitor, &mut sketches, |_, sketch, texels, rows| {
        // A texel's random row depends on the texel alone.
        let omega = Array2::from_shape_vec(
            (texels.len(), wide),
            texels
                .iter()
                .flat_map(|texel| {
                    let mut random =
                        Xoshiro256PlusPlus::seed_from_u64(seed.wrapping_mul(0x9e37_79b9).wrapping_add(*texel as u64));
                    (0..wide).map(move |_| if random.r#gen::<bool>() { 1.0f32 } else { -1.0 }).collect::<Vec<_>>()
                })
                .collect(),
        )
        .unwrap_or_else(|_| Array2::zeros((texels.len(), wide)));
        sketch.count += texels.len();
        for row in rows.rows() {
            sketch.sum.zip_mut_with(&row, |sum, x| *sum += f64::from(*x));
            sketch.squares += row.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
        }
        for (sum, column) in sketch.omega_sum.iter_mut().zip(omega.columns()) {
            *sum += column.iter().map(|x| f64::from(*x)).sum::<f64>();
        }
        ndarray::linalg::general_mat_mul(1.0, &rows.t(), &omega, 1.0, &mut sketch.range);
    })?;

    struct Power {
        count: usize,
        mean: Array1<f32>,
        energy: f64,
        q: Array2<f32>,
        image: Array2<f32>,
    }
    let mut powers: Vec<Power> = sketches
        .into_par_iter()
        .map(|mut sketch| {
            let mean64 = &sketch.sum / sketch.count.max(1) as f64;
            let energy = (sketch.squares - sketch.count as f64 * mean64.dot(&mean64)).max(0.0);
            let mean = mean64.mapv(|x| x as f32);
            for (mut column, sum) in sketch.range.columns_mut().into_iter().zip(&sketch.omega_sum) {
                column.scaled_add(-*sum as f32, &mean);
            }
            let q = if sketch.count > 1 { orthonormalize(&sketch.range) } else { Array2::zeros((len, 0)) };
            let image = Array2::zeros(q.dim());
            Power { count: sketch.count, mean, energy, q, image }
        })
        .collect();
    monitor.check()?;
    source.for_each_block("residual", (1, 3), monitor, &mut powers, |_, power, _, mut rows| {
        rows -= &power.mean;
        let z = rows.dot(&power.q);
        ndarray::linalg::general_mat_mul(1.0, &rows.t(), &z, 1.0, &mut power.image);
    })?;

    Ok(powers
        .into_par_iter()
        .map(|power| {
            let (vectors, variances) = nystrom(&power.q, &power.image, components.min(power.count.saturating_sub(1)));
            LocalPca { count: power.count, mean: power.mean, components: vectors, variances, energy: power.energy }
        })
        .collect())
}

/// Leading eigenvectors of a positive semi-definite `C` from `q` (orthonormal) and `image = C q`:
/// `C ~ image (q' image)^-1 image'`.
fn nystrom(q: &Array2<f32>, image: &Array2<f32>, components: usize) -> (Array2<f32>, Vec<f64>) {
    let n = q.ncols();
    if n == 0 || components == 0 {
        return (Array2::zeros((q.nrows(), 0)), Vec::new());
    }
    let core = transposed_product(q.view(), image.view()).mapv(f64::from);
    let trace: f64 = (0..n).map(|i| core[[i, i]]).sum();
    let core = DMatrix::from_fn(n, n, |i, j| {
        0.5 * (core[[i, j]] + core[[j, i]]) + if i == j { 1e-7 * trace.abs() / n as f64 + 1e-30 } else { 0.0 }
    });
    // image * L^-T, whose Gram matrix has C's eigenvalues.
    let eigen = nalgebra::SymmetricEigen::new(core);
    let top = eigen.eigenvalues.iter().fold(0.0f64, |top, x| top.max(*x));
    let kept: Vec<usize> = (0..n).filter(|&i| eigen.eigenvalues[i] > 1e-9 * top).collect();
    let whiten = Array2::from_shape_fn((n, kept.len()), |(i, j)| {
        (eigen.eigenvectors[(i, kept[j])] / eigen.eigenvalues[kept[j]].sqrt()) as f32
    });
    let half = image.dot(&whiten);
    let gram = transposed_product(half.view(), half.view()).mapv(f64::from);
    let (values, vectors) = sorted_eigen(&gram);
    let count = components.min(values.iter().filter(|value| **value > 1e-12 * values[0].max(1e-30)).count());
    let rotation = Array2::from_shape_fn((kept.len(), count), |(i, j)| (vectors[[i, j]] / values[j].sqrt()) as f32);
    (half.dot(&rotation), values[..count].to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nystrom_finds_the_eigenvectors_of_a_decaying_matrix() {
        let n = 60;
        let mut random = Xoshiro256PlusPlus::seed_from_u64(2);
        let basis = orthonormalize(&Array2::from_shape_simple_fn((n, 12), || random.gen_range(-1.0..1.0f32)));
        let values: Vec<f32> = (0..12).map(|i| 100.0 * 0.5f32.powi(i)).collect();
        let c = basis.dot(&Array2::from_diag(&Array1::from(values.clone()))).dot(&basis.t());
        let q = orthonormalize(&c.dot(&Array2::from_shape_simple_fn((n, 9), || random.gen_range(-1.0..1.0f32))));
        let (vectors, found) = nystrom(&q, &c.dot(&q), 4);
        for i in 0..4 {
            assert!(
                (found[i] - f64::from(values[i])).abs() < 0.01 * f64::from(values[i]),
                "{i}: {} {}",
                found[i],
                values[i]
            );
            let overlap = vectors.column(i).dot(&basis.column(i)).abs();
            assert!(overlap > 0.999, "{i}: {overlap}");
            assert!(vectors.column(i).dot(&basis.column((i + 1) % 12)).abs() < 0.05);
        }
    }
}

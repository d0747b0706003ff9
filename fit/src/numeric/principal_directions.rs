//! Leading directions of many rows by a randomised range finder [Halko 2011], and the products and eigenvectors of
//! tall matrices that it needs.

use crate::gpu::fit_gpu::FitGpu;
use crate::gpu::product::Precision;
use crate::gpu::row_stream::{RowStream, try_on};
use crate::matrix_product::{add_product, product};
use nalgebra::{DMatrix, SymmetricEigen};
use ndarray::{Array2, ArrayView2, s};
use rand::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

/// Rows that are made as floats at a time: 20 MB for Bonn's 6,561 pairs.
pub const ROW_BLOCK: usize = 256;
/// Columns of the range finder beyond the directions that are wanted.
pub const OVERSAMPLING: usize = 16;
/// Stride between the blocks of rows that the range finder's first two products are taken of: they only choose where
/// the power iteration starts.
const START_EVERY: usize = 4;

/// Returns a matrix of standard normal numbers (Box-Muller).
fn gaussian(rows: usize, columns: usize, random: &mut Xoshiro256PlusPlus) -> Array2<f32> {
    Array2::from_shape_simple_fn((rows, columns), || {
        let radius = (-2.0 * (1.0 - random.r#gen::<f64>()).ln()).sqrt();
        (radius * (std::f64::consts::TAU * random.r#gen::<f64>()).cos()) as f32
    })
}

/// Returns `a^T b` of two tall matrices, in f64 partial sums over fixed row blocks: the result is the same on any
/// number of threads.
pub fn transposed_product(a: ArrayView2<f32>, b: ArrayView2<f32>) -> Array2<f32> {
    let blocks: Vec<usize> = (0..a.nrows()).step_by(2048).collect();
    let parts: Vec<Array2<f32>> = blocks
        .par_iter()
        .map(|&start| {
            let end = (start + 2048).min(a.nrows());
            a.slice(s![start..end, ..]).t().dot(&b.slice(s![start..end, ..]))
        })
        .collect();
    let mut sum = Array2::<f64>::zeros((a.ncols(), b.ncols()));
    for part in parts {
        sum.zip_mut_with(&part, |sum, x| *sum += f64::from(*x));
    }
    sum.mapv(|x| x as f32)
}

/// Returns orthonormal columns with the span of `a` (tall), by two rounds of the Gram matrix' inverse square root.
/// Directions below rounding are dropped, so that rank-deficient input is allowed.
pub fn orthonormalize(a: &Array2<f32>) -> Array2<f32> {
    let once = orthonormalize_once(a);
    orthonormalize_once(&once)
}

fn orthonormalize_once(a: &Array2<f32>) -> Array2<f32> {
    let n = a.ncols();
    if n == 0 {
        return a.clone();
    }
    let gram = transposed_product(a.view(), a.view());
    let eigen = SymmetricEigen::new(DMatrix::from_fn(n, n, |i, j| f64::from(gram[[i, j]])));
    let top = eigen.eigenvalues.iter().fold(0.0f64, |top, x| top.max(*x));
    let kept: Vec<usize> =
        (0..n).filter(|&i| eigen.eigenvalues[i] > top * 1e-10 && eigen.eigenvalues[i] > 0.0).collect();
    let rotation = Array2::from_shape_fn((n, kept.len()), |(i, j)| {
        (eigen.eigenvectors[(i, kept[j])] / eigen.eigenvalues[kept[j]].sqrt()) as f32
    });
    a.dot(&rotation)
}

/// Returns the eigenvalues, largest first, and the eigenvectors (in columns) of a symmetric matrix. Each vector's
/// largest entry is positive, so that the result does not depend on the solver's choice of sign.
pub fn sorted_eigen(matrix: &Array2<f64>) -> (Vec<f64>, Array2<f64>) {
    let n = matrix.nrows();
    if n == 0 {
        return (Vec::new(), Array2::zeros((0, 0)));
    }
    let eigen = SymmetricEigen::new(DMatrix::from_fn(n, n, |i, j| 0.5 * (matrix[[i, j]] + matrix[[j, i]])));
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let values = order.iter().map(|&i| eigen.eigenvalues[i]).collect();
    let mut vectors = Array2::from_shape_fn((n, n), |(row, column)| eigen.eigenvectors[(row, order[column])]);
    for mut column in vectors.columns_mut() {
        let peak = column.iter().fold(0.0f64, |peak, x| if x.abs() > peak.abs() + 1e-12 { *x } else { peak });
        if peak < 0.0 {
            column.mapv_inplace(|x| -x);
        }
    }
    (values, vectors)
}

/// Rows that are made when they are needed: `rows(range)` gives `[row, sample]`.
pub struct Rows<'a, E> {
    /// Number of rows.
    pub count: usize,
    /// Samples per row.
    pub samples: usize,
    /// Function that makes a range of the rows.
    pub make: &'a (dyn Fn(std::ops::Range<usize>) -> Result<Array2<f32>, E> + Sync),
    /// Adapter that multiplies where it is quicker, and the precision in which rows are copied to it.
    pub gpu: Option<(&'a FitGpu, Precision)>,
}

impl<'a, E: Send> Rows<'a, E> {
    /// Returns `work(rows)` of each block of [`ROW_BLOCK`] rows, in order.
    fn map<R: Send>(&self, work: impl Fn(Array2<f32>) -> R + Sync) -> Result<Vec<R>, E> {
        (0..self.count)
            .step_by(ROW_BLOCK)
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|first| Ok(work((self.make)(first..(first + ROW_BLOCK).min(self.count))?)))
            .collect()
    }

    /// Pushes all rows into what `stream` begins on the adapter; `None` where there is none, it is slower or it fails, which
    /// the CPU makes good.
    fn on_gpu(
        &self,
        stream: impl FnOnce(&'a FitGpu, Precision) -> Option<RowStream<'a>>,
    ) -> Result<Option<Array2<f32>>, E> {
        let Some((gpu, precision)) = self.gpu.filter(|(gpu, _)| gpu.is_quicker()) else { return Ok(None) };
        let Some(mut stream) = stream(gpu, precision) else { return Ok(None) };
        let blocks: Vec<usize> = (0..self.count).step_by(ROW_BLOCK).collect();
        for group in blocks.chunks(rayon::current_num_threads().max(2)) {
            let made: Vec<Array2<f32>> = group
                .par_iter()
                .map(|&first| (self.make)(first..(first + ROW_BLOCK).min(self.count)))
                .collect::<Result<_, E>>()?;
            if made.iter().try_for_each(|rows| stream.push(rows)).is_none() {
                return Ok(None);
            }
        }
        Ok(stream.finish())
    }

    /// Returns `X q`, where X are the rows.
    fn times(&self, q: &Array2<f32>) -> Result<Array2<f32>, E> {
        if let Some((gpu, precision)) = self.gpu.filter(|(gpu, _)| !gpu.is_tried()) {
            try_on(gpu, &(self.make)(0..ROW_BLOCK.min(self.count))?, q, precision);
        }
        if let Some(found) = self.on_gpu(|gpu, precision| RowStream::times(gpu, self.count, q, precision))? {
            return Ok(found);
        }
        let parts = self.map(|rows| product(&rows, q))?;
        let views: Vec<_> = parts.iter().map(|part| part.view()).collect();
        Ok(ndarray::concatenate(ndarray::Axis(0), &views).unwrap_or_else(|_| Array2::zeros((0, q.ncols()))))
    }

    /// Returns `X' q`, where X are the rows, with blocks added in an order that does not depend on threads.
    fn transposed_times(&self, q: &Array2<f32>) -> Result<Array2<f32>, E> {
        let stream = |gpu, precision| RowStream::transposed_times(gpu, self.samples, q, precision);
        if let Some(found) = self.on_gpu(stream)? {
            return Ok(found);
        }
        let blocks: Vec<usize> = (0..self.count).step_by(ROW_BLOCK).collect();
        let mut sum = Array2::<f32>::zeros((self.samples, q.ncols()));
        // Eight sums at a time bound the memory; within one the order is fixed.
        for group in blocks.chunks(8 * 4) {
            let parts: Vec<Array2<f32>> = group
                .par_chunks(8)
                .map(|firsts| {
                    let mut part = Array2::<f32>::zeros((self.samples, q.ncols()));
                    for &first in firsts {
                        let range = first..(first + ROW_BLOCK).min(self.count);
                        let rows = (self.make)(range.clone())?;
                        add_product(&rows.t(), &q.slice(s![range, ..]), &mut part);
                    }
                    Ok(part)
                })
                .collect::<Result<_, E>>()?;
            parts.iter().for_each(|part| sum += part);
        }
        Ok(sum)
    }
}

/// Returns the stride between the blocks that the range finder of `rank` columns starts with.
fn start_every(count: usize, rank: usize) -> usize {
    // Twice as many rows as columns at least.
    if count >= 2 * START_EVERY * (rank + ROW_BLOCK) { START_EVERY } else { 1 }
}

/// Returns about how many rows [`principal_directions`] asks for.
pub fn rows_made(rows: usize, count: usize) -> usize {
    2 * rows + 2 * rows / start_every(rows, count + OVERSAMPLING)
}

/// Returns the `count` leading right singular vectors of `rows` in columns, fewer where the rank is lower but at least
/// one, by a randomised range finder with a power iteration [Halko 2011].
///
/// Cost: [`rows_made`] rows are made, and multiplied by `samples x count` each.
pub fn principal_directions<E: Send>(
    rows: &Rows<E>,
    count: usize,
    random: &mut Xoshiro256PlusPlus,
) -> Result<Array2<f32>, E> {
    let rank = (count + OVERSAMPLING).min(rows.count).min(rows.samples);
    let every = start_every(rows.count, rank);
    let blocks = rows.count.div_ceil(ROW_BLOCK).div_ceil(every);
    let end_of_last = (blocks.saturating_sub(1) * every + 1) * ROW_BLOCK;
    let start = Rows {
        count: blocks * ROW_BLOCK - end_of_last.saturating_sub(rows.count),
        samples: rows.samples,
        // Rows are asked for block by block.
        make: &|range: std::ops::Range<usize>| {
            let first = range.start * every;
            (rows.make)(first..first + range.len())
        },
        gpu: rows.gpu,
    };
    let q = orthonormalize(&start.times(&gaussian(rows.samples, rank, random))?);
    let back = orthonormalize(&start.transposed_times(&q)?);
    let q = orthonormalize(&rows.times(&back)?);
    drop(back);
    let right = rows.transposed_times(&q)?;
    let gram = transposed_product(right.view(), right.view()).mapv(f64::from);
    let (values, vectors) = sorted_eigen(&gram);
    let top = values.first().copied().unwrap_or(0.0);
    let kept = count.min(values.iter().filter(|value| **value > 1e-10 * top).count()).max(1).min(vectors.ncols());
    if right.ncols() == 0 || top <= 0.0 {
        // Nothing there: any direction will do.
        return Ok(Array2::from_shape_fn((rows.samples, 1), |(i, _)| if i == 0 { 1.0 } else { 0.0 }));
    }
    let rotation =
        Array2::from_shape_fn((vectors.nrows(), kept), |(i, j)| (vectors[[i, j]] / values[j].max(1e-30).sqrt()) as f32);
    Ok(right.dot(&rotation))
}

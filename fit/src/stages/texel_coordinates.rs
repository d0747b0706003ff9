//! The residual in few numbers a texel: principal directions of a sample of texels, and every texel's coordinates along
//! them. All that follows (clusters' models, quantisation, the search for a size) works on these numbers.

use crate::error::FitError;
use crate::gpu::fit_gpu::FitGpu;
use crate::gpu::product::Precision;
use crate::gpu::row_stream::RowStream;
use crate::input::texel_sample::texel_sample;
use crate::matrix_product::product;
use crate::monitor::Monitor;
use crate::numeric::principal_directions::{Rows, principal_directions, rows_made};
use crate::resume::stored::stored_structs;
use crate::stages::residual_source::ResidualSource;
use ndarray::{Array2, s};
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Coordinates of a residual.
pub struct Coordinates {
    /// Coordinates, `[texel, direction]`.
    pub scores: Array2<f32>,
    /// Directions, `[sample, direction]`: orthonormal columns, most important first.
    pub directions: Array2<f32>,
    /// Sum over texels of each texel's squared residual.
    pub squares: f64,
    /// Sum over texels of the squared coordinate along each direction.
    pub energies: Vec<f64>,
}

stored_structs! {
    Coordinates { scores, directions, squares, energies }
}

impl Coordinates {
    /// Finds at most `rank` directions from `sample` texels and projects every texel onto them. The mean is not
    /// taken off: the first direction is close to it.
    ///
    /// Products are on `gpu` where that is quicker; they are the CPU's up to rounding.
    ///
    /// Cost: one pass over the capture, `4 texels x samples x rank` floating-point operations and as many over the
    /// sample.
    pub fn new(
        source: &ResidualSource,
        rank: usize,
        sample: usize,
        seed: u64,
        gpu: Option<&FitGpu>,
        (stage, monitor): (&str, &Monitor),
    ) -> Result<Coordinates, FitError> {
        let texels = source.cache.texel_count();
        let chosen = texel_sample(texels, sample, seed);
        let count = chosen.len();
        let block = source.cache.gather(&chosen)?;
        // Eight bits are rounded much more coarsely than halves are, and a root brings any scale into their range.
        let is_root = source.curve.power() > 0.0 && source.curve.power() < 1.0;
        let precision = if is_root && source.cache.is_encoded()? { Precision::Half } else { Precision::Single };
        // Rows of the sample are made for each product, those of all texels once.
        let (made, all) = (AtomicUsize::new(0), rows_made(count, rank) + texels);
        let sampled = Rows {
            count,
            samples: source.row_len(),
            make: &|range| {
                let before = made.fetch_add(range.len(), Ordering::Relaxed);
                monitor.report(stage, before.min(all), all)?;
                Ok::<_, FitError>(source.rows(&block, range, |index| chosen[index]))
            },
            gpu: gpu.map(|gpu| (gpu, precision)),
        };
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x5ba5);
        let directions = principal_directions(&sampled, rank, &mut random)?;
        drop(block);
        let told = |done| monitor.report(stage, all - texels + done, all);
        let stream =
            gpu.filter(|gpu| gpu.is_quicker()).and_then(|gpu| RowStream::times(gpu, texels, &directions, precision));
        let on_gpu = match stream {
            Some(stream) => projected_on_gpu(source, stream, told)?,
            None => None,
        };
        let (scores, squares) = match on_gpu {
            Some(found) => found,
            None => projected(source, &directions, told)?,
        };
        let energies = scores
            .columns()
            .into_iter()
            .map(|column| column.iter().map(|x| f64::from(*x) * f64::from(*x)).sum())
            .collect();
        Ok(Coordinates { scores, directions, squares, energies })
    }
}

/// Returns every texel's coordinates along `directions`, and the sum of all squares. `told` reports the texels that are done.
fn projected(
    source: &ResidualSource,
    directions: &Array2<f32>,
    told: impl Fn(usize) -> Result<(), FitError>,
) -> Result<(Array2<f32>, f64), FitError> {
    let mut scores = Array2::<f32>::zeros((source.cache.texel_count(), directions.ncols()));
    let mut squares = 0.0;
    source.for_each_block(
        told,
        |range, rows| (range, product(&rows, directions), squares_of(&rows)),
        |(range, part, part_squares)| {
            scores.slice_mut(s![range, ..]).assign(&part);
            squares += part_squares;
        },
    )?;
    Ok((scores, squares))
}

/// Does the same through `stream`; `None` after an error of the driver.
fn projected_on_gpu(
    source: &ResidualSource,
    mut stream: RowStream,
    told: impl Fn(usize) -> Result<(), FitError>,
) -> Result<Option<(Array2<f32>, f64)>, FitError> {
    let (mut squares, mut works) = (0.0, true);
    source.for_each_block(
        told,
        |_, rows| {
            let squares = squares_of(&rows);
            (rows, squares)
        },
        |(rows, part_squares)| {
            works = works && stream.push(&rows).is_some();
            squares += part_squares;
        },
    )?;
    Ok(stream.finish().filter(|_| works).map(|scores| (scores, squares)))
}

/// Returns the sum of all squares.
fn squares_of(rows: &Array2<f32>) -> f64 {
    match rows.as_slice() {
        Some(all) => square_of(all),
        None => rows.iter().map(|x| f64::from(*x) * f64::from(*x)).sum(),
    }
}

/// Returns the sum of squares, in eight sums beside each other, so that none waits for the one before.
fn square_of(values: &[f32]) -> f64 {
    let mut sums = [0.0f64; 8];
    let (eights, rest) = values.as_chunks::<8>();
    for eight in eights {
        for (sum, x) in sums.iter_mut().zip(eight) {
            *sum += f64::from(*x) * f64::from(*x);
        }
    }
    sums.iter().sum::<f64>() + rest.iter().map(|x| f64::from(*x) * f64::from(*x)).sum::<f64>()
}

//! The residual in few numbers a texel: principal directions of a sample of texels, and every texel's place along
//! them. All that follows (clusters' models, quantisation, the search for a size) works on these numbers.

use crate::error::FitError;
use crate::monitor::Monitor;
use crate::project::{Rows, principal_directions};
use crate::residual_source::ResidualSource;
use ndarray::{Array2, s};
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;

/// A residual's coordinates.
pub struct Coordinates {
    /// `[texel, direction]`.
    pub scores: Array2<f32>,
    /// `[sample, direction]`, orthonormal columns, most important first.
    pub directions: Array2<f32>,
    /// Sum over texels of each texel's squared residual.
    pub squares: f64,
    /// Sum over texels of each squared coordinate.
    pub energies: Vec<f64>,
}

impl Coordinates {
    /// Finds at most `rank` directions from `sample` texels and projects every texel onto them. The mean is not
    /// taken off: the first direction is close to it.
    ///
    /// Cost: one pass over the capture, `4 texels x samples x rank` floating-point operations and as many over the
    /// sample.
    pub fn new(
        source: &ResidualSource,
        rank: usize,
        sample: usize,
        seed: u64,
        stage: &str,
        monitor: &Monitor,
    ) -> Result<Coordinates, FitError> {
        let texels = source.cache.texel_count();
        let count = sample.clamp(1, texels);
        let chosen: Vec<usize> = (0..count).map(|i| i * texels / count).collect();
        let block = source.cache.gather(&chosen)?;
        let sampled = Rows {
            count,
            samples: source.row_len(),
            make: &|range| {
                monitor.check()?;
                Ok::<_, FitError>(source.rows(&block, range, |index| chosen[index]))
            },
        };
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x5ba5);
        let directions = principal_directions(&sampled, rank, &mut random)?;
        drop(block);
        let mut scores = Array2::<f32>::zeros((texels, directions.ncols()));
        let mut squares = 0.0;
        source.for_each_block(
            stage,
            monitor,
            |range, rows| {
                let squares: f64 = rows.iter().map(|x| f64::from(*x) * f64::from(*x)).sum();
                (range, rows.dot(&directions), squares)
            },
            |(range, part, part_squares)| {
                scores.slice_mut(s![range, ..]).assign(&part);
                squares += part_squares;
            },
        )?;
        let energies = scores
            .columns()
            .into_iter()
            .map(|column| column.iter().map(|x| f64::from(*x) * f64::from(*x)).sum())
            .collect();
        Ok(Coordinates { scores, directions, squares, energies })
    }
}

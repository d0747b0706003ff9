//! The residual in few numbers a texel: principal directions of a sample of texels, and every texel's coordinates along
//! them. All that follows (clusters' models, quantisation, the search for a size) works on these numbers.

use crate::error::FitError;
use crate::input::texel_sample::texel_sample;
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
        let chosen = texel_sample(texels, sample, seed);
        let count = chosen.len();
        let block = source.cache.gather(&chosen)?;
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
        };
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x5ba5);
        let directions = principal_directions(&sampled, rank, &mut random)?;
        drop(block);
        let mut scores = Array2::<f32>::zeros((texels, directions.ncols()));
        let mut squares = 0.0;
        source.for_each_block(
            |done| monitor.report(stage, all - texels + done, all),
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

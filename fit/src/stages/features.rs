//! Features for clustering: a randomised SVD [Halko 2011] of a sample of texels, then one streamed
//! pass that projects every texel.

use crate::error::FitError;
use crate::input::texel_sample::texel_sample;
use crate::input::tile_cache::{Mapping, TileCache};
use crate::monitor::Monitor;
use crate::numeric::principal_directions::{ROW_BLOCK, Rows, principal_directions};
use crate::priors::holdout::Holdout;
use crate::resume::stored::stored_structs;
use ndarray::{Array2, Axis, s};
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

/// Features of every texel.
pub struct Features {
    /// Scores, `[texel, dimension]`.
    pub scores: Array2<f32>,
}

stored_structs! {
    Features { scores }
}

/// Projects every texel's function (through `mapping`) onto `dimensions` principal directions of a
/// sample of at most `sample` texels.
///
/// Cost: two passes over the cache; products of `texels x samples x dimensions`.
pub fn features(
    cache: &TileCache,
    mapping: &Mapping,
    holdout: &Holdout,
    dimensions: usize,
    sample: usize,
    seed: u64,
    monitor: &Monitor,
) -> Result<Features, FitError> {
    let samples = cache.pair_count() * 3;
    let texels = cache.texel_count();
    let chosen = texel_sample(texels, sample, seed);
    let mut block = Array2::<f32>::zeros((chosen.len(), samples));
    let mut next = 0;
    for tile in 0..cache.tile_count() {
        let range = cache.tile_texels(tile);
        let first = next;
        while next < chosen.len() && chosen[next] < range.end {
            next += 1;
        }
        let loaded = cache.read(tile)?;
        let rows = block.as_slice_mut().unwrap_or_default();
        rows[first * samples..next * samples].par_chunks_mut(samples).enumerate().for_each(|(i, row)| {
            loaded.texel_mapped(chosen[first + i] - range.start, row, mapping);
        });
        monitor.report("project", tile + 1, 2 * cache.tile_count())?;
    }
    block.axis_chunks_iter_mut(Axis(0), ROW_BLOCK).into_par_iter().for_each(|rows| holdout.fill(rows));
    let mean = block.mean_axis(Axis(0)).unwrap_or_else(|| ndarray::Array1::zeros(samples));
    block -= &mean;
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let sampled = Rows {
        count: block.nrows(),
        samples,
        make: &|range| Ok::<_, FitError>(block.slice(s![range, ..]).to_owned()),
        gpu: None,
    };
    let basis = principal_directions(&sampled, dimensions, &mut random)?;
    drop(block);
    monitor.check()?;

    let mut scores = Array2::<f32>::zeros((texels, basis.ncols()));
    for tile in 0..cache.tile_count() {
        let loaded = cache.read(tile)?;
        let range = loaded.texels.clone();
        let mut target = scores.slice_mut(s![range.clone(), ..]);
        let count = range.len();
        let parts: Vec<(usize, Array2<f32>)> = (0..count)
            .step_by(ROW_BLOCK)
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|first| {
                let rows = ROW_BLOCK.min(count - first);
                let mut block = Array2::<f32>::zeros((rows, samples));
                for (i, mut row) in block.rows_mut().into_iter().enumerate() {
                    let row = row.as_slice_mut().unwrap_or_default();
                    loaded.texel_mapped(first + i, row, mapping);
                }
                holdout.fill(block.view_mut());
                block -= &mean;
                (first, block.dot(&basis))
            })
            .collect();
        for (first, part) in parts {
            target.slice_mut(s![first..first + part.nrows(), ..]).assign(&part);
        }
        monitor.report("project", cache.tile_count() + tile + 1, 2 * cache.tile_count())?;
    }
    Ok(Features { scores })
}

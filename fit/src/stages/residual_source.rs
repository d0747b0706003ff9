//! Residual of every texel, in the residual's curve, computed when it is read.

use crate::error::FitError;
use crate::input::residual_curve::Curve;
use crate::input::tile_cache::{Mapping, Tile, TileCache};
use crate::numeric::principal_directions::ROW_BLOCK;
use crate::priors::holdout::Holdout;
use crate::stages::sparse::{ClusterLobes, Selection};
use btf_runtime::lobe_sum_at_pairs;
use ndarray::Array2;
use rayon::prelude::*;
use std::ops::Range;

/// Lobes of every texel.
pub struct TexelLobes<'a> {
    /// Dictionaries, tabulated on the measured pairs.
    pub clusters: &'a [ClusterLobes],
    /// Lobes that each texel refers to.
    pub selection: &'a Selection,
    /// Cluster per texel.
    pub labels: &'a [u32],
}

/// Source of every texel's residual.
pub struct ResidualSource<'a> {
    /// The capture.
    pub cache: &'a TileCache<'a>,
    /// The residual's curve applied to samples.
    pub mapping: &'a Mapping,
    /// The residual's curve for sums of lobes.
    pub curve: &'a Curve,
    /// Lobes whose sum is subtracted; `None` where lobes only guide.
    pub lobes: Option<TexelLobes<'a>>,
    /// Held-back pairs.
    pub holdout: &'a Holdout,
}

impl ResidualSource<'_> {
    /// Returns the length of a row: pairs times channels.
    pub fn row_len(&self) -> usize {
        self.cache.pair_count() * 3
    }

    /// Writes `g(X) - g(S)` of `texel`, which is number `index` of the block, into `row`.
    fn row(&self, tile: &Tile, index: usize, texel: usize, row: &mut [f32], scratch: &mut [f32]) {
        tile.texel_mapped(index, row, self.mapping);
        if let Some(TexelLobes { clusters, selection, labels }) = &self.lobes {
            let cluster = labels[texel] as usize;
            let refs = &selection.refs[selection.first[texel]..][..usize::from(selection.counts[texel])];
            let scales: Vec<f32> = selection.dictionary[cluster].iter().map(|entry| entry.weight_scale).collect();
            lobe_sum_at_pairs(refs, &scales, &clusters[cluster].tables, scratch);
            row.iter_mut().zip(scratch.iter()).for_each(|(x, s)| *x -= self.curve.encode(*s));
        } else {
            let nothing = self.curve.encode(0.0);
            if nothing != 0.0 {
                row.iter_mut().for_each(|x| *x -= nothing);
            }
        }
    }

    /// Returns the rows of the texels with numbers `range` in a block, `[number, sample]`; `texel` tells which texel of
    /// the capture a number is.
    pub fn rows(&self, block: &Tile, range: Range<usize>, texel: impl Fn(usize) -> usize) -> Array2<f32> {
        let len = self.row_len();
        let mut rows = Array2::<f32>::zeros((range.len(), len));
        let mut scratch = vec![0.0; len];
        for (index, mut row) in range.zip(rows.rows_mut()) {
            self.row(block, index, texel(index), row.as_slice_mut().unwrap_or_default(), &mut scratch);
        }
        self.holdout.fill(rows.view_mut());
        rows
    }

    /// Calls `work(texels, rows)` for blocks of at most [`ROW_BLOCK`] texels in parallel, and `take` with the results
    /// in the order of the blocks. `done(texels)` reports the progress and may end the work.
    pub fn for_each_block<R: Send>(
        &self,
        done: impl Fn(usize) -> Result<(), FitError>,
        work: impl Fn(Range<usize>, Array2<f32>) -> R + Sync,
        mut take: impl FnMut(R),
    ) -> Result<(), FitError> {
        for tile in 0..self.cache.tile_count() {
            let loaded = self.cache.read(tile)?;
            let range = loaded.texels.clone();
            let results: Vec<R> = (0..range.len())
                .step_by(ROW_BLOCK)
                .collect::<Vec<_>>()
                .into_par_iter()
                .map(|first| {
                    let numbers = first..(first + ROW_BLOCK).min(range.len());
                    let rows = self.rows(&loaded, numbers.clone(), |index| range.start + index);
                    work(range.start + numbers.start..range.start + numbers.end, rows)
                })
                .collect();
            results.into_iter().for_each(&mut take);
            done(range.end)?;
        }
        Ok(())
    }
}

//! Factorisation of the shared bases over light x view: two matrices a colour channel by a weighted higher-order SVD
//! [De Lathauwer 2000] in a luma-chroma frame, and each basis' core in them.

use crate::stages::principal_directions::sorted_eigen;
use btf_runtime::{COLOUR_FRAME, Factors};
use half::f16;
use ndarray::{Array2, ArrayView1};
use rayon::prelude::*;

/// All shared bases in the full rotated frame: nothing is lost yet, only the choice of ranks cuts.
pub struct Rotated {
    /// Number of views and of lights.
    pub shape: [usize; 2],
    /// View rotation `[view, rank]` of each channel, most important rank first.
    view: [Array2<f32>; 3],
    /// Light rotation `[light, rank]` of each channel.
    light: [Array2<f32>; 3],
    /// Cores `[basis][channel]`, each `[view rank, light rank]`.
    cores: Vec<[Array2<f32>; 3]>,
}

fn channel_slice(basis: ArrayView1<f32>, shape: [usize; 2], channel: usize) -> Array2<f32> {
    let frame = COLOUR_FRAME[channel];
    Array2::from_shape_fn((shape[0], shape[1]), |(v, l)| {
        let at = (v * shape[1] + l) * 3;
        (0..3).map(|c| frame[c] * basis[at + c]).sum()
    })
}

impl Rotated {
    /// Finds the rotations of `bases` (`[sample, basis]`), each weighted by the energy that it carries, and rotates
    /// every basis.
    pub fn new(bases: &Array2<f32>, energies: &[f64], shape: [usize; 2]) -> Rotated {
        let rotation = |channel: usize| -> (Array2<f32>, Array2<f32>) {
            let grams: Vec<(Array2<f32>, Array2<f32>)> = (0..bases.ncols())
                .into_par_iter()
                .map(|r| {
                    let slice = channel_slice(bases.column(r), shape, channel) * energies[r].sqrt() as f32;
                    (slice.dot(&slice.t()), slice.t().dot(&slice))
                })
                .collect();
            let mut by_view = Array2::<f64>::zeros((shape[0], shape[0]));
            let mut by_light = Array2::<f64>::zeros((shape[1], shape[1]));
            for (view, light) in &grams {
                by_view.zip_mut_with(view, |sum, x| *sum += f64::from(*x));
                by_light.zip_mut_with(light, |sum, x| *sum += f64::from(*x));
            }
            // What the file form stores is half precision: rotate by exactly that.
            let rounded = |matrix: Array2<f64>| matrix.mapv(|x| f16::from_f64(x).to_f32());
            (rounded(sorted_eigen(&by_view).1), rounded(sorted_eigen(&by_light).1))
        };
        let [(v0, l0), (v1, l1), (v2, l2)] = [0, 1, 2].map(rotation);
        let (view, light) = ([v0, v1, v2], [l0, l1, l2]);
        let cores = (0..bases.ncols())
            .into_par_iter()
            .map(|r| [0, 1, 2].map(|c| view[c].t().dot(&channel_slice(bases.column(r), shape, c)).dot(&light[c])))
            .collect();
        Rotated { shape, view, light, cores }
    }

    /// Returns the number of bases.
    pub fn count(&self) -> usize {
        self.cores.len()
    }

    /// Returns the core of `basis` in `channel` at all ranks.
    pub fn core(&self, basis: usize, channel: usize) -> &Array2<f32> {
        &self.cores[basis][channel]
    }

    /// Returns the factor matrices cut to `ranks` (`[view, light]` per channel).
    pub fn factors(&self, ranks: [[usize; 2]; 3]) -> Factors {
        let cut = |matrix: &Array2<f32>, rank: usize| -> Vec<f16> {
            matrix
                .rows()
                .into_iter()
                .flat_map(|row| row.iter().take(rank).map(|x| f16::from_f32(*x)).collect::<Vec<_>>())
                .collect()
        };
        Factors {
            shape: self.shape,
            ranks,
            view: [0, 1, 2].map(|c| cut(&self.view[c], ranks[c][0])),
            light: [0, 1, 2].map(|c| cut(&self.light[c], ranks[c][1])),
        }
    }
}

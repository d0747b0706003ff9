//! Factors the residual bases over light x view: shared matrices by a weighted higher-order SVD
//! [De Lathauwer 2000] in a luma-chroma frame, and each basis' core in them.

use crate::local_pca::LocalPca;
use crate::project::sorted_eigen;
use btf_runtime::{COLOUR_FRAME, Factors};
use half::f16;
use ndarray::{Array2, ArrayView1};
use rayon::prelude::*;

/// All bases in the full rotated frame: nothing is lost yet, ranks only cut.
pub struct Rotated {
    /// Views and lights.
    pub shape: [usize; 2],
    /// Per channel the view rotation `[view, rank]`, most important rank first.
    view: [Array2<f32>; 3],
    /// Per channel the light rotation `[light, rank]`.
    light: [Array2<f32>; 3],
    /// `[cluster][basis][channel]` core `[view rank, light rank]`; basis 0 is the mean.
    cores: Vec<Vec<[Array2<f32>; 3]>>,
}

fn channel_slice(basis: ArrayView1<f32>, shape: [usize; 2], channel: usize) -> Array2<f32> {
    let frame = COLOUR_FRAME[channel];
    Array2::from_shape_fn((shape[0], shape[1]), |(v, l)| {
        let at = (v * shape[1] + l) * 3;
        (0..3).map(|c| frame[c] * basis[at + c]).sum()
    })
}

impl Rotated {
    /// Finds the rotations, weighting each basis by the energy it carries, and rotates every basis.
    pub fn new(models: &[LocalPca], shape: [usize; 2]) -> Rotated {
        let weighted: Vec<(f64, ArrayView1<f32>)> = models
            .iter()
            .flat_map(|model| {
                let mean = std::iter::once((model.count as f64, model.mean.view()));
                mean.chain(
                    model.components.columns().into_iter().enumerate().map(|(j, column)| (model.variances[j], column)),
                )
            })
            .collect();
        let rotation = |channel: usize| -> (Array2<f32>, Array2<f32>) {
            let grams: Vec<(Array2<f32>, Array2<f32>)> = weighted
                .par_iter()
                .map(|(weight, basis)| {
                    let slice = channel_slice(*basis, shape, channel) * weight.sqrt() as f32;
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
        let cores = models
            .par_iter()
            .map(|model| {
                let bases = std::iter::once(model.mean.view()).chain(model.components.columns());
                bases
                    .map(|basis| [0, 1, 2].map(|c| view[c].t().dot(&channel_slice(basis, shape, c)).dot(&light[c])))
                    .collect()
            })
            .collect();
        Rotated { shape, view, light, cores }
    }

    /// Energy of basis `index` of `cluster` in `channel` outside rank `rank` `[view, light]`, of 1 for a component.
    pub fn lost(&self, cluster: usize, index: usize, channel: usize, rank: usize) -> f64 {
        let Some(cores) = self.cores[cluster].get(index) else { return 0.0 };
        let core = &cores[channel];
        let mut lost = 0.0f64;
        for (v, row) in core.rows().into_iter().enumerate() {
            let from = if v < rank { rank.min(row.len()) } else { 0 };
            lost += row.iter().skip(from).map(|x| f64::from(*x).powi(2)).sum::<f64>();
        }
        lost
    }

    /// Factor matrices cut to `ranks` (per channel, for view and light alike, at most their counts).
    pub fn factors(&self, ranks: [usize; 3]) -> Factors {
        let cut = |matrix: &Array2<f32>, rank: usize| -> Vec<f16> {
            matrix
                .rows()
                .into_iter()
                .flat_map(|row| row.iter().take(rank).map(|x| f16::from_f32(*x)).collect::<Vec<_>>())
                .collect()
        };
        let ranks = ranks.map(|rank| [rank.min(self.shape[0]), rank.min(self.shape[1])]);
        Factors {
            shape: self.shape,
            ranks,
            view: [0, 1, 2].map(|c| cut(&self.view[c], ranks[c][0])),
            light: [0, 1, 2].map(|c| cut(&self.light[c], ranks[c][1])),
        }
    }

    /// The cores of basis `index` for all clusters, cut to `factors`; zeros for a cluster without it.
    pub fn cores(&self, factors: &Factors, index: usize) -> Vec<Vec<f32>> {
        self.cores
            .iter()
            .map(|cluster| {
                let mut core = Vec::with_capacity(factors.core_len());
                for (channel, [rv, rl]) in factors.ranks.iter().enumerate() {
                    for v in 0..*rv {
                        for l in 0..*rl {
                            core.push(cluster.get(index).map_or(0.0, |cores| cores[channel][[v, l]]));
                        }
                    }
                }
                core
            })
            .collect()
    }
}

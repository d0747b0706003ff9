//! Factorisation of the shared bases over light x view: two matrices a colour channel by a weighted higher-order SVD
//! [De Lathauwer 2000] in a luma-chroma frame, and each basis' core in them.

use crate::numeric::principal_directions::sorted_eigen;
use btf_runtime::{COLOUR_FRAME, Factors};
use half::f16;
use nalgebra::DMatrix;
use ndarray::{Array2, ArrayView1, ArrayView2, s};
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

/// Largest exponent of a factor's step: halves are multiples of 2^-24.
const MAX_EXPONENT: f64 = 24.0;

/// Factor matrices that are rounded to few digits.
pub struct RoundedFactors {
    shape: [usize; 2],
    ranks: [[usize; 2]; 3],
    view: [RoundedSide; 3],
    light: [RoundedSide; 3],
}

/// One rounded matrix.
struct RoundedSide {
    /// `[direction, rank]`.
    matrix: Array2<f32>,
    /// The matrix in the exact frame, `[exact rank, rank]`.
    frame: Array2<f32>,
    /// Pseudo-inverse of the frame, `[rank, exact rank]`.
    inverse: Array2<f32>,
}

impl RoundedFactors {
    /// Returns the core by which the rounded factors come nearest to what `core` is in the exact frame.
    pub fn nearest_core(&self, core: &Array2<f32>, channel: usize) -> Array2<f32> {
        self.view[channel].inverse.dot(core).dot(&self.light[channel].inverse.t())
    }

    /// Returns the core in the exact frame of what `core` is with the rounded factors.
    pub fn exact_core(&self, core: ArrayView2<f32>, channel: usize) -> Array2<f32> {
        self.view[channel].frame.dot(&core).dot(&self.light[channel].frame.t())
    }

    /// Returns the factors.
    pub fn factors(&self) -> Factors {
        let halves = |side: &RoundedSide| side.matrix.iter().map(|x| f16::from_f32(*x)).collect();
        Factors {
            shape: self.shape,
            ranks: self.ranks,
            view: self.view.each_ref().map(halves),
            light: self.light.each_ref().map(halves),
        }
    }
}

/// Added to the diagonal of the products of rounded columns, whose lengths are about 1.
const RIDGE: f64 = 1e-7;

/// Returns the inverse of a positive definite matrix; the identity where it is not one.
fn inverse_of_positive(matrix: &Array2<f32>) -> Array2<f32> {
    let n = matrix.nrows();
    let ridge = |i: usize, j: usize| if i == j { RIDGE } else { 0.0 };
    let found = DMatrix::from_fn(n, n, |i, j| f64::from(matrix[[i, j]]) + ridge(i, j)).cholesky();
    let inverse = found.map_or_else(|| DMatrix::identity(n, n), |cholesky| cholesky.inverse());
    Array2::from_shape_fn((n, n), |(i, j)| inverse[(i, j)] as f32)
}

fn channel_slice(basis: ArrayView1<f32>, shape: [usize; 2], channel: usize) -> Array2<f32> {
    let frame = COLOUR_FRAME[channel];
    Array2::from_shape_fn((shape[0], shape[1]), |(v, l)| {
        let at = (v * shape[1] + l) * 3;
        (0..3).map(|c| frame[c] * basis[at + c]).sum()
    })
}

/// Returns the inverse of a rotation whose entries are rounded to half precision, by two steps of Newton and Schulz from
/// its transpose.
///
/// With the transpose itself a basis would come back with a relative error of 1e-4. That is the greatest error of all
/// where values are large beside what texels differ by, as those of a bright capture in the log curve.
fn inverse_of_rotation(rotation: &Array2<f32>) -> Array2<f32> {
    let rotation = rotation.mapv(f64::from);
    let mut inverse = rotation.t().to_owned();
    for _ in 0..2 {
        let product = rotation.dot(&inverse);
        inverse = 2.0 * &inverse - inverse.dot(&product);
    }
    inverse.mapv(|x| x as f32)
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
        let [from_view, from_light] = [&view, &light].map(|rotations| rotations.each_ref().map(inverse_of_rotation));
        let cores = (0..bases.ncols())
            .into_par_iter()
            .map(|r| {
                let core =
                    |c: usize| from_view[c].dot(&channel_slice(bases.column(r), shape, c)).dot(&from_light[c].t());
                [0, 1, 2].map(core)
            })
            .collect();
        Rotated { shape, view, light, cores }
    }

    /// Replaces the bases by mixtures of them, the columns of `mixtures`, `[basis, mixture]`.
    ///
    /// Cost: `2 bases x mixtures` floating-point operations a value of a core.
    pub fn mix(&mut self, mixtures: &Array2<f32>) {
        let mut mixed: Vec<[Array2<f32>; 3]> = (0..mixtures.ncols())
            .map(|_| [0, 1, 2].map(|c| Array2::zeros((self.view[c].ncols(), self.light[c].ncols()))))
            .collect();
        for channel in 0..3 {
            let shape = (self.view[channel].ncols(), self.light[channel].ncols());
            let mut all = Array2::<f32>::zeros((self.cores.len(), shape.0 * shape.1));
            for (mut row, core) in all.rows_mut().into_iter().zip(&self.cores) {
                row.iter_mut().zip(&core[channel]).for_each(|(x, value)| *x = *value);
            }
            let all = mixtures.t().dot(&all);
            for (core, row) in mixed.iter_mut().zip(all.rows()) {
                core[channel].iter_mut().zip(row).for_each(|(value, x)| *value = *x);
            }
        }
        self.cores = mixed;
    }

    /// Returns the number of bases.
    pub fn count(&self) -> usize {
        self.cores.len()
    }

    /// Returns the core of `basis` in `channel` at all ranks.
    pub fn core(&self, basis: usize, channel: usize) -> &Array2<f32> {
        &self.cores[basis][channel]
    }

    /// Returns the factor matrices cut to `ranks` and rounded, each column to multiples of the power of two nearest to its
    /// step in `steps`, `[channel][side][rank]`.
    pub fn rounded_factors(&self, ranks: [[usize; 2]; 3], steps: &[[Vec<f64>; 2]; 3]) -> RoundedFactors {
        let rounded = [0, 1].map(|side| {
            [0, 1, 2].map(|channel| {
                let exact = [&self.view, &self.light][side][channel].view();
                let mut matrix = exact.slice(s![.., ..ranks[channel][side]]).to_owned();
                // A column has an entry of at least 1 / sqrt(directions), which must not become 0.
                let coarsest = -(0.5 * (matrix.nrows().max(1) as f64).log2()).ceil() - 2.0;
                for (mut column, step) in matrix.columns_mut().into_iter().zip(&steps[channel][side]) {
                    let step = step.log2().round().clamp(-MAX_EXPONENT, coarsest).exp2() as f32;
                    column.mapv_inplace(|x| f16::from_f32((x / step).round() * step).to_f32());
                }
                // The rounded columns in the exact frame, and what takes a core in that frame to one of theirs.
                let frame = exact.t().dot(&matrix);
                let inverse = inverse_of_positive(&matrix.t().dot(&matrix)).dot(&matrix.t().dot(&exact));
                RoundedSide { matrix, frame, inverse }
            })
        });
        let [view, light] = rounded;
        RoundedFactors { shape: self.shape, ranks, view, light }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bases_come_back_from_rounded_rotations() {
        let shape = [7, 5];
        let bases = Array2::from_shape_fn((shape[0] * shape[1] * 3, 4), |(i, j)| ((i * (j + 2)) as f32).sin() + 3.0);
        let rotated = Rotated::new(&bases, &[4.0, 3.0, 2.0, 1.0], shape);
        let largest_error = |core: &dyn Fn(usize, usize) -> Array2<f32>| {
            let errors = (0..4).flat_map(|r| (0..3).map(move |c| (r, c))).map(|(r, c)| {
                let back = rotated.view[c].dot(&core(r, c)).dot(&rotated.light[c].t());
                (back - channel_slice(bases.column(r), shape, c)).iter().fold(0.0f32, |most, x| most.max(x.abs()))
            });
            errors.fold(0.0, f32::max)
        };
        let error = largest_error(&|r, c| rotated.core(r, c).clone());
        assert!(error < 1e-5, "{error}");
        // Planted difference: transposes in place of inverses.
        let transposed = largest_error(&|r, c| {
            rotated.view[c].t().dot(&channel_slice(bases.column(r), shape, c)).dot(&rotated.light[c])
        });
        assert!(transposed > 2e-4, "{transposed}");
    }
}

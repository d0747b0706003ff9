//! The extinction matrix that has nearly the projected areas of a voxel's flakes.

use super::flakes::{DIRECTIONS, FlakeSums};
use btf_runtime::voltex::Sym3;
use nalgebra::{SMatrix, SVector};
use std::sync::OnceLock;

/// Least squares from squared projected areas to the matrix.
fn solver() -> &'static SMatrix<f64, 6, 13> {
    static SOLVER: OnceLock<SMatrix<f64, 6, 13>> = OnceLock::new();
    SOLVER.get_or_init(|| {
        let rows = SMatrix::<f64, 13, 6>::from_fn(|i, j| {
            let d = DIRECTIONS[i].as_dvec3();
            [d.x * d.x, d.y * d.y, d.z * d.z, 2.0 * d.x * d.y, 2.0 * d.x * d.z, 2.0 * d.y * d.z][j]
        });
        let gram = rows.transpose() * rows;
        gram.try_inverse().unwrap_or_default() * rows.transpose()
    })
}

/// S of flakes per volume `volume`: `d' S d` is nearly the square of what they project along d.
pub fn extinction_of(sums: &FlakeSums, volume: f32) -> Sym3 {
    let squares = SVector::<f64, 13>::from_fn(|i, _| f64::from(sums.projected[i] / volume).powi(2));
    let s = solver() * squares;
    // Noise of the fit can make it indefinite.
    Sym3(std::array::from_fn(|i| s[i] as f32)).mapped(|x| x.max(0.0))
}

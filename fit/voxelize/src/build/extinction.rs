//! Extinction matrix that has nearly the projected areas of a voxel's microflakes.

use crate::model::microflakes::{DIRECTIONS, MicroflakeSums};
use btf_runtime::voltex::Sym3;
use glam::DVec3;
use nalgebra::{SMatrix, SVector};
use std::sync::OnceLock;

/// Returns the factor of each entry of a symmetric matrix S in `d' S d`.
pub(crate) fn entries_along(d: DVec3) -> [f64; 6] {
    [d.x * d.x, d.y * d.y, d.z * d.z, 2.0 * d.x * d.y, 2.0 * d.x * d.z, 2.0 * d.y * d.z]
}

/// Returns the matrix of least squares from squared projected areas to the entries of S.
fn solver() -> &'static SMatrix<f64, 6, 13> {
    static SOLVER: OnceLock<SMatrix<f64, 6, 13>> = OnceLock::new();
    SOLVER.get_or_init(|| {
        let rows = SMatrix::<f64, 13, 6>::from_fn(|i, j| entries_along(DIRECTIONS[i].as_dvec3())[j]);
        let gram = rows.transpose() * rows;
        gram.try_inverse().unwrap_or_default() * rows.transpose()
    })
}

/// Returns S of microflakes in a space of `volume`: `d' S d` is nearly the square of the area per volume that they
/// project along d.
pub fn extinction_of(sums: &MicroflakeSums, volume: f32) -> Sym3 {
    let squares = SVector::<f64, 13>::from_fn(|i, _| f64::from(sums.projected[i] / volume).powi(2));
    let s = solver() * squares;
    // Noise of the fit can make it indefinite.
    Sym3(std::array::from_fn(|i| s[i] as f32)).mapped(|x| x.max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::microflakes::MicroflakeColour;
    use crate::rays::projection::spread_directions;

    fn of_normals(normals: &[glam::Vec3]) -> MicroflakeSums {
        let mut sums = MicroflakeSums::default();
        normals.iter().for_each(|n| sums.add(&MicroflakeSums::microflake(1.0, *n, &MicroflakeColour::default())));
        sums
    }

    #[test]
    fn one_microflake_and_microflakes_of_all_directions_project_what_they_are() {
        for n in spread_directions(20, 0.7) {
            let s = extinction_of(&of_normals(&[n]), 0.5);
            for d in spread_directions(33, 0.1) {
                let projected = s.form(d.to_array(), d.to_array()).max(0.0).sqrt();
                // 1 per half a volume.
                assert!((projected - 2.0 * n.dot(d).abs()).abs() < 2e-3, "{projected} {}", n.dot(d));
            }
        }
        let all = spread_directions(2000, 0.0);
        let s = extinction_of(&of_normals(&all), 2000.0);
        let along = |d: glam::Vec3| s.form(d.to_array(), d.to_array()).sqrt();
        assert!(spread_directions(9, 0.4).into_iter().all(|d| (along(d) - 0.5).abs() < 2e-3));
        // Planted: microflakes of one direction only do not.
        let flat = extinction_of(&of_normals(&[glam::Vec3::Z; 2]), 2.0);
        assert!((flat.form([1.0, 0.0, 0.0], [1.0, 0.0, 0.0]).max(0.0).sqrt() - 0.5).abs() > 0.4);
    }
}

//! Surfaces as facets: sheets, meshes, and the ground of fur.

use std::f64::consts::{PI, TAU};

use btf_models::read_model;
use btf_models::shapes::{Point, UpAxis};
use glam::{DVec2, DVec3, Vec3};
use std::path::Path;

use super::canvas::{CLOSED, Facet};
use crate::error::VoxelizeError;
use crate::model::triangle_model::is_closed;

/// Pieces of a sphere from pole to pole; twice as many around.
const SPHERE_PIECES: usize = 64;

/// Returns the facets between a sheet's rows of points, with u along the rows and v from row to row.
pub fn sheet_facets(rows_m: &[Vec<Point>]) -> Vec<Facet> {
    let vertex = |row: usize, i: usize| {
        let points = &rows_m[row];
        // The tip of a fan is in the middle.
        let u = if points.len() == 1 { 0.5 } else { i as f64 / (points.len() - 1) as f64 };
        (DVec3::from(points[i]), DVec2::new(u, row as f64 / (rows_m.len() - 1) as f64))
    };
    let facet = |corners: [(usize, usize); 3]| {
        let vertices = corners.map(|(row, i)| vertex(row, i));
        Facet { corners_m: vertices.map(|(place, _)| place), uvs: Some(vertices.map(|(_, uv)| uv)) }
    };
    let mut facets = Vec::new();
    for row in 1..rows_m.len() {
        let (below, above) = (row - 1, row);
        match (rows_m[below].len(), rows_m[above].len()) {
            (1, count) => facets.extend((1..count).map(|i| facet([(below, 0), (above, i), (above, i - 1)]))),
            (count, 1) => facets.extend((1..count).map(|i| facet([(below, i - 1), (below, i), (above, 0)]))),
            (count, _) => facets.extend((1..count).flat_map(|i| {
                let [b, c, d, a] = [(below, i - 1), (below, i), (above, i), (above, i - 1)];
                [facet([b, c, d]), facet([b, d, a])]
            })),
        }
    }
    facets
}

/// Returns the facets of a mesh's file, with the share of their area that counts: [`CLOSED`] where its parts are.
///
/// # Errors
/// As [`read_model`].
pub fn mesh_facets(path: &Path, up: UpAxis) -> Result<Vec<(Facet, f64)>, VoxelizeError> {
    let mut facets = Vec::new();
    for mesh in read_model(path)? {
        for part in &mesh.parts {
            let weight = if is_closed(part) { CLOSED } else { 1.0 };
            for place in mesh.places.iter().map(|place| place.as_dmat4()) {
                facets.extend(part.triangles.iter().map(|triangle| {
                    let corner = |i: u32| {
                        let p = place.transform_point3(Vec3::from(part.positions[i as usize]).as_dvec3());
                        if up == UpAxis::Y { DVec3::new(p.x, -p.z, p.y) } else { p }
                    };
                    let uv = |uvs: &Vec<[f32; 2]>| triangle.map(|i| DVec2::from(uvs[i as usize].map(f64::from)));
                    (Facet { corners_m: triangle.map(corner), uvs: part.uvs.as_ref().map(uv) }, weight)
                }));
            }
        }
    }
    Ok(facets)
}

/// Returns the triangles of a sphere.
pub fn sphere_triangles(centre: DVec3, radius: f64) -> Vec<[DVec3; 3]> {
    let point = |row: usize, column: usize| {
        let (sin, cos) = (PI * row as f64 / SPHERE_PIECES as f64).sin_cos();
        let (y, x) = (TAU * column as f64 / (2 * SPHERE_PIECES) as f64).sin_cos();
        centre + radius * DVec3::new(sin * x, sin * y, cos)
    };
    let mut triangles = Vec::new();
    for row in 0..SPHERE_PIECES {
        for column in 0..2 * SPHERE_PIECES {
            let [a, b] = [point(row, column), point(row, column + 1)];
            let [c, d] = [point(row + 1, column), point(row + 1, column + 1)];
            triangles.extend([[a, c, d], [a, d, b]]);
        }
    }
    triangles
}

/// Returns the triangles of a box.
pub fn box_triangles(least: DVec3, most: DVec3) -> Vec<[DVec3; 3]> {
    let mut triangles = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in [least, most] {
            let corner = |du: DVec3, dv: DVec3| {
                let mut at = side;
                (at[u], at[v]) = (du[u], dv[v]);
                at
            };
            let [a, b, c, d] = [corner(least, least), corner(most, least), corner(most, most), corner(least, most)];
            triangles.extend(if side == most { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] });
        }
    }
    triangles
}

//! A chart: a surface over the unit square, sampled on a grid.

use crate::geometry::geometry::Vertex;
use crate::scene::mesh::{MeshPart, fill_tangents};
use glam::Vec3;
use std::ops::Range;

/// Metres that one unit of texture coordinate covers.
pub(crate) const TILE_M: f32 = 0.1;

/// A surface `position(s, t)` over the unit square; `d/ds x d/dt` points outwards.
pub(crate) struct Patch<F> {
    /// Cells along s and t.
    pub cells: [u32; 2],
    /// Whether s = 0 and s = 1 are the same curve.
    pub closed: bool,
    /// Metres.
    pub position: F,
}

impl<F: Fn(f32, f32) -> Vec3> Patch<F> {
    /// Makes a part of the whole surface.
    pub(crate) fn whole(&self, name: &str) -> MeshPart {
        self.part(name, &[(0..self.cells[0], 0..self.cells[1])])
    }

    /// Makes a part of the cells within any of some ranges along s and t.
    pub(crate) fn part(&self, name: &str, ranges: &[(Range<u32>, Range<u32>)]) -> MeshPart {
        let [columns, rows] = self.cells;
        let at = |i: u32, j: u32| (self.position)(i as f32 / columns as f32, j as f32 / rows as f32);
        // v grows along the columns' mean length; u along each row from its middle, so that rows of any length have the
        // same density.
        let mut v = vec![0.0f32];
        for j in 0..rows {
            let length = (0..columns).map(|i| at(i, j).distance(at(i, j + 1))).sum::<f32>() / columns as f32;
            v.push(v[j as usize] + length / TILE_M);
        }
        let mut vertices = Vec::with_capacity((columns as usize + 1) * (rows as usize + 1));
        for j in 0..=rows {
            let mut u = vec![0.0f32];
            (0..columns).for_each(|i| u.push(u[i as usize] + at(i, j).distance(at(i + 1, j)) / TILE_M));
            let middle = 0.5 * u[columns as usize];
            for i in 0..=columns {
                vertices.push(Vertex {
                    position: at(i, j).to_array(),
                    u: u[i as usize] - middle,
                    normal: self.normal(i as f32 / columns as f32, j as f32 / rows as f32).to_array(),
                    v: v[j as usize],
                    tangent: [1.0, 0.0, 0.0, 1.0],
                });
            }
        }
        let mut triangles = Vec::new();
        for (j, i) in (0..rows).flat_map(|j| (0..columns).map(move |i| (j, i))) {
            if ranges.iter().any(|(along_s, along_t)| along_s.contains(&i) && along_t.contains(&j)) {
                let a = j * (columns + 1) + i;
                let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        fill_tangents(&mut vertices, &triangles);
        without_unused_vertices(MeshPart::built_in(name, vertices, triangles))
    }

    /// Estimates the normal by differences over a grid cell, across the seam of a closed surface.
    fn normal(&self, s: f32, t: f32) -> Vec3 {
        let [ds, dt] = self.cells.map(|cells| 0.5 / cells as f32);
        let along_s = if self.closed {
            (self.position)((s + ds).rem_euclid(1.0), t) - (self.position)((s - ds).rem_euclid(1.0), t)
        } else {
            (self.position)((s + ds).min(1.0), t) - (self.position)((s - ds).max(0.0), t)
        };
        let along_t = (self.position)(s, (t + dt).min(1.0)) - (self.position)(s, (t - dt).max(0.0));
        unit_normal(along_s, along_t)
    }
}

/// The unit normal of a surface with these tangents; up where they have no area.
pub(super) fn unit_normal(along_s: Vec3, along_t: Vec3) -> Vec3 {
    along_s.cross(along_t).normalize_or(Vec3::Y)
}

fn without_unused_vertices(mut part: MeshPart) -> MeshPart {
    let mut numbers = vec![u32::MAX; part.vertices.len()];
    let mut kept = Vec::new();
    for index in part.triangles.iter_mut().flatten() {
        let number = &mut numbers[*index as usize];
        if *number == u32::MAX {
            *number = kept.len() as u32;
            kept.push(part.vertices[*index as usize]);
        }
        *index = *number;
    }
    part.vertices = kept;
    part
}

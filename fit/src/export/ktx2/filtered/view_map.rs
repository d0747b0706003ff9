//! A table that finds the triangle of measured views around a direction.

use btf_runtime::{DIRECTION_WORDS, EDGE_WORDS, SPHERE_HEADER_WORDS, Sphere, TRIANGLE_WORDS};

/// Cells a side of the table over the disk.
pub const CELLS: usize = 64;
/// Twice the area below which three views count as on a line.
const MIN_AREA: f32 = 1e-9;

/// Returns for each cell, row by row with y growing, the three views whose triangle holds the cell's middle or, beyond
/// all triangles, comes nearest to it. A cell with a measured view in it has a triangle of that view. Where views have no
/// triangles, because they are few or on a line, the last two of three are the same.
///
/// A direction is looked up by its x and y; its weights are those of [`weights_in`] in its cell's triangle.
pub fn triangles_of_cells(views: &Sphere) -> Vec<[u32; 3]> {
    let triangles = triangles(views);
    let mut views_of_cell = vec![Vec::new(); CELLS * CELLS];
    (0..views.len() as u32).for_each(|id| views_of_cell[cell_of(views.direction(id))].push(id));
    (0..CELLS * CELLS)
        .map(|cell| {
            let p = [cell % CELLS, cell / CELLS].map(|i| (i as f32 + 0.5) / CELLS as f32 * 2.0 - 1.0);
            let length = p[0].hypot(p[1]).max(1.0);
            let p = p.map(|x| x / length);
            let missed = |ids: &[u32; 3]| {
                let corners = ids.map(|id| views.direction(id));
                let weights = weights_in(p, corners);
                let q = [0, 1].map(|axis| (0..3).map(|i| weights[i] * corners[i][axis]).sum::<f32>());
                (q[0] - p[0]).hypot(q[1] - p[1])
            };
            let within = |ids: &&[u32; 3]| views_of_cell[cell].iter().filter(|id| ids.contains(id)).count();
            let most = triangles.iter().map(|ids| within(&ids)).max().unwrap_or(0);
            let candidates = triangles.iter().filter(|ids| within(ids) == most);
            *candidates.min_by(|a, b| missed(a).total_cmp(&missed(b))).unwrap_or(&[0; 3])
        })
        .collect()
}

/// Returns the cell of a direction.
pub fn cell_of(direction: [f32; 3]) -> usize {
    let [column, row] = [direction[0], direction[1]].map(|x| ((x * 0.5 + 0.5) * CELLS as f32) as usize);
    row.min(CELLS - 1) * CELLS + column.min(CELLS - 1)
}

/// Returns the triangles of `views`; without any the edges, and without these a single view.
fn triangles(views: &Sphere) -> Vec<[u32; 3]> {
    let words = views.words();
    let [n, triangles, edges] = [0, 1, 2].map(|i| words[i] as usize);
    let first = SPHERE_HEADER_WORDS + n * DIRECTION_WORDS;
    let row = |at: usize, ids: [usize; 3]| ids.map(|i| words[at + i]);
    if triangles > 0 {
        return (0..triangles).map(|number| row(first + number * TRIANGLE_WORDS, [6, 7, 8])).collect();
    }
    let first = first + triangles * TRIANGLE_WORDS;
    (0..edges).map(|number| row(first + number * EDGE_WORDS, [5, 6, 6])).collect()
}

/// Returns the weights of a triangle's corners at `p`, none of them negative; of three corners on a line, those of the point of
/// the first two's line that is nearest.
pub fn weights_in(p: [f32; 2], [a, b, c]: [[f32; 3]; 3]) -> [f32; 3] {
    let ([ex, ey], [fx, fy], [px, py]) =
        ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let area = ex * fy - ey * fx;
    if area.abs() < MIN_AREA {
        let along = ((px * ex + py * ey) / (ex * ex + ey * ey).max(MIN_AREA)).clamp(0.0, 1.0);
        return [1.0 - along, along, 0.0];
    }
    let (w1, w2) = ((px * fy - py * fx) / area, (ex * py - ey * px) / area);
    let weights = [1.0 - w1 - w2, w1, w2].map(|w| w.max(0.0));
    let sum: f32 = weights.iter().sum();
    weights.map(|w| w / sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_capture::DirectionSet;

    #[test]
    fn interpolation_by_cells_is_that_of_the_triangles() {
        let units: Vec<[f32; 3]> = DirectionSet::bonn81().units();
        let views = Sphere::new(&units).unwrap();
        let cells = triangles_of_cells(&views);
        let value = |id: u32| f64::from((id * 37 % 11) as f32 / 11.0);
        let (mut sum, mut count, mut other) = (0.0f64, 0.0, 0.0);
        for i in 0..2000u32 {
            let z = 0.3 + 0.7 * (i as f32 + 0.5) / 2000.0;
            let (sin, cos) = (i as f32 * 2.4).sin_cos();
            let direction = [(1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z];
            let cell = [direction[0], direction[1]].map(|x| ((x * 0.5 + 0.5) * CELLS as f32) as usize);
            let ids = cells[cell[1] * CELLS + cell[0]];
            let weights = weights_in([direction[0], direction[1]], ids.map(|id| views.direction(id)));
            let read: f64 = (0..3).map(|i| f64::from(weights[i]) * value(ids[i])).sum();
            let place = views.locate(direction);
            let wanted: f64 = (0..3).map(|i| f64::from(place.weights[i]) * value(place.ids[i])).sum();
            sum += (read - wanted).powi(2);
            // Planted: the cell beside it.
            let ids = cells[(cell[1] + 3).min(CELLS - 1) * CELLS + cell[0]];
            let weights = weights_in([direction[0], direction[1]], ids.map(|id| views.direction(id)));
            other += ((0..3).map(|i| f64::from(weights[i]) * value(ids[i])).sum::<f64>() - wanted).powi(2);
            count += 1.0;
        }
        let [error, other] = [sum, other].map(|sum| (sum / count).sqrt());
        assert!(error < 0.03 && other > 3.0 * error, "{error} {other}");
        for id in 0..81 {
            let direction = views.direction(id);
            let cell = [direction[0], direction[1]].map(|x| (((x * 0.5 + 0.5) * CELLS as f32) as usize).min(CELLS - 1));
            let ids = cells[cell[1] * CELLS + cell[0]];
            let weights = weights_in([direction[0], direction[1]], ids.map(|id| views.direction(id)));
            let at = ids.iter().position(|other| *other == id);
            assert!(at.is_some_and(|at| weights[at] > 0.999), "{id}: {ids:?} {weights:?}");
        }
    }

    #[test]
    fn a_single_view_and_views_on_a_line_have_weights_too() {
        let unit = |degrees: f64| [degrees.to_radians().sin() as f32, 0.0, degrees.to_radians().cos() as f32];
        let one = Sphere::new(&[unit(0.0)]).unwrap();
        let line = Sphere::new(&[unit(0.0), unit(30.0), unit(60.0)]).unwrap();
        for (views, at, wanted) in [(&one, unit(40.0), 0.0), (&line, unit(30.0), 0.5), (&line, unit(-80.0), 0.0)] {
            let ids = triangles_of_cells(views)[cell_of(at)];
            let corners = ids.map(|id| views.direction(id));
            let weights = weights_in([at[0], at[1]], corners);
            assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{weights:?}");
            let x: f32 = (0..3).map(|i| weights[i] * corners[i][0]).sum();
            assert!((x - wanted).abs() < 1e-6, "{ids:?} {weights:?} {x}");
        }
    }

    #[test]
    fn each_of_many_views_has_a_triangle_of_its_own_in_its_cell() {
        let views = Sphere::new(&DirectionSet::random(196, 1).unwrap().units()).unwrap();
        let cells = triangles_of_cells(&views);
        for id in 0..196 {
            assert!(cells[cell_of(views.direction(id))].contains(&id), "{id}");
        }
    }
}

//! Height field on a grid: heights and slopes, rays that march over it, and the visibility of a lamp from its nodes.

use rayon::prelude::*;

use crate::surface::grid::Grid;

/// Longest step of a march, in cells of the grid.
const STEP_CELLS: f32 = 0.75;

/// Halvings of the last step of a march to the surface.
const REFINEMENTS: usize = 6;

/// Angular radius of the lamp in radians (half a degree).
const LAMP_RADIUS_RAD: f32 = 0.00873;

/// One face of a patch as heights over its reference plane. Lengths are in millimetres, the origin is the lower left
/// corner of the patch, x points to the right, y up, z out of the face, and the mean height over the patch is 0. A
/// margin around the patch holds what oblique views and shadows reach.
///
/// The far face of a thin sheet is a second height field on the same grid, in the same lateral frame, with z out of
/// that face: directions then change the sign of z and nothing else.
#[derive(Debug, Clone)]
pub struct HeightField {
    pub(crate) grid: Grid,
    size_mm: f32,
    height_mm: Vec<f32>,
    /// Slopes dz/dx, dz/dy.
    slopes: Vec<[f32; 2]>,
    lowest_mm: f32,
    highest_mm: f32,
}

/// Share of the lamp that each node of a height field sees.
#[derive(Debug, Clone)]
pub struct LightVisibility {
    /// Share of the lamp per node, 0 to 255.
    pub(crate) share: Vec<u8>,
}

impl HeightField {
    /// Returns the height field of heights in millimetres at the nodes of `grid`, moved to mean height 0 over the patch
    /// of `size_mm`. Slopes are central differences.
    pub(crate) fn new(grid: Grid, size_mm: f32, mut height_mm: Vec<f32>) -> HeightField {
        // Summed in order, so threads do not matter.
        let inside = |node: usize| {
            let p = grid.position_mm(node % grid.side, node / grid.side);
            p.iter().all(|x| (0.0..=size_mm).contains(x))
        };
        let (sum, count) = (0..grid.len())
            .filter(|&node| inside(node))
            .fold((0f64, 0usize), |(sum, count), node| (sum + f64::from(height_mm[node]), count + 1));
        let mean = (sum / count as f64) as f32;
        for height in &mut height_mm {
            *height -= mean;
        }
        let at = |column: usize, row: usize| height_mm[row * grid.side + column];
        let slopes = (0..grid.len())
            .into_par_iter()
            .map(|node| {
                let (column, row) = (node % grid.side, node / grid.side);
                let (left, right) = (column.saturating_sub(1), (column + 1).min(grid.side - 1));
                let (below, above) = (row.saturating_sub(1), (row + 1).min(grid.side - 1));
                [
                    (at(right, row) - at(left, row)) / ((right - left) as f32 * grid.cell_mm),
                    (at(column, above) - at(column, below)) / ((above - below) as f32 * grid.cell_mm),
                ]
            })
            .collect();
        let lowest_mm = height_mm.iter().copied().fold(f32::MAX, f32::min);
        let highest_mm = height_mm.iter().copied().fold(f32::MIN, f32::max);
        HeightField { grid, size_mm, height_mm, slopes, lowest_mm, highest_mm }
    }

    /// Returns the width and height of the patch in millimetres.
    pub fn size_mm(&self) -> f32 {
        self.size_mm
    }

    /// Returns the lowest and highest node in millimetres, margin included.
    pub fn range_mm(&self) -> [f32; 2] {
        [self.lowest_mm, self.highest_mm]
    }

    /// Returns the height in millimetres at a position in millimetres.
    pub fn height_mm(&self, position_mm: [f32; 2]) -> f32 {
        self.grid.corners(self.grid.cells(position_mm)).sample(&self.height_mm)
    }

    /// Returns the unit normal at a position in millimetres.
    pub fn normal(&self, position_mm: [f32; 2]) -> [f32; 3] {
        self.normal_at(self.grid.cells(position_mm))
    }

    /// Returns the heights at the middles of `size` x `size` texels, `[row, column]`, row 0 at the top, as they are
    /// saved beside a capture.
    pub fn height_map_mm(&self, size: usize) -> Vec<f32> {
        let texel_mm = self.size_mm / size as f32;
        (0..size * size)
            .map(|texel| {
                let (column, row) = ((texel % size) as f32 + 0.5, (texel / size) as f32 + 0.5);
                self.height_mm([column * texel_mm, self.size_mm - row * texel_mm])
            })
            .collect()
    }

    /// Returns the unit normal at a place on the grid in cells.
    #[inline]
    pub(crate) fn normal_at(&self, place: [f32; 2]) -> [f32; 3] {
        let [slope_x, slope_y] = self.grid.corners(place).sample_all(&self.slopes);
        let scale = 1.0 / (1.0 + slope_x * slope_x + slope_y * slope_y).sqrt();
        [-slope_x * scale, -slope_y * scale, scale]
    }

    /// Marches from the top of the heights down along the ray that passes the reference plane at `start` (in cells)
    /// towards `wo`, to the first surface point. Returns its place in cells.
    pub(crate) fn march_down(&self, start: [f32; 2], wo: [f32; 3]) -> [f32; 2] {
        // Way on the grid per millimetre of height.
        let drift = [wo[0] / wo[2] / self.grid.cell_mm, wo[1] / wo[2] / self.grid.cell_mm];
        let at = |z: f32| [start[0] + drift[0] * z, start[1] + drift[1] * z];
        let above = |z: f32| z > self.grid.corners(at(z)).sample(&self.height_mm);
        let depth = self.highest_mm - self.lowest_mm;
        let way = (drift[0] * drift[0] + drift[1] * drift[1]).sqrt() * depth;
        let steps = (way / STEP_CELLS).ceil().max(1.0);
        let mut free = self.highest_mm;
        let mut blocked = self.lowest_mm;
        for i in 1..=steps as usize {
            let z = self.highest_mm - depth * (i as f32 / steps);
            if !above(z) {
                blocked = z;
                break;
            }
            free = z;
        }
        for _ in 0..REFINEMENTS {
            let middle = 0.5 * (free + blocked);
            if above(middle) { free = middle } else { blocked = middle }
        }
        at(0.5 * (free + blocked))
    }

    /// Marches from the surface at `place` (in cells) along `direction` (unit) to where the ray meets the surface
    /// again. Returns its place in cells, or `None` where the ray escapes upwards or past the edge.
    pub(crate) fn march_out(&self, place: [f32; 2], direction: [f32; 3]) -> Option<[f32; 2]> {
        let sin = (direction[0] * direction[0] + direction[1] * direction[1]).sqrt();
        if sin < 1e-5 {
            return None;
        }
        let drift = [direction[0] / sin, direction[1] / sin];
        let rise_mm = direction[2] / sin * self.grid.cell_mm;
        let last = (self.grid.side - 1) as f32;
        let start_mm = self.grid.corners(place).sample(&self.height_mm) + 1e-3 * self.grid.cell_mm;
        let at = |way: f32| [place[0] + drift[0] * way, place[1] + drift[1] * way];
        let above = |way: f32| start_mm + rise_mm * way > self.grid.corners(at(way)).sample(&self.height_mm);
        let mut way = 0.0;
        loop {
            way += STEP_CELLS;
            let [x, y] = at(way);
            if start_mm + rise_mm * way > self.highest_mm || x < 0.0 || y < 0.0 || x > last || y > last {
                return None;
            }
            if !above(way) {
                break;
            }
        }
        let (mut free, mut blocked) = (way - STEP_CELLS, way);
        for _ in 0..REFINEMENTS {
            let middle = 0.5 * (free + blocked);
            if above(middle) { free = middle } else { blocked = middle }
        }
        Some(at(0.5 * (free + blocked)))
    }

    /// Returns the share of the lamp that a node sees, from the clearance between the heights and the ray to the middle
    /// of the lamp.
    fn march_up(&self, column: usize, row: usize, wi: [f32; 3]) -> f32 {
        let sin2 = wi[0] * wi[0] + wi[1] * wi[1];
        if sin2 < 1e-10 {
            return 1.0;
        }
        let sin = sin2.sqrt();
        let step = [wi[0] / sin * STEP_CELLS, wi[1] / sin * STEP_CELLS];
        let step_mm = STEP_CELLS * self.grid.cell_mm;
        let rise_mm = step_mm * wi[2] / sin;
        let mut height = self.height_mm[row * self.grid.side + column];
        let mut place = [column as f32, row as f32];
        let mut away_mm = 0.0;
        // Smallest angle between the way to the lamp and the relief's edge, seen from the node.
        let mut clearance = f32::MAX;
        loop {
            place = [place[0] + step[0], place[1] + step[1]];
            height += rise_mm;
            away_mm += step_mm;
            if height > self.highest_mm + away_mm * LAMP_RADIUS_RAD / sin2 {
                break;
            }
            let gap_mm = height - self.grid.corners(place).sample(&self.height_mm);
            clearance = clearance.min(gap_mm * sin2 / away_mm);
            if clearance < -LAMP_RADIUS_RAD {
                return 0.0;
            }
        }
        let t = ((clearance + LAMP_RADIUS_RAD) / (2.0 * LAMP_RADIUS_RAD)).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    }
}

impl LightVisibility {
    /// Marches from every node of the grid of `field` towards the light `wi` (unit, in front of the face of the field),
    /// on the calling thread.
    pub fn new(field: &HeightField, wi: [f32; 3]) -> LightVisibility {
        let side = field.grid.side;
        let share = (0..field.grid.len())
            .map(|node| (field.march_up(node % side, node / side, wi) * 255.0 + 0.5) as u8)
            .collect();
        LightVisibility { share }
    }

    /// Returns the share of the lamp, 0 to 1, seen from a position in millimetres of `field`, which must be the one
    /// that this visibility was computed for.
    pub fn share_at(&self, field: &HeightField, position_mm: [f32; 2]) -> f32 {
        field.grid.corners(field.grid.cells(position_mm)).sample_share(&self.share)
    }

    /// Returns the size in bytes of the visibility of one light for this field.
    pub(crate) fn bytes(field: &HeightField) -> usize {
        field.grid.len()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use btf_capture::Direction;

    use super::*;

    /// Returns a height field of 20 x 20 mm on a grid of 0.15625 mm, from its height in millimetres over the position.
    pub(crate) fn shaped(height: impl Fn([f32; 2]) -> f32) -> HeightField {
        let grid = Grid::new(20.0, 20.0 / 128.0, 3.3);
        let heights =
            (0..grid.len()).map(|node| height(grid.position_mm(node % grid.side, node / grid.side))).collect();
        HeightField::new(grid, 20.0, heights)
    }

    /// Returns a wall along y of 0.4 mm height and 1 mm width in the middle of the patch.
    fn wall() -> HeightField {
        shaped(|p| if (p[0] - 10.0).abs() < 0.5 { 0.4 } else { 0.0 })
    }

    #[test]
    fn a_wall_throws_a_shadow_of_the_right_length_to_the_side_away_from_the_light() {
        let wall = wall();
        // From the right (+x) at 60 degrees: 0.4 mm * tan 60 = 0.69 mm of shadow to the left.
        let visible = LightVisibility::new(&wall, Direction::new(60.0, 0.0).unit());
        for y in [3.0, 12.3] {
            assert!(visible.share_at(&wall, [9.5 - 0.35, y]) < 0.05, "in the shadow");
            assert!(visible.share_at(&wall, [9.5 - 1.3, y]) > 0.95, "beyond it");
            assert!(visible.share_at(&wall, [10.5 + 0.5, y]) > 0.95, "on the lit side");
        }
        let noon = LightVisibility::new(&wall, [0.0, 0.0, 1.0]);
        assert_eq!(noon.share_at(&wall, [9.3, 5.0]), 1.0);
    }

    #[test]
    fn a_grazing_view_sees_the_wall_shifted_and_not_what_it_hides() {
        let wall = wall();
        let wo = Direction::new(60.0, 0.0).unit();
        // The eye stands to the right: the ray through a point of the reference plane left of the
        // wall meets it. The ground lies a little below the reference plane, the mean height.
        let drift = -wall.height_mm([5.0, 5.0]) * 60f32.to_radians().tan();
        let place = |x: f32| {
            wall.march_down(wall.grid.cells([x, 10.0]), wo)[0] * wall.grid.cell_mm - wall.grid.margin_mm + drift
        };
        assert!((place(5.0) - 5.0).abs() < 0.02, "plain ground");
        assert!((place(9.3) - (9.3 + 0.4 * 60f32.to_radians().tan())).abs() < 0.1, "the wall's top: {}", place(9.3));
        assert!((place(11.0) - 11.0).abs() < 0.02, "the ground on the eye's side");
        assert!((place(9.5 - 0.35) - 9.5).abs() < 0.35, "the hidden ground is not seen: {}", place(9.15));
    }

    #[test]
    fn the_height_map_is_the_relief_at_the_texels_with_the_top_row_first() {
        let plane = shaped(|p| 0.3 * p[0] - 0.2 * p[1]);
        let map = plane.height_map_mm(16);
        for (texel, expected) in [(0, [0.625, 19.375]), (15, [19.375, 19.375]), (240, [0.625, 0.625])] {
            assert!((map[texel] - plane.height_mm(expected)).abs() < 1e-4);
        }
        assert!(map.iter().sum::<f32>().abs() < 1e-2, "mean height 0");
        assert!(map[240] > map[0], "y points up");
    }
}

//! A regular grid of values over a patch and its margin, sampled bilinearly.

use btf_capture::DirectionSet;

/// Number of nodes of a patch's grid per texel and axis.
const NODES_PER_TEXEL: f32 = 2.0;

/// Largest number of nodes along a side; a leaf takes some 150 bytes per node while it is generated.
pub(crate) const MAX_SIDE: usize = 8192;

/// Polar angle in degrees up to which margins suffice; steeper rays read the edge.
const MARGIN_THETA_DEG: f64 = 82.0;

/// Margin beyond that for the parallax of the view, in millimetres, for shadows from outside.
const SHADOW_MARGIN_MM: f32 = 1.0;

/// Positions of the nodes of a field. Lengths are in millimetres, the origin is the lower left corner of the patch, x
/// points to the right, y up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Grid {
    /// Number of nodes along x and along y.
    pub side: usize,
    /// Distance between nodes in millimetres.
    pub cell_mm: f32,
    /// Distance of the first node from the origin, to the left and below, in millimetres.
    pub margin_mm: f32,
}

impl Grid {
    /// Returns a grid over a square patch of `size_mm` with at least `margin_mm` around it.
    pub fn new(size_mm: f32, cell_mm: f32, margin_mm: f32) -> Grid {
        let margin_cells = (margin_mm / cell_mm).ceil();
        let side = (size_mm / cell_mm).round() as usize + 2 * margin_cells as usize + 1;
        Grid { side, cell_mm, margin_mm: margin_cells * cell_mm }
    }

    /// Returns the grid of heights for a square patch, `size` texels and `size_mm` long on each side. The grid
    /// continues beyond the patch by what the steepest of `views` sees across heights within `relief_bound_mm` of
    /// their mean.
    pub fn for_patch(size: usize, size_mm: f32, relief_bound_mm: f32, views: &DirectionSet) -> Grid {
        let steepest = views.directions().iter().map(|d| d.theta_deg).fold(0.0, f64::max);
        let slope = steepest.min(MARGIN_THETA_DEG).to_radians().tan() as f32;
        let texel_mm = size_mm / size as f32;
        Grid::new(size_mm, texel_mm / NODES_PER_TEXEL, relief_bound_mm * slope + SHADOW_MARGIN_MM)
    }

    /// Returns the grid of every `stride`-th node.
    pub fn coarse(&self, stride: usize) -> Grid {
        Grid {
            side: ((self.side - 1) / stride + 1).max(2),
            cell_mm: self.cell_mm * stride as f32,
            margin_mm: self.margin_mm,
        }
    }

    /// Returns the position of a node in millimetres.
    pub fn position_mm(&self, column: usize, row: usize) -> [f32; 2] {
        [column as f32 * self.cell_mm - self.margin_mm, row as f32 * self.cell_mm - self.margin_mm]
    }

    /// Returns the place in cells from the first node, of a position in millimetres.
    #[inline]
    pub fn cells(&self, position_mm: [f32; 2]) -> [f32; 2] {
        position_mm.map(|x| (x + self.margin_mm) / self.cell_mm)
    }

    /// Returns the number of nodes.
    pub fn len(&self) -> usize {
        self.side * self.side
    }

    /// Returns the four nodes around a place and their weights; places outside are moved to the edge.
    #[inline]
    pub fn corners(&self, place: [f32; 2]) -> Corners {
        let last = (self.side - 1) as f32;
        // Just below the last node, so that the cell to the right exists.
        let x = place[0].clamp(0.0, last - 1e-3);
        let y = place[1].clamp(0.0, last - 1e-3);
        let (column, row) = (x as usize, y as usize);
        let (fx, fy) = (x - column as f32, y - row as f32);
        Corners {
            first: row * self.side + column,
            side: self.side,
            weights: [(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy],
        }
    }
}

/// Cell of a grid, with bilinear weights of its nodes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Corners {
    first: usize,
    side: usize,
    weights: [f32; 4],
}

impl Corners {
    #[inline]
    fn nodes(&self) -> [usize; 4] {
        [self.first, self.first + 1, self.first + self.side, self.first + self.side + 1]
    }

    /// Returns the interpolated value of one field.
    #[inline]
    pub fn sample(&self, values: &[f32]) -> f32 {
        let nodes = self.nodes();
        (0..4).map(|i| self.weights[i] * values[nodes[i]]).sum()
    }

    /// Returns the interpolated value of a field of shares, 0 to 255 standing for 0 to 1.
    #[inline]
    pub fn sample_share(&self, values: &[u8]) -> f32 {
        let nodes = self.nodes();
        let sum: f32 = (0..4).map(|i| self.weights[i] * f32::from(values[nodes[i]])).sum();
        sum * (1.0 / 255.0)
    }

    /// Returns the interpolated value of a field of several channels.
    #[inline]
    pub fn sample_all<const N: usize>(&self, values: &[[f32; N]]) -> [f32; N] {
        let nodes = self.nodes();
        std::array::from_fn(|channel| (0..4).map(|i| self.weights[i] * values[nodes[i]][channel]).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_is_sampled_exactly_inside_and_held_outside() {
        let grid = Grid::new(2.0, 0.25, 0.6);
        let plane: Vec<f32> = (0..grid.len())
            .map(|node| {
                let [x, y] = grid.position_mm(node % grid.side, node / grid.side);
                3.0 * x - 2.0 * y
            })
            .collect();
        for (x, y) in [(0.0, 0.0), (1.99, 0.4), (-0.7, 2.3), (1.1, 1.3)] {
            let value = grid.corners(grid.cells([x, y])).sample(&plane);
            assert!((value - (3.0 * x - 2.0 * y)).abs() < 1e-4, "{x} {y}: {value}");
        }
        let outside = grid.corners(grid.cells([99.0, 0.0])).sample(&plane);
        let edge = grid.corners(grid.cells([2.75, 0.0])).sample(&plane);
        assert!((outside - edge).abs() < 0.01);
    }
}

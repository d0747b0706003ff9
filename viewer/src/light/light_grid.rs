//! Draws point lights by about what each adds at a place: a grid over the scene [Boksansky 2021] has for each of its cells a
//! light cut [Walter 2005], ranges of neighbouring lights with their shares. Twin: `light_grid.wgsl`.

use crate::geometry::bvh_node::Bounds;
use crate::light::light_tree::{LightTree, TreeLight};
use glam::Vec3;
use rayon::prelude::*;

/// Cells of a grid at most: 512 KiB with the ranges of each.
const MAX_GRID_CELLS: usize = 1024;
/// Cells along a side of the grid at most.
const MAX_CELLS_ALONG: f32 = 64.0;
/// Factor by which cells grow until there are few enough.
const CELL_GROWTH: f32 = 1.05;
/// Ranges of lights of a cell at most; a further pair of numbers tells where the last one ends.
const MAX_RANGES: usize = 63;
/// Steps in which shares are counted: sums and differences of them are exact.
const SHARE_STEPS: f64 = (1 << 24) as f64;
/// Pairs of numbers before those of the lights. Twin: `LIGHT_GRID_HEAD`.
pub(crate) const LIGHT_GRID_HEAD: usize = 6;

/// Lights that are looked at for each that is drawn. Twin: `LIGHT_CANDIDATES`.
pub(crate) const LIGHT_CANDIDATES: usize = 8;
/// Greatest number that lights are drawn by. Twin: `BELOW_ONE`.
pub(crate) const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// The grid.
#[derive(Debug, Clone)]
pub(crate) struct LightGrid {
    /// The lights as they were given.
    lights: Vec<TreeLight>,
    /// The lights in the order of their tree: those that are drawn one after the other lie close together.
    ordered: Vec<TreeLight>,
    /// Least corner and the number of ranges of a cell, cells per unit on each axis and a 0, cells on each axis and a 0.
    /// Then the lights in the order of their tree, each with the share of power before it and its number as given, and a pair
    /// for where they end. Then the cells, x fastest, each with a pair for each of its ranges, the share of those before it and
    /// its first light in the tree's order, and a pair for where they end.
    pairs: Vec<[f32; 2]>,
}

/// A light that was drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DrawnLight {
    /// The range that it is of, which greater numbers need not look before.
    pub range: usize,
    /// Number of the light in the order of the grid.
    pub index: usize,
    /// 1 over its probability.
    pub weight: f32,
}

impl LightGrid {
    /// Builds the grid for `lights`, at least 1 and at most 2^24, in a scene that fills the box `lit`; where the lights fill
    /// a small part of that, the cells are around them. Cost: about 4 us for each of at most 1,024 cells, on all threads,
    /// and 0.5 us per light.
    pub(crate) fn new(lights: Vec<TreeLight>, lit: Bounds) -> LightGrid {
        let tree = LightTree::new(&lights);
        let Bounds { lo, hi } = around(&lights, lit);
        let counts = cells_of(hi - lo);
        let count = counts.map(|count| count as f32);
        let per_unit = Vec3::from(count) / (hi - lo).max(Vec3::splat(f32::MIN_POSITIVE));
        let per_unit = Vec3::from_array([0, 1, 2].map(|axis| if counts[axis] > 1 { per_unit[axis] } else { 0.0 }));
        let ranges = lights.len().min(MAX_RANGES);
        let mut pairs = vec![
            [lo.x, lo.y],
            [lo.z, ranges as f32],
            [per_unit.x, per_unit.y],
            [per_unit.z, 0.0],
            [count[0], count[1]],
            [count[2], 0.0],
        ];
        let powers = tree.order.iter().map(|light| f64::from(lights[*light as usize].power));
        let before = shares(&powers.collect::<Vec<_>>());
        pairs
            .extend(before.iter().zip(tree.order.iter().map(|light| *light as f32).chain([0.0])).map(|(a, b)| [*a, b]));
        let side = (hi - lo) / Vec3::from(count);
        // Mean squared distance of a box's points from its middle.
        let spread = side.as_dvec3().length_squared() / 12.0;
        let cell = |cell: usize| -> Vec<[f32; 2]> {
            let place = [cell % counts[0], cell / counts[0] % counts[1], cell / (counts[0] * counts[1])];
            let middle = lo + side * (Vec3::from(place.map(|at| at as f32)) + 0.5);
            let cut = tree.cut(middle, spread, ranges);
            let before = shares(&cut.iter().map(|range| range.importance).collect::<Vec<_>>());
            let firsts = cut.iter().map(|range| range.first).chain([lights.len() as u32]);
            before.into_iter().zip(firsts).map(|(before, first)| [before, first as f32]).collect()
        };
        let cells: Vec<_> = (0..counts.iter().product()).into_par_iter().map(cell).collect();
        pairs.extend(cells.into_iter().flatten());
        let ordered = tree.order.iter().map(|light| lights[*light as usize]).collect();
        LightGrid { lights, ordered, pairs }
    }

    /// Tells whether the grid was built for `lights`.
    pub(crate) fn is_of(&self, lights: &[TreeLight]) -> bool {
        self.lights == lights
    }

    /// Returns the bytes of [`LightGrid::pairs`] at most for so many lights; 0 where they need no grid whatever is asked.
    pub(crate) fn max_bytes(lights: usize) -> u64 {
        let pairs = LIGHT_GRID_HEAD + lights + 1 + MAX_GRID_CELLS * (MAX_RANGES + 1);
        if lights > LIGHT_CANDIDATES { (pairs * size_of::<[f32; 2]>()) as u64 } else { 0 }
    }

    /// Returns the numbers as shaders read them, two words each.
    pub(crate) fn pairs(&self) -> &[[f32; 2]] {
        &self.pairs
    }

    /// Returns the lights in the order of the grid.
    pub(crate) fn ordered(&self) -> &[TreeLight] {
        &self.ordered
    }

    /// Returns which of the lights that were given is number `index` in the order of the grid.
    pub(crate) fn number(&self, index: usize) -> usize {
        self.pairs[LIGHT_GRID_HEAD + index][1] as usize
    }

    /// Returns the first pair of the cell in which `position` lies, or of the nearest one.
    pub(crate) fn cell(&self, position: Vec3) -> usize {
        let [lo, lo_z, per_unit, per_unit_z, count, count_z] = [0, 1, 2, 3, 4, 5].map(|pair| self.pairs[pair]);
        let ranges = lo_z[1] as usize;
        let low = Vec3::new(lo[0], lo[1], lo_z[0]);
        let count = Vec3::new(count[0], count[1], count_z[0]);
        let at = (position - low) * Vec3::new(per_unit[0], per_unit[1], per_unit_z[0]);
        let at = at.max(Vec3::ZERO).min(count - 1.0).to_array().map(|at| at as usize);
        let cell = (at[2] * count.y as usize + at[1]) * count.x as usize + at[0];
        LIGHT_GRID_HEAD + self.lights.len() + 1 + cell * (ranges + 1)
    }

    /// Returns the range of a [cell](LightGrid::cell) that a number in [0, 1) draws from.
    pub(crate) fn range(&self, cell: usize, x: f32) -> usize {
        self.step(cell, self.pairs[1][1] as usize, x)
    }

    /// Returns which of `count` pairs from `first` on begins the step that holds `x`.
    fn step(&self, first: usize, count: usize, x: f32) -> usize {
        let (mut low, mut count) = (first, count);
        while count > 1 {
            let half = count / 2;
            // No branch that a processor would have to guess.
            low += half * usize::from(self.pairs[low + half][0] <= x);
            count -= half;
        }
        low
    }

    /// Draws a light by a number in [0, 1), of the range `from` or one behind it; neighbouring numbers draw neighbouring
    /// lights.
    pub(crate) fn draw(&self, from: usize, x: f32) -> DrawnLight {
        let mut range = from;
        while self.pairs[range + 1][0] <= x {
            range += 1;
        }
        let ([share_before, first], [share_end, end]) = (self.pairs[range], self.pairs[range + 1]);
        let (first, end) = (LIGHT_GRID_HEAD + first as usize, LIGHT_GRID_HEAD + end as usize);
        let before = self.pairs[first][0];
        let power_per_share = (self.pairs[end][0] - before) / (share_end - share_before);
        let at = self.step(first, end - first, before + (x - share_before) * power_per_share);
        let power = self.pairs[at + 1][0] - self.pairs[at][0];
        DrawnLight { range, index: at - LIGHT_GRID_HEAD, weight: power_per_share / power }
    }
}

/// Returns the sums of the shares of `weights` before each and behind the last, from 0 to 1. No share is 0, so that
/// everything may be drawn: each is a multiple of 2^-24.
fn shares(weights: &[f64]) -> Vec<f32> {
    let total: f64 = weights.iter().sum();
    let spare = SHARE_STEPS - weights.len() as f64;
    let mut sum = 0.0;
    let before = weights.iter().map(|weight| {
        let before = sum;
        sum += 1.0 + if total > 0.0 { (spare * weight / total).floor() } else { 0.0 };
        (before / SHARE_STEPS) as f32
    });
    before.chain([1.0]).collect()
}

/// Returns the box of the cells: that of the scene or, where it is smaller, one around the lights with as much again on
/// each side.
fn around(lights: &[TreeLight], lit: Bounds) -> Bounds {
    let places = lights.iter().map(|light| light.position);
    let Bounds { lo, hi } = places.fold(Bounds::EMPTY, Bounds::add_point);
    let margin = Vec3::splat((hi - lo).max_element());
    let within = |place: Vec3| place.max(lit.lo).min(lit.hi);
    Bounds { lo: within(lo - margin), hi: within(hi + margin) }
}

/// Returns the cells on each axis of a box with these sides: as many as may be, about cubes.
fn cells_of(sides: Vec3) -> [usize; 3] {
    let longest = sides.max_element();
    let mut width = longest / MAX_CELLS_ALONG;
    if !(width >= f32::MIN_POSITIVE && longest.is_finite()) {
        return [1; 3];
    }
    loop {
        let counts = sides.to_array().map(|side| (side / width).ceil().max(1.0) as usize);
        if counts.iter().product::<usize>() <= MAX_GRID_CELLS {
            return counts;
        }
        width *= CELL_GROWTH;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler;

    /// Lights of uneven power, most in a corner of the scene, some in one place, one far away and one that is off.
    fn lights(count: u32) -> Vec<TreeLight> {
        let light = |number: u32| {
            let [x, y, z, power] = [0, 1, 2, 3].map(|axis| sampler::one(4 * number + axis));
            let position = match number {
                5 => Vec3::splat(1e18),
                _ if number % 10 == 3 => Vec3::splat(0.5),
                _ => Vec3::new(x, y, z),
            };
            TreeLight { position, power: if number == 7 { 0.0 } else { 0.01 + power * power } }
        };
        (0..count).map(light).collect()
    }

    const SCENE: Bounds = Bounds { lo: Vec3::new(-1.0, -2.0, 0.0), hi: Vec3::new(5.0, 5.0, 1.0) };

    /// Places in the scene and beyond, and one at a light.
    fn places() -> Vec<Vec3> {
        let place = |number: u32| {
            let [x, y, z] = [0, 1, 2].map(|axis| sampler::one(9000 + 3 * number + axis));
            Vec3::new(8.0 * x - 2.0, 8.0 * y - 2.0, 2.0 * z - 0.5)
        };
        (0..20).map(place).chain([Vec3::splat(0.5), Vec3::splat(-1e30), Vec3::splat(f32::NAN)]).collect()
    }

    #[test]
    fn lights_are_drawn_as_often_as_their_density_says_and_every_one_may_be() {
        const DRAWS: usize = 1 << 16;
        for count in [1, 2, 31, 32, 1000] {
            let lights = lights(count);
            let grid = LightGrid::new(lights.clone(), SCENE);
            assert!(grid.is_of(&lights) && !grid.is_of(&lights[1..]));
            assert!(grid.pairs().len() < MAX_GRID_CELLS * (MAX_RANGES + 1) + lights.len() + 10);
            for place in places() {
                let cell = grid.cell(place);
                let mut drawn = vec![(0, 0.0); lights.len()];
                for number in 0..DRAWS {
                    let x = (number as f32 + 0.5) / DRAWS as f32;
                    let DrawnLight { range, index, weight } = grid.draw(grid.range(cell, x), x);
                    assert!(weight >= 1.0 - 1e-6 && grid.ordered()[index] == lights[grid.number(index)]);
                    assert_eq!(grid.draw(cell, x), DrawnLight { range, index, weight });
                    drawn[index] = (drawn[index].0 + 1, 1.0 / weight);
                }
                // Numbers of equal distances: a light has as many as its share, but for two at its ends.
                let is_as_often = |scale: f32| {
                    let wanted = |density: f32| scale * density * DRAWS as f32;
                    drawn.iter().all(|(times, density)| (*times as f32 - wanted(*density)).abs() < 2.0)
                };
                assert!(is_as_often(1.0), "{count} {place}");
                // Planted: other densities.
                assert!(!is_as_often(1.1), "{count} {place}");
                let density: f32 = drawn.iter().map(|(_, density)| density).sum();
                assert!((density - 1.0).abs() < 0.01, "{count} {place}: {density}");
            }
        }
    }

    #[test]
    fn near_lights_are_drawn_more_often_and_dim_ones_now_and_then() {
        let bright = |x: f32, power: f32| TreeLight { position: Vec3::new(x, 0.5, 0.5), power };
        let lights: Vec<_> = (0..500).map(|i| bright(i as f32 * 0.01, 1.0)).chain([bright(0.0, 1e-20)]).collect();
        let grid = LightGrid::new(lights.clone(), SCENE);
        let mean_distance = |place: Vec3| {
            let draw = |i: usize| grid.draw(grid.cell(place), (i as f32 + 0.5) / 1000.0).index;
            (0..1000).map(|i| grid.ordered()[draw(i)].position.distance(place)).sum::<f32>() / 1000.0
        };
        for x in [0.0, 2.5, 5.0] {
            let place = Vec3::new(x, 0.5, 0.5);
            let all = lights.iter().map(|light| light.position.distance(place)).sum::<f32>() / 501.0;
            assert!(mean_distance(place) < 0.4 * all, "{x}: {} {all}", mean_distance(place));
        }
        // The dim one has the least share of a range that there is.
        let cell = grid.cell(Vec3::ZERO);
        let draw = |i: u32| grid.draw(cell, i as f32 / (1 << 24) as f32).index;
        let times = (0..1 << 24).filter(|i| grid.number(draw(*i)) == 500).count();
        assert!((1..100).contains(&times), "{times}");
        assert!(grid.number(grid.draw(cell, BELOW_ONE).index) < 501);
    }

    #[test]
    fn the_cells_lie_around_the_lights() {
        let lights: Vec<_> = lights(100).into_iter().filter(|light| light.position.x < 2.0).collect();
        let Bounds { lo, hi } = around(&lights, SCENE);
        assert!(lo.x < -0.9 && (-1.1..-0.9).contains(&lo.y) && hi.x < 2.1 && (lo.z, hi.z) == (0.0, 1.0));
        assert_eq!(cells_of(Vec3::ZERO), [1; 3]);
        assert_eq!(cells_of(Vec3::new(1.0, 0.0, 0.0)), [64, 1, 1]);
        assert_eq!(cells_of(Vec3::INFINITY), [1; 3]);
        let counts = cells_of(Vec3::new(10.0, 10.0, 1.0));
        assert!(
            counts[0] == counts[1]
                && counts[0] > 4 * counts[2]
                && 2 * counts.iter().product::<usize>() > MAX_GRID_CELLS
        );
    }
}

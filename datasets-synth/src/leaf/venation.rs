//! The veins of a leaf patch: a main vein, secondaries that leave it in turn to either side and
//! bend towards the tip, and a network of finer veins between them.

use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::surface::noise::{cell_border_distance, gradient_noise};

/// Half the width of the main vein at the patch's lower edge in millimetres.
const MAIN_HALF_WIDTH_MM: f32 = 0.42;
/// Relative loss of the main vein's width per millimetre towards the tip.
const MAIN_TAPER_PER_MM: f32 = 0.008;
/// Half the width of a secondary vein where it leaves the main one.
const SECONDARY_HALF_WIDTH_MM: f32 = 0.17;
/// Length over which a secondary vein thins to its end.
const SECONDARY_LENGTH_MM: f32 = 22.0;
/// Distance between secondary veins along the main one, both sides counted.
const SECONDARY_SPACING_MM: f32 = 3.4;
/// Angle between a secondary vein and the main one at its start, in degrees.
const SECONDARY_ANGLE_DEG: f32 = 62.0;
/// The same at its end: it bends towards the tip.
const SECONDARY_END_ANGLE_DEG: f32 = 28.0;
/// Length of one straight piece of a vein.
const PIECE_MM: f32 = 0.5;
/// Mean size of the areas that tertiary veins enclose.
const TERTIARY_CELL_MM: f32 = 1.7;
/// Mean size of the areas that the finest veins enclose.
const QUATERNARY_CELL_MM: f32 = 0.62;

/// Where a point lies among the veins. Distances in millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct VeinSite {
    /// Distance to the main vein's middle.
    pub main: f32,
    /// Half-width of the main vein there.
    pub main_half_width: f32,
    /// Distance to the nearest secondary vein's middle.
    pub secondary: f32,
    /// Half-width of that vein there.
    pub secondary_half_width: f32,
    /// Distance to the nearest tertiary vein.
    pub tertiary: f32,
    /// Distance to the nearest vein of the finest order.
    pub quaternary: f32,
}

/// The veins of one leaf, in millimetres from the patch's lower left corner; the leaf's tip lies
/// upwards.
#[derive(Debug, Clone)]
pub(crate) struct Venation {
    main: Vein,
    secondaries: Vec<Vein>,
    seed: u32,
}

#[derive(Debug, Clone)]
struct Vein {
    points: Vec<[f32; 2]>,
    half_widths: Vec<f32>,
    /// Lower left and upper right corner.
    bounds: [[f32; 2]; 2],
}

impl Vein {
    fn new(points: Vec<[f32; 2]>, half_widths: Vec<f32>) -> Vein {
        let fold = |pick: fn(f32, f32) -> f32, start: f32| {
            points.iter().fold([start; 2], |corner, p| [pick(corner[0], p[0]), pick(corner[1], p[1])])
        };
        let bounds = [fold(f32::min, f32::MAX), fold(f32::max, f32::MIN)];
        Vein { points, half_widths, bounds }
    }

    /// Distance to the vein and its half-width there, if it is nearer than `limit`.
    fn nearest(&self, p: [f32; 2], limit: f32) -> Option<(f32, f32)> {
        let outside = (0..2).any(|k| p[k] < self.bounds[0][k] - limit || p[k] > self.bounds[1][k] + limit);
        if outside {
            return None;
        }
        let mut best = (limit * limit, 0.0, false);
        for (pair, widths) in self.points.windows(2).zip(self.half_widths.windows(2)) {
            let along = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
            let to = [p[0] - pair[0][0], p[1] - pair[0][1]];
            let length_squared = along[0] * along[0] + along[1] * along[1];
            let t = ((to[0] * along[0] + to[1] * along[1]) / length_squared).clamp(0.0, 1.0);
            let off = [to[0] - t * along[0], to[1] - t * along[1]];
            let squared = off[0] * off[0] + off[1] * off[1];
            if squared < best.0 {
                best = (squared, widths[0] * (1.0 - t) + widths[1] * t, true);
            }
        }
        best.2.then(|| (best.0.sqrt(), best.1))
    }
}

impl Venation {
    /// Grows the veins of a patch of `size_mm` with `margin_mm` around it. The same seed gives the
    /// same veins at any resolution.
    pub fn new(size_mm: f32, margin_mm: f32, seed: u64) -> Venation {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x7665_696E);
        let mut jitter = |amount: f32| 1.0 + amount * (random.gen_range(0.0..2.0f32) - 1.0);
        // The main vein: nearly upright, a third from the left, with a slow bend.
        let foot = 0.3 * size_mm * jitter(0.2);
        let lean = 0.07 * jitter(0.6);
        let bend = 0.25 * jitter(0.5);
        let main_x = move |y: f32| foot + lean * y + bend * (y * 0.16).sin();
        // Everything starts as far below the patch as a secondary vein is long.
        let start = -margin_mm - SECONDARY_LENGTH_MM;
        let end = size_mm + margin_mm + PIECE_MM;
        let steps = ((end - start) / PIECE_MM).ceil() as usize;
        let ys: Vec<f32> = (0..=steps).map(|i| start + i as f32 * PIECE_MM).collect();
        let width = |y: f32| MAIN_HALF_WIDTH_MM * (1.0 - MAIN_TAPER_PER_MM * y).clamp(0.4, 1.2);
        let main = Vein::new(ys.iter().map(|&y| [main_x(y), y]).collect(), ys.iter().map(|&y| width(y)).collect());

        let mut secondaries = Vec::new();
        let mut y = start;
        let mut side = if jitter(1.0) > 1.0 { 1.0 } else { -1.0 };
        while y < end {
            let angle_jitter = jitter(0.06);
            let width_jitter = jitter(0.15);
            let wave = 6.0 * jitter(0.5);
            let mut point = [main_x(y), y];
            let (mut points, mut half_widths) = (vec![point], vec![SECONDARY_HALF_WIDTH_MM * width_jitter]);
            let pieces = (SECONDARY_LENGTH_MM / PIECE_MM) as usize;
            for i in 1..=pieces {
                let t = i as f32 / pieces as f32;
                let bent = SECONDARY_ANGLE_DEG + (SECONDARY_END_ANGLE_DEG - SECONDARY_ANGLE_DEG) * t * t.sqrt();
                let angle = (bent * angle_jitter + wave * (t * 11.0 + y).sin()).to_radians();
                point = [point[0] + side * angle.sin() * PIECE_MM, point[1] + angle.cos() * PIECE_MM];
                points.push(point);
                half_widths.push(SECONDARY_HALF_WIDTH_MM * width_jitter * (1.0 - 0.75 * t));
            }
            secondaries.push(Vein::new(points, half_widths));
            side = -side;
            y += SECONDARY_SPACING_MM * jitter(0.12);
        }
        Venation { main, secondaries, seed: (seed ^ (seed >> 32)) as u32 }
    }

    /// Where `position_mm` lies among the veins.
    pub fn site(&self, position_mm: [f32; 2]) -> VeinSite {
        // Farther veins than this have no influence on anything.
        const REACH_MM: f32 = 8.0;
        let (main, main_half_width) =
            self.main.nearest(position_mm, REACH_MM).unwrap_or((REACH_MM, MAIN_HALF_WIDTH_MM));
        let mut secondary = (REACH_MM, SECONDARY_HALF_WIDTH_MM);
        for vein in &self.secondaries {
            if let Some(nearer) = vein.nearest(position_mm, secondary.0) {
                secondary = nearer;
            }
        }
        // Finer veins wander: the place is pushed about before it is looked up.
        let [x, y] = position_mm;
        let push = |stream: u32, step: f32| gradient_noise(x / step, y / step, self.seed.wrapping_add(stream));
        let (px, py) = (x + 0.5 * push(11, 1.3), y + 0.5 * push(12, 1.3));
        let network =
            |cell: f32, stream: u32| cell * cell_border_distance(px / cell, py / cell, self.seed.wrapping_add(stream));
        VeinSite {
            main,
            main_half_width,
            secondary: secondary.0,
            secondary_half_width: secondary.1,
            tertiary: network(TERTIARY_CELL_MM, 13),
            quaternary: network(QUATERNARY_CELL_MM, 14),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_main_vein_crosses_the_patch_and_secondaries_leave_to_both_sides() {
        let veins = Venation::new(20.0, 3.0, 1);
        for y in [0.0, 10.0, 20.0] {
            let crossings = (0..2000).filter(|i| veins.site([*i as f32 * 0.01, y]).main < 0.01).count();
            assert!(crossings > 0, "the main vein passes at y = {y}");
        }
        let foot = veins.main.points[veins.main.points.len() / 2][0];
        for side in [-1.0f32, 1.0] {
            let count = veins.secondaries.iter().filter(|v| (v.points[9][0] - foot) * side > 1.0).count();
            assert!(count >= 3, "{count}");
        }
        for vein in &veins.secondaries {
            let (first, last) = (vein.points[0], vein.points[vein.points.len() - 1]);
            assert!(last[1] > first[1], "bends towards the tip");
            assert!(vein.half_widths[0] > 3.0 * vein.half_widths[vein.half_widths.len() - 1], "thins");
        }
    }

    #[test]
    fn the_bounded_search_finds_what_the_plain_one_finds() {
        let veins = Venation::new(20.0, 3.0, 7);
        for i in 0..400 {
            let p = [(i % 20) as f32 * 1.1 - 1.0, (i / 20) as f32 * 1.1 - 1.0];
            let plain = veins
                .secondaries
                .iter()
                .flat_map(|vein| vein.points.windows(2))
                .map(|pair| {
                    // Distance to a finely cut piece.
                    (0..=20)
                        .map(|j| {
                            let t = j as f32 / 20.0;
                            let q: [f32; 2] = std::array::from_fn(|k| pair[0][k] * (1.0 - t) + pair[1][k] * t);
                            ((q[0] - p[0]).powi(2) + (q[1] - p[1]).powi(2)).sqrt()
                        })
                        .fold(f32::MAX, f32::min)
                })
                .fold(f32::MAX, f32::min);
            let fast = veins.site(p).secondary;
            assert!((fast - plain).abs() < 0.015, "{p:?}: {fast} {plain}");
        }
    }

    #[test]
    fn seeds_differ_and_repeat() {
        let site = |seed| Venation::new(20.0, 3.0, seed).site([7.3, 9.1]);
        assert_eq!(site(3), site(3));
        assert_ne!(site(3), site(4));
        assert_ne!(site(3).tertiary, site(4).tertiary);
    }
}

//! Parallel veins of a grass: a wide midrib, laterals and fine veins along the blade, and short
//! commissural veins that tie neighbours together. No reticulum.

use crate::leaf::venation::site::VeinSite;
use crate::leaf::venation::traits::ParallelTraits;
use crate::leaf::venation::vein::unit;
use crate::surface::noise::{gradient_noise, lattice_unit};

#[derive(Debug, Clone)]
pub(crate) struct ParallelVenation {
    traits: ParallelTraits,
    /// Position of the midrib at y = 0, and its lean.
    foot_mm: f32,
    lean: f32,
    /// Distances of the middles of the laterals from the midrib along x, rising, with their half-widths.
    laterals: Vec<(f32, f32)>,
    /// Distances of the middles of the fine veins from the midrib along x, rising.
    fine: Vec<f32>,
    seed: u32,
}

impl ParallelVenation {
    /// Generates the veins; see [`crate::leaf::venation::veins::Venation::new`].
    pub fn new(traits: &ParallelTraits, size_mm: f32, margin_mm: f32, seed: u64) -> ParallelVenation {
        let seed = (seed ^ (seed >> 32)) as u32;
        let unit = |i: i32, stream: u32| 2.0 * lattice_unit(i, 0, seed.wrapping_add(stream)) - 1.0;
        let foot_mm = size_mm * (0.36 + 0.06 * unit(0, 31));
        // Far enough to either side for every place of the patch and its margin.
        let reach = size_mm + 2.0 * margin_mm + 4.0;
        let first_mm = 1.15 * traits.main_half_width_mm;
        let (mut laterals, mut fine) = (Vec::new(), Vec::new());
        for side in [-1.0f32, 1.0] {
            let salt = if side < 0.0 { 40 } else { 50 };
            let mut at = first_mm;
            let mut index = 0;
            while at < reach {
                let step = traits.lateral_spacing_mm * (1.0 + 0.22 * unit(index, salt));
                // Fine veins share the room between laterals.
                let count = (step / traits.fine_spacing_mm).round().max(1.0) as i32;
                for i in 1..count {
                    let wander = 0.18 * unit(index * 64 + i, salt + 1);
                    fine.push(side * (at + step * (i as f32 + wander) / count as f32));
                }
                at += step;
                laterals.push((side * at, traits.lateral_half_width_mm * (1.0 + 0.3 * unit(index, salt + 2))));
                index += 1;
            }
        }
        laterals.sort_by(|a, b| a.0.total_cmp(&b.0));
        fine.sort_by(f32::total_cmp);
        ParallelVenation { traits: *traits, foot_mm, lean: 0.02 * unit(0, 32), laterals, fine, seed }
    }

    /// Returns the place of `position_mm` among the veins.
    pub fn site(&self, position_mm: [f32; 2]) -> VeinSite {
        let [x, y] = position_mm;
        // All veins bend together, slowly; the derivative gives their direction.
        let bend = |y: f32| self.lean * y + 0.5 * gradient_noise(0.5, y / 37.0, self.seed.wrapping_add(33));
        let across = x - self.foot_mm - bend(y);
        let slope = (bend(y + 0.05) - bend(y - 0.05)) / 0.1;

        let right = self.laterals.partition_point(|lateral| lateral.0 < across);
        let (mut secondary, mut secondary_half_width) = (f32::MAX, self.traits.lateral_half_width_mm);
        for index in [right.wrapping_sub(1), right] {
            if let Some(&(at, half_width)) = self.laterals.get(index)
                && (at - across).abs() < secondary
            {
                (secondary, secondary_half_width) = ((at - across).abs(), half_width);
            }
        }
        let strip = self.fine.partition_point(|&at| at < across);
        let neighbour = |index: usize| self.fine.get(index).copied();
        let fine = [neighbour(strip.wrapping_sub(1)), neighbour(strip)];
        let tertiary = fine.iter().flatten().map(|at| (at - across).abs()).fold(f32::MAX, f32::min);

        // Commissural veins: one in each stretch of a strip, somewhere in its middle part, a little oblique.
        // A strip ends at laterals, too.
        let strip = (strip + 3 * right) as i32;
        let stretch = y / self.traits.commissure_spacing_mm;
        let mut quaternary = f32::MAX;
        for row in -1..=1 {
            let row = stretch.floor() as i32 + row;
            let seed = self.seed.wrapping_add(34);
            let at = row as f32 + 0.15 + 0.7 * lattice_unit(strip, row, seed);
            let oblique = 0.5 * (lattice_unit(strip, row, seed.wrapping_add(1)) - 0.5);
            let middle = match fine {
                [Some(a), Some(b)] => 0.5 * (a + b),
                _ => across,
            };
            let away = (stretch - at) * self.traits.commissure_spacing_mm - oblique * (across - middle);
            quaternary = quaternary.min(away.abs());
        }
        let main_half_width =
            self.traits.main_half_width_mm * (1.0 - self.traits.main_taper_per_mm * y).clamp(0.4, 1.2);
        VeinSite {
            main: across.abs(),
            main_half_width,
            secondary,
            secondary_half_width,
            tertiary,
            quaternary,
            across,
            direction: unit([slope, 1.0]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_models::Species;

    use crate::leaf::species::Traits;
    use crate::leaf::venation::traits::VenationTraits;

    fn veins(seed: u64) -> ParallelVenation {
        match Traits::of(Some(Species::Maize)).venation {
            VenationTraits::Parallel(traits) => ParallelVenation::new(&traits, 30.0, 3.0, seed),
            VenationTraits::Pinnate(_) => panic!("maize is a grass"),
        }
    }

    /// Returns the positions along a row where a distance has a minimum near zero.
    fn crossings(veins: &ParallelVenation, y: f32, distance: fn(&VeinSite) -> f32) -> Vec<f32> {
        let xs: Vec<f32> = (0..12_000).map(|i| i as f32 * 0.0025).collect();
        let d: Vec<f32> = xs.iter().map(|&x| distance(&veins.site([x, y]))).collect();
        (1..d.len() - 1).filter(|&i| d[i] < 0.003 && d[i] <= d[i - 1] && d[i] < d[i + 1]).map(|i| xs[i]).collect()
    }

    #[test]
    fn laterals_and_fine_veins_run_side_by_side_along_the_blade_and_never_meet() {
        let veins = veins(1);
        let distances: [fn(&VeinSite) -> f32; 2] = [|s| s.secondary, |s| s.tertiary];
        for (distance, least) in distances.into_iter().zip([10, 40]) {
            let (low, high) = (crossings(&veins, 3.0, distance), crossings(&veins, 27.0, distance));
            assert!(low.len() >= least, "{}", low.len());
            assert!(low.len().abs_diff(high.len()) <= 2, "what enters below leaves above");
            let least = |xs: &[f32]| xs.windows(2).map(|p| p[1] - p[0]).fold(f32::MAX, f32::min);
            assert!((least(&low) - least(&high)).abs() < 0.01, "parallel");
        }
    }

    #[test]
    fn the_direction_is_along_the_blade_everywhere() {
        let veins = veins(2);
        for i in 0..400 {
            let d = veins.site([(i % 20) as f32 * 1.5, (i / 20) as f32 * 1.5]).direction;
            assert!(d[1] > 0.99 && (d[0] * d[0] + d[1] * d[1] - 1.0).abs() < 1e-5, "{d:?}");
        }
    }

    #[test]
    fn commissures_cross_between_neighbours_only() {
        let veins = veins(3);
        // Up one strip there is one in each stretch, and the strip beside has them elsewhere.
        let x = veins.foot_mm + 5.0;
        let ys = |x: f32| -> Vec<f32> {
            (0..3000).map(|i| i as f32 * 0.01).filter(|&y| veins.site([x, y]).quaternary < 0.012).collect()
        };
        let (a, b) = (ys(x), ys(x + veins.traits.fine_spacing_mm));
        assert!(a.len() > 10 && b.len() > 10);
        let shared = a.iter().filter(|y| b.iter().any(|z| (*y - z).abs() < 0.03)).count();
        assert!(2 * shared < a.len(), "{shared} of {}", a.len());
    }

    #[test]
    fn seeds_differ_and_repeat() {
        assert_eq!(veins(3).site([7.3, 9.1]), veins(3).site([7.3, 9.1]));
        assert_ne!(veins(3).site([7.3, 9.1]), veins(4).site([7.3, 9.1]));
    }
}

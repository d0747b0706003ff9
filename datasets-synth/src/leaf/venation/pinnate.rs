//! Pinnate veins: a main vein, secondaries that leave it in turn to either side and bend towards the
//! tip, tertiaries between them, and a network of finest veins.
//!
//! Tertiaries are a network of their own (the plain leaf), or curves that join one secondary to the
//! next: in ladder order (scalariform, percurrent: nearly parallel rungs, few forks) or as a coarse
//! reticulum (rungs at uneven distances, broken in the middle and tied to each other there)
//! [after Ellis et al. 2009, tertiary vein fabric].

use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::leaf::venation::site::VeinSite;
use crate::leaf::venation::traits::{PinnateTraits, RungTraits, TertiaryTraits};
use crate::leaf::venation::vein::{FineVeins, Vein, direction_of, double_angle};
use crate::surface::noise::{cell_border_distance, gradient_noise};

/// Length of one straight piece of a great vein.
const PIECE_MM: f32 = 0.5;
/// Length of one straight piece of a tertiary vein.
const FINE_PIECE_MM: f32 = 0.25;
/// Distance beyond which veins have no influence on displacement and tissue.
const REACH_MM: f32 = 8.0;
/// Distance from a great vein over which tertiaries begin to wander.
const JOIN_MM: f32 = 0.6;
/// Length over which a tertiary wanders to one side.
const WANDER_STEP_MM: f32 = 1.9;
/// Distance in millimetres below which the pull of a vein on the direction grows no more.
const PULL_CORE_MM: f32 = 0.3;

#[derive(Debug, Clone)]
pub(crate) struct PinnateVenation {
    main: Vein,
    secondaries: Vec<Vein>,
    tertiaries: Tertiaries,
    finest_cell_mm: f32,
    seed: u32,
}

#[derive(Debug, Clone)]
enum Tertiaries {
    /// Network of cells of this size.
    Network(f32),
    /// Curves, and how far they wander off their smooth course.
    Curves(FineVeins, f32),
}

impl PinnateVenation {
    /// Generates the veins; see [`crate::leaf::venation::veins::Venation::new`].
    pub fn new(traits: &PinnateTraits, size_mm: f32, margin_mm: f32, seed: u64) -> PinnateVenation {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x7665_696E);
        let mut jitter = |amount: f32| 1.0 + amount * (random.gen_range(0.0..2.0f32) - 1.0);
        // The main vein: nearly upright, a third from the left, with a slow bend.
        let foot = 0.3 * size_mm * jitter(0.2);
        let lean = 0.07 * jitter(0.6);
        let bend = 0.25 * jitter(0.5);
        let main_x = move |y: f32| foot + lean * y + bend * (y * 0.16).sin();
        // Everything starts as far below the patch as a secondary vein is long.
        let length_mm = traits.secondary_length_mm.max(traits.secondary_share_of_patch * size_mm);
        let start = -margin_mm - length_mm;
        let end = size_mm + margin_mm + PIECE_MM;
        let steps = ((end - start) / PIECE_MM).ceil() as usize;
        let ys: Vec<f32> = (0..=steps).map(|i| start + i as f32 * PIECE_MM).collect();
        let width = |y: f32| traits.main_half_width_mm * (1.0 - traits.main_taper_per_mm * y).clamp(0.4, 1.2);
        let main = Vein::new(ys.iter().map(|&y| [main_x(y), y]).collect(), ys.iter().map(|&y| width(y)).collect());

        let mut secondaries = Vec::new();
        let mut y = start;
        let mut side = if jitter(1.0) > 1.0 { 1.0 } else { -1.0 };
        while y < end {
            let angle_jitter = jitter(traits.secondary_angle_jitter);
            let width_jitter = jitter(0.15);
            let wave = traits.secondary_wave_deg * jitter(0.5);
            let mut point = [main_x(y), y];
            let half_width = traits.secondary_half_width_mm * width_jitter;
            let (mut points, mut half_widths) = (vec![point], vec![half_width]);
            let pieces = (length_mm / PIECE_MM) as usize;
            for i in 1..=pieces {
                let t = i as f32 / pieces as f32;
                let [first, last] = traits.secondary_angles_deg;
                let angle = first + (last - first) * t * t.sqrt();
                let angle = (angle * angle_jitter + wave * (t * 11.0 + y).sin()).to_radians();
                point = [point[0] + side * angle.sin() * PIECE_MM, point[1] + angle.cos() * PIECE_MM];
                points.push(point);
                half_widths.push(half_width * (1.0 - 0.75 * t));
            }
            secondaries.push(Vein::new(points, half_widths));
            side = -side;
            y += traits.secondary_spacing_mm * jitter(0.12);
        }
        let tertiaries = match traits.tertiary {
            TertiaryTraits::Network { cell_mm } => Tertiaries::Network(cell_mm),
            TertiaryTraits::Rungs(rungs) => {
                let mut random = Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x7275_6E67);
                let lines = tertiary_lines(&main, &secondaries, &rungs, &mut random);
                Tertiaries::Curves(FineVeins::new(&lines, -margin_mm, size_mm + margin_mm), rungs.wander_mm)
            }
        };
        let seed = (seed ^ (seed >> 32)) as u32;
        PinnateVenation { main, secondaries, tertiaries, finest_cell_mm: traits.finest_cell_mm, seed }
    }

    /// Returns the place of `position_mm` among the veins.
    pub fn site(&self, position_mm: [f32; 2]) -> VeinSite {
        let [x, y] = position_mm;
        // The main vein is upright enough to be found from the height alone.
        let step = ((y - self.main.points[0][1]) / PIECE_MM).clamp(0.0, (self.main.points.len() - 1) as f32);
        let index = (step as usize).min(self.main.points.len() - 2);
        let t = step - index as f32;
        let across = x - (self.main.points[index][0] * (1.0 - t) + self.main.points[index + 1][0] * t);

        let mut pull = [0.0; 2];
        let mut add = |distance: f32, direction: [f32; 2]| {
            let weight = 1.0 / (distance * distance + PULL_CORE_MM * PULL_CORE_MM);
            let double = double_angle(direction);
            pull = [pull[0] + weight * double[0], pull[1] + weight * double[1]];
        };
        let main = self.main.nearest(position_mm, REACH_MM);
        if let Some(main) = main {
            add(main.distance, main.direction);
        }
        let mut secondary = None;
        let mut limit = REACH_MM;
        for vein in &self.secondaries {
            if let Some(nearer) = vein.nearest(position_mm, limit) {
                limit = nearer.distance;
                secondary = Some(nearer);
            }
        }
        if let Some(secondary) = secondary {
            add(secondary.distance, secondary.direction);
        }
        // Finer veins wander: the place is pushed about before it is looked up.
        let push = |stream: u32, step: f32| gradient_noise(x / step, y / step, self.seed.wrapping_add(stream));
        let (px, py) = (x + 0.5 * push(11, 1.3), y + 0.5 * push(12, 1.3));
        let network =
            |cell: f32, stream: u32| cell * cell_border_distance(px / cell, py / cell, self.seed.wrapping_add(stream));
        VeinSite {
            main: main.map_or(REACH_MM, |m| m.distance),
            main_half_width: main.map_or(self.main.half_widths[index], |m| m.half_width),
            secondary: limit,
            secondary_half_width: secondary.map_or(self.secondaries[0].half_widths[0], |s| s.half_width),
            tertiary: match &self.tertiaries {
                Tertiaries::Network(cell_mm) => network(*cell_mm, 13),
                Tertiaries::Curves(veins, wander_mm) => {
                    // Not on the greater veins, so that what ends there is seen to end there.
                    let great = limit.min(main.map_or(REACH_MM, |m| m.distance));
                    let free = wander_mm * (1.0 - (-(great / JOIN_MM).powi(2)).exp());
                    veins.distance([x + free * push(15, WANDER_STEP_MM), y + free * push(16, WANDER_STEP_MM)])
                }
            },
            quaternary: network(self.finest_cell_mm, 14),
            across,
            direction: direction_of(pull),
        }
    }
}

/// Returns the tertiaries between all neighbouring veins: lines of points, each from vein to vein or from a rung to
/// another.
fn tertiary_lines(
    main: &Vein,
    secondaries: &[Vein],
    traits: &RungTraits,
    random: &mut Xoshiro256PlusPlus,
) -> Vec<Vec<[f32; 2]>> {
    /// Ratio of the distances on the main vein and on the secondary at which a rung in their angle ends.
    const LEAN: f32 = 0.8;
    let mut lines = Vec::new();
    // Secondaries of one side are every second.
    for (lower, upper) in secondaries.iter().zip(secondaries.iter().skip(2)) {
        let [foot, next_foot] = [lower.points[0], upper.points[0]];
        let gap = next_foot[1] - foot[1];
        let length = (lower.points.len() - 1) as f32 * PIECE_MM;
        // The way along the main vein from one foot to the next, then on along the upper secondary.
        let upper_way = |way: f32| {
            if way < gap { main_point(main, foot[1] + way) } else { upper.point_at((way - gap) * LEAN) }
        };
        let mut way = 0.7 * traits.spacing_mm;
        let mut last_middle: Option<[f32; 2]> = None;
        while way * LEAN < length {
            let uneven = traits.spacing_mm * traits.spacing_jitter;
            // Both ends move together, and little against each other, so that neighbours do not cross.
            let mut shift = |amount: f32| amount * uneven * (random.gen_range(0.0..2.0f32) - 1.0);
            let (both, apart) = (way + shift(0.7), shift(0.5));
            let (a, b) = (lower.point_at((both - apart) * LEAN), upper_way((both + apart).max(0.1)));
            let across = [b[0] - a[0], b[1] - a[1]];
            let normal = [-across[1], across[0]];
            // Bowed towards the leaf's edge, with a kink where it is tied to its neighbour.
            let outward = (normal[0] * (a[0] - foot[0])).signum();
            let bow = outward * traits.bow * (0.6 + 0.8 * random.gen_range(0.0..1.0f32));
            let kink = traits.ties * 0.12 * (random.gen_range(0.0..2.0f32) - 1.0);
            let at = 0.5 + 0.3 * traits.ties * (random.gen_range(0.0..2.0f32) - 1.0);
            let point = move |t: f32| {
                let off = bow * 4.0 * t * (1.0 - t) + kink * (1.0 - (t - at).abs() / at.max(1.0 - at)).max(0.0);
                // Both parts vanish at the ends, so that a rung ends on its veins.
                let ends = (8.0 * t).min(8.0 * (1.0 - t)).clamp(0.0, 1.0);
                [a[0] + t * across[0] + ends * off * normal[0], a[1] + t * across[1] + ends * off * normal[1]]
            };
            lines.push(line(point));
            let middle = point(at);
            if random.gen_range(0.0..1.0f32) < traits.forks {
                let end = upper_way(way + 0.55 * traits.spacing_mm);
                let start = point(0.45);
                lines.push(line(|t| [0, 1].map(|k| start[k] + t * (end[k] - start[k]))));
            }
            if let Some(last) = last_middle
                && random.gen_range(0.0..1.0f32) < traits.ties
            {
                lines.push(line(|t| [0, 1].map(|k| last[k] + t * (middle[k] - last[k]))));
            }
            last_middle = Some(middle);
            way += traits.spacing_mm * (1.0 + 0.5 * traits.spacing_jitter * (random.gen_range(0.0..2.0f32) - 1.0));
        }
    }
    lines
}

/// Returns the point of the main vein at a height.
fn main_point(main: &Vein, y: f32) -> [f32; 2] {
    let step = ((y - main.points[0][1]) / PIECE_MM).clamp(0.0, (main.points.len() - 1) as f32);
    let index = (step as usize).min(main.points.len() - 2);
    let t = step - index as f32;
    [0, 1].map(|k| main.points[index][k] * (1.0 - t) + main.points[index + 1][k] * t)
}

/// Returns the points of a curve over 0 to 1, cut into pieces.
fn line(point: impl Fn(f32) -> [f32; 2]) -> Vec<[f32; 2]> {
    let (a, b) = (point(0.0), point(1.0));
    let length = ((b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2)).sqrt();
    let pieces = (length / FINE_PIECE_MM).ceil().clamp(1.0, 400.0) as usize;
    (0..=pieces).map(|i| point(i as f32 / pieces as f32)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_models::Species;

    use crate::leaf::species::Traits;
    use crate::leaf::venation::traits::VenationTraits;
    use crate::leaf::venation::vein::unit;

    fn traits(species: Option<Species>) -> PinnateTraits {
        match Traits::of(species).venation {
            VenationTraits::Pinnate(traits) => traits,
            VenationTraits::Parallel(_) => panic!("{species:?} is not pinnate"),
        }
    }

    fn grow(species: Option<Species>, seed: u64) -> PinnateVenation {
        PinnateVenation::new(&traits(species), 20.0, 3.0, seed)
    }

    #[test]
    fn a_main_vein_crosses_the_patch_and_secondaries_leave_to_both_sides() {
        for species in [None, Some(Species::Soybean), Some(Species::Tree)] {
            let veins = grow(species, 1);
            for y in [0.0, 10.0, 20.0] {
                let sites = (0..2000).map(|i| veins.site([i as f32 * 0.01, y]));
                let crossings = sites.clone().filter(|site| site.main < 0.01).count();
                assert!(crossings > 0, "the main vein passes at y = {y}");
                let middle = sites.min_by(|a, b| a.main.total_cmp(&b.main)).unwrap();
                assert!(middle.across.abs() < 0.02 && middle.direction[1] > 0.85, "{middle:?}");
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
    }

    #[test]
    fn the_bounded_search_finds_what_the_plain_one_finds() {
        let veins = grow(None, 7);
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
    fn on_a_secondary_the_direction_is_the_secondarys() {
        let veins = grow(Some(Species::Tree), 3);
        let mut seen = 0;
        for vein in &veins.secondaries {
            for pair in vein.points.windows(2).skip(6) {
                let middle = [0, 1].map(|k| 0.5 * (pair[0][k] + pair[1][k]));
                let along = unit([pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]]);
                let d = veins.site(middle).direction;
                // The main vein pulls a little, too.
                assert!((d[0] * along[0] + d[1] * along[1]).abs() > 0.97, "{middle:?}");
                // Planted difference: the main vein's direction.
                assert!(d[1] < 0.95);
                seen += 1;
            }
        }
        assert!(seen > 100);
    }

    #[test]
    fn tertiaries_start_and_end_on_the_veins_they_join() {
        for (species, untied) in [(Species::Tree, true), (Species::Soybean, false)] {
            let veins = grow(Some(species), 5);
            let TertiaryTraits::Rungs(rungs) = traits(Some(species)).tertiary else { panic!("no curves") };
            let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
            let lines = tertiary_lines(&veins.main, &veins.secondaries, &rungs, &mut random);
            let greater = |p: [f32; 2]| {
                let near = veins.secondaries.iter().chain([&veins.main]).filter_map(|v| v.nearest(p, 1.0));
                near.map(|n| n.distance).fold(1.0, f32::min)
            };
            let joined = lines.iter().filter(|l| [l[0], l[l.len() - 1]].iter().all(|&p| greater(p) < 1e-2)).count();
            let touching = |p: [f32; 2], of: usize| {
                let others = lines.iter().enumerate().filter(|(i, _)| *i != of).flat_map(|(_, l)| l.windows(2));
                others.map(|pair| Vein::new(pair.to_vec(), vec![0.1; 2])).any(|piece| piece.nearest(p, 0.12).is_some())
            };
            // What does not end on a greater vein ends on another tertiary.
            for (i, line) in lines.iter().enumerate().take(60) {
                for end in [line[0], line[line.len() - 1]] {
                    assert!(greater(end) < 1e-2 || touching(end, i), "{species:?} line {i} ends in the blade");
                }
            }
            assert!(joined * 2 > lines.len() || !untied, "{joined} of {}", lines.len());
        }
    }

    #[test]
    fn a_ladder_is_straighter_and_more_even_than_a_reticulum() {
        // How far the middles of tertiaries lie from the straight lines between their ends.
        let bent = |species| {
            let veins = grow(Some(species), 5);
            let TertiaryTraits::Rungs(rungs) = traits(Some(species)).tertiary else { panic!("no curves") };
            let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
            let lines = tertiary_lines(&veins.main, &veins.secondaries, &rungs, &mut random);
            let bends: Vec<f32> = lines
                .iter()
                .map(|l| {
                    let (a, m, b) = (l[0], l[l.len() / 2], l[l.len() - 1]);
                    let length = ((b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2)).sqrt().max(1e-3);
                    ((b[0] - a[0]) * (m[1] - a[1]) - (b[1] - a[1]) * (m[0] - a[0])).abs() / (length * length)
                })
                .collect();
            let mean = bends.iter().sum::<f32>() / bends.len() as f32;
            bends.iter().map(|b| (b - mean).powi(2)).sum::<f32>() / bends.len() as f32
        };
        assert!(bent(Species::Tree) < 0.7 * bent(Species::Soybean));
    }

    #[test]
    fn seeds_differ_and_repeat() {
        for species in [None, Some(Species::Tree)] {
            let site = |seed| grow(species, seed).site([7.3, 9.1]);
            assert_eq!(site(3), site(3));
            assert_ne!(site(3), site(4));
            assert_ne!(site(3).quaternary, site(4).quaternary);
        }
    }
}

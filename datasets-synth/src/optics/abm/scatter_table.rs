//! BRDF and BTDF of a tissue model for all directions, pigments and wavelengths at once: the table that makes captures
//! of the algorithmic models affordable.
//!
//! For every incidence a beam is traced without absorption; each escaping ray is counted by its direction and by the
//! length of its path through the mesophyll. At a texel the pigments turn every class of lengths into a colour once
//! (`sum over wavelengths of the weight times exp(-k way)`), so that a direction pair costs an interpolation and a sum
//! over the classes.
//!
//! Grid: incidence at 20 cosines, even in their root (dense towards grazing, where the surface reflects more); outgoing
//! in 16 even classes of the cosine and 12 of `cos(phi / 2)`, phi being the azimuth between light and eye, so that
//! forward directions (180 degrees) are the finest; lengths in 16 classes: none at all, then by factors of 1.55 from
//! 0.32 thicknesses. The model is symmetric about the plane of incidence, so phi is folded.
//!
//! Limits: a class of lengths is represented by its mean, which makes the sum too dark by less than 0.5 % of the light
//! that the class carries; lobes narrower than a class are widened (cells of an oblateness above some 20).

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::optics::abm::path_lengths::{BLOCK, Beam, Face, Parallel, block_random};
use crate::optics::abm::stack::Stack;
use crate::optics::abm::walk::{Absorption, End, walk};

/// Number of incidences.
pub(crate) const INCIDENCES: usize = 20;
/// Number of classes of the outgoing cosine.
pub(crate) const COSINES: usize = 16;
/// Number of classes of the azimuth.
pub(crate) const AZIMUTHS: usize = 12;
/// Number of classes of path lengths.
pub(crate) const WAYS: usize = 16;

/// Upper end of the first class of lengths that are not 0, in thicknesses.
const FIRST_WAY: f64 = 0.32;
/// Ratio of the ends of a class.
const WAY_RATIO: f64 = 1.55;

/// Smallest cosine, used for grazing incidence.
const MIN_COSINE: f64 = 1e-3;

/// Position of light and eye relative to each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Passage {
    /// Light and eye on the same side: BRDF.
    Reflection,
    /// Light and eye on opposite sides: BTDF.
    Transmission,
}

/// Table of one face and one passage.
#[derive(Debug, Clone)]
pub struct ScatterTable {
    /// Mean path length of each class.
    ways: [f32; WAYS],
    /// Values of `pi f` by class of lengths, `[incidence, cosine, azimuth]`.
    cells: Vec<[f32; WAYS]>,
}

/// Counts of the rays of one incidence.
struct Incidence {
    /// Number of rays by cell and class of lengths.
    cells: Vec<[f64; WAYS]>,
    /// Number of rays and sum of their lengths, per class of lengths.
    means: [[f64; 2]; WAYS],
}

fn way_class(way: f64) -> usize {
    if way == 0.0 {
        return 0;
    }
    let place = (way / FIRST_WAY).ln() / WAY_RATIO.ln();
    (place.floor().max(-1.0) as i64 + 2).clamp(1, WAYS as i64 - 1) as usize
}

fn incidence_cosine(i: usize) -> f64 {
    let root = i as f64 / (INCIDENCES - 1) as f64;
    (root * root).max(MIN_COSINE)
}

impl ScatterTable {
    /// Traces the table of `stack` for light on `face`, `rays` for each of 20 incidences, in parallel on the current
    /// pool. Equal seeds give equal tables on any number of threads. A million rays take some 5 s on one core for both
    /// passages together; the noise of a cell is then below 3 %.
    pub fn trace(stack: &Stack, face: Face, passage: Passage, rays: u64, seed: u64) -> ScatterTable {
        let [reflected, transmitted] = ScatterTable::trace_both(stack, face, rays, seed);
        match passage {
            Passage::Reflection => reflected,
            Passage::Transmission => transmitted,
        }
    }

    /// Traces the tables of the reflected and of the transmitted light, which are those of [`ScatterTable::trace`].
    pub fn trace_both(stack: &Stack, face: Face, rays: u64, seed: u64) -> [ScatterTable; 2] {
        let traced: Vec<[Incidence; 2]> = (0..INCIDENCES)
            .map(|i| {
                let theta = incidence_cosine(i).acos().to_degrees();
                let beam = Parallel::onto(face, theta);
                let parts: Vec<_> = (0..rays.div_ceil(BLOCK))
                    .into_par_iter()
                    .map(|block| {
                        let mut random = block_random(seed.wrapping_add(i as u64), block);
                        let mut cells = [(); 2].map(|()| vec![[0u32; WAYS]; COSINES * AZIMUTHS]);
                        let mut means = [[[0f64; 2]; WAYS]; 2];
                        for _ in 0..BLOCK.min(rays - block * BLOCK) {
                            let start = beam.direction(&mut random);
                            let End::Escaped { direction, path } =
                                walk(stack, start, Absorption::None, &mut random).end
                            else {
                                continue;
                            };
                            let side = usize::from(direction[2] * start[2] >= 0.0);
                            let class = way_class(path);
                            cells[side][cell_of(direction)][class] += 1;
                            means[side][class][0] += 1.0;
                            means[side][class][1] += path;
                        }
                        (cells, means)
                    })
                    .collect();
                [0, 1].map(|side| {
                    let mut cells = vec![[0f64; WAYS]; COSINES * AZIMUTHS];
                    let mut means = [[0f64; 2]; WAYS];
                    for (part, part_means) in &parts {
                        for (cell, counts) in cells.iter_mut().zip(&part[side]) {
                            (0..WAYS).for_each(|w| cell[w] += f64::from(counts[w]));
                        }
                        for (mean, part) in means.iter_mut().zip(&part_means[side]) {
                            mean[0] += part[0];
                            mean[1] += part[1];
                        }
                    }
                    Incidence { cells, means }
                })
            })
            .collect();
        [0, 1].map(|side| ScatterTable::of(&traced.iter().map(|both| &both[side]).collect::<Vec<_>>(), rays))
    }

    /// Makes a table of the counts of each incidence.
    fn of(traced: &[&Incidence], rays: u64) -> ScatterTable {
        let ways = std::array::from_fn(|class| {
            let (count, sum) =
                traced.iter().fold((0.0, 0.0), |(n, s), i| (n + i.means[class][0], s + i.means[class][1]));
            if count > 0.0 { (sum / count) as f32 } else { 0.0 }
        });
        let cells = traced
            .iter()
            .flat_map(|incidence| incidence.cells.iter().enumerate())
            .map(|(i, cell)| {
                // pi f = pi weight / (N projected solid angle).
                let scale = std::f64::consts::PI / (rays as f64 * projected_solid_angle(i));
                cell.map(|weight| (weight * scale) as f32)
            })
            .collect();
        ScatterTable { ways, cells }
    }

    /// Returns the values of `pi f` by class of lengths, `[incidence, cosine, azimuth]`.
    pub(crate) fn cells(&self) -> &[[f32; WAYS]] {
        &self.cells
    }

    /// Returns the share of light from all around that each class carries out on this side.
    pub(crate) fn diffuse(&self) -> [f64; WAYS] {
        let mut sums = [0.0; WAYS];
        for (number, cell) in self.cells.iter().enumerate() {
            let (incidence, direction) = (number / (COSINES * AZIMUTHS), number % (COSINES * AZIMUTHS));
            // Two cosines times their differential are that of the fourth power of their root.
            let edge = |place: f64| (place / (INCIDENCES - 1) as f64).clamp(0.0, 1.0).powi(4);
            let weight = edge(incidence as f64 + 0.5) - edge(incidence as f64 - 0.5);
            let share = weight * projected_solid_angle(direction) / std::f64::consts::PI;
            (0..WAYS).for_each(|way| sums[way] += share * f64::from(cell[way]));
        }
        sums
    }

    /// Returns the mean path length of each class in thicknesses of the mesophyll.
    pub fn ways(&self) -> [f32; WAYS] {
        self.ways
    }

    /// Returns `pi f` by class of lengths, for the cosines of light and eye from the normals of their own sides (in (0,
    /// 1]) and the cosine of the azimuth between them. Interpolates linearly between the middles of cells.
    #[inline]
    pub fn pi_f(&self, cos_i: f32, cos_o: f32, cos_phi: f32) -> [f32; WAYS] {
        let clamp = |x: f32, last: usize| {
            let x = x.clamp(0.0, last as f32 - 1e-3);
            let cell = x as usize;
            (cell, x - cell as f32)
        };
        let (i, ti) = clamp(cos_i.max(0.0).sqrt() * (INCIDENCES - 1) as f32, INCIDENCES - 1);
        let (c, tc) = clamp(cos_o * COSINES as f32 - 0.5, COSINES - 1);
        let half = (0.5 + 0.5 * cos_phi.clamp(-1.0, 1.0)).sqrt();
        let (a, ta) = clamp(half * AZIMUTHS as f32 - 0.5, AZIMUTHS - 1);
        let mut sum = [0f32; WAYS];
        for (di, wi) in [(0, 1.0 - ti), (1, ti)] {
            for (dc, wc) in [(0, 1.0 - tc), (1, tc)] {
                let row = ((i + di) * COSINES + c + dc) * AZIMUTHS + a;
                for (da, wa) in [(0, 1.0 - ta), (1, ta)] {
                    let weight = wi * wc * wa;
                    let cell = &self.cells[row + da];
                    for w in 0..WAYS {
                        sum[w] += weight * cell[w];
                    }
                }
            }
        }
        sum
    }

    /// Returns the share of light from an incidence of the grid that passes, for the optical depth `k`.
    #[cfg(test)]
    fn hemispherical(&self, incidence: usize, k: f32) -> f64 {
        (0..COSINES * AZIMUTHS)
            .map(|i| {
                let cell = &self.cells[incidence * COSINES * AZIMUTHS + i];
                let left: f32 = (0..WAYS).map(|w| cell[w] * (-k * self.ways[w]).exp()).sum();
                f64::from(left) * projected_solid_angle(i) / std::f64::consts::PI
            })
            .sum()
    }
}

/// Returns the cell of a direction of travel; the light's azimuth is 0.
fn cell_of(direction: [f64; 3]) -> usize {
    let cosine = direction[2].abs().min(1.0);
    let sine = direction[0].hypot(direction[1]);
    let cos_phi = if sine > 0.0 { direction[0] / sine } else { -1.0 };
    let half = (0.5 + 0.5 * cos_phi).max(0.0).sqrt();
    let c = ((cosine * COSINES as f64) as usize).min(COSINES - 1);
    let a = ((half * AZIMUTHS as f64) as usize).min(AZIMUTHS - 1);
    c * AZIMUTHS + a
}

/// Returns the integral of the cosine over a cell `[cosine, azimuth]`, both signs of the azimuth.
fn projected_solid_angle(cell: usize) -> f64 {
    let (c, a) = (cell / AZIMUTHS, cell % AZIMUTHS);
    let edge = |j: usize| j as f64 / COSINES as f64;
    // phi = 2 acos(q); both signs cover 2 (phi_low - phi_high).
    let phi = |j: usize| 2.0 * (j as f64 / AZIMUTHS as f64).min(1.0).acos();
    let azimuth = 2.0 * (phi(a) - phi(a + 1));
    debug_assert!(azimuth > 0.0 && azimuth <= TAU);
    azimuth * (edge(c + 1).powi(2) - edge(c).powi(2)) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::abm::abm97::Abm97;
    use crate::optics::abm::path_lengths::trace_path_lengths;
    use crate::optics::abm::tissue::Tissue;
    use crate::optics::units::Nanometres;

    #[test]
    fn the_cells_cover_the_hemisphere_once() {
        let sum: f64 = (0..COSINES * AZIMUTHS).map(projected_solid_angle).sum();
        assert!((sum - std::f64::consts::PI).abs() < 1e-12, "{sum}");
        assert_eq!(way_class(0.0), 0);
        assert_eq!(way_class(1e-9), 1);
        assert_eq!(way_class(1e9), WAYS - 1);
        let classes: Vec<usize> = (0..400).map(|i| way_class(1.0 + f64::from(i) * 0.1)).collect();
        assert!(classes.windows(2).all(|w| w[0] <= w[1]));
    }

    #[test]
    fn the_table_reflects_and_transmits_what_the_model_does_at_every_absorption() {
        let leaf = Abm97::default();
        let stack = leaf.stack(Nanometres(550.0));
        let tables = [Passage::Reflection, Passage::Transmission]
            .map(|passage| ScatterTable::trace(&stack, Face::Adaxial, passage, 60_000, 1));
        // cos = (15/19)^2, 51.4 degrees.
        let beam = Parallel::onto(Face::Adaxial, incidence_cosine(15).acos().to_degrees());
        let exact = trace_path_lengths(&stack, &beam, 200_000, 2);
        for k in [0.0, 0.2, 0.561, 1.5, 4.0] {
            let (r, t) = (tables[0].hemispherical(15, k), tables[1].hemispherical(15, k));
            let (er, et) = (exact.reflectance(f64::from(k)).mean, exact.transmittance(f64::from(k)).mean);
            assert!((r - er).abs() < 5e-3 && (t - et).abs() < 5e-3, "{k}: {r} {er}, {t} {et}");
        }
    }

    #[test]
    fn lookups_find_the_forward_peak_and_stay_finite_everywhere() {
        let stack = Abm97::default().stack(Nanometres(550.0));
        let table = ScatterTable::trace(&stack, Face::Adaxial, Passage::Reflection, 40_000, 1);
        let surface = |cos_i, cos_o, cos_phi| table.pi_f(cos_i, cos_o, cos_phi)[0];
        assert!(surface(0.5, 0.5, -1.0) > 5.0 * surface(0.5, 0.5, 1.0), "the mirror direction is the brightest");
        for cos_i in [-1.0, 0.0, 1e-6, 0.5, 1.0, 1.5] {
            for cos_o in [-1.0, 0.0, 0.3, 1.0, 2.0] {
                for cos_phi in [-2.0, -1.0, 0.0, 1.0, 2.0] {
                    assert!(table.pi_f(cos_i, cos_o, cos_phi).iter().all(|x| x.is_finite() && *x >= 0.0));
                }
            }
        }
    }

    #[test]
    fn threads_do_not_matter() {
        let stack = Abm97::default().stack(Nanometres(550.0));
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| ScatterTable::trace(&stack, Face::Abaxial, Passage::Transmission, 9000, 1)).cells
        };
        assert_eq!(on(1), on(3));
    }
}

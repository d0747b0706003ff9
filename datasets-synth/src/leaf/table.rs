//! Table of an algorithmic model for viewers: the classes of ways of [`ScatterTable`] merged into few.
//!
//! Each class is divided between the two kept ones that lie about it, by least squares over the optical depths from 0.05 to 8, so that
//! the light without absorption stays as it is; the kept lengths are those with the least error over these depths under light
//! from all around. Limits: those of [`ScatterTable`], and half floats.

use half::f16;

use btf_models::{CLASSES, LeafTable, TABLE_GRID};

use crate::error::SynthError;
use crate::leaf::model::LeafModel;
use crate::leaf::tissue_leaf::traced_at;
use crate::optics::abm::path_lengths::Face;
use crate::optics::abm::scatter_table::{AZIMUTHS, COSINES, INCIDENCES, ScatterTable, WAYS};
use crate::optics::colour::{RgbBands, RgbFromSpectrum};
use crate::optics::units::Nanometres;
use crate::surface::capture::Progress;

// The file has the grid of what is traced.
const _: () = assert!(TABLE_GRID[0] == INCIDENCES && TABLE_GRID[1] == COSINES && TABLE_GRID[2] == AZIMUTHS);

/// First and last wavelength of the depths in nm, and their distance.
const ROWS_NM: [usize; 3] = [400, 780, 10];
/// Number of optical depths that errors are summed over, the first of them, and the last over it.
const DEPTHS: usize = 16;
const FIRST_DEPTH: f64 = 0.05;
const DEPTH_RANGE: f64 = 160.0;
/// Number of lengths that are tried for each class.
const TRIED: usize = 20;
/// Faces in the order of the table.
const FACES: [Face; 2] = [Face::Adaxial, Face::Abaxial];

/// Traces the table of a model with `rays` rays for each of 20 incidences of a face. `unit` is the model with 1 ug/cm2 of chlorophyll
/// and of carotenoids, on which no ray depends; `own_pigments` are those of its own leaf, ug/cm2. Returns `None` for a model of
/// plates.
///
/// # Errors
/// [`SynthError::Stopped`].
pub fn leaf_table(
    unit: &LeafModel,
    own_pigments: [f32; 2],
    rays: u64,
    seed: u64,
    progress: Progress,
) -> Result<Option<LeafTable>, SynthError> {
    let Some(tissue) = unit.tissue() else { return Ok(None) };
    let traced_nm = traced_at(tissue, &RgbFromSpectrum::new(RgbBands::Spectral31));
    let mut tables = Vec::new();
    let total = FACES.len() * traced_nm.len();
    for face in FACES {
        for nm in &traced_nm {
            if progress(tables.len(), total).is_break() {
                return Err(SynthError::Stopped);
            }
            tables.push(ScatterTable::trace_both(&tissue.stack(*nm), face, rays, seed));
        }
    }
    let mut cells = Vec::with_capacity(4 * traced_nm.len() * TABLE_GRID.iter().product::<usize>());
    let mut ways = [[0.0; CLASSES]; 4];
    for (face, of_face) in tables.chunks(traced_nm.len()).enumerate() {
        for side in 0..2 {
            let channels: Vec<&ScatterTable> = of_face.iter().map(|table| &table[side]).collect();
            let merged = Merged::of(&channels);
            for table in channels {
                let ways = table.ways();
                cells.extend(table.cells().iter().map(|cell| merged.cell(&ways, cell)));
            }
            ways[2 * face + side] = merged.ways.map(|way| way as f32);
        }
    }
    let rows = (ROWS_NM[0]..=ROWS_NM[1]).step_by(ROWS_NM[2]).map(|nm| {
        let parts = tissue.depth_parts(Nanometres(nm as f64));
        [nm as f32, parts.chlorophyll.0 as f32, parts.carotenoid.0 as f32, parts.rest.0 as f32]
    });
    Ok(Some(LeafTable { model: unit.name().to_owned(), own_pigments, rows: rows.collect(), ways, cells }))
}

/// Returns the optical depths that errors are summed over, evenly spaced in their logarithm.
fn depths() -> impl Iterator<Item = f64> {
    (0..DEPTHS).map(|i| FIRST_DEPTH * DEPTH_RANGE.powf(i as f64 / (DEPTHS - 1) as f64))
}

/// Lengths of ways that are kept.
#[derive(Debug, Clone, Copy)]
struct Merged {
    /// Ascending; the first is the surface.
    ways: [f64; CLASSES],
}

impl Merged {
    /// Finds the best lengths.
    fn of(tables: &[&ScatterTable]) -> Merged {
        let all: Vec<([f32; WAYS], [f64; WAYS])> = tables.iter().map(|table| (table.ways(), table.diffuse())).collect();
        let inside = || all.iter().flat_map(|(ways, _)| &ways[1..]).map(|way| f64::from(*way)).filter(|way| *way > 0.0);
        let (least, most) = (inside().fold(f64::MAX, f64::min), inside().fold(0.0, f64::max));
        let tried = |i: usize| least * (most / least).powf(i as f64 / (TRIED - 1) as f64);
        let mut best = (f64::MAX, Merged { ways: [0.0, 0.5, 1.5, 5.0] });
        for a in 0..TRIED {
            for b in a + 1..TRIED {
                for c in b + 1..TRIED {
                    let merged = Merged { ways: [0.0, tried(a), tried(b), tried(c)] };
                    let error = merged.error(&all);
                    if error < best.0 {
                        best = (error, merged);
                    }
                }
            }
        }
        best.1
    }

    /// Returns the shares of a class of length `way` in the kept ones.
    fn shares(&self, way: f64) -> [f64; CLASSES] {
        let mut shares = [0.0; CLASSES];
        let above = self.ways.partition_point(|kept| *kept <= way);
        match above {
            // Nothing of a way through the tissue is the surface.
            _ if way <= 0.0 => shares[0] = 1.0,
            0 | 1 => shares[1] = 1.0,
            CLASSES => shares[CLASSES - 1] = 1.0,
            _ => {
                let (mut product, mut square) = (0.0, 0.0);
                for depth in depths() {
                    let left = |way: f64| (-depth * way).exp();
                    let beyond = left(self.ways[above]);
                    let range = left(self.ways[above - 1]) - beyond;
                    product += range * (left(way) - beyond);
                    square += range * range;
                }
                shares[above - 1] = (product / square).clamp(0.0, 1.0);
                shares[above] = 1.0 - shares[above - 1];
            }
        }
        shares
    }

    /// Returns the sum of squares over optical depths of what leaves each table wrongly under light from all around.
    fn error(&self, tables: &[([f32; WAYS], [f64; WAYS])]) -> f64 {
        let kept: Vec<([f64; CLASSES], &[f32; WAYS], &[f64; WAYS])> = tables
            .iter()
            .map(|(ways, diffuse)| {
                let mut sums = [0.0; CLASSES];
                for (way, light) in ways.iter().zip(diffuse) {
                    let shares = self.shares(f64::from(*way));
                    (0..CLASSES).for_each(|class| sums[class] += shares[class] * light);
                }
                (sums, ways, diffuse)
            })
            .collect();
        depths()
            .map(|k| {
                let of_table = |(sums, ways, diffuse): &([f64; CLASSES], &[f32; WAYS], &[f64; WAYS])| {
                    let merged: f64 = sums.iter().zip(&self.ways).map(|(sum, way)| sum * (-k * way).exp()).sum();
                    let all = diffuse.iter().zip(*ways).map(|(light, way)| light * (-k * f64::from(*way)).exp());
                    (merged - all.sum::<f64>()).powi(2)
                };
                kept.iter().map(of_table).sum::<f64>()
            })
            .sum()
    }

    /// Returns a cell's classes as half floats.
    fn cell(&self, ways: &[f32; WAYS], cell: &[f32; WAYS]) -> [u16; CLASSES] {
        let mut sums = [0.0; CLASSES];
        for (way, value) in ways.iter().zip(cell) {
            let shares = self.shares(f64::from(*way));
            (0..CLASSES).for_each(|class| sums[class] += shares[class] * f64::from(*value));
        }
        sums.map(|sum| f16::from_f64(sum.min(f64::from(f16::MAX))).to_bits())
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::optics::abm::abm97::Abm97;
    use crate::optics::abm::path_lengths::{Diffuse, trace_path_lengths};
    use crate::optics::abm::tissue::Tissue;
    use crate::optics::units::MicrogramsPerSquareCentimetre;

    /// Under light from all around, few classes against every ray's own way.
    #[test]
    fn few_classes_reflect_and_transmit_what_the_model_does_at_every_absorption() {
        let stack = Abm97::default().stack(Nanometres(550.0));
        let tables: Vec<[ScatterTable; 2]> =
            FACES.map(|face| ScatterTable::trace_both(&stack, face, 20_000, 1)).to_vec();
        // Few classes against all, all against the rays, and one length for all ways against the rays, the planted error.
        let (mut few, mut all, mut planted) = (0f64, 0f64, 0f64);
        for (face, table) in FACES.into_iter().zip(&tables) {
            let exact = trace_path_lengths(&stack, &Diffuse { face }, 200_000, 2);
            for (side, table) in table.iter().enumerate() {
                let merged = Merged::of(&[table]);
                for k in [0.0f64, 0.2, 0.561, 1.5, 4.0] {
                    let (mut sum, mut of_all) = (0.0, 0.0);
                    for (way, light) in table.ways().iter().zip(table.diffuse()) {
                        let shares = merged.shares(f64::from(*way));
                        let left = shares.iter().zip(merged.ways).map(|(share, way)| share * (-k * way).exp());
                        sum += light * left.sum::<f64>();
                        of_all += light * (-k * f64::from(*way)).exp();
                    }
                    let truth = match side {
                        0 => exact.reflectance(k).mean,
                        _ => exact.transmittance(k).mean,
                    };
                    few = few.max((sum - of_all).abs());
                    all = all.max((of_all - truth).abs());
                    let light = table.diffuse();
                    let one = light[0] + light[1..].iter().sum::<f64>() * (-k * 2.0).exp();
                    planted = planted.max((one - truth).abs());
                }
            }
        }
        assert!(few < 0.006 && all < 0.01 && planted > 0.05, "{few} {all} {planted}");
    }

    #[test]
    fn a_table_has_its_size_and_depths_for_a_unit_of_each_content() {
        let own = Abm97::default();
        let one = MicrogramsPerSquareCentimetre(1.0);
        let unit = LeafModel::Abm97(Abm97 { chlorophyll: one, carotenoid: one, ..own });
        let go_on = |_: usize, _: usize| ControlFlow::Continue(());
        let table = leaf_table(&unit, [43.62, 0.0], 500, 1, &go_on).unwrap().unwrap();
        assert_eq!((table.model.as_str(), table.cells.len(), table.rows.len()), ("abm97", 4 * 3840, 39));
        let at = |nm: f32| table.rows.iter().find(|row| row[0] == nm).unwrap();
        let told = 43.62 * f64::from(at(550.0)[1]);
        assert!((told - own.depth_parts(Nanometres(550.0)).chlorophyll.0).abs() < 1e-4, "{told}");
        assert!(leaf_table(&LeafModel::default(), [0.0; 2], 500, 1, &go_on).unwrap().is_none());
        let stop = |_: usize, _: usize| ControlFlow::Break(());
        assert!(leaf_table(&unit, [0.0; 2], 500, 1, &stop).is_err());
    }
}

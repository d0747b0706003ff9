//! A layer as a sum of components that samplers may filter: every texel has the same bases, so that the mean of texels'
//! coefficients is the coefficient of their mean. No clusters, no lobes.
//!
//! Bases are the principal components of the texels' values at the measured pairs, in the root curve, rounded to BC7
//! before the texels' coefficients are found by least squares. The rounding of the strongest bases and planes leaves
//! more error than the weakest components take away: those make room for components that repeat a basis or a plane for
//! what its first rounding left.

use crate::error::FitError;
use crate::export::ktx2::filtered::bases::{Bases, Column};
use crate::export::ktx2::filtered::layout::{Layout, MIN_COMPONENTS};
use crate::export::ktx2::filtered::light_map::LightMap;
use crate::export::ktx2::filtered::measured_rows::{MeasuredRows, mean_row};
use crate::export::ktx2::filtered::planes::{Plane, encode_plane, scale_of};
use crate::monitor::Monitor;
use crate::numeric::principal_directions::{ROW_BLOCK, Rows, principal_directions};
use ndarray::{Array1, Array2, Axis, s};
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use std::ops::Range;

/// Blocks of texels that the mean and the components' first variances are taken of.
const SAMPLED_BLOCKS: usize = 48;
/// Texels that principal components are found from at most.
const MAX_ROWS: usize = 65_536;

/// A component: a basis and its coefficients.
pub struct Component {
    /// Number of the basis among [`FilteredLayer::bases`].
    pub basis: usize,
    /// The coefficients at the finest level.
    pub plane: Plane,
    /// The coefficients at the other levels; none for a component that these do without.
    pub coarser: Vec<Plane>,
}

/// A layer's mean, bases and components, the strongest component first.
pub struct FilteredLayer<'a> {
    /// The mean and the rounded bases.
    pub bases: Bases<'a>,
    /// The components; the first [`Layout::coarse`] have all levels.
    pub components: Vec<Component>,
}

/// What a layer is fitted to.
pub struct Source<'a> {
    /// Values of the finest texels.
    pub finest: &'a dyn MeasuredRows,
    /// Values of the coarser levels.
    pub coarser: Vec<&'a dyn MeasuredRows>,
    /// Number of views and lights.
    pub shape: [usize; 2],
}

/// Fits `count` components (an even number) to a layer.
///
/// Cost: the finest texels are read about four times and multiplied by `samples x count` each time; memory: four bytes a
/// texel and component, and blocks of 256 texels.
///
/// # Errors
/// If values cannot be read, or the monitor was cancelled.
pub fn fit_components<'a>(
    source: &Source,
    layout: &Layout,
    map: &'a LightMap,
    count: usize,
    monitor: &Monitor,
) -> Result<FilteredLayer<'a>, FitError> {
    let sampled = spread_blocks(source.finest.order().len());
    let mean = mean_row(source.finest, &sampled)?;
    let mut bases = Bases::new(map, source.shape, layout.tiles, &mean);
    monitor.report("components", 0, 3)?;
    let all = AllLevels::new(source);
    let directions = directions(&all, &bases.mean, count)?;
    monitor.report("components", 1, 3)?;
    let variances = variances(&all, &bases.mean, &directions)?;
    bases.extend(directions.view(), &variances, count);
    let rows_of = bases.solver();
    let project = |rows: &dyn MeasuredRows| project(rows, &bases.mean, &rows_of, monitor);
    let finest = project(source.finest)?;
    let coarser = source.coarser.iter().map(|rows| project(*rows)).collect::<Result<Vec<_>, _>>()?;
    monitor.report("components", 2, 3)?;
    let components = components(&finest, &coarser, layout, &bases.columns, count);
    monitor.report("components", 3, 3)?;
    Ok(FilteredLayer { bases, components })
}

/// Returns ranges of the order of texels, spread over all of them.
fn spread_blocks(texels: usize) -> Vec<Range<usize>> {
    let blocks = texels.div_ceil(ROW_BLOCK);
    let taken = blocks.min(SAMPLED_BLOCKS);
    (0..taken).map(|i| i * blocks / taken * ROW_BLOCK).map(|first| first..(first + ROW_BLOCK).min(texels)).collect()
}

/// Rows of all levels, one after the other. Each level counts half as much as the finer one: a level's means are no means
/// of the finer level's values in a curve, so that the bases of the finest texels alone would not hold them.
struct AllLevels<'a> {
    levels: Vec<Level<'a>>,
}

struct Level<'a> {
    rows: &'a dyn MeasuredRows,
    /// The texels that count.
    order: Vec<u32>,
    /// Factor of the rows.
    weight: f32,
}

/// Returns the weight of a coarser level's texels over that of the finest ones, of which four times as many are there from
/// level to level.
fn weight_of(level: usize) -> f32 {
    2f32.powi(level as i32).sqrt()
}

impl<'a> AllLevels<'a> {
    fn new(source: &Source<'a>) -> AllLevels<'a> {
        let all = std::iter::once(&source.finest).chain(&source.coarser);
        let levels = all.enumerate().map(|(number, rows)| {
            let order = rows.order();
            let every = order.len().div_ceil(MAX_ROWS);
            let order = order.into_iter().step_by(every).collect();
            Level { rows: *rows, order, weight: weight_of(number) * (every as f32).sqrt() }
        });
        AllLevels { levels: levels.collect() }
    }

    fn count(&self) -> usize {
        self.levels.iter().map(|level| level.order.len()).sum()
    }

    /// Returns the rows of a range of all levels' texels, less `mean`, times their levels' weights.
    fn rows(&self, range: Range<usize>, mean: &Array1<f32>) -> Result<Array2<f32>, FitError> {
        let mut parts = Vec::new();
        let mut first = 0;
        for Level { rows, order, weight } in &self.levels {
            let [start, end] = [range.start, range.end].map(|at| at.clamp(first, first + order.len()) - first);
            if start < end {
                parts.push((rows.rows(&order[start..end])? - mean) * *weight);
            }
            first += order.len();
        }
        let views: Vec<_> = parts.iter().map(|part| part.view()).collect();
        Ok(ndarray::concatenate(Axis(0), &views).unwrap_or_else(|_| Array2::zeros((0, mean.len()))))
    }
}

/// Returns the principal directions of the values less `mean`.
fn directions(all: &AllLevels, mean: &Array1<f32>, count: usize) -> Result<Array2<f32>, FitError> {
    let make = |range: Range<usize>| all.rows(range, mean);
    let rows = Rows { count: all.count(), samples: mean.len(), make: &make, gpu: None };
    principal_directions(&rows, count, &mut Xoshiro256PlusPlus::seed_from_u64(0))
}

/// Returns the mean square of each direction's coefficients over a sample of the rows.
fn variances(all: &AllLevels, mean: &Array1<f32>, directions: &Array2<f32>) -> Result<Vec<f64>, FitError> {
    let squares: Vec<(Array1<f64>, usize)> = spread_blocks(all.count())
        .into_par_iter()
        .map(|block| {
            let found = all.rows(block, mean)?.dot(directions);
            Ok((found.mapv(|x| f64::from(x).powi(2)).sum_axis(Axis(0)), found.nrows()))
        })
        .collect::<Result<_, FitError>>()?;
    let texels: usize = squares.iter().map(|(_, count)| count).sum();
    let mut sum = Array1::<f64>::zeros(directions.ncols());
    squares.iter().for_each(|(square, _)| sum += square);
    Ok(sum.iter().map(|sum| sum / texels.max(1) as f64).collect())
}

/// Returns the coefficients `[basis, texel]` of all texels of a level.
fn project(
    rows: &dyn MeasuredRows,
    mean: &Array1<f32>,
    solver: &Array2<f32>,
    monitor: &Monitor,
) -> Result<Array2<f32>, FitError> {
    let order = rows.order();
    let parts: Vec<Array2<f32>> = order
        .par_chunks(ROW_BLOCK)
        .map(|texels| {
            monitor.check()?;
            Ok((rows.rows(texels)? - mean).dot(solver))
        })
        .collect::<Result<_, FitError>>()?;
    let mut found = Array2::zeros((solver.ncols(), order.len()));
    for (texels, part) in order.chunks(ROW_BLOCK).zip(parts) {
        for (texel, coefficients) in texels.iter().zip(part.rows()) {
            found.slice_mut(s![.., *texel as usize]).assign(&coefficients);
        }
    }
    Ok(found)
}

/// A component before its coarser levels are encoded.
struct Candidate {
    basis: usize,
    /// Whether it is what the first plane of the basis left.
    is_repeat: bool,
    plane: Plane,
    /// Sum of its squares over the measured pairs and all levels' texels, with their weights.
    energy: f64,
}

/// Encodes all planes, and again what their rounding left, and returns the `count` strongest.
fn components(
    finest: &Array2<f32>,
    coarser: &[Array2<f32>],
    layout: &Layout,
    columns: &[Column],
    count: usize,
) -> Vec<Component> {
    let size = layout.levels[0];
    let squares = |values: &mut dyn Iterator<Item = &f32>| values.map(|x| f64::from(*x).powi(2)).sum::<f64>();
    let mut candidates: Vec<Candidate> = (0..columns.len())
        .into_par_iter()
        .flat_map_iter(|basis| {
            let values = finest.row(basis).to_vec();
            let levels = coarser.iter().map(|level| level.row(basis));
            let largest = levels.flatten().chain(&values).fold(0.0f32, |most, x| most.max(x.abs()));
            let energy = squares(&mut values.iter())
                + (1..)
                    .zip(coarser)
                    .map(|(level, coarse)| f64::from(weight_of(level)).powi(2) * squares(&mut coarse.row(basis).iter()))
                    .sum::<f64>();
            let plane = encode_plane(&values, size, scale_of(largest));
            let left = less(&values, &plane);
            let largest = left.iter().fold(0.0f32, |most, x| most.max(x.abs()));
            let energy_left = squares(&mut left.iter());
            let repeat = encode_plane(&left, size, scale_of(largest));
            [
                Candidate { basis, is_repeat: false, plane, energy: energy * columns[basis].square },
                Candidate { basis, is_repeat: true, plane: repeat, energy: energy_left * columns[basis].square },
            ]
        })
        .collect();
    // What a plane left is always less than the plane; of coarser levels it is not asked for.
    candidates.sort_by(|a, b| b.energy.total_cmp(&a.energy));
    candidates.truncate(count);
    // A material of one colour has a basis or two; textures have a few.
    while candidates.len() < MIN_COMPONENTS {
        let plane = encode_plane(&vec![0.0; finest.ncols()], size, scale_of(0.0));
        candidates.push(Candidate { basis: 0, is_repeat: true, plane, energy: 0.0 });
    }
    let scales: Vec<f32> = (0..columns.len())
        .map(|basis| {
            let first = candidates.iter().find(|candidate| candidate.basis == basis && !candidate.is_repeat);
            first.map_or(1.0, |candidate| candidate.plane.scale)
        })
        .collect();
    let coarse = Layout::coarse(candidates.len());
    let levels_of = |number: usize, Candidate { basis, is_repeat, plane, .. }: Candidate| {
        let levels = coarser.iter().zip(&layout.levels[1..]).filter(|_| number < coarse);
        let coarser = levels
            .map(|(values, size)| {
                let values = values.row(basis).to_vec();
                let first = encode_plane(&values, *size, scales[basis]);
                if is_repeat { encode_plane(&less(&values, &first), *size, plane.scale) } else { first }
            })
            .collect();
        Component { basis, plane, coarser }
    };
    candidates.into_par_iter().enumerate().map(|(number, candidate)| levels_of(number, candidate)).collect()
}

/// Returns what `plane` leaves of coefficients.
fn less(values: &[f32], plane: &Plane) -> Vec<f32> {
    values.iter().zip(plane.decoded()).map(|(x, y)| x - y).collect()
}

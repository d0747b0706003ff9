//! A layer as a sum of components that samplers may filter: every texel has the same bases, so that the mean of texels'
//! coefficients is the coefficient of their mean. No clusters, no lobes.
//!
//! Bases are the principal components of the texels' values at the measured pairs, in the root curve, rounded to BC7
//! before the texels' coefficients are found by least squares. The rounding of the strongest bases and planes leaves
//! more error than the weakest components take away: those make room for components that repeat a basis or a plane for
//! what its first rounding left.

use crate::error::FitError;
use crate::export::ktx2::filtered::bases::{Bases, Column};
use crate::export::ktx2::filtered::layout::Layout;
use crate::export::ktx2::filtered::light_map::LightMap;
use crate::export::ktx2::filtered::measured_rows::{MeasuredRows, mean_row};
use crate::export::ktx2::filtered::planes::{Plane, encode_plane, scale_of};
use crate::monitor::Monitor;
use crate::stages::principal_directions::{ROW_BLOCK, Rows, principal_directions};
use ndarray::{Array1, Array2, Axis, s};
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use std::ops::Range;

/// Blocks of texels that the mean and the components' first variances are taken of.
const SAMPLED_BLOCKS: usize = 48;
/// Texels that principal components are found from at most.
const MOST_ROWS: usize = 65_536;

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
    let order = source.finest.order();
    let sampled = spread_blocks(order.len());
    let mean = mean_row(source.finest, &sampled)?;
    let mut bases = Bases::new(map, source.shape, layout.tiles, &mean);
    monitor.report("components", 0, 3)?;
    let directions = directions(source, &order, &bases.mean, count)?;
    monitor.report("components", 1, 3)?;
    let variances = variances(source, &order, &sampled, &bases.mean, &directions)?;
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

/// Returns the principal directions of the values less `mean`.
fn directions(source: &Source, order: &[u32], mean: &Array1<f32>, count: usize) -> Result<Array2<f32>, FitError> {
    let every = order.len().div_ceil(MOST_ROWS);
    let chosen: Vec<u32> = order.iter().step_by(every).copied().collect();
    let make = |range: Range<usize>| Ok(source.finest.rows(&chosen[range])? - mean);
    let rows = Rows { count: chosen.len(), samples: mean.len(), make: &make };
    principal_directions(&rows, count, &mut Xoshiro256PlusPlus::seed_from_u64(0))
}

/// Returns the mean square of each direction's coefficients over the sampled texels.
fn variances(
    source: &Source,
    order: &[u32],
    sampled: &[Range<usize>],
    mean: &Array1<f32>,
    directions: &Array2<f32>,
) -> Result<Vec<f64>, FitError> {
    let squares: Vec<(Array1<f64>, usize)> = sampled
        .par_iter()
        .map(|block| {
            let found = (source.finest.rows(&order[block.clone()])? - mean).dot(directions);
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
    /// Sum of its squares over the finest texels and the measured pairs.
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
    let energy = |values: &[f32], basis: usize| -> f64 {
        values.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() * columns[basis].square
    };
    let mut candidates: Vec<Candidate> = (0..columns.len())
        .into_par_iter()
        .flat_map_iter(|basis| {
            let values = finest.row(basis).to_vec();
            let levels = coarser.iter().map(|level| level.row(basis));
            let largest = levels.flatten().chain(&values).fold(0.0f32, |most, x| most.max(x.abs()));
            let plane = encode_plane(&values, size, scale_of(largest));
            let left = less(&values, &plane);
            let largest = left.iter().fold(0.0f32, |most, x| most.max(x.abs()));
            let repeat = encode_plane(&left, size, scale_of(largest));
            [
                Candidate { basis, is_repeat: false, plane, energy: energy(&values, basis) },
                Candidate { basis, is_repeat: true, plane: repeat, energy: energy(&left, basis) },
            ]
        })
        .collect();
    // What a plane left is always less than the plane.
    candidates.sort_by(|a, b| b.energy.total_cmp(&a.energy));
    candidates.truncate(count);
    let scales: Vec<f32> = (0..columns.len())
        .map(|basis| {
            let first = candidates.iter().find(|candidate| candidate.basis == basis && !candidate.is_repeat);
            first.map_or(1.0, |candidate| candidate.plane.scale)
        })
        .collect();
    let coarse = Layout::coarse(count);
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

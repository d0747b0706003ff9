//! Displacement of the texels, found in the capture itself: a plane sweep over the measured views [Collins 1996] tells
//! at which height a texel looks alike from most of them, and semi-global matching smooths the heights along rows and
//! columns [Hirschmuller 2008]. Several ways of comparing views are tried; the one that predicts the steepest views
//! best is taken, and none if no one predicts them better than no heights at all.

use crate::error::FitError;
use crate::input::layer_frame::layer_directions;
use crate::input::rounds::Rounds;
use crate::input::tile_cache::{Mapping, TileCache};
use crate::monitor::Monitor;
use crate::stages::slopes::{integrate_slopes, slopes_from_shading};
use btf_capture::CaptureInfo;
use btf_runtime::{Heights, SeenBy, Sphere};
use rayon::prelude::*;

/// Least cosine with the normal of the views that are compared (61 degrees), and of the view that they are compared
/// with (20 degrees), from which every point is seen.
const MIN_COS: f32 = 0.484;
const REFERENCE_COS: f32 = 0.939;
/// Number of views at most; number of lights, which are between 15 and 65 degrees off the pole, where shadows are short
/// and slopes show.
const MAX_VIEWS: usize = 56;
const LIGHTS: usize = 12;
const LIGHT_COS: [f32; 2] = [0.42, 0.97];
/// Greatest height up and down that is tried, and the step between heights, in texel widths.
const MAX_HEIGHT: f32 = 10.0;
const SWEEP_STEP: f32 = 0.5;
/// Share of the heights that is cut at either end of their range.
const STANDING_OUT: f32 = 0.002;
/// Finest step of the stored heights in texel widths.
const MIN_STEP: f32 = 0.125;
/// Limit of a difference of encoded values: where a texel is hidden, the size of the difference says nothing.
const MAX_DIFFERENCE: f32 = 0.16;
/// Shares of the views, those in which a texel looks most alike, whose mean is its cost: in the other views the texel
/// is hidden.
const SHARES: [f32; 3] = [0.1, 0.2, 1.0];
/// Cost of a step of height, and of a jump, between neighbours.
const STEP_COST: f32 = 0.002;
const JUMP_COST: f32 = 0.01;
/// Radius in texels of the mean that the high-pass comparison takes off.
const SMOOTH_RADIUS: usize = 4;
/// Share of the views, the steepest, that is predicted from the others, as eyes outside the hull are from all; strides
/// of the views, lights and texels that the prediction is measured on.
const STEEPEST: f32 = 0.25;
const FORETOLD_VIEWS: usize = 8;
const FORETOLD_LIGHTS: usize = 6;
const FORETOLD_EVERY: usize = 5;
/// Greatest cosine with the normal of the lights whose shading tells slopes (30 degrees), their least number, and the
/// greatest.
const SHADED_COS: f32 = 0.87;
const MIN_SHADED: usize = 8;
const MAX_SHADED: usize = 96;
/// Weights of the found heights against the slopes that the shading tells, which are tried, slopes first.
const FIDELITIES: [f64; 4] = [0.1, 1.0, 3.0, 10.0];
/// Share by which the error of a weight may be larger than the least for it to be taken before later ones: slopes matter
/// more for shading than the prediction shows.
const NEAR_LEAST: f64 = 0.03;
/// Offsets of all heights that are tried, texel widths.
const OFFSETS: [f32; 7] = [0.0, -0.45, -0.3, -0.15, 0.15, 0.3, 0.45];
/// Share of the error without heights that heights must take away to be worth their bytes.
const MIN_GAIN: f64 = 0.03;

/// Quantity by which views are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Feature {
    /// Encoded luma: diffuse materials.
    Value,
    /// Encoded luma over the image's mean.
    Gain,
    /// Encoded luma over the image's mean, less its surroundings: for glossy materials.
    Detail,
}

/// A luma image, row by row.
type Image = Vec<f32>;

/// Function that reads the images of some views and lights, `[view][light]`.
type ReadImages<'a> = dyn Fn(&[usize], &[usize]) -> Result<Vec<Vec<Image>>, FitError> + 'a;

/// Returns the bytes per texel that [`find_heights`] needs: images as they are and as they are compared, and costs of
/// all heights for each share, as they are and smoothed along lines.
pub fn bytes_per_texel() -> usize {
    let sweep = 2 * (MAX_VIEWS + 1) * LIGHTS + (SHARES.len() + 2) * tried().len();
    4 * (sweep + MAX_SHADED + 3 * (FIDELITIES.len() + 3))
}

/// Finds the heights of a capture's texels; `None` if they do not predict views better than no heights.
///
/// Cost: views x lights x heights x texels differences for each of three comparisons. Memory: [`bytes_per_texel`].
pub fn find_heights(cache: &TileCache, info: &CaptureInfo, monitor: &Monitor) -> Result<Option<Heights>, FitError> {
    let views = layer_directions(&info.views, info.side);
    let all_lights = layer_directions(&info.lights, info.side);
    // Of channels in groups the first: others reflect differently.
    let lights = &all_lights[..Rounds::of(&info.lights).lights];
    let size = [info.width, info.height];
    let Some(reference) =
        (0..views.len()).max_by(|&a, &b| views[a][2].total_cmp(&views[b][2])).filter(|&v| views[v][2] > REFERENCE_COS)
    else {
        return Ok(None);
    };
    let others: Vec<usize> = (0..views.len()).filter(|&v| v != reference && views[v][2] > MIN_COS).collect();
    let sloping = (0..lights.len()).filter(|&l| (LIGHT_COS[0]..LIGHT_COS[1]).contains(&lights[l][2]));
    let lit = spread(&sloping.collect::<Vec<_>>(), LIGHTS);
    if others.len() < 4 || lit.is_empty() {
        return Ok(None);
    }
    let others = spread(&others, MAX_VIEWS);
    // Luma in a root curve, as the eye and 8-bit files have it.
    let curve = Mapping::new(cache, |x| x.max(0.0).powf(1.0 / 2.4));
    let image = |view: usize, light: usize| -> Result<Image, FitError> {
        let samples = cache.image(view * all_lights.len() + light, &curve)?;
        Ok(samples.chunks_exact(3).map(|rgb| 0.3 * rgb[0] + 0.5 * rgb[1] + 0.2 * rgb[2]).collect())
    };
    let images = |views: &[usize], lights: &[usize]| -> Result<Vec<Vec<Image>>, FitError> {
        views.par_iter().map(|&view| lights.iter().map(|&light| image(view, light)).collect()).collect()
    };
    let score = Score::new(&views, &spread(&lit, FORETOLD_LIGHTS), &images)?;
    let mut best = (score.error(None, size) * (1.0 - MIN_GAIN), None);
    let sweep = Sweep {
        size,
        reference: images(&[reference], &lit)?.remove(0),
        others: images(&others, &lit)?,
        slopes: others.iter().map(|&view| slope(views[view])).collect(),
    };
    let features = [Feature::Value, Feature::Gain, Feature::Detail];
    for (done, feature) in features.into_iter().enumerate() {
        monitor.report("heights", done, features.len())?;
        for costs in sweep.of_feature(feature).costs(monitor)? {
            for costs in [smoothed(&costs, size), costs] {
                let heights = quantized(&lowest(&costs));
                let error = score.error(Some(&heights), size);
                if error < best.0 {
                    best = (error, Some(heights));
                }
            }
        }
    }
    let Some(found) = best.1 else { return Ok(None) };
    monitor.report("heights", features.len(), features.len())?;
    let (upright, linear) = (reference, Mapping::new(cache, |x| x.max(0.0)));
    let shaded = spread(&(0..lights.len()).filter(|&l| lights[l][2] < SHADED_COS).collect::<Vec<_>>(), MAX_SHADED);
    let luminance = |light: &usize| -> Result<Image, FitError> {
        let samples = cache.image(upright * all_lights.len() + light, &linear)?;
        Ok(samples.chunks_exact(3).map(|rgb| (rgb[0] + rgb[1] + rgb[2]) / 3.0).collect())
    };
    let images = shaded.par_iter().map(luminance).collect::<Result<Vec<_>, FitError>>()?;
    let directions: Vec<[f32; 3]> = shaded.iter().map(|&light| lights[light]).collect();
    Ok(Some(refined(found, size, &images, &directions, &score)))
}

/// Returns the heights that predict the steepest views best: the `found` ones, or those whose slopes are nearer to what
/// the shading of an upright view tells, all of them moved up or down. `images` are luminances `[light][texel]`.
fn refined(found: Heights, size: [usize; 2], images: &[Image], lights: &[[f32; 3]], score: &Score) -> Heights {
    let plain: Vec<f32> = found.codes.iter().map(|code| found.step * f32::from(*code)).collect();
    let mut shapes = Vec::new();
    if images.len() >= MIN_SHADED {
        // Heights that jump from texel to texel would shade each other.
        let gentle = quantized(&blurred(&plain, size));
        let slopes = slopes_from_shading(images, lights, &gentle.field(size));
        shapes.extend(FIDELITIES.map(|fidelity| integrate_slopes(&slopes, &plain, size, fidelity)));
    }
    shapes.push(plain);
    let tried: Vec<(f64, Heights)> = shapes
        .iter()
        .map(|shape| {
            let moved = OFFSETS.map(|offset| quantized(&shape.iter().map(|z| z + offset).collect::<Vec<_>>()));
            let errors = moved.each_ref().map(|heights| score.error(Some(heights), size));
            let best = (0..moved.len()).min_by(|&a, &b| errors[a].total_cmp(&errors[b])).unwrap_or(0);
            (errors[best], moved[best].clone())
        })
        .collect();
    let least = tried.iter().map(|(error, _)| *error).fold(f64::INFINITY, f64::min);
    let near = tried.into_iter().find(|(error, _)| *error <= least * (1.0 + NEAR_LEAST));
    near.map_or(found, |(_, heights)| heights)
}

/// Returns the means of each texel and its neighbours, with weights 1, 2 and 1 along rows and columns.
fn blurred(heights: &[f32], [width, rows]: [usize; 2]) -> Image {
    let along = |image: &[f32], stride: usize, count: usize| -> Image {
        (0..image.len())
            .map(|texel| {
                let place = texel / stride % count;
                let before = if place > 0 { image[texel - stride] } else { image[texel] };
                let after = if place + 1 < count { image[texel + stride] } else { image[texel] };
                0.25 * (before + after) + 0.5 * image[texel]
            })
            .collect()
    };
    along(&along(heights, 1, width), width, rows)
}

/// Returns at most `count` of `all`, evenly spread.
fn spread(all: &[usize], count: usize) -> Vec<usize> {
    let kept = count.min(all.len());
    (0..kept).map(|i| all[(2 * i + 1) * all.len() / (2 * kept)]).collect()
}

/// Returns the columns and rows by which a point one texel width above the surface appears moved towards the eye's
/// side.
fn slope(direction: [f32; 3]) -> [f32; 2] {
    [direction[0] / direction[2], -direction[1] / direction[2]]
}

/// Returns the heights that the sweep tries.
fn tried() -> Vec<f32> {
    let count = (MAX_HEIGHT / SWEEP_STEP) as i32;
    (-count..=count).map(|i| i as f32 * SWEEP_STEP).collect()
}

/// The images of a sweep, `[view][light]`.
struct Sweep {
    size: [usize; 2],
    reference: Vec<Image>,
    others: Vec<Vec<Image>>,
    slopes: Vec<[f32; 2]>,
}

/// Costs `[height][texel]`.
type Costs = Vec<Vec<f32>>;

impl Sweep {
    fn of_feature(&self, feature: Feature) -> Sweep {
        let made = |images: &[Image]| images.iter().map(|image| self.featured(image, feature)).collect::<Vec<_>>();
        Sweep {
            size: self.size,
            reference: made(&self.reference),
            others: self.others.par_iter().map(|images| made(images)).collect(),
            slopes: self.slopes.clone(),
        }
    }

    fn featured(&self, image: &Image, feature: Feature) -> Image {
        match feature {
            Feature::Value => image.clone(),
            Feature::Gain => {
                let mean = image.iter().sum::<f32>() / image.len() as f32;
                // As bright as the typical image, so that the costs keep their meaning.
                image.iter().map(|x| 0.4 * x / mean.max(1e-4)).collect()
            }
            Feature::Detail => {
                let [width, height] = self.size;
                let mut around = image.clone();
                box_mean(&mut around, width);
                let mut turned = transposed(&around, width);
                box_mean(&mut turned, height);
                let around = transposed(&turned, height);
                image.iter().zip(around).map(|(x, mean)| x - mean).collect()
            }
        }
    }

    /// Returns the costs of all heights and texels for each of [`SHARES`].
    fn costs(&self, monitor: &Monitor) -> Result<Vec<Costs>, FitError> {
        let [width, height] = self.size;
        let by_height: Vec<Vec<Vec<f32>>> = tried()
            .into_par_iter()
            .map(|z| {
                monitor.check()?;
                let mut planes = vec![vec![0.0; width * height]; SHARES.len()];
                let mut of_views = vec![vec![0.0; width]; self.others.len()];
                let mut alike = vec![0.0; self.others.len()];
                for row in 0..height {
                    for ((sums, images), slope) in of_views.iter_mut().zip(&self.others).zip(&self.slopes) {
                        self.row_differences(images, row, [-z * slope[0], -z * slope[1]], sums);
                    }
                    for column in 0..width {
                        alike.iter_mut().zip(&of_views).for_each(|(alike, sums)| *alike = sums[column]);
                        means_of_least(&mut alike, |share, mean| planes[share][row * width + column] = mean);
                    }
                }
                Ok(planes)
            })
            .collect::<Result<_, FitError>>()?;
        let mut by_share = vec![Costs::new(); SHARES.len()];
        for planes in by_height {
            by_share.iter_mut().zip(planes).for_each(|(costs, plane)| costs.push(plane));
        }
        Ok(by_share)
    }

    /// Adds to `sums` the mean over the lights of the limited difference between a row of the reference and of `images`
    /// moved by `shift`.
    fn row_differences(&self, images: &[Image], row: usize, shift: [f32; 2], sums: &mut [f32]) {
        let [width, height] = self.size;
        sums.fill(0.0);
        let (left, along) = (shift[0].floor(), shift[0] - shift[0].floor());
        let down = shift[1] - shift[1].floor();
        let of_row = |row: f32| row.clamp(0.0, (height - 1) as f32) as usize * width;
        let first = row as f32 + shift[1].floor();
        let (upper, lower) = (of_row(first), of_row(first + 1.0));
        // Columns whose two neighbours lie within the image.
        let begin = ((-left).max(0.0) as usize).min(width);
        let end = ((width as f32 - 1.0 - left).clamp(0.0, width as f32) as usize).max(begin);
        for (image, reference) in images.iter().zip(&self.reference) {
            let (upper, lower) = (&image[upper..upper + width], &image[lower..lower + width]);
            let reference = &reference[row * width..(row + 1) * width];
            let value = |column: usize| upper[column] + (lower[column] - upper[column]) * down;
            let difference = |x: f32, column: usize| (x - reference[column]).abs().min(MAX_DIFFERENCE);
            for column in (0..begin).chain(end..width) {
                let at = (column as f32 + left).clamp(0.0, (width - 1) as f32) as usize;
                sums[column] += difference(value(at), column);
            }
            let moved = (begin as f32 + left) as usize;
            let count = end - begin;
            let (upper, lower) = (&upper[moved..], &lower[moved..]);
            for i in 0..count {
                let x = upper[i] + (lower[i] - upper[i]) * down;
                let y = upper[i + 1] + (lower[i + 1] - upper[i + 1]) * down;
                sums[begin + i] += (x + (y - x) * along - reference[begin + i]).abs().min(MAX_DIFFERENCE);
            }
        }
        let count = images.len() as f32;
        sums.iter_mut().for_each(|sum| *sum /= count);
    }
}

/// Calls `take(share, mean)` with the mean of the least values for each of [`SHARES`].
fn means_of_least(values: &mut [f32], mut take: impl FnMut(usize, f32)) {
    let counts = SHARES.map(|share| ((share * values.len() as f32) as usize).max(1));
    let middle = counts[SHARES.len() - 2];
    if middle < values.len() {
        values.select_nth_unstable_by(middle, f32::total_cmp);
    }
    values[..middle].sort_unstable_by(f32::total_cmp);
    for (share, count) in counts.into_iter().enumerate() {
        take(share, values[..count].iter().sum::<f32>() / count as f32);
    }
}

/// Replaces every value by the mean of the values within [`SMOOTH_RADIUS`] of it in its row.
fn box_mean(image: &mut [f32], width: usize) {
    let mut sums = vec![0.0f64; width + 1];
    for row in image.chunks_exact_mut(width) {
        for i in 0..width {
            sums[i + 1] = sums[i] + f64::from(row[i]);
        }
        for i in 0..width {
            let (first, end) = (i.saturating_sub(SMOOTH_RADIUS), (i + SMOOTH_RADIUS + 1).min(width));
            row[i] = ((sums[end] - sums[first]) / (end - first) as f64) as f32;
        }
    }
}

fn transposed(image: &[f32], width: usize) -> Image {
    let height = image.len() / width;
    (0..width).flat_map(|column| (0..height).map(move |row| image[row * width + column])).collect()
}

/// Returns costs smoothed by semi-global matching along rows and columns, both ways: neighbours may differ by a step at
/// little cost and by any jump at a larger one.
fn smoothed(costs: &Costs, [width, height]: [usize; 2]) -> Costs {
    let levels = costs.len();
    let lines = |start: &(dyn Fn(usize) -> usize + Sync), stride: isize, count: usize, length: usize| {
        (0..count)
            .into_par_iter()
            .map(|line| {
                let mut sums = vec![0.0f32; length * levels];
                let mut previous = vec![0.0f32; levels];
                for i in 0..length {
                    let texel = (start(line) as isize + i as isize * stride) as usize;
                    let least = previous.iter().copied().fold(f32::INFINITY, f32::min);
                    let now = &mut sums[i * levels..(i + 1) * levels];
                    for level in 0..levels {
                        let mut best = previous[level].min(least + JUMP_COST);
                        if level > 0 {
                            best = best.min(previous[level - 1] + STEP_COST);
                        }
                        if level + 1 < levels {
                            best = best.min(previous[level + 1] + STEP_COST);
                        }
                        now[level] = costs[level][texel] + best - least;
                    }
                    previous.copy_from_slice(now);
                }
                sums
            })
            .collect::<Vec<_>>()
    };
    let mut total = vec![vec![0.0f32; width * height]; levels];
    let mut add = |lines: Vec<Vec<f32>>, texel: &(dyn Fn(usize, usize) -> usize + Sync)| {
        total.par_iter_mut().enumerate().for_each(|(level, plane)| {
            for (line, sums) in lines.iter().enumerate() {
                for (i, sums) in sums.chunks_exact(levels).enumerate() {
                    plane[texel(line, i)] += sums[level];
                }
            }
        });
    };
    add(lines(&|row| row * width, 1, height, width), &|row, i| row * width + i);
    add(lines(&|row| row * width + width - 1, -1, height, width), &|row, i| row * width + width - 1 - i);
    let down = width as isize;
    add(lines(&|column| column, down, width, height), &|column, i| i * width + column);
    add(lines(&|column| (height - 1) * width + column, -down, width, height), &|column, i| {
        (height - 1 - i) * width + column
    });
    total
}

/// Returns the height of least cost of each texel, refined between the tried heights by a parabola.
fn lowest(costs: &Costs) -> Vec<f32> {
    let tried = tried();
    (0..costs[0].len())
        .into_par_iter()
        .map(|texel| {
            let at = |level: usize| costs[level][texel];
            let least = (0..tried.len()).min_by(|&a, &b| at(a).total_cmp(&at(b))).unwrap_or(0);
            let level = least.clamp(1, tried.len() - 2);
            let (a, b, c) = (at(level - 1), at(level), at(level + 1));
            let offset = 0.5 * (a - c) / (a - 2.0 * b + c).max(1e-9);
            tried[level] + SWEEP_STEP * offset.clamp(-0.5, 0.5)
        })
        .collect()
}

/// Returns `heights` as codes. The few that stand out are cut to the others' range: most are mistakes, and every ray
/// walks through that range.
fn quantized(heights: &[f32]) -> Heights {
    let mut sorted = heights.to_vec();
    sorted.sort_unstable_by(f32::total_cmp);
    let cut = (heights.len() as f32 * STANDING_OUT) as usize;
    let (least, most) = (sorted[cut], sorted[heights.len() - 1 - cut]);
    let heights: Vec<f32> = heights.iter().map(|x| x.clamp(least, most)).collect();
    let peak = heights.iter().fold(0.0f32, |peak, x| peak.max(x.abs()));
    let step = MIN_STEP.max(peak / 127.0);
    Heights { step, codes: heights.iter().map(|x| (x / step).round().clamp(-127.0, 127.0) as i8).collect() }
}

/// Views that are predicted from those around them.
struct Score {
    predicted: Vec<Foretold>,
}

struct Foretold {
    direction: [f32; 3],
    truth: Vec<Image>,
    views: [[f32; 3]; 3],
    weights: [f32; 3],
    /// Images of the neighbours, `[neighbour][light]`.
    images: Vec<Vec<Image>>,
}

impl Score {
    fn new(views: &[[f32; 3]], lights: &[usize], images: &ReadImages) -> Result<Score, FitError> {
        let mut by_slope: Vec<usize> = (0..views.len()).collect();
        by_slope.sort_by(|&a, &b| views[a][2].total_cmp(&views[b][2]).then(a.cmp(&b)));
        let (steep, rest) = by_slope.split_at((STEEPEST * views.len() as f32) as usize);
        let sphere = Sphere::new(&rest.iter().map(|&other| views[other]).collect::<Vec<_>>())?;
        let predicted = spread(steep, FORETOLD_VIEWS)
            .into_iter()
            .map(|view| {
                let around = sphere.locate(views[view]);
                let ids = around.ids.map(|id| rest[id as usize]);
                Ok(Foretold {
                    direction: views[view],
                    truth: images(&[view], lights)?.remove(0),
                    views: ids.map(|id| views[id]),
                    weights: around.weights,
                    images: images(&ids, lights)?,
                })
            })
            .collect::<Result<_, FitError>>()?;
        Ok(Score { predicted })
    }

    /// Returns the mean squared error of the predicted views.
    fn error(&self, heights: Option<&Heights>, size: [usize; 2]) -> f64 {
        let field = heights.map(|heights| heights.field(size));
        let errors: Vec<f64> = self
            .predicted
            .par_iter()
            .map(|view| {
                let mut sum = 0.0f64;
                for texel in (0..size[0] * size[1]).step_by(FORETOLD_EVERY) {
                    let seen = match &field {
                        Some(field) => field.seen_by(texel as u32, view.direction, 0.0, &view.views, &view.weights),
                        None => SeenBy { texels: [texel as u32; 3], weights: view.weights },
                    };
                    for (light, truth) in view.truth.iter().enumerate() {
                        let found: f32 =
                            (0..3).map(|v| seen.weights[v] * view.images[v][light][seen.texels[v] as usize]).sum();
                        sum += f64::from((found - truth[texel]).powi(2));
                    }
                }
                sum
            })
            .collect();
        errors.iter().sum::<f64>()
    }
}

#[cfg(test)]
mod tests;

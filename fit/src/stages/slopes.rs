//! Slopes of the texels from their shading under all lights, seen from above: photometric stereo [Woodham 1980] with
//! the shadows that known heights cast left out, and with weights that let go of highlights and of other outliers.

use btf_runtime::{HeightField, lit_share};
use rayon::prelude::*;

/// Number of rounds in which outliers lose weight.
const ROUNDS: usize = 4;
/// Multiple of the median error at which a light has half of its weight, and that of the first round.
const OUTLIER: f32 = 1.5;
const FIRST_OUTLIER: f32 = 4.5;
/// Even light besides the lamp, as a share of the lamp: light that the surface itself reflects.
const EVEN_LIGHT: f32 = 0.1;
/// Least cosine of a normal, and steepest slope.
const MIN_COS: f32 = 0.05;
const MAX_SLOPE: f32 = 4.0;

/// Returns the slope of each texel along columns and rows, texel widths of height per texel width. `images` are linear
/// luminances `[light][texel]` of an upright view under `lights`, unit vectors; `field` are heights that cast about the
/// shadows that are seen.
///
/// Cost: for each texel its horizons, and a system of three equations for each round.
pub fn slopes_from_shading(images: &[Vec<f32>], lights: &[[f32; 3]], field: &HeightField) -> Vec<[f32; 2]> {
    let width = field.size()[0];
    (0..images.first().map_or(0, Vec::len))
        .into_par_iter()
        .map(|texel| {
            let horizons = field.horizons([(texel % width) as f32, (texel / width) as f32]);
            let lit: Vec<f32> = lights.iter().map(|light| lit_share(&horizons, *light).powi(2)).collect();
            let values: Vec<f32> = images.iter().map(|image| image[texel]).collect();
            slope_of(&values, lights, &lit)
        })
        .collect()
}

/// Returns the slope of a texel from its `values` under `lights`, which count as far as they are `lit`.
fn slope_of(values: &[f32], lights: &[[f32; 3]], lit: &[f32]) -> [f32; 2] {
    let mut weights = lit.to_vec();
    let mut m = [0.0f32; 3];
    for round in 0..ROUNDS {
        m = weighted_fit(values, lights, &weights);
        let predicted: Vec<f32> = lights.iter().map(|l| (m[0] * l[0] + m[1] * l[1] + m[2] * l[2]).max(0.0)).collect();
        let errors: Vec<f32> = values.iter().zip(&predicted).map(|(value, p)| (value - p).abs()).collect();
        let mut sorted = errors.clone();
        sorted.sort_unstable_by(f32::total_cmp);
        let scale = if round == 0 { FIRST_OUTLIER } else { OUTLIER } * sorted[sorted.len() / 2] + 1e-4;
        for (i, weight) in weights.iter_mut().enumerate() {
            *weight = if predicted[i] > 0.0 || round == 0 { lit[i] / (1.0 + (errors[i] / scale).powi(2)) } else { 0.0 };
        }
    }
    let length = m.iter().map(|x| x * x).sum::<f32>().sqrt();
    // Even light comes from above, and would make slopes look gentler than they are.
    let up = (m[2] - EVEN_LIGHT / (1.0 + EVEN_LIGHT) * length).max(MIN_COS * length + 1e-6);
    // Rows run against y.
    [-m[0] / up, m[1] / up].map(|slope| slope.clamp(-MAX_SLOPE, MAX_SLOPE))
}

/// Returns the vector whose products with `lights` are nearest to `values` with these weights.
fn weighted_fit(values: &[f32], lights: &[[f32; 3]], weights: &[f32]) -> [f32; 3] {
    let (mut a, mut b) = ([[0.0f64; 3]; 3], [0.0f64; 3]);
    for ((value, light), weight) in values.iter().zip(lights).zip(weights) {
        for i in 0..3 {
            let weighted = f64::from(weight * light[i]);
            b[i] += weighted * f64::from(*value);
            (0..3).for_each(|j| a[i][j] += weighted * f64::from(light[j]));
        }
    }
    (0..3).for_each(|i| a[i][i] += 1e-3);
    // Cramer's rule; the matrix is positive definite.
    let minor = |i: usize, j: usize| {
        let ([i1, i2], [j1, j2]) = ([(i + 1) % 3, (i + 2) % 3], [(j + 1) % 3, (j + 2) % 3]);
        a[i1][j1] * a[i2][j2] - a[i1][j2] * a[i2][j1]
    };
    let determinant: f64 = (0..3).map(|j| a[0][j] * minor(0, j)).sum();
    [0, 1, 2].map(|i| ((0..3).map(|j| minor(j, i) * b[j]).sum::<f64>() / determinant) as f32)
}

/// Returns the heights whose differences are nearest to `slopes` between texel centres, and which are near `heights`:
/// least squares, with weight `fidelity` for a height against 1 for a difference.
///
/// Cost: by conjugate gradients, about 30 passes over the texels for each power of ten of `1 / fidelity`.
pub fn integrate_slopes(slopes: &[[f32; 2]], heights: &[f32], [width, rows]: [usize; 2], fidelity: f64) -> Vec<f32> {
    // The pairs of neighbours, each with the axis between them.
    let neighbours = |texel: usize| {
        let (column, row) = (texel % width, texel / width);
        [(column + 1 < width).then_some((texel + 1, 0)), (row + 1 < rows).then_some((texel + width, 1))]
    };
    let mut right: Vec<f64> = heights.iter().map(|z| fidelity * f64::from(*z)).collect();
    for texel in 0..heights.len() {
        for (next, axis) in neighbours(texel).into_iter().flatten() {
            let step = f64::from(0.5 * (slopes[texel][axis] + slopes[next][axis]));
            right[texel] -= step;
            right[next] += step;
        }
    }
    let apply = |x: &[f64]| -> Vec<f64> {
        let of_texel = |texel: usize| {
            let (column, row) = (texel % width, texel / width);
            let mut sum = fidelity * x[texel];
            let around = [
                (column > 0).then(|| texel - 1),
                (column + 1 < width).then_some(texel + 1),
                (row > 0).then(|| texel - width),
                (row + 1 < rows).then_some(texel + width),
            ];
            around.into_iter().flatten().for_each(|other| sum += x[texel] - x[other]);
            sum
        };
        (0..x.len()).into_par_iter().map(of_texel).collect()
    };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut x: Vec<f64> = heights.iter().map(|z| f64::from(*z)).collect();
    let mut residual: Vec<f64> = right.iter().zip(apply(&x)).map(|(b, a)| b - a).collect();
    let mut direction = residual.clone();
    let (mut square, goal) = (dot(&residual, &residual), 1e-10 * dot(&right, &right));
    for _ in 0..500 {
        if square <= goal {
            break;
        }
        let applied = apply(&direction);
        let step = square / dot(&direction, &applied);
        x.iter_mut().zip(&direction).for_each(|(x, d)| *x += step * d);
        residual.iter_mut().zip(&applied).for_each(|(r, a)| *r -= step * a);
        let next = dot(&residual, &residual);
        direction.iter_mut().zip(&residual).for_each(|(d, r)| *d = r + next / square * *d);
        square = next;
    }
    x.into_iter().map(|z| z as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_runtime::Heights;

    const SIZE: [usize; 2] = [40, 30];

    fn relief(column: f32, row: f32) -> f32 {
        0.8 * (column * 0.5).sin() + 0.5 * (row * 0.4 + 1.0).cos()
    }

    fn relief_slope(column: f32, row: f32) -> [f32; 2] {
        [0.4 * (column * 0.5).cos(), -0.2 * (row * 0.4 + 1.0).sin()]
    }

    fn lights() -> Vec<[f32; 3]> {
        (0..24)
            .map(|i| {
                let (phi, z) = (i as f32 * 2.4, 0.35 + 0.02 * i as f32);
                let r = (1.0 - z * z).sqrt();
                [r * phi.cos(), r * phi.sin(), z]
            })
            .collect()
    }

    fn places() -> impl Iterator<Item = (f32, f32)> {
        (0..SIZE[0] * SIZE[1]).map(|texel| ((texel % SIZE[0]) as f32, (texel / SIZE[0]) as f32))
    }

    fn flat() -> Heights {
        Heights { step: 0.125, codes: vec![0; SIZE[0] * SIZE[1]] }
    }

    /// Mean difference of two lists of slopes, leaving out the border.
    fn difference(a: &[[f32; 2]], b: &[[f32; 2]]) -> f32 {
        a.iter().zip(b).map(|(a, b)| (a[0] - b[0]).abs() + (a[1] - b[1]).abs()).sum::<f32>() / a.len() as f32
    }

    #[test]
    fn slopes_come_back_from_shading_with_highlights() {
        let lights = lights();
        let truth: Vec<[f32; 2]> = places().map(|(c, r)| relief_slope(c, r)).collect();
        // A Lambertian surface in even light, whose albedo varies, with a highlight under every eighth light.
        let image = |(number, light): (usize, &[f32; 3])| -> Vec<f32> {
            truth
                .iter()
                .enumerate()
                .map(|(texel, [p, q])| {
                    let length = (1.0 + p * p + q * q).sqrt();
                    let cosine = (-p * light[0] + q * light[1] + light[2]).max(0.0) / length;
                    let highlight = if (number + texel) % 8 == 0 { 0.5 } else { 0.0 };
                    (0.3 + 0.2 * (texel as f32).sin()) * cosine + highlight
                })
                .collect()
        };
        let images: Vec<Vec<f32>> = lights.iter().enumerate().map(image).collect();
        let heights = flat();
        let found = slopes_from_shading(&images, &lights, &heights.field(SIZE));
        // What even light would add to upright slopes is taken off, so those of this lamp alone come out a tenth steeper.
        let steeper: Vec<[f32; 2]> = truth.iter().map(|slope| slope.map(|x| 1.1 * x)).collect();
        assert!(difference(&found, &steeper) < 0.05, "{}", difference(&found, &steeper));
        // Planted difference: rows that run along y.
        let turned: Vec<[f32; 2]> = steeper.iter().map(|slope| [slope[0], -slope[1]]).collect();
        assert!(difference(&found, &turned) > 0.1, "{}", difference(&found, &turned));
    }

    #[test]
    fn heights_come_back_from_their_slopes_and_from_rough_heights() {
        let slopes: Vec<[f32; 2]> = places().map(|(c, r)| relief_slope(c, r)).collect();
        let truth: Vec<f32> = places().map(|(c, r)| relief(c, r)).collect();
        // Rough heights: right on average over a few texels, with steps.
        let rough: Vec<f32> = truth.iter().enumerate().map(|(i, z)| z + if i % 2 == 0 { 0.3 } else { -0.3 }).collect();
        let error = |heights: &[f32]| -> f32 {
            heights.iter().zip(&truth).map(|(a, b)| (a - b).abs()).sum::<f32>() / truth.len() as f32
        };
        let found = integrate_slopes(&slopes, &rough, SIZE, 0.1);
        assert!(error(&found) < 0.05, "{}", error(&found));
        assert!(error(&rough) > 0.25);
        // Planted difference: slopes of the other axis.
        let turned: Vec<[f32; 2]> = slopes.iter().map(|slope| [slope[1], slope[0]]).collect();
        assert!(error(&integrate_slopes(&turned, &rough, SIZE, 0.1)) > 0.2);
        // With much fidelity the heights stay.
        let kept = integrate_slopes(&slopes, &rough, SIZE, 1e6);
        assert!(kept.iter().zip(&rough).all(|(a, b)| (a - b).abs() < 1e-3));
    }
}

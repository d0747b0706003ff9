//! Directional albedo of a leaf's gloss: the table that couples it to the body.

use crate::leaf::lobe::fresnel;
use crate::leaf::state::LeafState;
use crate::leaf::words::{ALBEDO_COLUMNS, ALBEDO_ROWS};
use std::f64::consts::PI;

/// Number of strata of the facets' slope.
const SLOPES: usize = 48;
/// Number of strata of the facets' azimuth.
const AZIMUTHS: usize = 64;

/// Computes the table in the order of its words, and its cosine-weighted mean over the hemisphere. Costs some
/// milliseconds with one roughness, ten times that with two.
pub(crate) fn albedo_table(state: &LeafState) -> (Vec<f32>, f32) {
    let gamma = [state.gamma_along, state.gamma_across].map(f64::from);
    let cosine_of = |row: usize| (row as f64 / (ALBEDO_ROWS - 1) as f64).powi(2).max(1e-6);
    let table: Vec<f32> = (0..ALBEDO_ROWS)
        .flat_map(|row| {
            let cosine = cosine_of(row);
            let at =
                |azimuth_cos_squared| directional_albedo(state.gloss_index, gamma, cosine, azimuth_cos_squared) as f32;
            match gamma[0] == gamma[1] {
                true => [at(1.0); ALBEDO_COLUMNS],
                false => std::array::from_fn(|column| at(azimuth_of(gamma, column))),
            }
        })
        .collect();
    // Over even steps of the root of the cosine c = s^2: 2 c dc = 4 s^3 ds, by the trapezium rule; over the azimuth the
    // mean of the columns at even turns.
    let over_azimuth = |row: usize| -> f64 {
        let turns = 32;
        let at = |turn: usize| {
            let share = (0.5 * PI * (turn as f64 + 0.5) / turns as f64).cos().powi(2);
            let cut = (gamma[1].powi(2) + (gamma[0].powi(2) - gamma[1].powi(2)) * share).sqrt();
            let [least, most] = [gamma[0].min(gamma[1]), gamma[0].max(gamma[1])];
            let position = (cut - least) / (most - least).max(1e-9) * (ALBEDO_COLUMNS - 1) as f64;
            let column = (position as usize).min(ALBEDO_COLUMNS - 2);
            let entry = |column: usize| f64::from(table[row * ALBEDO_COLUMNS + column]);
            entry(column) + (entry(column + 1) - entry(column)) * (position - column as f64).clamp(0.0, 1.0)
        };
        (0..turns).map(at).sum::<f64>() / turns as f64
    };
    let last = ALBEDO_ROWS - 1;
    let weight = |row: usize| (row as f64).powi(3) * if row == last { 0.5 } else { 1.0 };
    let sum: f64 = (0..=last).map(|row| weight(row) * over_azimuth(row)).sum();
    let mean = sum / (0..=last).map(weight).sum::<f64>();
    (table, mean as f32)
}

/// Returns the squared cosine of the azimuth from the veins at which a vertical plane cuts the roughness of a column,
/// for two roughnesses that differ.
fn azimuth_of([along, across]: [f64; 2], column: usize) -> f64 {
    let cut = along.min(across) + (along - across).abs() * column as f64 / (ALBEDO_COLUMNS - 1) as f64;
    ((cut * cut - across * across) / (along * along - across * across)).clamp(0.0, 1.0)
}

/// Returns the share of the light from a direction of cosine `cosine` that the gloss reflects: the mean of `F G (w.h) /
/// (cosine n.h)` over facets drawn from their density, by midpoints. 0 to 1.
fn directional_albedo(index: f32, [along, across]: [f64; 2], cosine: f64, azimuth_cos_squared: f64) -> f64 {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let w = [sine * azimuth_cos_squared.sqrt(), sine * (1.0 - azimuth_cos_squared).max(0.0).sqrt()];
    let mut sum = 0.0;
    for turn in 0..AZIMUTHS {
        let (sin, cos) = (2.0 * PI * (turn as f64 + 0.5) / AZIMUTHS as f64).sin_cos();
        let facing = [along * cos, across * sin];
        for i in 0..SLOPES {
            let slope = (-((i as f64 + 0.5) / SLOPES as f64).ln()).sqrt();
            let [x, y] = facing.map(|c| c * slope);
            let cos_h = 1.0 / (1.0 + x * x + y * y).sqrt();
            let w_dot_h = (w[0] * x + w[1] * y + cosine) * cos_h;
            let other = 2.0 * w_dot_h * cos_h - cosine;
            if w_dot_h > 0.0 && other > 0.0 {
                let g = (2.0 * cos_h * cosine.min(other) / w_dot_h).min(1.0);
                sum += f64::from(fresnel(index, w_dot_h as f32)) * g * w_dot_h / (cosine * cos_h);
            }
        }
    }
    (sum / (AZIMUTHS * SLOPES) as f64).min(1.0)
}

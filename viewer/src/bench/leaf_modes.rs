//! Measures what each mode of a live leaf costs and loses.

use crate::error::ViewerError;
use btf_capture::{delta_e00, lab_from_linear, rgb_of, rgb_weights};
use btf_runtime::{Leaf, LeafMode, LeafState, LeafTexel, LeafTexture, ViewedLeaf, leaf_body_spectrum};
use serde::Serialize;
use std::hint::black_box;
use web_time::Instant;

/// States that colours are compared over.
const STATES: u32 = 500;
/// Places that are evaluated for the time.
const PLACES: u32 = 4096;
/// Measurements of which the fastest counts.
const REPEATS: usize = 7;
/// Longest wavelength of a colour, nanometres.
const LAST_NM: f32 = 700.0;

/// A mode's row.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LeafModeRow {
    /// `three-piece`, `rational`, `n-layers` or `two-sided`.
    pub mode: &'static str,
    /// Mean CIEDE2000 of the body's reflected and transmitted colours against N layers, of `two-sided` against two halves, in double precision
    /// under 31 wavelengths, over random leaves from green to brown.
    pub delta_e00_mean: f64,
    /// Largest CIEDE2000 over these leaves.
    pub delta_e00_max: f64,
    /// Nanoseconds of what depends on place and eye, one thread of the CPU.
    pub view_ns: f64,
    /// Nanoseconds of what a light then adds.
    pub light_ns: f64,
}

/// Measures all modes. Cost: about a second.
///
/// # Errors
/// None that is expected: the states are finite.
pub fn leaf_mode_rows() -> Result<Vec<LeafModeRow>, ViewerError> {
    LeafMode::ALL.into_iter().map(row).collect()
}

fn row(mode: LeafMode) -> Result<LeafModeRow, ViewerError> {
    let (mut sum, mut largest) = (0.0, 0f64);
    for number in 0..STATES {
        let state = LeafState { mode, ..state_of(number) };
        let (live, reference) = (body_colours(&state)?, reference_colours(&state));
        for side in 0..2 {
            let error = delta_e00(lab_from_linear(live[side]), lab_from_linear(reference[side]));
            sum += error;
            largest = largest.max(error);
        }
    }
    let leaf = leaf_of(&LeafState { mode, ..LeafState::default() }, LeafTexel::default())?;
    let places: Vec<_> = (0..PLACES).map(|i| (uv_of(i), direction_of(2 * i), direction_of(2 * i + 1))).collect();
    let viewed = |(uv, wo, _): &([f32; 2], [f32; 3], [f32; 3])| ViewedLeaf::new(leaf.words(), *uv, 0, [1.0; 4], *wo);
    let view_ns = nanoseconds(&mut || {
        for place in &places {
            black_box(viewed(place));
        }
    });
    let seen: Vec<ViewedLeaf> = places.iter().map(viewed).collect();
    let light_ns = nanoseconds(&mut || {
        for (viewed, (.., wi)) in seen.iter().zip(&places) {
            black_box(viewed.light(*wi));
        }
    });
    let delta_e00_mean = sum / f64::from(2 * STATES);
    Ok(LeafModeRow { mode: mode.name(), delta_e00_mean, delta_e00_max: largest, view_ns, light_ns })
}

/// Nanoseconds per place of `work`, which treats all of them.
fn nanoseconds(work: &mut dyn FnMut()) -> f64 {
    let mut fastest = f64::MAX;
    for _ in 0..REPEATS {
        let start = Instant::now();
        work();
        fastest = fastest.min(start.elapsed().as_secs_f64());
    }
    fastest * 1e9 / f64::from(PLACES)
}

fn leaf_of(state: &LeafState, texel: LeafTexel) -> Result<Leaf, ViewerError> {
    let named = |source| ViewerError::Leaf { name: "of the bench".into(), source };
    Leaf::new(state, &LeafTexture::uniform(texel)).map_err(named)
}

/// Computes the linear sRGB of what a leaf without gloss reflects and transmits along its normal.
fn body_colours(state: &LeafState) -> Result<[[f64; 3]; 2], ViewerError> {
    let leaf = leaf_of(state, LeafTexel { gloss: [0.0; 2], ..LeafTexel::default() })?;
    let viewed = ViewedLeaf::new(leaf.words(), [0.5; 2], 0, [1.0; 4], [0.0, 0.0, 1.0]);
    Ok([1.0, -1.0].map(|z| viewed.light([0.0, 0.0, z]).map(f64::from)))
}

/// Computes from the spectrum what a leaf without gloss reflects and transmits, linear sRGB; in a channel both together
/// at most 1, as the leaf has it.
fn reference_colours(state: &LeafState) -> [[f64; 3]; 2] {
    let rows: Vec<_> = leaf_body_spectrum(state).into_iter().filter(|row| row.wavelength_nm <= LAST_NM).collect();
    let wavelengths: Vec<f64> = rows.iter().map(|row| row.wavelength_nm.into()).collect();
    let weights = rgb_weights(&wavelengths).unwrap_or_default();
    let of = |value: fn(&btf_runtime::LeafSpectrumRow) -> f32| {
        rgb_of(&weights, &rows.iter().map(value).collect::<Vec<_>>()).map(f64::from)
    };
    let (front, behind) = (of(|row| row.reflectance), of(|row| row.transmittance));
    let scale: [f64; 3] = std::array::from_fn(|c| 1.0 / (front[c] + behind[c]).max(1.0));
    [front, behind].map(|rgb| std::array::from_fn(|c| rgb[c] * scale[c]))
}

/// Returns number `index` of a sequence that fills the unit interval evenly, one for each dimension.
fn spread(index: u32, dimension: u32) -> f32 {
    // Steps that are the least alike [Roberts 2018]: powers of the root of x^9 = x + 1.
    const STEP: f64 = 0.926_7;
    ((0.5 + f64::from(index + 1) * STEP.powi(dimension as i32 + 1)) % 1.0) as f32
}

/// Returns a leaf within the ranges, two of five without red and brown pigments; few pigments as often as many.
fn state_of(number: u32) -> LeafState {
    let plain = number % 5 < 2;
    let at = |dimension| spread(number, dimension);
    LeafState {
        chlorophyll_ug_per_cm2: 100.0 * at(0).powf(1.5),
        carotenoid_ug_per_cm2: 25.0 * at(1),
        anthocyanin_ug_per_cm2: if plain { 0.0 } else { 15.0 * at(2) * at(2) },
        brown: if plain { 0.0 } else { at(3) * at(3) },
        water_cm: 0.04 * at(4),
        dry_matter_g_per_cm2: 0.001 + 0.019 * at(5),
        structure: 1.0 + 2.0 * at(6),
        ..LeafState::default()
    }
}

fn uv_of(place: u32) -> [f32; 2] {
    [spread(place, 0), spread(place, 1)]
}

/// Returns a direction; either side of the surface is as likely.
fn direction_of(place: u32) -> [f32; 3] {
    let (z, angle) = (0.02 + 0.97 * spread(place, 2), std::f32::consts::TAU * spread(place, 3));
    let radius = (1.0 - z * z).sqrt();
    [radius * angle.cos(), radius * angle.sin(), if spread(place, 4) < 0.5 { -z } else { z }]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_exact_modes_lose_less_and_all_take_time() {
        let rows = leaf_mode_rows().unwrap();
        let names: Vec<_> = rows.iter().map(|row| row.mode).collect();
        assert_eq!(names, ["three-piece", "rational", "n-layers", "two-sided"]);
        assert!(rows[2].delta_e00_mean < 0.5 && rows[2].delta_e00_max < 3.0, "{rows:?}");
        assert!(rows[..2].iter().all(|row| row.delta_e00_mean > 4.0 * rows[2].delta_e00_mean), "{rows:?}");
        assert!(
            rows.iter().all(|row| row.view_ns > 0.0 && row.light_ns > 0.0 && row.delta_e00_max >= row.delta_e00_mean)
        );
    }
}

//! Plates of leaf tissue in double precision, for tables and spectra [Allen 1969; Jacquemoud 1990].
//!
//! Reflectances and transmittances are shares of the light that has *entered* through the first surface, so that a
//! gloss, which tells how much enters, couples to them; without absorption they add up to 1. docs/reference/model.md has the
//! equations.

use crate::leaf::body::printed_plate;
use crate::leaf::figures::{LEAF_ROWS, LeafRow, PRINTED_ROWS, THREE_ROWS};
use crate::leaf::lobe::fresnel;
use crate::leaf::state::{LeafMode, LeafState, TwoHalves};
use crate::leaf::theta::{exact_theta, rational_theta, three_piece_theta};
use std::ops::Range;

/// Half-angle in degrees of the cone of light that PROSPECT assumes [Jacquemoud 1990].
pub const CONE_DEG: f64 = 40.0;

/// The transmittances of an interface between air and a medium for diffuse light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Faces {
    /// Transmittance from the air into the medium.
    pub entry: f64,
    /// Transmittance from the medium into the air, `entry / n^2` [Stern 1964].
    pub exit: f64,
}

impl Faces {
    /// Computes the transmittances of a medium of refractive index `index`.
    pub fn new(index: f32) -> Faces {
        let entry = interface_transmittance(index, 90.0);
        Faces { entry, exit: entry / f64::from(index).powi(2) }
    }
}

/// Returns the mean transmittance of the interface between air and a medium of index `index` (1 and more) under light
/// that fills a cone of half-angle `cone_deg` (0 to 90 degrees) about the normal, to 1e-6. Costs 257 Fresnel terms.
pub(crate) fn interface_transmittance(index: f32, cone_deg: f64) -> f64 {
    // Simpson's rule over the cosine, with the cosine as weight.
    const INTERVALS: usize = 256;
    let rim = cone_deg.to_radians().cos();
    let (mut sum, mut weights) = (0.0, 0.0);
    for i in 0..=INTERVALS {
        let cosine = rim + (1.0 - rim) * i as f64 / INTERVALS as f64;
        let rule = if i == 0 || i == INTERVALS { 1.0 } else { 2.0 + 2.0 * (i % 2) as f64 };
        // At an angle of 0 all cosines are 1.
        let weight = rule * cosine;
        sum += weight * (1.0 - f64::from(fresnel(index, cosine as f32)));
        weights += weight;
    }
    sum / weights
}

/// Returns reflectance and transmittance of one plate of `theta` [Miao, eq. 3 and 4, over the light that enters].
pub(crate) fn one_plate(theta: f64, exit: f64) -> [f64; 2] {
    let back = theta * (1.0 - exit);
    let behind = theta * exit / (1.0 - back * back);
    [back * behind, behind]
}

/// Returns reflectance and transmittance of `structure` plates (1 and more, need not be whole) of `theta`: the first,
/// lit from the air, above a pile of the others [Stokes 1862; Jacquemoud 1990].
pub(crate) fn n_plates(theta: f64, faces: Faces, structure: f64) -> [f64; 2] {
    let [front, behind] = one_plate(theta, faces.exit);
    let (r, t) = (1.0 - faces.entry + faces.entry * front, faces.entry * behind);
    let [below, through] = plates_in_air(theta, faces, structure - 1.0);
    let between = behind / (1.0 - below * r);
    [front + between * below * t, between * through]
}

/// Returns reflectance and transmittance of `count` plates of `theta` under diffuse light from the air [Stokes 1862].
pub(crate) fn plates_in_air(theta: f64, faces: Faces, count: f64) -> [f64; 2] {
    let [front, behind] = one_plate(theta, faces.exit);
    // What a layer absorbs is not taken as 1 - r - t, which loses its digits.
    let absorbed = faces.entry * (1.0 - theta) / (1.0 - (1.0 - faces.exit) * theta);
    pile(1.0 - faces.entry + faces.entry * front, faces.entry * behind, absorbed, count)
}

/// Returns reflectance of the upper and of the lower face and transmittance of two halves, whose absorptions of a layer of the
/// whole leaf are `pigments` and `body`, as shares of the light that entered.
pub(crate) fn two_halves(halves: TwoHalves, pigments: f64, body: f64, faces: Faces, structure: f64) -> [f64; 3] {
    let ratios = halves.of_layers();
    let [upper, lower] = [0, 1].map(|half| {
        let [count, of_pigments, of_body] = ratios[half];
        plates_in_air(exact_theta(of_pigments * pigments + of_body * body), faces, count * structure)
    });
    let between = 1.0 / (1.0 - upper[0] * lower[0]);
    let front = upper[0] + upper[1] * upper[1] * lower[0] * between;
    let back = lower[0] + lower[1] * lower[1] * upper[0] * between;
    let entered = |reflected: f64| ((reflected - (1.0 - faces.entry)) / faces.entry).max(0.0);
    [entered(front), entered(back), upper[1] * lower[1] * between / faces.entry]
}

/// Returns reflectance and transmittance of `count` layers that reflect `r`, transmit `t` and absorb `absorbed`.
fn pile(r: f64, t: f64, absorbed: f64, count: f64) -> [f64; 2] {
    if absorbed <= 0.0 {
        let through = t / (t + (1.0 - t) * count);
        return [1.0 - through, through];
    }
    let d = ((1.0 + r + t) * (1.0 + r - t) * (1.0 - r + t) * absorbed).sqrt();
    // g and c of Stokes are 1 less these, both near 0 where little is absorbed.
    let g_less = (absorbed * (1.0 - r + t) + d) / (1.0 + r * r - t * t + d);
    let c_less = (absorbed * (1.0 - t + r) + d) / (1.0 - r * r + t * t + d);
    // c^count - 1; where nothing passes the logarithm is -inf, and 0 layers of it are none.
    let fall = if count == 0.0 { 0.0 } else { (count * (-c_less.min(1.0)).ln_1p()).exp_m1() };
    let (power, power2_less) = (1.0 + fall, -fall * (2.0 + fall));
    let g2_less = g_less * (2.0 - g_less);
    let denominator = g2_less + power2_less - g2_less * power2_less;
    [(1.0 - g_less) * power2_less / denominator, power * g2_less / denominator]
}

/// Returns reflectance and transmittance of [`TwoHalves::BROAD_LEAF`] with the contents of `state`, lit on the upper face.
fn broad_leaf(row: &LeafRow, state: &LeafState, faces: Faces) -> [f64; 2] {
    let layers = f64::from(state.structure);
    let [pigments, body] = [0..4, 4..6].map(|contents| absorption(row, state, contents) / layers);
    let [front, _, behind] = two_halves(TwoHalves::BROAD_LEAF, pigments, body, faces, layers);
    [front, behind]
}

/// Sums `K C` of a whole leaf over some of its contents, which are numbers of [`LeafState::contents`].
pub(crate) fn absorption(row: &LeafRow, state: &LeafState, contents: Range<usize>) -> f64 {
    let held = state.contents();
    contents.map(|i| f64::from(row.absorption[i]) * f64::from(held[i])).sum()
}

/// The optics of a leaf at one wavelength.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeafSpectrumRow {
    /// Wavelength in nanometres.
    pub wavelength_nm: f32,
    /// Share of the light that the leaf reflects.
    pub reflectance: f32,
    /// Share of the light that the leaf transmits.
    pub transmittance: f32,
}

/// Returns reflectance and transmittance by wavelength of a leaf without textures, as shares of the incident light
/// including the surface's own reflection, for a plot. They are computed by the state's mode: N layers give 400 to 780
/// nm every 10 nm under a cone of 40 degrees, the others red, green and blue lit along the normal. Two halves
/// are lit on their upper face, and a tissue has what N layers have. Costs 514 Fresnel
/// terms a row. Finite for every finite state.
pub fn leaf_spectrum(state: &LeafState) -> Vec<LeafSpectrumRow> {
    let state = state.evaluable();
    let layers = f64::from(state.structure);
    let (rows, cone_deg): (&[LeafRow], f64) = match state.mode {
        LeafMode::ThreePiece => (&PRINTED_ROWS, 0.0),
        LeafMode::Rational => (&THREE_ROWS, 0.0),
        LeafMode::NLayers | LeafMode::TwoSided | LeafMode::Tissue => (&LEAF_ROWS, CONE_DEG),
    };
    let of_row = |row: &LeafRow| {
        let k = absorption(row, &state, 0..6) / layers;
        let faces = Faces::new(row.index);
        let entering = interface_transmittance(row.index, cone_deg);
        let [front, behind] = match state.mode {
            LeafMode::ThreePiece => return printed_plate(three_piece_theta(k as f32)),
            LeafMode::Rational => one_plate(f64::from(rational_theta(k as f32)), faces.exit),
            LeafMode::NLayers | LeafMode::Tissue => n_plates(exact_theta(k), faces, layers),
            LeafMode::TwoSided => broad_leaf(row, &state, faces),
        };
        [(1.0 - entering + entering * front) as f32, (entering * behind) as f32]
    };
    rows.iter()
        .map(|row| {
            let [reflectance, transmittance] = of_row(row);
            LeafSpectrumRow { wavelength_nm: row.wavelength_nm, reflectance, transmittance }
        })
        .collect()
}

/// Returns reflectance and transmittance of the body alone, as shares of the light that has entered, over the spectrum: by two
/// halves where the mode has them, lit on the upper face, and by N layers for every other mode. It is the reference for the
/// errors of the modes. Otherwise like [`leaf_spectrum`].
pub fn leaf_body_spectrum(state: &LeafState) -> Vec<LeafSpectrumRow> {
    let state = state.evaluable();
    let layers = f64::from(state.structure);
    let of_row = |row: &LeafRow| {
        let faces = Faces::new(row.index);
        let [reflectance, transmittance] = match state.mode {
            LeafMode::TwoSided => broad_leaf(row, &state, faces),
            _ => n_plates(exact_theta(absorption(row, &state, 0..6) / layers), faces, layers),
        }
        .map(|share| share as f32);
        LeafSpectrumRow { wavelength_nm: row.wavelength_nm, reflectance, transmittance }
    };
    LEAF_ROWS.iter().map(of_row).collect()
}

//! `plate-two-sided` as an inversion sees it: the contents of a leaf and how they divide between palisade and spongy
//! tissue.

use crate::inversion::forward::{Domain, Forward, MAX_UNKNOWNS, Sensitivity, Unknown, Values};
use crate::inversion::plates::{DOMAINS, PLATE_UNKNOWNS, STRUCTURE, plate_unknowns};
use crate::optics::abm::path_lengths::Face;
use crate::optics::plates::halves_slopes::HalvesSlopes;
use crate::optics::plates::shares::PlateOptics;
use crate::optics::plates::slopes::LitSurface;
use crate::optics::plates::two_halves::TwoHalves;
use crate::optics::specific_absorption::{Coefficients, SpecificAbsorption};

/// Indices of the shares of the palisade among the unknowns.
const LAYERS: usize = PLATE_UNKNOWNS;
const PIGMENTS: usize = PLATE_UNKNOWNS + 1;
const BODY: usize = PLATE_UNKNOWNS + 2;
/// Number of pigments; water and dry matter come after them.
const PIGMENT_COUNT: usize = 4;
/// Standard deviation of the shares of the palisade among leaves, by hand: wide, so that both faces tell them.
const SHARE_SPREAD: f64 = 0.2;

/// Returns the unknowns of `plate-two-sided` near `halves`: those of `plate-n` and the fields of [`TwoHalves`].
pub(crate) fn halves_unknowns(halves: &TwoHalves) -> [Unknown; MAX_UNKNOWNS] {
    let share = |key, option, name, bounds, start| Unknown {
        key,
        option,
        name,
        unit: "",
        bounds,
        range: bounds,
        start,
        spread: SHARE_SPREAD,
    };
    let layers = "share of the layers in the palisade";
    let body = "share of water and dry matter in the palisade";
    let shares = [
        share("palisade_layers", "palisade-layers", layers, [0.05, 0.95], halves.layers),
        share(
            "palisade_pigments",
            "palisade-pigments",
            "share of pigments in the palisade",
            [0.0, 1.0],
            halves.pigments,
        ),
        share("palisade_body", "palisade-body", body, [0.0, 1.0], halves.body),
    ];
    let plates = plate_unknowns();
    std::array::from_fn(|i| if i < PLATE_UNKNOWNS { plates[i] } else { shares[i - PLATE_UNKNOWNS] })
}

/// Two unequal piles of plates at fixed wavelengths.
pub(crate) struct HalvesForward {
    unknowns: [Unknown; MAX_UNKNOWNS],
    bands: Vec<(Coefficients, LitSurface)>,
}

impl HalvesForward {
    /// Prepares PROSPECT-D in two halves, lit over a cone of half-angle `cone_deg`, at wavelengths within the table.
    pub(crate) fn new(halves: &TwoHalves, wavelengths_nm: &[f64], cone_deg: f64) -> HalvesForward {
        let table = SpecificAbsorption::ProspectD;
        let band = |nm: &f64| (table.coefficients(*nm), LitSurface::new(table.index(*nm), cone_deg));
        HalvesForward { unknowns: halves_unknowns(halves), bands: wavelengths_nm.iter().map(band).collect() }
    }
}

impl Forward for HalvesForward {
    fn unknowns(&self) -> &[Unknown] {
        &self.unknowns
    }

    fn first_of_both_faces(&self) -> usize {
        LAYERS
    }

    fn domains(&self) -> &[Domain] {
        &DOMAINS
    }

    fn at(&self, band: usize, face: Face, values: &Values) -> Sensitivity {
        let (coefficients, surface) = &self.bands[band];
        let absorbed = |from: usize, to: usize| (from..to).map(|i| coefficients[i] * values[i]).sum::<f64>();
        let (pigments, body) = (absorbed(0, PIGMENT_COUNT), absorbed(PIGMENT_COUNT, STRUCTURE));
        let structure = values[STRUCTURE];
        // Of each half, the palisade first: its layers, its shares of pigments and of the body, its absorption.
        let shares = |share: f64| [share, 1.0 - share];
        let (layers, pigment_shares, body_shares) =
            (shares(values[LAYERS]), shares(values[PIGMENTS]), shares(values[BODY]));
        let counts = layers.map(|layers| layers * structure);
        let k = [0, 1].map(|half| (pigment_shares[half] * pigments + body_shares[half] * body) / counts[half]);
        let order = if face == Face::Adaxial { [0, 1] } else { [1, 0] };
        let slopes = surface.halves(order.map(|half| k[half]), order.map(|half| counts[half]));
        let HalvesSlopes { optics, by_absorption, by_layers } = slopes;
        let both = |optics: PlateOptics| [optics.reflectance, optics.transmittance];
        let mut by = [[0.0; MAX_UNKNOWNS]; 2];
        for (place, half) in order.into_iter().enumerate() {
            // How the halves change with the shares of the palisade.
            let sign = if half == 0 { 1.0 } else { -1.0 };
            let (by_k, by_count) = (both(by_absorption[place]), both(by_layers[place]));
            for (by, (by_k, by_count)) in by.iter_mut().zip(by_k.into_iter().zip(by_count)) {
                for (i, coefficient) in coefficients.iter().enumerate() {
                    let share = if i < PIGMENT_COUNT { pigment_shares[half] } else { body_shares[half] };
                    by[i] += by_k * share * coefficient / counts[half];
                }
                by[STRUCTURE] += by_count * layers[half] - by_k * k[half] / structure;
                by[LAYERS] += sign * (by_count * structure - by_k * k[half] / layers[half]);
                by[PIGMENTS] += sign * by_k * pigments / counts[half];
                by[BODY] += sign * by_k * body / counts[half];
            }
        }
        Sensitivity { shares: both(optics), by }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inversion::plates::{contents_of, values_of};
    use crate::optics::plates::two_halves::two_sided_spectrum;
    use btf_models::LeafContents;

    #[test]
    fn shares_are_those_of_the_model_and_derivatives_its_differences() {
        let nm = [450.0, 550.5, 680.0, 710.0, 1200.0, 1450.0, 2300.0];
        let forward = HalvesForward::new(&TwoHalves::default(), &nm, 40.0);
        let leaf = LeafContents { anthocyanin_ug_per_cm2: 2.0, brown: 0.1, ..LeafContents::default() };
        for halves in [[0.9, 0.99, 0.95], [0.5, 0.5, 0.5], [0.4, 0.7, 0.3], [0.7, 0.2, 0.1]] {
            let mut values = values_of(&leaf);
            values[PLATE_UNKNOWNS..].copy_from_slice(&halves);
            for face in [Face::Adaxial, Face::Abaxial] {
                let shares = |values: &Values, band: usize| {
                    let halves = TwoHalves { layers: values[LAYERS], pigments: values[PIGMENTS], body: values[BODY] };
                    let (contents, table) = (contents_of(values), SpecificAbsorption::ProspectD);
                    let optics = two_sided_spectrum(&halves, table, &contents, 40.0, face, &nm[band..=band]).unwrap();
                    [optics[0].reflectance, optics[0].transmittance]
                };
                for band in 0..nm.len() {
                    let at = forward.at(band, face, &values);
                    for (i, unknown) in forward.unknowns().iter().enumerate() {
                        let step = 1e-5 * unknown.span();
                        let moved = |by: f64| {
                            let mut values = values;
                            values[i] += by;
                            shares(&values, band)
                        };
                        let (low, high) = (moved(-step), moved(step));
                        for side in 0..2 {
                            assert!((at.shares[side] - shares(&values, band)[side]).abs() < 2e-8);
                            let expected = (high[side] - low[side]) / (2.0 * step);
                            let apart = (at.by[side][i] - expected).abs() * unknown.span();
                            let got = at.by[side][i];
                            assert!(
                                apart < 1e-3,
                                "{halves:?} {face:?} {} nm, {}: {got} {expected}",
                                nm[band],
                                unknown.name
                            );
                        }
                    }
                }
            }
        }
    }
}

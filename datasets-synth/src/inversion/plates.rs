//! `plate-n` as an inversion sees it.

use btf_models::{LEAF_QUANTITIES, LeafContents, LeafDescription};

use crate::inversion::forward::{Domain, Forward, MAX_UNKNOWNS, Sensitivity, Unknown, Values};
use crate::optics::abm::path_lengths::Face;
use crate::optics::plates::shares::PlateOptics;
use crate::optics::plates::slopes::LitSurface;
use crate::optics::specific_absorption::{Coefficients, SpecificAbsorption};

/// Index of the number of layers among the unknowns; those before it are contents.
pub(crate) const STRUCTURE: usize = PLATE_UNKNOWNS - 1;

/// Number of unknowns of `plate-n`: the first of [`LEAF_QUANTITIES`].
pub(crate) const PLATE_UNKNOWNS: usize = 7;

/// Option, greatest value that is tried, usual value and spread of each unknown, in the order of [`LEAF_QUANTITIES`]. The
/// usual values are about the means of measured leaves, with something of everything, so that every derivative tells; the
/// spreads are half as wide again as those of measured leaves.
const SEARCH: [(&str, f64, f64, f64); PLATE_UNKNOWNS] = [
    ("cab", 200.0, 35.0, 35.0),
    ("car", 60.0, 8.0, 8.0),
    ("cant", 60.0, 1.0, 3.0),
    ("cbrown", 5.0, 0.02, 0.2),
    ("cw", 0.1, 0.012, 0.01),
    ("cm", 0.06, 0.006, 0.005),
    ("n", 5.0, 1.6, 0.5),
];

/// Wavelengths that tell contents by themselves [Feret 2019; Spafford 2021].
pub(crate) const DOMAINS: [Domain; 3] = [
    // Water and dry matter.
    Domain { tells: &[4, 5], with: &[STRUCTURE], nm: [1700.0, 2400.0] },
    // Chlorophyll.
    Domain { tells: &[0], with: &[STRUCTURE], nm: [700.0, 720.0] },
    // Carotenoids.
    Domain { tells: &[1], with: &[STRUCTURE], nm: [520.0, 560.0] },
];

/// Returns the unknowns of `plate-n`, in the order of the fields of [`LeafContents`].
pub(crate) fn plate_unknowns() -> [Unknown; PLATE_UNKNOWNS] {
    std::array::from_fn(|i| {
        let (quantity, (option, most, start, spread)) = (&LEAF_QUANTITIES[i], SEARCH[i]);
        let bounds = [quantity.range[0], most];
        Unknown {
            key: quantity.key,
            option,
            name: quantity.name,
            unit: quantity.unit,
            bounds,
            range: quantity.range,
            start,
            spread,
        }
    })
}

/// Pile of plates at one wavelength.
pub(crate) struct PlateBand {
    coefficients: Coefficients,
    surface: LitSurface,
}

impl PlateBand {
    /// Prepares PROSPECT-D at a wavelength within the table, lit over a cone of half-angle `cone_deg`.
    pub(crate) fn lit(wavelength_nm: f64, cone_deg: f64) -> PlateBand {
        PlateBand::with(wavelength_nm, |index| LitSurface::new(index, cone_deg))
    }

    /// Prepares its body, whose shares are of the light that has entered.
    pub(crate) fn entered(wavelength_nm: f64) -> PlateBand {
        PlateBand::with(wavelength_nm, LitSurface::entered)
    }

    fn with(wavelength_nm: f64, surface: impl Fn(f64) -> LitSurface) -> PlateBand {
        let table = SpecificAbsorption::ProspectD;
        PlateBand { coefficients: table.coefficients(wavelength_nm), surface: surface(table.index(wavelength_nm)) }
    }

    /// Returns the shares of light of a leaf of contents and N.
    pub(crate) fn at(&self, values: &Values) -> Sensitivity {
        let structure = values[STRUCTURE];
        let absorption: f64 = self.coefficients.iter().zip(values).map(|(k, content)| k * content).sum();
        let k = absorption / structure;
        let slopes = self.surface.slopes(k, structure);
        let both = |optics: PlateOptics| [optics.reflectance, optics.transmittance];
        let (by_k, by_n) = (both(slopes.by_absorption), both(slopes.by_structure));
        let by = std::array::from_fn(|side| {
            let mut by: Values = [0.0; MAX_UNKNOWNS];
            for (by, coefficient) in by.iter_mut().zip(&self.coefficients) {
                *by = by_k[side] * coefficient / structure;
            }
            // N also thins the layers.
            by[STRUCTURE] = by_n[side] - by_k[side] * k / structure;
            by
        });
        Sensitivity { shares: both(slopes.optics), by }
    }
}

/// Pile of plates at fixed wavelengths.
pub(crate) struct PlateForward {
    unknowns: [Unknown; PLATE_UNKNOWNS],
    bands: Vec<PlateBand>,
}

impl PlateForward {
    /// Prepares PROSPECT-D, lit over a cone of half-angle `cone_deg`, at wavelengths within the table.
    pub(crate) fn new(wavelengths_nm: &[f64], cone_deg: f64) -> PlateForward {
        let bands = wavelengths_nm.iter().map(|nm| PlateBand::lit(*nm, cone_deg)).collect();
        PlateForward { unknowns: plate_unknowns(), bands }
    }
}

impl Forward for PlateForward {
    fn unknowns(&self) -> &[Unknown] {
        &self.unknowns
    }

    fn domains(&self) -> &[Domain] {
        &DOMAINS
    }

    fn at(&self, band: usize, _: Face, values: &Values) -> Sensitivity {
        self.bands[band].at(values)
    }
}

/// Returns the contents of a leaf as values of the unknowns of `plate-n`.
pub(crate) fn values_of(contents: &LeafContents) -> Values {
    let leaf = LeafDescription { contents: *contents, ..LeafDescription::default() };
    let mut values = [0.0; MAX_UNKNOWNS];
    values[..PLATE_UNKNOWNS].iter_mut().zip(&LEAF_QUANTITIES).for_each(|(value, quantity)| *value = quantity.of(&leaf));
    values
}

/// Returns values of the unknowns of `plate-n` as the contents of a leaf.
pub(crate) fn contents_of(values: &Values) -> LeafContents {
    let mut leaf = LeafDescription::default();
    LEAF_QUANTITIES[..PLATE_UNKNOWNS].iter().zip(values).for_each(|(quantity, value)| quantity.set(&mut leaf, *value));
    leaf.contents
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::plates::model::{PlateModel, plate_spectrum};

    #[test]
    fn shares_are_those_of_the_model_and_derivatives_its_differences() {
        let nm = [450.0, 550.5, 710.0, 1200.0, 1450.0, 2300.0];
        let forward = PlateForward::new(&nm, 40.0);
        let leaf = LeafContents { anthocyanin_ug_per_cm2: 2.0, brown: 0.1, ..LeafContents::default() };
        let values = values_of(&leaf);
        assert_eq!(contents_of(&values), leaf);
        let shares = |values: &Values, band: usize| {
            let contents = contents_of(values);
            let optics = plate_spectrum(PlateModel::N, SpecificAbsorption::ProspectD, &contents, 40.0, &nm).unwrap();
            [optics[band].reflectance, optics[band].transmittance]
        };
        for band in 0..nm.len() {
            let at = forward.at(band, Face::Adaxial, &values);
            for (i, unknown) in forward.unknowns().iter().enumerate() {
                let step = 1e-5 * unknown.span();
                let moved = |by: f64| {
                    let mut values = values;
                    values[i] += by;
                    shares(&values, band)
                };
                let (low, high) = (moved(-step), moved(step));
                for side in 0..2 {
                    assert!((at.shares[side] - shares(&values, band)[side]).abs() < 4e-9);
                    let expected = (high[side] - low[side]) / (2.0 * step);
                    let apart = (at.by[side][i] - expected).abs() * unknown.span();
                    assert!(apart < 1e-3, "{} nm, {}: {} {expected}", nm[band], unknown.name, at.by[side][i]);
                }
            }
        }
    }
}

//! Tables of specific absorptions and refractive index that a plate model can use.

use btf_models::LeafContents;

use crate::error::SynthError;
use crate::optics::tables::interpolated;
use crate::optics::tables::leaf_table::{LEAF_FIRST_NM, LEAF_LAST_NM, LeafTable, PROSPECT_5, PROSPECT_D};

/// Table of specific absorptions and refractive index of leaf tissue, 400 to 2500 nm at 1 nm, linear in between.
///
/// Outside of these wavelengths the functions return NaN; [`check_wavelengths`] refuses them first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SpecificAbsorption {
    /// Table of PROSPECT-5 [Feret 2008], without anthocyanins, which count as colourless.
    Prospect5,
    /// Table of PROSPECT-D [Feret 2017].
    #[default]
    ProspectD,
}

/// First and last wavelength of the tables in nanometres.
pub const LEAF_TABLE_NM: [f64; 2] = [LEAF_FIRST_NM, LEAF_LAST_NM];

/// Specific absorptions at one wavelength, in the order of the fields of [`LeafContents`].
pub(crate) type Coefficients = [f64; 6];

impl SpecificAbsorption {
    fn table(self) -> &'static LeafTable {
        match self {
            SpecificAbsorption::Prospect5 => &PROSPECT_5,
            SpecificAbsorption::ProspectD => &PROSPECT_D,
        }
    }

    /// Returns the name: `prospect-5` or `prospect-d`.
    pub fn name(self) -> &'static str {
        match self {
            SpecificAbsorption::Prospect5 => "prospect-5",
            SpecificAbsorption::ProspectD => "prospect-d",
        }
    }

    /// Returns the refractive index of the leaf's material.
    pub fn index(self, wavelength_nm: f64) -> f64 {
        interpolated(&self.table().index, LEAF_FIRST_NM, 1.0, wavelength_nm)
    }

    /// Returns the absorption of the whole leaf, `sum K C`: divide by N for one layer's k.
    pub fn absorption(self, contents: &LeafContents, wavelength_nm: f64) -> f64 {
        absorption_of(&self.coefficients(wavelength_nm), contents)
    }

    /// Returns the coefficients by which [`SpecificAbsorption::absorption`] multiplies the contents.
    pub(crate) fn coefficients(self, wavelength_nm: f64) -> Coefficients {
        let table = self.table();
        [&table.chlorophyll, &table.carotenoid, &table.anthocyanin, &table.brown, &table.water, &table.dry_matter]
            .map(|column| interpolated(column, LEAF_FIRST_NM, 1.0, wavelength_nm))
    }
}

/// Returns `sum K C` for coefficients that were looked up.
#[inline]
pub(crate) fn absorption_of(coefficients: &Coefficients, contents: &LeafContents) -> f64 {
    coefficients[0] * contents.chlorophyll_ug_per_cm2
        + coefficients[1] * contents.carotenoid_ug_per_cm2
        + coefficients[2] * contents.anthocyanin_ug_per_cm2
        + coefficients[3] * contents.brown
        + coefficients[4] * contents.water_cm
        + coefficients[5] * contents.dry_matter_g_per_cm2
}

/// Refuses wavelengths in nanometres that the tables do not reach.
///
/// # Errors
/// [`SynthError::BadParameter`] for the first outside of 400 to 2500.
pub fn check_wavelengths(wavelengths_nm: &[f64]) -> Result<(), SynthError> {
    match wavelengths_nm.iter().find(|nm| !(LEAF_FIRST_NM..=LEAF_LAST_NM).contains(*nm)) {
        None => Ok(()),
        Some(nm) => Err(SynthError::BadParameter {
            name: "a wavelength",
            value: format!("{nm} nm"),
            allowed: format!("wavelengths from {LEAF_FIRST_NM} to {LEAF_LAST_NM} nm"),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use SpecificAbsorption::{Prospect5, ProspectD};

    #[test]
    fn the_tables_hold_the_published_values() {
        // [Feret 2008] at the wavelengths that Miao prints, and at 550 nm.
        for (nm, index, chlorophyll, carotenoid, brown, dry_matter) in [
            (435.0, 1.5267, 0.0716, 0.1682, 0.4912, 14.81),
            (546.0, 1.4309, 0.01221, 0.007301, 0.3568, 2.3),
            (550.0, 1.4303, 0.01286, 0.003816, 0.3511, 2.3),
            (675.0, 1.4857, 0.05914, 0.0, 0.1572, 2.3),
        ] {
            let c = Prospect5.coefficients(nm);
            assert_eq!(Prospect5.index(nm), index, "{nm}");
            assert_eq!([c[0], c[1], c[2], c[3], c[5]], [chlorophyll, carotenoid, 0.0, brown, dry_matter], "{nm}");
        }
        // [Feret 2017] at the first row.
        assert_eq!(ProspectD.index(400.0), 1.5115);
        assert_eq!(ProspectD.coefficients(400.0), [0.0648815, 0.16734, 0.0666747, 0.5272, 0.000058, 109.7]);
        // Beyond the pigments nothing absorbs but brown pigment, water and dry matter; in the last row only those two.
        assert_eq!(Prospect5.coefficients(780.0), [0.0, 0.0, 0.0, 0.05284, 0.02659, 2.3]);
        assert_eq!(ProspectD.coefficients(780.0)[3..], [0.05284, 0.02659, 2.3]);
        for table in [Prospect5, ProspectD] {
            let [pigments @ .., water, dry_matter] = table.coefficients(2500.0);
            assert!(pigments == [0.0; 4] && water > 50.0 && dry_matter > 20.0, "{water} {dry_matter}");
        }
    }

    #[test]
    fn absorption_is_the_sum_over_contents_and_linear_between_rows() {
        let contents = LeafContents { anthocyanin_ug_per_cm2: 3.0, brown: 0.2, ..LeafContents::default() };
        let at = |nm| ProspectD.absorption(&contents, nm);
        assert!((at(550.5) - 0.5 * (at(550.0) + at(551.0))).abs() < 1e-12);
        let without = LeafContents { anthocyanin_ug_per_cm2: 0.0, ..contents };
        let difference = at(550.0) - ProspectD.absorption(&without, 550.0);
        assert!((difference - 3.0 * ProspectD.coefficients(550.0)[2]).abs() < 1e-12 && difference > 0.1);
        assert_eq!(Prospect5.absorption(&contents, 550.0), Prospect5.absorption(&without, 550.0));
    }

    #[test]
    fn wavelengths_outside_of_the_tables_are_refused() {
        check_wavelengths(&[400.0, 555.5, 2500.0]).unwrap();
        for nm in [399.9, 2500.1, f64::NAN] {
            let message = check_wavelengths(&[500.0, nm]).unwrap_err().to_string();
            assert!(message.contains(&format!("{nm} nm")) && message.contains("400 to 2500"), "{message}");
            assert!(Prospect5.index(nm).is_nan());
        }
    }
}

//! Figures typed in from the literature; nothing is read at run time.

pub(crate) mod abm;
pub(crate) mod prospect_5;
#[allow(clippy::approx_constant, reason = "one refractive index happens to start with log2(e)'s digits")]
pub(crate) mod prospect_d;

/// Number of rows of a leaf table: 400 to 780 nm.
pub(crate) const LEAF_ROWS: usize = 381;

/// Wavelength of a leaf table's first row in nanometres; the rows are 1 nm apart.
pub(crate) const LEAF_FIRST_NM: f64 = 400.0;

/// Wavelength of a leaf table's last row in nanometres.
pub(crate) const LEAF_LAST_NM: f64 = 780.0;

/// Refractive index and specific absorptions of leaf tissue, by wavelength.
pub(crate) struct LeafTable {
    /// Refractive index.
    pub(crate) index: [f64; LEAF_ROWS],
    /// Specific absorption of chlorophyll a + b in cm2/ug.
    pub(crate) chlorophyll: [f64; LEAF_ROWS],
    /// Specific absorption of carotenoids in cm2/ug.
    pub(crate) carotenoid: [f64; LEAF_ROWS],
    /// Specific absorption of anthocyanins in cm2/ug.
    pub(crate) anthocyanin: [f64; LEAF_ROWS],
    /// Specific absorption of brown pigment, per arbitrary unit.
    pub(crate) brown: [f64; LEAF_ROWS],
    /// Specific absorption of water in 1/cm.
    pub(crate) water: [f64; LEAF_ROWS],
    /// Specific absorption of dry matter in cm2/g.
    pub(crate) dry_matter: [f64; LEAF_ROWS],
}

/// Returns the value of a column, linear between its rows; NaN outside of them, so that a mistake shows.
pub(crate) fn interpolated(column: &[f64], first_nm: f64, step_nm: f64, wavelength_nm: f64) -> f64 {
    let position = (wavelength_nm - first_nm) / step_nm;
    let last = column.len() - 1;
    if !(0.0..=last as f64).contains(&position) {
        return f64::NAN;
    }
    let row = (position as usize).min(last - 1);
    let fraction = position - row as f64;
    column[row] * (1.0 - fraction) + column[row + 1] * fraction
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_rows_a_column_is_linear_and_outside_it_says_so() {
        let column = [1.0, 3.0, 4.0];
        assert_eq!(interpolated(&column, 400.0, 5.0, 400.0), 1.0);
        assert_eq!(interpolated(&column, 400.0, 5.0, 402.5), 2.0);
        assert_eq!(interpolated(&column, 400.0, 5.0, 405.0), 3.0);
        assert_eq!(interpolated(&column, 400.0, 5.0, 410.0), 4.0);
        for outside in [399.9, 410.1, f64::NAN, f64::INFINITY] {
            assert!(interpolated(&column, 400.0, 5.0, outside).is_nan(), "{outside}");
        }
    }
}

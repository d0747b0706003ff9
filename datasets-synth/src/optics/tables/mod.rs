//! Figures from the literature, compiled into the program.

pub(crate) mod abm;
pub(crate) mod leaf_table;

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

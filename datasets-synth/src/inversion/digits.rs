//! Numbers with as many digits as they are worth.

/// Writes a number with `digits` significant digits, without idle zeros: 41.29, 0.01235, 250.
pub fn significant(x: f64, digits: usize) -> String {
    if x == 0.0 || !x.is_finite() {
        return x.to_string();
    }
    let decimals = (digits as i32 - 1 - x.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{x:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::significant;

    #[test]
    fn numbers_have_their_digits_and_no_idle_zeros() {
        for (x, text) in
            [(0.0, "0"), (41.28734, "41.29"), (0.0123456, "0.01235"), (1.5, "1.5"), (250.0, "250"), (-0.5, "-0.5")]
        {
            assert_eq!(significant(x, 4), text);
        }
        assert_eq!(significant(f64::NAN, 2), "NaN");
        assert_eq!(significant(0.0001234, 2), "0.00012");
    }
}

//! Parses the values of options.

/// Parses a colour of three numbers with commas between.
pub(super) fn parse_colour(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    numbers
        .and_then(|numbers| <[f64; 3]>::try_from(numbers).ok())
        .ok_or_else(|| "write three numbers with commas between, such as 0.3,0.1,0.05".into())
}

/// Parses a count as people type it: 1000000 or 1e6.
pub(super) fn whole_number(text: &str) -> Result<u64, String> {
    match text.parse::<f64>() {
        Ok(x) if (1.0..=1e12).contains(&x) && x.fract() == 0.0 => Ok(x as u64),
        _ => Err("give a whole number from 1 to 1e12, such as 1000000 or 1e6".into()),
    }
}

//! What a reader of an inversion must know beside the numbers, in words.

use crate::inversion::forward::{MAX_UNKNOWNS, Unknown};
use crate::inversion::outcome::{Inversion, State};

/// Standard error, relative to a leaf's range, above which a content counts as not told.
const VAGUE: f64 = 0.25;
/// Correlation above which two contents are told only together.
const TOGETHER: f64 = 0.97;
/// Root mean square error of the shares of light above which the spectra are those of another kind of thing.
const POOR: f64 = 0.04;

/// Returns the remarks on an inversion. `ranges` are those of leaves, for each unknown; `span_nm` is the range of
/// wavelengths that was measured.
pub(crate) fn remarks(
    unknowns: &[Unknown],
    ranges: &[[f64; 2]; MAX_UNKNOWNS],
    found: &Inversion,
    span_nm: [f64; 2],
) -> Vec<String> {
    let mut remarks = Vec::new();
    for (i, unknown) in unknowns.iter().enumerate() {
        let Unknown { name, unit, .. } = unknown;
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        let (value, error) = (shown(found.values[i]), found.standard_errors[i]);
        let [least, most] = ranges[i];
        match found.states[i] {
            State::Untold => remarks.push(format!(
                "{name} cannot be told between {} and {} nm and stayed at {value}{unit}",
                span_nm[0], span_nm[1]
            )),
            State::AtBound => remarks.push(format!("{name} ended at {value}{unit}, an end of what is tried")),
            State::Found if error > VAGUE * (most - least) => {
                remarks.push(format!("{name} is hardly told: {value} +- {}{unit}", shown(error)));
            }
            State::Found if !(least..=most).contains(&found.values[i]) => {
                remarks.push(format!("{name} is {value}{unit}, outside of {least} to {most}, which leaves have"));
            }
            _ => {}
        }
        for j in 0..i {
            if found.correlations[i][j].abs() > TOGETHER {
                let other = unknowns[j].name;
                remarks.push(format!(
                    "{other} and {name} are told only together: correlation {:.2}",
                    found.correlations[i][j]
                ));
            }
        }
    }
    if let Some(worst) = found.rmse.into_iter().flatten().reduce(f64::max)
        && worst > POOR
    {
        remarks.push(format!("the model misses the spectra by {worst:.3} (root mean square): no leaf of its kind"));
    }
    remarks
}

/// Writes a number with four digits.
pub(crate) fn shown(x: f64) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    let digits = (3 - x.abs().log10().floor() as i32).clamp(0, 8) as usize;
    let text = format!("{x:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::shown;

    #[test]
    fn numbers_have_four_digits_and_no_idle_zeros() {
        for (x, text) in
            [(0.0, "0"), (41.28734, "41.29"), (0.0123456, "0.01235"), (1.5, "1.5"), (250.0, "250"), (-0.5, "-0.5")]
        {
            assert_eq!(shown(x), text);
        }
    }
}

//! What a reader of an inversion must know beside the numbers, in words.

use crate::inversion::digits::significant;
use crate::inversion::forward::Unknown;
use crate::inversion::outcome::{Inversion, State};

/// Standard error, relative to a leaf's range, above which a content counts as not told.
const VAGUE: f64 = 0.25;
/// Correlation above which two contents are told only together.
const TOGETHER: f64 = 0.97;
/// Root mean square error of the shares of light above which the spectra are those of another kind of thing.
const POOR: f64 = 0.04;

/// Returns the remarks on an inversion. `needs_faces` is the index of the first unknown that both faces were needed for; `span_nm` is the range of wavelengths that was measured.
pub(crate) fn remarks(unknowns: &[Unknown], found: &Inversion, needs_faces: usize, span_nm: [f64; 2]) -> Vec<String> {
    let mut remarks = Vec::new();
    for (i, unknown) in unknowns.iter().enumerate() {
        let Unknown { name, unit, .. } = unknown;
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        let (value, error) = (significant(found.values[i], 4), found.standard_errors[i]);
        let [least, most] = unknown.range;
        match found.states[i] {
            State::Untold if i > needs_faces => {}
            State::Untold if i == needs_faces => remarks.push(
                "how contents divide between the halves of the leaf takes spectra of both faces and stayed as it was"
                    .to_owned(),
            ),
            State::Untold => remarks.push(format!(
                "{name} cannot be told between {} and {} nm and stayed at {value}{unit}",
                span_nm[0], span_nm[1]
            )),
            State::AtBound => remarks.push(format!("{name} ended at {value}{unit}, an end of what is tried")),
            state if state.is_found() && error > VAGUE * (most - least) => {
                remarks.push(format!("{name} is hardly told: {value} +- {}{unit}", significant(error, 2)));
            }
            state if state.is_found() && !(least..=most).contains(&found.values[i]) => {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inversion::forward::MAX_UNKNOWNS;

    #[test]
    fn what_is_not_told_well_is_named_and_what_is_told_well_is_not() {
        let unknown = |name: &'static str| Unknown {
            key: name,
            option: name,
            name,
            unit: "mg",
            bounds: [0.0, 100.0],
            range: [0.0, 10.0],
            start: 5.0,
            spread: 5.0,
        };
        let unknowns = ["sure", "vague", "bound", "untold", "far"].map(unknown);
        let mut found = Inversion {
            values: [0.0; MAX_UNKNOWNS],
            standard_errors: [f64::NAN; MAX_UNKNOWNS],
            correlations: [[0.0; MAX_UNKNOWNS]; MAX_UNKNOWNS],
            states: [State::Held; MAX_UNKNOWNS],
            rmse: [Some(0.01), None, None, None],
            steps: 1,
            remarks: Vec::new(),
        };
        found.values[..5].copy_from_slice(&[5.0, 6.0, 100.0, 5.0, 12.0]);
        found.standard_errors[..5].copy_from_slice(&[0.1, 4.0, f64::NAN, f64::NAN, 0.1]);
        found.states[..5].copy_from_slice(&[
            State::Found,
            State::Found,
            State::AtBound,
            State::Untold,
            State::FoundByDomain,
        ]);
        let told = |found: &Inversion| remarks(&unknowns, found, 5, [400.0, 780.0]);
        let words = told(&found);
        for (remark, expected) in words.iter().zip([
            "vague is hardly told: 6 +- 4 mg",
            "bound ended at 100 mg",
            "untold cannot be told between 400 and 780 nm",
            "far is 12 mg, outside of 0 to 10",
        ]) {
            assert!(remark.contains(expected), "{remark}");
        }
        assert_eq!(words.len(), 4, "{words:?}");
        found.correlations[1][0] = -0.99;
        found.rmse[0] = Some(0.1);
        let more = told(&found);
        assert!(more.iter().any(|remark| remark.contains("sure and vague are told only together: correlation -0.99")));
        assert!(more.last().unwrap().contains("misses the spectra by 0.100"), "{more:?}");
    }
}

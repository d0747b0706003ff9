//! Checks the contents of leaves, by the names of the command line.

use btf_models::{LEAF_QUANTITIES, LeafContents, LeafDescription};

use crate::error::SynthError;

/// Names of the options of the contents, in the order of [`LEAF_QUANTITIES`].
const OPTIONS: [&str; 7] = ["--cab", "--car", "--cant", "--cbrown", "--cw", "--cm", "--n"];

/// Checks every range. The models themselves accept any contents from 0 up. Contents beyond these ranges are those of
/// no leaf, but often a wrong unit (dry matter in mg/cm2, for example).
///
/// # Errors
/// [`SynthError::BadParameter`] for the first out of its range, named as on the command line.
pub fn check_contents(contents: &LeafContents) -> Result<(), SynthError> {
    let leaf = LeafDescription { contents: *contents, ..LeafDescription::default() };
    for (name, quantity) in OPTIONS.into_iter().zip(&LEAF_QUANTITIES) {
        let value = quantity.of(&leaf);
        if quantity.fault(value).is_some() {
            let ([low, high], unit) = (quantity.range, if quantity.unit.is_empty() { "" } else { " " });
            let allowed = format!("a number from {low} to {high}{unit}{} of {}", quantity.unit, quantity.name);
            return Err(SynthError::BadParameter { name, value: value.to_string(), allowed });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contents_out_of_range_are_named_with_option_and_range() {
        check_contents(&LeafContents::default()).unwrap();
        let message = |contents: LeafContents| check_contents(&contents).unwrap_err().to_string();
        let green = LeafContents::default();
        for (contents, option, range) in [
            (LeafContents { chlorophyll_ug_per_cm2: 400.0, ..green }, "--cab is 400", "0 to 100 ug/cm2"),
            (LeafContents { carotenoid_ug_per_cm2: -1.0, ..green }, "--car is -1", "0 to 25 ug/cm2"),
            (LeafContents { anthocyanin_ug_per_cm2: 16.0, ..green }, "--cant is 16", "0 to 15 ug/cm2"),
            (LeafContents { brown: f64::NAN, ..green }, "--cbrown is NaN", "0 to 1 of"),
            (LeafContents { water_cm: 1.0, ..green }, "--cw is 1", "0 to 0.04 cm"),
            (LeafContents { dry_matter_g_per_cm2: 20.0, ..green }, "--cm is 20", "0 to 0.02 g/cm2"),
            (LeafContents { structure: 0.99, ..green }, "--n is 0.99", "1 to 3"),
        ] {
            let message = message(contents);
            assert!(message.contains(option) && message.contains(range), "{message}");
        }
    }
}

//! What a leaf holds, and the ranges that are taken for a leaf's.

use crate::error::SynthError;

/// What a leaf holds per area of leaf.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeafContents {
    /// Chlorophyll a + b in ug/cm2, 0 to 100.
    pub chlorophyll_ug_per_cm2: f64,
    /// Carotenoids in ug/cm2, 0 to 25.
    pub carotenoid_ug_per_cm2: f64,
    /// Anthocyanins in ug/cm2, 0 to 15. Only PROSPECT-D knows their absorption.
    pub anthocyanin_ug_per_cm2: f64,
    /// Brown pigment in arbitrary units, 0 to 1.
    pub brown: f64,
    /// Water in cm, 0 to 0.04.
    pub water_cm: f64,
    /// Dry matter in g/cm2, 0 to 0.02.
    pub dry_matter_g_per_cm2: f64,
    /// Structure parameter N, 1 to 3.
    pub structure: f64,
}

impl Default for LeafContents {
    /// A green leaf: 40 ug/cm2 chlorophyll, 8 ug/cm2 carotenoids, no anthocyanins, no brown pigment,
    /// 0.01 cm water, 0.005 g/cm2 dry matter, N = 1.5.
    fn default() -> LeafContents {
        LeafContents {
            chlorophyll_ug_per_cm2: 40.0,
            carotenoid_ug_per_cm2: 8.0,
            anthocyanin_ug_per_cm2: 0.0,
            brown: 0.0,
            water_cm: 0.01,
            dry_matter_g_per_cm2: 0.005,
            structure: 1.5,
        }
    }
}

impl LeafContents {
    /// Checks every range. The models themselves survive any contents from 0 up; beyond these ranges
    /// lies no leaf, but often a slip of the unit (dry matter in mg/cm2, say).
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for the first out of its range, named as on the command line.
    pub fn check(&self) -> Result<(), SynthError> {
        for (name, value, low, high, unit) in [
            ("--cab", self.chlorophyll_ug_per_cm2, 0.0, 100.0, " ug/cm2 of chlorophyll"),
            ("--car", self.carotenoid_ug_per_cm2, 0.0, 25.0, " ug/cm2 of carotenoids"),
            ("--cant", self.anthocyanin_ug_per_cm2, 0.0, 15.0, " ug/cm2 of anthocyanins"),
            ("--cbrown", self.brown, 0.0, 1.0, " of brown pigment"),
            ("--cw", self.water_cm, 0.0, 0.04, " cm of water"),
            ("--cm", self.dry_matter_g_per_cm2, 0.0, 0.02, " g/cm2 of dry matter"),
            ("--n", self.structure, 1.0, 3.0, ""),
        ] {
            // Not `<`, so that a NaN is refused, too.
            if !(low..=high).contains(&value) {
                let allowed = format!("a number from {low} to {high}{unit}");
                return Err(SynthError::BadParameter { name, value: value.to_string(), allowed });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contents_out_of_range_are_named_with_option_and_range() {
        LeafContents::default().check().unwrap();
        let message = |contents: LeafContents| contents.check().unwrap_err().to_string();
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

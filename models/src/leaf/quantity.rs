//! The numbers that describe a leaf, each with its key, unit and range: one table for files, command lines and
//! panels.

use crate::leaf::description::LeafDescription;
use btf_leaf_quantities::{
    ANTHOCYANINS, BROWN, CAROTENOIDS, CHLOROPHYLL, DRY_MATTER, GAMMA_ACROSS, GAMMA_ALONG, GLOSS_INDEX, Quantity,
    STRUCTURE, WATER,
};

/// One number of a [`LeafDescription`].
#[derive(Debug, Clone, Copy)]
pub struct LeafQuantity {
    /// Table of the leaf file in which the number stands.
    pub section: &'static str,
    /// Key of the number in its table.
    pub key: &'static str,
    /// Name for people, without the unit.
    pub name: &'static str,
    /// Unit; empty for what has none.
    pub unit: &'static str,
    /// Meaning for people, a clause without a full stop.
    pub meaning: &'static str,
    /// Least and greatest value of a leaf.
    pub range: [f64; 2],
    get: fn(&LeafDescription) -> f64,
    set: fn(&mut LeafDescription, f64),
}

impl LeafQuantity {
    /// Returns the number of a leaf.
    pub fn of(&self, leaf: &LeafDescription) -> f64 {
        (self.get)(leaf)
    }

    /// Puts another one in.
    pub fn set(&self, leaf: &mut LeafDescription, value: f64) {
        (self.set)(leaf, value);
    }

    /// Returns what is wrong with a value, as a verb phrase for a sentence that starts with the file: nothing for one
    /// within the range.
    pub fn fault(&self, value: f64) -> Option<String> {
        let [least, most] = self.range;
        // Not `<`, so that a NaN is refused, too.
        if (least..=most).contains(&value) {
            return None;
        }
        let LeafQuantity { section, key, .. } = self;
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        Some(format!("has `{key}` in [{section}] as {value}, which is not within {least} to {most}{unit}"))
    }
}

/// Coefficients of variation: at 1 one plant in six would have less than nothing.
const VARIATION: [f64; 2] = [0.0, 1.0];

/// A row of the table that `btf-runtime` shares: everything but the field is as [`btf_leaf_quantities`] has it.
macro_rules! shared {
    ($quantity:ident, $($field:ident).+) => {{
        const QUANTITY: Quantity = $quantity;
        LeafQuantity {
            section: QUANTITY.part.section(),
            key: QUANTITY.key,
            name: QUANTITY.name,
            unit: QUANTITY.unit,
            meaning: QUANTITY.meaning,
            range: QUANTITY.range,
            get: |leaf| leaf.$($field).+,
            set: |leaf, value| leaf.$($field).+ = value,
        }
    }};
}

/// A row of what leaf files have besides: table and key in the file, name, unit, meaning, range, field.
macro_rules! quantity {
    ($section:literal, $key:literal, $name:literal, $unit:literal, $meaning:literal, $range:expr, $($field:ident).+) => {
        LeafQuantity {
            section: $section,
            key: $key,
            name: $name,
            unit: $unit,
            meaning: $meaning,
            range: $range,
            get: |leaf| leaf.$($field).+,
            set: |leaf, value| leaf.$($field).+ = value,
        }
    };
}

/// Every number, in the order of the file. The contents come first, in the order of [`crate::LeafContents`]'s options:
/// chlorophyll, carotenoids, anthocyanins, brown, water, dry matter, structure; then the gloss. These ten are
/// [`btf_leaf_quantities::QUANTITIES`], in their order.
pub const LEAF_QUANTITIES: [LeafQuantity; 16] = [
    shared!(CHLOROPHYLL, contents.chlorophyll_ug_per_cm2),
    shared!(CAROTENOIDS, contents.carotenoid_ug_per_cm2),
    shared!(ANTHOCYANINS, contents.anthocyanin_ug_per_cm2),
    shared!(BROWN, contents.brown),
    shared!(WATER, contents.water_cm),
    shared!(DRY_MATTER, contents.dry_matter_g_per_cm2),
    shared!(STRUCTURE, contents.structure),
    shared!(GLOSS_INDEX, gloss.index),
    shared!(GAMMA_ALONG, gloss.gamma_along),
    shared!(GAMMA_ACROSS, gloss.gamma_across),
    quantity!(
        "look",
        "severity",
        "severity of the deficiency",
        "",
        "how far the deficiency has gone in textures that btf-synth grows; nothing changes in this picture",
        [0.0, 1.0],
        severity
    ),
    quantity!(
        "look",
        "size_mm",
        "width of the patch",
        "mm",
        "width of the patch that textures and captures show; nothing changes in this picture",
        [1.0, 200.0],
        size_mm
    ),
    quantity!(
        "variation",
        "chlorophyll",
        "variation of chlorophyll",
        "",
        "standard deviation over mean of chlorophyll among the plants",
        VARIATION,
        variation.chlorophyll
    ),
    quantity!(
        "variation",
        "carotenoid",
        "variation of carotenoids",
        "",
        "standard deviation over mean of carotenoids among the plants",
        VARIATION,
        variation.carotenoid
    ),
    quantity!(
        "variation",
        "brown",
        "variation of brown pigment",
        "",
        "standard deviation over mean of brown pigment among the plants",
        VARIATION,
        variation.brown
    ),
    quantity!(
        "variation",
        "thickness",
        "variation of thickness",
        "",
        "standard deviation over mean of all that absorbs, among the plants",
        VARIATION,
        variation.thickness
    ),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaf::description::LeafDescription;
    use btf_leaf_quantities::QUANTITIES;

    #[test]
    fn the_shared_quantities_come_first_and_the_plain_leaf_has_their_defaults() {
        let plain = LeafDescription::default();
        for (own, shared) in LEAF_QUANTITIES.iter().zip(&QUANTITIES) {
            assert_eq!((own.section, own.key), (shared.part.section(), shared.key));
            assert_eq!(own.of(&plain), shared.default, "{}", own.key);
        }
    }
}

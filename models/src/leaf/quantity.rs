//! The numbers that describe a leaf, each with its key, unit and range: one table for files, command lines and
//! panels.

use crate::leaf::description::LeafDescription;
use crate::leaf::species::LeafGloss;

/// One number of a [`LeafDescription`].
#[derive(Debug, Clone, Copy)]
pub struct LeafQuantity {
    /// Its table in the file.
    pub section: &'static str,
    /// Its key there.
    pub key: &'static str,
    /// What it is, for people, without the unit.
    pub name: &'static str,
    /// Unit; empty for what has none.
    pub unit: &'static str,
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

/// A row of the table: where it stands in the file, what it is, and the field.
macro_rules! quantity {
    ($section:literal, $key:literal, $name:literal, $unit:literal, $range:expr, $($field:ident).+) => {
        LeafQuantity {
            section: $section,
            key: $key,
            name: $name,
            unit: $unit,
            range: $range,
            get: |leaf| leaf.$($field).+,
            set: |leaf, value| leaf.$($field).+ = value,
        }
    };
}

/// Roughness of a gloss.
const ROUGHNESS: [f64; 2] = [LeafGloss::MIN_ROUGHNESS, 1.0];

/// Coefficients of variation: at 1 one plant in six would have less than nothing.
const VARIATION: [f64; 2] = [0.0, 1.0];

/// Every number, in the order of the file. The contents come first, in the order of
/// [`crate::LeafContents`]'s options: chlorophyll, carotenoids, anthocyanins, brown, water, dry matter, structure.
pub const LEAF_QUANTITIES: [LeafQuantity; 16] = [
    quantity!(
        "contents",
        "chlorophyll_ug_per_cm2",
        "chlorophyll",
        "ug/cm2",
        [0.0, 100.0],
        contents.chlorophyll_ug_per_cm2
    ),
    quantity!(
        "contents",
        "carotenoid_ug_per_cm2",
        "carotenoids",
        "ug/cm2",
        [0.0, 25.0],
        contents.carotenoid_ug_per_cm2
    ),
    quantity!(
        "contents",
        "anthocyanin_ug_per_cm2",
        "anthocyanins",
        "ug/cm2",
        [0.0, 15.0],
        contents.anthocyanin_ug_per_cm2
    ),
    quantity!("contents", "brown", "brown pigment", "", [0.0, 1.0], contents.brown),
    quantity!("contents", "water_cm", "water", "cm", [0.0, 0.04], contents.water_cm),
    quantity!("contents", "dry_matter_g_per_cm2", "dry matter", "g/cm2", [0.0, 0.02], contents.dry_matter_g_per_cm2),
    quantity!("contents", "structure", "structure N", "", [1.0, 3.0], contents.structure),
    quantity!("gloss", "index", "refractive index", "", [1.01, 3.0], gloss.index),
    quantity!("gloss", "gamma_along", "roughness along the veins", "", ROUGHNESS, gloss.gamma_along),
    quantity!("gloss", "gamma_across", "roughness across the veins", "", ROUGHNESS, gloss.gamma_across),
    quantity!("look", "severity", "severity of the deficiency", "", [0.0, 1.0], severity),
    quantity!("look", "size_mm", "width of the patch", "mm", [1.0, 200.0], size_mm),
    quantity!("variation", "chlorophyll", "variation of chlorophyll", "", VARIATION, variation.chlorophyll),
    quantity!("variation", "carotenoid", "variation of carotenoids", "", VARIATION, variation.carotenoid),
    quantity!("variation", "brown", "variation of brown pigment", "", VARIATION, variation.brown),
    quantity!("variation", "thickness", "variation of thickness", "", VARIATION, variation.thickness),
];

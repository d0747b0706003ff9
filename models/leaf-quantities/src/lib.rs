//! The numbers that describe a leaf's tissue and gloss: key, unit, range, default and meaning of each, in one table.
//!
//! The reader of leaf files (`btf-models`) and the evaluation of leaves (`btf-runtime`) both derive their tables from
//! this one. The package depends on nothing, so that neither of the two depends on the other.

#![forbid(unsafe_code)]

/// The part of a leaf that a quantity describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The contents of the tissue, per area of leaf.
    Tissue,
    /// The gloss of the cuticle.
    Gloss,
}

impl Part {
    /// Returns the name of the part's table in a leaf file: `contents` or `gloss`.
    pub const fn section(self) -> &'static str {
        match self {
            Part::Tissue => "contents",
            Part::Gloss => "gloss",
        }
    }
}

/// A number that describes a leaf.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// Part of the leaf that the number describes.
    pub part: Part,
    /// Key in the part's table of a leaf file.
    pub key: &'static str,
    /// Key that tells the quantity without its part: name of the field where all quantities stand beside each other.
    pub whole_key: &'static str,
    /// Name for people, without the unit.
    pub name: &'static str,
    /// Unit; empty for a number without one.
    pub unit: &'static str,
    /// Meaning for people, a clause without a full stop.
    pub meaning: &'static str,
    /// Least and greatest value that leaves have.
    pub range: [f64; 2],
    /// Value of the plain green leaf.
    pub default: f64,
}

impl Quantity {
    /// Returns the range in single precision.
    pub const fn range_f32(&self) -> [f32; 2] {
        [self.range[0] as f32, self.range[1] as f32]
    }
}

/// Chlorophyll a and b.
pub const CHLOROPHYLL: Quantity = Quantity {
    part: Part::Tissue,
    key: "chlorophyll_ug_per_cm2",
    whole_key: "chlorophyll_ug_per_cm2",
    name: "chlorophyll",
    unit: "ug/cm2",
    meaning: "chlorophyll a and b, which absorb blue and red",
    range: [0.0, 100.0],
    default: 40.0,
};

/// Carotenoids.
pub const CAROTENOIDS: Quantity = Quantity {
    part: Part::Tissue,
    key: "carotenoid_ug_per_cm2",
    whole_key: "carotenoid_ug_per_cm2",
    name: "carotenoids",
    unit: "ug/cm2",
    meaning: "carotenoids, which absorb blue; what is left of them makes autumn yellow",
    range: [0.0, 25.0],
    default: 8.0,
};

/// Anthocyanins. Of the models only PROSPECT-D has their absorption.
pub const ANTHOCYANINS: Quantity = Quantity {
    part: Part::Tissue,
    key: "anthocyanin_ug_per_cm2",
    whole_key: "anthocyanin_ug_per_cm2",
    name: "anthocyanins",
    unit: "ug/cm2",
    meaning: "anthocyanins, which absorb green and look red",
    range: [0.0, 15.0],
    default: 0.0,
};

/// Brown pigment of dying tissue, arbitrary units.
pub const BROWN: Quantity = Quantity {
    part: Part::Tissue,
    key: "brown",
    whole_key: "brown",
    name: "brown pigment",
    unit: "",
    meaning: "brown pigment of dying tissue, in arbitrary units",
    range: [0.0, 1.0],
    default: 0.0,
};

/// Water, as the thickness of a layer.
pub const WATER: Quantity = Quantity {
    part: Part::Tissue,
    key: "water_cm",
    whole_key: "water_cm",
    name: "water",
    unit: "cm",
    meaning: "water as a layer; it absorbs next to nothing of what is visible",
    range: [0.0, 0.04],
    default: 0.01,
};

/// Dry matter.
pub const DRY_MATTER: Quantity = Quantity {
    part: Part::Tissue,
    key: "dry_matter_g_per_cm2",
    whole_key: "dry_matter_g_per_cm2",
    name: "dry matter",
    unit: "g/cm2",
    meaning: "dry matter: cell walls, proteins, starch",
    range: [0.0, 0.02],
    default: 0.005,
};

/// Structure parameter N of PROSPECT [Jacquemoud 1990]: the number of plates, which need not be whole.
pub const STRUCTURE: Quantity = Quantity {
    part: Part::Tissue,
    key: "structure",
    whole_key: "structure",
    name: "structure N",
    unit: "",
    meaning: "number of layers between which light is scattered; more reflect more and transmit less",
    range: [1.0, 3.0],
    default: 1.5,
};

/// Refractive index of the cuticle [Miao, section 2].
pub const GLOSS_INDEX: Quantity = Quantity {
    part: Part::Gloss,
    key: "index",
    whole_key: "gloss_index",
    name: "refractive index",
    unit: "",
    meaning: "refractive index of the cuticle; more shines more",
    range: [1.01, 3.0],
    default: 1.42,
};

/// Least roughness of a gloss: a narrower lobe falls between the directions of a capture.
const MIN_ROUGHNESS: f64 = 0.05;

/// Roughness of the gloss along the veins: the square root of twice the variance of its facets' slopes, which is
/// Beckmann's alpha.
pub const GAMMA_ALONG: Quantity = Quantity {
    part: Part::Gloss,
    key: "gamma_along",
    whole_key: "gamma_along",
    name: "roughness along the veins",
    unit: "",
    meaning: "roughness of the gloss along the veins",
    range: [MIN_ROUGHNESS, 1.0],
    default: 0.3,
};

/// Roughness of the gloss across the veins: the square root of twice the variance of its facets' slopes, which is
/// Beckmann's alpha.
pub const GAMMA_ACROSS: Quantity = Quantity {
    part: Part::Gloss,
    key: "gamma_across",
    whole_key: "gamma_across",
    name: "roughness across the veins",
    unit: "",
    meaning: "roughness of the gloss across the veins",
    range: [MIN_ROUGHNESS, 1.0],
    default: 0.3,
};

/// The quantities of a leaf, the tissue's first, in the order of leaf files.
pub const QUANTITIES: [Quantity; 10] = [
    CHLOROPHYLL,
    CAROTENOIDS,
    ANTHOCYANINS,
    BROWN,
    WATER,
    DRY_MATTER,
    STRUCTURE,
    GLOSS_INDEX,
    GAMMA_ALONG,
    GAMMA_ACROSS,
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn keys_are_unique_defaults_lie_in_their_ranges_and_the_tissue_comes_first() {
        let whole: BTreeSet<&str> = QUANTITIES.iter().map(|quantity| quantity.whole_key).collect();
        assert_eq!(whole.len(), QUANTITIES.len());
        let in_files: BTreeSet<(&str, &str)> =
            QUANTITIES.iter().map(|quantity| (quantity.part.section(), quantity.key)).collect();
        assert_eq!(in_files.len(), QUANTITIES.len());
        for Quantity { whole_key, range: [least, most], default, .. } in QUANTITIES {
            assert!((least..=most).contains(&default), "{whole_key}");
        }
        assert!(QUANTITIES.is_sorted_by_key(|quantity| quantity.part == Part::Gloss));
    }
}

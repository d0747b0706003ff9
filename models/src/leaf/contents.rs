//! Contents of a leaf.

use btf_leaf_quantities::{ANTHOCYANINS, BROWN, CAROTENOIDS, CHLOROPHYLL, DRY_MATTER, STRUCTURE, WATER};

/// Contents of a leaf per area of its blade. Ranges: [`crate::LEAF_QUANTITIES`].
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
    /// Returns a green leaf: 40 ug/cm2 chlorophyll, 8 ug/cm2 carotenoids, no anthocyanins, no brown pigment, 0.01 cm
    /// water, 0.005 g/cm2 dry matter, N = 1.5.
    fn default() -> LeafContents {
        LeafContents {
            chlorophyll_ug_per_cm2: CHLOROPHYLL.default,
            carotenoid_ug_per_cm2: CAROTENOIDS.default,
            anthocyanin_ug_per_cm2: ANTHOCYANINS.default,
            brown: BROWN.default,
            water_cm: WATER.default,
            dry_matter_g_per_cm2: DRY_MATTER.default,
            structure: STRUCTURE.default,
        }
    }
}

impl LeafContents {
    /// Returns this leaf without any pigment, an albino [Miao, Fig. 2f].
    pub fn without_pigments(self) -> LeafContents {
        LeafContents {
            chlorophyll_ug_per_cm2: 0.0,
            carotenoid_ug_per_cm2: 0.0,
            anthocyanin_ug_per_cm2: 0.0,
            brown: 0.0,
            ..self
        }
    }
}

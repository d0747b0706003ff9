//! Named physiological states of a leaf: contents of a whole blade.
//!
//! | preset | Cab | Car | Cant | brown | water | dry | N | reason |
//! |---|---|---|---|---|---|---|---|---|
//! | healthy | 40 | 8 | 0 | 0 | 0.010 | 0.005 | 1.5 | the default leaf |
//! | nitrogen-deficient | 12 | 3.5 | 0 | 0.05 | 0.010 | 0.004 | 1.5 | Miao's sample 4 refitted: Cab 11.6, Car 3.2 (docs/results/leaf-optics.md) |
//! | magnesium-deficient | 18 | 7 | 1.5 | 0.10 | 0.010 | 0.005 | 1.5 | half of the chlorophyll gone, carotenoids kept, reddish margins |
//! | senescent | 4 | 8 | 0.5 | 0.50 | 0.004 | 0.005 | 2.2 | chlorophyll goes before carotenoids; drying opens air gaps: N rises |
//! | albino | 0 | 0 | 0 | 0 | 0.010 | 0.005 | 1.5 | no pigment at all [Miao, Fig. 2f] |
//!
//! Units are those of [`LeafContents`]. The contents are means over a blade. Where on the blade a deficiency shows
//! belongs to its appearance textures: [`crate::LeafDescription::deficiency`] generates them, and then the contents
//! stay those of the healthy leaf. When it is wrong: a preset is a look within the ranges that leaf models are used in,
//! no diagnosis; the two deficiencies beyond their cited number are round figures.

use crate::leaf::contents::LeafContents;

/// Named physiological state of a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LeafPreset {
    /// Green leaf.
    Healthy,
    /// Pale leaf with little of everything that holds nitrogen.
    NitrogenDeficient,
    /// Yellowish green leaf, reddish at the margins.
    MagnesiumDeficient,
    /// Old leaf, yellow to brown.
    Senescent,
    /// White leaf.
    Albino,
}

impl LeafPreset {
    /// Every preset.
    pub const ALL: [LeafPreset; 5] = [
        LeafPreset::Healthy,
        LeafPreset::NitrogenDeficient,
        LeafPreset::MagnesiumDeficient,
        LeafPreset::Senescent,
        LeafPreset::Albino,
    ];

    /// Returns the name in files and panels.
    pub fn name(self) -> &'static str {
        match self {
            LeafPreset::Healthy => "healthy",
            LeafPreset::NitrogenDeficient => "nitrogen-deficient",
            LeafPreset::MagnesiumDeficient => "magnesium-deficient",
            LeafPreset::Senescent => "senescent",
            LeafPreset::Albino => "albino",
        }
    }

    /// Returns the contents of a blade in this state.
    pub fn contents(self) -> LeafContents {
        let healthy = LeafContents::default();
        match self {
            LeafPreset::Healthy => healthy,
            LeafPreset::NitrogenDeficient => LeafContents {
                chlorophyll_ug_per_cm2: 12.0,
                carotenoid_ug_per_cm2: 3.5,
                brown: 0.05,
                dry_matter_g_per_cm2: 0.004,
                ..healthy
            },
            LeafPreset::MagnesiumDeficient => LeafContents {
                chlorophyll_ug_per_cm2: 18.0,
                carotenoid_ug_per_cm2: 7.0,
                anthocyanin_ug_per_cm2: 1.5,
                brown: 0.1,
                ..healthy
            },
            LeafPreset::Senescent => LeafContents {
                chlorophyll_ug_per_cm2: 4.0,
                anthocyanin_ug_per_cm2: 0.5,
                brown: 0.5,
                water_cm: 0.004,
                structure: 2.2,
                ..healthy
            },
            LeafPreset::Albino => healthy.without_pigments(),
        }
    }
}

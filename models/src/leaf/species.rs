//! Named leaves: contents and specular lobe of a species, and deficiencies.
//!
//! | species | patch | contents | gloss |
//! |---|---|---|---|
//! | maize | 30 mm | Cab 40, Car 5, N 1.5 [Miao, Fig. 2a] | rougher across the veins |
//! | soybean | 30 mm | Cab 43.62 [Baranoski 1997, Table 1], Car 8 | dull: hairs |
//! | tree | 30 mm | Cab 50, Car 10, N 1.6 | glossy |
//! | grass | 5 mm | Cab 35, Car 7, N 1.4 | rougher across the veins |
//! | spruce | 25 mm | Cab 95, Car 20, N 2.4, water 0.03 cm, dry matter 0.02 g/cm2 | dull: needles stand all ways |
//! | none | 20 mm | Cab 40, Car 8, N 1.5 | 0.3 |
//!
//! Where the numbers come from: the contents as cited, otherwise the middle of the ranges that leaf models are used in
//! (Cab 0 to 100, Car 0 to 25 ug/cm2, N 1 to 3). Roughness along and across veins differ as in [Comar 2014] for
//! grasses. A spruce's leaf is a shoot: needles one over the other [Stenberg 1995], so that in its outline there is some
//! twice what a needle holds, and next to nothing is transmitted. When it is wrong: a preset is a look, no botanical measurement; cultivar, age and growth change every
//! number by half.

use crate::leaf::contents::LeafContents;
use btf_leaf_quantities::{GAMMA_ACROSS, GAMMA_ALONG, GLOSS_INDEX};

/// Species of a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Species {
    /// *Zea mays*: a grass with parallel veins.
    Maize,
    /// *Glycine max*: pinnate, hairy and dull.
    Soybean,
    /// A broad-leaved tree such as beech or oak: strong secondaries, tertiaries like ladders, glossy.
    Tree,
    /// A lawn's grass such as *Lolium perenne*: parallel veins, a narrow midrib.
    Grass,
    /// *Picea abies*: a shoot, which is a twig with its needles.
    Spruce,
}

/// Specular lobe of a leaf's cuticle: Cook-Torrance with two roughnesses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeafGloss {
    /// Refractive index, 1.01 to 3.
    pub index: f64,
    /// Roughness along the vein direction, 0.05 to 1.
    pub gamma_along: f64,
    /// Roughness across the vein direction, 0.05 to 1.
    pub gamma_across: f64,
}

impl LeafGloss {
    /// Smallest roughness; a narrower lobe falls between the directions of a capture.
    pub const MIN_ROUGHNESS: f64 = GAMMA_ALONG.range[0];

    /// Refractive index of the cuticle [Miao, section 2].
    pub const CUTICLE_INDEX: f64 = GLOSS_INDEX.default;

    /// Returns the usual cuticle with a roughness along and one across the veins.
    pub const fn cuticle(gamma_along: f64, gamma_across: f64) -> LeafGloss {
        LeafGloss { index: LeafGloss::CUTICLE_INDEX, gamma_along, gamma_across }
    }
}

impl Default for LeafGloss {
    /// Returns the roughness 0.3 both ways.
    fn default() -> LeafGloss {
        LeafGloss::cuticle(GAMMA_ALONG.default, GAMMA_ACROSS.default)
    }
}

/// Defaults of a species, used where nothing else is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeciesPreset {
    /// Width and height of the patch in millimetres.
    pub size_mm: f64,
    /// Contents of the blade.
    pub contents: LeafContents,
    /// Specular lobe of the cuticle.
    pub gloss: LeafGloss,
}

impl Default for SpeciesPreset {
    /// Returns the defaults of the plain leaf.
    fn default() -> SpeciesPreset {
        SpeciesPreset { size_mm: 20.0, contents: LeafContents::default(), gloss: LeafGloss::default() }
    }
}

impl Species {
    /// Every species.
    pub const ALL: [Species; 5] = [Species::Maize, Species::Soybean, Species::Tree, Species::Grass, Species::Spruce];

    /// Returns the name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Species::Maize => "maize",
            Species::Soybean => "soybean",
            Species::Tree => "tree",
            Species::Grass => "grass",
            Species::Spruce => "spruce",
        }
    }

    /// Returns the defaults of the species.
    pub fn preset(self) -> SpeciesPreset {
        let of = |chlorophyll, carotenoid, structure, gloss| SpeciesPreset {
            size_mm: 30.0,
            contents: LeafContents {
                chlorophyll_ug_per_cm2: chlorophyll,
                carotenoid_ug_per_cm2: carotenoid,
                structure,
                ..LeafContents::default()
            },
            gloss,
        };
        match self {
            Species::Maize => of(40.0, 5.0, 1.5, LeafGloss::cuticle(0.26, 0.42)),
            Species::Soybean => of(43.62, 8.0, 1.5, LeafGloss::cuticle(0.50, 0.50)),
            Species::Tree => of(50.0, 10.0, 1.6, LeafGloss::cuticle(0.22, 0.24)),
            Species::Grass => SpeciesPreset { size_mm: 5.0, ..of(35.0, 7.0, 1.4, LeafGloss::cuticle(0.28, 0.40)) },
            Species::Spruce => {
                let shoot = of(95.0, 20.0, 2.4, LeafGloss::cuticle(0.45, 0.50));
                let contents = LeafContents { water_cm: 0.03, dry_matter_g_per_cm2: 0.02, ..shoot.contents };
                SpeciesPreset { size_mm: 25.0, contents, ..shoot }
            }
        }
    }
}

/// Deficiency of a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deficiency {
    /// Lack of nitrogen: yellow from the tip along the midrib (maize), pale all over (others).
    Nitrogen,
    /// Lack of magnesium: yellow between green veins.
    Magnesium,
}

impl Deficiency {
    /// Every deficiency.
    pub const ALL: [Deficiency; 2] = [Deficiency::Nitrogen, Deficiency::Magnesium];

    /// Default severity of a deficiency.
    pub const SEVERITY: f64 = 0.7;

    /// Default brown pigment of a deficient leaf: how brown its dead parts are.
    pub const BROWN: f64 = 0.35;

    /// Returns the name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Deficiency::Nitrogen => "nitrogen",
            Deficiency::Magnesium => "magnesium",
        }
    }
}

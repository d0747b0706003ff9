//! Description of a leaf: contents, gloss, look, and variation between plants.

use std::path::PathBuf;

use crate::leaf::contents::LeafContents;
use crate::leaf::species::{Deficiency, LeafGloss, Species, SpeciesPreset};

/// Differences between plants of one canopy, as coefficients of variation (standard deviation over mean), 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlantVariation {
    /// Variation of chlorophyll.
    pub chlorophyll: f64,
    /// Variation of carotenoids.
    pub carotenoid: f64,
    /// Variation of brown pigment.
    pub brown: f64,
    /// Variation of the thickness of the blade, which scales everything that absorbs.
    pub thickness: f64,
    /// Seed of the random numbers.
    pub seed: u64,
}

impl Default for PlantVariation {
    /// Returns a variation of 0, so that all leaves are alike, with seed 1.
    fn default() -> PlantVariation {
        PlantVariation { chlorophyll: 0.0, carotenoid: 0.0, brown: 0.0, thickness: 0.0, seed: 1 }
    }
}

/// Description of a leaf: its contents, its specular lobe and look, and the variation between plants.
#[derive(Debug, Clone, PartialEq)]
pub struct LeafDescription {
    /// Contents of the blade.
    pub contents: LeafContents,
    /// Specular lobe of the cuticle.
    pub gloss: LeafGloss,
    /// Species that sets veins, displacement and tissue; `None` is a plain pinnate leaf.
    pub species: Option<Species>,
    /// Deficiency that the textures show.
    pub deficiency: Option<Deficiency>,
    /// Progress of the deficiency, 0 (healthy) to 1; without effect on a healthy leaf.
    pub severity: f64,
    /// Seed of everything that is generated.
    pub seed: u64,
    /// Width and height of the patch that the textures show, in millimetres.
    pub size_mm: f64,
    /// Folder of appearance textures ([`crate::TextureImages`]), relative to the description file.
    pub textures: Option<PathBuf>,
    /// Variation from plant to plant.
    pub variation: PlantVariation,
}

impl Default for LeafDescription {
    /// Returns the plain leaf.
    fn default() -> LeafDescription {
        LeafDescription::of(None, None)
    }
}

impl LeafDescription {
    /// Returns the leaf of a species, or the plain one, healthy or deficient, with the defaults of everything else.
    pub fn of(species: Option<Species>, deficiency: Option<Deficiency>) -> LeafDescription {
        let SpeciesPreset { size_mm, mut contents, gloss } =
            species.map_or_else(SpeciesPreset::default, Species::preset);
        if deficiency.is_some() {
            contents.brown = Deficiency::BROWN;
        }
        LeafDescription {
            contents,
            gloss,
            species,
            deficiency,
            severity: Deficiency::SEVERITY,
            seed: 1,
            size_mm,
            textures: None,
            variation: PlantVariation::default(),
        }
    }
}

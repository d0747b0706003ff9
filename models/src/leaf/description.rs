//! A leaf: contents, gloss, look, and how plants differ.

use std::path::PathBuf;

use crate::leaf::contents::LeafContents;
use crate::leaf::species::{Deficiency, LeafGloss, Species, SpeciesPreset};

/// How plants of one canopy differ, as coefficients of variation (standard deviation over mean), 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlantVariation {
    /// Of chlorophyll.
    pub chlorophyll: f64,
    /// Of carotenoids.
    pub carotenoid: f64,
    /// Of brown pigment.
    pub brown: f64,
    /// Of the blade's thickness: of all that absorbs.
    pub thickness: f64,
    /// Seed of the draw.
    pub seed: u64,
}

impl Default for PlantVariation {
    /// Nothing varies; seed 1.
    fn default() -> PlantVariation {
        PlantVariation { chlorophyll: 0.0, carotenoid: 0.0, brown: 0.0, thickness: 0.0, seed: 1 }
    }
}

/// A leaf: what it holds, how it shines and looks, and how its like on other plants differ.
#[derive(Debug, Clone, PartialEq)]
pub struct LeafDescription {
    /// What the blade holds.
    pub contents: LeafContents,
    /// Gloss of its cuticle.
    pub gloss: LeafGloss,
    /// Veins, relief and tissue; `None` is a plain pinnate leaf.
    pub species: Option<Species>,
    /// What its textures show it to lack.
    pub deficiency: Option<Deficiency>,
    /// How far the deficiency has gone, 0 (healthy) to 1; without one it says nothing.
    pub severity: f64,
    /// Seed of everything that is grown.
    pub seed: u64,
    /// Width and height of the patch that the textures show, in millimetres.
    pub size_mm: f64,
    /// Folder of appearance textures ([`crate::TextureImages`]), relative to the description file.
    pub textures: Option<PathBuf>,
    /// From plant to plant.
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

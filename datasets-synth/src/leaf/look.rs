//! Look of a leaf apart from its contents.

use btf_models::{Species, TextureImages, TextureKind};

use crate::error::SynthError;
use crate::leaf::chlorosis::Chlorosis;

/// Look of a leaf apart from its contents: what its textures are generated from.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LeafLook {
    /// Species that sets veins, displacement and tissue; `None` is a plain pinnate leaf.
    pub species: Option<Species>,
    /// Deficiency, if any.
    pub chlorosis: Option<Chlorosis>,
    /// Textures that the user supplies.
    pub images: TextureImages,
    /// Place of the patch on the blade.
    pub place: BladePlace,
}

/// Place of a patch on the blade.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum BladePlace {
    /// Patch beside the main vein, which crosses it left of the middle.
    #[default]
    Beside,
    /// Patch over the whole blade from margin to margin: the main vein runs up the middle.
    Whole,
}

impl LeafLook {
    /// Checks the severity of the deficiency.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for a severity out of its range.
    pub fn check(&self) -> Result<(), SynthError> {
        self.chlorosis.map_or(Ok(()), |chlorosis| chlorosis.check())
    }

    /// Describes the look for a provenance, each part with a comma before it; empty for the plain leaf.
    pub fn provenance(&self) -> String {
        let species = self.species.map_or(String::new(), |species| format!(", species {}", species.name()));
        let chlorosis = self.chlorosis.map_or(String::new(), |chlorosis| {
            format!(", {} deficiency of severity {}", chlorosis.deficiency.name(), chlorosis.severity)
        });
        let own: Vec<&str> = self.images.kinds().map(TextureKind::name).collect();
        let own = if own.is_empty() { String::new() } else { format!(", own textures for {}", own.join(" and ")) };
        format!("{species}{chlorosis}{own}")
    }
}

//! How a leaf looks apart from its contents.

use btf_models::{Species, TextureImages, TextureKind};

use crate::error::SynthError;
use crate::leaf::chlorosis::Chlorosis;

/// How a leaf looks apart from its contents: what its textures are made of.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LeafLook {
    /// Veins, relief and tissue; `None` is a plain pinnate leaf.
    pub species: Option<Species>,
    /// A deficiency.
    pub chlorosis: Option<Chlorosis>,
    /// The user's own textures.
    pub images: TextureImages,
    /// Which place of the blade the patch is.
    pub place: BladePlace,
}

/// Which place of the blade a patch is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum BladePlace {
    /// A place beside the main vein, which crosses it left of the middle.
    #[default]
    Beside,
    /// The blade from margin to margin: the main vein runs up the middle.
    Whole,
}

impl LeafLook {
    /// # Errors
    /// [`SynthError::BadParameter`] for a severity out of its range.
    pub fn check(&self) -> Result<(), SynthError> {
        self.chlorosis.map_or(Ok(()), |chlorosis| chlorosis.check())
    }

    /// Returns the look in words for a provenance, each part with a comma before it; nothing for the plain leaf.
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

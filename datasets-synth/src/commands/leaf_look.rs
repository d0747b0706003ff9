//! Options of what a leaf looks like: species, deficiency, and textures as images.

use std::path::{Path, PathBuf};

use btf_synth::{AppearanceTextures, Chlorosis, Deficiency, LeafLook, LeafParams, Species, TextureImages};
use clap::{Args, ValueEnum};

use super::Failure;

#[derive(Args)]
pub(super) struct LookArgs {
    /// Species: sets veins, relief, patch size, contents and gloss where no option does [default: a plain leaf]
    #[arg(long, value_enum)]
    species: Option<SpeciesName>,
    /// What the leaf lacks: nitrogen yellows it (maize: from the tip along the midrib), magnesium between the veins
    #[arg(long, value_enum)]
    deficiency: Option<DeficiencyName>,
    /// How far the deficiency has gone (0 to 1) [default: 0.7]
    #[arg(long, requires = "deficiency", value_name = "S")]
    severity: Option<f64>,
    /// No pigment at all: an albino leaf
    #[arg(long, conflicts_with_all = ["cab", "car", "cant", "cbrown", "deficiency"])]
    pub albino: bool,
    /// Folder of your own textures (structure.png, pigment.png, gloss.png, ...); what it lacks is grown
    #[arg(long, value_name = "DIR")]
    textures: Option<PathBuf>,
    /// Write the leaf's textures as images to the new folder DIR, with textures.toml
    #[arg(long, value_name = "DIR")]
    export_textures: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum SpeciesName {
    /// Parallel veins, a wide midrib
    Maize,
    /// Pinnate, a fine reticulum, dull
    Soybean,
    /// Pinnate, strong secondaries, tertiaries like ladders, glossy
    Tree,
}

#[derive(Clone, Copy, ValueEnum)]
enum DeficiencyName {
    Nitrogen,
    Magnesium,
}

/// How far a deficiency has gone where the user does not say.
const SEVERITY: f64 = 0.7;

impl LookArgs {
    /// The parameters of the species asked for, or the default ones, with the look asked for.
    pub(super) fn params(&self) -> Result<LeafParams, Failure> {
        let species = self.species.map(|name| match name {
            SpeciesName::Maize => Species::Maize,
            SpeciesName::Soybean => Species::Soybean,
            SpeciesName::Tree => Species::Tree,
        });
        let mut params = species.map_or_else(LeafParams::default, LeafParams::of);
        let chlorosis = self.deficiency.map(|name| Chlorosis {
            deficiency: match name {
                DeficiencyName::Nitrogen => Deficiency::Nitrogen,
                DeficiencyName::Magnesium => Deficiency::Magnesium,
            },
            severity: self.severity.unwrap_or(SEVERITY),
        });
        if chlorosis.is_some() {
            params.contents.brown = Chlorosis::BROWN;
        }
        // [Miao, Fig. 2f]: the text says that all pigments are 0; the caption prints C_r 5 and C_b 0.2 instead,
        // which is a brownish yellow leaf (--cab 0 --car 5 --cbrown 0.2).
        if self.albino {
            params.contents.chlorophyll_ug_per_cm2 = 0.0;
            params.contents.carotenoid_ug_per_cm2 = 0.0;
            params.contents.anthocyanin_ug_per_cm2 = 0.0;
            params.contents.brown = 0.0;
        }
        let images = self.textures.as_ref().map_or(Ok(TextureImages::default()), TextureImages::read)?;
        params.look = LeafLook { species, chlorosis, images };
        Ok(params)
    }

    /// Writes the textures of a leaf where that is asked for.
    pub(super) fn export(&self, params: &LeafParams) -> Result<Option<&Path>, Failure> {
        let Some(dir) = &self.export_textures else { return Ok(None) };
        AppearanceTextures::new(params)?.export(dir)?;
        Ok(Some(dir))
    }
}

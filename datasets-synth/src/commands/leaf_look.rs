//! Options for the look of a leaf: species, deficiency, and textures as images.

use std::path::{Path, PathBuf};

use btf_synth::{AppearanceTextures, Deficiency, LeafDescription, LeafParams, Species, TextureImages};
use clap::{Args, ValueEnum};

use super::failure::Failure;
use super::leaf_file;
use super::leaf_file::LeafFileArgs;

#[derive(Args)]
pub(super) struct LookArgs {
    /// Species: sets veins, relief, patch size, contents and gloss where no option does, over --leaf veins and relief
    /// alone [default: a plain leaf]
    #[arg(long, value_enum)]
    species: Option<SpeciesName>,
    /// What the leaf lacks: nitrogen yellows it (maize: from the tip along the midrib), magnesium between the veins
    #[arg(long, value_enum)]
    deficiency: Option<DeficiencyName>,
    /// How far the deficiency has gone (0 to 1) [default: 0.7]
    #[arg(long, value_name = "S")]
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
    #[command(flatten)]
    file: LeafFileArgs,
    /// Write the leaf that all options describe to FILE, as --leaf reads it, with the exported textures or your own
    #[arg(long, value_name = "FILE")]
    write_leaf: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
pub(super) enum SpeciesName {
    /// Parallel veins, a wide midrib
    Maize,
    /// Pinnate, a fine reticulum, dull
    Soybean,
    /// Pinnate, strong secondaries, tertiaries like ladders, glossy
    Tree,
    /// Parallel veins, a narrow midrib
    Grass,
    /// A shoot of a spruce: a twig with its needles, dark
    Spruce,
}

#[derive(Clone, Copy, ValueEnum)]
enum DeficiencyName {
    Nitrogen,
    Magnesium,
}

impl From<SpeciesName> for Species {
    fn from(name: SpeciesName) -> Species {
        match name {
            SpeciesName::Maize => Species::Maize,
            SpeciesName::Soybean => Species::Soybean,
            SpeciesName::Tree => Species::Tree,
            SpeciesName::Grass => Species::Grass,
            SpeciesName::Spruce => Species::Spruce,
        }
    }
}

impl From<DeficiencyName> for Deficiency {
    fn from(name: DeficiencyName) -> Deficiency {
        match name {
            DeficiencyName::Nitrogen => Deficiency::Nitrogen,
            DeficiencyName::Magnesium => Deficiency::Magnesium,
        }
    }
}

/// Leaf that the options of its look describe.
pub(super) struct Looked {
    /// Description of the leaf without its textures.
    pub leaf: LeafDescription,
    /// Folder of textures, relative to the current folder.
    pub textures: Option<PathBuf>,
    /// Whether the user gave the pigments, instead of a species.
    pub own_pigments: bool,
}

impl LookArgs {
    /// Returns the leaf of the file, of the species or the plain one, with the look that the options ask for.
    pub(super) fn leaf(&self) -> Result<Looked, Failure> {
        let (species, deficiency) = (self.species.map(Species::from), self.deficiency.map(Deficiency::from));
        let file = self.file.read()?;
        let own_pigments = file.is_some() || self.albino;
        let mut leaf = file.unwrap_or_else(|| LeafDescription::of(species, None));
        leaf.species = species.or(leaf.species);
        if deficiency.is_some() {
            leaf.deficiency = deficiency;
            leaf.contents.brown = Deficiency::BROWN;
        }
        if self.severity.is_some() && leaf.deficiency.is_none() {
            return Err(Failure::Usage("--severity says how far a deficiency has gone; give --deficiency, too".into()));
        }
        leaf.severity = self.severity.unwrap_or(leaf.severity);
        // [Miao, Fig. 2f]: the text says that all pigments are 0; the caption prints C_r 5 and C_b 0.2 instead,
        // which is a brownish yellow leaf (--cab 0 --car 5 --cbrown 0.2).
        if self.albino {
            leaf.contents = leaf.contents.without_pigments();
        }
        let textures = self.textures.clone().or_else(|| self.file.textures(&leaf));
        Ok(Looked { leaf, textures, own_pigments })
    }

    /// Writes the textures of a leaf, and its description, if the options ask for them.
    pub(super) fn export(&self, looked: &Looked, params: &LeafParams) -> Result<Option<&Path>, Failure> {
        let exported = self.export_textures.as_deref();
        if let Some(dir) = exported {
            AppearanceTextures::new(params)?.export(dir)?;
        }
        if let Some(file) = &self.write_leaf {
            leaf_file::write(&looked.leaf, exported.or(looked.textures.as_deref()), file)?;
        }
        Ok(exported)
    }
}

impl Looked {
    /// Returns the textures as images.
    pub(super) fn images(&self) -> Result<TextureImages, Failure> {
        let read = |dir| TextureImages::read(dir).map_err(|error| Failure::Failed(error.to_string()));
        self.textures.as_ref().map_or(Ok(TextureImages::default()), read)
    }
}

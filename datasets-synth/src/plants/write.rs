//! Writes the files of a canopy: the `.glb` or script, the description of its leaves and their textures.

use std::fs;
use std::path::{Path, PathBuf};

use btf_capture::{CaptureError, Direction, DirectionSet, write_file_atomically};
use btf_models::shapes::SCRIPT_ENDING;
use btf_models::{
    LeafDescription, ModelError, PlantVariation, Species, TEXTURES_NAME, TextureImages, TextureKind, glb,
};

use crate::error::SynthError;
use crate::leaf::look::{BladePlace, LeafLook};
use crate::leaf::params::LeafParams;
use crate::leaf::textures::AppearanceTextures;
use crate::plants::canopy::Canopy;
use crate::plants::gltf::canopy_glb;
use crate::plants::grass;
use crate::plants::maize::BLADE_WIDTH_M;
use crate::plants::params::{Form, PlantsParams};
use crate::plants::script::canopy_script;
use crate::plants::soybean::LEAFLET_LENGTH_M;
use crate::plants::spruce::SHOOT_LENGTH_M;
use crate::plants::tree::LEAF_LENGTH_M;
use crate::surface::capture::Progress;
use crate::surface::capture_params::CaptureParams;

/// Number of texels along a side of the textures of a leaf, beside the few of their margin; grids have two nodes per
/// texel.
const TEXTURE_TEXELS: usize = 256;

/// Treatment of files that exist already.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Existing {
    /// Keep them and write nothing.
    Refuse,
    /// Replace them: a `.glb` or script, a description, a folder that holds nothing but textures.
    Replace,
}

/// Files of a canopy and their contents. Triangles are those of the meshes, whatever is written.
#[derive(Debug, Clone, PartialEq)]
pub struct PlantsReport {
    /// Path of the description of the leaves, beside the file.
    pub leaf: PathBuf,
    /// Path of the folder of their textures.
    pub textures: PathBuf,
    /// Number of plants.
    pub plants: usize,
    /// Number of different plants.
    pub variants: usize,
    /// Number of triangles in the file.
    pub triangles_unique: u64,
    /// Number of triangles that are drawn.
    pub triangles_instanced: u64,
    /// Number of shapes in the file; none in a mesh.
    pub shapes: usize,
    /// Number of blades of all plants.
    pub leaves: u64,
    /// Number of flowers of all plants.
    pub flowers: u64,
    /// Area of one face of all blades in square metres, over their outlines.
    pub leaf_area_m2: f64,
    /// Leaf area over the outlines, by the area of the ground.
    pub leaf_area_index: f64,
    /// Area of one face of all blades in square metres, of the triangles that are drawn: chords are shorter than outlines.
    pub drawn_leaf_area_m2: f64,
    /// Leaf area of the drawn triangles, by the area of the ground.
    pub drawn_leaf_area_index: f64,
    /// Size of the `.glb` or script in bytes.
    pub bytes: usize,
}

/// Default variation of the plants of a canopy, where the description of the leaf gives none.
pub const CANOPY_VARIATION: PlantVariation =
    PlantVariation { chlorophyll: 0.12, carotenoid: 0.12, brown: 0.3, thickness: 0.06, seed: 1 };

/// Generates a canopy and writes `out` (its name ends in .glb, or for [`Form::Shapes`] in .shapes.toml), beside it
/// `NAME-leaf.toml` and the folder `NAME-textures`. `leaf` gives contents and deficiency of the leaves; species and
/// patch size are those of the plants. Equal parameters give equal bytes on any number of threads.
///
/// # Errors
/// [`SynthError::BadParameter`]; [`SynthError::Capture`] for files that exist or cannot be written;
/// [`SynthError::Stopped`]. Every file is whole or not there.
pub fn write_plants(
    out: impl AsRef<Path>,
    params: &PlantsParams,
    leaf: &LeafDescription,
    images: TextureImages,
    existing: Existing,
    progress: Progress,
) -> Result<PlantsReport, SynthError> {
    params.check()?;
    let files = Files::beside(out.as_ref(), params.form)?;
    files.check(existing)?;
    let go_on = |done: usize| if progress(done, 3).is_break() { Err(SynthError::Stopped) } else { Ok(()) };
    let canopy = Canopy::new(params)?;
    go_on(1)?;
    let leaf = LeafDescription {
        species: Some(params.species),
        size_mm: texture_size_mm(params.species),
        textures: Some(files.textures_name.clone().into()),
        ..leaf.clone()
    };
    let (bytes, shapes) = match params.form {
        Form::Mesh => (canopy_glb(&canopy, &leaf, &glb::escaped(&files.leaf_name))?, 0),
        Form::Shapes => {
            let script = canopy_script(&canopy, params.detail, &files.leaf_name)?;
            let shapes = script.strokes.iter().map(|stroke| stroke.shapes.len()).sum();
            (script.to_text(&files.out)?.into_bytes(), shapes)
        }
    };
    let textures = AppearanceTextures::new(&texture_params(&leaf, images)?)?;
    go_on(2)?;
    if existing == Existing::Replace && files.textures.exists() {
        fs::remove_dir_all(&files.textures)
            .map_err(|source| CaptureError::Write { path: files.textures.clone(), source })?;
    }
    textures.export(&files.textures)?;
    leaf.write(&files.leaf)?;
    write_file_atomically(&files.out, &bytes)?;
    let (leaf_area_m2, drawn_leaf_area_m2) = (canopy.leaf_area_m2(), canopy.drawn_leaf_area_m2());
    let ground_m2 = canopy.area_per_plant_m2 * canopy.instances.len() as f64;
    Ok(PlantsReport {
        plants: canopy.instances.len(),
        variants: canopy.variants.len(),
        triangles_unique: canopy.unique_triangles(),
        triangles_instanced: canopy.instanced_triangles(),
        shapes,
        leaves: canopy.leaves(),
        flowers: canopy.flowers(),
        leaf_area_m2,
        leaf_area_index: leaf_area_m2 / ground_m2,
        drawn_leaf_area_m2,
        drawn_leaf_area_index: drawn_leaf_area_m2 / ground_m2,
        bytes: bytes.len(),
        leaf: files.leaf,
        textures: files.textures,
    })
}

/// Returns the width and height of the textures of a species in millimetres: a blade from margin to margin, or a
/// leaflet from base to tip.
fn texture_size_mm(species: Species) -> f64 {
    let metres = match species {
        Species::Maize => BLADE_WIDTH_M,
        Species::Soybean => LEAFLET_LENGTH_M,
        Species::Tree => LEAF_LENGTH_M,
        Species::Grass => grass::BLADE_WIDTH_M,
        Species::Spruce => SHOOT_LENGTH_M,
    };
    (1000.0 * metres).round()
}

/// Returns the parameters that the textures are generated for: seen from straight above, so that they have next to no
/// margin.
fn texture_params(leaf: &LeafDescription, images: TextureImages) -> Result<LeafParams, SynthError> {
    let described = LeafParams::described(leaf, images);
    let above = DirectionSet::new(vec![Direction::new(0.0, 0.0)])?;
    let capture = CaptureParams { size: TEXTURE_TEXELS / 2, views: above.clone(), lights: above, ..described.capture };
    let look = LeafLook { place: BladePlace::Whole, ..described.look };
    Ok(LeafParams { capture, look, ..described })
}

/// Paths of the files that are written.
struct Files {
    out: PathBuf,
    leaf: PathBuf,
    leaf_name: String,
    textures: PathBuf,
    textures_name: String,
}

impl Files {
    fn beside(out: &Path, form: Form) -> Result<Files, SynthError> {
        let (ending, remedy) = match form {
            Form::Mesh => (".glb", "give a file name that ends in .glb, or --form shapes"),
            Form::Shapes => (SCRIPT_ENDING, "give a file name that ends in .shapes.toml, or --form mesh"),
        };
        let bad = |fault: String| ModelError::Leaf { path: out.into(), fault, remedy };
        let name =
            out.file_name().and_then(|name| name.to_str()).ok_or_else(|| bad("has no name in Unicode".into()))?;
        let stem = name.strip_suffix(ending).filter(|stem| !stem.is_empty());
        let stem = stem.ok_or_else(|| bad(format!("does not end in {ending}")))?;
        let (leaf_name, textures_name) = (format!("{stem}-leaf.toml"), format!("{stem}-textures"));
        let (leaf, textures) = (out.with_file_name(&leaf_name), out.with_file_name(&textures_name));
        Ok(Files { out: out.into(), leaf, leaf_name, textures, textures_name })
    }

    /// Refuses files that must not be replaced.
    fn check(&self, existing: Existing) -> Result<(), SynthError> {
        let bad =
            |path: &Path, fault: &str, remedy| ModelError::Leaf { path: path.into(), fault: fault.into(), remedy };
        if existing == Existing::Refuse {
            let there = [&self.out, &self.leaf, &self.textures].into_iter().find(|path| path.exists());
            let remedy = "give another name, or --force to replace it";
            return there.map_or(Ok(()), |path| Err(bad(path, "exists already", remedy).into()));
        }
        let Ok(listing) = fs::read_dir(&self.textures) else { return Ok(()) };
        let ours = |name: &str| {
            name == TEXTURES_NAME || TextureKind::ALL.iter().any(|kind| name.strip_suffix(".png") == Some(kind.name()))
        };
        for entry in listing.flatten() {
            if !entry.file_name().to_str().is_some_and(ours) {
                return Err(bad(&entry.path(), "is no texture", "move it out of that folder, which is replaced").into());
            }
        }
        Ok(())
    }
}

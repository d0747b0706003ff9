//! A leaf that is evaluated live: its description, its appearance textures, and the words that decoders read.

use crate::error::ViewerError;
use btf_capture::files;
use btf_models::{LeafDescription, LeafTable, TextureImages, TextureKind};
use btf_runtime::{LEAF_BAND_NM, Leaf, LeafMode, LeafScattering, LeafState, LeafTexel, LeafTexture};
use rayon::prelude::*;
use std::path::{Path, PathBuf, absolute};

/// Texels on a side of the appearance textures as the decoder has them, at most.
const MAX_TEXELS: usize = 512;

/// A leaf of a scene.
#[derive(Debug, Clone)]
pub struct SceneLeaf {
    /// File stem of its description, or what it is called.
    pub name: String,
    /// File of the leaf's description, if it was read from one.
    pub path: Option<PathBuf>,
    /// Contents and looks of the leaf.
    pub description: LeafDescription,
    /// The leaf as decoders evaluate it.
    pub leaf: Leaf,
}

impl SceneLeaf {
    /// Reads a leaf's description and the textures that it names.
    ///
    /// # Errors
    /// The errors of [`LeafDescription::read`] and [`TextureImages::read`].
    pub fn load(path: &Path) -> Result<SceneLeaf, ViewerError> {
        let description = LeafDescription::read(path)?;
        let images = match description.textures_beside(path) {
            Some(folder) => TextureImages::read(folder)?,
            None => TextureImages::default(),
        };
        let name = path.file_stem().map_or_else(|| "leaf".into(), |stem| stem.to_string_lossy().into_owned());
        let texture = texture_of(&images, description.size_mm as f32);
        Ok(SceneLeaf { path: Some(path.into()), ..SceneLeaf::new(name, description, &texture)? })
    }

    /// Adds the table of an algorithmic model, and draws the leaf by it.
    ///
    /// # Errors
    /// Those of [`LeafTable::read`]; [`ViewerError::Usage`] for a table without the bands of live leaves.
    pub fn add_table(&mut self, path: &Path) -> Result<(), ViewerError> {
        let scattering = scattering_of(&LeafTable::read(path)?).ok_or_else(|| {
            let name = path.display();
            ViewerError::Usage(format!(
                "{name} lacks wavelengths that live leaves are drawn at; make it again with `btf-synth scatter`"
            ))
        })?;
        let named = |source| ViewerError::Leaf { name: self.name.clone(), source };
        self.leaf.add_scattering(&scattering).map_err(named)?;
        self.describe(self.description.clone(), LeafMode::Tissue).map(|_| ())
    }

    /// Makes a leaf with textures that are in memory.
    ///
    /// # Errors
    /// [`ViewerError::Leaf`] for textures that fill no rectangle or numbers that are not finite.
    pub fn new(
        name: impl Into<String>,
        description: LeafDescription,
        texture: &LeafTexture,
    ) -> Result<SceneLeaf, ViewerError> {
        let name = name.into();
        let state = LeafState::from_values(LeafMode::default(), description.tissue_and_gloss());
        let leaf = Leaf::new(&state, texture).map_err(|source| ViewerError::Leaf { name: name.clone(), source })?;
        Ok(SceneLeaf { name, path: None, description, leaf })
    }

    /// Takes over what the description says of contents and gloss; returns the words that changed.
    ///
    /// # Errors
    /// [`ViewerError::Leaf`] for numbers that are not finite.
    pub fn describe(
        &mut self,
        description: LeafDescription,
        mode: LeafMode,
    ) -> Result<std::ops::Range<usize>, ViewerError> {
        let state = LeafState::from_values(mode, description.tissue_and_gloss());
        let changed =
            self.leaf.set_state(&state).map_err(|source| ViewerError::Leaf { name: self.name.clone(), source })?;
        self.description = description;
        Ok(changed)
    }

    /// Writes the description so that it can be read again from `path`: its folder of textures is named as seen from
    /// there.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] for a file that is there and no leaf's description; those of [`LeafDescription::write`].
    pub fn save(&self, path: &Path) -> Result<(), ViewerError> {
        if files::exists(path) && LeafDescription::read(path).is_err() {
            let name = path.display();
            return Err(ViewerError::Usage(format!(
                "{name} is there and no description of a leaf; choose another name"
            )));
        }
        let textures = match &self.path {
            Some(own) => self.description.textures_beside(own).map(|folder| folder_from(path, &folder)),
            None => self.description.textures.clone(),
        };
        Ok(LeafDescription { textures, ..self.description.clone() }.write(path)?)
    }
}

/// Returns what decoders take of a table: its depths at the wavelengths of their bands; `None` where it lacks one.
pub fn scattering_of(table: &LeafTable) -> Option<LeafScattering> {
    let mut depths = [[0.0; 3]; LEAF_BAND_NM.len()];
    for (depths, nm) in depths.iter_mut().zip(LEAF_BAND_NM) {
        let [_, chlorophyll, carotenoid, rest] = table.rows.iter().find(|row| row[0] == nm)?;
        *depths = [*chlorophyll, *carotenoid, *rest];
    }
    Some(LeafScattering { depths, ways: table.ways, cells: table.cells.clone() })
}

/// Returns a folder as the file `path` names it: relative where it lies beside or below it, else absolute.
fn folder_from(path: &Path, folder: &Path) -> PathBuf {
    let (Ok(path), Ok(folder)) = (absolute(path), absolute(folder)) else { return folder.into() };
    match path.parent().and_then(|parent| folder.strip_prefix(parent).ok()) {
        Some(below) => below.into(),
        None => folder,
    }
}

/// Samples the textures of a patch of `size_mm` on the decoder's grid; what there is no image of is as in a leaf
/// without textures.
fn texture_of(images: &TextureImages, size_mm: f32) -> LeafTexture {
    let [_, _, area_mm, _] = images.area_mm(size_mm);
    let Some(finest) = images.finest_width() else { return LeafTexture::uniform(LeafTexel::default()) };
    let side = ((finest as f64 * f64::from(size_mm) / area_mm).round() as usize).clamp(1, MAX_TEXELS);
    let texel_mm = size_mm / side as f32;
    let texel = |number: usize| {
        let (x, y) = ((number % side) as f32 + 0.5, (side - 1 - number / side) as f32 + 0.5);
        let at = |kind, dx: f32, dy: f32| images.sample(kind, [(x + dx) * texel_mm, (y + dy) * texel_mm], size_mm);
        let here = |kind| at(kind, 0.0, 0.0);
        let plain = LeafTexel::default();
        // x and y of the normal of a face from its heights.
        let tilt = |kind| {
            let slope = |dx: f32, dy: f32| Some((at(kind, dx, dy)?[0] - at(kind, -dx, -dy)?[0]) / texel_mm);
            let [x, y] = [slope(0.5, 0.0), slope(0.0, 0.5)].map(|slope| slope.unwrap_or(0.0));
            let length = (1.0 + x * x + y * y).sqrt();
            [-x / length, -y / length]
        };
        let ([front_x, front_y], [back_x, back_y]) = (tilt(TextureKind::Height), tilt(TextureKind::HeightAbaxial));
        let front_gloss = here(TextureKind::Gloss).map_or(plain.gloss[0], |gloss| gloss[0]);
        let [chlorophyll, carotenoid, brown] = here(TextureKind::Pigment).unwrap_or([1.0; 3]);
        LeafTexel {
            factors: [
                chlorophyll,
                carotenoid,
                brown,
                here(TextureKind::Thickness).map_or(plain.factors[3], |thickness| thickness[0]),
            ],
            gloss: [front_gloss, here(TextureKind::GlossAbaxial).map_or(front_gloss, |gloss| gloss[0])],
            veins: here(TextureKind::Direction).map_or(plain.veins, |[cos, sin, _]| [cos, sin]),
            structure: here(TextureKind::Structure).unwrap_or(plain.structure),
            tilt: [front_x, front_y, back_x, back_y],
        }
    };
    LeafTexture { width: side, texels: (0..side * side).into_par_iter().map(texel).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_models::TABLE_GRID;
    use btf_runtime::ViewedLeaf;

    #[test]
    fn a_saved_leaf_finds_its_textures_from_wherever_it_lies() {
        let dir = tempfile::tempdir().unwrap();
        let place = |name: &str| dir.path().join(name);
        std::fs::create_dir_all(place("leaves/veins")).unwrap();
        std::fs::create_dir(place("elsewhere")).unwrap();
        let description = LeafDescription { textures: Some("veins".into()), ..LeafDescription::default() };
        let texture = LeafTexture::uniform(LeafTexel::default());
        let leaf = SceneLeaf::new("maize", description, &texture).unwrap();
        let mut leaf = SceneLeaf { path: Some(place("leaves/maize.toml")), ..leaf };
        let mut pale = leaf.description.clone();
        pale.contents.chlorophyll_ug_per_cm2 = 7.25;
        leaf.describe(pale.clone(), LeafMode::NLayers).unwrap();
        for (name, textures) in [
            ("leaves/pale.toml", PathBuf::from("veins")),
            ("pale.toml", Path::new("leaves").join("veins")),
            ("elsewhere/pale.toml", absolute(place("leaves/veins")).unwrap()),
            ("leaves/maize.toml", PathBuf::from("veins")),
        ] {
            leaf.save(&place(name)).unwrap();
            let read = LeafDescription::read(place(name)).unwrap();
            assert_eq!(read, LeafDescription { textures: Some(textures), ..pale.clone() }, "{name}");
            let found = read.textures_beside(place(name)).unwrap().canonicalize().unwrap();
            assert_eq!(found, place("leaves/veins").canonicalize().unwrap(), "{name}");
        }
    }

    #[test]
    fn a_leaf_is_saved_over_a_leaf_and_over_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let leaf =
            SceneLeaf::new("leaf", LeafDescription::default(), &LeafTexture::uniform(LeafTexel::default())).unwrap();
        let path = dir.path().join("notes.toml");
        std::fs::write(&path, "mine = 1").unwrap();
        let message = leaf.save(&path).unwrap_err().to_string();
        assert!(message.contains("notes.toml is there and no description of a leaf"), "{message}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "mine = 1");
        let other = dir.path().join("leaf.toml");
        leaf.save(&other).unwrap();
        leaf.save(&other).unwrap();
        assert_eq!(LeafDescription::read(&other).unwrap(), leaf.description);
    }

    #[test]
    fn a_table_draws_the_leaf_and_one_without_its_bands_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("grey.leaftable");
        let cells = 4 * TABLE_GRID.iter().product::<usize>();
        let mut table = LeafTable {
            model: "grey".into(),
            own_pigments: [0.0; 2],
            rows: LEAF_BAND_NM.map(|nm| [nm, 0.0, 0.0, 0.0]).to_vec(),
            ways: [[0.0, 1.0, 2.0, 3.0]; 4],
            // One half as a half float.
            cells: vec![[0, 0x3800, 0, 0]; cells],
        };
        table.write(&file).unwrap();
        let plain = LeafTexture::uniform(LeafTexel::default());
        let mut leaf = SceneLeaf::new("leaf", LeafDescription::default(), &plain).unwrap();
        leaf.add_table(&file).unwrap();
        assert_eq!(leaf.leaf.state().mode, LeafMode::Tissue);
        let up = [0.0, 0.0, 1.0];
        let seen = ViewedLeaf::new(leaf.leaf.words(), [0.5; 2], 0, [1.0; 4], up).light(up);
        assert!(seen.iter().all(|value| (value - 0.5).abs() < 1e-3), "{seen:?}");
        table.rows.pop();
        table.write(&file).unwrap();
        let said = leaf.add_table(&file).unwrap_err().to_string();
        assert!(said.contains("grey.leaftable lacks wavelengths"), "{said}");
    }
}

//! What the user works on: the scene, the edits of its assets and leaves, and which of them are not saved.

use super::editor::Editor;
use super::physiology::Physiology;
use crate::error::ViewerError;
use crate::scene::material::Body;
use crate::scene::scene::Scene;
use crate::window::files::{Replaced, open_file};
use std::path::{Path, PathBuf};

/// The scene that is open, with its editors.
pub(crate) struct Document {
    pub scene: Scene,
    /// Edits the assets.
    pub editor: Editor,
    /// Edits the leaves.
    pub physiology: Physiology,
    /// Whether a leaf was changed later than assets were.
    pub leaf_at_hand: bool,
}

/// An asset or a leaf that is not as its file has it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Unsaved {
    pub of: Edited,
    /// Name of the asset or the leaf.
    pub name: String,
    /// File to save it in.
    pub file: String,
}

/// Assets and leaves that can be edited and saved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Edited {
    /// Number of an asset of the scene, whose edits are saved with it.
    Asset(usize),
    /// Number of a leaf of the scene, whose description is saved.
    Leaf(usize),
}

impl Document {
    /// Opens a scene; the brush has a radius of `brush_radius` texels.
    pub(crate) fn new(scene: Scene, brush_radius: f32) -> Document {
        let (editor, physiology) = (Editor::new(&scene, brush_radius), Physiology::new(&scene));
        Document { leaf_at_hand: !scene.leaves.is_empty(), scene, editor, physiology }
    }

    /// Returns what was changed last, which split views show something else in place of.
    pub(crate) fn at_hand(&self) -> Body {
        match self.leaf_at_hand {
            true => Body::Leaf(self.physiology.leaf),
            false => Body::Asset(self.editor.asset),
        }
    }

    /// Takes a file into the scene; an asset takes the place of number `asset`. What it replaces is lost, saved or not.
    ///
    /// # Errors
    /// The errors of [`open_file`]. The scene is then as it was.
    pub(crate) fn open(&mut self, path: &Path, asset: usize) -> Result<(), ViewerError> {
        let replaced = Replaced::by(path, asset);
        open_file(&mut self.scene, asset, path)?;
        self.editor = self.editor.reopened(&self.scene, replaced);
        self.physiology = self.physiology.reopened(&self.scene, replaced);
        self.leaf_at_hand = !self.scene.leaves.is_empty();
        Ok(())
    }

    /// Tells whether anything is unsaved. Cost: a comparison of all edits.
    pub(crate) fn has_unsaved(&self) -> bool {
        self.edited().next().is_some()
    }

    /// Lists what is unsaved, each with the file that its panel names or else one beside its own, no file twice.
    pub(crate) fn unsaved(&self) -> Vec<Unsaved> {
        let mut all: Vec<Unsaved> = Vec::new();
        for of in self.edited() {
            let (name, file) = match of {
                Edited::Asset(asset) => (&self.scene.assets[asset].name, self.editor.file_of(&self.scene, asset)),
                Edited::Leaf(leaf) => (&self.scene.leaves[leaf].name, self.physiology.file_of(&self.scene, leaf)),
            };
            let is_free = |file: &String| all.iter().all(|other| other.file != *file);
            let file = (1..).map(|number| numbered(&file, number)).find(is_free).unwrap_or(file);
            all.push(Unsaved { of, name: name.clone(), file });
        }
        all
    }

    /// Lists what is unsaved and would be lost if the file were opened in place of asset number `asset`.
    pub(crate) fn lost_by_opening(&self, path: &Path, asset: usize) -> Vec<Unsaved> {
        let replaced = Replaced::by(path, asset);
        let is_lost = |unsaved: &Unsaved| match unsaved.of {
            Edited::Asset(asset) => !replaced.keeps_asset(asset),
            Edited::Leaf(_) => !replaced.keeps_leaves(),
        };
        self.unsaved().into_iter().filter(is_lost).collect()
    }

    /// Saves assets and leaves in their files; returns the names of the files.
    ///
    /// # Errors
    /// The first file's that cannot be written; those before it are saved.
    pub(crate) fn save(&mut self, unsaved: &[Unsaved]) -> Result<String, ViewerError> {
        for Unsaved { of, file, .. } in unsaved {
            match of {
                Edited::Asset(asset) => self.editor.save_as(&self.scene, *asset, Path::new(file))?,
                Edited::Leaf(leaf) => self.physiology.save_as(&self.scene, *leaf, Path::new(file))?,
            }
        }
        Ok(unsaved.iter().map(|unsaved| unsaved.file.as_str()).collect::<Vec<_>>().join(", "))
    }

    fn edited(&self) -> impl Iterator<Item = Edited> {
        let assets = (0..self.scene.assets.len()).filter(|asset| !self.editor.is_saved(&self.scene, *asset));
        let leaves = (0..self.scene.leaves.len()).filter(|leaf| !self.physiology.is_saved(&self.scene, *leaf));
        assets.map(Edited::Asset).chain(leaves.map(Edited::Leaf))
    }
}

/// Returns `a/b.spmm` as `a/b_2.spmm`; number 1 is the file itself.
fn numbered(file: &str, number: u32) -> String {
    let path = PathBuf::from(file);
    let (Some(stem), Some(extension), 2..) = (path.file_stem(), path.extension(), number) else { return file.into() };
    let name = format!("{}_{number}.{}", stem.to_string_lossy(), extension.to_string_lossy());
    path.with_file_name(name).display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::asset::SceneAsset;
    use crate::scene::leaf::SceneLeaf;
    use crate::scene::material::Shown;
    use crate::scene::scene::MeshChoice;
    use crate::window::editing::physiology::LeafSettings;
    use btf_models::{LEAF_QUANTITIES, LeafDescription};
    use btf_runtime::{LeafMode, LeafTexel, LeafTexture};
    use std::sync::Arc;

    /// Two assets and a leaf, all of one name for each kind, whose files would be in `folder`.
    fn document(folder: &Path) -> Document {
        let mut asset = SceneAsset::built_in();
        asset.path = Some(folder.join("weave.spmm"));
        let asset = Arc::new(asset);
        let texture = LeafTexture::uniform(LeafTexel::default());
        let leaf = SceneLeaf::new("leaf", LeafDescription::default(), &texture).unwrap();
        let leaf = SceneLeaf { path: Some(folder.join("leaf.toml")), ..leaf };
        let shown = Shown { assets: vec![asset.clone(), asset], leaves: vec![leaf] };
        Document::new(Scene::built_in(&MeshChoice::Plane, shown, [1.0; 2]).unwrap(), 8.0)
    }

    fn edit_asset(document: &mut Document, asset: usize) {
        document.editor.show(&document.scene, asset);
        document.editor.add(&mut document.scene);
        document.editor.close(&document.scene);
    }

    fn edit_leaf(document: &mut Document) {
        let mut settings = document.physiology.settings(&document.scene).unwrap();
        settings.put(&LEAF_QUANTITIES[0], 12.0);
        document.physiology.set(&mut document.scene, settings).unwrap();
    }

    fn files(unsaved: &[Unsaved]) -> Vec<String> {
        let name = |file: &String| Path::new(file).file_name().unwrap().to_string_lossy().into_owned();
        unsaved.iter().map(|unsaved| name(&unsaved.file)).collect()
    }

    #[test]
    fn edits_are_unsaved_until_they_are_saved_or_taken_back() {
        let dir = tempfile::tempdir().unwrap();
        let mut document = document(dir.path());
        assert!(!document.has_unsaved() && document.unsaved().is_empty());
        edit_asset(&mut document, 0);
        edit_asset(&mut document, 1);
        edit_leaf(&mut document);
        let unsaved = document.unsaved();
        assert_eq!(files(&unsaved), ["weave_edited.spmm", "weave_edited_2.spmm", "leaf_edited.toml"]);
        document.editor.undo(&mut document.scene).unwrap();
        document.physiology.undo(&mut document.scene).unwrap();
        assert_eq!(files(&document.unsaved()), ["weave_edited.spmm"]);
        // How a leaf is evaluated is no part of its file.
        let settings = document.physiology.settings(&document.scene).unwrap();
        let settings = LeafSettings { mode: LeafMode::ThreePiece, ..settings };
        assert!(document.physiology.set(&mut document.scene, settings).is_some());
        assert_eq!(document.unsaved().len(), 1);
        edit_leaf(&mut document);
        let told = document.save(&document.unsaved()).unwrap();
        assert!(told.contains("weave_edited.spmm, ") && told.ends_with("leaf_edited.toml") && !document.has_unsaved());
        let saved = SceneAsset::load(&dir.path().join("weave_edited.spmm")).unwrap();
        let asset = |asset: &SceneAsset| asset.file_form().unwrap().asset.clone();
        assert_eq!(asset(&saved), asset(&document.scene.assets[0]));
        // Back before what was saved, too.
        document.editor.undo(&mut document.scene).unwrap();
        assert!(document.has_unsaved());
        document.editor.redo(&mut document.scene).unwrap();
        assert!(!document.has_unsaved());
    }

    #[test]
    fn opening_a_file_loses_what_it_replaces_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let mut document = document(dir.path());
        edit_asset(&mut document, 0);
        edit_asset(&mut document, 1);
        edit_leaf(&mut document);
        let lost = |document: &Document, name: &str| files(&document.lost_by_opening(Path::new(name), 1));
        assert_eq!(lost(&document, "x.SPMM"), ["weave_edited_2.spmm"]);
        assert_eq!(lost(&document, "x.toml").len(), 3);
        assert!(lost(&document, "x.hdr").is_empty() && lost(&document, "x.glb").is_empty());
        // A mesh leaves assets and leaves as they are: unsaved.
        let mesh = dir.path().join("m.obj");
        std::fs::write(&mesh, "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n").unwrap();
        document.open(&mesh, 0).unwrap();
        assert_eq!(document.unsaved().len(), 3);
        let other = dir.path().join("other.spmm");
        std::fs::write(&other, include_bytes!("../../scene/builtin/weave.spmm")).unwrap();
        document.open(&other, 1).unwrap();
        assert_eq!(files(&document.unsaved()), ["weave_edited.spmm", "leaf_edited.toml"]);
        // What cannot be opened changes nothing.
        assert!(document.open(&dir.path().join("none.toml"), 0).is_err());
        assert_eq!(document.unsaved().len(), 2);
    }
}

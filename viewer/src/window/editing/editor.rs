//! Editing an asset while it is drawn: which edit is at hand, where it is put, and the way back.

use super::history::History;
use crate::error::ViewerError;
use crate::scene::asset::SceneAsset;
use crate::scene::scene::Scene;
use crate::window::files::Replaced;
use btf_runtime::{Asset, Edit, Edits, MAX_EDITS, pack};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Effect of a click or drag on the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Tool {
    /// Nowhere: drags turn the camera.
    #[default]
    Look,
    /// On the texels around the mouse.
    Brush,
    /// On all texels of the cluster under the mouse.
    Cluster,
    /// Takes the edit from the texels around the mouse.
    Eraser,
}

/// The edits of a scene's assets in the making.
#[derive(Debug, Default)]
pub(crate) struct Editor {
    /// Number of the asset whose edits are shown.
    pub asset: usize,
    /// Number of the edit at hand in its list, from 0.
    pub selected: usize,
    pub tool: Tool,
    /// Radius of the brush, texels.
    pub radius: f32,
    pub file: String,
    /// Message of the latest saving, or the error.
    pub message: Option<String>,
    history: History<Edits>,
    /// Edits of each asset as they were opened or saved last; `None` where the asset cannot be edited.
    saved: Vec<Option<Edits>>,
}

/// Target of an edit without a brush.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Extent {
    /// On all texels.
    Everywhere,
    /// On no texel.
    Nowhere,
}

impl Editor {
    /// Makes an editor of a scene, with a brush of `radius` texels. Edits that assets have are taken as saved.
    pub(crate) fn new(scene: &Scene, radius: f32) -> Editor {
        let saved = (0..scene.assets.len()).map(|asset| edits_of(scene, asset).cloned()).collect();
        let mut editor = Editor { radius, saved, ..Editor::default() };
        editor.show(scene, 0);
        editor
    }

    /// Makes an editor of the scene after a file was opened. What is unsaved of assets that were not replaced stays so.
    pub(crate) fn reopened(&self, scene: &Scene, replaced: Replaced) -> Editor {
        let mut editor = Editor::new(scene, self.radius);
        for (asset, saved) in editor.saved.iter_mut().enumerate().filter(|(asset, _)| replaced.keeps_asset(*asset)) {
            saved.clone_from(self.saved.get(asset).unwrap_or(&None));
        }
        editor
    }

    /// Tells whether an asset is as it was opened or saved last.
    pub(crate) fn is_saved(&self, scene: &Scene, asset: usize) -> bool {
        edits_of(scene, asset) == self.saved.get(asset).and_then(Option::as_ref)
    }

    /// Returns the file that an asset is saved in: the one that the panel names for the asset that it shows, else one
    /// beside its own.
    pub(crate) fn file_of(&self, scene: &Scene, asset: usize) -> String {
        match asset == self.asset {
            true => self.file.clone(),
            false => edited_path(&scene.assets[asset]).display().to_string(),
        }
    }

    /// Turns to an asset.
    pub(crate) fn show(&mut self, scene: &Scene, asset: usize) {
        self.asset = asset;
        self.selected = 0;
        self.message = None;
        self.file = scene.assets.get(asset).map_or_else(String::new, |asset| edited_path(asset).display().to_string());
    }

    fn edits<'a>(&self, scene: &'a Scene) -> Option<&'a Edits> {
        edits_of(scene, self.asset)
    }

    /// Returns the edit at hand.
    pub(crate) fn edit(&self, scene: &Scene) -> Option<Edit> {
        self.edits(scene)?.list.get(self.selected).copied()
    }

    /// Returns the number of edits of the asset.
    pub(crate) fn count(&self, scene: &Scene) -> usize {
        self.edits(scene).map_or(0, |edits| edits.list.len())
    }

    /// Changes the asset's edits; the change belongs to the step that [`Editor::close`] ends.
    fn change(&mut self, scene: &mut Scene, change: impl FnOnce(&mut Edits, &Asset)) {
        let Some(asset) = scene.assets.get_mut(self.asset) else { return };
        let file = match asset.file_form() {
            Ok(file) => &file.asset,
            Err(error) => {
                self.message = Some(error.to_string());
                return;
            }
        };
        let before = file.edits.clone();
        let mut after = before.clone();
        if after.texels.is_empty() {
            after.texels = vec![0; file.texel_count()];
        }
        change(&mut after, file);
        if after.list.is_empty() {
            after.texels.clear();
        }
        if after != before {
            self.history.begin(self.asset, before);
            Arc::make_mut(asset).set_edits(after);
        }
    }

    /// Ends a step: a stroke of the brush, a drag of a slider, a click.
    pub(crate) fn close(&mut self, scene: &Scene) {
        self.history.close(|asset| edits_of(scene, asset).cloned());
    }

    pub(crate) fn can_undo(&self) -> bool {
        self.history.can_undo()
    }

    pub(crate) fn can_redo(&self) -> bool {
        self.history.can_redo()
    }

    /// Takes the last step back; returns the asset that it changed.
    pub(crate) fn undo(&mut self, scene: &mut Scene) -> Option<usize> {
        self.close(scene);
        let (asset, edits) = self.history.undo()?;
        self.go_to(scene, asset, edits)
    }

    /// Does a step again that was taken back; returns the asset that it changed.
    pub(crate) fn redo(&mut self, scene: &mut Scene) -> Option<usize> {
        self.close(scene);
        let (asset, edits) = self.history.redo()?;
        self.go_to(scene, asset, edits)
    }

    fn go_to(&mut self, scene: &mut Scene, asset: usize, edits: Edits) -> Option<usize> {
        Arc::make_mut(scene.assets.get_mut(asset)?).set_edits(edits);
        if self.asset != asset {
            self.show(scene, asset);
        }
        self.selected = self.selected.min(self.count(scene).saturating_sub(1));
        Some(asset)
    }

    /// Adds an edit that changes nothing yet and lies nowhere; on the whole asset if it is the first.
    pub(crate) fn add(&mut self, scene: &mut Scene) {
        self.change(scene, |edits, _| {
            if edits.list.len() < MAX_EDITS {
                edits.list.push(Edit::default());
                if edits.list.len() == 1 {
                    edits.texels.fill(1);
                }
            }
        });
        self.selected = self.count(scene).saturating_sub(1);
    }

    /// Removes the edit at hand.
    pub(crate) fn remove(&mut self, scene: &mut Scene) {
        let number = self.selected as u8 + 1;
        self.change(scene, |edits, _| {
            if usize::from(number) <= edits.list.len() {
                edits.list.remove(usize::from(number) - 1);
            }
            for texel in &mut edits.texels {
                *texel = if *texel == number { 0 } else { *texel - u8::from(*texel > number) };
            }
        });
        self.selected = self.selected.min(self.count(scene).saturating_sub(1));
    }

    /// Puts `edit` in place of the one at hand.
    pub(crate) fn set(&mut self, scene: &mut Scene, edit: Edit) {
        let selected = self.selected;
        self.change(scene, |edits, _| {
            if let Some(own) = edits.list.get_mut(selected).filter(|_| edit.in_range()) {
                *own = edit;
            }
        });
    }

    /// Puts the edit at hand on all texels, or on none.
    pub(crate) fn fill(&mut self, scene: &mut Scene, extent: Extent) {
        let everywhere = extent == Extent::Everywhere;
        let number = self.selected as u8 + 1;
        self.change(scene, |edits, _| {
            for texel in &mut edits.texels {
                if everywhere || *texel == number {
                    *texel = if everywhere { number } else { 0 };
                }
            }
        });
    }

    /// Uses the tool at hand at a texel of an asset; returns `true` if something changed.
    pub(crate) fn touch(&mut self, scene: &mut Scene, asset: usize, texel: u32) -> bool {
        if self.asset != asset {
            self.close(scene);
            self.show(scene, asset);
        }
        if self.count(scene) == 0 && self.tool != Tool::Eraser {
            self.add(scene);
            self.fill(scene, Extent::Nowhere);
        }
        let before = self.edits(scene).cloned();
        let (tool, radius) = (self.tool, self.radius);
        let number = if tool == Tool::Eraser { 0 } else { self.selected as u8 + 1 };
        self.change(scene, |edits, asset| match tool {
            Tool::Look => {}
            Tool::Brush | Tool::Eraser => paint(edits, [asset.width, asset.height], texel, radius, number),
            Tool::Cluster => {
                // Clusters are those of the layer that is seen in front.
                let clusters = &asset.layers[0].texel_clusters;
                let cluster = clusters[texel as usize];
                let texels = edits.texels.iter_mut().zip(clusters);
                texels.filter(|(_, of)| **of == cluster).for_each(|(edit, _)| *edit = number);
            }
        });
        self.edits(scene) != before.as_ref()
    }

    /// Writes the asset with its edits to [`Editor::file`].
    pub(crate) fn save(&mut self, scene: &Scene) {
        let path = PathBuf::from(&self.file);
        if self.asset >= scene.assets.len() {
            return;
        }
        self.message = Some(match self.save_as(scene, self.asset, &path) {
            Ok(()) => format!("saved {}", path.display()),
            Err(error) => error.to_string(),
        });
    }

    /// Writes an asset with its edits to a file.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] for the file of an asset of the scene, its own or another; [`ViewerError::Write`].
    pub(crate) fn save_as(&mut self, scene: &Scene, asset: usize, path: &Path) -> Result<(), ViewerError> {
        save(scene, &scene.assets[asset], path)?;
        self.saved[asset] = edits_of(scene, asset).cloned();
        Ok(())
    }
}

/// Returns the edits of an asset of a scene; `None` where only its resident form is at hand, or where there is none.
fn edits_of(scene: &Scene, asset: usize) -> Option<&Edits> {
    scene.assets.get(asset)?.file.as_ref().map(|file| &file.asset.edits)
}

/// Returns where an asset is saved unless another file is named: beside its own file.
fn edited_path(asset: &SceneAsset) -> PathBuf {
    let name = format!("{}_edited.spmm", asset.name.trim_end_matches("_edited"));
    asset.path.as_deref().unwrap_or(Path::new(&name)).with_file_name(&name)
}

/// Packs an asset with its edits.
///
/// # Errors
/// [`ViewerError::Usage`] for the file of an asset of the scene, its own or another; [`ViewerError::Write`].
fn save(scene: &Scene, asset: &SceneAsset, path: &Path) -> Result<(), ViewerError> {
    let target = path.canonicalize().ok();
    let known = |other: &Arc<SceneAsset>| other.path.as_deref().and_then(|own| own.canonicalize().ok());
    if target.is_some() && scene.assets.iter().any(|other| known(other) == target) {
        return Err(ViewerError::Usage(format!("{} is open in this scene; choose another name", path.display())));
    }
    let bytes = pack(&asset.file_form()?.asset).map_err(|source| ViewerError::Asset { path: path.into(), source })?;
    Ok(btf_capture::atomic::write_file_atomically(path, &bytes)?)
}

/// Puts edit `number` on the texels around `texel`; textures repeat.
fn paint(edits: &mut Edits, [width, height]: [usize; 2], texel: u32, radius: f32, number: u8) {
    let (column, row) = ((texel as usize % width) as i64, (texel as usize / width) as i64);
    let reach = radius.ceil() as i64;
    for dy in -reach..=reach {
        for dx in -reach..=reach {
            if (dx * dx + dy * dy) as f32 <= radius * radius {
                let (x, y) = ((column + dx).rem_euclid(width as i64), (row + dy).rem_euclid(height as i64));
                edits.texels[y as usize * width + x as usize] = number;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MeshChoice;
    use btf_runtime::Asset;

    fn scene() -> Scene {
        Scene::built_in(&MeshChoice::Plane, vec![Arc::new(SceneAsset::built_in())], [1.0; 2]).unwrap()
    }

    fn edits(scene: &Scene) -> Edits {
        scene.assets[0].file_form().unwrap().asset.edits.clone()
    }

    #[test]
    fn every_step_goes_back_and_forth() {
        let mut scene = scene();
        let mut editor = Editor::new(&scene, 8.0);
        let mut states = vec![edits(&scene)];
        editor.add(&mut scene);
        editor.close(&scene);
        states.push(edits(&scene));
        // A drag of a slider is one step.
        for roughness in [1.1, 1.3, 1.6] {
            editor.set(&mut scene, Edit { roughness, ..Edit::default() });
        }
        editor.close(&scene);
        states.push(edits(&scene));
        editor.add(&mut scene);
        editor.tool = Tool::Brush;
        editor.radius = 2.0;
        assert!(editor.touch(&mut scene, 0, 65));
        editor.close(&scene);
        states.push(edits(&scene));
        // A circle of radius 2 has 13 texels.
        assert_eq!(states[3].texels.iter().filter(|edit| **edit == 2).count(), 13);
        editor.tool = Tool::Cluster;
        assert!(editor.touch(&mut scene, 0, 900));
        editor.close(&scene);
        states.push(edits(&scene));
        editor.remove(&mut scene);
        editor.close(&scene);
        states.push(edits(&scene));
        assert_eq!(states[5].list.len(), 1);
        for state in states.iter().rev().skip(1) {
            assert_eq!(editor.undo(&mut scene), Some(0));
            assert_eq!(&edits(&scene), state);
        }
        assert_eq!(editor.undo(&mut scene), None);
        for state in &states[1..] {
            assert_eq!(editor.redo(&mut scene), Some(0));
            assert_eq!(&edits(&scene), state);
        }
        assert!(!editor.can_redo() && editor.can_undo());
        // A new step after one that was taken back takes its place.
        editor.undo(&mut scene);
        editor.fill(&mut scene, Extent::Everywhere);
        editor.close(&scene);
        assert!(!editor.can_redo());
        // A step that changes nothing is none.
        editor.undo(&mut scene);
        let before = edits(&scene);
        editor.redo(&mut scene);
        editor.fill(&mut scene, Extent::Everywhere);
        editor.close(&scene);
        editor.undo(&mut scene);
        assert_eq!(edits(&scene), before);
    }

    #[test]
    fn what_is_saved_is_what_was_edited_and_never_what_was_measured() {
        let dir = tempfile::tempdir().unwrap();
        let own = dir.path().join("weave.spmm");
        std::fs::write(&own, pack(&SceneAsset::built_in().file_form().unwrap().asset).unwrap()).unwrap();
        let asset = Arc::new(SceneAsset::load(&own).unwrap());
        let mut scene = Scene::built_in(&MeshChoice::Plane, vec![asset], [1.0; 2]).unwrap();
        let mut editor = Editor::new(&scene, 8.0);
        assert_eq!(PathBuf::from(&editor.file), dir.path().join("weave_edited.spmm"));
        editor.add(&mut scene);
        editor.set(&mut scene, Edit { tint: [0.2, 0.9, 0.4], ..Edit::default() });
        editor.save(&scene);
        assert!(editor.message.as_ref().unwrap().starts_with("saved"), "{:?}", editor.message);
        let bytes = std::fs::read(dir.path().join("weave_edited.spmm")).unwrap();
        assert_eq!(Asset::parse(&bytes).unwrap(), scene.assets[0].file_form().unwrap().asset);
        editor.file = own.display().to_string();
        let before = std::fs::read(&own).unwrap();
        editor.save(&scene);
        assert!(editor.message.as_ref().unwrap().contains("choose another name"), "{:?}", editor.message);
        assert_eq!(std::fs::read(&own).unwrap(), before);
    }
}

//! Changing a leaf while it is drawn: which leaf is at hand, what it holds, how it is evaluated, and the way back.

use super::history::History;
use crate::error::ViewerError;
use crate::scene::leaf::SceneLeaf;
use crate::scene::plant_variation::vary_plants;
use crate::scene::scene::Scene;
use crate::window::files::Replaced;
use btf_models::{LeafDescription, LeafPreset, LeafQuantity};
use btf_runtime::LeafMode;
use std::ops::Range;
use std::path::{Path, PathBuf};
use web_time::Instant;

/// Parameters of a leaf that the panel changes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LeafSettings {
    pub description: LeafDescription,
    pub mode: LeafMode,
}

impl LeafSettings {
    fn of(leaf: &SceneLeaf) -> LeafSettings {
        LeafSettings { description: leaf.description.clone(), mode: leaf.leaf.state().mode }
    }

    /// Puts a number in its place, the nearest within its range; what is no number leaves it as it is.
    pub(crate) fn put(&mut self, quantity: &LeafQuantity, value: f64) {
        if !value.is_nan() {
            let [least, most] = quantity.range;
            quantity.set(&mut self.description, value.clamp(least, most));
        }
    }

    /// Takes over what a blade of a named state holds.
    pub(crate) fn take(&mut self, preset: LeafPreset) {
        self.description.contents = preset.contents();
    }
}

/// Change of a leaf that a renderer has to follow.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct LeafChange {
    pub leaf: usize,
    /// Words of the leaf that changed.
    pub words: Range<usize>,
    /// The factors of the instances changed.
    pub plants: bool,
}

/// The leaves of a scene in the making.
#[derive(Debug, Default)]
pub(crate) struct Physiology {
    /// Number of the leaf that is shown.
    pub leaf: usize,
    pub file: String,
    /// Message of the latest saving, or the error.
    pub message: Option<String>,
    /// Time of the last change on the CPU, milliseconds.
    pub step_ms: Option<f64>,
    /// Settings of each leaf as the scene was opened.
    opened: Vec<LeafSettings>,
    /// Description of each leaf as it was opened or saved last.
    saved: Vec<LeafDescription>,
    history: History<LeafSettings>,
}

impl Physiology {
    pub(crate) fn new(scene: &Scene) -> Physiology {
        let opened = scene.leaves.iter().map(LeafSettings::of).collect();
        let saved = scene.leaves.iter().map(|leaf| leaf.description.clone()).collect();
        let mut physiology = Physiology { opened, saved, ..Physiology::default() };
        physiology.show(scene, 0);
        physiology
    }

    /// Makes what edits the leaves of the scene after a file was opened. What is unsaved of leaves that were not
    /// replaced stays so.
    pub(crate) fn reopened(&self, scene: &Scene, replaced: Replaced) -> Physiology {
        let mut physiology = Physiology::new(scene);
        if replaced.keeps_leaves() {
            physiology.saved.iter_mut().zip(&self.saved).for_each(|(new, known)| new.clone_from(known));
        }
        physiology
    }

    /// Tells whether a leaf's description is as it was opened or saved last. How the leaf is evaluated is no part of
    /// it.
    pub(crate) fn is_saved(&self, scene: &Scene, leaf: usize) -> bool {
        scene.leaves.get(leaf).map(|leaf| &leaf.description) == self.saved.get(leaf)
    }

    /// Returns the file that a leaf is saved in: the one that the panel names for the leaf that it shows, else one
    /// beside its own.
    pub(crate) fn file_of(&self, scene: &Scene, leaf: usize) -> String {
        match leaf == self.leaf {
            true => self.file.clone(),
            false => edited_path(&scene.leaves[leaf]).display().to_string(),
        }
    }

    /// Turns to a leaf.
    pub(crate) fn show(&mut self, scene: &Scene, leaf: usize) {
        self.leaf = leaf;
        self.message = None;
        self.file = scene.leaves.get(leaf).map_or_else(String::new, |leaf| edited_path(leaf).display().to_string());
    }

    /// Returns the leaf at hand as it is; `None` in a scene without leaves.
    pub(crate) fn settings(&self, scene: &Scene) -> Option<LeafSettings> {
        scene.leaves.get(self.leaf).map(LeafSettings::of)
    }

    /// Tells whether the leaf at hand is as it was opened.
    pub(crate) fn is_as_opened(&self, scene: &Scene) -> bool {
        self.settings(scene).as_ref() == self.opened.get(self.leaf)
    }

    /// Changes the leaf at hand; the change belongs to the step that [`Physiology::close`] ends. Costs what
    /// [`SceneLeaf::describe`] does, and [`vary_plants`] where the variation changes.
    pub(crate) fn set(&mut self, scene: &mut Scene, settings: LeafSettings) -> Option<LeafChange> {
        let before = self.settings(scene)?;
        let change = self.put_into(scene, self.leaf, settings)?;
        self.history.begin(self.leaf, before);
        Some(change)
    }

    /// Puts the leaf at hand back to what it was opened as.
    pub(crate) fn reset(&mut self, scene: &mut Scene) -> Option<LeafChange> {
        self.set(scene, self.opened.get(self.leaf)?.clone())
    }

    fn put_into(&mut self, scene: &mut Scene, number: usize, settings: LeafSettings) -> Option<LeafChange> {
        let leaf = scene.leaves.get_mut(number)?;
        if LeafSettings::of(leaf) == settings {
            return None;
        }
        let start = Instant::now();
        let plants = leaf.description.variation != settings.description.variation;
        let words = match leaf.describe(settings.description, settings.mode) {
            Ok(words) => words,
            Err(error) => {
                self.message = Some(error.to_string());
                return None;
            }
        };
        if plants {
            vary_plants(&mut scene.geometry, &scene.materials, &scene.leaves);
        }
        self.step_ms = Some(start.elapsed().as_secs_f64() * 1e3);
        Some(LeafChange { leaf: number, words, plants })
    }

    /// Ends a step: a drag of a slider, a click, a number.
    pub(crate) fn close(&mut self, scene: &Scene) {
        self.history.close(|leaf| scene.leaves.get(leaf).map(LeafSettings::of));
    }

    pub(crate) fn can_undo(&self) -> bool {
        self.history.can_undo()
    }

    pub(crate) fn can_redo(&self) -> bool {
        self.history.can_redo()
    }

    /// Takes the last step back.
    pub(crate) fn undo(&mut self, scene: &mut Scene) -> Option<LeafChange> {
        self.close(scene);
        let (leaf, settings) = self.history.undo()?;
        self.go_to(scene, leaf, settings)
    }

    /// Does a step again that was taken back.
    pub(crate) fn redo(&mut self, scene: &mut Scene) -> Option<LeafChange> {
        self.close(scene);
        let (leaf, settings) = self.history.redo()?;
        self.go_to(scene, leaf, settings)
    }

    fn go_to(&mut self, scene: &mut Scene, leaf: usize, settings: LeafSettings) -> Option<LeafChange> {
        if self.leaf != leaf {
            self.show(scene, leaf);
        }
        self.put_into(scene, leaf, settings)
    }

    /// Writes the description of the leaf at hand to [`Physiology::file`].
    pub(crate) fn save(&mut self, scene: &Scene) {
        if self.leaf >= scene.leaves.len() {
            return;
        }
        let path = PathBuf::from(&self.file);
        self.message = Some(match self.save_as(scene, self.leaf, &path) {
            Ok(()) => format!("saved {}", path.display()),
            Err(error) => error.to_string(),
        });
    }

    /// Writes the description of a leaf to a file.
    ///
    /// # Errors
    /// The errors of [`SceneLeaf::save`].
    pub(crate) fn save_as(&mut self, scene: &Scene, leaf: usize, path: &Path) -> Result<(), ViewerError> {
        scene.leaves[leaf].save(path)?;
        self.saved[leaf].clone_from(&scene.leaves[leaf].description);
        Ok(())
    }
}

/// Returns where a leaf is saved unless another file is named: beside its own file.
fn edited_path(leaf: &SceneLeaf) -> PathBuf {
    let name = format!("{}_edited.toml", leaf.name.trim_end_matches("_edited"));
    leaf.path.as_deref().unwrap_or(Path::new(&name)).with_file_name(&name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::material::{Body, Material, Shown};
    use crate::scene::mesh;
    use crate::scene::scene::{MeshChoice, SceneMesh, SceneObject};
    use btf_models::LEAF_QUANTITIES;
    use btf_runtime::{LeafTexel, LeafTexture, ViewedLeaf};
    use glam::{Mat4, Vec3};

    fn leaf(name: &str) -> SceneLeaf {
        SceneLeaf::new(name, LeafDescription::default(), &LeafTexture::uniform(LeafTexel::default())).unwrap()
    }

    fn scene(names: &[&str]) -> Scene {
        let leaves = names.iter().map(|name| leaf(name)).collect();
        Scene::built_in(&MeshChoice::Plane, Shown { assets: Vec::new(), leaves }, [1.0; 2]).unwrap()
    }

    fn green(scene: &Scene) -> f32 {
        let words = scene.leaves[0].leaf.words();
        ViewedLeaf::new(words, [0.5; 2], 0, [1.0; 4], [0.0, 0.0, 1.0]).light([0.0, 0.6, 0.8])[1]
    }

    #[test]
    fn every_quantity_changes_the_description_within_its_range_and_the_words_say_so() {
        let mut scene = scene(&["leaf"]);
        let mut physiology = Physiology::new(&scene);
        for quantity in &LEAF_QUANTITIES {
            let [least, most] = quantity.range;
            for (typed, kept) in [(most * 100.0, most), (least - 1.0, least), (f64::INFINITY, most), (f64::NAN, most)] {
                let old = scene.leaves[0].leaf.clone();
                let mut settings = physiology.settings(&scene).unwrap();
                settings.put(quantity, typed);
                let change = physiology.set(&mut scene, settings);
                assert_eq!(quantity.of(&scene.leaves[0].description), kept, "{} {typed}", quantity.key);
                assert_eq!(change.is_some(), !typed.is_nan());
                let Some(LeafChange { words, plants, .. }) = change else { continue };
                assert_eq!(plants, quantity.section == "variation");
                assert_eq!(words.is_empty(), !["contents", "gloss"].contains(&quantity.section), "{}", quantity.key);
                let (old, new) = (old.words(), scene.leaves[0].leaf.words());
                assert!((0..new.len()).all(|i| old[i] == new[i] || words.contains(&i)));
            }
        }
    }

    #[test]
    fn presets_and_modes_are_what_is_drawn() {
        let mut scene = scene(&["leaf"]);
        let mut physiology = Physiology::new(&scene);
        let mut seen = vec![green(&scene)];
        for preset in &LeafPreset::ALL[1..] {
            let mut settings = physiology.settings(&scene).unwrap();
            settings.take(*preset);
            physiology.set(&mut scene, settings).unwrap();
            assert_eq!(scene.leaves[0].description.contents, preset.contents());
            seen.push(green(&scene));
        }
        for mode in [LeafMode::Rational, LeafMode::ThreePiece] {
            let settings = LeafSettings { mode, ..physiology.settings(&scene).unwrap() };
            physiology.set(&mut scene, settings).unwrap();
            assert_eq!(scene.leaves[0].leaf.state().mode, mode);
            seen.push(green(&scene));
        }
        for (i, x) in seen.iter().enumerate() {
            assert!(seen[..i].iter().all(|other| (other - x).abs() > 1e-3), "{seen:?}");
        }
        assert!(physiology.step_ms.is_some() && !physiology.is_as_opened(&scene));
        assert!(physiology.reset(&mut scene).is_some() && physiology.is_as_opened(&scene));
        assert_eq!(green(&scene), seen[0]);
        // What is so already is no change.
        assert_eq!(physiology.reset(&mut scene), None);
        let settings = LeafSettings { mode: LeafMode::TwoSided, ..physiology.settings(&scene).unwrap() };
        physiology.set(&mut scene, settings).unwrap();
        assert!((green(&scene) - seen[0]).abs() > 1e-3, "{} {}", green(&scene), seen[0]);
    }

    #[test]
    fn every_step_goes_back_and_forth_also_from_leaf_to_leaf() {
        let mut scene = scene(&["one", "other"]);
        let mut physiology = Physiology::new(&scene);
        assert_eq!(physiology.file, "one_edited.toml");
        let states = |scene: &Scene| scene.leaves.iter().map(LeafSettings::of).collect::<Vec<_>>();
        let mut known = vec![states(&scene)];
        // A drag is one step.
        for value in [30.0, 20.0, 10.0] {
            let mut settings = physiology.settings(&scene).unwrap();
            settings.put(&LEAF_QUANTITIES[0], value);
            physiology.set(&mut scene, settings);
        }
        physiology.close(&scene);
        known.push(states(&scene));
        physiology.show(&scene, 1);
        let mut settings = physiology.settings(&scene).unwrap();
        settings.take(LeafPreset::Albino);
        physiology.set(&mut scene, settings);
        physiology.close(&scene);
        known.push(states(&scene));
        physiology.show(&scene, 0);
        for (leaf, state) in [(1, &known[1]), (0, &known[0])] {
            assert_eq!(physiology.undo(&mut scene).unwrap().leaf, leaf);
            assert_eq!((&states(&scene), physiology.leaf), (state, leaf));
        }
        assert!(physiology.undo(&mut scene).is_none() && !physiology.can_undo() && physiology.can_redo());
        for state in &known[1..] {
            physiology.redo(&mut scene).unwrap();
            assert_eq!(&states(&scene), state);
        }
    }

    #[test]
    fn another_variation_gives_other_plants_and_none_gives_the_same_ones() {
        let part = mesh::plane();
        let objects = vec![SceneObject { part, material: Material::new(Body::Leaf(0), [1.0; 2]) }];
        let places = (0..5).map(|i| Mat4::from_translation(Vec3::X * 3.0 * i as f32)).collect();
        let shown = Shown { assets: Vec::new(), leaves: vec![leaf("leaf")] };
        let mut scene = Scene::from_meshes(Path::new("row"), vec![SceneMesh { objects, places }], shown).unwrap();
        let mut physiology = Physiology::new(&scene);
        let factors =
            |scene: &Scene| scene.geometry.instances().iter().map(|instance| instance.factors).collect::<Vec<_>>();
        assert_eq!(factors(&scene), [[1.0; 4]; 5]);
        let mut settings = physiology.settings(&scene).unwrap();
        settings.description.variation.chlorophyll = 0.2;
        let change = physiology.set(&mut scene, settings.clone()).unwrap();
        assert!(change.plants && change.words.is_empty());
        let varied = factors(&scene);
        assert!(varied.iter().all(|[a, rest @ ..]| *a != 1.0 && *rest == [1.0; 3]), "{varied:?}");
        settings.description.variation.seed = 2;
        assert!(physiology.set(&mut scene, settings).unwrap().plants);
        assert_ne!(factors(&scene), varied);
        physiology.close(&scene);
        assert!(physiology.undo(&mut scene).unwrap().plants);
        assert_eq!(factors(&scene), [[1.0; 4]; 5]);
    }
}

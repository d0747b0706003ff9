//! The split view: the picture beside another one of the same scene, or the difference of both.

use super::side::Side;
use crate::gpu::scene_change::SceneChange;
use crate::options::{RenderMode, ShadeOptions};
use crate::scene::asset::SceneAsset;
use crate::scene::material::Body;
use crate::scene::scene::Scene;
use btf_runtime::{DecodeOptions, Edits, Interpolation};
use std::sync::Arc;

/// The picture on the other side of the split view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Against {
    /// Everything that the assets have: all components and lobes, exact interpolation, the finest texels.
    #[default]
    Everything,
    /// Traced paths.
    Paths,
    /// The assets without their edits.
    Measured,
    /// An asset of the scene in place of the body at hand.
    Asset(usize),
    /// The asset that was opened beside the scene, [`Split::opened`], in place of the body at hand.
    Opened,
}

impl Against {
    /// Returns the settings of the other picture.
    pub(crate) fn shade(self, shade: &ShadeOptions) -> ShadeOptions {
        match self {
            Against::Everything => {
                let all = DecodeOptions { interpolation: Interpolation::Exact, ..DecodeOptions::default() };
                ShadeOptions { decode: all, levels: false, ..*shade }
            }
            Against::Paths => ShadeOptions { mode: RenderMode::Path, ..*shade },
            Against::Measured | Against::Asset(_) | Against::Opened => *shade,
        }
    }
}

/// The split view's state.
pub(crate) struct Split {
    pub on: bool,
    pub against: Against,
    /// Show `|a - b|` times [`Split::gain`] in place of both.
    pub difference: bool,
    pub gain: f32,
    /// Position of the dividing line, as a share of the width.
    pub place: f32,
    pub side: Side,
    /// An asset to compare with that is no part of the scene.
    pub opened: Option<Arc<SceneAsset>>,
    /// Text of the field that names an asset to open.
    pub file: String,
    scene: Option<Scene>,
}

impl Split {
    pub(crate) fn new(gain: f32) -> Split {
        Split {
            on: false,
            against: Against::default(),
            difference: false,
            gain,
            place: 0.5,
            side: Side::default(),
            opened: None,
            file: String::new(),
            scene: None,
        }
    }

    /// Turns the view on, with an asset in place of the body at hand.
    pub(crate) fn compare_with(&mut self, asset: Arc<SceneAsset>, scene: &Scene, at_hand: Body) {
        (self.on, self.against, self.opened) = (true, Against::Opened, Some(asset));
        self.reset(scene, at_hand);
    }

    /// Returns what the picture of a scene can be compared with.
    pub(crate) fn choices(&self, scene: &Scene, at_hand: Body) -> Vec<Against> {
        let ways = [Against::Everything, Against::Paths, Against::Measured].into_iter();
        // The others are ways to decode assets.
        let ways = ways.filter(|way| *way == Against::Paths || !scene.assets.is_empty());
        let others = (0..scene.assets.len()).filter(|asset| Body::Asset(*asset) != at_hand).map(Against::Asset);
        let opened = self.opened.iter().map(|_| Against::Opened);
        ways.chain(others).chain(opened).collect()
    }

    /// Returns the name of what the picture is compared with.
    pub(crate) fn name(&self, against: Against, scene: &Scene) -> String {
        let name = |asset: Option<&Arc<SceneAsset>>| asset.map_or_else(String::new, |asset| asset.name.clone());
        match against {
            Against::Everything => "all detail".into(),
            Against::Paths => "path tracing".into(),
            Against::Measured => "as measured".into(),
            Against::Asset(asset) => name(scene.assets.get(asset)),
            Against::Opened => name(self.opened.as_ref()),
        }
    }

    /// Begins anew, with another choice or another scene or body at hand.
    pub(crate) fn reset(&mut self, scene: &Scene, at_hand: Body) {
        (self.side, self.scene) = (Side::default(), None);
        let choices = self.choices(scene, at_hand);
        if !choices.contains(&self.against) {
            self.against = choices[0];
        }
    }

    /// Draws the line between the two pictures, which the mouse moves, over the `area` of both.
    pub(crate) fn show_line(&mut self, ui: &mut egui::Ui, area: egui::Rect, scene: &Scene) {
        if !self.on || self.difference {
            return;
        }
        let x = area.min.x + self.place * area.width();
        let line = egui::Rect::from_center_size(egui::pos2(x, area.center().y), egui::vec2(10.0, area.height()));
        let response = ui.interact(line, ui.scope_id().with("split"), egui::Sense::drag());
        if response.dragged() {
            let moved = response.drag_delta().x / area.width().max(1.0);
            self.place = (self.place + moved).clamp(0.02, 0.98);
        }
        if response.hovered() || response.dragged() {
            ui.ctx().set_cursor_icon(egui::CursorIcon::ResizeHorizontal);
        }
        let painter = ui.painter_at(area);
        painter.vline(x, area.y_range(), egui::Stroke::new(1.0, egui::Color32::WHITE));
        let label = |at, align, text: String| {
            painter.text(at, align, text, egui::FontId::proportional(13.0), egui::Color32::WHITE);
        };
        let top = area.min.y + 8.0;
        label(egui::pos2(x - 8.0, top), egui::Align2::RIGHT_TOP, "this".into());
        label(egui::pos2(x + 8.0, top), egui::Align2::LEFT_TOP, self.name(self.against, scene));
    }

    /// Takes over a change of the scene, where the other picture shows what changed.
    pub(crate) fn update(&mut self, scene: &Scene, change: &SceneChange) {
        let Some(other) = &mut self.scene else { return };
        match change {
            SceneChange::Edits(_) if self.against == Against::Measured => return,
            SceneChange::Edits(asset) => other.assets[*asset].clone_from(&scene.assets[*asset]),
            SceneChange::Shown(asset) => Arc::make_mut(&mut other.assets[*asset]).show_like(&scene.assets[*asset]),
            SceneChange::Leaf { leaf, .. } => other.leaves[*leaf].clone_from(&scene.leaves[*leaf]),
            SceneChange::Environment => other.environment.clone_from(&scene.environment),
            SceneChange::Instances => other.geometry.clone_from(&scene.geometry),
            SceneChange::Skins | SceneChange::Bricks => other.volumes.clone_from(&scene.volumes),
        }
        self.side.update(other, change);
    }

    /// Returns the other picture and its scene, with the camera, lights and surroundings of `scene`.
    pub(crate) fn scene(&mut self, scene: &Scene, at_hand: Body) -> (&mut Side, &Scene) {
        let (against, opened) = (self.against, &self.opened);
        let other = self.scene.get_or_insert_with(|| compared(against, opened.as_ref(), scene, at_hand));
        other.camera = scene.camera;
        other.lights.clone_from(&scene.lights);
        (other.sun, other.ambient, other.background) = (scene.sun, scene.ambient, scene.background);
        for (other, own) in other.materials.iter_mut().zip(&scene.materials) {
            other.displacement = own.displacement;
        }
        (&mut self.side, other)
    }
}

/// Makes the scene of the other picture as it begins.
fn compared(against: Against, opened: Option<&Arc<SceneAsset>>, scene: &Scene, at_hand: Body) -> Scene {
    let mut other = scene.clone();
    let in_its_place = match against {
        Against::Everything | Against::Paths => None,
        Against::Measured => {
            let edited = |asset: &&mut Arc<SceneAsset>| {
                asset.file.as_ref().is_some_and(|file| !file.asset.edits.list.is_empty())
            };
            for asset in other.assets.iter_mut().filter(edited) {
                Arc::make_mut(asset).set_edits(Edits::default());
            }
            None
        }
        Against::Asset(asset) => Some(asset),
        Against::Opened => {
            other.assets.extend(opened.cloned());
            opened.map(|_| other.assets.len() - 1)
        }
    };
    if let Some(asset) = in_its_place {
        for material in other.materials.iter_mut().filter(|material| material.body == at_hand) {
            material.body = Body::Asset(asset);
        }
    }
    other
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::leaf::SceneLeaf;
    use crate::scene::material::Shown;
    use crate::scene::scene::MeshChoice;
    use btf_models::LeafDescription;
    use btf_runtime::{LeafTexel, LeafTexture};

    #[test]
    fn an_opened_asset_stands_in_for_the_leaf_at_hand_and_the_scene_stays() {
        let texture = LeafTexture::uniform(LeafTexel::default());
        let leaf = |name: &str| SceneLeaf::new(name, LeafDescription::default(), &texture).unwrap();
        let shown = Shown { assets: Vec::new(), leaves: vec![leaf("one"), leaf("other")] };
        let scene = Scene::built_in(&MeshChoice::Plane, shown, [1.0; 2]).unwrap();
        let mut split = Split::new(8.0);
        split.reset(&scene, Body::Leaf(1));
        // Without assets nothing can be decoded otherwise.
        assert_eq!((split.against, split.choices(&scene, Body::Leaf(1))), (Against::Paths, vec![Against::Paths]));
        let asset = Arc::new(SceneAsset::built_in());
        split.compare_with(asset, &scene, Body::Leaf(1));
        assert_eq!((split.on, split.name(split.against, &scene).as_str()), (true, "weave"));
        let (_, other) = split.scene(&scene, Body::Leaf(1));
        let bodies = |scene: &Scene| scene.materials.iter().map(|material| material.body).collect::<Vec<_>>();
        assert_eq!((bodies(other), other.assets.len()), (vec![Body::Leaf(0), Body::Asset(0)], 1));
        assert_eq!((bodies(&scene), scene.assets.len()), (vec![Body::Leaf(0), Body::Leaf(1)], 0));
    }

    #[test]
    fn assets_are_compared_with_each_other_as_before() {
        let asset = Arc::new(SceneAsset::built_in());
        let assets = vec![asset.clone(), asset];
        let scene = Scene::built_in(&MeshChoice::Plane, assets, [1.0; 2]).unwrap();
        let mut split = Split::new(8.0);
        assert_eq!(
            split.choices(&scene, Body::Asset(0)),
            [Against::Everything, Against::Paths, Against::Measured, Against::Asset(1)]
        );
        split.against = Against::Asset(1);
        let (_, other) = split.scene(&scene, Body::Asset(0));
        assert!(other.materials.iter().all(|material| material.body == Body::Asset(1)));
        // The other one is at hand now: what was chosen is no choice any more.
        split.reset(&scene, Body::Asset(1));
        assert_eq!(split.against, Against::Everything);
    }
}

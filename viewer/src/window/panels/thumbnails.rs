//! Small pictures of a scene's assets.

use crate::cpu::picture::CpuPicture;
use crate::options::ShadeOptions;
use crate::picture::Picture;
use crate::scene::asset::SceneAsset;
use crate::scene::scene::{MeshChoice, Scene};
use std::sync::Arc;

/// Pixels of a side.
const SIDE: u32 = 56;

/// A picture for each asset that was seen last.
#[derive(Default)]
pub(crate) struct Thumbnails {
    /// Names and pictures.
    made: Vec<(String, egui::TextureHandle)>,
}

impl Thumbnails {
    /// Makes the pictures of assets that are new. Cost: a picture of 56 x 56 pixels on the CPU for each.
    pub(crate) fn update(&mut self, context: &egui::Context, scene: &Scene) {
        self.made.truncate(scene.assets.len());
        for (number, asset) in scene.assets.iter().enumerate() {
            // An asset that is edited keeps its picture.
            if self.made.get(number).is_some_and(|(known, _)| *known == asset.name) {
                continue;
            }
            let Some(picture) = thumbnail(asset) else { continue };
            let size = [SIDE as usize; 2];
            let image = egui::ColorImage::from_rgb(size, &picture.srgb8(0.0));
            let texture = context.load_texture(asset.name.clone(), image, egui::TextureOptions::LINEAR);
            self.made.truncate(number);
            self.made.push((asset.name.clone(), texture));
        }
    }

    /// Draws the pictures, that of the asset at hand marked; returns the asset that was clicked, if one was.
    pub(crate) fn show(&self, ui: &mut egui::Ui, selected: usize) -> Option<usize> {
        let mut clicked = None;
        ui.horizontal_wrapped(|ui| {
            for (number, (name, texture)) in self.made.iter().enumerate() {
                let image = egui::Image::new(texture).fit_to_exact_size(egui::Vec2::splat(SIDE as f32));
                let button = egui::Button::image(image).selected(number == selected);
                if ui.add(button).on_hover_text(name).clicked() {
                    clicked = Some(number);
                }
            }
        });
        clicked
    }
}

/// Draws the asset on a sphere.
fn thumbnail(asset: &Arc<SceneAsset>) -> Option<Picture> {
    let scene = Scene::built_in(&MeshChoice::Sphere, vec![asset.clone()], [1.0; 2]).ok()?;
    let mut picture = CpuPicture::new([SIDE; 2]);
    for _ in 0..4 {
        picture.add_sample(&scene, &ShadeOptions::default(), &|| true);
    }
    Some(Picture { width: SIDE, height: SIDE, radiance: picture.radiance() })
}

//! Small pictures of a scene's assets, drawn on a thread of their own: assets are expanded for them.

use crate::cpu::picture::CpuPicture;
use crate::options::ShadeOptions;
use crate::picture::Picture;
use crate::scene::asset::SceneAsset;
use crate::scene::scene::{MeshChoice, Scene};
use crate::window::pictures::preparing::POLL;
use crate::work::in_background;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError};

/// Pixels of a side.
const SIDE: u32 = 56;

/// A picture for each asset that was seen last.
#[derive(Default)]
pub(crate) struct Thumbnails {
    /// Names and pictures; an asset that cannot be drawn has none.
    made: Vec<(String, Option<egui::TextureHandle>)>,
    /// The picture that is being drawn, of the asset behind the made ones.
    drawn: Option<Receiver<Option<Picture>>>,
}

impl Thumbnails {
    /// Makes the pictures of assets that are new, one after another. Cost: on another thread, a picture of 56 x 56 pixels
    /// on the CPU for each, and the expansion of the asset.
    pub(crate) fn update(&mut self, context: &egui::Context, scene: &Scene) {
        // An asset that is edited keeps its picture.
        let known = self.made.iter().zip(&scene.assets).take_while(|((name, _), asset)| *name == asset.name).count();
        if known < self.made.len() {
            self.made.truncate(known);
            self.drawn = None;
        }
        let Some(asset) = scene.assets.get(known) else { return };
        let drawn = self.drawn.get_or_insert_with(|| draw(asset.clone()));
        let picture = match drawn.try_recv() {
            Ok(picture) => picture,
            Err(TryRecvError::Empty) => return context.request_repaint_after(POLL),
            Err(TryRecvError::Disconnected) => None,
        };
        let texture = picture.map(|picture| {
            let image = egui::ColorImage::from_rgb([SIDE as usize; 2], &picture.srgb8(0.0));
            context.load_texture(asset.name.clone(), image, egui::TextureOptions::LINEAR)
        });
        self.made.push((asset.name.clone(), texture));
        self.drawn = None;
        context.request_repaint();
    }

    /// Draws the pictures, that of the asset at hand marked; returns the asset that was clicked, if one was.
    pub(crate) fn show(&self, ui: &mut egui::Ui, selected: usize) -> Option<usize> {
        let mut clicked = None;
        ui.horizontal_wrapped(|ui| {
            for (number, (name, texture)) in self.made.iter().enumerate() {
                let Some(texture) = texture else { continue };
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

/// Draws the picture of an asset on another thread.
fn draw(asset: Arc<SceneAsset>) -> Receiver<Option<Picture>> {
    in_background(move || thumbnail(&asset))
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

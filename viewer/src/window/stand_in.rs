//! The picture that stands in while a renderer is made ready: plain surfaces in direct light, coarse, by the CPU, which
//! needs neither shaders nor assets for it.

use super::cpu_canvas::CpuCanvas;
use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::options::{RenderMode, ShadeOptions};
use crate::scene::material::Material;
use crate::scene::scene::{Ambient, Scene};

/// Pixels of the picture, about: drawn in some hundredths of a second while all processors compile.
const PIXELS: u32 = 128 * 128;
/// Samples per pixel after which it is left alone.
const SAMPLES: u32 = 8;
/// Reflectance of every surface.
const REFLECTANCE: f32 = 0.5;

/// A simpler picture of a scene.
pub(super) struct StandIn(CpuCanvas);

impl StandIn {
    /// Makes a picture without samples for an area of `view` pixels.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the driver has no memory for it.
    pub fn new(gpu: &Gpu, view: [u32; 2]) -> Result<StandIn, ViewerError> {
        Ok(StandIn(CpuCanvas::new(gpu, shrunk(view, PIXELS))?))
    }

    /// Returns the picture.
    pub fn canvas(&self) -> &CpuCanvas {
        &self.0
    }

    /// Tells whether it is for an area of `view` pixels.
    pub fn fits(&self, view: [u32; 2]) -> bool {
        self.0.size() == shrunk(view, PIXELS)
    }

    /// Tells whether it has all samples that it gets.
    pub fn is_finished(&self) -> bool {
        self.0.picture.samples >= SAMPLES
    }

    /// Adds a sample, unless it has all.
    pub fn add_sample(&mut self, gpu: &Gpu, scene: &Scene) {
        if !self.is_finished() {
            let options = ShadeOptions { mode: RenderMode::Direct, depth: 1, ..ShadeOptions::default() };
            self.0.add_sample(gpu, &simplified(scene), &options);
        }
    }
}

/// Returns the size of a picture of at most `pixels` that has the shape of an area of the window.
pub(super) fn shrunk([width, height]: [u32; 2], pixels: u32) -> [u32; 2] {
    let shrink = (f64::from(pixels) / (f64::from(width) * f64::from(height))).sqrt().min(1.0);
    [width, height].map(|side| ((f64::from(side) * shrink) as u32).max(1))
}

/// Returns a scene of the same shapes and lights whose surfaces are plain.
fn simplified(scene: &Scene) -> Scene {
    let materials = vec![Material::plain([REFLECTANCE; 3]); scene.materials.len()];
    Scene { materials, assets: Vec::new(), ambient: Ambient::NONE, ..scene.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::picture::CpuPicture;
    use crate::scene::asset::SceneAsset;
    use crate::scene::scene::MeshChoice;
    use std::sync::Arc;

    #[test]
    fn the_simplified_scene_shows_the_same_shape_without_its_asset() {
        let asset = Arc::new(SceneAsset::built_in());
        let scene = Scene::built_in(&MeshChoice::Sphere, vec![asset.clone()], [1.0; 2]).unwrap();
        let draw = |scene: &Scene| {
            let mut picture = CpuPicture::new([24, 16]);
            picture.add_sample(scene, &ShadeOptions::default(), &|| true);
            picture
        };
        let plain = draw(&simplified(&scene));
        assert!(!asset.is_expanded(), "nothing is decoded for it");
        let whole = draw(&scene);
        let hits = |picture: &CpuPicture| picture.hits.iter().map(|hit| hit.primitive).collect::<Vec<_>>();
        assert_eq!(hits(&plain), hits(&whole));
        assert!(plain.radiance() != whole.radiance() && plain.radiance().iter().any(|radiance| radiance[1] > 0.05));
    }

    #[test]
    fn pictures_shrink_to_their_pixels_and_keep_their_shape() {
        assert_eq!(shrunk([800, 400], 20_000), [200, 100]);
        assert_eq!(shrunk([30, 20], 20_000), [30, 20]);
        assert_eq!(shrunk([10_000, 1], 100), [1000, 1]);
    }
}

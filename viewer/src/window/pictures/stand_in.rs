//! The picture that stands in while a renderer is made ready: plain surfaces in direct light, coarse, by the CPU, which
//! needs neither shaders nor assets for it. A thread of its own draws it, so that the window stays at hand.

use super::cpu_canvas::CpuCanvas;
use crate::cpu::picture::CpuPicture;
use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::options::{RenderMode, ShadeOptions};
use crate::scene::material::Material;
use crate::scene::scene::{Ambient, Scene};
use crate::work::{self, HAS_THREADS};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};

/// Pixels of the picture at most: drawn in some hundredths of a second while all processors compile.
const PIXELS: u32 = 128 * 128;
/// Pixels of a picture with volumetric textures, which take longer.
const PIXELS_WITH_VOLUMES: u32 = 64 * 64;
/// Samples per pixel after which it is left alone; one where the window waits for them.
const SAMPLES: u32 = if HAS_THREADS { 8 } else { 1 };
/// Reflectance of every surface.
const REFLECTANCE: f32 = 0.5;

/// A simpler picture of a scene.
#[derive(Default)]
pub(crate) struct StandIn {
    /// The newest picture.
    shown: Option<CpuCanvas>,
    drawing: Option<Drawing>,
    /// Whether the scene is another one than that which is being drawn.
    is_stale: bool,
}

/// The thread that draws. Dropped, it ends soon.
struct Drawing {
    /// The picture after each sample.
    pictures: Receiver<CpuPicture>,
    size: [u32; 2],
    /// Whether a picture has come.
    has_come: bool,
    stop: Arc<AtomicBool>,
}

impl StandIn {
    /// Returns the picture, once there is one.
    pub fn canvas(&self) -> Option<&CpuCanvas> {
        self.shown.as_ref()
    }

    /// Notes that the scene has changed.
    pub fn restart(&mut self) {
        self.is_stale = true;
    }

    /// Takes the newest picture, and begins another where the scene has changed, for an area of `view` pixels. What was
    /// begun comes to its first sample all the same, so that a camera that is turned all the time is followed.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the driver has no memory for it.
    pub fn advance(&mut self, gpu: &Gpu, scene: &Scene, view: [u32; 2]) -> Result<(), ViewerError> {
        if let Some(drawing) = &mut self.drawing
            && let Some(picture) = drawing.pictures.try_iter().last()
        {
            drawing.has_come = true;
            let mut canvas = match self.shown.take().filter(|canvas| canvas.size() == drawing.size) {
                Some(canvas) => canvas,
                None => CpuCanvas::new(gpu, drawing.size)?,
            };
            canvas.picture = picture;
            canvas.upload(gpu);
            self.shown = Some(canvas);
        }
        let size = shrunk(view, if scene.volumes.is_some() { PIXELS_WITH_VOLUMES } else { PIXELS });
        let is_other = |drawing: &Drawing| drawing.has_come && (self.is_stale || drawing.size != size);
        if self.drawing.as_ref().is_none_or(is_other) {
            self.drawing = Some(Drawing::start(simplified(scene), size));
            self.is_stale = false;
        }
        Ok(())
    }
}

impl Drawing {
    fn start(scene: Scene, size: [u32; 2]) -> Drawing {
        let (sender, pictures) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        work::run(move || {
            let goes_on = || !stopped.load(Ordering::Relaxed);
            let options = ShadeOptions { mode: RenderMode::Direct, depth: 1, ..ShadeOptions::default() };
            let mut picture = CpuPicture::new(size);
            for _ in 0..SAMPLES {
                picture.add_sample(&scene, &options, &goes_on);
                if !goes_on() || sender.send(picture.clone()).is_err() {
                    return;
                }
            }
        });
        Drawing { pictures, size, has_come: false, stop }
    }
}

impl Drop for Drawing {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// Returns the size of a picture of at most `pixels` that has the shape of an area of the window.
pub(crate) fn shrunk([width, height]: [u32; 2], pixels: u32) -> [u32; 2] {
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
    use crate::scene::asset::SceneAsset;
    use crate::scene::scene::MeshChoice;

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
    fn the_thread_draws_all_samples_unless_it_is_stopped() {
        let scene = || Scene::built_in(&MeshChoice::Sphere, vec![Arc::new(SceneAsset::built_in())], [1.0; 2]).unwrap();
        let drawing = Drawing::start(simplified(&scene()), [24, 16]);
        let samples: Vec<u32> = drawing.pictures.iter().map(|picture| picture.samples).collect();
        assert_eq!(samples, (1..=SAMPLES).collect::<Vec<_>>());
        let drawing = Drawing::start(simplified(&scene()), [400, 300]);
        drawing.stop.store(true, Ordering::Relaxed);
        assert!(drawing.pictures.iter().count() < SAMPLES as usize);
    }

    #[test]
    fn pictures_shrink_to_their_pixels_and_keep_their_shape() {
        assert_eq!(shrunk([800, 400], 20_000), [200, 100]);
        assert_eq!(shrunk([30, 20], 20_000), [30, 20]);
        assert_eq!(shrunk([10_000, 1], 100), [1000, 1]);
    }
}

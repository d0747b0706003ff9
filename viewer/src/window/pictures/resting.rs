//! The picture without its noise, which is shown while nothing moves. A thread of its own filters what the renderer has, after 4
//! samples, 8, 16 and so on; once something moves, the renderer's own picture is shown.

use super::cpu_canvas::CpuCanvas;
use super::side::Side;
use crate::denoise::a_trous::a_trous;
use crate::denoise::features::features_of;
use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::results::reading::Reading;
use crate::options::ShadeOptions;
use crate::picture::Picture;
use crate::scene::scene::Scene;
use crate::work;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError};

/// Samples of the first picture that is filtered; half of them tell its noise.
const FIRST_SAMPLES: u32 = 4;

/// Filters pictures while nothing moves.
#[derive(Default)]
pub(crate) struct Resting {
    /// Whether that is wanted.
    pub on: bool,
    /// The picture that is on its way back from the renderer, and its samples.
    reading: Option<(u32, Reading)>,
    /// The one read before: noise is what the next one, of twice the samples, differs by.
    before: Option<(u32, Picture)>,
    /// The newest picture that waits for the thread.
    waiting: Option<Noisy>,
    filtering: Option<Receiver<(u32, Picture)>>,
    /// Whether a thread is at work, perhaps for nobody any more.
    is_busy: Arc<AtomicBool>,
    /// What is shown, and its samples.
    shown: Option<(u32, CpuCanvas)>,
}

/// A picture with its noise.
struct Noisy {
    samples: u32,
    picture: Picture,
    halfway: Picture,
}

impl Resting {
    /// Returns the filtered picture and its samples, if there is one.
    pub fn shown(&self) -> Option<(u32, &CpuCanvas)> {
        self.shown.as_ref().map(|(samples, canvas)| (*samples, canvas))
    }

    /// Tells whether a picture is being filtered that will be shown.
    pub fn is_at_work(&self) -> bool {
        self.reading.is_some() || self.waiting.is_some() || self.filtering.is_some()
    }

    /// Forgets everything, because the picture is to show something else.
    pub fn restart(&mut self) {
        *self = Resting { on: self.on, is_busy: self.is_busy.clone(), ..Resting::default() };
    }

    /// Goes on, after the renderer of `side` has drawn `samples` samples of `scene`.
    ///
    /// # Errors
    /// What the driver reported.
    pub fn advance(
        &mut self,
        gpu: &Gpu,
        side: &Side,
        scene: &Scene,
        options: &ShadeOptions,
        samples: u32,
    ) -> Result<(), ViewerError> {
        if !self.on {
            self.restart();
            return Ok(());
        }
        self.take_filtered(gpu)?;
        if let Some((samples, reading)) = &mut self.reading
            && let Some(read) = reading.take()
        {
            let (samples, picture) = (*samples, read?);
            self.reading = None;
            if let Some((half, halfway)) = self.before.take()
                && 2 * half == samples
                && samples >= FIRST_SAMPLES
            {
                self.waiting = Some(Noisy { samples, picture: picture.clone(), halfway });
            }
            self.before = Some((samples, picture));
        }
        let newest = self.before.as_ref().map_or(FIRST_SAMPLES / 4, |(samples, _)| *samples);
        if self.reading.is_none() && samples.is_power_of_two() && samples > newest {
            self.reading = side.begin_read()?.map(|reading| (samples, reading));
        }
        if !self.is_busy.load(Ordering::Relaxed)
            && let Some(noisy) = self.waiting.take()
        {
            self.is_busy.store(true, Ordering::Relaxed);
            let (scene, options, is_busy) = (scene.clone(), *options, self.is_busy.clone());
            self.filtering = Some(work::in_background(move || {
                let samples = noisy.samples;
                let filtered = noisy.filtered(&scene, &options);
                is_busy.store(false, Ordering::Relaxed);
                (samples, filtered)
            }));
        }
        Ok(())
    }

    /// Shows the picture that the thread has filtered, once it has.
    fn take_filtered(&mut self, gpu: &Gpu) -> Result<(), ViewerError> {
        let Some(result) = &self.filtering else { return Ok(()) };
        let (samples, picture) = match result.try_recv() {
            Ok(filtered) => filtered,
            Err(TryRecvError::Empty) => return Ok(()),
            Err(TryRecvError::Disconnected) => {
                self.filtering = None;
                return Ok(());
            }
        };
        self.filtering = None;
        let size = [picture.width, picture.height];
        let mut canvas = match self.shown.take() {
            Some((_, canvas)) if canvas.size() == size => canvas,
            _ => CpuCanvas::new(gpu, size)?,
        };
        (canvas.picture.sums, canvas.picture.samples) = (picture.radiance, 1);
        canvas.upload(gpu);
        self.shown = Some((samples, canvas));
        Ok(())
    }

    /// Returns the filtered picture, to be written to a file; `None` where none is shown.
    pub fn reading(&self) -> Option<Reading> {
        let (_, canvas) = self.shown.as_ref()?;
        let ([width, height], radiance) = (canvas.size(), canvas.picture.radiance());
        Some(Reading::Whole(Some(Picture { width, height, radiance })))
    }
}

impl Noisy {
    /// Returns the picture without its noise.
    fn filtered(self, scene: &Scene, options: &ShadeOptions) -> Picture {
        let Picture { width, height, radiance } = self.picture;
        let features = features_of(scene, [width, height], options, self.samples);
        let radiance = a_trous(&radiance, &self.halfway.radiance, self.samples, &features, [width, height]);
        Picture { width, height, radiance }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::picture::CpuPicture;
    use crate::scene::material::Material;
    use crate::scene::mesh::sphere;
    use crate::scene::scene::SceneObject;
    use std::path::Path;

    #[test]
    fn a_filtered_picture_is_nearer_to_one_of_many_samples() {
        let ball = SceneObject { part: sphere(), material: Material::plain([0.5; 3]) };
        let mut scene = Scene::from_objects(Path::new("ball"), vec![ball], Vec::new()).unwrap();
        scene.place_lights(64);
        let options = ShadeOptions { light_samples: 1, ..ShadeOptions::default() };
        let size = [48, 32];
        let mut picture = CpuPicture::new(size);
        let mut after = |samples: u32| {
            while picture.samples < samples {
                picture.add_sample(&scene, &options, &|| true);
            }
            Picture { width: size[0], height: size[1], radiance: picture.radiance() }
        };
        let [halfway, noisy, truth] = [2, 4, 256].map(&mut after);
        let quality = |picture: &Picture| picture.psnr_db(&truth, 0.0);
        let before = quality(&noisy);
        let filtered = Noisy { samples: 4, picture: noisy, halfway }.filtered(&scene, &options);
        assert!(quality(&filtered) > before + 1.0, "{} {before}", quality(&filtered));
    }
}

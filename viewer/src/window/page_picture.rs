//! A picture of a size and a number of samples, drawn on a page without being shown.

use super::link::LinkedView;
use super::panels::panel::Panel;
use super::pictures::renderer::Renderer;
use super::pictures::split::Split;
use crate::error::ViewerError;
use crate::gpu::backend::GpuTracer;
use crate::gpu::device::{Gpu, instance};
use crate::gpu::frame::FrameRequest;
use crate::gpu::pipelines::are_compiling;
use crate::gpu::preparation::Preparation;
use crate::gpu::results::fence::Fence;
use crate::gpu::tracer::Tracer;
use crate::options::ShadeOptions;
use crate::scene::scene::Scene;
use std::path::Path;

/// Bands of a picture, between which other pages are drawn.
const BANDS: u64 = 16;

/// Draws a scene as a link tells, and returns the bytes of a PNG. `pause` gives other work its turn.
///
/// # Errors
/// [`ViewerError::NoAdapter`], [`ViewerError::Gpu`]; [`ViewerError::Usage`] for a picture without pixels or samples.
pub async fn draw_picture<F: Future<Output = ()>>(
    mut scene: Scene,
    link: &str,
    size: [u32; 2],
    samples: u32,
    pause: impl Fn() -> F,
) -> Result<Vec<u8>, ViewerError> {
    if size.contains(&0) || samples == 0 {
        return Err(ViewerError::Usage("a picture has pixels and samples: give a width, a height and samples".into()));
    }
    let kind = GpuTracer::Bvh;
    let mut panel = Panel::new(&scene, ShadeOptions::default(), Renderer::Gpu(kind));
    LinkedView::read(link).apply(&mut scene, &mut panel, &mut Split::new(1.0));
    let gpu = Gpu::of_browser(instance(None), None).await?;
    let mut tracer = Tracer::new(&gpu, &scene, kind)?;
    let mut request = FrameRequest { scene: &scene, size, options: panel.shade, sample: 0 };
    tracer.make_ready(&request, &Preparation::default())?;
    while are_compiling() {
        pause().await;
    }
    let band_pixels = (u64::from(size[0]) * u64::from(size[1])).div_ceil(BANDS);
    // One band is drawn and the next one waits, so that the adapter does not.
    let mut ahead: Option<Fence> = None;
    for sample in 0..samples {
        request.sample = sample;
        let mut is_last = false;
        while !is_last {
            (_, is_last) = tracer.sample_band(&request, band_pixels)?;
            if let Some(end) = ahead.replace(Fence::behind_all(&gpu)) {
                while !end.has_passed(&gpu) {
                    pause().await;
                }
            }
            gpu.check()?;
        }
    }
    let mut reading = tracer.begin_read()?.ok_or_else(|| gpu.error("it has drawn nothing"))?;
    let picture = loop {
        match reading.take() {
            Some(picture) => break picture?,
            None => pause().await,
        }
    };
    picture.png(Path::new("picture.png"), scene.exposure_ev)
}

//! A picture in the making in the window: on the GPU by a tracer, or on the CPU. A split view has two.

use super::cpu_canvas::CpuCanvas;
use super::pace::Pace;
use super::preparing::Preparing;
use super::renderer::Renderer;
use super::stand_in::StandIn;
use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::frame::FrameRequest;
use crate::gpu::limits::IN_BROWSER;
use crate::gpu::pipelines::Pipelines;
use crate::gpu::results::fence::Fence;
use crate::gpu::results::readback::read_buffer;
use crate::gpu::results::reading::Reading;
use crate::gpu::results::timer::{GpuTimer, PassTimes};
use crate::gpu::scene_change::{SceneChange, Updated};
use crate::gpu::target::{Band, Target};
use crate::gpu::tracer::Tracer;
use crate::picture::Picture;
use crate::scene::camera::Camera;
use crate::scene::scene::Scene;
use web_time::Instant;

/// The devices of the window's pictures.
pub(crate) struct Devices {
    /// Shows them.
    pub window: Gpu,
    /// Traces them: the same one, or one beside it, see [`Gpu::for_tracing`].
    pub tracing: Gpu,
}

/// The picture of one renderer.
#[derive(Default)]
pub(crate) struct Side {
    /// The renderer that is being made ready.
    preparing: Option<Preparing>,
    /// What is shown meanwhile.
    stand_in: StandIn,
    tracer: Option<Tracer>,
    /// Pipelines of the scene before.
    spare: Option<Pipelines>,
    /// The picture of the scene before, until it is seen otherwise.
    before: Option<Target>,
    /// The camera of the newest sample.
    camera: Option<Camera>,
    /// What the GPU is at, where nobody can wait for it.
    at_work: Option<AtWork>,
    /// Time that the bands of the sample at hand have taken so far, milliseconds.
    bands_ms: f64,
    /// How much is drawn at once there.
    pub pace: Pace,
    /// The bands of the tracer's picture on the window's device, where that is another.
    copies: Vec<wgpu::Buffer>,
    cpu: Option<CpuCanvas>,
}

/// A band of a sample that a GPU draws.
struct AtWork {
    end: Fence,
    since: Instant,
    pixels: u64,
}

/// Rows of a picture in a buffer of the window's device.
pub(crate) struct Rows<'a> {
    pub first: u32,
    pub count: u32,
    pub pixels: &'a wgpu::Buffer,
}

impl Rows<'_> {
    /// Returns all rows of a picture.
    pub(crate) fn of_canvas(canvas: &CpuCanvas) -> Rows<'_> {
        Rows { first: 0, count: canvas.picture.height, pixels: &canvas.buffer }
    }
}

/// Time of a sample.
pub(crate) struct Took {
    /// Milliseconds.
    pub ms: f64,
    /// The sample by kind of pass, where the GPU has timestamps.
    pub passes: Option<PassTimes>,
}

impl Side {
    /// Begins anew with another scene, at the same pace; what was compiled serves it where it fits.
    pub(crate) fn switch_scene(&mut self) {
        let old = std::mem::take(self);
        let tracer = old.tracer.or_else(|| old.preparing.and_then(Preparing::into_tracer));
        let (spare, before) = tracer.map(Tracer::into_rest).unzip();
        // The copies of a picture on another device go with its tracer.
        let before = before.flatten().filter(|_| old.copies.is_empty()).or(old.before);
        *self = Side { pace: old.pace, spare: spare.or(old.spare), before, camera: old.camera, ..Side::default() };
    }

    /// Returns width and height of what is shown, pixels.
    pub(crate) fn size(&self) -> Option<[u32; 2]> {
        let stand_in = self.stand_in.canvas().map(CpuCanvas::size);
        let cpu = self.cpu.as_ref().map(CpuCanvas::size);
        stand_in.or(self.traced().map(|(size, _)| size)).or(cpu)
    }

    /// Returns the rows of what is shown, from the top.
    pub(crate) fn rows(&self) -> Vec<Rows<'_>> {
        match (self.stand_in.canvas(), self.traced(), &self.cpu) {
            (Some(canvas), _, _) => vec![Rows::of_canvas(canvas)],
            (None, Some((_, bands)), _) => {
                let rows = bands.iter().enumerate().map(|(number, band)| Rows {
                    first: band.first_row,
                    count: band.rows,
                    pixels: self.copies.get(number).unwrap_or(&band.pixels),
                });
                rows.collect()
            }
            (None, None, Some(canvas)) => vec![Rows::of_canvas(canvas)],
            (None, None, None) => Vec::new(),
        }
    }

    /// Returns size and bands of the traced picture that is there: the tracer's, or that of the scene before.
    fn traced(&self) -> Option<([u32; 2], &[Band])> {
        let before = self.before.as_ref().map(|target| (target.size, target.bands.as_slice()));
        self.tracer.as_ref().and_then(Tracer::shown).or(before)
    }

    /// Returns what is being done to make the renderer ready, for the user; `None` where it is.
    pub(crate) fn preparation(&self) -> Option<String> {
        self.preparing.as_ref().map(Preparing::line)
    }

    /// Takes over a change of the scene.
    pub(crate) fn update(&mut self, scene: &Scene, change: &SceneChange) {
        if let Some(preparing) = &mut self.preparing {
            preparing.note(change);
        }
        let Some(tracer) = &mut self.tracer else { return };
        // What cannot be taken over is uploaded anew, which tells why.
        if !matches!(tracer.update(scene, change), Ok(Updated::InPlace)) {
            self.tracer = None;
        }
    }

    /// Takes over the renderer that was being made ready, if it is; `true` if so.
    ///
    /// # Errors
    /// What the driver reported; those of uploading the scene.
    pub(crate) fn take_ready(&mut self, scene: &Scene) -> Result<bool, ViewerError> {
        let Some(made) = self.preparing.as_ref().and_then(|preparing| preparing.poll(scene)) else { return Ok(false) };
        self.preparing = None;
        self.tracer = made?;
        self.stand_in = StandIn::default();
        Ok(true)
    }

    /// Adds a sample to the picture; number 0 starts anew. Where the renderer is not ready it is made so on another
    /// thread, and there is no sample.
    ///
    /// # Errors
    /// What the driver reported.
    pub(crate) fn add_sample(
        &mut self,
        devices: &Devices,
        renderer: Renderer,
        request: &FrameRequest,
        timer: Option<&mut GpuTimer>,
    ) -> Result<Option<Took>, ViewerError> {
        if self.preparing.is_some() {
            return Ok(None);
        }
        if self.tracer.is_some() {
            self.camera = Some(request.scene.camera);
        }
        match (renderer, &mut self.tracer) {
            (Renderer::Gpu(_), Some(tracer)) if tracer.is_ready_for(request) => {
                if IN_BROWSER {
                    return self.add_bands(devices, request);
                }
                let (ms, passes) = tracer.timed_sample(request, timer)?;
                self.copy_bands(devices)?;
                Ok(Some(Took { ms, passes }))
            }
            (Renderer::Cpu, _) if request.scene.assets.iter().all(|asset| asset.is_expanded()) => {
                self.add_cpu_sample(&devices.window, request).map(Some)
            }
            (_, tracer) => {
                let (tracer, spare) = (tracer.take(), self.spare.take());
                self.preparing = Some(Preparing::start(&devices.tracing, renderer, request, tracer, spare));
                Ok(None)
            }
        }
    }

    /// Draws the next bands of a sample; `None` while there are more.
    fn add_bands(&mut self, devices: &Devices, request: &FrameRequest) -> Result<Option<Took>, ViewerError> {
        let Some(tracer) = &mut self.tracer else { return Ok(None) };
        let (band_pixels, most) = (self.pace.band_pixels(request.size), self.pace.pixels_at_once());
        let (mut pixels, mut is_last) = (0, false);
        while !is_last && (pixels == 0 || pixels + band_pixels <= most) {
            let (drawn, last) = tracer.sample_band(request, band_pixels)?;
            (pixels, is_last) = (pixels + drawn, last);
        }
        let end = Fence::behind_all(&devices.tracing);
        self.at_work = Some(AtWork { end, since: Instant::now(), pixels });
        // The time of the last band is not known yet, and that of the others tells enough.
        Ok(is_last.then_some(Took { ms: std::mem::take(&mut self.bands_ms), passes: None }))
    }

    /// Tells whether the GPU is at work, for which a browser does not let us wait.
    pub(crate) fn is_at_work(&mut self, devices: &Devices) -> bool {
        let Some(AtWork { end, since, pixels }) = &self.at_work else { return false };
        if !end.has_passed(&devices.tracing) {
            return true;
        }
        let ms = since.elapsed().as_secs_f64() * 1e3;
        self.pace.note(*pixels, ms);
        self.bands_ms += ms;
        self.at_work = None;
        false
    }

    /// Has the picture begin anew.
    pub(crate) fn restart(&mut self) {
        self.stand_in.restart();
        self.bands_ms = 0.0;
        self.tracer.iter_mut().for_each(Tracer::restart_bands);
    }

    fn add_cpu_sample(&mut self, gpu: &Gpu, request: &FrameRequest) -> Result<Took, ViewerError> {
        let start = Instant::now();
        let mut canvas = match self.cpu.take().filter(|_| request.sample > 0) {
            Some(canvas) => canvas,
            None => CpuCanvas::new(gpu, request.size)?,
        };
        canvas.add_sample(gpu, request.scene, &request.options);
        self.cpu = Some(canvas);
        Ok(Took { ms: start.elapsed().as_secs_f64() * 1e3, passes: None })
    }

    /// Brings the bands of the tracer's picture to the window's device, where that is another.
    fn copy_bands(&mut self, devices: &Devices) -> Result<(), ViewerError> {
        let Devices { window, tracing } = devices;
        let (Some(tracer), true) = (&self.tracer, window.device != tracing.device) else { return Ok(()) };
        let bands = tracer.bands();
        let fits = |(copy, band): (&wgpu::Buffer, &wgpu::Buffer)| copy.size() == band.size();
        if self.copies.len() != bands.len() || !self.copies.iter().zip(bands.iter().map(|band| &band.pixels)).all(fits)
        {
            let copy = |band: &wgpu::Buffer| {
                window.empty_buffer("pixels of this picture", band.size(), wgpu::BufferUsages::STORAGE)
            };
            self.copies = bands.iter().map(|band| copy(&band.pixels)).collect::<Result<_, _>>()?;
        }
        for (copy, band) in self.copies.iter().zip(bands) {
            let bytes: Vec<u8> = read_buffer(tracing, &band.pixels, band.pixels.size() as usize)?;
            window.queue.write_buffer(copy, 0, &bytes);
        }
        Ok(())
    }

    /// Goes on with the picture that stands in while the renderer is made ready, for an area of `view` pixels.
    ///
    /// # Errors
    /// What the driver reported.
    pub(crate) fn stand_in(&mut self, gpu: &Gpu, scene: &Scene, view: [u32; 2]) -> Result<(), ViewerError> {
        if self.camera != Some(scene.camera) {
            self.before = None;
        }
        match self.preparing {
            Some(_) if self.before.is_none() => self.stand_in.advance(gpu, scene, view),
            _ => Ok(()),
        }
    }

    /// Begins to read the mean linear radiance of the picture at hand; `None` before its first sample.
    ///
    /// # Errors
    /// What the driver reported.
    pub(crate) fn begin_read(&self) -> Result<Option<Reading>, ViewerError> {
        if self.preparing.is_some() {
            return Ok(None);
        }
        match (&self.tracer, &self.cpu) {
            (Some(tracer), _) => tracer.begin_read(),
            (None, Some(canvas)) => {
                let ([width, height], radiance) = (canvas.size(), canvas.picture.radiance());
                Ok(Some(Reading::Whole(Some(Picture { width, height, radiance }))))
            }
            (None, None) => Ok(None),
        }
    }
}

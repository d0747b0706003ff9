//! A picture in the making in the window: on the GPU by a tracer, or on the CPU. A split view has two.

use super::cpu_canvas::CpuCanvas;
use super::preparing::Preparing;
use super::renderer::Renderer;
use super::stand_in::StandIn;
use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::frame::FrameRequest;
use crate::gpu::scene_change::{SceneChange, Updated};
use crate::gpu::timer::{GpuTimer, PassTimes};
use crate::gpu::tracer::Tracer;
use crate::picture::Picture;
use crate::scene::scene::Scene;
use std::time::Instant;

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
    /// The bands of the tracer's picture on the window's device, where that is another.
    copies: Vec<wgpu::Buffer>,
    cpu: Option<CpuCanvas>,
}

/// Rows of a picture in a buffer of the window's device.
pub(crate) struct Rows<'a> {
    pub first: u32,
    pub count: u32,
    pub pixels: &'a wgpu::Buffer,
}

impl Rows<'_> {
    /// Returns all rows of a picture.
    fn of_canvas(canvas: &CpuCanvas) -> Rows<'_> {
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
    /// Returns width and height of what is shown, pixels.
    pub(crate) fn size(&self) -> Option<[u32; 2]> {
        let stand_in = self.stand_in.canvas().map(CpuCanvas::size);
        let cpu = self.cpu.as_ref().map(CpuCanvas::size);
        stand_in.or(self.tracer.as_ref().and_then(Tracer::size)).or(cpu)
    }

    /// Returns the rows of what is shown, from the top.
    pub(crate) fn rows(&self) -> Vec<Rows<'_>> {
        match (self.stand_in.canvas(), &self.tracer, &self.cpu) {
            (Some(canvas), _, _) => vec![Rows::of_canvas(canvas)],
            (None, Some(tracer), _) => {
                let rows = tracer.bands().iter().enumerate().map(|(number, band)| Rows {
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
        match (renderer, &mut self.tracer) {
            (Renderer::Gpu(_), Some(tracer)) if tracer.is_ready_for(request) => {
                let (ms, passes) = tracer.timed_sample(request, timer)?;
                self.copy_bands(devices)?;
                Ok(Some(Took { ms, passes }))
            }
            (Renderer::Cpu, _) if request.scene.assets.iter().all(|asset| asset.is_expanded()) => {
                self.add_cpu_sample(&devices.window, request).map(Some)
            }
            (_, tracer) => {
                self.preparing = Some(Preparing::start(&devices.tracing, renderer, request, tracer.take()));
                Ok(None)
            }
        }
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
            let bytes: Vec<u8> = tracing.read(&band.pixels, band.pixels.size() as usize)?;
            window.queue.write_buffer(copy, 0, &bytes);
        }
        Ok(())
    }

    /// Goes on with the picture that stands in while the renderer is made ready, for an area of `view` pixels.
    ///
    /// # Errors
    /// What the driver reported.
    pub(crate) fn stand_in(&mut self, gpu: &Gpu, scene: &Scene, view: [u32; 2]) -> Result<(), ViewerError> {
        match self.preparing {
            Some(_) => self.stand_in.advance(gpu, scene, view),
            None => Ok(()),
        }
    }

    /// Has the picture that stands in begin anew.
    pub(crate) fn restart_stand_in(&mut self) {
        self.stand_in.restart();
    }

    /// Reads the mean linear radiance of the picture at hand; `None` before its first sample.
    ///
    /// # Errors
    /// What the driver reported.
    pub(crate) fn read(&self) -> Result<Option<Picture>, ViewerError> {
        let (size, radiance) = match (&self.tracer, &self.cpu) {
            (Some(tracer), _) => (tracer.size(), tracer.read_radiance()?),
            (None, Some(canvas)) => (Some(canvas.size()), canvas.picture.radiance()),
            (None, None) => (None, Vec::new()),
        };
        let size = size.filter(|_| self.preparing.is_none());
        Ok(size.map(|[width, height]| Picture { width, height, radiance }))
    }
}

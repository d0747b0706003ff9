//! A renderer that is made ready on a thread of its own, so that the window stays at hand: the scene is uploaded and
//! shaders are compiled, which takes some drivers minutes.

use super::renderer::Renderer;
use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::frame::FrameRequest;
use crate::gpu::pipelines::{Pipelines, are_compiling};
use crate::gpu::preparation::Preparation;
use crate::gpu::scene_change::{SceneChange, Updated};
use crate::gpu::tracer::Tracer;
use crate::options::ShadeOptions;
use crate::scene::scene::Scene;
use crate::work::in_background;
#[cfg(feature = "window")]
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;
use web_time::Instant;

/// Interval at which the window asks whether a thread's work is done. Each time it draws itself, on software drivers with
/// the processors that compile: a tenth of one at this interval.
pub(crate) const POLL: Duration = Duration::from_millis(100);

/// Number of threads that make renderers ready.
static AT_WORK: AtomicUsize = AtomicUsize::new(0);

/// What the thread has made: a tracer, or nothing where the CPU renders.
type Made = Result<Option<Tracer>, ViewerError>;

/// A renderer in the making. Dropped, it has its thread end soon.
pub(crate) struct Preparing {
    preparation: Arc<Preparation>,
    made: Receiver<Made>,
    since: Instant,
    /// What has changed of the scene since the thread took it.
    changes: Vec<SceneChange>,
}

/// What a thread is to make ready.
struct Job {
    gpu: Gpu,
    renderer: Renderer,
    /// A tracer that has the scene already but not all passes.
    tracer: Option<Tracer>,
    pipelines: Option<Pipelines>,
    scene: Scene,
    size: [u32; 2],
    options: ShadeOptions,
}

impl Preparing {
    /// Begins to make a renderer ready for a picture; `tracer` has its scene already, if there is one, and `pipelines` are those of
    /// another scene's.
    pub fn start(
        gpu: &Gpu,
        renderer: Renderer,
        request: &FrameRequest,
        tracer: Option<Tracer>,
        pipelines: Option<Pipelines>,
    ) -> Preparing {
        let preparation = Arc::new(Preparation::default());
        let FrameRequest { scene, size, options, .. } = *request;
        let job = Job { gpu: gpu.clone(), renderer, tracer, pipelines, scene: scene.clone(), size, options };
        let told = preparation.clone();
        AT_WORK.fetch_add(1, Ordering::SeqCst);
        let made = in_background(move || {
            let made = job.run(&told);
            AT_WORK.fetch_sub(1, Ordering::SeqCst);
            made
        });
        Preparing { preparation, made, since: Instant::now(), changes: Vec::new() }
    }

    /// Notes a change of the scene.
    pub fn note(&mut self, change: &SceneChange) {
        if !self.changes.contains(change) {
            self.changes.push(change.clone());
        }
    }

    /// Returns what the thread has made, once it has, brought up to date with `scene`; a tracer that cannot be is none.
    ///
    /// # Errors
    /// Those of [`Tracer::new`] and [`Tracer::warm_up`], in the inner result.
    pub fn poll(&self, scene: &Scene) -> Option<Made> {
        if are_compiling() {
            return None;
        }
        let made = match self.made.try_recv() {
            Ok(made) => made,
            Err(TryRecvError::Empty) => return None,
            Err(TryRecvError::Disconnected) => {
                Err(ViewerError::Usage("the renderer could not be made ready; choose another backend".into()))
            }
        };
        Some(made.map(|tracer| {
            tracer.and_then(|mut tracer| {
                let mut takes = |change| matches!(tracer.update(scene, change), Ok(Updated::InPlace));
                self.changes.iter().all(&mut takes).then_some(tracer)
            })
        }))
    }

    /// Returns the tracer if it has been made, as it is.
    pub fn into_tracer(self) -> Option<Tracer> {
        self.made.try_recv().ok()?.ok().flatten()
    }

    /// Returns what is being done, for the user, with the time it has taken.
    pub fn line(&self) -> String {
        format!("{} ({:.0} s)", self.preparation.line(), self.since.elapsed().as_secs_f64())
    }
}

/// Ends the program, as one that has succeeded, if a renderer is still being made ready: what a driver's library frees at
/// the usual end is in use by its compiler then, and now and then the program would crash.
#[cfg(feature = "window")]
pub(crate) fn end_if_at_work() {
    if AT_WORK.load(Ordering::SeqCst) == 0 {
        return;
    }
    let _ = std::io::stdout().flush();
    #[cfg(unix)]
    #[allow(unsafe_code, reason = "the C library's call that ends a program and runs nothing of it any more")]
    // SAFETY: takes a number, and does not return.
    unsafe {
        libc::_exit(0)
    }
    #[cfg(not(unix))]
    std::process::exit(0)
}

impl Drop for Preparing {
    fn drop(&mut self) {
        self.preparation.abandon();
    }
}

impl Job {
    fn run(self, preparation: &Preparation) -> Made {
        let Job { gpu, renderer, tracer, pipelines, scene, size, options } = self;
        let Renderer::Gpu(kind) = renderer else {
            expand(&scene);
            return Ok(None);
        };
        let mut tracer = match tracer {
            Some(tracer) => tracer,
            None => Tracer::with_pipelines(&gpu, &scene, kind, pipelines)?,
        };
        tracer.expect_changes();
        tracer.make_ready(&FrameRequest { scene: &scene, size, options, sample: 0 }, preparation)?;
        Ok(Some(tracer))
    }
}

/// Expands the bases of a scene's assets, which the CPU decodes from.
fn expand(scene: &Scene) {
    for asset in &scene.assets {
        asset.resident();
    }
}

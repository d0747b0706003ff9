//! What a bench measured; the keys of `--json`.

use crate::bench::leaf_modes::LeafModeRow;
use crate::bench::params::BenchKind;
use crate::gpu::results::timer::PassTimes;
use serde::Serialize;

/// A measured point.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BenchRow {
    /// The mesh, `instances` for a model of the user's, or the landscape.
    pub mesh: &'static str,
    /// What was changed, for `ablations`, which light is followed, for `trade`, and from where it is seen, for
    /// `landscapes`.
    pub variant: &'static str,
    /// `fast` or `exact`.
    pub interpolation: &'static str,
    /// For `trade`: error of the mean of [`TRADE_SAMPLES`](crate::TRADE_SAMPLES) samples against the path-traced
    /// picture, of 8-bit sRGB values, peak 255.
    pub psnr_db: Option<f64>,
    /// For `trade`: on the front of error over time.
    pub front: bool,
    /// Median time of a frame, milliseconds.
    pub frame_ms: f64,
    /// The median frame by kind of pass, where the GPU has timestamps.
    pub passes: Option<PassTimes>,
    /// Frames that were timed.
    pub frames: usize,
    /// Mean time of frames that are submitted without waiting for one another, milliseconds; where a frame of a GPU takes
    /// less than 30 ms.
    pub unwaited_ms: Option<f64>,
    /// Bands of rows in which the picture was drawn: more than its memory asks for where a pass would take seconds.
    pub bands: usize,
    /// Point lights.
    pub lights: usize,
    /// Assets.
    pub materials: usize,
    /// Share of the pixels that show an asset.
    pub coverage: f64,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Residual components at most.
    pub components: u32,
    /// Asset decodes of a frame.
    pub spmm_evaluations: u64,
    /// Rays of a frame.
    pub rays: u64,
    /// Triangles of the scene, each as often as it is placed.
    pub triangles: u64,
    /// Instances of meshes.
    pub instances: usize,
}

/// A whole bench; the keys of `--json`.
#[derive(Debug, Clone, Serialize)]
pub struct BenchReport {
    /// Quantity that was varied.
    pub bench: BenchKind,
    /// Adapter name, or the number of threads of the CPU backend.
    pub adapter: String,
    /// Graphics interface and kind of adapter.
    pub interface: String,
    /// `ray-query`, `bvh` or `cpu`.
    pub backend: &'static str,
    /// `gpu-timestamps` or `wall-clock`.
    pub timer: &'static str,
    /// Names of the assets.
    pub assets: Vec<String>,
    /// Bytes of the assets in the decoder's memory.
    pub resident_bytes: usize,
    /// The points.
    pub rows: Vec<BenchRow>,
    /// For `trade`: the modes of a live leaf.
    pub leaf_modes: Vec<LeafModeRow>,
}

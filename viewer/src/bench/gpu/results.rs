//! What a measurement wrote down; the keys of `gpu.json`.

use serde::{Deserialize, Serialize};

/// Name of the file in the output folder.
pub const GPU_RESULTS_FILE: &str = "gpu.json";

/// The results of the measurement of a GPU, as far as it has come.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct GpuResults {
    /// Version of the program.
    pub version: String,
    /// Commit of the sources, where the build was told (`BTF_COMMIT`).
    pub commit: Option<String>,
    /// Arguments of the program.
    pub command: Vec<String>,
    /// Names of the assets.
    pub assets: Vec<String>,
    /// Name of the model of the canopies; none for the plant that comes with the viewer.
    pub mesh: Option<String>,
    /// Whether everything was small, which no figure of a GPU should be.
    pub quick: bool,
    /// Threads of the CPU.
    pub threads: usize,
    /// Seconds from start to end.
    pub seconds: f64,
    /// Whether all steps were tried or left out; otherwise the file is of a run that goes on or was stopped.
    pub finished: bool,
    /// The steps so far, in order.
    pub steps: Vec<StepRecord>,
}

/// What became of a step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepRecord {
    /// Name of the step.
    pub name: String,
    /// `ok`, `failed: ` with a sentence, `timed out`, or `skipped: ` with a reason.
    pub status: String,
    /// Seconds that it took.
    pub seconds: f64,
    /// What it measured before it ended: JSON objects with a `kind`.
    pub rows: Vec<serde_json::Value>,
}

impl StepRecord {
    /// Tells whether the step was begun and did not come to its end.
    pub fn has_failed(&self) -> bool {
        self.status != "ok" && !self.status.starts_with("skipped")
    }
}

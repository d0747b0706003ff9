//! Checks the assets of a library and gathers what its records say.

use crate::error::FitError;
use crate::inspect::load::read_file;
use crate::inspect::validate::validate;
use crate::library::claim::holder_of;
use crate::library::plan::{LibraryPlan, PlannedMaterial};
use crate::library::record::{FittedMaterial, LibraryFolders, Outcome, read_record, record_key};
use crate::monitor::Monitor;
use rayon::prelude::*;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// A library with what became of each of its materials, in the order of the plan.
#[derive(Debug, Clone, Serialize)]
pub struct Library {
    /// Folder of the assets.
    pub assets: PathBuf,
    /// The materials.
    pub materials: Vec<CollectedMaterial>,
}

/// A material of a library. The names are the keys of `library collect --json`.
#[derive(Debug, Clone, Serialize)]
pub struct CollectedMaterial {
    /// Name of the material.
    pub name: String,
    /// Captures, relative to the plan.
    pub captures: Vec<PathBuf>,
    /// What became of it.
    #[serde(flatten)]
    pub status: Status,
    /// Seconds of the fit, or of the try that failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// The asset; also where it is damaged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fitted: Option<FittedMaterial>,
}

/// What became of a material.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "status", rename_all = "snake_case")]
pub enum Status {
    /// The asset is there and valid.
    Fitted,
    /// The fit has failed.
    Failed {
        /// Why, in a sentence.
        reason: String,
    },
    /// The asset is not what was written.
    Damaged {
        /// What is wrong, in a sentence.
        reason: String,
    },
    /// A worker is at it.
    InWork {
        /// The worker.
        worker: String,
        /// Seconds since its last sign of life.
        silent_s: u64,
    },
    /// No worker has begun with it, or the plan has other options for it now.
    Open,
}

impl Status {
    /// The names of all, in the order in which they are counted.
    pub const NAMES: [&'static str; 5] = ["fitted", "failed", "damaged", "in_work", "open"];

    /// Returns the name of the status.
    pub fn name(&self) -> &'static str {
        match self {
            Status::Fitted => "fitted",
            Status::Failed { .. } => "failed",
            Status::Damaged { .. } => "damaged",
            Status::InWork { .. } => "in_work",
            Status::Open => "open",
        }
    }
}

impl Library {
    /// Returns how many materials have the status of this name.
    pub fn count(&self, status: &str) -> usize {
        self.materials.iter().filter(|material| material.status.name() == status).count()
    }
}

/// Reads the records of the plan at `path`, and reads and validates every asset.
///
/// # Errors
/// A plan that cannot be read; [`FitError::Interrupted`].
///
/// Cost: reading all assets.
pub fn collect_library(path: &Path, monitor: &Monitor) -> Result<Library, FitError> {
    let plan = LibraryPlan::read(path)?;
    let folders = LibraryFolders::of_plan(&plan, path);
    let done = AtomicUsize::new(0);
    let collected = plan.materials.par_iter().map(|material| {
        monitor.report("collect", done.fetch_add(1, Ordering::Relaxed), plan.materials.len())?;
        Ok(collect(&plan, &folders, material))
    });
    Ok(Library { materials: collected.collect::<Result<_, FitError>>()?, assets: folders.assets.clone() })
}

fn collect(plan: &LibraryPlan, folders: &LibraryFolders, material: &PlannedMaterial) -> CollectedMaterial {
    let name = material.name.clone();
    let key = record_key(material, &plan.options_of(material));
    let record = read_record(folders, &name).filter(|record| record.key == key);
    let holder = holder_of(&folders.claims(), &name);
    let seconds = record.as_ref().map(|record| record.seconds);
    let (status, fitted) = match (record.map(|record| record.outcome), holder) {
        (Some(Outcome::Fitted(fitted)), _) => match fault(&folders.asset(&name), &fitted) {
            None => (Status::Fitted, Some(*fitted)),
            Some(reason) => (Status::Damaged { reason }, Some(*fitted)),
        },
        (_, Some((holder, age))) => (Status::InWork { worker: holder.worker, silent_s: age.as_secs() }, None),
        (Some(Outcome::Failed(reason)), None) => (Status::Failed { reason }, None),
        (None, None) => (Status::Open, None),
    };
    CollectedMaterial { name, captures: material.captures.clone(), status, seconds, fitted }
}

/// Returns what is wrong with an asset, if anything.
fn fault(path: &Path, fitted: &FittedMaterial) -> Option<String> {
    let bytes = match read_file(path) {
        Ok(bytes) => bytes,
        Err(error) => return Some(error.to_string()),
    };
    // Another program may have written a valid asset over it.
    let same = blake3::hash(&bytes).to_hex().as_str() == fitted.blake3;
    if let Some(error) = validate(bytes).error {
        return Some(format!("{}: {error}", path.display()));
    }
    (!same).then(|| format!("{} is another asset than the one that was fitted", path.display()))
}

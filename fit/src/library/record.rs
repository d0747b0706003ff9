//! Records of a library: what became of each material, as a JSON file beside the assets.

use crate::error::FitError;
use crate::library::likeness::Likeness;
use crate::library::options::MaterialOptions;
use crate::library::plan::{LibraryPlan, PlannedMaterial};
use crate::metrics::Metrics;
use crate::output_path::real_path;
use btf_capture::write_file_atomically;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// The folders of a library.
#[derive(Debug, Clone)]
pub struct LibraryFolders {
    /// Folder of the plan, which its paths are relative to.
    pub plan: PathBuf,
    /// Folder of the assets.
    pub assets: PathBuf,
}

impl LibraryFolders {
    /// Returns the folders of `plan`, which was read from `path`.
    pub fn of_plan(plan: &LibraryPlan, path: &Path) -> LibraryFolders {
        let folder = real_path(path).parent().map_or_else(|| PathBuf::from("."), Path::to_path_buf);
        LibraryFolders { assets: folder.join(&plan.assets), plan: folder }
    }

    /// Returns the path of a material's asset.
    pub fn asset(&self, name: &str) -> PathBuf {
        self.assets.join(format!("{name}.spmm"))
    }

    /// Returns the folder of the claims.
    pub fn claims(&self) -> PathBuf {
        self.assets.join("claims")
    }

    /// Returns the path of a material's record.
    pub fn record(&self, name: &str) -> PathBuf {
        self.assets.join("records").join(format!("{name}.json"))
    }

    /// Returns the paths of a material's captures.
    pub fn captures(&self, material: &PlannedMaterial) -> Vec<PathBuf> {
        material.captures.iter().map(|capture| self.plan.join(capture)).collect()
    }

    /// Makes the folders.
    ///
    /// # Errors
    /// [`FitError::File`] if one cannot be made.
    pub fn make(&self) -> Result<(), FitError> {
        let records = self.assets.join("records");
        fs::create_dir_all(&records).map_err(|source| FitError::File {
            path: records,
            action: "making a folder of the library",
            source,
            remedy: "make the folder of the assets writable, or name another one in the plan",
        })
    }
}

/// What became of a material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MaterialRecord {
    /// Hash of the captures' paths and of the options that change the asset.
    pub key: String,
    /// Worker that wrote the record.
    pub worker: String,
    /// When the record was written, seconds since 1970 by the clock of the file system.
    pub written_s: f64,
    /// Seconds that the fit took.
    pub seconds: f64,
    /// Processor time of all threads in these seconds.
    #[serde(default)]
    pub processor_s: f64,
    /// The fit, or why there is none.
    pub outcome: Outcome,
}

/// A fit, or why there is none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The asset is written.
    Fitted(Box<FittedMaterial>),
    /// A sentence with the reason.
    Failed(String),
}

/// An asset that was written, with what a catalogue shows of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FittedMaterial {
    /// BLAKE3 of the asset's bytes, hexadecimal.
    pub blake3: String,
    /// Size of the asset in bytes.
    pub bytes: u64,
    /// Columns and rows of texels.
    pub size: [usize; 2],
    /// Views and lights of the first layer.
    pub directions: [usize; 2],
    /// Number of layers.
    pub layers: usize,
    /// Error against the captures.
    pub metrics: Metrics,
    /// What a user should know of the fit, a sentence each.
    #[serde(default)]
    pub remarks: Vec<String>,
    /// Lobes of each family in the dictionaries of all layers, by the family's name.
    pub families: BTreeMap<String, usize>,
    /// Seconds by stage.
    pub stages: BTreeMap<String, f64>,
    /// Greatest memory of the worker so far, bytes.
    pub peak_memory_bytes: Option<u64>,
    /// Features by which materials are compared.
    pub likeness: Likeness,
    /// Picture on three shapes, a JPEG in base64.
    pub thumbnail: String,
}

/// What has become of a material, by its files.
#[derive(Debug, Clone, PartialEq)]
pub enum MaterialState {
    /// Nothing that counts for its options.
    Open,
    /// The material's asset is there.
    Done(Box<MaterialRecord>),
    /// The material's fit has failed.
    Failed(Box<MaterialRecord>),
}

/// Returns what `record`, of the material `name`, and its asset say. The asset is not read.
pub fn state_of(folders: &LibraryFolders, name: &str, record: Option<MaterialRecord>) -> MaterialState {
    let Some(record) = record else { return MaterialState::Open };
    match &record.outcome {
        Outcome::Fitted(fitted) => {
            let there = fs::metadata(folders.asset(name)).is_ok_and(|meta| meta.len() == fitted.bytes);
            if there { MaterialState::Done(Box::new(record)) } else { MaterialState::Open }
        }
        Outcome::Failed(_) => MaterialState::Failed(Box::new(record)),
    }
}

/// Returns the hash by which a record knows that it is about this material as it is planned now.
pub fn record_key(material: &PlannedMaterial, options: &MaterialOptions) -> String {
    let mut hasher = blake3::Hasher::new();
    for capture in &material.captures {
        hasher.update(capture.to_string_lossy().as_bytes());
        hasher.update(b"\0");
    }
    hasher.update(options.signature().as_bytes());
    hasher.finalize().to_hex()[..32].to_string()
}

/// Reads the record of the material `name`; `None` where there is none that can be read.
pub fn read_record(folders: &LibraryFolders, name: &str) -> Option<MaterialRecord> {
    serde_json::from_slice(&fs::read(folders.record(name)).ok()?).ok()
}

/// Writes the record of the material `name`.
///
/// # Errors
/// [`FitError::Capture`] if it cannot be written.
pub fn write_record(folders: &LibraryFolders, name: &str, record: &MaterialRecord) -> Result<(), FitError> {
    let text = serde_json::to_vec(record).unwrap_or_default();
    Ok(write_file_atomically(folders.record(name), &text)?)
}

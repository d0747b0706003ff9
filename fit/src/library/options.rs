//! Options of a material in a plan, by the names of `btf-fit fit`.

use crate::params::{ErrorMeasure, FitParams, Role};
use serde::{Deserialize, Deserializer, Serialize};
use std::path::Path;

/// Options of a material; what is `None` others decide.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialOptions {
    /// Largest size of the asset, as `2MB`; excludes `psnr`.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "size")]
    pub bytes: Option<String>,
    /// Least PSNR of the 8-bit values, dB; excludes `bytes`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psnr: Option<f64>,
    /// Clusters of texels, 1 to 256.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clusters: Option<usize>,
    /// Most lobes, 0 to 32.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lobes: Option<usize>,
    /// Residual components, 0 to 128.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub components: Option<usize>,
    /// What lobes are to the residual: `base` or `guide`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub role: Option<Role>,
    /// The error to make small: `gamma`, `linear` or `log`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<ErrorMeasure>,
    /// Whether to find and store the texels' heights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heights: Option<bool>,
    /// Seed of every random choice.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Most memory to use, as `4GB`; near the least that a capture needs accuracy falls.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "size")]
    pub memory: Option<String>,
    /// Materials of a higher priority are fitted first; 0 if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub priority: Option<i64>,
}

/// Reads a size and checks it where the file has it, so that a fault is told with its line.
fn size<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    let text = String::deserialize(deserializer)?;
    btf_capture::bytes_from_text(&text).map_err(|fault| serde::de::Error::custom(format!("`{text}`: {fault}")))?;
    Ok(Some(text))
}

impl MaterialOptions {
    /// Returns these options, and `below` where these have none. A size here puts an error below out of force, and the
    /// other way round.
    pub fn over(&self, below: &MaterialOptions) -> MaterialOptions {
        let own_goal = self.bytes.is_some() || self.psnr.is_some();
        let goal = if own_goal { self } else { below };
        MaterialOptions {
            bytes: goal.bytes.clone(),
            psnr: goal.psnr,
            clusters: self.clusters.or(below.clusters),
            lobes: self.lobes.or(below.lobes),
            components: self.components.or(below.components),
            role: self.role.or(below.role),
            error: self.error.or(below.error),
            heights: self.heights.or(below.heights),
            seed: self.seed.or(below.seed),
            memory: self.memory.clone().or_else(|| below.memory.clone()),
            priority: self.priority.or(below.priority),
        }
    }

    /// Returns the parameters of the fit, whose temporary files lie in `folder`. Numbers of clusters and lobes that are not
    /// asked for follow from the capture ([`FitParams::suit`]).
    pub fn params(&self, folder: &Path) -> FitParams {
        let bytes = |text: &Option<String>| text.as_deref().and_then(|text| btf_capture::bytes_from_text(text).ok());
        let default = FitParams::default();
        FitParams {
            bytes: bytes(&self.bytes),
            psnr_db: self.psnr,
            clusters: self.clusters.unwrap_or(default.clusters),
            lobes: self.lobes.unwrap_or(default.lobes),
            role: self.role,
            components: self.components,
            memory_bytes: bytes(&self.memory).unwrap_or(default.memory_bytes),
            error: self.error,
            heights: self.heights.unwrap_or(default.heights),
            seed: self.seed.unwrap_or(default.seed),
            cache_directory: folder.to_path_buf(),
            ..default
        }
    }

    /// Returns the options that change an asset, as text.
    pub(crate) fn signature(&self) -> String {
        let shown = MaterialOptions { priority: None, ..self.clone() };
        serde_json::to_string(&shown).unwrap_or_default()
    }
}

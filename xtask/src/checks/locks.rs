//! Lock files: each workspace beside the main one, too, has one that fits its manifests.
//!
//! A package that gains a dependency changes the lock file of every workspace that depends on it, and only cargo's own run in that
//! workspace writes it.

use crate::shell::cargo;
use std::path::Path;

/// Checks the lock files of the workspace below `root` and of the workspaces in `others`, folders below it.
pub fn check(root: &Path, others: impl Iterator<Item = &'static str>) -> Result<String, String> {
    let manifests: Vec<_> =
        std::iter::once(".").chain(others).map(|folder| root.join(folder).join("Cargo.toml")).collect();
    for manifest in &manifests {
        let output = cargo(&["metadata", "--locked", "--format-version", "1", "--manifest-path"])
            .arg(manifest)
            .output()
            .map_err(|error| format!("cargo metadata does not start: {error}"))?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr);
            return Err(format!(
                "the lock file beside {} does not fit: `cargo metadata` without --locked in that folder writes it\n{said}",
                manifest.display()
            ));
        }
    }
    Ok(format!("{} lock files fit their manifests", manifests.len()))
}

//! Reads the assets that a command line names.

use btf_viewer::{SceneAsset, ViewerError};
use std::path::PathBuf;
use std::sync::Arc;

/// Loads packed assets, in the order of `paths`.
///
/// # Errors
/// The errors of [`SceneAsset::load`], for the first file that cannot be used.
pub(super) fn load_assets(paths: &[PathBuf]) -> Result<Vec<Arc<SceneAsset>>, ViewerError> {
    paths.iter().map(|path| SceneAsset::load(path).map(Arc::new)).collect()
}

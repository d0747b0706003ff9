//! The asset that stands in where none is given.

use crate::error::ViewerError;
use crate::scene::asset::SceneAsset;
use btf_capture::atomic::{create_folder, write_file_atomically};
use btf_runtime::pack;
use btf_runtime::testing::dense_asset;
use std::path::{Path, PathBuf};

/// Texels per side, and components, of the asset; and of a quick run's.
const DENSE: (usize, usize) = (256, 81);
const QUICK_DENSE: (usize, usize) = (32, 24);

/// Writes an asset of random content, as large as measured ones or small for a `quick` run, into `folder`, which is made
/// where it is missing. It has its levels, so that the steps' processes need not make them.
///
/// # Errors
/// [`ViewerError::Write`] where the folder takes no file.
pub fn write_stand_in_asset(folder: &Path, quick: bool) -> Result<PathBuf, ViewerError> {
    let (side, components) = if quick { QUICK_DENSE } else { DENSE };
    let name = format!("random-content-{side}x{side}-{components}");
    let path = folder.join(format!("{name}.spmm"));
    let asset = SceneAsset::new(name, dense_asset(1, side, components));
    let bytes = pack(&asset.file_form()?.whole).map_err(|source| ViewerError::Asset { path: path.clone(), source })?;
    create_folder(folder)?;
    write_file_atomically(&path, &bytes)?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stand_in_has_all_components_and_levels() {
        let folder = tempfile::tempdir().unwrap();
        let asset = SceneAsset::load(&write_stand_in_asset(&folder.path().join("new"), true).unwrap()).unwrap();
        assert_eq!((asset.most_components(), asset.head().width()), (24, 32));
        assert!(!asset.file_form().unwrap().asset.levels.is_empty());
    }
}

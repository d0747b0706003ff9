//! What a folder has that the window opens.

use super::files::is_known;
use crate::error::ViewerError;
use std::path::{Path, PathBuf};

/// A folder in a folder, or a file of a kind that the window opens.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Entry {
    /// Name without the folder.
    pub name: String,
    pub path: PathBuf,
    pub is_folder: bool,
}

/// Lists a folder: first its folders, then its files, each by name, without regard to case. Hidden ones are left out.
///
/// # Errors
/// [`ViewerError::Read`].
pub(crate) fn list(folder: &Path) -> Result<Vec<Entry>, ViewerError> {
    let read = std::fs::read_dir(folder).map_err(|source| ViewerError::Read { path: folder.into(), source })?;
    let entry = |path: PathBuf| {
        let name = path.file_name()?.to_string_lossy().into_owned();
        // Behind a link, what it leads to counts.
        let is_folder = path.is_dir();
        let is_shown = !name.starts_with('.') && (is_folder || is_known(&path));
        is_shown.then_some(Entry { name, path, is_folder })
    };
    let mut entries: Vec<Entry> = read.filter_map(|item| entry(item.ok()?.path())).collect();
    entries.sort_by_cached_key(|entry| (!entry.is_folder, entry.name.to_lowercase(), entry.name.clone()));
    Ok(entries)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_come_first_and_other_files_are_left_out() {
        let dir = tempfile::tempdir().unwrap();
        for folder in ["zeta", "Alpha", ".hidden"] {
            std::fs::create_dir(dir.path().join(folder)).unwrap();
        }
        for file in ["b.spmm", "A.GLB", "notes.txt", "noext", ".c.spmm", "sky.exr"] {
            std::fs::write(dir.path().join(file), "").unwrap();
        }
        let names: Vec<String> = list(dir.path()).unwrap().into_iter().map(|entry| entry.name).collect();
        assert_eq!(names, ["Alpha", "zeta", "A.GLB", "b.spmm", "sky.exr"]);
        let message = list(&dir.path().join("none")).unwrap_err().to_string();
        assert!(message.contains("none: cannot be read"), "{message}");
    }
}

//! Checks of the place where a result is to be written, before the work.

use std::path::{Path, PathBuf};

/// Returns a sentence where `path` cannot become an output: it is a folder, or it is or lies in one of `inputs`, which are
/// never written to.
pub fn output_fault(path: &Path, inputs: &[PathBuf]) -> Option<String> {
    if path.is_dir() {
        return Some(format!("{} is a folder; give the name of a file in it", path.display()));
    }
    let real = real_path(path);
    for input in inputs {
        let real_input = std::fs::canonicalize(input).unwrap_or_else(|_| input.clone());
        if real == real_input {
            return Some(format!(
                "{} is an input and would be overwritten; give another name for the output",
                path.display()
            ));
        }
        if real_input.is_dir() && real.starts_with(&real_input) {
            return Some(format!(
                "{} lies in the input folder {}; write it elsewhere, inputs are never written to",
                path.display(),
                input.display()
            ));
        }
    }
    None
}

/// Returns the path with its folder resolved; the file itself need not exist.
pub fn real_path(path: &Path) -> PathBuf {
    if let Ok(real) = std::fs::canonicalize(path) {
        return real;
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match (std::fs::canonicalize(folder), path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => path.to_path_buf(),
    }
}

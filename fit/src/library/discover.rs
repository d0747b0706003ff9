//! Finds the captures below a folder, without reading their images.

use crate::error::FitError;
use glob::Pattern;
use std::fs;
use std::path::{Path, PathBuf};

/// Deepest folder nesting that is searched.
const MAX_DEPTH: usize = 12;
/// Names of a capture's own files.
const MANIFEST: &str = "capture.toml";

/// Returns the captures below `folder`, sorted: folders that hold images or a `capture.toml`, archives, UBO2014 files. A
/// folder within a capture is part of it. With `globs` only those whose path below `folder` matches one of them.
///
/// # Errors
/// [`FitError::File`] if a folder cannot be listed; [`FitError::Params`] for what is no glob.
pub fn discover_captures(folder: &Path, globs: &[String]) -> Result<Vec<PathBuf>, FitError> {
    let patterns: Result<Vec<Pattern>, FitError> = globs.iter().map(|text| glob_from_text(text)).collect();
    let patterns = patterns?;
    let mut found = Vec::new();
    search(folder, Path::new(""), 0, &mut found)?;
    found.retain(|path| patterns.is_empty() || patterns.iter().any(|glob| glob.matches_path(path)));
    found.sort();
    Ok(found)
}

/// Reads a glob of the command line.
///
/// # Errors
/// [`FitError::Params`], one sentence.
pub fn glob_from_text(text: &str) -> Result<Pattern, FitError> {
    Pattern::new(text)
        .map_err(|error| FitError::Params(format!("`{text}` is no glob: {error}; write it as in leather*")))
}

/// Adds the captures in `root/below`, as paths below `root`.
fn search(root: &Path, below: &Path, depth: usize, found: &mut Vec<PathBuf>) -> Result<(), FitError> {
    let folder = root.join(below);
    let failed = |source| FitError::File {
        path: folder.clone(),
        action: "listing the folder",
        source,
        remedy: "give a folder of captures that can be read",
    };
    let (mut folders, mut files) = (Vec::new(), Vec::new());
    for entry in fs::read_dir(&folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with('.') {
            continue;
        }
        // Links are followed, as a capture's reader does.
        match fs::metadata(entry.path()) {
            Ok(meta) if meta.is_dir() => folders.push(name),
            Ok(_) => files.push(name),
            Err(_) => {}
        }
    }
    if depth > 0 && is_capture(&folders, &files) {
        found.push(below.to_path_buf());
        return Ok(());
    }
    found.extend(files.iter().filter(|name| is_capture_file(name)).map(|name| below.join(name)));
    if depth < MAX_DEPTH {
        folders.sort();
        for name in folders {
            search(root, &below.join(name), depth + 1, found)?;
        }
    }
    Ok(())
}

/// Tells whether a folder with these folders and files is a capture.
fn is_capture(folders: &[String], files: &[String]) -> bool {
    files.iter().any(|name| name == MANIFEST || is_image_of_a_pair(name))
        || folders.iter().any(|name| is_view_folder(name))
}

/// Tells whether a folder is that of a view in Bonn's layout, as `tv000_pv000`.
fn is_view_folder(name: &str) -> bool {
    let numbers = |part: &str, head: &str| {
        part.strip_prefix(head)
            .is_some_and(|rest| !rest.is_empty() && rest.chars().all(|c| c.is_ascii_digit() || c == '.'))
    };
    name.split_once('_').is_some_and(|(theta, phi)| numbers(theta, "tv") && numbers(phi, "pv"))
}

/// Tells whether a file is an image whose name has the angles of a light and a view.
fn is_image_of_a_pair(name: &str) -> bool {
    let has = |head: &str| name.split([' ', '_']).any(|part| part.strip_prefix(head).is_some_and(starts_with_digit));
    has("tl") && has("pl") && has("tv") && has("pv")
}

fn starts_with_digit(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_digit())
}

/// Tells whether a file may be a capture of its own: an archive or a UBO2014 file.
fn is_capture_file(name: &str) -> bool {
    let extension = Path::new(name).extension().unwrap_or_default();
    extension.eq_ignore_ascii_case("zip") || extension.eq_ignore_ascii_case("btf")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn captures_of_every_kind_are_found_and_folders_inside_them_are_not() {
        let root = tempfile::tempdir().unwrap();
        let touch = |path: &str| {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, b"").unwrap();
        };
        touch("cloth/wool/tv000_pv000/00001 tl000 pl000 tv000 pv000.jpg");
        touch("cloth/list/capture.toml");
        touch("cloth/list/more/capture.toml");
        touch("flat/00001 tl000 pl000 tv000 pv000.png");
        touch("zips/red.zip");
        touch("zips/blue.BTF");
        touch("notes/readme.txt");
        touch("notes/tvs_pvc/a.txt");
        touch(".hidden/capture.toml");
        let found = |globs: &[&str]| {
            let globs: Vec<String> = globs.iter().map(|glob| glob.to_string()).collect();
            discover_captures(root.path(), &globs).unwrap()
        };
        assert_eq!(
            found(&[]),
            ["cloth/list", "cloth/wool", "flat", "zips/blue.BTF", "zips/red.zip"].map(PathBuf::from)
        );
        assert_eq!(found(&["cloth/*", "*.zip"]), ["cloth/list", "cloth/wool", "zips/red.zip"].map(PathBuf::from));
        assert!(glob_from_text("[").unwrap_err().to_string().contains("no glob"));
        assert!(discover_captures(&root.path().join("gone"), &[]).unwrap_err().to_string().contains("gone"));
    }
}

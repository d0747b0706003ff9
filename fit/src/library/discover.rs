//! Finds the captures below a folder, without reading their images.

use crate::error::FitError;
use crate::output_path::real_path;
use glob::Pattern;
use std::collections::BTreeSet;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Deepest folder nesting that is searched.
const MAX_DEPTH: usize = 12;
/// Name of the file that describes a capture.
const MANIFEST: &str = "capture.toml";
/// Bytes of a table in which its heading is looked for.
const MAX_HEADING_BYTES: usize = 4096;

/// Returns the captures below `folder`, sorted: folders that hold images, a list of images or a `capture.toml`, archives,
/// UBO2014 files. A folder within a capture is part of it. With `globs` only those whose path below `folder` matches one of
/// them.
///
/// # Errors
/// [`FitError::File`] if a folder cannot be listed; [`FitError::Params`] for what is no glob, and for a folder that is a
/// capture itself.
pub fn discover_captures(folder: &Path, globs: &[String]) -> Result<Vec<PathBuf>, FitError> {
    let patterns: Result<Vec<Pattern>, FitError> = globs.iter().map(|text| glob_from_text(text)).collect();
    let patterns = patterns?;
    let mut found = Vec::new();
    let mut search = Search { root: folder, seen: BTreeSet::new(), found: &mut found };
    search.below(Path::new(""), 0)?;
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

/// A search for captures.
struct Search<'a> {
    root: &'a Path,
    /// Real paths of the folders that were listed: links may lead in a circle.
    seen: BTreeSet<PathBuf>,
    /// The captures, as paths below the root.
    found: &'a mut Vec<PathBuf>,
}

impl Search<'_> {
    /// Adds the captures in the folder `below` the root.
    fn below(&mut self, below: &Path, depth: usize) -> Result<(), FitError> {
        let folder = self.root.join(below);
        let failed = |source| FitError::File {
            path: folder.clone(),
            action: "listing the folder",
            source,
            remedy: "give a folder of captures that can be read",
        };
        if !self.seen.insert(real_path(&folder)) {
            return Ok(());
        }
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
        if is_capture(&folder, &folders, &files) {
            if depth == 0 {
                let shown = folder.display();
                return Err(FitError::Params(format!("{shown} is a capture itself; give the folder above it")));
            }
            self.found.push(below.to_path_buf());
            return Ok(());
        }
        self.found.extend(files.iter().filter(|name| is_capture_file(name)).map(|name| below.join(name)));
        if depth < MAX_DEPTH {
            folders.sort();
            for name in folders {
                self.below(&below.join(name), depth + 1)?;
            }
        }
        Ok(())
    }
}

/// Tells whether a folder with these folders and files is a capture.
fn is_capture(folder: &Path, folders: &[String], files: &[String]) -> bool {
    files.iter().any(|name| name == MANIFEST || is_image_of_a_pair(name) || is_list(&folder.join(name)))
        || folders.iter().any(|name| is_view_folder(name))
}

/// Tells whether a file is a table whose first line has the columns of a list of images.
fn is_list(path: &Path) -> bool {
    if !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
        return false;
    }
    let mut heading = vec![0; MAX_HEADING_BYTES];
    let Ok(length) = fs::File::open(path).and_then(|mut file| file.read(&mut heading)) else { return false };
    let text = String::from_utf8_lossy(&heading[..length]).into_owned();
    let line = text.lines().find(|line| !line.trim().is_empty() && !line.starts_with('#')).unwrap_or_default();
    let columns: Vec<&str> = line.split([',', ';', '\t']).map(|column| column.trim().trim_matches('"')).collect();
    columns.contains(&"file") && ["theta_v", "x_v"].iter().any(|column| columns.contains(column))
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
        touch("notes/prices.csv");
        touch("rig/shots/1.png");
        fs::write(root.path().join("rig/list.csv"), "# a rig\nfile; theta_v; phi_v; theta_l; phi_l\n").unwrap();
        touch("notes/tvs_pvc/a.txt");
        touch(".hidden/capture.toml");
        let found = |globs: &[&str]| {
            let globs: Vec<String> = globs.iter().map(|glob| glob.to_string()).collect();
            discover_captures(root.path(), &globs).unwrap()
        };
        assert_eq!(
            found(&[]),
            ["cloth/list", "cloth/wool", "flat", "rig", "zips/blue.BTF", "zips/red.zip"].map(PathBuf::from)
        );
        assert_eq!(found(&["cloth/*", "*.zip"]), ["cloth/list", "cloth/wool", "zips/red.zip"].map(PathBuf::from));
        let itself = discover_captures(&root.path().join("cloth/wool"), &[]).unwrap_err().to_string();
        assert!(itself.contains("the folder above"), "{itself}");
        assert!(glob_from_text("[").unwrap_err().to_string().contains("no glob"));
        assert!(discover_captures(&root.path().join("gone"), &[]).unwrap_err().to_string().contains("gone"));
    }
}

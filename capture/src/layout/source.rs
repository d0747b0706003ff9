//! Finds a capture's image files, in a folder or in a zip archive that is read in place.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};

use zip::ZipArchive;

use crate::error::CaptureError;
use crate::shared_bytes::SharedBytes;

/// Largest file or zip entry that is read, in bytes. A float EXR of the largest allowed image would be larger, but no
/// known capture comes near.
pub(crate) const MAX_FILE_BYTES: u64 = 256 << 20;

/// Largest ratio by which a zip entry above [`RATIO_FREE_BYTES`] may claim to inflate. Deflate reaches 1032; images
/// that are worth packing stay below 20.
const MAX_INFLATION: u64 = 200;

/// Size in bytes up to which a zip entry may inflate by any ratio, as a black image does.
const RATIO_FREE_BYTES: u64 = 16 << 20;

/// Deepest folder nesting that is searched.
const MAX_DEPTH: usize = 8;

/// Files of a capture. A source is shared between threads, and reading takes no lock.
#[derive(Debug)]
pub(crate) struct Source {
    root: PathBuf,
    kind: Kind,
    /// Path of each file below the root, with `/` between its parts, sorted.
    names: Vec<String>,
}

#[derive(Debug)]
enum Kind {
    Folder,
    Zip {
        archive: ZipArchive<Cursor<SharedBytes>>,
        /// Index of the entry of each name.
        entries: Vec<usize>,
    },
}

impl Source {
    /// Lists the files of the folder or zip at `path`.
    pub(crate) fn open(path: &Path) -> Result<Source, CaptureError> {
        let meta = fs::metadata(path).map_err(|source| CaptureError::read(path, source))?;
        if meta.is_dir() {
            let mut names = Vec::new();
            list_folder(path, "", 0, &mut names)?;
            names.sort();
            Ok(Source { root: path.into(), kind: Kind::Folder, names })
        } else {
            Source::open_zip(path)
        }
    }

    fn open_zip(path: &Path) -> Result<Source, CaptureError> {
        let shown = path.display().to_string();
        let not_a_zip = |reason: String| CaptureError::NotAnArchive { path: shown.clone(), reason };
        let bytes = SharedBytes::map(path)?.ok_or_else(|| not_a_zip("it is an empty file".into()))?;
        let archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| not_a_zip(one_line(&error)))?;
        if archive.has_duplicate_names() {
            return Err(not_a_zip("two of its entries have one name".into()));
        }
        let mut entries = Vec::with_capacity(archive.len());
        for index in 0..archive.len() {
            let entry = archive.by_index_data(index).map_err(|error| not_a_zip(one_line(&error)))?;
            let name = entry.name().map_err(|error| not_a_zip(one_line(&error)))?.into_owned();
            let Some(safe) = safe_name(&name) else {
                return Err(CaptureError::UnsafeEntry { archive: shown, entry: name.escape_debug().to_string() });
            };
            if entry.is_file() && !is_system_file(&safe) {
                entries.push((safe, index));
            }
        }
        entries.sort();
        if let Some(pair) = entries.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return Err(not_a_zip(format!("two of its entries are named {}", pair[0].0)));
        }
        let (names, entries) = entries.into_iter().unzip();
        Ok(Source { root: path.into(), kind: Kind::Zip { archive, entries }, names })
    }

    pub(crate) fn root(&self) -> &Path {
        &self.root
    }

    /// Returns the path of the archive that holds the files; `None` for a folder.
    pub(crate) fn archive(&self) -> Option<&Path> {
        match self.kind {
            Kind::Folder => None,
            Kind::Zip { .. } => Some(&self.root),
        }
    }

    pub(crate) fn names(&self) -> &[String] {
        &self.names
    }

    /// Returns the path of file `index` for messages.
    pub(crate) fn shown(&self, index: usize) -> String {
        self.shown_name(&self.names[index])
    }

    /// Returns the path of a name below the root for messages.
    pub(crate) fn shown_name(&self, name: &str) -> String {
        match self.kind {
            Kind::Folder => self.root.join(name).display().to_string(),
            Kind::Zip { .. } => format!("{}: {name}", self.root.display()),
        }
    }

    /// Reads file `index` whole, at most `limit` bytes.
    pub(crate) fn read(&self, index: usize, limit: u64) -> Result<Vec<u8>, CaptureError> {
        let limit = limit.min(MAX_FILE_BYTES);
        let too_large = |claim: String| CaptureError::TooLarge { path: self.shown(index), claim };
        match &self.kind {
            Kind::Folder => {
                let path = self.root.join(&self.names[index]);
                let failed = |source| CaptureError::read(&path, source);
                let mut file = File::open(&path).map_err(failed)?;
                let size = file.metadata().map_err(failed)?.len();
                if size > limit {
                    return Err(too_large(format!("has {size} bytes")));
                }
                let mut bytes = Vec::with_capacity(size as usize);
                file.read_to_end(&mut bytes).map_err(failed)?;
                Ok(bytes)
            }
            Kind::Zip { archive, entries } => {
                let damaged = |reason: String| CaptureError::BadImage { path: self.shown(index), reason };
                // A clone shares the map and the table of contents, so each call has a reader of
                // its own.
                let mut archive = archive.clone();
                let entry = archive.by_index(entries[index]).map_err(|error| damaged(one_line(&error)))?;
                let (size, packed) = (entry.size(), entry.compressed_size());
                if size > limit {
                    return Err(too_large(format!("claims {size} bytes")));
                }
                if size > RATIO_FREE_BYTES && size / MAX_INFLATION > packed {
                    return Err(too_large(format!("claims to inflate from {packed} to {size} bytes")));
                }
                let mut bytes = Vec::with_capacity(size as usize);
                // The claim may be a lie: stop one byte behind it.
                entry.take(size + 1).read_to_end(&mut bytes).map_err(|error| damaged(one_line(&error)))?;
                if bytes.len() as u64 > size {
                    return Err(too_large(format!("inflates beyond the {size} bytes it claims")));
                }
                if (bytes.len() as u64) < size {
                    return Err(damaged(format!("it has {} of the {size} bytes it claims", bytes.len())));
                }
                Ok(bytes)
            }
        }
    }
}

fn list_folder(folder: &Path, prefix: &str, depth: usize, names: &mut Vec<String>) -> Result<(), CaptureError> {
    if depth > MAX_DEPTH {
        return Ok(());
    }
    let failed = |source| CaptureError::read(folder, source);
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        // A name that is not Unicode cannot be a capture's.
        let Ok(name) = entry.file_name().into_string() else { continue };
        let name = format!("{prefix}{name}");
        if is_system_file(&name) {
            continue;
        }
        let mut kind = entry.file_type().map_err(failed)?;
        if kind.is_symlink() {
            // Follow links to files and folders; the depth bounds a loop. A dangling one is no file.
            let Ok(meta) = fs::metadata(entry.path()) else { continue };
            kind = meta.file_type();
        }
        if kind.is_dir() {
            list_folder(&entry.path(), &format!("{name}/"), depth + 1, names)?;
        } else if kind.is_file() {
            names.push(name);
        }
    }
    Ok(())
}

/// Returns the name with `/` between its parts, or `None` if it leads out of the archive: absolute, with a drive, with
/// a part `..`, or with a NUL. Backslashes count as separators, as on Windows.
pub(crate) fn safe_name(name: &str) -> Option<String> {
    let name = name.replace('\\', "/");
    let bytes = name.as_bytes();
    let has_drive = bytes.len() >= 2 && bytes[0].is_ascii_alphabetic() && bytes[1] == b':';
    if name.starts_with('/') || has_drive || name.contains('\0') {
        return None;
    }
    let parts: Vec<&str> = name.split('/').filter(|part| !part.is_empty() && *part != ".").collect();
    if parts.contains(&"..") { None } else { Some(parts.join("/")) }
}

/// Returns whether a file was left by an operating system: hidden files and the resource forks of macOS.
fn is_system_file(name: &str) -> bool {
    name.split('/').any(|part| part.starts_with('.') || part == "__MACOSX")
}

fn one_line(error: &dyn std::fmt::Display) -> String {
    let text = error.to_string();
    text.split_whitespace().collect::<Vec<_>>().join(" ").trim_end_matches('.').to_string()
}

/// Returns the folders that hold `names`, to tell a flat capture from a nested one.
pub(crate) fn folders_of<'a>(names: impl Iterator<Item = &'a str>) -> BTreeSet<&'a str> {
    names.map(|name| name.rsplit_once('/').map_or("", |(folder, _)| folder)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_lead_out_of_an_archive_are_seen() {
        for name in [
            "../a.png",
            "a/../../b.png",
            "/a.png",
            "\\a.png",
            "C:\\a.png",
            "c:a.png",
            "..\\a.png",
            "a\\..\\..\\b",
            "a\0b",
        ] {
            assert_eq!(safe_name(name), None, "{name:?}");
        }
        assert_eq!(safe_name("a\\b.png").as_deref(), Some("a/b.png"));
        assert_eq!(safe_name("./a//b..c.png").as_deref(), Some("a/b..c.png"));
    }
}

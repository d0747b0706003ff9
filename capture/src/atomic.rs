//! Files and folders that appear whole or not at all: written beside their place, synced, renamed.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use crate::error::CaptureError;

/// Writes `bytes` to `path`, replacing what was there in one step: readers see the old file or
/// the new one, and a failure leaves the old one.
///
/// # Errors
/// [`CaptureError::Write`]; nothing half-written remains.
pub fn write_file_atomically(path: impl AsRef<Path>, bytes: &[u8]) -> Result<(), CaptureError> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(bytes).map_err(|source| CaptureError::write(&file.path, source))?;
    file.commit()
}

/// A file being written beside its final path. [`AtomicFile::commit`] puts it in place; dropped
/// without that, it is removed and the final path is untouched.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    temporary: PathBuf,
    file: Option<File>,
}

impl AtomicFile {
    /// Starts a new file that will become `path`.
    ///
    /// # Errors
    /// [`CaptureError::Write`] if the folder of `path` does not take a new file.
    pub fn create(path: impl AsRef<Path>) -> Result<AtomicFile, CaptureError> {
        let path = path.as_ref();
        let temporary = temporary_sibling(path)?;
        let file = OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&temporary)
            .map_err(|source| CaptureError::write(path, source))?;
        Ok(AtomicFile { path: path.into(), temporary, file: Some(file) })
    }

    /// Syncs the file to disk and renames it to its final path.
    ///
    /// # Errors
    /// [`CaptureError::Write`]; the final path is then untouched.
    pub fn commit(mut self) -> Result<(), CaptureError> {
        let done = self.file.take().map_or(Ok(()), |file| file.sync_all());
        let done = done.and_then(|()| fs::rename(&self.temporary, &self.path));
        done.map_err(|source| {
            // The drop below finds no open file any more, so clean up here.
            let _ = fs::remove_file(&self.temporary);
            CaptureError::write(&self.path, source)
        })?;
        sync_folder(parent_of(&self.path));
        Ok(())
    }

    fn open_file(&mut self) -> io::Result<&mut File> {
        self.file.as_mut().ok_or_else(|| io::Error::other("the file is closed"))
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.open_file()?.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.open_file()?.flush()
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if self.file.take().is_some() {
            // Nothing can be done about a failure here, and the final path is untouched.
            let _ = fs::remove_file(&self.temporary);
        }
    }
}

/// A name beside `path` that no other file has and no reader of captures takes for an image.
pub(crate) fn temporary_sibling(path: &Path) -> Result<PathBuf, CaptureError> {
    static COUNTER: AtomicU64 = AtomicU64::new(0);
    let name = path
        .file_name()
        .ok_or_else(|| CaptureError::write(path, io::Error::new(io::ErrorKind::InvalidInput, "it has no file name")))?;
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".partial-{}-{}", std::process::id(), COUNTER.fetch_add(1, Ordering::Relaxed)));
    Ok(parent_of(path).join(hidden))
}

/// The folder that holds `path`, `.` for a bare name.
pub(crate) fn parent_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Makes renames in `folder` durable where the operating system lets a folder be synced; elsewhere
/// the file's own sync has to do, so failures are passed over.
pub(crate) fn sync_folder(folder: &Path) {
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(dir: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_committed_file_replaces_the_old_one_and_leaves_nothing_beside_it() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.bin");
        write_file_atomically(&path, b"old").unwrap();
        write_file_atomically(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names(dir.path()), ["a.bin"]);
    }

    #[test]
    fn a_dropped_file_leaves_the_old_one() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.bin");
        write_file_atomically(&path, b"old").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"half of the ne").unwrap();
        assert_eq!(names(dir.path()).len(), 2, "the temporary file is beside it");
        drop(file);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(dir.path()), ["a.bin"]);
    }

    #[test]
    fn a_failed_rename_leaves_nothing_behind() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("taken");
        fs::create_dir(&path).unwrap();
        fs::write(path.join("inside"), b"x").unwrap();
        assert!(write_file_atomically(&path, b"new").is_err());
        assert_eq!(names(dir.path()), ["taken"]);
        let message = write_file_atomically(dir.path().join("no/such/a.bin"), b"").unwrap_err().to_string();
        assert!(message.contains("a.bin"), "{message}");
    }
}

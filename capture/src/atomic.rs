//! Writes files and folders that appear whole or not at all: they are written beside their place, synced and renamed.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use crate::error::CaptureError;

/// Creates the folder `path` and its missing parents.
///
/// # Errors
/// [`CaptureError::Write`] with the path of the folder.
pub fn create_folder(path: impl AsRef<Path>) -> Result<(), CaptureError> {
    fs::create_dir_all(path.as_ref()).map_err(|source| CaptureError::write(path.as_ref(), source))
}

/// Writes `bytes` to `path` and replaces an existing file in one step: readers see the old file or the new one, and a
/// failure leaves the old one.
///
/// # Errors
/// [`CaptureError::Write`]; nothing half-written remains.
#[cfg(not(target_arch = "wasm32"))]
pub fn write_file_atomically(path: impl AsRef<Path>, bytes: &[u8]) -> Result<(), CaptureError> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(bytes).map_err(|source| CaptureError::write(&file.path, source))?;
    file.commit()
}

/// Hands `bytes` to the page as a file of the name `path`.
///
/// # Errors
/// None.
#[cfg(target_arch = "wasm32")]
pub fn write_file_atomically(path: impl AsRef<Path>, bytes: &[u8]) -> Result<(), CaptureError> {
    crate::files::write(path, bytes);
    Ok(())
}

/// A file that is written beside its final path. [`AtomicFile::commit`] renames it to that path; a file that is dropped
/// before is removed, and the final path is untouched.
///
/// A symbolic link stays a link: the file that it leads to is replaced. A device or a pipe (`/dev/null`, `/dev/stdout`)
/// is written to directly, because a rename would put a file in its place.
#[derive(Debug)]
pub struct AtomicFile {
    /// Final path of the file, with links followed.
    path: PathBuf,
    /// Path of the file while it is written; none for a device or a pipe.
    temporary: Option<PathBuf>,
    file: Option<File>,
}

impl AtomicFile {
    /// Starts a new file that will become `path`.
    ///
    /// # Errors
    /// [`CaptureError::Write`] if the folder of `path` does not take a new file.
    pub fn create(path: impl AsRef<Path>) -> Result<AtomicFile, CaptureError> {
        let path = path.as_ref();
        let failed = |source| CaptureError::write(path, source);
        let mut options = OpenOptions::new();
        options.write(true);
        if fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
            let file = options.open(path).map_err(failed)?;
            return Ok(AtomicFile { path: path.into(), temporary: None, file: Some(file) });
        }
        // A link that leads nowhere is replaced like a file.
        let linked = path.is_symlink().then(|| fs::canonicalize(path).ok()).flatten();
        let path = linked.unwrap_or_else(|| path.into());
        let temporary = temporary_sibling(&path)?;
        let file = options.create_new(true).open(&temporary).map_err(failed)?;
        Ok(AtomicFile { path, temporary: Some(temporary), file: Some(file) })
    }

    /// Syncs the file to disk and renames it to its final path.
    ///
    /// # Errors
    /// [`CaptureError::Write`]; the final path is then untouched.
    pub fn commit(mut self) -> Result<(), CaptureError> {
        let Some(temporary) = &self.temporary else {
            return self.open_file().and_then(File::flush).map_err(|source| CaptureError::write(&self.path, source));
        };
        let done = self.file.take().map_or(Ok(()), |file| file.sync_all());
        let done = done.and_then(|()| fs::rename(temporary, &self.path));
        done.map_err(|source| {
            // The drop below finds no open file any more, so clean up here.
            let _ = fs::remove_file(temporary);
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
        if let (Some(_), Some(temporary)) = (self.file.take(), &self.temporary) {
            // Nothing can be done about a failure here, and the final path is untouched.
            let _ = fs::remove_file(temporary);
        }
    }
}

/// A folder that is filled beside its final path. [`StagedFolder::commit`] renames it to that path; a folder that is
/// dropped before is removed, and the final path is untouched.
#[derive(Debug)]
pub struct StagedFolder {
    path: PathBuf,
    target: PathBuf,
    kept: bool,
}

impl StagedFolder {
    /// Starts a folder that will become `target`, which must not exist or be empty; missing parent folders are made.
    pub fn create(target: &Path) -> Result<StagedFolder, CaptureError> {
        refuse_non_empty(target)?;
        let failed = |source| CaptureError::write(target, source);
        fs::create_dir_all(parent_of(target)).map_err(failed)?;
        let path = temporary_sibling(target)?;
        fs::create_dir(&path).map_err(failed)?;
        Ok(StagedFolder { path, target: target.into(), kept: false })
    }

    /// Returns the path of the folder while it is filled.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Renames the folder to its final path. Whoever wrote its files must have synced them.
    pub fn commit(mut self) -> Result<(), CaptureError> {
        let failed = |source| CaptureError::write(&self.target, source);
        sync_folder(&self.path);
        refuse_non_empty(&self.target)?;
        if self.target.exists() {
            // Renaming onto an empty folder is not possible everywhere.
            fs::remove_dir(&self.target).map_err(failed)?;
        }
        fs::rename(&self.path, &self.target).map_err(failed)?;
        self.kept = true;
        sync_folder(parent_of(&self.target));
        Ok(())
    }
}

impl Drop for StagedFolder {
    fn drop(&mut self) {
        if !self.kept {
            // Nothing can be done about a failure here.
            let _ = fs::remove_dir_all(&self.path);
        }
    }
}

fn refuse_non_empty(dir: &Path) -> Result<(), CaptureError> {
    match fs::read_dir(dir) {
        Ok(mut entries) => match entries.next() {
            None => Ok(()),
            Some(_) => Err(CaptureError::OutputNotEmpty { path: dir.into() }),
        },
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) if error.kind() == io::ErrorKind::NotADirectory => {
            Err(CaptureError::OutputNotEmpty { path: dir.into() })
        }
        Err(source) => Err(CaptureError::write(dir, source)),
    }
}

/// Returns a path beside `path` that no other file has and that no reader of captures takes for an image.
pub fn temporary_sibling(path: &Path) -> Result<PathBuf, CaptureError> {
    static COUNTER: AtomicU64 = AtomicU64::new(0);
    let name = path
        .file_name()
        .ok_or_else(|| CaptureError::write(path, io::Error::new(io::ErrorKind::InvalidInput, "it has no file name")))?;
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".partial-{}-{}", std::process::id(), COUNTER.fetch_add(1, Ordering::Relaxed)));
    Ok(parent_of(path).join(hidden))
}

/// Returns the folder that holds `path`; `.` for a bare name.
pub fn parent_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Makes renames in `folder` durable where the operating system can sync a folder. Elsewhere the sync of the file
/// itself has to do, so failures are ignored.
pub fn sync_folder(folder: &Path) {
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

    /// Uses a socket in place of every device: a rename may replace no device, and a failing test on `/dev/null` would
    /// take that device from the machine that it runs on.
    #[test]
    #[cfg(unix)]
    fn a_device_is_never_replaced_by_a_file() {
        use std::os::unix::fs::FileTypeExt;
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("device");
        let _listener = std::os::unix::net::UnixListener::bind(&path).unwrap();
        let message = write_file_atomically(&path, b"new").unwrap_err().to_string();
        assert!(message.contains("device"), "{message}");
        assert!(fs::symlink_metadata(&path).unwrap().file_type().is_socket());
        assert_eq!(names(dir.path()), ["device"]);
    }

    #[test]
    #[cfg(unix)]
    fn a_link_stays_one_and_its_file_is_replaced() {
        let dir = tempfile::tempdir().unwrap();
        let (path, link) = (dir.path().join("a.bin"), dir.path().join("link"));
        fs::write(&path, b"old").unwrap();
        std::os::unix::fs::symlink("a.bin", &link).unwrap();
        write_file_atomically(&link, b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names(dir.path()), ["a.bin", "link"]);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_pipe_takes_what_is_written() {
        use std::io::Read;
        use std::os::fd::AsRawFd;
        let (mut reader, writer) = io::pipe().unwrap();
        write_file_atomically(format!("/proc/self/fd/{}", writer.as_raw_fd()), b"through").unwrap();
        drop(writer);
        let mut seen = Vec::new();
        reader.read_to_end(&mut seen).unwrap();
        assert_eq!(seen, b"through");
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

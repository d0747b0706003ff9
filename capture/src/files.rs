//! Files by their paths: those of the system; in a browser, which has none, those that the page has handed over, and what
//! is written waits there until the page takes it.

#[cfg(target_arch = "wasm32")]
pub use page::{exists, hand_over, length, list, open, read, read_range, shared, take_written, write};
#[cfg(not(target_arch = "wasm32"))]
pub use system::{exists, length, list, open, read, read_range};

use std::io;
use std::path::Path;

/// Reads a text file whole.
///
/// # Errors
/// Those of [`read`]; [`io::ErrorKind::InvalidData`] where it is no UTF-8.
pub fn read_to_string(path: impl AsRef<Path>) -> io::Result<String> {
    String::from_utf8(read(path)?).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))
}

#[cfg(not(target_arch = "wasm32"))]
mod system {
    use std::fs::File;
    use std::io::{self, Read, Seek};
    use std::ops::Range;
    use std::path::{Path, PathBuf};

    /// Opens a file for reading.
    ///
    /// # Errors
    /// Those of [`File::open`].
    pub fn open(path: impl AsRef<Path>) -> io::Result<File> {
        File::open(path)
    }

    /// Lists the files and folders in a folder, as far as they can be read, in no order.
    ///
    /// # Errors
    /// Those of [`std::fs::read_dir`].
    pub fn list(folder: impl AsRef<Path>) -> io::Result<Vec<PathBuf>> {
        Ok(std::fs::read_dir(folder)?.flatten().map(|entry| entry.path()).collect())
    }

    /// Reads a file whole.
    ///
    /// # Errors
    /// Those of [`std::fs::read`].
    pub fn read(path: impl AsRef<Path>) -> io::Result<Vec<u8>> {
        std::fs::read(path)
    }

    /// Returns the length of a file in bytes.
    ///
    /// # Errors
    /// Those of [`std::fs::metadata`].
    pub fn length(path: impl AsRef<Path>) -> io::Result<u64> {
        Ok(std::fs::metadata(path)?.len())
    }

    /// Reads a part of a file: the bytes of a range, fewer where the file ends before. Takes memory for what is read
    /// only.
    ///
    /// # Errors
    /// Those of [`File::open`] and of reading.
    pub fn read_range(path: impl AsRef<Path>, range: Range<u64>) -> io::Result<Vec<u8>> {
        let mut file = open(path)?;
        file.seek(io::SeekFrom::Start(range.start))?;
        let mut bytes = Vec::new();
        file.take(range.end.saturating_sub(range.start)).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    /// Tells whether there is a file or folder of this path.
    pub fn exists(path: impl AsRef<Path>) -> bool {
        path.as_ref().exists()
    }
}

#[cfg(target_arch = "wasm32")]
mod page {
    use std::collections::BTreeMap;
    use std::io;
    use std::ops::Range;
    use std::path::{Component, Path, PathBuf};
    use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

    /// The files by their paths.
    static FILES: Mutex<BTreeMap<PathBuf, Arc<Vec<u8>>>> = Mutex::new(BTreeMap::new());
    /// What was written and the page has not taken yet.
    static WRITTEN: Mutex<Vec<(PathBuf, Arc<Vec<u8>>)>> = Mutex::new(Vec::new());

    fn files() -> MutexGuard<'static, BTreeMap<PathBuf, Arc<Vec<u8>>>> {
        FILES.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn written() -> MutexGuard<'static, Vec<(PathBuf, Arc<Vec<u8>>)>> {
        WRITTEN.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns a path without `.`, and without `..` as far as something stands before it.
    fn plain(path: &Path) -> PathBuf {
        let mut plain = PathBuf::new();
        for component in path.components() {
            match component {
                Component::CurDir => {}
                Component::ParentDir if plain.file_name().is_some() => drop(plain.pop()),
                other => plain.push(other),
            }
        }
        plain
    }

    /// Keeps a file for those who read it, in place of an earlier one of the same path.
    pub fn hand_over(path: impl AsRef<Path>, bytes: Vec<u8>) {
        files().insert(plain(path.as_ref()), Arc::new(bytes));
    }

    /// Returns a file without copying it.
    ///
    /// # Errors
    /// [`io::ErrorKind::NotFound`] where the page has not handed it over.
    pub fn shared(path: impl AsRef<Path>) -> io::Result<Arc<Vec<u8>>> {
        let missing = || io::Error::new(io::ErrorKind::NotFound, "the page has no such file; drop it with the others");
        files().get(&plain(path.as_ref())).cloned().ok_or_else(missing)
    }

    /// Reads a file whole.
    ///
    /// # Errors
    /// Those of [`shared`].
    pub fn read(path: impl AsRef<Path>) -> io::Result<Vec<u8>> {
        Ok(shared(path)?.to_vec())
    }

    /// Opens a file for reading.
    ///
    /// # Errors
    /// Those of [`shared`].
    pub fn open(path: impl AsRef<Path>) -> io::Result<io::Cursor<Vec<u8>>> {
        read(path).map(io::Cursor::new)
    }

    /// Returns the length of a file in bytes.
    ///
    /// # Errors
    /// Those of [`shared`].
    pub fn length(path: impl AsRef<Path>) -> io::Result<u64> {
        Ok(shared(path)?.len() as u64)
    }

    /// Reads a part of a file: the bytes of a range, fewer where the file ends before.
    ///
    /// # Errors
    /// Those of [`shared`].
    pub fn read_range(path: impl AsRef<Path>, range: Range<u64>) -> io::Result<Vec<u8>> {
        let bytes = shared(path)?;
        let [start, end] = [range.start, range.end].map(|at| at.min(bytes.len() as u64) as usize);
        Ok(bytes.get(start..end).unwrap_or_default().to_vec())
    }

    /// Lists the files in a folder, in order.
    ///
    /// # Errors
    /// [`io::ErrorKind::NotFound`] where there is none in it.
    pub fn list(folder: impl AsRef<Path>) -> io::Result<Vec<PathBuf>> {
        let folder = plain(folder.as_ref());
        let files: Vec<PathBuf> = files().keys().filter(|path| path.parent() == Some(&folder)).cloned().collect();
        match files.is_empty() {
            true => Err(io::Error::new(io::ErrorKind::NotFound, "the page has no such folder; drop it with the file")),
            false => Ok(files),
        }
    }

    /// Tells whether the page has handed over a file of this path.
    pub fn exists(path: impl AsRef<Path>) -> bool {
        files().contains_key(&plain(path.as_ref()))
    }

    /// Writes a file: it can be read again, and the page can take it.
    pub fn write(path: impl AsRef<Path>, bytes: &[u8]) {
        let (path, bytes) = (plain(path.as_ref()), Arc::new(bytes.to_vec()));
        files().insert(path.clone(), bytes.clone());
        written().push((path, bytes));
    }

    /// Takes what was written since the last call, in order.
    pub fn take_written() -> Vec<(PathBuf, Arc<Vec<u8>>)> {
        std::mem::take(&mut *written())
    }
}

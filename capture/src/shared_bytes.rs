//! Memory maps of files.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use crate::error::CaptureError;

/// Memory map of a file; clones share the map.
#[derive(Debug, Clone)]
pub struct SharedBytes(Arc<memmap2::Mmap>);

impl SharedBytes {
    /// Maps the file at `path`. Returns `None` for an empty file, which cannot be mapped.
    ///
    /// # Errors
    /// [`CaptureError::Read`] with the path.
    pub fn map(path: &Path) -> Result<Option<SharedBytes>, CaptureError> {
        let file = File::open(path).map_err(|source| CaptureError::read(path, source))?;
        let size = file.metadata().map_err(|source| CaptureError::read(path, source))?.len();
        if size == 0 {
            return Ok(None);
        }
        #[allow(
            unsafe_code,
            reason = "mapping a file: read-only, and neither captures nor assets are rewritten in place"
        )]
        let map = unsafe { memmap2::Mmap::map(&file) }.map_err(|source| CaptureError::read(path, source))?;
        Ok(Some(SharedBytes(Arc::new(map))))
    }
}

impl AsRef<[u8]> for SharedBytes {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

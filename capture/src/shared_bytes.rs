//! Memory maps of files.

use std::path::Path;
use std::sync::Arc;

use crate::error::CaptureError;

/// Memory map of a file; clones share the map. In a browser, which has no files, the bytes that the page handed over.
#[derive(Debug, Clone)]
pub struct SharedBytes(Arc<Map>);

#[cfg(not(target_arch = "wasm32"))]
type Map = memmap2::Mmap;
#[cfg(target_arch = "wasm32")]
type Map = Vec<u8>;

impl SharedBytes {
    /// Maps the file at `path`. Returns `None` for an empty file, which cannot be mapped.
    ///
    /// # Errors
    /// [`CaptureError::Read`] with the path.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn map(path: &Path) -> Result<Option<SharedBytes>, CaptureError> {
        let file = std::fs::File::open(path).map_err(|source| CaptureError::read(path, source))?;
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

    /// Shares the file at `path`. Returns `None` for an empty file.
    ///
    /// # Errors
    /// [`CaptureError::Read`] with the path.
    #[cfg(target_arch = "wasm32")]
    pub fn map(path: &Path) -> Result<Option<SharedBytes>, CaptureError> {
        let bytes = crate::files::shared(path).map_err(|source| CaptureError::read(path, source))?;
        Ok((!bytes.is_empty()).then_some(SharedBytes(bytes)))
    }
}

impl AsRef<[u8]> for SharedBytes {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

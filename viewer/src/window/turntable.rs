//! Pictures around the scene: in a folder, or on a page, which saves single files only, in an archive.

use crate::error::ViewerError;
use crate::gpu::results::reading::Reading;
use crate::picture::Picture;
use crate::window::files::free_name;
#[cfg(not(target_arch = "wasm32"))]
use btf_capture::atomic::create_folder;
use std::path::PathBuf;

/// A turntable in the making.
pub(crate) struct Turntable {
    /// The folder, or the archive.
    pub place: PathBuf,
    /// Pictures that are written.
    pub done: u32,
    /// The next picture, while it is read.
    pub reading: Option<Reading>,
    #[cfg(target_arch = "wasm32")]
    archive: Option<zip::ZipWriter<std::io::Cursor<Vec<u8>>>>,
}

impl Turntable {
    /// Pictures of a whole turn.
    pub(crate) const PICTURES: u32 = 36;
    /// Samples per pixel of each picture.
    pub(crate) const SAMPLES: u32 = 16;

    /// Begins a turntable in a new folder.
    ///
    /// # Errors
    /// [`ViewerError::Write`] where it cannot be made.
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn new() -> Result<Turntable, ViewerError> {
        let place = free_name("btf-view_turntable", "");
        create_folder(&place)?;
        Ok(Turntable { place, done: 0, reading: None })
    }

    /// Begins a turntable in a new archive.
    ///
    /// # Errors
    /// None.
    #[cfg(target_arch = "wasm32")]
    pub(crate) fn new() -> Result<Turntable, ViewerError> {
        let archive = Some(zip::ZipWriter::new(std::io::Cursor::new(Vec::new())));
        Ok(Turntable { place: free_name("btf-view_turntable", ".zip"), done: 0, reading: None, archive })
    }

    /// Writes the next picture; returns `true` if it was the last one.
    ///
    /// # Errors
    /// The errors of [`Picture::write_png`].
    pub(crate) fn write(&mut self, picture: &Picture, exposure_ev: f32) -> Result<bool, ViewerError> {
        self.add(&format!("{:03}.png", self.done), picture, exposure_ev)?;
        self.done += 1;
        Ok(self.done == Turntable::PICTURES)
    }

    #[cfg(not(target_arch = "wasm32"))]
    fn add(&mut self, name: &str, picture: &Picture, exposure_ev: f32) -> Result<(), ViewerError> {
        picture.write_png(&self.place.join(name), exposure_ev)
    }

    #[cfg(target_arch = "wasm32")]
    fn add(&mut self, name: &str, picture: &Picture, exposure_ev: f32) -> Result<(), ViewerError> {
        use std::io::Write;
        let bytes = picture.png(&self.place, exposure_ev)?;
        let failed =
            |error: zip::result::ZipError| ViewerError::Encode { path: name.into(), reason: error.to_string() };
        // Pictures are small as they are.
        let stored = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        let Some(archive) = &mut self.archive else { return Ok(()) };
        archive.start_file(name, stored).map_err(failed)?;
        archive.write_all(&bytes).map_err(|error| failed(error.into()))?;
        if self.done + 1 == Turntable::PICTURES
            && let Some(archive) = self.archive.take()
        {
            let bytes = archive.finish().map_err(failed)?.into_inner();
            btf_capture::files::write(&self.place, &bytes);
        }
        Ok(())
    }
}

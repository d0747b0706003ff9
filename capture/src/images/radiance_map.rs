//! Reads pictures of radiance, EXR and Radiance files, as linear RGB for renderers.

use crate::error::CaptureError;
use crate::images::bands::BandReading;
use crate::images::decoded::{ImageFault, Samples};
use crate::images::file_format::{FileFormat, decode};
use std::path::Path;

/// Picture of linear radiance.
#[derive(Debug, Clone, PartialEq)]
pub struct RadianceMap {
    /// Number of pixels per row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Radiance `[row, column, rgb]` from the top left; finite and at least 0.
    pub rgb: Vec<f32>,
}

impl RadianceMap {
    /// Reads an `.exr` (RGB, or a spectrum) or `.hdr` file. Negative values become 0.
    ///
    /// # Errors
    /// [`CaptureError`] naming the file: unreadable, of another kind, damaged, or with values that are no numbers.
    pub fn read(path: &Path) -> Result<RadianceMap, CaptureError> {
        let fault = |reason: String| CaptureError::RadianceMap { path: path.into(), reason };
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or("");
        let format = match FileFormat::from_extension(extension) {
            Some(format @ (FileFormat::Exr | FileFormat::Hdr)) => format,
            _ => return Err(fault("it is no .exr or .hdr file, convert it to one".into())),
        };
        let bytes = crate::files::read(path).map_err(|source| CaptureError::Read { path: path.into(), source })?;
        let image = decode(&bytes, &[], format, None, BandReading::COLOUR).map_err(|found| match found {
            ImageFault::Damaged(reason) | ImageFault::Unfit(reason) => fault(reason),
            ImageFault::WrongSize { width, height } => fault(format!("it has {width} x {height} pixels")),
        })?;
        let (Samples::F32(mut rgb) | Samples::Computed(mut rgb)) = image.samples else {
            return Err(fault("its values are no radiance".into()));
        };
        if rgb.iter().any(|x| !x.is_finite()) {
            return Err(fault("it has values that are not finite numbers, write it again without them".into()));
        }
        rgb.iter_mut().for_each(|x| *x = x.max(0.0));
        Ok(RadianceMap { width: image.width, height: image.height, rgb })
    }

    /// Returns the bytes of an EXR file in single precision, which keeps every value.
    ///
    /// # Errors
    /// The encoder's reason.
    pub fn exr(&self) -> Result<Vec<u8>, String> {
        crate::images::exr::encode_single(&self.rgb, self.width, self.height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exr_keeps_every_value() {
        let dir = tempfile::tempdir().unwrap();
        let rgb = vec![1e-20, 0.1, 3.0e9, 0.0, 1.0 / 3.0, 65505.0];
        let map = RadianceMap { width: 1, height: 2, rgb };
        let path = dir.path().join("a.exr");
        std::fs::write(&path, map.exr().unwrap()).unwrap();
        assert_eq!(RadianceMap::read(&path).unwrap(), map);
    }

    #[test]
    fn reads_radiance_files_and_names_what_is_wrong_with_others() {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        std::fs::write(path("sky.exr"), crate::images::exr::encode(&[1.0, 2.0, 3.0, 0.0, -1.0, 4096.0], 2, 1).unwrap())
            .unwrap();
        let map = RadianceMap::read(&path("sky.exr")).unwrap();
        assert_eq!((map.width, map.height, map.rgb.as_slice()), (2, 1, [1.0, 2.0, 3.0, 0.0, 0.0, 4096.0].as_slice()));
        let whole = std::fs::read(path("sky.exr")).unwrap();
        std::fs::write(path("cut.exr"), &whole[..whole.len() / 2]).unwrap();
        std::fs::write(path("sky.png"), b"no").unwrap();
        for name in ["cut.exr", "sky.png", "missing.hdr"] {
            let message = RadianceMap::read(&path(name)).unwrap_err().to_string();
            assert!(message.contains(name) && !message.contains('\n'), "{message}");
        }
    }
}

//! Pictures in linear radiance, and their conversion to 8-bit sRGB.

use crate::error::ViewerError;
use btf_capture::atomic::write_file_atomically;
use btf_capture::{RadianceMap, Transfer};
use image::ImageEncoder;
use image::codecs::png::PngEncoder;
use std::path::Path;

/// A picture in linear radiance.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear RGB, sRGB primaries, row-major from the top left.
    pub radiance: Vec<[f32; 3]>,
}

/// The hit and the cost of the last sample of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelHit {
    /// Triangle that the primary ray hit, or [`crate::NO_HIT`].
    pub primitive: u32,
    /// Rays traced: the eye's, mirror and shadow rays.
    pub rays: u32,
    /// Asset decodes.
    pub evaluations: u32,
}

impl Picture {
    /// Returns 8-bit sRGB values, `[pixel, channel]`: applies the exposure, clips to 1, applies the sRGB curve and rounds.
    pub fn srgb8(&self, exposure_ev: f32) -> Vec<u8> {
        let gain = exposure_ev.exp2();
        let encode = |x: &f32| (Transfer::Srgb.encoded_from_linear((x * gain).clamp(0.0, 1.0)) * 255.0).round() as u8;
        self.radiance.iter().flatten().map(encode).collect()
    }

    /// Writes the picture, never half a file: for a name that ends with `.exr` linear radiance in single precision, without
    /// the exposure; for all others an 8-bit sRGB PNG.
    ///
    /// # Errors
    /// [`ViewerError::Write`] or [`ViewerError::Encode`], both naming the file.
    pub fn write(&self, path: &Path, exposure_ev: f32) -> Result<(), ViewerError> {
        if !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr")) {
            return self.write_png(path, exposure_ev);
        }
        let rgb = self.radiance.as_flattened().to_vec();
        let map = RadianceMap { width: self.width as usize, height: self.height as usize, rgb };
        let bytes = map.exr().map_err(|reason| ViewerError::Encode { path: path.into(), reason })?;
        write_file_atomically(path, &bytes)?;
        Ok(())
    }

    /// Writes an 8-bit sRGB PNG; never half a file.
    ///
    /// # Errors
    /// [`ViewerError::Write`] or [`ViewerError::Encode`], both naming the file.
    pub fn write_png(&self, path: &Path, exposure_ev: f32) -> Result<(), ViewerError> {
        write_file_atomically(path, &self.png(path, exposure_ev)?)?;
        Ok(())
    }

    /// Returns the peak signal-to-noise ratio of this picture and another one of the same size as 8-bit sRGB values, dB; at most 200,
    /// for equal ones.
    pub fn psnr_db(&self, other: &Picture, exposure_ev: f32) -> f64 {
        psnr_db(&self.radiance, &other.radiance, exposure_ev)
    }

    /// Returns the bytes of an 8-bit sRGB PNG; `path` is for messages.
    ///
    /// # Errors
    /// [`ViewerError::Encode`].
    pub(crate) fn png(&self, path: &Path, exposure_ev: f32) -> Result<Vec<u8>, ViewerError> {
        let mut bytes = Vec::new();
        PngEncoder::new(&mut bytes)
            .write_image(&self.srgb8(exposure_ev), self.width, self.height, image::ExtendedColorType::Rgb8)
            .map_err(|error| ViewerError::Encode { path: path.into(), reason: error.to_string() })?;
        Ok(bytes)
    }
}

/// Returns the peak signal-to-noise ratio of two pictures' linear radiance as 8-bit sRGB values, dB; at most 200, for
/// equal ones.
pub(crate) fn psnr_db(a: &[[f32; 3]], b: &[[f32; 3]], exposure_ev: f32) -> f64 {
    let codes = |radiance: &[[f32; 3]]| {
        Picture { width: radiance.len() as u32, height: 1, radiance: radiance.to_vec() }.srgb8(exposure_ev)
    };
    let (a, b) = (codes(a), codes(b));
    let square: f64 = a.iter().zip(&b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum();
    (10.0 * (255.0 * 255.0 * a.len() as f64 / square.max(1e-9)).log10()).min(200.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_comes_before_the_curve_and_both_ends_are_cut_off() {
        let picture = Picture { width: 2, height: 1, radiance: vec![[0.0, 0.25, 1.0], [-1.0, 9.0, f32::NAN]] };
        assert_eq!(picture.srgb8(0.0)[..5], [0, 137, 255, 0, 255]);
        // 0.25 twice doubled is 1.
        assert_eq!(picture.srgb8(2.0)[1], 255);
    }

    #[test]
    fn an_exr_has_the_radiance_and_other_names_are_png() {
        let dir = tempfile::tempdir().unwrap();
        let picture = Picture { width: 2, height: 1, radiance: vec![[0.0, 0.25, 1.0], [1.0, 9.0, 0.1]] };
        let (exr, png) = (dir.path().join("a.EXR"), dir.path().join("a"));
        picture.write(&exr, 3.0).unwrap();
        picture.write(&png, 0.0).unwrap();
        assert_eq!(RadianceMap::read(&exr).unwrap().rgb, picture.radiance.as_flattened());
        assert!(std::fs::read(&png).unwrap().starts_with(b"\x89PNG"));
    }

    #[test]
    fn png_comes_back_as_it_was_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let picture = Picture { width: 3, height: 2, radiance: (0..6).map(|i| [i as f32 / 5.0; 3]).collect() };
        picture.write_png(&path, 0.0).unwrap();
        let read = image::open(&path).unwrap().to_rgb8();
        assert_eq!((read.dimensions(), read.into_raw()), ((3, 2), picture.srgb8(0.0)));
        let message = picture.write_png(&dir.path().join("no/such/a.png"), 0.0).unwrap_err().to_string();
        assert!(message.contains("a.png"), "{message}");
    }
}

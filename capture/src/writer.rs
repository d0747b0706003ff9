//! Writes a capture folder that appears whole or not at all.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use crate::atomic::{StagedFolder, sync_folder};
use crate::colour::spectrum::PLAUSIBLE_NM;
use crate::error::CaptureError;
use crate::images::bands::MAX_BANDS;
use crate::images::decoded::MIN_LINEAR;
use crate::images::encode8::Encoder8;
use crate::images::{decoded, exr, file_format};
use crate::info::{CaptureInfo, ImageFormat, file_linear};
use crate::layout::bonn;
use crate::layout::manifest::{self, MANIFEST_NAME};

/// A writer of a capture folder in Bonn's layout, image by image, from any number of threads and in any order.
/// Everything goes into a hidden folder beside the final one, and [`CaptureWriter::finish`] renames that folder. A
/// writer that is dropped before (an error, Ctrl-C) leaves nothing behind.
#[derive(Debug)]
pub struct CaptureWriter {
    path: PathBuf,
    staging: StagedFolder,
    info: CaptureInfo,
    encoder: Encoder8,
    /// Whether each pair has been written.
    written: Vec<AtomicBool>,
}

impl CaptureWriter {
    /// Starts a capture that will become the folder `dir`; missing parent folders are created.
    ///
    /// # Errors
    /// [`CaptureError::OutputNotEmpty`] if `dir` holds anything, [`CaptureError::BadOutput`] for an invalid description
    /// (no texels, a curve with EXR, a scale that is not positive, directions that disagree with the side),
    /// [`CaptureError::Write`].
    pub fn create(dir: impl AsRef<Path>, info: CaptureInfo) -> Result<CaptureWriter, CaptureError> {
        let dir = dir.as_ref();
        check_info(&info).map_err(|reason| CaptureError::BadOutput { path: dir.into(), reason })?;
        let staging = StagedFolder::create(dir)?;
        for &view in info.views.directions() {
            let folder = staging.path().join(bonn::folder_name(view));
            fs::create_dir(folder).map_err(|source| CaptureError::write(dir, source))?;
        }
        let encoder = Encoder8::new(&info);
        let written = (0..info.pair_count()).map(|_| AtomicBool::new(false)).collect();
        Ok(CaptureWriter { path: dir.into(), staging, info, encoder, written })
    }

    /// Returns the description of the capture.
    pub fn info(&self) -> &CaptureInfo {
        &self.info
    }

    /// Writes one image of reflectance x cosine, `linear[texel, channel]`: three channels, or the bands of the description,
    /// which are written as EXR files with a channel for each wavelength. 8-bit formats round and clamp to the range
    /// of the curve; EXR keeps negatives down to -0.1 and clamps below that and above 65504, the largest half. Writing
    /// a pair again replaces its image.
    ///
    /// # Errors
    /// [`CaptureError::BadOutput`] if `linear` is not texels x channels long or holds a NaN or infinity,
    /// [`CaptureError::Write`] (a full disk says so).
    ///
    /// # Panics
    /// If `view` or `light` is out of range.
    pub fn write(&self, view: usize, light: usize, linear: &[f32]) -> Result<(), CaptureError> {
        let info = &self.info;
        assert!(view < info.views.len() && light < info.lights.len(), "pair ({view}, {light}) out of range");
        let relative = self.relative_path(view, light);
        let final_path = self.path.join(&relative);
        let refused = |reason: String| CaptureError::BadOutput { path: final_path.clone(), reason };
        let channels = info.channels();
        if linear.len() != info.texel_count() * channels {
            let (got, width, height) = (linear.len(), info.width, info.height);
            let reason = format!("it got {got} values for {width} x {height} texels of {channels} channels");
            return Err(refused(reason));
        }
        if let Some(at) = linear.iter().position(|value| !value.is_finite()) {
            let reason = format!("texel {} has the value {}; values must be finite", at / channels, linear[at]);
            return Err(refused(reason));
        }
        let bytes = match info.format {
            ImageFormat::Exr => {
                let factor = info.linear_factor(light);
                let values: Vec<f32> = linear.iter().map(|&x| file_linear(x.max(MIN_LINEAR), factor)).collect();
                match info.wavelengths_nm.is_empty() {
                    true => exr::encode(&values, info.width, info.height),
                    false => exr::encode_bands(&values, &info.wavelengths_nm, info.width, info.height),
                }
            }
            format => {
                let mut pixels = vec![0; linear.len()];
                self.encoder.encode_slice(light, linear, &mut pixels);
                file_format::encode_8_bit(&pixels, info.width, info.height, format)
            }
        }
        .map_err(refused)?;
        write_whole(&self.staging.path().join(relative), &bytes)
            .map_err(|source| CaptureError::write(&final_path, source))?;
        self.written[view * info.lights.len() + light].store(true, Ordering::Relaxed);
        Ok(())
    }

    /// Writes a map beside the images, such as the displacement that they show: a single-precision EXR file of one
    /// channel, Y, with one of `values`, `[row, column]`, per texel. Readers of captures ignore the map.
    ///
    /// # Errors
    /// [`CaptureError::BadOutput`] if `name` is no plain file name or one that a capture gives to
    /// its own files, or `values` is not texels long; [`CaptureError::Write`].
    pub fn write_map(&self, name: &str, values: &[f32]) -> Result<(), CaptureError> {
        let (info, final_path) = (&self.info, self.path.join(name));
        let refused = |reason: String| CaptureError::BadOutput { path: final_path.clone(), reason };
        if Path::new(name).file_name() != Some(name.as_ref()) || name == MANIFEST_NAME || bonn::is_image_name(name) {
            return Err(refused("a map cannot have this name; give a plain one that ends in .exr".into()));
        }
        if values.len() != info.texel_count() {
            return Err(refused(format!("it got {} values for {} x {} texels", values.len(), info.width, info.height)));
        }
        let bytes = exr::encode_map(values, info.width, info.height).map_err(refused)?;
        let staged = self.staging.path().join(name);
        write_whole(&staged, &bytes)
            .and_then(|()| File::open(&staged)?.sync_all())
            .map_err(|source| CaptureError::write(&final_path, source))
    }

    /// Writes `capture.toml`, syncs everything to disk and renames the folder to its final path.
    ///
    /// # Errors
    /// [`CaptureError::BadOutput`] if an image was never written, [`CaptureError::OutputNotEmpty`]
    /// if something else filled the folder meanwhile, [`CaptureError::Write`]; nothing is left.
    pub fn finish(self) -> Result<(), CaptureError> {
        let is_lacking = |pair: &usize| self.info.has_image(*pair) && !self.written[*pair].load(Ordering::Relaxed);
        let missing = (0..self.written.len()).filter(is_lacking).count();
        let refused = |reason: String| CaptureError::BadOutput { path: self.path.clone(), reason };
        if missing > 0 {
            return Err(refused(format!("{missing} of its {} images were never written", self.written.len())));
        }
        let text = manifest::to_text(&self.info).map_err(refused)?;
        write_whole(&self.staging.path().join(MANIFEST_NAME), text.as_bytes())
            .map_err(|source| CaptureError::write(&self.path.join(MANIFEST_NAME), source))?;
        // Synced at the end and in parallel: one by one while writing would wait for the disk at
        // every image.
        (0..self.written.len()).into_par_iter().try_for_each(|pair| {
            let lights = self.info.lights.len();
            let relative = self.relative_path(pair / lights, pair % lights);
            File::open(self.staging.path().join(&relative))
                .and_then(|file| file.sync_all())
                .map_err(|source| CaptureError::write(&self.path.join(relative), source))
        })?;
        for &view in self.info.views.directions() {
            sync_folder(&self.staging.path().join(bonn::folder_name(view)));
        }
        self.staging.commit()
    }

    fn relative_path(&self, view: usize, light: usize) -> PathBuf {
        let info = &self.info;
        Path::new(&bonn::folder_name(info.views.directions()[view])).join(bonn::file_name(
            &info.views,
            &info.lights,
            view,
            light,
            info.format.extension(),
        ))
    }
}

fn check_info(info: &CaptureInfo) -> Result<(), String> {
    decoded::check_size(info.width, info.height, None).map_err(|_| {
        format!("{} x {} texels cannot be written; give 1 to {}", info.width, info.height, decoded::MAX_TEXELS)
    })?;
    if !info.wavelengths_nm.is_empty() && info.format != ImageFormat::Exr {
        return Err(format!("bands are written as EXR files, not as {}", info.format));
    }
    let ascend = |pair: &[f64]| pair[0] < pair[1];
    let plausible = info.wavelengths_nm.iter().all(|nm| PLAUSIBLE_NM.contains(nm));
    if !plausible || !info.wavelengths_nm.windows(2).all(ascend) || info.wavelengths_nm.len() > MAX_BANDS {
        return Err(format!("its bands are not 1 to {MAX_BANDS} ascending wavelengths from 100 to 20,000 nm"));
    }
    if info.format == ImageFormat::Exr && info.transfer != crate::Transfer::Linear {
        return Err(format!("EXR images are linear, so the curve cannot be {}; use linear", info.transfer));
    }
    if !(info.scale > 0.0 && info.scale.is_finite()) {
        return Err(format!("its scale is {}; it must be a positive number", info.scale));
    }
    info.check_sides()
}

/// Writes a file and closes it; the caller syncs.
fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    File::create(path)?.write_all(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_lies_beside_the_images_and_does_not_disturb_reading() {
        let parent = tempfile::tempdir().unwrap();
        let dir = parent.path().join("with map");
        let set = crate::DirectionSet::random(1, 1).unwrap();
        let writer =
            CaptureWriter::create(&dir, CaptureInfo::new("m", 3, 2, set.clone(), set, ImageFormat::Exr)).unwrap();
        writer.write(0, 0, &[0.5; 18]).unwrap();
        writer.write_map("height.exr", &[0.25; 6]).unwrap();
        for (name, count) in [("height.exr", 5), ("../height.exr", 6), ("capture.toml", 6), ("", 6)] {
            assert!(writer.write_map(name, &vec![0.0; count]).is_err(), "{name}");
        }
        assert!(writer.write_map("00000 tl000 pl000 tv000 pv000.exr", &[0.0; 6]).is_err());
        writer.finish().unwrap();
        assert!(dir.join("height.exr").is_file());
        assert_eq!(crate::Capture::open(&dir).unwrap().info().pair_count(), 1);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_reported_with_the_remedy() {
        // /dev/full fails every write as a full disk does.
        let error = write_whole(Path::new("/dev/full"), b"x").unwrap_err();
        let message = CaptureError::write(Path::new("out/00000 tl000.png"), error).to_string();
        assert!(message.contains("out/00000 tl000.png") && message.contains("free space"), "{message}");
    }
}

//! A picture of motion vectors and depths, and its file.

use crate::error::ViewerError;
use btf_capture::write_channels_exr;
use std::path::Path;

/// Depth of a pixel that shows the sky or the background, scene units: the value that Blender writes there, since
/// filters turn an infinity into no number.
pub const BACKGROUND_DEPTH: f32 = 1e10;
/// Names of the channels of a file, in the order of [`MotionPixel`].
const CHANNELS: [&str; 3] = ["motion.X", "motion.Y", "Z"];

/// Where the content of a pixel was in the picture before, and how far away it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionPixel {
    /// From the place in this picture to that in the picture before, pixels: x to the right, y downwards, each -65504 to
    /// 65504.
    pub motion: [f32; 2],
    /// Depth along the axis of the camera, scene units; [`BACKGROUND_DEPTH`] where nothing is.
    pub depth: f32,
}

/// The motion of a whole picture.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionPicture {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// All pixels, row-major from the top left.
    pub pixels: Vec<MotionPixel>,
}

impl MotionPicture {
    /// Writes an EXR file in single precision with the channels `motion.X`, `motion.Y` and `Z`, never half a file.
    ///
    /// # Errors
    /// [`ViewerError::Write`] or what the encoder says, both naming the file.
    pub fn write(&self, path: &Path) -> Result<(), ViewerError> {
        let values: Vec<f32> =
            self.pixels.iter().flat_map(|MotionPixel { motion: [x, y], depth }| [*x, *y, *depth]).collect();
        write_channels_exr(path, &values, &CHANNELS, [self.width as usize, self.height as usize])?;
        Ok(())
    }
}

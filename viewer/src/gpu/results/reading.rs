//! A picture on its way back from a GPU.

use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::frame::GpuPixel;
use crate::gpu::results::readback::Readback;
use crate::picture::Picture;

/// A picture that is being read.
pub(crate) enum Reading {
    /// A picture that is at hand, until it is taken.
    Whole(Option<Picture>),
    /// A picture whose bands are being copied, from the top.
    Bands { gpu: Box<Gpu>, size: [u32; 2], bands: Vec<Readback<GpuPixel>>, pixels: Vec<GpuPixel> },
}

impl Reading {
    /// Returns the picture once it is there, and nothing after that.
    ///
    /// # Errors
    /// What the driver reported.
    pub(crate) fn take(&mut self) -> Option<Result<Picture, ViewerError>> {
        match self {
            Reading::Whole(picture) => picture.take().map(Ok),
            Reading::Bands { gpu, size, bands, pixels } => {
                if let Err(error) = gpu.wait() {
                    return Some(Err(error));
                }
                while let Some(band) = bands.first() {
                    match band.take(gpu)? {
                        Ok(read) => pixels.extend(read),
                        Err(error) => return Some(Err(error)),
                    }
                    bands.remove(0);
                }
                let radiance = pixels.iter().map(GpuPixel::radiance).collect();
                Some(Ok(Picture { width: size[0], height: size[1], radiance }))
            }
        }
    }
}

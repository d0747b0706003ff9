//! Reads one image file of a capture, with the file beside it that the header of an ENVI image stands for.

use crate::error::CaptureError;
use crate::images::bands::BandReading;
use crate::images::decoded::{DecodedImage, ImageFault};
use crate::images::envi::{DATA_EXTENSIONS, Header, MAX_HEADER_BYTES};
use crate::images::file_format::{FileFormat, decode};
use crate::layout::source::{MAX_FILE_BYTES, Source};

/// Bytes that an image file may have whatever its size in texels, for headers, thumbnails and profiles.
const FREE_FILE_BYTES: u64 = 4 << 20;

/// Most bytes of an image file per texel: sixteen float channels.
const MAX_BYTES_PER_TEXEL: u64 = 64;

/// Most bytes of a file with bands per texel: 256 float channels.
const MAX_SPECTRAL_BYTES_PER_TEXEL: u64 = 1024;

/// An image file of a source.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ImageFile<'a> {
    pub source: &'a Source,
    /// Index of the file in the source.
    pub file: usize,
    pub format: FileFormat,
}

impl<'a> ImageFile<'a> {
    /// Returns file `file` of a source, which its name says to be of `format`; the first bytes tell the two kinds of
    /// `.hdr` apart.
    pub(crate) fn of_name(source: &'a Source, file: usize, format: FileFormat) -> Result<ImageFile<'a>, CaptureError> {
        let format = match format {
            FileFormat::Hdr => format.of_bytes(&source.read(file, MAX_FILE_BYTES)?),
            _ => format,
        };
        Ok(ImageFile { source, file, format })
    }

    /// Reads and decodes the image. If `size` is given, an image of another size is refused, and a file of far more
    /// bytes is not read.
    pub(crate) fn decode(
        &self,
        size: Option<(usize, usize)>,
        reading: BandReading,
    ) -> Result<DecodedImage, CaptureError> {
        let ImageFile { source, file, format } = *self;
        let told = |fault: ImageFault| self.error(fault, size);
        let limit = match size {
            _ if format == FileFormat::Envi => MAX_HEADER_BYTES,
            Some((width, height)) => {
                let spectral = format.is_spectral();
                let per_texel = if spectral { MAX_SPECTRAL_BYTES_PER_TEXEL } else { MAX_BYTES_PER_TEXEL };
                FREE_FILE_BYTES + (width * height) as u64 * per_texel
            }
            None => MAX_FILE_BYTES,
        };
        let bytes = source.read(file, limit)?;
        let beside = if format == FileFormat::Envi {
            let header = Header::read(&bytes).map_err(told)?;
            // The header's claim is checked; a file that is larger by less is told to contradict it.
            source.read(self.numbers()?, FREE_FILE_BYTES + header.data_bytes())?
        } else {
            Vec::new()
        };
        decode(&bytes, &beside, format, size, reading).map_err(told)
    }

    fn error(&self, fault: ImageFault, size: Option<(usize, usize)>) -> CaptureError {
        let path = self.source.shown(self.file);
        match fault {
            ImageFault::Damaged(reason) => CaptureError::BadImage { path, reason },
            ImageFault::Unfit(reason) => CaptureError::UnfitImage { path, reason },
            ImageFault::WrongSize { width, height } => {
                let (expected_width, expected_height) = size.unwrap_or_default();
                CaptureError::WrongSize { path, width, height, expected_width, expected_height }
            }
        }
    }

    /// Returns the index of the file of numbers beside the header of an ENVI image: of the same name without the
    /// header's extension, or with one of [`DATA_EXTENSIONS`] for it.
    fn numbers(&self) -> Result<usize, CaptureError> {
        let names = self.source.names();
        let header = &names[self.file];
        let stem = header.rsplit_once('.').map_or(header.as_str(), |(stem, _)| stem);
        let is_numbers = |name: &str| match name[stem.len()..].strip_prefix('.') {
            None => name.len() == stem.len(),
            Some(extension) => DATA_EXTENSIONS.iter().any(|other| extension.eq_ignore_ascii_case(other)),
        };
        // Names are sorted, so those that start alike stand together.
        let from = names.partition_point(|name| name.as_str() < stem);
        let alike = (from..names.len()).take_while(|file| names[*file].starts_with(stem));
        let found: Vec<usize> = alike.filter(|file| is_numbers(&names[*file])).collect();
        let unfit = |reason| Err(CaptureError::UnfitImage { path: self.source.shown(self.file), reason });
        match found[..] {
            [file] => Ok(file),
            [] => {
                let name = stem.rsplit('/').next().unwrap_or(stem);
                let extensions = DATA_EXTENSIONS.join(", .");
                unfit(format!(
                    "has no file of numbers beside it; put it there as `{name}`, without an extension or with .{extensions}"
                ))
            }
            [first, second, ..] => {
                let [first, second] = [first, second].map(|file| self.source.shown(file));
                unfit(format!("has two files of numbers beside it, {first} and {second}; remove one of them"))
            }
        }
    }
}

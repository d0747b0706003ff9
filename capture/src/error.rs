//! Errors of reading and writing captures, each one sentence with its remedy.

use std::io;
use std::path::{Path, PathBuf};

/// Reason why a capture could not be read or written. `Display` is one plain sentence that names the file and says what
/// to do; programs print it after `error: `.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureError {
    /// Nothing exists at the path.
    #[error("{} does not exist; check the path of the capture", path.display())]
    NotFound {
        /// Path that was given.
        path: PathBuf,
    },
    /// The operating system refused a read.
    #[error("{} could not be read ({source}); check that it exists and that you may read it", path.display())]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// A picture of radiance that
    #[error("{}: {reason}", path.display())]
    RadianceMap {
        /// The file.
        path: PathBuf,
        /// Fault and remedy.
        reason: String,
    },
    /// The operating system refused a write.
    #[error("{} could not be written ({source}); {}", path.display(), write_remedy(source))]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// The output folder holds something already.
    #[error("{} is not an empty folder; choose another output folder or empty it first", path.display())]
    OutputNotEmpty {
        /// The output folder.
        path: PathBuf,
    },
    /// A file that is no capture of any kind.
    #[error(
        "{path} is not a capture folder and not a readable zip archive ({reason}); give a folder or a zip in Bonn's layout, a folder or a zip with a list of its images (.csv), or a UBO2014 file (.btf)"
    )]
    NotAnArchive {
        /// Path that was given.
        path: String,
        /// Reason that the zip reader gives.
        reason: String,
    },
    /// A zip entry whose path leads out of the archive.
    #[error(
        "{archive} holds an entry named `{entry}` that leads out of the archive; do not trust it, get the archive from its source again"
    )]
    UnsafeEntry {
        /// The archive.
        archive: String,
        /// The entry's name.
        entry: String,
    },
    /// A zip entry, or a file, far larger than an image of this capture can be.
    #[error(
        "{path} {claim}, more than an image of this capture can need; it may be a decompression bomb, get the file from its source again"
    )]
    TooLarge {
        /// The entry or file.
        path: String,
        /// Claim of the file, as a verb phrase.
        claim: String,
    },
    /// A folder or archive without any file.
    #[error("{path} is empty; a capture holds images named like `tv000_pv000/00000 tl000 pl000 tv000 pv000.png`")]
    Empty {
        /// The folder or archive.
        path: String,
    },
    /// Files of which none has capture angles in its name, and no list.
    #[error(
        "{path} holds {files} files but no image named like `00000 tl000 pl000 tv000 pv000.png` or `tv000_pv000_tl000_pl000.exr` (tif, png, jpg, exr or hdr) and no list of images (a .csv with the columns file, theta_v, phi_v, theta_l, phi_l); point to the folder that holds the capture's images, or to the UBO2014 file (.btf) itself"
    )]
    NoImages {
        /// The folder or archive.
        path: String,
        /// Number of files seen.
        files: usize,
    },
    /// Two files for the same pair of directions.
    #[error("{first} and {second} are images of the same light and view; remove one of them")]
    DoubledPair {
        /// The first file.
        first: String,
        /// The second file.
        second: String,
    },
    /// A pair without an image.
    #[error(
        "{path} lacks {missing} of its {expected_count} images ({views} views x {lights} lights), first `{expected}`; add what is missing, remove the views or lights that are incomplete, or write `incomplete = true` in capture.toml to fit without"
    )]
    MissingPair {
        /// The folder or archive.
        path: String,
        /// Name of the first file that should be there.
        expected: String,
        /// Number of pairs without an image.
        missing: usize,
        /// Number of pairs that views x lights make.
        expected_count: usize,
        /// Number of views found in the names.
        views: usize,
        /// Number of lights found in the names.
        lights: usize,
    },
    /// An incomplete capture whose images hardly share a view or a light.
    #[error(
        "{path} has {images} images of {views} views and {lights} lights, too few for so many pairs; write the views and lights that images count as in capture.toml, such as views = \"bonn81\""
    )]
    TooSparse {
        /// The folder or archive.
        path: String,
        /// Number of images.
        images: usize,
        /// Number of views.
        views: usize,
        /// Number of lights.
        lights: usize,
    },
    /// Keys of `capture.toml` that a capture of this kind does not take.
    #[error("{path}: {reason}")]
    BadKeys {
        /// The manifest.
        path: String,
        /// Which keys, and the remedy.
        reason: String,
    },
    /// Maps from texels to pixels without a size of the texels, or the other way round.
    #[error(
        "{path} needs both the columns h11 to h33 of its list and `rectified = [columns, rows]` in capture.toml, and has only one of them"
    )]
    NotRectified {
        /// The folder or archive.
        path: String,
    },
    /// A table that is no curves over wavelength.
    #[error("{path} cannot be used as {what}: {reason}")]
    BadCurves {
        /// The table.
        path: String,
        /// What it was to be.
        what: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A capture whose bands are asked for, and which has none.
    #[error("{name} is no capture in spectral bands: {reason}")]
    NotSpectral {
        /// Name of the capture.
        name: String,
        /// Why it has none, and the remedy.
        reason: String,
    },
    /// A pair without an image was asked for.
    #[error("{path} has no image; the capture is incomplete")]
    NoImage {
        /// The capture and the pair.
        path: String,
    },
    /// Images of more than one format.
    #[error(
        "{first} and {second} have different formats; a capture holds one of tif, png, jpg, exr or hdr, convert the others"
    )]
    MixedFormats {
        /// A file of the first format.
        first: String,
        /// A file of another.
        second: String,
    },
    /// An image that cannot be decoded.
    #[error("{path} cannot be read as an image ({reason}); it is damaged or of another kind, copy or make it again")]
    BadImage {
        /// The file.
        path: String,
        /// Reason that the decoder gives.
        reason: String,
    },
    /// A whole image of a kind that is not read, or that lacks something.
    #[error("{path} {reason}")]
    UnfitImage {
        /// The file.
        path: String,
        /// What it has or lacks, as a verb phrase, and the remedy.
        reason: String,
    },
    /// An image of another size than the first.
    #[error(
        "{path} is {width} x {height}, but the capture's first image is {expected_width} x {expected_height}; all images must have one size, replace it"
    )]
    WrongSize {
        /// The file.
        path: String,
        /// Width of the image in texels.
        width: usize,
        /// Height of the image in texels.
        height: usize,
        /// Width of the capture in texels.
        expected_width: usize,
        /// Height of the capture in texels.
        expected_height: usize,
    },
    /// NaN, infinity, or a negative below -0.1.
    #[error(
        "{path} has the value {value} in channel {channel} of the texel at column {column}, row {row}; values must be finite and at least -0.1, mend or re-export the image"
    )]
    BadValue {
        /// The file.
        path: String,
        /// The value after scale and cosine.
        value: f32,
        /// Column from the left, from 0.
        column: usize,
        /// Row from the top, from 0.
        row: usize,
        /// 0 red, 1 green, 2 blue.
        channel: usize,
    },
    /// `capture.toml` is malformed.
    #[error(
        "{path} line {line} is not understood ({reason}); correct that line or remove the file to use the defaults"
    )]
    BadManifest {
        /// The manifest.
        path: String,
        /// Line, from 1.
        line: usize,
        /// Fault of the line.
        reason: String,
    },
    /// A UBO2014 file that cannot be read.
    #[error(
        "{path} cannot be read as a UBO2014 file ({reason}); it is cut, damaged or of another kind, get it from its source again"
    )]
    BadContainer {
        /// The file.
        path: String,
        /// Fault of the file.
        reason: String,
    },
    /// A list of images that cannot be used.
    #[error("{path} line {line} is not understood ({reason}); correct that line")]
    BadList {
        /// The list.
        path: String,
        /// Line, from 1.
        line: usize,
        /// Fault of the line.
        reason: String,
    },
    /// More than one list of images.
    #[error("{first} and {second} both list the capture's images; remove one of them or name the one to read")]
    TwoLists {
        /// The first list.
        first: String,
        /// The second list.
        second: String,
    },
    /// A set of directions that cannot be used.
    #[error("the set of directions cannot be used: {reason}")]
    BadDirections {
        /// Fault and remedy.
        reason: String,
    },
    /// Images in memory that do not fit the capture's description.
    #[error("the images have {reason}")]
    BadImages {
        /// What they have, and what was expected.
        reason: String,
    },
    /// Directions that do not agree with the capture's side.
    #[error("{path} cannot be used: {reason}")]
    BadSides {
        /// The folder or archive.
        path: String,
        /// Fault and remedy.
        reason: String,
    },
    /// A word that is none of those allowed.
    #[error("`{word}` is not {what}; write {allowed}")]
    BadWord {
        /// Word that was given.
        word: String,
        /// Kind of word that was expected.
        what: &'static str,
        /// The allowed words.
        allowed: &'static str,
    },
    /// A capture description or image that cannot be written.
    #[error("the capture {} cannot be written: {reason}", path.display())]
    BadOutput {
        /// The output folder.
        path: PathBuf,
        /// Fault and remedy.
        reason: String,
    },
}

impl CaptureError {
    pub(crate) fn read(path: &Path, source: io::Error) -> CaptureError {
        if source.kind() == io::ErrorKind::NotFound {
            return CaptureError::NotFound { path: path.into() };
        }
        CaptureError::Read { path: path.into(), source }
    }

    pub(crate) fn write(path: &Path, source: io::Error) -> CaptureError {
        CaptureError::Write { path: path.into(), source }
    }
}

fn write_remedy(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "free space on that disk and run again",
        _ => "check that the folder exists and that you may write there",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_told_from_other_write_errors() {
        let full = CaptureError::write(Path::new("out/a.png"), io::ErrorKind::StorageFull.into()).to_string();
        assert!(full.contains("out/a.png") && full.contains("free space"), "{full}");
        let denied = CaptureError::write(Path::new("out/a.png"), io::ErrorKind::PermissionDenied.into()).to_string();
        assert!(!denied.contains("free space"), "{denied}");
    }
}

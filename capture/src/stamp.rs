//! Stamps of a capture's files, by which a resumed program sees that the capture is unchanged.

use crate::capture::{Capture, Images};
use crate::error::CaptureError;
use crate::images::bands::Weighing;
use std::path::Path;
use std::time::UNIX_EPOCH;

/// A file of a capture as the file system describes it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileStamp {
    /// Path below the folder of the capture, with `/` between its parts. A zip, a UBO2014 file and the manifest beside
    /// it have their own file name.
    pub name: String,
    /// Size in bytes.
    pub bytes: u64,
    /// Time of the last change in nanoseconds since 1970; 0 where the system does not tell.
    pub modified_ns: u64,
}

impl FileStamp {
    fn of(path: &Path, name: String) -> Result<FileStamp, CaptureError> {
        let meta = std::fs::metadata(path).map_err(|source| CaptureError::read(path, source))?;
        let since = meta.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        let modified_ns = since.map_or(0, |since| since.as_nanos() as u64);
        Ok(FileStamp { name, bytes: meta.len(), modified_ns })
    }
}

impl Capture {
    /// Returns the name, size and time of every file that the capture is read from, `capture.toml` and lists among
    /// them, sorted by name, and of the weights of [`Capture::through`]. Two calls return the same only if the capture did not change in between, unless somebody
    /// set the clock back. A capture in memory has one, with a hash of its values for the time.
    ///
    /// # Errors
    /// [`CaptureError::Read`] or [`CaptureError::NotFound`] for a file that is gone.
    ///
    /// Cost: a look at each file's entry, a few milliseconds for 6561 of them.
    pub fn stamps(&self) -> Result<Vec<FileStamp>, CaptureError> {
        let mut stamps = self.stamps_of_files()?;
        for part in self.groups.iter().flat_map(|parts| parts.iter().skip(1)) {
            stamps.extend(part.stamps()?.into_iter().filter(|stamp| !stamps.contains(stamp)).collect::<Vec<_>>());
        }
        if let Weighing::Sums(sums) = &self.weighing {
            let weights = sums.weights.as_flattened();
            let (bytes, modified_ns) = (4 * weights.len() as u64, hash_of(weights));
            stamps.push(FileStamp { name: "weights of the bands".into(), bytes, modified_ns });
        }
        Ok(stamps)
    }

    fn stamps_of_files(&self) -> Result<Vec<FileStamp>, CaptureError> {
        let own_name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        match &*self.images {
            Images::Files { source, .. } => match source.archive() {
                Some(path) => Ok(vec![FileStamp::of(path, own_name(path))?]),
                None => {
                    source.names().iter().map(|name| FileStamp::of(&source.root().join(name), name.clone())).collect()
                }
            },
            Images::Container(container) => {
                let path = container.path();
                let beside = path.with_extension("toml");
                let mut stamps = vec![FileStamp::of(path, own_name(path))?];
                if beside.is_file() {
                    stamps.push(FileStamp::of(&beside, own_name(&beside))?);
                }
                Ok(stamps)
            }
            Images::Memory { values, .. } => {
                let modified_ns = hash_of(values);
                Ok(vec![FileStamp { name: self.info().name.clone(), bytes: 4 * values.len() as u64, modified_ns }])
            }
        }
    }
}

/// Returns the FNV-1a hash of the bits of `values`, in place of a time.
fn hash_of(values: &[f32]) -> u64 {
    let hash = |hash: u64, value: &f32| (hash ^ u64::from(value.to_bits())).wrapping_mul(0x0100_0000_01b3);
    values.iter().fold(0xcbf2_9ce4_8422_2325, hash)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CaptureInfo, CaptureWriter, DirectionSet, ImageFormat};

    #[test]
    fn a_changed_a_renamed_and_an_added_file_show() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grey");
        let set = DirectionSet::random(2, 1).unwrap();
        let writer = CaptureWriter::create(&path, CaptureInfo::new("grey", 2, 2, set.clone(), set, ImageFormat::Png));
        let writer = writer.unwrap();
        for pair in 0..4 {
            writer.write(pair / 2, pair % 2, &[0.25; 12]).unwrap();
        }
        writer.finish().unwrap();
        let stamps = || Capture::open(&path).unwrap().stamps().unwrap();
        let first = stamps();
        assert_eq!(first, stamps());
        assert!(first.len() >= 4 && first.iter().all(|stamp| stamp.bytes > 0), "{first:?}");
        let image = path.join(&first.iter().find(|stamp| stamp.name.ends_with(".png")).unwrap().name);
        let bytes = std::fs::read(&image).unwrap();
        std::thread::sleep(std::time::Duration::from_millis(20));
        std::fs::write(&image, &bytes).unwrap();
        assert_ne!(first, stamps(), "the same bytes written again: the time tells");
        let second = stamps();
        std::fs::write(path.join("capture.toml"), "side = \"front\"").unwrap();
        assert_ne!(second, stamps());
    }
}

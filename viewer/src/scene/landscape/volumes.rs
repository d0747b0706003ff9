//! The volumes of a landscape: those that come with the program, or files in their place.

use super::planted::Flora;
use crate::error::ViewerError;
use crate::scene::volume::open_volume;
use crate::volume::source::{VolumeSource, tinted};
use btf_runtime::voltex::{Voltex, Volume};
use std::path::PathBuf;
use std::sync::Arc;

/// The volumes of a landscape, each in each of its tints.
#[derive(Default)]
pub(super) struct LandscapeVolumes {
    /// The volumes; of those that are stored by brick the coarse levels.
    pub volumes: Vec<Arc<Voltex>>,
    /// Where the bricks of each volume are, if it is stored by brick.
    pub sources: Vec<Option<Arc<VolumeSource>>>,
    /// Bytes of the files.
    pub file_bytes: u64,
    /// Finest level of each volume's file, counted from the coarsest.
    pub finest_levels: Vec<u32>,
}

/// The volumes that a landscape asks for.
pub(super) struct Wanted<'a> {
    /// Name of the landscape, for messages.
    pub name: &'a str,
    /// Volumes that it grows of.
    pub flora: &'a Flora,
    /// Whether volumes must go on into each other.
    pub cyclic: bool,
}

impl Wanted<'_> {
    /// Loads the volumes from `files`, as many as the flora has, or those that come with the program where there are none.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] for volumes that the landscape cannot use; [`ViewerError::Read`] and [`ViewerError::Volume`]
    /// for the files.
    pub fn load(&self, files: &[PathBuf]) -> Result<LandscapeVolumes, ViewerError> {
        let (name, Flora { built_in, tints, .. }) = (self.name, self.flora);
        let mut own = LandscapeVolumes::default();
        for (bytes, tints) in built_in.iter().zip(*tints).filter(|_| files.is_empty()) {
            let volume = Volume::parse(bytes).map_err(|source| ViewerError::Volume { path: name.into(), source })?;
            own.file_bytes += bytes.len() as u64;
            for tint in *tints {
                own.add(Arc::new(Voltex::new(&tinted(volume.clone(), *tint))), None);
            }
        }
        for (path, tints) in files.iter().zip(*tints) {
            let length = btf_capture::files::length(path);
            own.file_bytes += length.map_err(|source| ViewerError::Read { path: path.clone(), source })?;
            for tint in *tints {
                let (volume, source) = open_volume(path, *tint)?;
                let [x, y, _] = volume.extent();
                if self.cyclic && (volume.cyclic() != [true; 2] || x < 1.0 || y < 1.0) {
                    return Err(ViewerError::Usage(format!(
                        "{}: the {name}'s volumes go on into each other; build one of a script whose space is cyclic along x \
                         and y and as long along both as it is high at least",
                        path.display()
                    )));
                }
                own.add(volume, source);
            }
        }
        Ok(own)
    }
}

impl LandscapeVolumes {
    fn add(&mut self, volume: Arc<Voltex>, source: Option<Arc<VolumeSource>>) {
        let finest = source.as_ref().map_or(volume.level_count(), |source| source.file().finest_level());
        self.finest_levels.push(finest);
        self.volumes.push(volume);
        self.sources.push(source);
    }
}

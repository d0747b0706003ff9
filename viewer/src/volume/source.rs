//! The file of a volumetric texture, of which a scene loads the bricks that it needs.

use crate::error::ViewerError;
use btf_capture::files;
use btf_models::DiffuseColour;
use btf_runtime::voltex::{BrickError, BrickedFile, MAX_WHOLE_LEVEL, Voltex, Volume};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The levels of a volume's bricks, counted from the coarsest.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct BrickLevels {
    /// Finest level.
    pub finest: u32,
    /// Level of each brick.
    pub levels: Vec<u32>,
}

/// Volumes whose bricks are to be loaded: the number of each, its file and the levels.
pub(crate) struct BrickJob(pub Vec<(usize, Arc<VolumeSource>, BrickLevels)>);

/// Volumes whose bricks are loaded: the number of each, its words and the levels.
pub(crate) struct LoadedBricks(pub Vec<(usize, Arc<Voltex>, BrickLevels)>);

impl BrickJob {
    /// Loads the bricks. Cost: about a second for a million voxels and thread.
    ///
    /// # Errors
    /// Those of [`VolumeSource::load`].
    pub(crate) fn run(self) -> Result<LoadedBricks, ViewerError> {
        let load = |(number, source, levels): (usize, Arc<VolumeSource>, BrickLevels)| {
            Ok::<_, ViewerError>((number, Arc::new(source.load(&levels)?), levels))
        };
        Ok(LoadedBricks(self.0.into_iter().map(load).collect::<Result<_, _>>()?))
    }
}

/// A file whose bricks are at hand.
#[derive(Debug)]
pub(crate) struct VolumeSource {
    path: PathBuf,
    file: BrickedFile,
    tint: [f32; 3],
}

impl VolumeSource {
    /// Opens a volume that is stored by brick; `None` for one that is stored whole, as those of up to 128 voxels a side
    /// are. Its materials' colours count `tint` times.
    ///
    /// # Errors
    /// [`ViewerError::Read`] and [`ViewerError::Volume`], naming the file.
    pub(crate) fn open(path: &Path, tint: [f32; 3]) -> Result<Option<VolumeSource>, ViewerError> {
        let beginning = files::read_range(path, 0..BrickedFile::HEAD_BYTES);
        let beginning = beginning.map_err(|source| ViewerError::Read { path: path.into(), source })?;
        if !BrickedFile::is_one(&beginning) {
            return Ok(None);
        }
        let length = files::length(path).map_err(|source| ViewerError::Read { path: path.into(), source })?;
        let file = BrickedFile::open(&|range| files::read_range(path, range), length, &threads);
        let file = file.map_err(|error| said_of(path, error))?;
        Ok(Some(VolumeSource { path: path.into(), file, tint }))
    }

    /// Returns what is at hand of the file.
    pub(crate) fn file(&self) -> &BrickedFile {
        &self.file
    }

    /// Loads the volume down to a level, each brick to its own level.
    ///
    /// # Errors
    /// As [`VolumeSource::open`].
    fn load(&self, BrickLevels { finest, levels }: &BrickLevels) -> Result<Voltex, ViewerError> {
        let volume = self.file.load(&|range| files::read_range(&self.path, range), *finest, levels, &threads);
        let volume = volume.map_err(|error| said_of(&self.path, error))?;
        Ok(Voltex::new(&tinted(volume, self.tint)))
    }

    /// Loads the levels that are stored whole.
    ///
    /// # Errors
    /// As [`VolumeSource::open`].
    pub(crate) fn load_whole_levels(&self) -> Result<Voltex, ViewerError> {
        let levels = vec![MAX_WHOLE_LEVEL; self.file.bricks().len()];
        self.load(&BrickLevels { finest: MAX_WHOLE_LEVEL, levels })
    }
}

fn said_of(path: &Path, error: BrickError) -> ViewerError {
    match error {
        BrickError::Read(source) => ViewerError::Read { path: path.into(), source },
        BrickError::File(source) => ViewerError::Volume { path: path.into(), source },
    }
}

fn threads(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(work);
}

/// Returns a volume whose materials reflect and transmit `tint` times as much, and no brighter than all light, if they
/// were not before.
pub(crate) fn tinted(mut volume: Volume, tint: [f32; 3]) -> Volume {
    for material in &mut volume.materials {
        let own = DiffuseColour { reflectance: material.reflectance, transmittance: material.transmittance };
        DiffuseColour { reflectance: material.reflectance, transmittance: material.transmittance } = own.tinted(tint);
    }
    volume
}

//! Levels of all bricks within a budget of memory: as fine as they are needed, or all of them coarser by the same
//! factor.

use super::need::{BrickView, widths_needed};
use crate::volume::source::{BrickJob, BrickLevels, VolumeSource};
use crate::volume::volumes::Volumes;
use btf_runtime::voltex::{BRICK_LEVEL, BrickedFile, MAX_LEVELS};

/// Octaves by which voxels may be coarser than they are needed.
const MAX_COARSER: f32 = MAX_LEVELS as f32;
/// Halvings of the interval in which the least number of octaves is looked for.
const HALVINGS: u32 = 12;

/// What a volume's bricks are needed for.
#[derive(Debug)]
struct VolumeNeed<'a> {
    file: &'a BrickedFile,
    /// Width of the voxels that are needed of each brick, sides of the volume.
    widths: Vec<f32>,
}

impl<'a> VolumeNeed<'a> {
    /// Returns what views need of a volume of a scene.
    fn new(volumes: &Volumes, volume: usize, source: &'a VolumeSource, views: &[BrickView]) -> VolumeNeed<'a> {
        let bricks: Vec<[u32; 3]> = source.file().bricks().collect();
        VolumeNeed { file: source.file(), widths: widths_needed(volumes, volume, &bricks, views) }
    }

    /// Returns the levels of the volume where voxels may be `octaves` coarser than they are needed.
    fn levels(&self, octaves: f32) -> BrickLevels {
        let finest = self.file.finest_level();
        let level = |width: &f32| {
            let level = (-width.log2()).min(finest as f32) - octaves;
            (level.ceil().max(0.0) as u32).clamp(BRICK_LEVEL, finest)
        };
        let levels: Vec<u32> = self.widths.iter().map(level).collect();
        BrickLevels { finest: levels.iter().copied().max().unwrap_or(BRICK_LEVEL), levels }
    }
}

/// The levels of the bricks of a scene's volumes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BrickPlan {
    /// Levels of each volume that is stored by brick, in the order of [`Volumes::sources`].
    volumes: Vec<BrickLevels>,
    /// Bytes of all of them in memory.
    pub bytes: u64,
    /// Octaves by which voxels are coarser than they are needed.
    pub coarser: f32,
}

impl BrickPlan {
    /// Returns the levels that `views` need, as fine as volumes of `budget` bytes together may be.
    pub(crate) fn new(volumes: &Volumes, views: &[BrickView], budget: u64) -> BrickPlan {
        let has_bricks: Vec<usize> = volumes.sources().map(|(volume, ..)| volume).collect();
        let whole = (0..volumes.volume_count()).filter(|volume| !has_bricks.contains(volume));
        let whole: u64 = whole.map(|volume| 4 * volumes.volume(volume).words().len() as u64).sum();
        let needs = volumes.sources().map(|(volume, source, _)| VolumeNeed::new(volumes, volume, source, views));
        BrickPlan::within(&needs.collect::<Vec<_>>(), budget.saturating_sub(whole))
    }

    /// Returns the work of loading the levels; `None` where what is loaded is as fine everywhere.
    pub(crate) fn job(&self, volumes: &Volumes) -> Option<BrickJob> {
        let is_covered = |(loaded, wanted): (&BrickLevels, &BrickLevels)| {
            let finer = loaded.levels.iter().zip(&wanted.levels).all(|(loaded, wanted)| loaded >= wanted);
            finer && loaded.levels.len() == wanted.levels.len() && loaded.finest >= wanted.finest
        };
        if volumes.sources().map(|(.., loaded)| loaded).zip(&self.volumes).all(is_covered) {
            return None;
        }
        let other = volumes.sources().zip(&self.volumes).filter(|((.., loaded), levels)| loaded != levels);
        let jobs = other.map(|((volume, source, _), levels)| (volume, source.clone(), levels.clone()));
        Some(BrickJob(jobs.collect())).filter(|job| !job.0.is_empty())
    }

    /// Returns the levels with which all volumes take at most `budget` bytes, or the coarsest where these take more.
    fn within(needs: &[VolumeNeed], budget: u64) -> BrickPlan {
        let plan = |octaves: f32| {
            let volumes: Vec<BrickLevels> = needs.iter().map(|need| need.levels(octaves)).collect();
            let bytes = |(need, own): (&VolumeNeed, &BrickLevels)| need.file.resident_bytes(own.finest, &own.levels);
            let bytes = needs.iter().zip(&volumes).map(bytes).sum();
            BrickPlan { volumes, bytes, coarser: octaves }
        };
        let whole = plan(0.0);
        if whole.bytes <= budget {
            return whole;
        }
        let (mut too_fine, mut fits) = (0.0, plan(MAX_COARSER));
        for _ in 0..HALVINGS {
            let middle = plan(0.5 * (too_fine + fits.coarser));
            if middle.bytes <= budget { fits = middle } else { too_fine = middle.coarser }
        }
        fits
    }
}

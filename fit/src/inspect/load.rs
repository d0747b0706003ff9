//! Files and assets read on all threads, with messages that name the file.

use crate::error::FitError;
use btf_capture::text_from_bytes;
use btf_runtime::{Asset, PackedGoal, Resident, SingleBases};
use rayon::prelude::*;
use std::path::Path;

/// Runs `work(0..count)` of the runtime on all threads of the pool.
pub(crate) fn parallel(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(work);
}

/// Returns the resident form of `asset`, whose clusters are expanded on all threads of the pool.
pub fn resident_in_parallel(asset: &Asset) -> Resident {
    Resident::from_asset_on(asset, &parallel)
}

/// Returns the resident form of `asset` with packed bases, as `goal` has it.
///
/// # Errors
/// [`FitError::Budget`] if it takes more bytes than the goal without any component.
pub fn packed_in_parallel(asset: &Asset, goal: PackedGoal) -> Result<Resident, FitError> {
    let resident = Resident::packed_on(asset, goal, &parallel);
    let needed = 4 * resident.words().len() as u64;
    match goal {
        PackedGoal::Bytes(most) if needed > most => Err(FitError::Budget(format!(
            "in memory the asset takes {} at least; allow that with --resident-bytes, or take a coarser level of it with btf-fit convert --level",
            text_from_bytes(needed)
        ))),
        _ => Ok(resident),
    }
}

/// Returns the bases of a packed resident form ([`packed_in_parallel`]) as single numbers.
pub fn unpacked_in_parallel(packed: &Resident) -> SingleBases {
    SingleBases::of_packed(packed, &parallel)
}

/// Reads and parses an asset file; returns its bytes and the asset.
///
/// # Errors
/// If it cannot be read or is no good asset; the message names the file.
pub fn load_asset(path: &Path) -> Result<(Vec<u8>, Asset), FitError> {
    let bytes = read_file(path)?;
    let asset = Asset::parse(&bytes).map_err(|source| FitError::Asset { path: path.to_path_buf(), source })?;
    Ok((bytes, asset))
}

/// Returns `error` with the path of the file that it is about.
pub fn with_path(path: &Path, error: FitError) -> FitError {
    match error {
        FitError::Pack(source) => FitError::Asset { path: path.to_path_buf(), source },
        FitError::PackVolume(source) => FitError::Volume { path: path.to_path_buf(), source },
        FitError::Params(text) => FitError::Params(format!("{}: {text}", path.display())),
        other => other,
    }
}

/// Returns the bytes of a file, unchecked.
///
/// # Errors
/// If the file cannot be read; the message names it.
pub fn read_file(path: &Path) -> Result<Vec<u8>, FitError> {
    std::fs::read(path).map_err(|source| FitError::File {
        path: path.to_path_buf(),
        action: "reading the asset",
        source,
        remedy: if path.is_dir() {
            "give a file; a capture, which is a folder, is checked by btf-fit fit and btf-fit compare"
        } else {
            "check the path"
        },
    })
}

//! The volume: microflakes gathered into voxels, filtered to levels, fitted to what rays see.

pub(crate) mod build;
pub(crate) mod clip;
pub(crate) mod extinction;
pub(crate) mod gather;
pub(crate) mod light_correction;
pub(crate) mod lit;
pub(crate) mod palette;
pub(crate) mod refit;
pub(crate) mod sggx_correction;
pub(crate) mod shadow;

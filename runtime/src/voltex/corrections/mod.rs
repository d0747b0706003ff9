//! Corrections of a level as a whole: what all of its voxels together show and each of them cannot express.

pub(crate) mod facets;
pub(crate) mod light_correction;

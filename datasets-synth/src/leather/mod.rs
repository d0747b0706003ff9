//! Pebbled leather: the grain of a hide, its finish, and the capture of a patch.

pub(crate) mod capture;
pub(crate) mod facets;
pub(crate) mod finish;
pub(crate) mod grain;
pub(crate) mod hide;
pub(crate) mod params;

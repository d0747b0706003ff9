//! Finished stages of a fit kept on disk, so that an interrupted fit goes on (`--resume`).

pub(crate) mod checkpoint;
pub(crate) mod stored;

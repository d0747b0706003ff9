//! Libraries of many materials: a plan, any number of workers that fit it, and a catalogue of what they made.

pub(crate) mod catalogue;
pub(crate) mod claim;
pub(crate) mod collect;
pub(crate) mod discover;
pub(crate) mod estimate;
pub(crate) mod likeness;
pub(crate) mod options;
pub(crate) mod plan;
pub(crate) mod record;
pub(crate) mod run;
pub(crate) mod scripts;
pub(crate) mod shapes;
pub(crate) mod thumbnail;

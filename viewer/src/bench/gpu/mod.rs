//! One run over everything that a GPU is measured by, in steps of which each is a process of its own: a device that is lost
//! or a driver that hangs costs one step.
//!
//! ```text
//! runner --starts--> child (btf-view --step NAME) --runs--> step --rows, a line of JSON each--> runner --> gpu.json
//! ```

mod adapter;
mod canopies;
mod child;
mod expansion;
mod frames;
mod operations;
pub(crate) mod params;
pub(crate) mod parity;
mod picture_parity;
pub(crate) mod results;
mod roofline;
mod rows;
pub(crate) mod runner;
pub(crate) mod stand_in;
pub(crate) mod step;
mod transitions;
mod workload;

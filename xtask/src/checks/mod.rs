//! The repository's own checks. Each reads sources or `cargo metadata`, needs nothing installed, and returns one line
//! that says what was read, or every offence on a line of its own.

pub mod arrows;
pub mod header;
pub mod licences;
pub mod links;
pub mod locks;
pub mod rooms;
mod spdx;
pub mod words;

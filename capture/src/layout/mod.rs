//! How the images of a capture lie on disk: names, lists, folders, archives.

pub(crate) mod bonn;
pub(crate) mod grid;
pub(crate) mod list;
pub(crate) mod manifest;
pub(crate) mod source;

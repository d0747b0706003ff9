//! Layouts of a capture's images on disk: names, lists, folders, archives.

pub(crate) mod bonn;
pub(crate) mod grid;
pub(crate) mod list;
pub(crate) mod manifest;
pub(crate) mod source;

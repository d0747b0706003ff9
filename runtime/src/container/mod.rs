//! The container of every file of this package: header, tables, checksums, entropy coding.

pub(crate) mod directory;
pub(crate) mod entropy;
pub(crate) mod fault;
pub(crate) mod file_format;
pub(crate) mod finding;
pub(crate) mod sections;
pub(crate) mod writer;

//! What is in a file, and what is wrong with it.

pub(crate) mod convert;
pub(crate) mod describe;
pub(crate) mod describe_file;
pub(crate) mod describe_resident;
pub(crate) mod describe_voltex;
pub(crate) mod load;
pub(crate) mod lobe_use;
pub(crate) mod sections;
pub(crate) mod validate;

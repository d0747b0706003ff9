//! The resident form: the words that decoders in every language read, built from the file form or checked after
//! loading.

pub(crate) mod build;
pub(crate) mod check;
pub(crate) mod expansion;
pub(crate) mod expansion_input;
pub(crate) mod layout;
pub(crate) mod packed_bases;
pub(crate) mod packed_part;
pub(crate) mod packed_table;
pub(crate) mod packed_widths;
pub(crate) mod relief_records;
pub(crate) mod resident;
pub(crate) mod single;

//! The resident form: the words that decoders on every side read, built from the file form or checked as they come.

pub(crate) mod build;
pub(crate) mod check;
pub(crate) mod expansion;
pub(crate) mod expansion_input;
pub(crate) mod layout;
pub(crate) mod resident;
pub(crate) mod single;

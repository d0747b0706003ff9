//! Pages for people: HTML and SVG.

pub(crate) mod base64;
pub(crate) mod page;
pub(crate) mod plot;
pub(crate) mod report;

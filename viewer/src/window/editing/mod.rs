//! Editing of assets and leaves while they are drawn: steps back and forth, and what is not saved.

pub(crate) mod document;
pub(crate) mod editor;
mod history;
pub(crate) mod physiology;

//! What stands beside the picture: the panels, and the dialogs that choose files and ask about unsaved edits.

pub(crate) mod asked;
mod comparison;
mod editor;
pub(crate) mod lights;
pub(crate) mod open_dialog;
mod outdoors;
pub(crate) mod panel;
pub(crate) mod physiology;
mod spectrum;
pub(crate) mod status;
pub(crate) mod thumbnails;
pub(crate) mod unsaved;
mod wind;

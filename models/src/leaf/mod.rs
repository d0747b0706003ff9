//! What a leaf is, for whoever makes, lights or draws one: contents, gloss, species, the file that describes it,
//! and the folder of its appearance textures.

pub(crate) mod contents;
pub(crate) mod description;
mod description_file;
pub(crate) mod preset;
pub(crate) mod quantity;
pub(crate) mod species;
pub(crate) mod texture_folder;
pub(crate) mod texture_image;
mod tissue_and_gloss;

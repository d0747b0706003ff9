//! Leaves, for everyone who generates, lights or draws them: contents, gloss, species, the file that describes a leaf,
//! and the folder of its appearance textures.

pub(crate) mod contents;
pub(crate) mod description;
mod description_file;
pub(crate) mod preset;
pub(crate) mod quantity;
pub(crate) mod species;
pub(crate) mod table;
pub(crate) mod texture_folder;
pub(crate) mod texture_image;
mod tissue_and_gloss;

//! A packed asset in its file form: layers, dictionaries, lobes, residuals, directions, heights, edits.

pub(crate) mod asset;
pub(crate) mod dictionary;
pub(crate) mod disk;
pub(crate) mod edit;
pub(crate) mod height_field;
pub(crate) mod heights;
pub(crate) mod limits;
pub(crate) mod lobe;
pub(crate) mod lobe_tables;
pub(crate) mod lobe_weights;
pub(crate) mod predicted_lobes;
pub(crate) mod relief;
pub(crate) mod residual;
pub(crate) mod spectrum;
pub(crate) mod sphere;

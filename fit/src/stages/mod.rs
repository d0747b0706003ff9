//! The stages of a fit, one algorithm a file.

pub(crate) mod budget;
pub(crate) mod candidates;
pub(crate) mod dictionary;
pub(crate) mod encode;
pub(crate) mod factor;
pub(crate) mod features;
pub(crate) mod heights;
pub(crate) mod kmeans;
pub(crate) mod lasso;
pub(crate) mod lobe_dictionaries;
pub(crate) mod lobe_weights;
pub(crate) mod local_pca;
pub(crate) mod rate_labels;
pub(crate) mod residual_source;
pub(crate) mod slopes;
pub(crate) mod sparse;
pub(crate) mod texel_coordinates;

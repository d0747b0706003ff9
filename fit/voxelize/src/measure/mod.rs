//! How well a volume stands for its model.

pub(crate) mod ablations;
pub(crate) mod march;
pub(crate) mod measure;
pub(crate) mod simplify;

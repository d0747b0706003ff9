//! The stages strung together: memory plan, both recipes, search for a size or an error, forecast of the time.

pub(crate) mod adapter;
pub(crate) mod assemble;
pub(crate) mod choose_error;
pub(crate) mod choose_relief;
pub(crate) mod description;
pub(crate) mod fit;
pub(crate) mod fitted;
pub(crate) mod forecast;
pub(crate) mod match_energy;
pub(crate) mod memory_plan;
pub(crate) mod outcome;
pub(crate) mod prepare;
pub(crate) mod prepare_layer;
pub(crate) mod representatives;
pub(crate) mod search;

//! The stages strung together: memory plan, search for a size, forecast of the time.

pub(crate) mod fitted;
pub(crate) mod forecast;
pub(crate) mod outcome;
pub(crate) mod pipeline;

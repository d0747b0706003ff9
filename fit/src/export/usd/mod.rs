//! OpenUSD layers and packages with fitted materials (docs/reference/usd.md).

pub(crate) mod export;
pub(crate) mod layer;
pub(crate) mod network;
pub(crate) mod preview;

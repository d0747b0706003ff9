//! What comes back from a GPU: that it has finished, how long it took, what it has computed.

pub(crate) mod fence;
pub(crate) mod readback;
pub(crate) mod reading;
pub(crate) mod timer;

//! Commands about what materials have in common.

pub(super) mod learn;
pub(super) mod propose;

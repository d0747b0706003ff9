//! What materials have in common: covariances between direction pairs, learnt from fitted assets and adapted to a
//! capture's own samples. They predict the pairs of a capture that have no image, and tell which pairs tell most.

pub(crate) mod covariance;
pub(crate) mod functions;
pub(crate) mod holdout;
pub(crate) mod kernels;
pub(crate) mod learn;
pub(crate) mod parts;
pub(crate) mod predict;
pub(crate) mod propose;
pub(crate) mod variances;

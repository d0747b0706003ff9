//! Algorithmic models (ABM): random walks of rays through the interfaces of a leaf's tissue.

pub(crate) mod abm97;
pub(crate) mod abm_b;
pub(crate) mod abm_u;
pub(crate) mod path_lengths;
pub(crate) mod scatter_table;
pub(crate) mod specimen;
pub(crate) mod stack;
pub(crate) mod tissue;
pub(crate) mod walk;

//! Triangles, instances, the hierarchies over them, and where rays meet them.

pub(crate) mod bvh;
pub(crate) mod bvh_build;
pub(crate) mod bvh_node;
pub(crate) mod geometry;
pub(crate) mod lanes;
pub(crate) mod lod_transition;
pub(crate) mod shear;
pub(crate) mod surface;

//! Models as triangles, and what they are made of.

pub(crate) mod additive_recurrence;
pub(crate) mod frame;
pub(crate) mod leaf_colour;
pub(crate) mod light_table;
pub(crate) mod microflakes;
pub(crate) mod triangle_model;

//! The shaders that `cargo xtask shaders` writes, judged by compilers of others and run on the software driver: one
//! module per subject.

mod golden;
mod leaf;
mod support;
mod validation;
mod voltex;

//! `btf-fit` as a user runs it, and fits of extreme captures: one module per subject, one program, because each program links the
//! whole of the fitter.

mod command_line;
mod containers;
mod extremes;
mod library;
mod memory;
mod packed;
mod painted;
mod resume;
mod roles;
mod support;
mod trade;
mod volume_extremes;

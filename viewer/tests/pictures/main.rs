//! What is drawn, measured against other ways of drawing it: one module per subject, one program, because each program
//! links the whole of the renderer.

mod diffuse_sheets;
mod expansion;
mod extremes;
mod filters;
mod gpu;
mod layers;
mod leaves;
mod live_changes;
mod motion;
mod skins;
mod volume_extremes;
mod volumes;

#[path = "../support/mod.rs"]
mod support;

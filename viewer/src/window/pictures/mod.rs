//! The pictures in the window, while they are made.

pub(crate) mod blit;
pub(crate) mod cpu_canvas;
pub(crate) mod pace;
pub(crate) mod pictures;
pub(crate) mod preparing;
pub(crate) mod progress;
pub(crate) mod renderer;
pub(crate) mod resting;
pub(crate) mod side;
pub(crate) mod split;
pub(crate) mod stand_in;

//! The window: the camera under the mouse, panels, progressive rendering, and edits that are saved before they are
//! lost. Whose window it is (`Host`) is the system's (`desktop.rs`) or, on a page, the browser's (`page.rs`).

mod bricks;
mod canvas;
mod controls;
#[cfg(feature = "window")]
pub(crate) mod desktop;
mod editing;
mod files;
mod folder;
mod keys;
mod light_handles;
#[cfg(any(test, target_arch = "wasm32"))]
mod link;
mod mouse;
#[cfg(target_arch = "wasm32")]
pub(crate) mod page;
#[cfg(target_arch = "wasm32")]
pub(crate) mod page_picture;
mod panels;
mod pictures;
mod pressed;
mod settings;
mod turntable;
mod view;
mod zoom;

#[cfg(test)]
pub(crate) use pictures::blit::GpuBlit;

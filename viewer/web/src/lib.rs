//! `btf-view` on a page: what its scripts (`page/`) call. Everything here runs in workers; the page itself only hands events and
//! files over and shows the pictures that come back.

#![cfg(target_arch = "wasm32")]

mod events;
mod files;
mod shown;
mod viewer;

use wasm_bindgen::prelude::*;

#[wasm_bindgen]
extern "C" {
    #[wasm_bindgen(js_namespace = console, js_name = error)]
    fn report(message: &str);
}

/// Has the browser's console tell what a defect of ours was.
#[wasm_bindgen(start)]
fn start() {
    std::panic::set_hook(Box::new(|panic| report(&panic.to_string())));
}

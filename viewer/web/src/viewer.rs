//! The window on the page's canvas.

use crate::events;
use crate::shown::PageScene;
use btf_viewer::{Page, PageFrame};
use egui::{Event, Modifiers};
use js_sys::{Object, Reflect};
use std::path::Path;
use wasm_bindgen::prelude::*;
use web_sys::OffscreenCanvas;

/// The window. Places are in points from the canvas's upper left corner, which are pixels of CSS.
#[wasm_bindgen]
pub struct Viewer {
    page: Page,
    modifiers: Modifiers,
}

#[wasm_bindgen]
impl Viewer {
    /// Opens a window of `width` x `height` pixels on a canvas; `shown` is what it shows, as JSON.
    ///
    /// # Errors
    /// What is not understood of `shown`; no adapter; what the browser reported.
    pub async fn open(
        canvas: OffscreenCanvas,
        width: u32,
        height: u32,
        pixels_per_point: f32,
        shown: String,
    ) -> Result<Viewer, JsError> {
        let scene = PageScene::read(&shown)?.make()?;
        let page = Page::open(canvas, [width, height], pixels_per_point, scene).await?;
        Ok(Viewer { page, modifiers: Modifiers::NONE })
    }

    /// Shows something else, as JSON.
    ///
    /// # Errors
    /// What cannot be shown; the window then shows what it did.
    pub fn show(&mut self, shown: &str) -> Result<(), JsError> {
        self.page.show(PageScene::read(shown)?.make()?);
        Ok(())
    }

    /// Opens a file that was handed over, as if it was dropped at a place.
    #[wasm_bindgen(js_name = openFile)]
    pub fn open_file(&mut self, path: &str, x: f32, y: f32) {
        self.page.open_file(Path::new(path), (x.is_finite() && y.is_finite()).then_some([x, y]));
    }

    /// Follows the canvas to another size in pixels.
    pub fn resize(&mut self, width: u32, height: u32, pixels_per_point: f32) {
        self.page.resize([width.max(1), height.max(1)], pixels_per_point);
    }

    /// Notes which keys are held down: bits 1 Shift, 2 Ctrl, 4 Alt, 8 Meta.
    pub fn modifiers(&mut self, bits: u32) {
        let modifiers = events::modifiers(bits);
        if modifiers != self.modifiers {
            self.modifiers = modifiers;
            self.page.set_modifiers(modifiers);
        }
    }

    /// Takes a movement of the pointer.
    #[wasm_bindgen(js_name = pointerMoved)]
    pub fn pointer_moved(&mut self, x: f32, y: f32) {
        self.page.take(Event::PointerMoved(egui::pos2(x, y)));
    }

    /// Takes a button that is pressed or released, by its number in JavaScript.
    #[wasm_bindgen(js_name = pointerButton)]
    pub fn pointer_button(&mut self, x: f32, y: f32, button: u32, pressed: bool) {
        self.page.take(events::pointer_button([x, y], button, pressed, self.modifiers));
    }

    /// Takes note that the pointer has left the canvas.
    #[wasm_bindgen(js_name = pointerGone)]
    pub fn pointer_gone(&mut self) {
        self.page.take(Event::PointerGone);
    }

    /// Takes a turn of the wheel, in points or lines.
    pub fn wheel(&mut self, x: f32, y: f32, lines: bool) {
        self.page.take(events::wheel([x, y], lines, self.modifiers));
    }

    /// Takes what a finger does: comes (0), moves (1), leaves (2).
    pub fn touch(&mut self, id: u32, phase: u32, x: f32, y: f32) {
        self.page.take(events::touch(id, phase, [x, y]));
    }

    /// Takes a key that is pressed or released, by its name in JavaScript.
    pub fn key(&mut self, name: &str, pressed: bool, repeat: bool) {
        if let Some(event) = events::key(name, pressed, repeat, self.modifiers) {
            self.page.take(event);
        }
    }

    /// Takes text that was typed or pasted.
    pub fn text(&mut self, text: String) {
        self.page.take(Event::Text(text));
    }

    /// Returns how the scene is seen, as text for a link.
    pub fn link(&self) -> String {
        self.page.link()
    }

    /// Has the scene seen as a link tells.
    pub fn follow(&mut self, link: &str) {
        self.page.follow(link);
    }

    /// Returns the picture's samples per pixel; 0 while the renderer is made ready.
    pub fn samples(&self) -> u32 {
        self.page.samples()
    }

    /// Returns the message of the latest opening or saving, or why the renderer stopped.
    pub fn message(&self) -> Option<String> {
        self.page.message()
    }

    /// Draws a frame at `now` seconds where there is something new; returns what it leaves to the page.
    ///
    /// # Errors
    /// What the browser reported.
    pub fn frame(&mut self, now: f64) -> Result<Object, JsError> {
        let PageFrame { is_drawn, next_in_ms, cursor, copied, choose_file, is_typing, has_unsaved } =
            self.page.frame(now)?;
        let frame = Object::new();
        let values: [(&str, JsValue); 7] = [
            ("isDrawn", is_drawn.into()),
            ("nextInMs", next_in_ms.into()),
            ("cursor", cursor.into()),
            ("copied", copied.into()),
            ("chooseFile", choose_file.into()),
            ("isTyping", is_typing.into()),
            ("hasUnsaved", has_unsaved.into()),
        ];
        for (name, value) in values {
            // A plain object takes every property.
            let _ = Reflect::set(&frame, &name.into(), &value);
        }
        Ok(frame)
    }
}

#[wasm_bindgen]
extern "C" {
    #[wasm_bindgen(js_name = setTimeout)]
    fn set_timeout(resolve: &js_sys::Function, ms: i32) -> JsValue;
}

/// Gives other work its turn.
async fn pause() {
    let promise = js_sys::Promise::new(&mut |resolve, _| {
        set_timeout(&resolve, 1);
    });
    // It cannot be refused.
    let _ = wasm_bindgen_futures::JsFuture::from(promise).await;
}

/// Draws a picture of `samples` a pixel that is not shown, of what `shown` tells as JSON, seen as `link` tells; returns the bytes
/// of a PNG.
///
/// # Errors
/// What is not understood; no adapter; what the browser reported.
#[wasm_bindgen(js_name = drawPicture)]
pub async fn draw_picture(
    shown: String,
    link: String,
    width: u32,
    height: u32,
    samples: u32,
) -> Result<Vec<u8>, JsError> {
    let scene = PageScene::read(&shown)?.make()?;
    Ok(btf_viewer::draw_picture(scene, &link, [width, height], samples, pause).await?)
}

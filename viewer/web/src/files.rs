//! Files that the page hands over and takes, and the work on them that another worker does.

use btf_capture::files;
use btf_runtime::{Levels, ResidentFile, serial};
use js_sys::{Array, Uint8Array};
use std::sync::Arc;
use wasm_bindgen::prelude::*;

/// Keeps a file for those who open it by its path.
#[wasm_bindgen(js_name = handOver)]
pub fn hand_over(path: &str, bytes: Vec<u8>) {
    files::hand_over(path, bytes);
}

/// Takes the files that were written since the last call: pairs of name and bytes.
#[wasm_bindgen(js_name = takeWritten)]
pub fn take_written() -> Array {
    let pair = |(path, bytes): (std::path::PathBuf, Arc<Vec<u8>>)| {
        Array::of2(&path.display().to_string().into(), &Uint8Array::from(bytes.as_slice()))
    };
    files::take_written().into_iter().map(pair).collect()
}

/// Expands an asset, or the beginning of one that ends with a tier, to the form that decoders read; one that has this form stays
/// as it is. `has_levels` tells whether coarser levels are made for distant surfaces, which takes longer than all else. Cost:
/// seconds for an asset of 2 MB.
///
/// # Errors
/// What is wrong with the bytes.
#[wasm_bindgen]
pub fn expand(bytes: Vec<u8>, has_levels: bool) -> Result<Vec<u8>, JsError> {
    if ResidentFile::is_one(&bytes) {
        return Ok(bytes);
    }
    let levels = if has_levels { Levels::All } else { Levels::AtHand };
    let file = btf_runtime::open(Arc::new(bytes), levels, &serial)?;
    Ok(file.pack()?)
}

/// Returns the lengths in bytes of an asset's beginnings that can be shown, the whole file's last.
///
/// # Errors
/// Too few bytes to tell, or bytes of something else.
#[wasm_bindgen(js_name = tierLengths)]
pub fn tier_lengths(beginning: &[u8]) -> Result<Vec<u32>, JsError> {
    Ok(btf_runtime::tier_lengths(beginning)?)
}

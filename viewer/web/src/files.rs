//! Files that the page hands over and takes, and the work on them that another worker does.

use btf_capture::files;
use btf_runtime::{Asset, ResidentFile, serial, with_levels};
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

/// An asset that was loaded, or the beginning of one that ends with a tier.
#[wasm_bindgen]
pub struct Loaded(Form);

enum Form {
    File(Asset),
    Resident(Vec<u8>),
}

#[wasm_bindgen]
impl Loaded {
    /// Checks and reads the bytes. Cost: a second for 2 MB.
    ///
    /// # Errors
    /// What is wrong with the bytes.
    pub fn read(bytes: Vec<u8>) -> Result<Loaded, JsError> {
        Ok(Loaded(match ResidentFile::is_one(&bytes) {
            true => Form::Resident(bytes),
            false => Form::File(Asset::parse(&bytes)?),
        }))
    }

    /// Tells whether the coarser levels for distant surfaces are still to be made.
    #[wasm_bindgen(getter, js_name = lacksLevels)]
    pub fn lacks_levels(&self) -> bool {
        matches!(&self.0, Form::File(asset) if asset.levels.is_empty())
    }

    /// Makes the coarser levels where they are lacking. Cost: more than all else, many seconds for 2 MB.
    #[wasm_bindgen(js_name = addLevels)]
    pub fn add_levels(&mut self) {
        if let Form::File(asset) = &mut self.0 {
            *asset = with_levels(asset, &serial);
        }
    }

    /// Returns the form that decoders read. Cost: a second for 2 MB.
    ///
    /// # Errors
    /// An asset of more than 4 GiB in this form.
    pub fn expanded(&self) -> Result<Vec<u8>, JsError> {
        match &self.0 {
            Form::File(asset) => Ok(ResidentFile::of_asset(asset.clone(), &serial).pack()?),
            Form::Resident(bytes) => Ok(bytes.clone()),
        }
    }
}

/// Returns the lengths in bytes of an asset's beginnings that can be shown, the whole file's last.
///
/// # Errors
/// Too few bytes to tell, or bytes of something else.
#[wasm_bindgen(js_name = tierLengths)]
pub fn tier_lengths(beginning: &[u8]) -> Result<Vec<u32>, JsError> {
    Ok(btf_runtime::tier_lengths(beginning)?)
}

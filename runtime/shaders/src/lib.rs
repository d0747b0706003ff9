//! The decoder as complete compute shaders in the languages of every engine, made from the one WGSL library that
//! `btf-runtime` publishes; and that library as one text with a head that says how to use it.
//!
//! ```text
//! btf_runtime::wgsl_library() --library_text--> btf.wgsl                      for includers
//!        + queries.wgsl       --module_text---> btf_queries.wgsl --translate--> .hlsl .metal .glsl .spv
//! ```
//!
//! Volumetric textures likewise: `btf_runtime::voltex_wgsl()` as `btf_voltex.wgsl`, with depths.wgsl as
//! `btf_depths.wgsl` and its translations.
//!
//! `btf_expansion.wgsl`, the compute passes that make a resident form's bases, is written in WGSL alone.
//!
//! `cargo xtask shaders` writes the folder that [`files`] makes; none of it is checked in. The entry points are in this
//! package and not beside the library, which has no bindings: an engine that includes `btf.wgsl` defines its own.
//!
//! Limits: asset words, questions and answers have one binding each (WebGPU's default: 128 MiB). An engine with larger
//! assets includes the library with an `asset_word` over several bindings, as the viewer does.

#![forbid(unsafe_code)]

mod error;
mod languages;
mod queries;
mod readme;
mod texts;

use btf_runtime::EXPANSION_WGSL;
pub use error::ShaderError;
pub use languages::{Language, ShaderFile, translate};
pub use queries::{Answer, Depth, Options, Query, Range, Ray, WORKGROUP};
pub use readme::readme;
pub use texts::{
    DEPTHS_NAME, ENTRY_POINTS, EXPANSION_FILE, LIBRARY_FILE, MODULE_NAME, VOLTEX_LIBRARY_FILE, depths_text,
    library_text, module_text, voltex_library_text,
};

/// File name of [`readme`].
pub const README_FILE: &str = "README.md";

/// Returns everything that `cargo xtask shaders` writes, `(file name, bytes)`, the same each time.
///
/// # Errors
/// [`ShaderError`] if naga cannot translate our own text, which the tests of this package rule out.
///
/// Cost: a few hundred milliseconds.
pub fn files() -> Result<Vec<(String, Vec<u8>)>, ShaderError> {
    let modules = [(MODULE_NAME, module_text()), (DEPTHS_NAME, depths_text())];
    let translated = modules.iter().map(|(name, text)| translate(name, text)).collect::<Result<Vec<_>, _>>()?;
    let described: Vec<_> = modules.iter().zip(&translated).map(|((_, text), files)| (&text[..], &files[..])).collect();
    let mut files = vec![
        (LIBRARY_FILE.to_string(), library_text().into_bytes()),
        (EXPANSION_FILE.to_string(), EXPANSION_WGSL.into()),
        (VOLTEX_LIBRARY_FILE.to_string(), voltex_library_text().into_bytes()),
        (README_FILE.to_string(), readme(&described)?.into_bytes()),
    ];
    files.extend(translated.into_iter().flatten().map(|file| (file.name, file.bytes)));
    Ok(files)
}

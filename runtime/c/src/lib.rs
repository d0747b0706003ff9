//! The C interface of `btf-runtime`: an opaque handle, plain structs, an error code from every call.
//!
//! A user reads `include/btf.h`, which `cargo xtask header` writes from this source with cbindgen (`cbindgen.toml`):
//! the comments of all public items are written for C. `border.rs` holds the rules of the border: pointers are checked
//! for null and alignment, counts for overflow, and no panic gets through.
//!
//! | File | |
//! |---|---|
//! | `code` | error codes, their texts, the last error of a thread |
//! | `border` | the entry of every call |
//! | `asset` | the handle: open, close, properties |
//! | `evaluate` | values, samples and densities |
//! | `threads` | the threads of opening, gone when it returns |

#![allow(unsafe_code, reason = "C hands over pointers; each use says why it is right")]
#![deny(unsafe_op_in_unsafe_fn, clippy::undocumented_unsafe_blocks)]
#![allow(clippy::missing_safety_doc, reason = "the comments are the header's: they say what pointers must point to")]

mod asset;
mod border;
mod code;
mod evaluate;
#[cfg(target_arch = "wasm32")]
mod memory;
mod threads;

pub use asset::{
    BTF_BACK_LIT_BACK, BTF_BACK_LIT_FRONT, BTF_FRONT_LIT_BACK, BTF_FRONT_LIT_FRONT, Handle, Info, Levels, OpenOptions,
    btf_bands, btf_close, btf_default_open_options, btf_material, btf_open_file, btf_open_memory, btf_query,
    btf_resident, btf_show_bands,
};
pub use code::{Code, btf_error_text, btf_last_error};
pub use evaluate::{
    Drawn, Heights, Interpolation, Options, Place, btf_default_options, btf_density, btf_evaluate, btf_evaluate_bands,
    btf_evaluate_many, btf_sample,
};
#[cfg(target_arch = "wasm32")]
pub use memory::{btf_allocate, btf_free};

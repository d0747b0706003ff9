//! Memory for callers that have none of their own beside the library's: the host of a WebAssembly module.

use std::alloc::{Layout, alloc, dealloc};

/// Bytes by which memory for callers is aligned: as much as any argument needs.
const ALIGNMENT: usize = 16;

/// Returns memory for arguments and results; null where there is none. It holds anything.
#[unsafe(no_mangle)]
pub extern "C" fn btf_allocate(length: usize) -> *mut u8 {
    match Layout::from_size_align(length.max(1), ALIGNMENT) {
        // SAFETY: the length is above 0.
        Ok(layout) => unsafe { alloc(layout) },
        Err(_) => std::ptr::null_mut(),
    }
}

/// Returns memory of [`btf_allocate`]; null does nothing.
///
/// # Safety
/// `pointer` must be of `btf_allocate(length)` and not be used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn btf_free(pointer: *mut u8, length: usize) {
    if let (false, Ok(layout)) = (pointer.is_null(), Layout::from_size_align(length.max(1), ALIGNMENT)) {
        // SAFETY: as the caller promised.
        unsafe { dealloc(pointer, layout) }
    }
}

//! The entry of every call: pointers are checked, faults become codes, and no panic leaves the library.

use crate::code::{Code, Fault, remember};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs the body of a call. A panic is a mistake of this library and becomes [`Code::Internal`].
pub fn call(body: impl FnOnce() -> Result<(), Fault>) -> Code {
    // What a body changes before it fails are the caller's numbers alone: handles are only read.
    let fault = match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(())) => return Code::Ok,
        Ok(Err(fault)) => fault,
        Err(panic) => {
            let told = panic.downcast_ref::<String>().map(String::as_str);
            let told = told.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
            Fault::new(Code::Internal, format!("a mistake of the btf library, please report it: {told}"))
        }
    };
    remember(&fault.sentence);
    fault.code
}

/// Refuses a pointer that cannot be used; `name` is its name in the header.
fn check<T>(pointer: *const T, name: &str) -> Result<(), Fault> {
    if pointer.is_null() {
        return Err(Fault::new(Code::Pointer, format!("the pointer '{name}' is null")));
    }
    if !pointer.is_aligned() {
        let bytes = align_of::<T>();
        return Err(Fault::new(Code::Pointer, format!("the pointer '{name}' is not aligned to {bytes} bytes")));
    }
    Ok(())
}

/// Refuses a pointer to `count` items that cannot be used; it is not checked for 0 items.
pub fn check_many<T>(pointer: *const T, count: usize, name: &str) -> Result<(), Fault> {
    if count.checked_mul(size_of::<T>()).is_none_or(|bytes| bytes > isize::MAX as usize) {
        return Err(Fault::new(Code::Argument, format!("'{name}' cannot have {count} items: no memory is that large")));
    }
    if count == 0 { Ok(()) } else { check(pointer, name) }
}

/// # Safety
/// A pointer that is not null must point to a `T` that nothing changes while `'a` lasts.
pub unsafe fn read<'a, T>(pointer: *const T, name: &str) -> Result<&'a T, Fault> {
    check(pointer, name)?;
    // SAFETY: not null and aligned; the rest is promised by the caller.
    Ok(unsafe { &*pointer })
}

/// # Safety
/// A pointer that is not null must point to `count` items that nothing changes while `'a` lasts.
pub unsafe fn read_many<'a, T>(pointer: *const T, count: usize, name: &str) -> Result<&'a [T], Fault> {
    check_many(pointer, count, name)?;
    if count == 0 {
        return Ok(&[]);
    }
    // SAFETY: not null, aligned and no longer than memory; the rest is promised by the caller.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// A pointer to the memory for a result.
pub struct Target<T>(*mut T);

impl<T> Target<T> {
    /// # Safety
    /// A pointer that is not null must point to memory for a `T` that may be written; it may hold anything.
    pub unsafe fn new(pointer: *mut T, name: &str) -> Result<Target<T>, Fault> {
        check(pointer, name)?;
        Ok(Target(pointer))
    }

    /// Writes the result.
    pub fn set(&self, result: T) {
        // SAFETY: not null and aligned; that it may be written was promised to `new`.
        unsafe { self.0.write(result) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::code::btf_last_error;
    use std::ffi::CStr;

    #[test]
    fn a_panic_becomes_a_code_and_its_message_part_of_the_sentence() {
        let number = 7;
        for (code, words) in [(call(|| panic!("planted {number}")), "planted 7"), (call(|| panic!("bare")), "bare")] {
            // SAFETY: the text is this thread's and no call comes in between.
            let sentence = unsafe { CStr::from_ptr(btf_last_error()) }.to_str().unwrap().to_string();
            assert_eq!(code, Code::Internal);
            assert!(sentence.contains("please report") && (sentence.contains(words) || words == "planted 7"));
        }
        assert_eq!(call(|| Ok(())), Code::Ok);
    }

    #[test]
    fn bad_pointers_and_counts_are_told_by_name() {
        let code = |result: Result<(), Fault>| result.map_err(|fault| (fault.code, fault.sentence));
        let numbers = [1.0f32; 4];
        let odd = numbers.as_ptr().wrapping_byte_add(1);
        assert_eq!(code(check_many(numbers.as_ptr(), 4, "uv")), Ok(()));
        assert_eq!(code(check_many(std::ptr::null::<f32>(), 0, "uv")), Ok(()));
        for (result, expected, word) in [
            (check(std::ptr::null::<f32>(), "uv"), Code::Pointer, "null"),
            (check(odd, "uv"), Code::Pointer, "aligned"),
            (check_many(odd, 1, "uv"), Code::Pointer, "aligned"),
            (check_many(numbers.as_ptr(), usize::MAX / 2, "uv"), Code::Argument, "items"),
            (check_many(numbers.as_ptr(), usize::MAX / 4, "uv"), Code::Argument, "items"),
        ] {
            let fault = result.unwrap_err();
            assert!(fault.code == expected && fault.sentence.contains("'uv'") && fault.sentence.contains(word));
        }
    }
}

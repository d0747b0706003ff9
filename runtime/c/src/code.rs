//! Error codes, a text for each, and the full sentence of a thread's last error.

use btf_runtime::FormatError;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};

/// The code that every call returns: 0, or the reason why the call did nothing. btf_last_error() has the full sentence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum Code {
    /// The call succeeded.
    Ok = 0,
    /// A pointer is null or not aligned for its type.
    Pointer = 1,
    /// A number is out of its range: a level, a count, an option.
    Argument = 2,
    /// The file cannot be read.
    File = 3,
    /// The bytes are no asset: they do not begin with "SPMM".
    NotAnAsset = 4,
    /// The asset is of a version that this library does not read.
    Version = 5,
    /// The bytes end too early, or go on behind the end of the asset.
    Length = 6,
    /// A checksum does not match: the bytes were changed in transit.
    Damaged = 7,
    /// The bytes break another rule of docs/reference/format.md.
    Invalid = 8,
    /// A mistake of this library. The handle may be used further; please report the sentence.
    Internal = 9,
}

impl Code {
    const ALL: [Code; 10] = [
        Code::Ok,
        Code::Pointer,
        Code::Argument,
        Code::File,
        Code::NotAnAsset,
        Code::Version,
        Code::Length,
        Code::Damaged,
        Code::Invalid,
        Code::Internal,
    ];

    fn text(self) -> &'static CStr {
        match self {
            Code::Ok => c"no error",
            Code::Pointer => c"a pointer is null or not aligned",
            Code::Argument => c"an argument is out of its range",
            Code::File => c"the file cannot be read",
            Code::NotAnAsset => c"the bytes are not an SPMM asset",
            Code::Version => c"the asset is of a version that this library does not read",
            Code::Length => c"the asset is cut off or has bytes appended",
            Code::Damaged => c"the asset is damaged",
            Code::Invalid => c"the asset is invalid",
            Code::Internal => c"a mistake of the btf library",
        }
    }
}

/// The reason why a call did nothing.
#[derive(Debug)]
pub struct Fault {
    pub code: Code,
    /// Sentence with the remedy.
    pub sentence: String,
}

impl Fault {
    pub fn new(code: Code, sentence: impl Into<String>) -> Fault {
        Fault { code, sentence: sentence.into() }
    }
}

impl From<FormatError> for Fault {
    fn from(error: FormatError) -> Fault {
        let code = match &error {
            FormatError::BadMagic { .. } => Code::NotAnAsset,
            FormatError::Version { .. } => Code::Version,
            FormatError::TooShort { .. } | FormatError::Length { .. } => Code::Length,
            FormatError::HeaderChecksum | FormatError::SectionChecksum { .. } => Code::Damaged,
            _ => Code::Invalid,
        };
        Fault::new(code, error.to_string())
    }
}

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Keeps the sentence for [`btf_last_error`].
pub fn remember(sentence: &str) {
    // A file's name may hold a zero, C's text may not.
    let text = CString::new(sentence.replace('\0', " ")).unwrap_or_default();
    // A thread that is ending keeps nothing.
    let _ = LAST.try_with(|last| *last.borrow_mut() = text);
}

/// Returns a few words for an error code, for example "the asset is damaged". `code` may be any number. The result is
/// never null, belongs to the library and stays for ever.
#[unsafe(no_mangle)]
pub extern "C" fn btf_error_text(code: i32) -> *const c_char {
    let known = Code::ALL.into_iter().find(|known| *known as i32 == code);
    known.map_or(c"no error code of this library", Code::text).as_ptr()
}

/// Returns the sentence of the last call of this thread that failed: the fault and the remedy. Calls that succeed leave
/// it. The text is empty where no call has failed, and never null; it belongs to the library and stays until the next
/// call of this thread that fails, or the thread's end.
#[unsafe(no_mangle)]
pub extern "C" fn btf_last_error() -> *const c_char {
    LAST.try_with(|last| last.borrow().as_ptr()).unwrap_or(c"".as_ptr())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text_of(code: i32) -> &'static str {
        // SAFETY: the text is a literal of this file.
        unsafe { CStr::from_ptr(btf_error_text(code)) }.to_str().unwrap()
    }

    #[test]
    fn every_code_has_a_text_of_its_own_and_any_other_number_a_text_too() {
        let texts: std::collections::BTreeSet<&str> = (0..Code::ALL.len() as i32).map(text_of).collect();
        assert_eq!(texts.len(), Code::ALL.len());
        for other in [-1, Code::ALL.len() as i32, i32::MAX, i32::MIN] {
            assert!(!texts.contains(text_of(other)));
        }
    }

    #[test]
    fn a_sentence_is_kept_by_its_own_thread_and_may_hold_any_character() {
        remember("of \"a\0b\" and µ");
        let own = || {
            // SAFETY: the text is this thread's and no call comes in between.
            unsafe { CStr::from_ptr(btf_last_error()) }.to_str().unwrap().to_string()
        };
        assert_eq!(own(), "of \"a b\" and µ");
        assert_eq!(std::thread::spawn(own).join().unwrap(), "");
    }
}

//! Resolves addresses of files beside a glTF file.

use std::path::{Path, PathBuf};

/// Returns the path of the file that an address in the glTF file `path` means.
pub fn beside(path: &Path, uri: &str) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).join(unescaped(uri))
}

/// Decodes the escaped bytes of an address; invalid escapes stay as they are.
fn unescaped(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let mut out = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let digits = uri.get(at + 1..at + 3).filter(|_| bytes[at] == b'%');
        match digits.and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
            Some(byte) => {
                out.push(byte);
                at += 3;
            }
            None => {
                out.push(bytes[at]);
                at += 1;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_unescaped_and_lie_beside_the_file() {
        assert_eq!(unescaped("a%20b%zz%2"), "a b%zz%2");
        assert_eq!(beside(Path::new("plants/maize.glb"), "maize%20leaf.toml"), Path::new("plants/maize leaf.toml"));
    }
}

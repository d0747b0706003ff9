//! Reads TOML files of bounded size and finds the line of a fault.

use std::path::Path;

/// Reads a text file of at most `most_bytes`. `what` says what such a file holds, with its article. The error is a verb
/// phrase to stand behind the file's name.
pub fn bounded_text(path: &Path, most_bytes: u64, what: &str) -> Result<String, String> {
    let unreadable = |error: std::io::Error| format!("cannot be read ({error})");
    let bytes = beginning(path, most_bytes + 1).map_err(unreadable)?;
    if bytes.len() as u64 > most_bytes {
        return Err(format!("is larger than the {most_bytes} bytes that {what} may have"));
    }
    String::from_utf8(bytes).map_err(|_| "is no text".into())
}

/// Reads at most `most_bytes` of a file.
#[cfg(not(target_arch = "wasm32"))]
fn beginning(path: &Path, most_bytes: u64) -> std::io::Result<Vec<u8>> {
    use std::io::Read;
    let mut bytes = Vec::new();
    std::fs::File::open(path)?.take(most_bytes).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads a file, which lies in memory already.
#[cfg(target_arch = "wasm32")]
fn beginning(path: &Path, _: u64) -> std::io::Result<Vec<u8>> {
    crate::files::read(path)
}

/// Returns the line of a TOML fault, counted from 1, and its reason on one line.
pub fn line_and_reason(text: &str, error: &toml::de::Error) -> (usize, String) {
    let at = error.span().map_or(0, |span| span.start).min(text.len());
    let line = text.as_bytes()[..at].iter().filter(|&&byte| byte == b'\n').count() + 1;
    (line, error.message().split_whitespace().collect::<Vec<_>>().join(" "))
}

/// Returns a sentence that quotes a file as one line: control characters, which texts in TOML may hold, as escapes.
pub fn one_line(sentence: &str) -> String {
    let shown = |c: char| if c.is_control() { c.escape_default().to_string() } else { c.to_string() };
    sentence.chars().map(shown).collect()
}

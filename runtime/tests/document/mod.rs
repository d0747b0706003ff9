//! Shared parts of the tests of the formats' documents: their fenced blocks, and the readers written from them.

use std::path::Path;
use std::process::{Command, Output};

/// Returns the lines of a document's fenced block with this info string.
pub fn block(document: &'static str, name: &str) -> Vec<&'static str> {
    let fence = format!("```{name}");
    let mut lines = document.lines().skip_while(|line| *line != fence);
    assert!(lines.next().is_some(), "the document has no block {name}");
    lines.take_while(|line| *line != "```").collect()
}

/// Returns the bytes of a dump with rows `offset  bytes in hex  | remark`; the bytes between rows are zero, up to the
/// row `end`.
pub fn bytes_from_dump(lines: &[&str]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for line in lines {
        let mut words = line.split('|').next().unwrap_or("").split_whitespace();
        let Some(offset) = words.next() else { continue };
        let offset = usize::from_str_radix(offset, 16).expect("an offset in hex");
        assert!(offset >= bytes.len(), "rows rise: {line}");
        bytes.resize(offset, 0);
        bytes.extend(words.map(|byte| u8::from_str_radix(byte, 16).expect("a byte in hex")));
    }
    bytes
}

/// Returns the command of a reader in Python, of `tests/peers`.
pub fn python(script: &str) -> Command {
    let mut command = Command::new(if cfg!(windows) { "python" } else { "python3" });
    // What Python compiles stays out of the sources.
    command.env("PYTHONPYCACHEPREFIX", Path::new(env!("CARGO_TARGET_TMPDIR")).join("pycache"));
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/peers").join(script));
    command
}

/// Runs a command and returns its output.
pub fn output_of(command: &mut Command) -> Output {
    command.output().unwrap_or_else(|error| {
        panic!(
            "the readers written from the documents need Python 3.9 or newer as {:?}: install it (Debian: apt-get \
             install python3): {error}",
            command.get_program()
        )
    })
}

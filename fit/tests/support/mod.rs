//! What the tests of the program share.

use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Runs the program in `folder`.
pub fn btf_fit(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_btf-fit"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .expect("btf-fit starts")
}

/// Exit code and the single line on stderr.
pub fn refusal(output: &Output) -> (i32, String) {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(text.trim_end().lines().count(), 1, "one sentence, not: {text}");
    assert!(text.starts_with("error: ") && !text.contains("panicked"), "{text}");
    (output.status.code().unwrap_or(-1), text)
}

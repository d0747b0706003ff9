//! An X server without a screen (Xvfb) and a hand for mouse and keys (xdotool), for the test that opens the viewer's
//! window.

use super::apt::{self, Program};
use crate::failure::Failure;

const PROGRAMS: [Program; 2] = [
    Program { name: "Xvfb", package: "xvfb", question: "-help" },
    Program { name: "xdotool", package: "xdotool", question: "--version" },
];

/// Finds both programs or installs them. Returns one line that says so.
pub fn ensure() -> Result<String, Failure> {
    apt::ensure(&PROGRAMS.each_ref(), &advice).map(|_| "Xvfb and xdotool are here".to_string())
}

fn advice(missing: &[&str]) -> String {
    format!(
        "the test of the viewer's window needs {}: install it (Debian, Ubuntu: apt-get install {}), or set BTF_SKIP_GPU=1 \
         to leave this test out",
        missing.join(" and "),
        missing.join(" ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn advice_is_one_sentence_with_the_remedy() {
        let sentence = advice(&["xvfb", "xdotool"]);
        assert!(sentence.contains("apt-get install xvfb xdotool") && !sentence.contains('\n'));
    }
}

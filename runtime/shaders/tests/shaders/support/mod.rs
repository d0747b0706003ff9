//! Shared parts of the tests.

#![allow(dead_code, reason = "each test file takes what it needs of these")]

pub mod gpu;
pub mod tools;

use std::io::Write;

/// Prints that `what` is left out; `cargo xtask test` counts it as a skipped test.
pub fn skip(what: &str) {
    println!("skipped: {what}");
    if let Some(log) = std::env::var_os("BTF_SKIP_LOG") {
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(log).expect("the skip log opens");
        writeln!(file, "{what}").expect("the skip log is written");
    }
}

/// Returns whether an environment variable is 1.
pub fn is_set(variable: &str) -> bool {
    std::env::var_os(variable).is_some_and(|value| value == "1")
}

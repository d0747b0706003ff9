//! `cargo xtask check`: what every edit needs and no test sees.

use crate::arguments;
use crate::checks::{links, locks, rooms, words};
use crate::chores::fuzz;
use crate::failure::Failure;
use crate::shell::{cargo, root, run_checked};

/// Arguments of cargo that check the format without writing.
pub const FORMAT: &[&str] = &["fmt", "--all", "--check"];
/// Arguments of cargo that run clippy with warnings as errors.
pub const CLIPPY: &[&str] = &["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"];
/// Arguments of cargo that run clippy over the viewer as the demo builds it.
pub const CLIPPY_WITHOUT_WINDOW: &[&str] =
    &["clippy", "--package", "btf-viewer", "--no-default-features", "--", "-D", "warnings"];

/// Arguments of cargo that build the documentation of the code.
pub const DOCS: &[&str] = &["doc", "--workspace", "--no-deps"];
/// Variable, and its value, by which a warning of rustdoc is an error.
pub const DOCS_FLAGS: (&str, &str) = ("RUSTDOCFLAGS", "-D warnings");

const HELP: &str = "\
Checks that the folders inside the packages use each other without cycles, the words and the links of the documents, the lock
files, the format, lints and the documentation of the code.

Usage: cargo xtask check";

/// Runs the chore: first the checks that take a second.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if !arguments::none("check", HELP, arguments)? {
        return Ok(());
    }
    for check in [rooms::check, words::check, links::check] {
        println!("{}", check(&root()).map_err(Failure::new)?);
    }
    println!("{}", locks::check(&root(), fuzz::folders()).map_err(Failure::new)?);
    for arguments in [FORMAT, CLIPPY, CLIPPY_WITHOUT_WINDOW] {
        run_checked(&mut cargo(arguments))?;
    }
    run_checked(cargo(DOCS).env(DOCS_FLAGS.0, DOCS_FLAGS.1))
}

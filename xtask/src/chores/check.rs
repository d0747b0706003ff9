//! `cargo xtask check`: format and clippy, the two that every edit needs.

use crate::arguments;
use crate::checks::rooms;
use crate::failure::Failure;
use crate::shell::{cargo, root, run_checked};

/// Arguments of cargo that check the format without writing.
pub const FORMAT: &[&str] = &["fmt", "--all", "--check"];
/// Arguments of cargo that run clippy with warnings as errors.
pub const CLIPPY: &[&str] = &["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"];
/// Arguments of cargo that run clippy over the viewer as the demo builds it.
pub const CLIPPY_WITHOUT_WINDOW: &[&str] =
    &["clippy", "--package", "btf-viewer", "--no-default-features", "--", "-D", "warnings"];

const HELP: &str = "\
Checks format, lints, and that the folders inside the packages use each other without cycles.

Usage: cargo xtask check";

/// Runs the chore: the folders first, because that takes a second.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if !arguments::none("check", HELP, arguments)? {
        return Ok(());
    }
    println!("{}", rooms::check(&root()).map_err(Failure::new)?);
    run_checked(&mut cargo(FORMAT))?;
    run_checked(&mut cargo(CLIPPY))?;
    run_checked(&mut cargo(CLIPPY_WITHOUT_WINDOW))
}

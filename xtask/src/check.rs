//! `cargo xtask check`: format and clippy, the two that every edit needs.

use crate::failure::Failure;
use crate::rooms;
use crate::shell::{cargo, root, run_checked};

/// `cargo fmt` without writing.
pub const FORMAT: &[&str] = &["fmt", "--all", "--check"];
/// Clippy with warnings as errors.
pub const CLIPPY: &[&str] = &["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"];

/// Runs both.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if crate::asks_for_help(arguments) {
        println!(
            "Checks format, lints, and that the folders inside the packages use each other without cycles.\n\nUsage: cargo xtask check"
        );
        return Ok(());
    }
    if let Some(unknown) = arguments.first() {
        return Err(Failure::usage(format!("`check` takes no argument, it was given '{unknown}'")));
    }
    println!("{}", rooms::check(&root()).map_err(Failure::new)?);
    run_checked(&mut cargo(FORMAT))?;
    run_checked(&mut cargo(CLIPPY))
}

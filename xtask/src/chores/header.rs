//! `cargo xtask header`.

use crate::arguments;
use crate::checks::header;
use crate::failure::Failure;

const HELP: &str = "\
Writes the C header runtime/c/include/btf.h from runtime/c/src.

Usage: cargo xtask header

`cargo xtask test` fails where the header in the repository is another one.";

/// Runs the chore.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if arguments::none("header", HELP, arguments)? {
        println!("{}", header::write()?);
    }
    Ok(())
}

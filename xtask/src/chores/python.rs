//! `cargo xtask python`.

use crate::arguments;
use crate::failure::Failure;
use crate::metadata::Metadata;
use crate::tools::peers;
use crate::tools::python_module::{self, Build};

const HELP: &str = "\
Builds the wheel of the Python module, installs it under the target folder (peers/btf) and runs its tests there. Python,
maturin and numpy are those of the comparisons with Mitsuba (peers/mitsuba), which are installed where they are missing.

Usage: cargo xtask python

The wheel is in target/peers/wheels: pip install target/peers/wheels/btf-*.whl";

/// Runs the chore.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if arguments::none("python", HELP, arguments)? {
        let target = Metadata::read()?.target_directory;
        println!("{}", peers::ensure(&target)?);
        println!("{}", python_module::build_and_test(&target, Build::Release)?);
    }
    Ok(())
}

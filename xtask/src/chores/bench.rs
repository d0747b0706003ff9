//! `cargo xtask bench`.

use crate::arguments::asks_for_help;
use crate::failure::Failure;
use crate::shell::{cargo, run_checked};

const HELP: &str = "\
Times reading, clustering, fitting, decoding and leaf optics with criterion.

Usage: cargo xtask bench [CRITERION ARGUMENTS]

Example: cargo xtask bench decode";

/// Runs the benches of the tests package. Passes all arguments on to them.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if asks_for_help(arguments) {
        println!("{HELP}");
        return Ok(());
    }
    let mut command = cargo(&["bench", "--package", "btf-tests", "--benches", "--"]);
    run_checked(command.args(arguments))
}

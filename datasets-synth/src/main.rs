//! `btf-synth`: synthetic captures and virtual instruments from the command line.

mod commands;

use std::process::ExitCode;

fn main() -> ExitCode {
    commands::run()
}

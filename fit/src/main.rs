//! `btf-fit`: fits a capture and packs it; expands, compares, describes and checks what was packed.

mod commands;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    commands::run(commands::Cli::parse()).into()
}

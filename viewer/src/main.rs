//! `btf-view`: shows packed BTF assets in a window, or renders them into a picture.

mod cli;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    cli::run(&cli::Arguments::parse())
}

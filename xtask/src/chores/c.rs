//! `cargo xtask c`.

use crate::arguments::asks_for_help;
use crate::failure::Failure;
use crate::metadata::Metadata;
use crate::tools::c_package;
use std::path::PathBuf;

const HELP: &str = "\
Builds libbtf and installs it: btf.h and btf.hpp, the shared and the static library, and what CMake (find_package(btf)) and
pkg-config need to find them. A prefix may be moved afterwards.

Usage: cargo xtask c [--prefix FOLDER]

  --prefix FOLDER   where to install; target/c/btf without it

Example: cargo xtask c --prefix ~/.local && cmake -S runtime/c/examples/cmake -B build -DCMAKE_PREFIX_PATH=~/.local";

/// Runs the chore.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if asks_for_help(arguments) {
        println!("{HELP}");
        return Ok(());
    }
    let target = Metadata::read()?.target_directory;
    let prefix = match arguments {
        [] => target.join("c/btf"),
        [option, folder] if option == "--prefix" => PathBuf::from(folder),
        _ => return Err(Failure::usage("`c` takes --prefix FOLDER or nothing".to_string())),
    };
    c_package::install(&target, &prefix, "release")?;
    println!("{}", prefix.display());
    Ok(())
}

//! `cargo xtask web`.

use crate::arguments;
use crate::failure::Failure;
use crate::metadata::Metadata;
use crate::tools::{wasm, web_package};

const HELP: &str = "\
Makes the package for browsers and Node.js below the target folder (web/btf-runtime), as npm takes it, and runs its tests: the
C interface compiled to WebAssembly, scripts, types, and the decoder in WGSL.

Usage: cargo xtask web

It needs Rust's standard library for WebAssembly: `rustup target add wasm32-unknown-unknown`.
Example: cargo xtask web && npm install target/web/btf-runtime";

/// The profile in which users get it.
const PROFILE: &str = "release";

/// Runs the chore.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if arguments::none("web", HELP, arguments)? {
        let target = Metadata::read()?.target_directory;
        println!("{}", wasm::ensure(&target)?);
        let package = web_package::build(&target, PROFILE)?;
        println!("{}", web_package::test(&target, &package, PROFILE)?);
        println!("{}", package.display());
    }
    Ok(())
}

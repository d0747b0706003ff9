//! `cargo xtask setup`.

use crate::arguments;
use crate::failure::Failure;
use crate::metadata::Metadata;
use crate::tools::{asset_tools, browser, compilers, driver, peers, shader_tools, wasm, wasm_bindgen, window_tools};

const HELP: &str = "\
Installs what the tests need besides Rust (Debian packages as root, packages of npm below the target folder), or says what
to install: the software Vulkan driver of the GPU tests, Xvfb and xdotool for the test of the window, compilers and valgrind
for the tests in C, the sources of Rust's standard library for WebAssembly, wasm-bindgen, Chromium and Playwright, and the programs that check
shaders and exported files. BTF_SKIP_PEERS=1 leaves these last programs out.

Usage: cargo xtask setup";

/// Runs the chore: goes on after a tool that cannot be installed, and fails at the end.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if !arguments::none("setup", HELP, arguments)? {
        return Ok(());
    }
    let target = Metadata::read()?.target_directory;
    let mut tools = vec![driver::ensure(), window_tools::ensure(), compilers::ensure()];
    tools.extend([wasm::ensure(&target), wasm_bindgen::ensure(&target), browser::ensure(&target)]);
    if !peers::left_out() {
        tools.extend([
            shader_tools::ensure_validators(),
            shader_tools::ensure_dawn(&target),
            asset_tools::ensure(&target),
        ]);
    }
    let mut missing = 0;
    for tool in tools {
        match tool {
            Ok(said) => println!("{said}"),
            Err(failure) => {
                eprintln!("error: {failure}");
                missing += 1;
            }
        }
    }
    match missing {
        0 => Ok(()),
        _ => Err(Failure::new(format!("{missing} of the tools above are missing"))),
    }
}

//! `cargo xtask web`.

use crate::arguments::asks_for_help;
use crate::failure::Failure;
use crate::files::bytes_of;
use crate::metadata::Metadata;
use crate::tools::{viewer_page, wasm, wasm_bindgen, web_package};
use std::path::{Path, PathBuf};

const HELP: &str = "\
Makes what browsers run, below the target folder: the package `btf-runtime` as npm takes it (web/btf-runtime), with its tests in
Node.js, and the viewer as a page (web/btf-view).

Usage: cargo xtask web [--publish FOLDER]

  --publish FOLDER   also copies the page into a folder that any static host serves

It needs Rust's standard library for WebAssembly: `rustup target add wasm32-unknown-unknown`.
Example: cargo xtask web --publish public && python3 -m http.server --directory public";

/// The profile in which users get the package.
const PROFILE: &str = "release";
/// The profile in which users get the page: browsers load it.
const PAGE_PROFILE: &str = "web";

/// Runs the chore.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if asks_for_help(arguments) {
        println!("{HELP}");
        return Ok(());
    }
    let publish = match arguments {
        [] => None,
        [option, folder] if option == "--publish" => Some(PathBuf::from(folder)),
        _ => return Err(Failure::usage("`web` takes --publish FOLDER or nothing".to_string())),
    };
    let target = Metadata::read()?.target_directory;
    println!("{}", wasm::ensure(&target)?);
    println!("{}", wasm_bindgen::ensure(&target)?);
    let package = web_package::build(&target, PROFILE)?;
    let counts = web_package::test(&target, &package, PROFILE)?;
    println!("{counts}");
    if counts.failed > 0 {
        return Err(Failure::new("the package answers wrongly".to_string()));
    }
    let page = viewer_page::build(&target, PAGE_PROFILE)?;
    println!("{}", package.display());
    tell(&page)?;
    if let Some(folder) = publish {
        viewer_page::publish(&page, &folder)?;
        tell(&folder)?;
    }
    Ok(())
}

fn tell(page: &Path) -> Result<(), Failure> {
    println!("{} ({:.1} MB)", page.display(), bytes_of(page)? as f64 / 1e6);
    Ok(())
}

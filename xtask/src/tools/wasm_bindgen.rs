//! The program wasm-bindgen, which writes the scripts between WebAssembly and a browser: cargo installs it below the target
//! folder, in the version of our library of that name.

use crate::failure::Failure;
use crate::shell::{answer_of, cargo, run_checked};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The version of the library, see Cargo.toml: both must be of one.
const VERSION: &str = "0.2.130";
/// The folder below the target folder.
const FOLDER: &str = "peers/wasm-bindgen";

/// Returns where the program is below the target folder.
pub fn program(target: &Path) -> PathBuf {
    target.join(FOLDER).join("bin").join(if cfg!(windows) { "wasm-bindgen.exe" } else { "wasm-bindgen" })
}

/// Finds or installs the program. Returns one line that says so.
pub fn ensure(target: &Path) -> Result<String, Failure> {
    let path = program(target);
    let version = || answer_of(Command::new(&path).arg("--version"));
    let is_right = |answer: &String| answer.trim() == format!("wasm-bindgen {VERSION}");
    if version().filter(is_right).is_none() {
        let folder = target.join(FOLDER);
        let build = folder.join("build");
        let package = format!("wasm-bindgen-cli@{VERSION}");
        // Without its test runner, which serves pages.
        let mut install = cargo(&["install", "--debug", "--no-default-features", "--bin", "wasm-bindgen", "--force"]);
        install.arg("--root").arg(&folder).arg("--target-dir").arg(&build).arg(&package);
        run_checked(&mut install)
            .map_err(|failure| Failure::new(format!("{failure}; set BTF_SKIP_WEB=1 to leave pages out")))?;
        // Some hundreds of megabytes that nobody needs again.
        let _ = std::fs::remove_dir_all(build);
    }
    match version().filter(is_right) {
        Some(answer) => Ok(format!("{} is in {}", answer.trim(), path.display())),
        None => Err(Failure::new(format!("{} does not answer as wasm-bindgen {VERSION}", path.display()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::root;

    #[test]
    fn program_and_library_are_of_one_version() {
        let manifest = std::fs::read_to_string(root().join("Cargo.toml")).unwrap();
        assert!(manifest.contains(&format!("wasm-bindgen = \"={VERSION}\"")), "Cargo.toml names another version");
    }
}

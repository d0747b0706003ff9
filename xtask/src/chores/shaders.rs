//! `cargo xtask shaders`: the decoder as complete compute shaders, written to a folder.

use crate::arguments::asks_for_help;
use crate::failure::Failure;
use crate::metadata::Metadata;
use crate::shell::{cargo, run_checked};
use std::path::PathBuf;

const HELP: &str = "\
Writes the decoder's WGSL library (btf.wgsl) and complete compute shaders over it in WGSL, HLSL, MSL, GLSL
(ES 3.10 and 4.60) and SPIR-V, with a README.md that has bindings, layouts and entry points. Needs no GPU.

Usage: cargo xtask shaders [-o FOLDER]

  -o, --out FOLDER   where they go [default: target/shaders]

Example: cargo xtask shaders -o ../engine/shaders/btf";

/// Runs the chore. Overwrites files of the same names.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if asks_for_help(arguments) {
        println!("{HELP}");
        return Ok(());
    }
    let out = match parse(arguments)? {
        // Relative to where the user is; the program runs in the repository's root.
        Some(out) => std::path::absolute(&out)
            .map_err(|error| Failure::new(format!("{} is no folder name: {error}", out.display())))?,
        None => Metadata::read()?.target_directory.join("shaders"),
    };
    run_checked(cargo(&["run", "--quiet", "--package", "btf-shaders", "--"]).arg(out))
}

/// Returns the folder that the user names.
fn parse(arguments: &[String]) -> Result<Option<PathBuf>, Failure> {
    match arguments {
        [] => Ok(None),
        [name, folder] if ["-o", "--out"].contains(&name.as_str()) && !folder.is_empty() => Ok(Some(folder.into())),
        [name] if ["-o", "--out"].contains(&name.as_str()) => {
            Err(Failure::usage(format!("{name} needs a folder\n\n{HELP}")))
        }
        _ => Err(Failure::usage(format!("`shaders` does not know '{}'\n\n{HELP}", arguments.join(" ")))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_read_and_anything_else_is_bad_usage() {
        let parse = |words: &[&str]| parse(&words.iter().map(ToString::to_string).collect::<Vec<_>>());
        assert_eq!(parse(&[]).unwrap(), None);
        assert_eq!(parse(&["-o", "a"]).unwrap(), Some(PathBuf::from("a")));
        assert_eq!(parse(&["--out", "b/c"]).unwrap(), Some(PathBuf::from("b/c")));
        for words in [&["-o"][..], &["-o", ""], &["a"], &["-o", "a", "b"]] {
            assert_eq!(parse(words).unwrap_err().exit_code(), 2, "{words:?}");
        }
    }
}

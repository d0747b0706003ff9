//! `cargo xtask CHORE`: every chore of the repository, in Rust, with nothing to install first.
//!
//! | Folder | Contents |
//! |---|---|
//! | `chores` | the chores, one file each |
//! | `suite` | `cargo xtask test`: the steps of CI, and how many tests passed, failed and were skipped |
//! | `checks` | our own checks: arrows between packages, folders, licences, words, the C header |
//! | `tools` | programs of others that tests need: finds or installs them |
//!
//! A library, because features of dependencies are chosen for the packages that a command of cargo builds, and `cargo test --doc`
//! builds those that have one: without it, it would compile half of the workspace anew.
//!
//! Exit codes: 0 success, 1 a failure, 2 bad usage. Where a program fails that a chore started, its exit code is passed
//! on.

mod arguments;
mod checks;
mod chores;
mod counts;
mod failure;
mod files;
mod gpu_goals;
mod gpu_page;
mod gpu_results;
mod metadata;
mod shell;
mod suite;
mod tools;

use chores::{
    bench, blender, book, c, check, cost, demo, fuzz, gpu_report, header, priors, python, setup, shaders, volumes, web,
};
use failure::Failure;
use std::process::ExitCode;

const HELP: &str = "\
Usage: cargo xtask CHORE [OPTIONS]

Chores:
  demo    make a leaf capture, fit it, measure it and render a picture of it
  test    everything that CI runs; --quick is the tier for every edit
  check   what takes a minute and no test sees: words, links, lock files, format, clippy, docs
  bench   time reading, clustering, fitting and decoding (criterion)
  blender build, install and test the add-on for Blender
  c       build and install the library for C and C++
  book    make a site of the documents, target/book
  cost    time fits, and learn what `btf-fit library plan --estimate` tells hours by
  fuzz    fuzz the packed formats and the readers of models and captures with libFuzzer
  gpu-report
          write what `btf-view bench gpu` measured as a page of the documents
  priors  learn the priors of `btf-fit fit`
  python  build, install and test the Python module
  header  write the C header from the sources of the C interface
  shaders write the decoder in WGSL, HLSL, MSL, GLSL and SPIR-V
  volumes build the volumes of `btf-view scene`
  web     make the package for browsers and Node.js
  setup   install what the tests need besides Rust: a software Vulkan driver, valgrind, judges of shaders and files

`cargo xtask CHORE --help` tells more, with an example.";

/// Runs the chore that the program's arguments name, and says what failed. Returns the exit code.
pub fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            // A failed suite has said everything above its closing line.
            if !failure.to_string().is_empty() {
                eprintln!("error: {failure}");
            }
            ExitCode::from(failure.exit_code())
        }
    }
}

/// Runs the chore that the arguments name.
fn run(arguments: &[String]) -> Result<(), Failure> {
    let Some((chore, rest)) = arguments.split_first() else {
        return Err(Failure::usage(format!("a chore is missing\n\n{HELP}")));
    };
    match chore.as_str() {
        "demo" => demo::run(rest),
        "test" => suite::run(rest),
        "c" => c::run(rest),
        "check" => check::run(rest),
        "bench" => bench::run(rest),
        "blender" => blender::run(rest),
        "book" => book::run(rest),
        "cost" => cost::run(rest),
        "fuzz" => fuzz::run(rest),
        "gpu-report" => gpu_report::run(rest),
        "python" => python::run(rest),
        "header" => header::run(rest),
        "priors" => priors::run(rest),
        "setup" => setup::run(rest),
        "shaders" => shaders::run(rest),
        "volumes" => volumes::run(rest),
        "web" => web::run(rest),
        "-h" | "--help" | "help" => {
            println!("{HELP}");
            Ok(())
        }
        unknown => Err(Failure::usage(format!("there is no chore '{unknown}'\n\n{HELP}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHORES: [&str; 13] = [
        "demo",
        "test",
        "check",
        "bench",
        "book",
        "fuzz",
        "gpu-report",
        "python",
        "header",
        "shaders",
        "volumes",
        "web",
        "setup",
    ];

    fn exit_code_of(arguments: &[&str]) -> u8 {
        let arguments: Vec<String> = arguments.iter().map(ToString::to_string).collect();
        run(&arguments).err().map_or(0, |failure| failure.exit_code())
    }

    #[test]
    fn an_unknown_chore_is_bad_usage_and_the_list_is_shown() {
        let failure = run(&["brew".to_string()]).unwrap_err();
        assert_eq!(failure.exit_code(), 2);
        assert!(failure.to_string().contains("no chore 'brew'"));
        for chore in CHORES {
            assert!(failure.to_string().contains(chore), "{chore} is not in the list");
        }
    }

    #[test]
    fn bad_options_of_every_chore_are_bad_usage() {
        assert_eq!(exit_code_of(&[]), 2);
        assert_eq!(exit_code_of(&["test", "--fast"]), 2);
        assert_eq!(exit_code_of(&["demo", "--size", "large"]), 2);
        assert_eq!(exit_code_of(&["demo", "--out"]), 2);
        assert_eq!(exit_code_of(&["check", "now"]), 2);
        assert_eq!(exit_code_of(&["book", "now"]), 2);
        assert_eq!(exit_code_of(&["fuzz", "now"]), 2);
        assert_eq!(exit_code_of(&["fuzz", "--runs", "many"]), 2);
        assert_eq!(exit_code_of(&["gpu-report"]), 2);
        assert_eq!(exit_code_of(&["gpu-report", "a", "b"]), 2);
        assert_eq!(exit_code_of(&["python", "now"]), 2);
        assert_eq!(exit_code_of(&["header", "now"]), 2);
        assert_eq!(exit_code_of(&["setup", "now"]), 2);
        assert_eq!(exit_code_of(&["volumes", "now"]), 2);
    }

    #[test]
    fn help_is_no_failure() {
        assert_eq!(exit_code_of(&["--help"]), 0);
        for chore in CHORES {
            assert_eq!(exit_code_of(&[chore, "--help"]), 0);
        }
    }
}

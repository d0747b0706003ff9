//! `cargo xtask fuzz`: runs the fuzz targets of the packed formats and of the readers of models and captures with libFuzzer, on
//! the toolchain at hand. The crates are laid out for cargo-fuzz as well; this needs neither it nor a nightly toolchain, only a
//! C++ compiler, because the fuzzed crates have no unsafe code that a sanitizer would have to watch.

use crate::arguments::asks_for_help;
use crate::failure::Failure;
use crate::shell::{self, answer_of, root, run_and_read, run_checked};
use std::path::{Path, PathBuf};
use std::process::Command;

/// A workspace of fuzz targets.
struct Workspace {
    /// Folder of the workspace in the repository.
    folder: &'static str,
    /// Targets, each with the folders of `corpus` that it starts from.
    targets: &'static [(&'static str, &'static [&'static str])],
}

/// Workspaces that are fuzzed.
const WORKSPACES: [Workspace; 2] = [
    Workspace {
        folder: "runtime/fuzz",
        targets: &[
            ("parse", &["parse"]),
            ("resident", &["resident"]),
            ("round_trip", &["round_trip"]),
            ("validate", &["validate", "parse", "resident"]),
            ("voltex", &["voltex"]),
        ],
    },
    Workspace {
        folder: "models/fuzz",
        targets: &[
            ("glb", &["glb"]),
            ("gltf", &["gltf"]),
            ("obj", &["obj"]),
            ("shapes", &["shapes"]),
            ("leaf", &["leaf"]),
            ("manifest", &["manifest"]),
            ("list", &["list"]),
            ("ubo2014", &["ubo2014"]),
        ],
    },
];

/// Returns the folders of the workspaces that are fuzzed.
pub fn folders() -> impl Iterator<Item = &'static str> {
    WORKSPACES.iter().map(|workspace| workspace.folder)
}

/// Default number of executions of a target, which take some seconds.
pub const RUNS: u64 = 20_000;

/// Argument of libFuzzer that bounds an input, bytes.
const MAX_BYTES: &str = "-max_len=32768";

/// Flags of rustc that record which code a run reaches and what it compares: those of cargo-fuzz for
/// `--sanitizer none`.
const COVERAGE: &str = "--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares";

const HELP: &str = "\
Fuzzes the packed formats and the readers of models and captures with libFuzzer: anything is decoded, opened, validated or
made an asset of and written and read again. It needs a C++ compiler. What is found on the way stays under the target folder; an input that fails is kept there, named.

Usage: cargo xtask fuzz [TARGET] [--runs N]

  TARGET    parse, resident, round_trip, validate or voltex (runtime/fuzz), glb, gltf, obj, shapes, leaf, manifest, list or
            ubo2014 (models/fuzz); all of them if not given
  --runs N  executions of each target [default: 20000]

Example: cargo xtask fuzz parse --runs 3000000";

/// Runs the chore.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if asks_for_help(arguments) {
        println!("{HELP}");
        return Ok(());
    }
    let (mut only, mut runs) = (None, RUNS);
    let mut rest = arguments.iter().map(String::as_str);
    while let Some(argument) = rest.next() {
        match argument {
            "--runs" => {
                let number = rest.next().and_then(|number| number.parse().ok());
                runs = number.ok_or_else(|| Failure::usage(format!("--runs takes a number\n\n{HELP}")))?;
            }
            name if targets().any(|target| target == name) => only = Some(name.to_string()),
            _ => return Err(Failure::usage(format!("`fuzz` does not know '{argument}'\n\n{HELP}"))),
        }
    }
    if !has_compiler() {
        return Err(Failure::new("libFuzzer needs a C++ compiler; install one (Debian: apt-get install g++)"));
    }
    let target = crate::metadata::Metadata::read()?.target_directory;
    println!("{}", fuzz(&target, only.as_deref(), runs)?);
    Ok(())
}

/// Returns whether a C++ compiler is installed.
pub fn has_compiler() -> bool {
    answer_of(Command::new("c++").arg("--version")).is_some()
}

/// Names of all targets.
fn targets() -> impl Iterator<Item = &'static str> {
    WORKSPACES.iter().flat_map(|workspace| workspace.targets.iter().map(|(name, _)| *name))
}

/// Builds the targets and runs all or one. Returns one line that says how much was run.
pub fn fuzz(target: &Path, only: Option<&str>, runs: u64) -> Result<String, Failure> {
    let host = answer_of(Command::new("rustc").arg("-vV")).unwrap_or_default();
    let host = host.lines().find_map(|line| line.strip_prefix("host: ")).unwrap_or_default().to_string();
    let built = target.join("fuzz");
    let mut said = Vec::new();
    for workspace in &WORKSPACES {
        let wanted = |name: &str| only.is_none_or(|only| only == name);
        if !workspace.targets.iter().any(|(name, _)| wanted(name)) {
            continue;
        }
        let package = root().join(workspace.folder);
        let manifest = package.join("Cargo.toml");
        run_checked(shell::cargo(&["fmt", "--check", "--manifest-path"]).arg(&manifest))?;
        // With a target, flags are for its crates alone and not for build scripts.
        let mut build =
            shell::cargo(&["build", "--release", "--locked", "--bins", "--target", &host, "--manifest-path"]);
        run_checked(build.arg(&manifest).env("RUSTFLAGS", COVERAGE).env("CARGO_TARGET_DIR", &built))?;
        for (name, corpora) in workspace.targets.iter().filter(|(name, _)| wanted(name)) {
            let corpora = corpora.iter().map(|corpus| package.join("corpus").join(corpus));
            said.push(run_target(&built, &host, name, workspace.folder, &corpora.collect::<Vec<_>>(), runs)?);
        }
    }
    Ok(format!("executions without a finding: {}", said.join(", ")))
}

/// Runs one target that was built in the folder `built`, starting from `corpora`. Returns its name and its executions.
fn run_target(
    built: &Path,
    host: &str,
    name: &str,
    folder: &str,
    corpora: &[PathBuf],
    runs: u64,
) -> Result<String, Failure> {
    let found = built.join("corpus").join(name);
    std::fs::create_dir_all(&found)
        .map_err(|error| Failure::new(format!("{} cannot be made: {error}", found.display())))?;
    let mut command = Command::new(built.join(host).join("release").join(name));
    command.arg(MAX_BYTES).arg(format!("-runs={runs}")).args(["-seed=1", "-verbosity=0", "-print_final_stats=1"]);
    command.arg(format!("-artifact_prefix={}-", built.join(name).display())).arg(&found).args(corpora);
    let (status, output) = run_and_read(&mut command)?;
    if !status.success() {
        return Err(Failure::new(format!(
            "the fuzz target {name} failed; the input is named above: put it into {folder}/corpus/{name} and mend what it shows"
        )));
    }
    let executed = executed(&output).ok_or_else(|| Failure::new(format!("the fuzz target {name} ran nothing")))?;
    Ok(format!("{name} {executed}"))
}

/// Executions that libFuzzer counts in its closing words; `None` for none.
fn executed(output: &str) -> Option<u64> {
    let number = |line: &str| line.strip_prefix("stat::number_of_executed_units:")?.trim().parse().ok();
    output.lines().find_map(number).filter(|count| *count > 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_target_is_one_of_the_package_and_has_a_corpus() {
        for workspace in &WORKSPACES {
            let package = root().join(workspace.folder);
            let manifest = std::fs::read_to_string(package.join("Cargo.toml")).unwrap();
            for (name, corpora) in workspace.targets {
                assert!(manifest.contains(&format!("name = \"{name}\"")), "{name}");
                assert!(package.join("fuzz_targets").join(name).with_extension("rs").is_file(), "{name}");
                for corpus in *corpora {
                    assert!(std::fs::read_dir(package.join("corpus").join(corpus)).unwrap().count() >= 10, "{corpus}");
                }
            }
            assert_eq!(manifest.matches("[[bin]]").count(), workspace.targets.len());
        }
        let mut names: Vec<&str> = targets().collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), targets().count(), "targets are told apart by name alone");
    }

    #[test]
    fn the_count_is_read_and_none_is_none() {
        assert_eq!(executed("Done\nstat::number_of_executed_units: 2000\nstat::x: 1\n"), Some(2000));
        assert_eq!(executed("stat::number_of_executed_units: 0\n"), None);
        assert_eq!(executed("panicked"), None);
    }
}

//! `cargo xtask fuzz`: the fuzz targets of the format with libFuzzer, on the toolchain at hand. The crate is laid out for
//! cargo-fuzz as well; this needs neither it nor a nightly toolchain, only a C++ compiler, because the format's crate
//! has no unsafe code that a sanitizer would have to watch.

use crate::arguments::asks_for_help;
use crate::failure::Failure;
use crate::shell::{self, answer_of, root, run_and_read, run_checked};
use std::path::Path;
use std::process::Command;

/// Names of the fuzz targets, each with the folders of runtime/fuzz/corpus that it starts from.
const TARGETS: [(&str, &[&str]); 5] = [
    ("parse", &["parse"]),
    ("resident", &["resident"]),
    ("round_trip", &["round_trip"]),
    ("validate", &["validate", "parse", "resident"]),
    ("voltex", &["voltex"]),
];

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
Fuzzes the packed formats with libFuzzer: anything is decoded, opened, validated or made an asset of and written and read
again. It needs a C++ compiler. What is found on the way stays under the target folder; an input that fails is kept there, named.

Usage: cargo xtask fuzz [TARGET] [--runs N]

  TARGET    parse, resident, round_trip, validate or voltex; all of them if not given
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
            name if TARGETS.iter().any(|(target, _)| *target == name) => only = Some(name.to_string()),
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

/// Builds the fuzz targets and runs all of them, or the one that is named. Returns one line with the number of
/// executions.
pub fn fuzz(target: &Path, only: Option<&str>, runs: u64) -> Result<String, Failure> {
    let package = root().join("runtime/fuzz");
    let host = answer_of(Command::new("rustc").arg("-vV")).unwrap_or_default();
    let host = host.lines().find_map(|line| line.strip_prefix("host: ")).unwrap_or_default().to_string();
    let built = target.join("fuzz");
    let manifest = package.join("Cargo.toml");
    run_checked(shell::cargo(&["fmt", "--check", "--manifest-path"]).arg(&manifest))?;
    // With a target, flags are for its crates alone and not for build scripts.
    let mut build = shell::cargo(&["build", "--release", "--locked", "--bins", "--target", &host, "--manifest-path"]);
    run_checked(build.arg(&manifest).env("RUSTFLAGS", COVERAGE).env("CARGO_TARGET_DIR", &built))?;
    let mut said = Vec::new();
    for (name, corpora) in TARGETS.iter().filter(|(name, _)| only.is_none_or(|only| only == *name)) {
        let found = built.join("corpus").join(name);
        std::fs::create_dir_all(&found)
            .map_err(|error| Failure::new(format!("{} cannot be made: {error}", found.display())))?;
        let mut command = Command::new(built.join(&host).join("release").join(name));
        command.arg(MAX_BYTES).arg(format!("-runs={runs}")).args(["-seed=1", "-verbosity=0", "-print_final_stats=1"]);
        command.arg(format!("-artifact_prefix={}-", built.join(name).display())).arg(&found);
        command.args(corpora.iter().map(|corpus| package.join("corpus").join(corpus)));
        let (status, output) = run_and_read(&mut command)?;
        if !status.success() {
            return Err(Failure::new(format!(
                "the fuzz target {name} failed; the input is named above: put it into runtime/fuzz/corpus/{name} and mend what it shows"
            )));
        }
        let executed = executed(&output).ok_or_else(|| Failure::new(format!("the fuzz target {name} ran nothing")))?;
        said.push(format!("{name} {executed}"));
    }
    Ok(format!("executions without a finding: {}", said.join(", ")))
}

/// Returns the number of executions from libFuzzer's closing statistics, or `None` where nothing was executed.
fn executed(output: &str) -> Option<u64> {
    let number = |line: &str| line.strip_prefix("stat::number_of_executed_units:")?.trim().parse().ok();
    output.lines().find_map(number).filter(|count| *count > 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_target_is_one_of_the_package_and_has_a_corpus() {
        let package = root().join("runtime/fuzz");
        let manifest = std::fs::read_to_string(package.join("Cargo.toml")).unwrap();
        for (name, corpora) in TARGETS {
            assert!(manifest.contains(&format!("name = \"{name}\"")), "{name}");
            assert!(package.join("fuzz_targets").join(name).with_extension("rs").is_file(), "{name}");
            for corpus in corpora {
                assert!(std::fs::read_dir(package.join("corpus").join(corpus)).unwrap().count() >= 10, "{corpus}");
            }
        }
        assert_eq!(manifest.matches("[[bin]]").count(), TARGETS.len());
    }

    #[test]
    fn the_count_is_read_and_none_is_none() {
        assert_eq!(executed("Done\nstat::number_of_executed_units: 2000\nstat::x: 1\n"), Some(2000));
        assert_eq!(executed("stat::number_of_executed_units: 0\n"), None);
        assert_eq!(executed("panicked"), None);
    }
}

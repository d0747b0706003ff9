//! `cargo xtask test`: everything that CI runs, and its quick tier.

use crate::check::{CLIPPY, FORMAT};
use crate::counts::{Counts, cargo_test_failures, from_cargo_test, from_nextest, nextest_failures};
use crate::failure::Failure;
use crate::metadata::{Metadata, has_subcommand};
use crate::shell::{self, cargo, root, run_and_read};
use crate::{
    arrows, asset_tools, driver, fuzz, header, licences, links, memcheck, peers, python, rooms, shader_tools, words,
};
use std::path::{Path, PathBuf};
use std::time::Instant;

const HELP: &str = "\
Runs everything that CI runs: format, clippy, dependency arrows, licences, words, links of the documents, the C header, the
software Vulkan driver, compiler and valgrind for the tests in C, shader compilers, Mitsuba for comparison and the Python module (under
the target folder), fuzz targets for some seconds, tests, doc tests, docs. The last line sums it up: N passed, N failed, N skipped.

Usage: cargo xtask test [--quick]

  --quick   the tier for every edit: no GPU, no integration tests, no docs (under 5 minutes)

BTF_SKIP_GPU=1 leaves the GPU tests out, BTF_SKIP_PEERS=1 the comparisons with Mitsuba, the Python module and what
shader compilers say, BTF_SKIP_VALGRIND=1 the C interface under valgrind; all are counted as skipped. BTF_PEERS_PYTHON
names a Python that has Mitsuba and maturin already. BTF_DATA names the folder of the measured data, without which the
tests that use it are skipped.

Example: BTF_SKIP_GPU=1 cargo xtask test";

/// What has happened so far.
struct Suite {
    counts: Counts,
    failures: Vec<String>,
}

impl Suite {
    /// Runs one step; a failed check is one failed test, and no later step runs.
    fn step(&mut self, name: &str, work: impl FnOnce(&mut Suite) -> Result<Counts, String>) -> bool {
        if !self.failures.is_empty() {
            return false;
        }
        println!("\n== {name}");
        let start = Instant::now();
        let seconds = || start.elapsed().as_secs_f64();
        match work(self) {
            Ok(counts) => {
                self.counts += counts;
                println!("== {name}: {counts} ({:.0} s)", seconds());
                if counts.failed > 0 {
                    self.failures.push(name.to_string());
                }
            }
            Err(sentence) => {
                self.counts += Counts::FAILED;
                eprintln!("{sentence}");
                println!("== {name}: failed ({:.0} s)", seconds());
                self.failures.push(format!("{name}: {}", sentence.lines().next().unwrap_or_default()));
            }
        }
        self.failures.is_empty()
    }

    fn check(&mut self, name: &str, work: impl FnOnce() -> Result<String, String>) -> bool {
        self.step(name, |_| {
            println!("{}", work()?);
            Ok(Counts::PASSED)
        })
    }

    /// A step with programs that others have written, kept under the `target` folder; each sentence of `work` is a check passed.
    fn peer(&mut self, name: &str, target: Option<&Path>, work: impl FnOnce(&Path) -> Result<Vec<String>, Failure>) {
        self.step(name, |_| {
            if peers::left_out() {
                println!("left out: BTF_SKIP_PEERS=1");
                return Ok(Counts::SKIPPED);
            }
            let said = work(known(target)?).map_err(|failure| failure.to_string())?;
            said.iter().for_each(|sentence| println!("{sentence}"));
            Ok(Counts { passed: said.len(), ..Counts::default() })
        });
    }

    fn cargo(&mut self, name: &str, arguments: &[&str], variables: &[(&str, &str)]) -> bool {
        self.step(name, |_| {
            let mut command = cargo(arguments);
            command.envs(variables.iter().copied());
            match shell::run(&mut command) {
                Ok(status) if status.success() => Ok(Counts::PASSED),
                Ok(_) => Err(format!("`cargo {}` failed; run it alone to see more", arguments.join(" "))),
                Err(failure) => Err(failure.to_string()),
            }
        })
    }
}

fn known(target: Option<&Path>) -> Result<&Path, String> {
    target.ok_or_else(|| "the target folder is not known".to_string())
}

/// Runs the suite; the closing line is printed in every case.
fn run_suite(quick: bool) -> Result<(), Failure> {
    let skip_gpu = std::env::var_os("BTF_SKIP_GPU").is_some_and(|value| value == "1");
    let mut suite = Suite { counts: Counts::default(), failures: Vec::new() };
    suite.cargo("format", FORMAT, &[]);
    suite.cargo("clippy", CLIPPY, &[]);
    let metadata = match Metadata::read() {
        Ok(metadata) => Some(metadata),
        Err(failure) => {
            suite.step("metadata", |_| Err(failure.to_string()));
            None
        }
    };
    if let Some(metadata) = &metadata {
        suite.check("arrows", || arrows::check(metadata, &root()));
        suite.check("licences", || licences::check(metadata));
    }
    suite.check("rooms", || rooms::check(&root()));
    suite.check("words", || words::check(&root()));
    suite.check("links", || links::check(&root()));
    suite.check("header", header::check);
    if quick {
        suite.step("unit tests", |_| tests(&["--workspace", "--lib", "--bins"], None));
        suite.step("left out by --quick", |_| {
            println!("integration tests, GPU tests, doc tests and docs: `cargo xtask test` runs them");
            Ok(Counts::SKIPPED)
        });
    } else {
        suite.step("driver", |_| {
            if skip_gpu {
                println!("left out: BTF_SKIP_GPU=1");
                return Ok(Counts::SKIPPED);
            }
            println!("{}", driver::ensure().map_err(|failure| failure.to_string())?);
            Ok(Counts::PASSED)
        });
        suite.check("tools for C", || memcheck::ensure().map_err(|failure| failure.to_string()));
        let target = metadata.as_ref().map(|metadata| metadata.target_directory.as_path());
        suite.peer("shader tools", target, |target| shader_tools::ensure(target).map(|said| vec![said]));
        suite.peer("asset tools", target, |target| asset_tools::ensure(target).map(|said| vec![said]));
        suite.peer("peers", target, |target| Ok(vec![peers::ensure(target)?, peers::check_rivals(target)?]));
        suite.peer("python", target, |target| python::build_and_test(target).map(|said| vec![said]));
        suite.step("fuzz", |_| {
            if !fuzz::has_compiler() {
                println!("left out: no C++ compiler");
                return Ok(Counts::SKIPPED);
            }
            println!("{}", fuzz::fuzz(known(target)?, None, fuzz::RUNS).map_err(|failure| failure.to_string())?);
            Ok(Counts::PASSED)
        });
        let log = target.map(|target| target.join("skipped-tests.txt"));
        suite.step("tests", |_| tests(&["--workspace"], log.as_deref()));
        suite.step("doc tests", |_| doc_tests());
        suite.cargo("docs", &["doc", "--workspace", "--no-deps"], &[("RUSTDOCFLAGS", "-D warnings")]);
    }
    println!();
    for failure in &suite.failures {
        eprintln!("failed: {failure}");
    }
    println!("{}", suite.counts);
    match suite.failures.is_empty() {
        true => Ok(()),
        false => Err(Failure::silent()),
    }
}

/// The chore.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if crate::asks_for_help(arguments) {
        println!("{HELP}");
        return Ok(());
    }
    match arguments {
        [] => run_suite(false),
        [quick] if quick == "--quick" => run_suite(true),
        _ => Err(Failure::usage(format!("`test` does not know '{}'\n\n{HELP}", arguments.join(" ")))),
    }
}

/// Runs tests with nextest where it is installed. Tests that had nothing to work with write a line to `log`.
fn tests(selection: &[&str], log: Option<&Path>) -> Result<Counts, String> {
    let nextest = has_subcommand("nextest");
    let base: &[&str] = if nextest { &["nextest", "run", "--no-fail-fast"] } else { &["test", "--no-fail-fast"] };
    let mut command = cargo(base);
    command.args(selection);
    if !nextest && !selection.contains(&"--lib") {
        // Doc tests have a step of their own.
        command.args(["--lib", "--bins", "--tests"]);
    }
    if let Some(log) = log {
        let _ = std::fs::remove_file(log);
        command.env("BTF_SKIP_LOG", log);
    }
    for (name, value) in software_driver() {
        command.env(name, value);
    }
    let (status, output) = run_and_read(&mut command).map_err(|failure| failure.to_string())?;
    let counts = if nextest { from_nextest(&output) } else { from_cargo_test(&output) };
    let Some(counts) = counts else {
        return Err(format!("the tests did not run: `cargo {} {}`", base.join(" "), selection.join(" ")));
    };
    for failed in if nextest { nextest_failures(&output) } else { cargo_test_failures(&output) } {
        eprintln!("failed: {failed}");
    }
    let skipped = log.and_then(|log| std::fs::read_to_string(log).ok()).unwrap_or_default();
    skipped.lines().for_each(|reason| println!("skipped: {reason}"));
    if counts.failed == 0 && !status.success() {
        return Err(format!("`cargo {} {}` failed", base.join(" "), selection.join(" ")));
    }
    Ok(counts.with_skipped(skipped.lines().count()))
}

fn doc_tests() -> Result<Counts, String> {
    let (status, output) =
        run_and_read(&mut cargo(&["test", "--workspace", "--doc"])).map_err(|failure| failure.to_string())?;
    match from_cargo_test(&output) {
        Some(counts) if status.success() || counts.failed > 0 => Ok(counts),
        _ => Err("`cargo test --workspace --doc` failed".to_string()),
    }
}

/// Points the Vulkan loader to the software driver, unless the user has pointed it somewhere.
fn software_driver() -> Vec<(&'static str, PathBuf)> {
    let chosen = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].iter().any(|name| std::env::var_os(name).is_some());
    match driver::software_manifest() {
        Some(manifest) if !chosen => vec![("VK_DRIVER_FILES", manifest.clone()), ("VK_ICD_FILENAMES", manifest)],
        _ => Vec::new(),
    }
}

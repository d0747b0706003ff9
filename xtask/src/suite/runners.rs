//! Runs tests with nextest or cargo, and reads how many passed, failed and were skipped.
//!
//! Tests that need nothing but Rust run first, those with other programs or a GPU when these have been installed. The
//! two are told apart by the names of test programs, so that all run in one build of the workspace.

use crate::counts::{self, Counts};
use crate::metadata::{Metadata, has_subcommand};
use crate::shell::{cargo, run_and_read};
use crate::tools::driver;
use std::path::{Path, PathBuf};

/// The integration tests that use a GPU or programs of others; every other one needs nothing but Rust.
const DEPENDENT: [&str; 12] = [
    "c_programs",
    "fit_gpu",
    "golden",
    "gpu_bench",
    "leaf",
    "pictures",
    "promises",
    "shaders",
    "slurm",
    "validation",
    "voltex",
    "window",
];
/// The unit tests that use a GPU: parts of their paths.
const GPU_UNIT_TESTS: [&str; 8] = [
    "gpu_clock::",
    "gpu::product::tests",
    "gpu::row_stream::tests",
    "gpu::speed::tests",
    "a_fit_on_an_adapter",
    "an_adapter_finds_the_errors",
    "images_of_linear_values_are_measured",
    "every_batch_is_counted_once",
];

/// The result of a test run.
pub struct Tested {
    pub counts: Counts,
    /// Names of the tests that failed.
    pub failed: Vec<String>,
}

/// Runs the unit tests that use no GPU.
pub fn unit_tests(metadata: &Metadata) -> Result<Tested, String> {
    run(&["--lib", "--bins"].map(String::from), &without_gpu(), metadata)
}

/// Runs the unit tests and the integration tests that need nothing but Rust.
pub fn independent_tests(metadata: &Metadata) -> Result<Tested, String> {
    let mut selection = ["--lib", "--bins"].map(String::from).to_vec();
    selection.extend(selected(metadata, |name| !DEPENDENT.contains(&name)));
    run(&selection, &without_gpu(), metadata)
}

/// Runs the integration tests that use a GPU or programs of others.
pub fn dependent_tests(metadata: &Metadata) -> Result<Tested, String> {
    run(&selected(metadata, |name| DEPENDENT.contains(&name)), &[], metadata)
}

/// Runs the unit tests that use a GPU.
pub fn gpu_unit_tests(metadata: &Metadata) -> Result<Tested, String> {
    run(&["--lib".to_string()], &GPU_UNIT_TESTS, metadata)
}

/// Returns the filter that leaves out the unit tests that use a GPU.
fn without_gpu() -> Vec<&'static str> {
    GPU_UNIT_TESTS.iter().flat_map(|part| ["--skip", part]).collect()
}

/// Returns `--test NAME` for the integration tests with a name that `wanted` accepts.
fn selected(metadata: &Metadata, wanted: impl Fn(&str) -> bool) -> Vec<String> {
    let names = metadata.integration_tests();
    names.into_iter().filter(|name| wanted(name)).flat_map(|name| ["--test".to_string(), name.to_string()]).collect()
}

/// Runs the test programs of `selection` with `filter` as the arguments of each. Tests that had nothing to work with
/// write a line to a file, and are counted as skipped. Tests that the filter leaves out are counted in the run that has
/// them.
fn run(selection: &[String], filter: &[&str], metadata: &Metadata) -> Result<Tested, String> {
    let nextest = has_subcommand("nextest");
    let base: &[&str] = if nextest { &["nextest", "run", "--no-fail-fast"] } else { &["test", "--no-fail-fast"] };
    let mut command = cargo(base);
    command.arg("--workspace").args(selection);
    if !filter.is_empty() {
        command.arg("--").args(filter);
    }
    let log = metadata.target_directory.join("skipped-tests.txt");
    let _ = std::fs::remove_file(&log);
    command.env("BTF_SKIP_LOG", &log);
    command.envs(software_driver()).envs(driver::QUICK_COMPILER);
    let (status, output) = run_and_read(&mut command).map_err(|failure| failure.to_string())?;
    let counts = if nextest { counts::from_nextest(&output) } else { counts::from_cargo_test(&output) };
    let Some(mut counts) = counts else {
        return Err(format!("the tests did not run: `cargo {} --workspace {}`", base.join(" "), selection.join(" ")));
    };
    if !filter.is_empty() {
        counts.skipped = 0;
    }
    let failed = if nextest { counts::nextest_failures(&output) } else { counts::cargo_test_failures(&output) };
    if counts.failed == 0 && !status.success() {
        return Err(format!("`cargo {} --workspace {}` failed", base.join(" "), selection.join(" ")));
    }
    Ok(Tested { counts: counts.with_skipped(told_skips(&log)), failed })
}

/// Prints the lines of the log of skipped tests. Returns their number.
fn told_skips(log: &Path) -> usize {
    let skipped = std::fs::read_to_string(log).unwrap_or_default();
    skipped.lines().for_each(|reason| println!("skipped: {reason}"));
    skipped.lines().count()
}

/// Runs the examples in the documentation.
pub fn doc_tests() -> Result<Tested, String> {
    let (status, output) =
        run_and_read(&mut cargo(&["test", "--workspace", "--doc"])).map_err(|failure| failure.to_string())?;
    match counts::from_cargo_test(&output) {
        Some(counts) if status.success() || counts.failed > 0 => {
            Ok(Tested { counts, failed: counts::cargo_test_failures(&output) })
        }
        _ => Err("`cargo test --workspace --doc` failed".to_string()),
    }
}

/// Returns variables that point the Vulkan loader to the software driver, unless the user has pointed it somewhere.
fn software_driver() -> Vec<(&'static str, PathBuf)> {
    let chosen = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].iter().any(|name| std::env::var_os(name).is_some());
    match driver::software_manifest() {
        Some(manifest) if !chosen => vec![("VK_DRIVER_FILES", manifest.clone()), ("VK_ICD_FILENAMES", manifest)],
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_test_program_runs_once() {
        let metadata = Metadata::read().unwrap();
        let names = metadata.integration_tests();
        let mut unique = names.clone();
        unique.dedup();
        assert_eq!(names, unique, "test programs of two packages have one name, so that both would run twice");
        let dependent = selected(&metadata, |name| DEPENDENT.contains(&name)).len();
        let independent = selected(&metadata, |name| !DEPENDENT.contains(&name)).len();
        assert_eq!(dependent + independent, 2 * names.len());
        assert!(dependent > 0 && independent > 0);
    }
}

//! `btf-view bench gpu`: a step that dies, hangs or finds a fault is told and costs nothing but itself.

mod support;

use btf_viewer::{GPU_RESULTS_FILE, GpuResults};
use std::path::Path;
use std::process::{Command, Output};

/// Runs the program with a small asset and returns its output and what it wrote down.
fn run(folder: &Path, more: &[&str]) -> (Output, GpuResults) {
    let asset = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/scene/builtin/weave.spmm");
    let mut command = Command::new(env!("CARGO_BIN_EXE_btf-view"));
    let output = command.args(["bench", "gpu"]).arg(asset).arg("-o").arg(folder).args(more).output().unwrap();
    let json = std::fs::read(folder.join(GPU_RESULTS_FILE)).unwrap();
    (output, serde_json::from_slice(&json).unwrap())
}

#[test]
fn a_step_that_dies_hangs_or_finds_a_fault_costs_nothing_but_itself() {
    if support::gpu_is_left_out("the measurement of a GPU") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let steps = "planted-abort,adapter,planted-hang,roofline,planted-wrong-decode,parity-decode";
    let (output, results) = run(folder.path(), &["--quick", "--backend", "bvh", "--only", steps]);
    let statuses: Vec<&str> = results.steps.iter().map(|step| step.status.as_str()).collect();
    println!("{statuses:?}");
    assert_eq!(results.steps.iter().map(|step| step.name.as_str()).collect::<Vec<_>>().join(","), steps);
    assert!(statuses[0].starts_with("failed: the process ended by itself"), "{}", statuses[0]);
    assert_eq!((statuses[1], statuses[2], statuses[3], statuses[5]), ("ok", "timed out", "ok", "ok"));
    assert!(statuses[4].contains("decoded values differ from the CPU's"), "{}", statuses[4]);
    // What was measured before the end is there, whatever the end.
    assert!(results.steps.iter().all(|step| !step.rows.is_empty()));
    let differing = |step: usize| -> Vec<u64> {
        results.steps[step].rows.iter().map(|row| row["differing"].as_u64().unwrap()).collect()
    };
    println!("{:?} {:?}", differing(4), differing(5));
    assert!(differing(4).iter().all(|count| *count > 1000) && differing(5) == [0; 4]);
    let roofline = &results.steps[3].rows[0];
    let positive = |key: &str| roofline[key].as_f64().is_some_and(|x| x > 0.0);
    assert!(positive("copy_gigabytes_per_s") && positive("tera_multiply_adds_per_s"), "{roofline}");
    assert!(results.finished && results.quick);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1));
    assert!(message.contains("3 of 6 steps") && message.lines().count() == 1, "{message}");
}

#[test]
fn counted_operations_are_those_of_the_layout() {
    if support::gpu_is_left_out("counted operations") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (output, results) = run(folder.path(), &["--quick", "--only", "operations"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let rows = &results.steps[0].rows;
    let of = |row: &serde_json::Value, part: &str, kind: &str| row[part][kind].as_f64().unwrap();
    for row in rows {
        println!("{row}");
        // A ray reads the words of a node at least, and every pixel has one.
        assert!(of(row, "ray", "loaded_words") > 10.0 && row["rays_per_pixel"].as_f64().unwrap() >= 1.0);
        assert!(of(row, "pixel", "stored_words") > 10.0);
        assert_eq!((of(row, "evaluation", "stored_words"), of(row, "ray", "stored_words")), (0.0, 0.0));
    }
    // The weave has 4 components: 3 channels of 5 bases at 9 pairs at most, a multiply-add each, and the means of 3.
    let expanded = rows.iter().find(|row| row["form"] == "expanded" && row["lights"] == 1).unwrap();
    let (float, words) = (of(expanded, "evaluation", "float"), of(expanded, "evaluation", "loaded_words"));
    assert!(float > 2.0 * 9.0 * 15.0 && float < 3000.0, "{float}");
    assert!(words > 9.0 * 9.0 && words < 800.0, "{words}");
}

#[test]
fn steps_without_time_are_left_out_and_unknown_ones_are_bad_usage() {
    let folder = tempfile::tempdir().unwrap();
    let (output, results) = run(folder.path(), &["--minutes", "0.01"]);
    assert!(output.status.success() && results.finished && results.steps.len() == 15);
    assert!(results.steps.iter().all(|step| step.status == "skipped: no time" && step.rows.is_empty()));
    let (output, results) = run(folder.path(), &["--only", "cornel"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("no step 'cornel'"));
    // The earlier file is untouched.
    assert_eq!(results.steps.len(), 15);
}

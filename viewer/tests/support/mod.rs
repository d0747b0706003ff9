//! What the test files share: which backends are tested, and that a missing adapter is a failure unless `BTF_SKIP_GPU=1`
//! leaves the GPU out, visibly.

use btf_viewer::{BackendChoice, GpuTracer};
use std::io::Write;

/// Whether GPU tests are left out on purpose; says of `what` that it is, and `cargo xtask test` counts the lines of its log
/// as skipped tests.
pub fn gpu_is_left_out(what: &str) -> bool {
    let left_out = std::env::var_os("BTF_SKIP_GPU").is_some_and(|value| value == "1");
    if left_out {
        println!("skipped: {what} (BTF_SKIP_GPU=1)");
        if let Some(log) = std::env::var_os("BTF_SKIP_LOG") {
            let mut file = std::fs::OpenOptions::new().create(true).append(true).open(log).expect("the skip log opens");
            writeln!(file, "{what} (BTF_SKIP_GPU=1)").expect("the skip log is written");
        }
    }
    left_out
}

/// The CPU and both tracers, for test `test`.
#[allow(dead_code, reason = "each test file takes what it needs of this one")]
pub fn backends(test: &str) -> Vec<BackendChoice> {
    if gpu_is_left_out(&format!("{test} on the GPU")) {
        return vec![BackendChoice::Cpu];
    }
    vec![BackendChoice::Cpu, BackendChoice::Gpu(GpuTracer::RayQuery), BackendChoice::Gpu(GpuTracer::Bvh)]
}

//! What the test files share: which backends are tested, and that a missing adapter is a failure unless
//! `BTF_SKIP_GPU=1` leaves the GPU out, visibly. `BTF_SKIP_RAY_QUERY=1` leaves ray queries out, for adapters without them.

#![allow(dead_code, unused_imports, reason = "each test file takes what it needs of this one")]

pub use btf_viewer::testing::{ABSOLUTE, RELATIVE, count_differences, difference};
use btf_viewer::{BackendChoice, Gpu, GpuTracer};
use std::io::Write;

/// Whether GPU tests are left out on purpose; says of `what` that it is, and `cargo xtask test` counts the lines of its
/// log as skipped tests.
pub fn gpu_is_left_out(what: &str) -> bool {
    is_left_out(what, "BTF_SKIP_GPU")
}

fn is_left_out(what: &str, switch: &str) -> bool {
    let left_out = std::env::var_os(switch).is_some_and(|value| value == "1");
    if left_out {
        skip(&format!("{what} ({switch}=1)"));
    }
    left_out
}

/// Whether ray queries are left out of test `test` on purpose; says so, as [`gpu_is_left_out`].
pub fn ray_query_is_left_out(test: &str) -> bool {
    is_left_out(&format!("{test} by ray queries"), "BTF_SKIP_RAY_QUERY")
}

/// The tracers that test `test` draws with: both, or the compute hierarchy alone. Every call says what is left out.
pub fn tracers(test: &str) -> Vec<GpuTracer> {
    if ray_query_is_left_out(test) {
        return vec![GpuTracer::Bvh];
    }
    vec![GpuTracer::RayQuery, GpuTracer::Bvh]
}

/// Says visibly that a test was skipped: on stdout and in the file that `BTF_SKIP_LOG` names, whose lines `cargo xtask test`
/// counts.
pub fn skip(what: &str) {
    println!("skipped: {what}");
    if let Some(log) = std::env::var_os("BTF_SKIP_LOG") {
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(log).expect("the skip log opens");
        writeln!(file, "{what}").expect("the skip log is written");
    }
}

/// The CPU and both tracers, for test `test`.
pub fn backends(test: &str) -> Vec<BackendChoice> {
    if gpu_is_left_out(&format!("{test} on the GPU")) {
        return vec![BackendChoice::Cpu];
    }
    [BackendChoice::Cpu].into_iter().chain(tracers(test).into_iter().map(BackendChoice::Gpu)).collect()
}

/// The adapter, or `None` where GPU tests are skipped on purpose.
pub fn gpu(test: &str) -> Option<Gpu> {
    if gpu_is_left_out(test) {
        return None;
    }
    match Gpu::headless(None) {
        Ok(gpu) => Some(gpu),
        Err(error) => panic!("{error}; BTF_SKIP_GPU=1 skips this test"),
    }
}

//! `--memory` is kept, as the program and the operating system count it, and refuses no limit of three times what is used.

use crate::support::{btf_fit, bumpy_capture_of, refusal};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Returns the limit that a fit asks for where it is refused, bytes.
fn asked_for(goal: &[&str], folder: &Path) -> u64 {
    let (code, text) = refusal(&btf_fit(&[&FIT[..], goal, &["--memory=1MB"]].concat(), folder));
    let megabytes = text.split("at least ").nth(1).and_then(|rest| rest.split(' ').next()).and_then(|x| x.parse().ok());
    let megabytes: u64 = megabytes.unwrap_or_else(|| panic!("no size in: {text}"));
    assert_eq!(code, 1, "{text}");
    // The sentence has whole megabytes, rounded.
    (megabytes + 1) * 1_000_000
}

const FIT: [&str; 5] = ["fit", "capture", "-o", "a.spmm", "--threads=2"];

/// Runs a fit within `limit` bytes. Returns its peak memory, bytes: as it reports it, and as the system counted it
/// while it ran.
fn peaks(goal: &[&str], limit: u64, folder: &Path) -> [u64; 2] {
    let memory = format!("--memory={}MB", limit / 1_000_000);
    let mut command = Command::new(env!("CARGO_BIN_EXE_btf-fit"));
    command.args(FIT).args(goal).args([memory.as_str(), "--json", "fit.json"]).current_dir(folder);
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let status = format!("/proc/{}/status", child.id());
    let mut counted = 0;
    let ended = loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kib = line.and_then(|line| line.trim().strip_suffix(" kB")).and_then(|kib| kib.parse::<u64>().ok());
        counted = kib.map_or(counted, |kib| 1024 * kib);
        if let Some(ended) = child.try_wait().unwrap() {
            break ended;
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    assert!(ended.success(), "{ended}");
    let json = std::fs::read_to_string(folder.join("fit.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    [json["peak_memory_bytes"].as_u64().unwrap(), counted]
}

#[test]
#[cfg(target_os = "linux")]
fn a_fit_stays_within_its_memory_and_asks_for_no_more_than_three_times_what_it_uses() {
    let folder = tempfile::tempdir().unwrap();
    bumpy_capture_of(folder.path(), "capture", [96, 96], 20, 7);
    for goal in [&["--bytes=60kB"][..], &["--clusters=8"]] {
        let limit = asked_for(goal, folder.path());
        let [told, counted] = peaks(goal, limit, folder.path());
        println!("{goal:?}: asks for {limit}, tells {told}, the system counts {counted}");
        assert!(told <= limit && counted <= limit, "{goal:?}: {told} and {counted} of {limit}");
        assert!(limit <= 3 * told, "{goal:?}: a limit of three times {told} is refused, {limit} is asked for");
        // Planted difference: a figure that is not the system's.
        assert!(told >= counted && told < counted + counted / 4, "{goal:?}: {told} is told, {counted} counted");
    }
}

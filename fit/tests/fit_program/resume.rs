//! `--resume`: killed at any moment and run again, a fit ends in the same bytes, goes on after its last finished
//! stage, and takes nothing that is of another fit or damaged.

use btf_capture::{Capture, CaptureInfo, CaptureWriter, DirectionSet, ImageFormat};
use btf_fit::{FitError, FitParams, Monitor, fit_and_measure};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// A capture of tilted, glossy facets; `shade` makes another one of the same shape.
fn write_capture(path: &Path, size: usize, directions: usize, shade: f32) {
    let set = DirectionSet::random(directions, 7).unwrap();
    let info = CaptureInfo::new("capture", size, size, set.clone(), set.clone(), ImageFormat::Png);
    let writer = CaptureWriter::create(path, info).unwrap();
    for (view, wo) in set.units().iter().enumerate() {
        for (light, wi) in set.units().iter().enumerate() {
            let sample = |texel: usize| {
                let slope = 0.3 * (texel as f32 * 0.7).sin();
                let gloss = (wi[2] * wo[2] - wi[0] * wo[0]).max(0.0).powi(6);
                (shade * (wi[2] + slope * wi[0]) + 0.3 * slope * gloss).max(0.0)
            };
            let image: Vec<f32> =
                (0..size * size).flat_map(|t| [0.5, 0.4, 0.2].map(|albedo| albedo * sample(t))).collect();
            writer.write(view, light, &image).unwrap();
        }
    }
    writer.finish().unwrap();
}

/// With a goal lobes only guide and stages come in another order than without.
const ORDERS: [&[&str]; 2] = [&["--clusters", "3", "--bytes", "20kB"], &["--clusters", "3"]];

fn start(folder: &Path, asset: &str, options: &[&str], more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_btf-fit"));
    command.args(["fit", "capture", "-o", asset]).args(options).args(more).current_dir(folder);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Starts the fit and kills it after `wait_s` (SIGKILL where there are signals); whether it was still running.
fn kill_after(wait_s: f64, mut command: Command) -> bool {
    let mut child = command.spawn().unwrap();
    std::thread::sleep(Duration::from_secs_f64(wait_s));
    child.kill().unwrap();
    !child.wait().unwrap().success()
}

/// Runs to the end with `--resume`; the stages that were there already.
fn resume(folder: &Path, asset: &str, options: &[&str]) -> Vec<String> {
    let output = start(folder, asset, options, &["--resume", "--json", "-"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(!folder.join(format!("{asset}.resume")).exists(), "the finished stages go when the asset is written");
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    json["resumed"].as_array().unwrap().iter().map(|stage| stage.as_str().unwrap().to_string()).collect()
}

#[test]
fn a_fit_that_is_killed_at_ten_random_moments_ends_in_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_capture(&here.join("capture"), 20, 12, 1.0);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(2026);
    let mut resumed = 0;
    for (order, options) in ORDERS.into_iter().enumerate() {
        let begun = Instant::now();
        let output = start(here, "whole.spmm", options, &[]).output().unwrap();
        let whole_s = begun.elapsed().as_secs_f64();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let wanted = std::fs::read(here.join("whole.spmm")).unwrap();
        assert!(!here.join("whole.spmm.resume").exists(), "without --resume nothing is kept");

        for moment in 0..5 {
            let asset = format!("{order}-{moment}.spmm");
            let mut wait_s = random.gen_range(0.0..1.0) * whole_s;
            while !kill_after(wait_s, start(here, &asset, options, &["--resume"])) {
                // It was faster than the undisturbed one: not killed at all.
                std::fs::remove_file(here.join(&asset)).unwrap();
                wait_s *= 0.7;
            }
            resumed += usize::from(!resume(here, &asset, options).is_empty());
            assert!(std::fs::read(here.join(&asset)).unwrap() == wanted, "{options:?}, killed for the {moment}th time");
        }
        // One fit that is never left alone long enough for the whole.
        let mut kills = 0;
        while kills < 3 && kill_after(0.5 * whole_s, start(here, "often.spmm", options, &["--resume"])) {
            kills += 1;
        }
        if kills == 3 {
            resume(here, "often.spmm", options);
        }
        assert!(std::fs::read(here.join("often.spmm")).unwrap() == wanted, "{options:?}, killed {kills} times");
        println!("{options:?}: {whole_s:.2} s undisturbed, finished after {kills} kills in a row");
    }
    println!("killed ten times, {resumed} times it went on from finished stages");
    assert!(resumed >= 3, "{resumed}");
}

struct Run {
    /// The asset, or nothing where the run was interrupted.
    bytes: Option<Vec<u8>>,
    skipped: Vec<String>,
    ran: Vec<String>,
    remarks: Vec<String>,
}

/// Fits; stops at the first report of the stage `stop`.
fn run(capture: &Path, params: &FitParams, stop: &'static str) -> Run {
    let remarks = Arc::new(Mutex::new(Vec::new()));
    let heard = Arc::clone(&remarks);
    let monitor = Arc::new_cyclic(|own: &std::sync::Weak<Monitor>| {
        let own = own.clone();
        Monitor::with_listener(move |stage, _, _| {
            if let (true, Some(monitor)) = (stage == stop, own.upgrade()) {
                monitor.cancel();
            }
        })
        .on_remark(move |text| heard.lock().unwrap().push(text.to_string()))
    });
    let bytes = match fit_and_measure(&[Capture::open(capture).unwrap()], &params.check().unwrap(), &monitor) {
        Ok(fitted) => Some(fitted.bytes),
        Err(FitError::Interrupted) => None,
        Err(error) => panic!("{error}"),
    };
    let ran = monitor.stages().into_iter().map(|stage| stage.name).collect();
    let remarks = remarks.lock().unwrap().clone();
    Run { bytes, skipped: monitor.skipped(), ran, remarks }
}

fn params(folder: &Path) -> FitParams {
    FitParams {
        clusters: 3,
        bytes: Some(20_000),
        leave_out: 0.1,
        cache_directory: folder.to_path_buf(),
        resume: Some(folder.join("a.spmm.resume")),
        ..FitParams::default()
    }
}

/// The files of the finished stages.
fn stages(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder.join("a.spmm.resume")).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|end| end == "stage")).collect();
    files.sort();
    files
}

/// Parameters of both orders of stages.
fn both(folder: &Path) -> [FitParams; 2] {
    let goal = params(folder);
    [FitParams { bytes: None, ..goal.clone() }, goal]
}

#[test]
fn finished_stages_are_skipped_wherever_the_fit_was_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let (here, capture) = (folder.path(), folder.path().join("capture"));
    write_capture(&capture, 14, 8, 1.0);
    let stored: &[&str] = &["project", "cluster", "dictionary", "weights", "residual", "encode", "measure"];
    let whole: &[&str] = &["project", "cluster", "dictionary", "weights", "residual", "predict", "encode", "measure"];
    for asked in both(here) {
        // With a goal the residual's coordinates are those of the stage `project`; the rest of it is not kept.
        let (order, last_kept) = if asked.bytes.is_some() { (whole, "predict") } else { (stored, "residual") };
        let kept = |stage: &&str| asked.bytes.is_none() || *stage != "residual";
        let passes = 1 + order.iter().position(|stage| *stage == last_kept).unwrap();
        let undisturbed = run(&capture, &FitParams { resume: None, ..asked.clone() }, "").bytes.unwrap();
        for (finished, stop) in order.iter().copied().enumerate() {
            let what = format!("{:?} stopped at {stop}", asked.bytes);
            let params = FitParams { resume: Some(here.join(format!("{passes}-{stop}"))), ..asked.clone() };
            assert!(run(&capture, &params, stop).bytes.is_none(), "{what}");
            let resumed = run(&capture, &params, "");
            assert!(resumed.bytes.unwrap() == undisturbed, "{what}");
            assert!(resumed.remarks.is_empty(), "{what}: {:?}", resumed.remarks);
            // What was done is not done again; behind the last pass over all texels no image is read before it is
            // measured.
            let skipped = resumed.skipped.iter().map(String::as_str).filter(|name| *name != "leave-out");
            let skipped: Vec<&str> = skipped.collect();
            let expected: Vec<&str> = match stop {
                "measure" => vec!["encode"],
                _ => order[..finished.min(passes)].iter().copied().filter(kept).collect(),
            };
            assert_eq!(skipped, expected, "{what}");
            let again: Vec<&String> = resumed.ran.iter().filter(|name| skipped.contains(&name.as_str())).collect();
            assert!(again.iter().all(|name| *name == "residual"), "{what}: {again:?} ran again");
            assert_eq!(resumed.ran.iter().any(|name| name == "read"), finished < passes, "{what}");
        }
    }
}

#[test]
fn stages_of_another_capture_or_other_options_are_not_used() {
    let folder = tempfile::tempdir().unwrap();
    let (here, capture) = (folder.path(), folder.path().join("capture"));
    write_capture(&capture, 14, 8, 1.0);
    let other_options = FitParams { seed: 5, clusters: 2, ..params(here) };
    let alone = |params: &FitParams| run(&capture, &FitParams { resume: None, ..params.clone() }, "").bytes.unwrap();
    let (first, second) = (alone(&params(here)), alone(&other_options));
    assert!(first != second, "the planted difference shows in the bytes");

    assert!(run(&capture, &params(here), "measure").bytes.is_none());
    assert_eq!(stages(here).len(), 8);
    let resumed = run(&capture, &other_options, "measure");
    assert!(resumed.skipped.is_empty());
    assert!(matches!(&resumed.remarks[..], [remark] if remark.contains("other options")), "{:?}", resumed.remarks);
    assert!(run(&capture, &other_options, "").bytes.unwrap() == second);

    // Another capture in the same place: same names, same sizes in texels, other light.
    assert!(run(&capture, &params(here), "measure").bytes.is_none());
    std::fs::rename(&capture, here.join("first")).unwrap();
    write_capture(&capture, 14, 8, 0.6);
    let darker = alone(&params(here));
    assert!(darker != first);
    let resumed = run(&capture, &params(here), "");
    assert!(matches!(&resumed.remarks[..], [remark] if remark.contains("another capture")), "{:?}", resumed.remarks);
    assert!(resumed.skipped.is_empty() && resumed.bytes.unwrap() == darker);

    std::fs::remove_dir_all(here.join("a.spmm.resume")).unwrap();
    // One stage of the first capture put among those of the second by hand: its own key gives it away.
    let moved = FitParams { resume: Some(here.join("first.resume")), ..params(here) };
    assert!(run(&here.join("first"), &moved, "measure").bytes.is_none());
    assert!(run(&capture, &params(here), "measure").bytes.is_none());
    let name = stages(here)[1].file_name().unwrap().to_owned();
    std::fs::copy(here.join("first.resume").join(&name), here.join("a.spmm.resume").join(&name)).unwrap();
    std::fs::remove_file(here.join("a.spmm.resume/whole-encode.stage")).unwrap();
    let resumed = run(&capture, &params(here), "");
    assert!(matches!(&resumed.remarks[..], [remark] if remark.contains("of another fit")), "{:?}", resumed.remarks);
    assert!(resumed.bytes.unwrap() == darker);
}

#[test]
fn a_cut_or_damaged_stage_is_computed_anew() {
    let folder = tempfile::tempdir().unwrap();
    let (here, capture) = (folder.path(), folder.path().join("capture"));
    write_capture(&capture, 14, 8, 1.0);
    // Without lobes, for speed.
    for params in both(here).map(|params| FitParams { lobes: 0, ..params }) {
        let undisturbed = run(&capture, &FitParams { resume: None, ..params.clone() }, "").bytes.unwrap();
        assert!(run(&capture, &params, "measure").bytes.is_none());
        let whole: Vec<(PathBuf, Vec<u8>)> =
            stages(here).into_iter().map(|path| (path.clone(), std::fs::read(path).unwrap())).collect();
        assert_eq!(whole.len(), if params.bytes.is_some() { 7 } else { 8 });
        for (number, (path, bytes)) in whole.iter().enumerate() {
            let mut flipped = bytes.clone();
            let middle = bytes.len() / 2;
            flipped[middle] ^= 16;
            for (what, damaged) in [("cut", &bytes[..bytes.len() - 1 - number * 7]), ("flipped", &flipped)] {
                whole.iter().for_each(|(path, bytes)| std::fs::write(path, bytes).unwrap());
                if !path.ends_with("whole-encode.stage") {
                    // Otherwise nothing before it would be looked at.
                    std::fs::remove_file(here.join("a.spmm.resume/whole-encode.stage")).unwrap();
                }
                std::fs::write(path, damaged).unwrap();
                // A file that a killed run was still writing.
                std::fs::write(here.join("a.spmm.resume/.layer0-cluster.stage.partial-1-0"), "x").unwrap();
                let resumed = run(&capture, &params, "");
                assert!(resumed.bytes.unwrap() == undisturbed, "{what}: {}", path.display());
                assert_eq!(resumed.remarks.len(), 1, "{what}: {} {:?}", path.display(), resumed.remarks);
                assert!(!here.join("a.spmm.resume/.layer0-cluster.stage.partial-1-0").exists());
            }
        }
        std::fs::remove_dir_all(here.join("a.spmm.resume")).unwrap();
    }
}

#[test]
fn a_capture_that_does_not_fit_into_memory_is_not_decoded_twice() {
    let folder = tempfile::tempdir().unwrap();
    let (here, capture) = (folder.path(), folder.path().join("capture"));
    write_capture(&capture, 64, 16, 1.0);
    let small = FitParams { memory_bytes: 1, ..params(here) };
    let small = small.check().unwrap();
    let refused = fit_and_measure(&[Capture::open(&capture).unwrap()], &small, &Monitor::default()).err().unwrap();
    let needed = refused.to_string();
    let needed = needed.split("at least ").nth(1).unwrap().split(' ').next().unwrap().parse::<u64>().unwrap();
    let small = FitParams { memory_bytes: (needed + 1) * 1_000_000, ..params(here) };
    let undisturbed = run(&capture, &FitParams { resume: None, ..small.clone() }, "").bytes.unwrap();
    assert!(run(&capture, &small, "cluster").bytes.is_none());
    assert!(here.join("a.spmm.resume/layer0-read.texels").exists());
    let resumed = run(&capture, &small, "");
    assert_eq!(resumed.skipped, ["leave-out", "project", "read"]);
    assert!(resumed.bytes.unwrap() == undisturbed && resumed.remarks.is_empty());
}

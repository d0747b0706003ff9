//! `btf-fit` as a user runs it: exit codes, one-sentence errors, nothing lost and nothing half written.

use crate::support::{btf_fit, refusal};
use btf_capture::{CaptureInfo, CaptureWriter, DirectionSet, ImageFormat, Side};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A capture of a tilted, tinted Lambertian, `size` x `size` texels under `directions` lights and views.
fn capture(folder: &Path, size: usize, directions: usize) -> PathBuf {
    let set = DirectionSet::random(directions, 7).unwrap();
    let path = folder.join("capture");
    let info = CaptureInfo::new("capture", size, size, set.clone(), set.clone(), ImageFormat::Png);
    let writer = CaptureWriter::create(&path, info).unwrap();
    for view in 0..set.len() {
        for (light, wi) in set.units().iter().enumerate() {
            let sample = |texel: usize| (wi[2] + 0.3 * wi[0] * (texel as f32 * 0.7).sin()).max(0.0);
            let image: Vec<f32> =
                (0..size * size).flat_map(|t| [0.5, 0.4, 0.2].map(|albedo| albedo * sample(t))).collect();
            writer.write(view, light, &image).unwrap();
        }
    }
    writer.finish().unwrap();
    path
}

#[test]
fn a_fit_is_described_checked_and_a_damaged_copy_refused() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    capture(here, 12, 6);
    let output =
        btf_fit(&["fit", "capture", "-o", "a.spmm", "--clusters", "2", "--report", "a.html", "--json", "-"], here);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // With `--json -` nothing else goes to standard output.
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for key in [
        "bytes",
        "seconds",
        "stages",
        "peak_memory_bytes",
        "psnr_db",
        "psnr_linear_db",
        "rel_rmse",
        "worst_texel_rmse",
        "clusters",
        "lobes_per_texel_mean",
        "components",
    ] {
        assert!(!json[key].is_null(), "{key} is missing");
    }
    // Processor time is that of all threads, in stages and between them.
    let all = json["processor_seconds"].as_f64().unwrap();
    let stages = json["stages_processor"].as_object().unwrap();
    let sum: f64 = stages.values().map(|seconds| seconds.as_f64().unwrap()).sum();
    assert!(0.0 < sum && sum <= all * 1.01, "{sum} {all}");
    assert!(json["stages"].as_object().unwrap().keys().eq(stages.keys()) && stages.contains_key("measure"));
    assert_eq!(json["bytes"].as_u64().unwrap(), std::fs::metadata(here.join("a.spmm")).unwrap().len());
    assert!(std::fs::read_to_string(here.join("a.html")).unwrap().contains("</html>"));
    assert!(btf_fit(&["validate", "a.spmm"], here).status.success());
    assert!(btf_fit(&["info", "a.spmm"], here).status.success());

    // `compare` gives the same figure, and `expand` a folder that compares alike.
    let compared = btf_fit(&["compare", "capture", "a.spmm", "--json", "-"], here);
    let compared: serde_json::Value = serde_json::from_slice(&compared.stdout).unwrap();
    assert_eq!(compared["psnr_db"], json["psnr_db"]);
    assert!(btf_fit(&["expand", "a.spmm", "decoded", "--quiet"], here).status.success());
    let decoded = btf_fit(&["compare", "decoded", "a.spmm", "--json", "-"], here);
    let decoded: serde_json::Value = serde_json::from_slice(&decoded.stdout).unwrap();
    let (own, original) = (decoded["psnr_db"].as_f64().unwrap_or(f64::INFINITY), json["psnr_db"].as_f64().unwrap());
    assert!(own > original + 10.0, "the asset against its own pictures: {own} dB, against the capture: {original} dB");

    let bytes = std::fs::read(here.join("a.spmm")).unwrap();
    std::fs::write(here.join("cut.spmm"), &bytes[..bytes.len() - 7]).unwrap();
    for command in ["validate", "info"] {
        let (code, text) = refusal(&btf_fit(&[command, "cut.spmm"], here));
        assert!(code == 1 && text.contains("cut.spmm"), "{code} {text}");
    }
}

#[test]
fn four_captures_of_a_leaf_become_one_asset_of_four_layers() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let set = DirectionSet::random(6, 7).unwrap();
    for side in Side::ALL {
        let lights = if side.is_transmission() { set.behind().unwrap() } else { set.clone() };
        let info = CaptureInfo::new("leaf", 7, 5, set.clone(), lights.clone(), ImageFormat::Png);
        let writer = CaptureWriter::create(here.join(side.to_string()), CaptureInfo { side, ..info }).unwrap();
        for view in 0..6 {
            for (light, wi) in lights.units().iter().enumerate() {
                let sample = |texel: usize| wi[2].abs() * (0.4 + 0.3 * wi[0] * (texel as f32 * 0.7).sin());
                writer.write(view, light, &(0..35 * 3).map(|i| sample(i / 3)).collect::<Vec<_>>()).unwrap();
            }
        }
        writer.finish().unwrap();
    }
    let sides = Side::ALL.map(|side| side.to_string());
    let mut arguments =
        vec!["fit", "-o", "leaf.spmm", "--clusters=2", "--components=0", "--report", "leaf.html", "--json", "-"];
    arguments.extend(sides.iter().map(String::as_str));
    let output = btf_fit(&arguments, here);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["layers"], 4);
    let page = std::fs::read_to_string(here.join("leaf.html")).unwrap();
    let checked = String::from_utf8(btf_fit(&["validate", "leaf.spmm"], here).stdout).unwrap();
    let verdict = checked.trim().lines().last();
    assert_eq!(verdict, Some("ok: 4 layers (front, back, transmission-back, transmission-front)"), "{checked}");
    assert!(checked.contains("warning SPMM5001: no physical size is known"), "{checked}");
    let told = String::from_utf8(btf_fit(&["info", "leaf.spmm"], here).stdout).unwrap();
    for (number, side) in sides.iter().enumerate() {
        assert_eq!(json["by_layer"][number]["side"], side.as_str());
        assert!(told.contains(&format!("layer {number}: {side}, 6 views x 6 lights")), "{told}");
        assert!(page.contains(&format!("Beside the originals – {side}")));
        let compared = btf_fit(&["compare", side, "leaf.spmm", "--json", "-"], here);
        let compared: serde_json::Value = serde_json::from_slice(&compared.stdout).unwrap();
        assert_eq!((&compared["layer"], &compared["side"]), (&number.into(), &side.as_str().into()));
        assert_eq!(compared["psnr_db"], json["by_layer"][number]["psnr_db"]);
        let out = format!("decoded-{side}");
        let layer = number.to_string();
        assert!(btf_fit(&["expand", "leaf.spmm", &out, "--layer", &layer, "--quiet"], here).status.success());
        let decoded = btf_fit(&["compare", &out, "leaf.spmm", "--json", "-"], here);
        let decoded: serde_json::Value = serde_json::from_slice(&decoded.stdout).unwrap();
        assert_eq!(decoded["layer"], number);
        assert!(decoded["psnr_db"].as_f64().unwrap_or(f64::INFINITY) > compared["psnr_db"].as_f64().unwrap() + 10.0);
    }

    // An asset of one layer, compared with a capture of another side, or with `side` written wrongly.
    assert!(btf_fit(&["fit", "front", "-o", "one.spmm", "--clusters", "2", "--quiet"], here).status.success());
    let (code, text) = refusal(&btf_fit(&["compare", "back", "one.spmm"], here));
    assert!(code == 1 && text.contains("no layer for the side `back`") && text.contains("holds `front`"), "{text}");
    std::fs::write(here.join("transmission-back/capture.toml"), "side = \"front\"").unwrap();
    let (code, text) = refusal(&btf_fit(&["fit", "transmission-back", "-o", "x.spmm"], here));
    assert!(code == 1 && text.contains("transmission-back cannot be used") && text.contains("behind"), "{text}");
}

#[test]
fn bad_usage_is_two_bad_input_is_one_and_an_older_asset_survives() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let path = capture(here, 8, 4);
    std::fs::write(here.join("old.spmm"), "precious").unwrap();
    assert_eq!(btf_fit(&["fit", "capture"], here).status.code(), Some(2));
    assert_eq!(btf_fit(&["fit", "capture", "-o", "old.spmm", "--bytes", "much"], here).status.code(), Some(2));
    assert_eq!(btf_fit(&["fit", "capture", "-o", "old.spmm", "--clusters", "0"], here).status.code(), Some(2));
    assert_eq!(refusal(&btf_fit(&["fit", "nowhere", "-o", "old.spmm"], here)).0, 1);
    let (code, text) =
        refusal(&btf_fit(&["fit", "capture", "-o", "old.spmm", "--bytes", "700", "--clusters", "2"], here));
    assert!(code == 1 && text.contains("--bytes"), "{text}");

    // An image that is cut off in the middle of the capture.
    let view = std::fs::read_dir(&path).unwrap().map(|e| e.unwrap().path()).find(|p| p.is_dir()).unwrap();
    let image = std::fs::read_dir(view).unwrap().next().unwrap().unwrap().path();
    let bytes = std::fs::read(&image).unwrap();
    std::fs::write(&image, &bytes[..bytes.len() / 2]).unwrap();
    let (code, text) = refusal(&btf_fit(&["fit", "capture", "-o", "old.spmm"], here));
    assert!(code == 1 && text.contains(image.file_name().unwrap().to_str().unwrap()), "{text}");
    assert_eq!(std::fs::read_to_string(here.join("old.spmm")).unwrap(), "precious");
    assert_eq!(std::fs::read_dir(here).unwrap().count(), 2, "something was left behind");
}

#[cfg(unix)]
#[test]
fn ctrl_c_exits_with_130_and_leaves_everything_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    // Large enough that it still runs when the signal comes.
    capture(here, 64, 24);
    std::fs::write(here.join("old.spmm"), "precious").unwrap();
    let child = Command::new(env!("CARGO_BIN_EXE_btf-fit"))
        .args(["fit", "capture", "-o", "old.spmm"])
        .current_dir(here)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_millis(700));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(refusal(&output).0, 130);
    assert_eq!(std::fs::read_to_string(here.join("old.spmm")).unwrap(), "precious");
    assert_eq!(std::fs::read_dir(here).unwrap().count(), 2, "something was left behind");
}

//! `btf-fit fit --role`: both roles with and without a goal, and what the program says about them.

use crate::support::{btf_fit, bumpy_capture};
use serde_json::Value;
use std::path::Path;

/// Fits the capture with `options`; returns what `--json` says.
fn fit(here: &Path, name: &str, options: &[&str]) -> Value {
    let shared = ["fit", "capture", "-o", name, "--clusters=2", "--json", "-"];
    let output = btf_fit(&[&shared[..], options].concat(), here);
    assert!(output.status.success(), "{options:?}: {}", String::from_utf8_lossy(&output.stderr));
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["bytes"].as_u64().unwrap(), std::fs::metadata(here.join(name)).unwrap().len());
    json
}

fn info(here: &Path, name: &str) -> String {
    let output = btf_fit(&["info", name], here);
    String::from_utf8(output.stdout).unwrap()
}

/// Checks that every report says the role `role` and counts lobes by what they belong to.
fn says(here: &Path, name: &str, json: &Value, role: &str) {
    assert_eq!(json["lobe_role"], role);
    assert_eq!(json["by_layer"][0]["lobe_role"], role);
    let number = |key: &str| json[key].as_f64().unwrap();
    assert!(number("lobe_bytes") > 0.0 && number("lobe_bytes") < number("bytes"), "{json}");
    let (own, of_cluster, words) = match role {
        "base" => ("lobes_per_texel_mean", "lobes_per_cluster_mean", "lobes per texel (base"),
        _ => ("lobes_per_cluster_mean", "lobes_per_texel_mean", "lobes per cluster (guide"),
    };
    assert!(number(own) > 0.0 && number(of_cluster) == 0.0, "{json}");
    let told = info(here, name);
    assert!(told.contains(words), "{told}");
    assert_eq!(told.contains("per texel"), role == "base", "{told}");
}

#[test]
fn either_role_reaches_a_size_and_is_told_as_what_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    bumpy_capture(here, "capture", 14, 7);
    let size = 9_000;
    for role in ["base", "guide"] {
        let (name, page) = (format!("{role}.spmm"), format!("{role}.html"));
        let asked = format!("--bytes={size}");
        let options = ["--role", role, "--lobes=2", &asked, "--report", &page];
        let json = fit(here, &name, &options);
        let bytes = json["bytes"].as_u64().unwrap();
        assert!(bytes <= size && bytes > size * 8 / 10, "{role}: {bytes}");
        says(here, &name, &json, role);
        let page = std::fs::read_to_string(here.join(page)).unwrap();
        assert_eq!(page.contains("add nothing to the value"), role == "guide");
        assert_eq!(page.contains("lobes per texel"), role == "base");
    }
    // Planted difference: the roles are two assets, and a base needs more bytes for its lobes.
    let read = |name: &str| std::fs::read(here.join(name)).unwrap();
    assert_ne!(read("base.spmm"), read("guide.spmm"));
}

#[test]
fn either_role_reaches_a_psnr_and_works_without_a_goal() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    bumpy_capture(here, "capture", 10, 7);
    for role in ["base", "guide"] {
        let json = fit(here, "a.spmm", &["--role", role, "--lobes=2", "--psnr=34"]);
        assert!(json["psnr_db"].as_f64().unwrap() >= 34.0, "{json}");
        says(here, "a.spmm", &json, role);
        says(here, "a.spmm", &fit(here, "a.spmm", &["--role", role, "--lobes=2"]), role);
    }
}

#[test]
fn without_a_role_lobes_are_the_base_and_a_goal_stores_no_references() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    bumpy_capture(here, "capture", 8, 7);
    for (goal, stores) in [("--bytes=8000", false), ("--psnr=34", false), ("--components=8", true)] {
        let json = fit(here, "usual.spmm", &[goal]);
        assert_eq!(json["lobe_role"], "base");
        fit(here, "asked.spmm", &[goal, "--role", "base"]);
        let read = |name: &str| std::fs::read(here.join(name)).unwrap();
        assert_eq!(read("usual.spmm"), read("asked.spmm"), "{goal}");
        let sections = btf_runtime::read_directory(&read("usual.spmm")).unwrap().sections;
        let has = |kind: btf_runtime::SectionKind| sections.iter().any(|section| section.kind == kind as u32);
        assert_eq!(has(btf_runtime::SectionKind::LobeRefs), stores, "{goal}");
        assert_eq!(has(btf_runtime::SectionKind::LobeWeights), !stores, "{goal}");
    }
}

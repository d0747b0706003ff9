//! `btf-synth invert` as a user runs it: tables in, contents out, and what it refuses.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn synth(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_btf-synth")).args(arguments).output().unwrap()
}

fn succeed(arguments: &[&str]) -> String {
    let output = synth(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn a_spectrum_of_the_program_gives_its_contents_back() {
    let folder = tempfile::tempdir().unwrap();
    let [table, contents, plots] = ["maple.csv", "contents.csv", "plots"].map(|name| folder.path().join(name));
    let leaf = ["--cab", "27", "--car", "11", "--cw", "0.02", "--n", "1.8", "--to-nm", "2500"];
    succeed(&[&["spectrum", "--quiet", "--csv", text(&table)], &leaf[..]].concat());
    let said = succeed(&["invert", text(&table), "--csv", text(&contents), "--plots", text(&plots)]);
    assert!(said.contains("maple, misses its spectra by 0.0000 R, 0.0000 T"), "{said}");
    assert!(said.contains("27 ug/cm2") && said.contains("chlorophyll"), "{said}");
    let written = fs::read_to_string(&contents).unwrap();
    let [heading, row] = written.lines().collect::<Vec<_>>()[..] else { panic!("{written}") };
    assert!(heading.starts_with("name,chlorophyll_ug_per_cm2,chlorophyll_ug_per_cm2_standard_error"));
    let chlorophyll: f64 = row.split(',').nth(1).unwrap().parse().unwrap();
    assert!((chlorophyll - 27.0).abs() < 1e-3, "{row}");
    let plot = fs::read_to_string(plots.join("maple.svg")).unwrap();
    assert!(plot.contains("R, measured") && plot.contains("T, plate-n"));
    // As JSON, with a content that is known.
    let json = succeed(&["invert", text(&table), "--hold", "cbrown=0,cant=0", "--json", "-"]);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let found = &json["leaves"][0]["contents"];
    assert_eq!(found["brown"]["state"], "held");
    assert!((found["water_cm"]["value"].as_f64().unwrap() - 0.02).abs() < 1e-5, "{found}");
    // The number of threads does not matter.
    let on = |threads: &str| {
        let json = succeed(&["invert", text(&table), "--threads", threads, "--json", "-"]);
        serde_json::from_str::<serde_json::Value>(&json).unwrap()["leaves"].clone()
    };
    assert_eq!(on("1"), on("2"));
}

#[test]
fn a_model_is_compared_with_measured_leaves() {
    let folder = tempfile::tempdir().unwrap();
    let [table, plot] = ["elm.csv", "elm.svg"].map(|name| folder.path().join(name));
    succeed(&["spectrum", "--cab", "27", "--quiet", "--csv", text(&table)]);
    let against = |more: &[&str]| {
        let json = succeed(&[&["spectrum", "--measured", text(&table), "--json", "-"], more].concat());
        serde_json::from_str::<serde_json::Value>(&json).unwrap()["measured"].clone()
    };
    let error = |told: &serde_json::Value| told["adaxial"]["reflectance"]["root_mean_square_error"].as_f64().unwrap();
    let same = against(&["--cab", "27", "--plot", text(&plot), "--both-sides"]);
    assert!(error(&same) < 1e-9 && same["adaxial"]["transmittance"]["leaves"] == 1, "{same}");
    assert!(same.get("abaxial").is_none() && fs::read_to_string(&plot).unwrap().contains("stroke-dasharray"));
    // Another leaf is told apart, also between the wavelengths of the table and beyond them.
    let other = error(&against(&["--cab", "60", "--step-nm", "7", "--to-nm", "900"]));
    assert!((0.005..0.1).contains(&other), "{other}");
    let output = synth(&["spectrum", "--measured", text(&table), "--from-nm", "900", "--to-nm", "1000"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && said.contains("elm.csv has no measurement of the adaxial face"), "{said}");
}

#[test]
fn both_faces_of_a_leaf_tell_its_halves() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("birch.csv");
    let leaf = ["--cab", "27", "--palisade-layers", "0.7", "--palisade-pigments", "0.9", "--to-nm", "2500"];
    let spectrum = ["spectrum", "--model", "plate-two-sided", "--both-sides", "--quiet", "--csv", text(&table)];
    succeed(&[&spectrum[..], &leaf[..]].concat());
    let found = |model: &str| {
        let json = succeed(&["invert", text(&table), "--model", model, "--hold", "cant=0,cbrown=0", "--json", "-"]);
        serde_json::from_str::<serde_json::Value>(&json).unwrap()["leaves"][0].clone()
    };
    let halves = found("plate-two-sided");
    for (key, value) in [("chlorophyll_ug_per_cm2", 27.0), ("palisade_layers", 0.7), ("palisade_pigments", 0.9)] {
        let told = halves["contents"][key]["value"].as_f64().unwrap();
        assert!((told / value - 1.0).abs() < 0.02, "{key} {told}");
    }
    // Planted difference: one pile has one face.
    let pile = found("plate-n");
    assert!(pile["rmse_abaxial_reflectance"].as_f64().unwrap() > 0.005, "{pile}");
}

#[test]
fn many_leaves_are_rows_and_remarks_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("leaves.csv");
    let mut csv = String::from("name,quantity");
    for nm in (400..=780).step_by(20) {
        csv += &format!(",{nm}");
    }
    for leaf in ["a", "b", "c", "d", "e"] {
        csv += &format!("\n{leaf},reflectance{}", ",5.0".repeat(20));
    }
    fs::write(&table, csv).unwrap();
    let said = succeed(&["invert", text(&table), "--percent"]);
    assert_eq!(said.lines().count(), 7, "{said}");
    assert!(said.lines().last().unwrap().contains("5 of 5 leaves have remarks"), "{said}");
    let refused = synth(&["invert", text(&table)]);
    assert_eq!(refused.status.code(), Some(1));
    let sentence = String::from_utf8(refused.stderr).unwrap();
    assert!(sentence.contains("leaves.csv") && sentence.contains("--percent"), "{sentence}");
}

#[test]
fn what_cannot_be_inverted_is_refused_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("leaf.csv");
    fs::write(&table, "nm,R\n450,0.05\n550,0.12\n").unwrap();
    let table = text(&table);
    for (arguments, code, words) in [
        (vec!["invert"], 2, "SPECTRA.csv"),
        (vec!["invert", "nowhere.csv"], 1, "nowhere.csv cannot be used as spectra"),
        (vec!["invert", table, "--hold", "wet=1"], 2, "cab, car, cant, cbrown, cw, cm, n"),
        (vec!["invert", table, "--hold", "cw=much"], 2, "--hold cw=much"),
        (vec!["invert", table, "--hold", "cw=3"], 2, "water is 3"),
        (vec!["invert", table, "--model", "plate-paper"], 2, "plate-n, plate-two-sided, abm97, abm-b or abm-u"),
        (vec!["invert", table, "--cone-deg", "91"], 2, "0 to 90"),
        (vec!["invert", table, "--csv", "no/such/folder/x.csv"], 1, "no/such/folder"),
        (vec!["invert", "--capture", "nowhere"], 2, "--out"),
        (vec!["invert", "--capture", "nowhere", "-o", "x"], 1, "nowhere"),
        (vec!["invert", "--capture", "nowhere", "-o", "x", "--hold", "cab=3"], 2, "cant, cw, cm and n"),
    ] {
        let output = synth(&arguments);
        let sentence = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {sentence}");
        assert!(sentence.contains(words), "{arguments:?}: {sentence}");
    }
}

#[test]
fn a_photographed_leaf_becomes_a_leaf_file_that_is_photographed_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (capture, out) = (path("capture"), path("leaf"));
    let small = ["--size", "16", "--directions", "random:5", "--quiet"];
    succeed(&[&["leaf", text(&capture), "--species", "soybean", "--cab", "45"], &small[..]].concat());
    let said = succeed(&["invert", "--capture", text(&capture), "-o", text(&out), "--hold", "n=1.5"]);
    assert!(said.contains("leaf.toml: chlorophyll"), "{said}");
    assert!(fs::read_to_string(out.join("leaf.toml")).unwrap().contains("textures = \"textures\""));
    assert!(out.join("standard-errors/pigment.png").exists());
    let again = path("again");
    succeed(&[&["leaf", text(&again), "--leaf", text(&out.join("leaf.toml"))], &small[..]].concat());
    assert!(again.join("capture.toml").exists());
    // What is there is not written over.
    let refused = synth(&["invert", "--capture", text(&capture), "-o", text(&out)]);
    let sentence = String::from_utf8(refused.stderr).unwrap();
    assert!(
        refused.status.code() == Some(1)
            && sentence.contains("leaf is not an empty folder; choose another output folder"),
        "{sentence}"
    );
}

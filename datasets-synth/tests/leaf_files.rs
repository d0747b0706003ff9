//! Leaves described in files: `btf-synth leaf --leaf` and `--write-leaf`, and what spectra take from them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use btf_models::{LeafDescription, Species};

fn synth(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_btf-synth")).args(arguments).output().unwrap()
}

fn succeed(arguments: &[&str]) -> Vec<u8> {
    let output = synth(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

/// Makes a small capture and gives its files' bytes in order.
fn capture(dir: &Path, more: &[&str]) -> Vec<(PathBuf, Vec<u8>)> {
    let fixed =
        ["leaf", dir.to_str().unwrap(), "--size", "16", "--directions", "random:3", "--format", "exr", "--quiet"];
    succeed(&[&fixed, more].concat());
    let mut files = Vec::new();
    let mut folders = vec![dir.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => folders.push(path),
                false => files.push((path.strip_prefix(dir).unwrap().to_path_buf(), fs::read(&path).unwrap())),
            }
        }
    }
    files.sort();
    assert!(files.len() >= 9);
    files
}

#[test]
fn the_same_leaf_by_file_and_by_options_gives_the_same_bytes() {
    let parent = tempfile::tempdir().unwrap();
    let path = |name: &str| parent.path().join(name);
    let file = path("deep/leaf.toml");
    fs::create_dir(path("deep")).unwrap();
    let options = [
        "--species",
        "maize",
        "--deficiency",
        "magnesium",
        "--severity",
        "0.55",
        "--cab",
        "33.3",
        "--cw",
        "0.02",
        "--n",
        "1.75",
        "--gamma",
        "0.31",
        "--gamma-across",
        "0.44",
        "--size-mm",
        "24.7",
        "--seed",
        "12",
    ];
    let by_options = capture(&path("options"), &[&options[..], &["--write-leaf", file.to_str().unwrap()]].concat());
    let by_file = capture(&path("file"), &["--leaf", file.to_str().unwrap()]);
    assert!(by_options == by_file);
    // An option wins over the file.
    let greener = capture(&path("greener"), &["--leaf", file.to_str().unwrap(), "--cab", "60"]);
    assert!(greener != by_file && greener.len() == by_file.len());
    // Exported textures are named as seen from the file, and read again.
    let (leaf, textures) = (path("deep/again.toml"), path("textures"));
    let export = ["--export-textures", textures.to_str().unwrap(), "--write-leaf", leaf.to_str().unwrap()];
    capture(&path("exported"), &[&options[..], &export].concat());
    assert_eq!(LeafDescription::read(&leaf).unwrap().textures, Some("../textures".into()));
    let from_textures = capture(&path("by-textures"), &["--leaf", leaf.to_str().unwrap(), "--seed", "99"]);
    let other_seed = capture(&path("other-seed"), &["--leaf", file.to_str().unwrap(), "--seed", "99"]);
    assert!(from_textures != other_seed, "the textures were not read");
}

#[test]
fn a_spectrum_of_a_file_is_that_of_its_contents() {
    let parent = tempfile::tempdir().unwrap();
    let file = parent.path().join("leaf.toml");
    let mut leaf = LeafDescription::of(Some(Species::Tree), None);
    leaf.contents.brown = 0.4;
    leaf.write(&file).unwrap();
    let spectrum = |more: &[&str]| {
        let text = succeed(&[&["spectrum", "--step-nm", "50", "--json", "-"], more].concat());
        let json: serde_json::Value = serde_json::from_slice(&text).unwrap();
        json["reflectance"].to_string()
    };
    let by_options = spectrum(&["--cab", "50", "--car", "10", "--n", "1.6", "--cbrown", "0.4"]);
    assert_eq!(spectrum(&["--leaf", file.to_str().unwrap()]), by_options);
    assert_ne!(spectrum(&[]), by_options);
    // The random walk takes pigments alone.
    let walk = ["--model", "abm97", "--rays", "1e3"];
    let by_options = spectrum(&[&walk[..], &["--cab", "50", "--car", "10"]].concat());
    assert_eq!(spectrum(&[&walk[..], &["--leaf", file.to_str().unwrap()]].concat()), by_options);
    assert_ne!(spectrum(&walk), by_options);
}

#[test]
fn a_bad_file_is_named_and_nothing_is_written() {
    let parent = tempfile::tempdir().unwrap();
    let file = parent.path().join("leaf.toml");
    fs::write(&file, "[contents]\nbrown = 2").unwrap();
    let out = parent.path().join("out");
    let output = synth(&["leaf", out.to_str().unwrap(), "--leaf", file.to_str().unwrap()]);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(message.contains("leaf.toml has `brown` in [contents] as 2") && message.lines().count() == 1, "{message}");
    assert_eq!(fs::read_dir(parent.path()).unwrap().count(), 1);
    let output = synth(&["leaf", out.to_str().unwrap(), "--severity", "0.5"]);
    assert_eq!((output.status.code(), out.exists()), (Some(2), false));
}

//! `btf-view --motion` as a process: files beside the pictures, and sentences where there is no motion.

use std::path::Path;
use std::process::{Command, Output};

/// Runs the program on a sphere, without a window.
fn run(folder: &Path, arguments: &[&str]) -> Output {
    let scene = folder.join("scene.toml");
    let text =
        "[[object]]\nmesh = \"sphere\"\nmaterial = \"m\"\n[[material]]\nname = \"m\"\ndiffuse = [0.5, 0.5, 0.5]\n";
    std::fs::write(&scene, text).unwrap();
    Command::new(env!("CARGO_BIN_EXE_btf-view"))
        .arg("--scene")
        .arg(scene)
        .args(["--backend", "cpu", "--size", "24x16", "--quiet", "--headless", "--out"])
        .arg(folder.join("around.png"))
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn motion_is_written_beside_each_picture_of_a_turntable() {
    let dir = tempfile::tempdir().unwrap();
    let ended = run(dir.path(), &["--turntable", "2", "--motion"]);
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let mut names: Vec<String> =
        dir.path().read_dir().unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    let wanted = ["around_000-motion.exr", "around_000.png", "around_001-motion.exr", "around_001.png", "scene.toml"];
    assert_eq!(names, wanted);
    let bytes = std::fs::read(dir.path().join("around_001-motion.exr")).unwrap();
    for channel in ["motion.X\0", "motion.Y\0", "Z\0"] {
        assert!(bytes.windows(channel.len()).any(|window| window == channel.as_bytes()), "{channel}");
    }
}

#[test]
fn a_single_picture_and_bands_have_no_motion_and_say_so() {
    let dir = tempfile::tempdir().unwrap();
    for (arguments, named) in
        [(&["--motion"][..], "--sequence"), (&["--turntable", "2", "--motion", "--bands"][..], "cannot be used with")]
    {
        let ended = run(dir.path(), arguments);
        let told = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(2), "{told}");
        assert!(told.contains(named), "{told}");
        assert!(!dir.path().join("around_000-motion.exr").exists());
    }
}

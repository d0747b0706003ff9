//! `btf-view serve` as a process: lines in, lines and pixels out.

use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Command, Stdio};

#[test]
fn requests_are_answered_one_after_the_other_and_faults_are_sentences() {
    let dir = tempfile::tempdir().unwrap();
    let scene =
        "[[object]]\nmesh = \"sphere\"\nmaterial = \"m\"\n[[material]]\nname = \"m\"\ndiffuse = [0.5, 0.5, 0.5]\n";
    let path = dir.path().join("scene.toml");
    std::fs::write(&path, scene).unwrap();
    let mut server = Command::new(env!("CARGO_BIN_EXE_btf-view"))
        .args(["serve", "--backend", "cpu"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut requests = server.stdin.take().unwrap();
    let mut answers = BufReader::new(server.stdout.take().unwrap());
    let mut answer_to = |request: &str| {
        writeln!(requests, "{request}").unwrap();
        loop {
            let mut line = String::new();
            answers.read_line(&mut line).unwrap();
            let told: Value = serde_json::from_str(&line).unwrap();
            if told["progress"].is_null() && told["note"].is_null() {
                let mut pixels = vec![0; told["bytes"].as_u64().unwrap_or(0) as usize];
                answers.read_exact(&mut pixels).unwrap();
                return (told, pixels);
            }
        }
    };
    let good = format!("{{\"scene\": {:?}, \"size\": [20, 10], \"frames\": 2}}", path.display());
    let (told, pixels) = answer_to(&good);
    assert_eq!((told["width"].as_u64(), told["frames"].as_u64(), pixels.len()), (Some(20), Some(2), 20 * 10 * 16));
    for bad in ["no json", "{\"scene\": \"none.toml\", \"size\": [2, 2], \"frames\": 1}", "{\"size\": [2, 2]}"] {
        let (told, pixels) = answer_to(bad);
        let sentence = told["error"].as_str().unwrap();
        assert!(pixels.is_empty() && !sentence.is_empty() && !sentence.contains('\n'), "{sentence}");
    }
    assert_eq!(answer_to(&good).1, pixels);
    drop(requests);
    assert!(server.wait().unwrap().success());
}

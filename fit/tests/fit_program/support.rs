//! What the tests of the program share.

#![allow(dead_code, reason = "each test program takes what it needs of these")]

use btf_capture::{CaptureInfo, CaptureWriter, DirectionSet, ImageFormat};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Runs the program in `folder`.
pub fn btf_fit(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_btf-fit"))
        .args(arguments)
        .current_dir(folder)
        // Without it the window system's library writes a line of its own when adapters are listed.
        .env("XDG_RUNTIME_DIR", folder)
        .stdin(Stdio::null())
        .output()
        .expect("btf-fit starts")
}

/// Exit code and the single line on stderr.
pub fn refusal(output: &Output) -> (i32, String) {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(text.trim_end().lines().count(), 1, "one sentence, not: {text}");
    assert!(text.starts_with("error: ") && !text.contains("panicked"), "{text}");
    (output.status.code().unwrap_or(-1), text)
}

/// Writes a capture of a bumpy, tinted surface with a highlight: 10 x 9 texels, `directions` lights and as many views.
pub fn bumpy_capture(folder: &Path, name: &str, directions: usize, seed: u64) -> PathBuf {
    bumpy_capture_of(folder, name, [10, 9], directions, seed)
}

/// Writes a capture like [`bumpy_capture`]'s of `width` x `height` texels.
pub fn bumpy_capture_of(
    folder: &Path,
    name: &str,
    [width, height]: [usize; 2],
    directions: usize,
    seed: u64,
) -> PathBuf {
    let set = DirectionSet::random(directions, seed).unwrap();
    let path = folder.join(name);
    let info = CaptureInfo::new(name, width, height, set.clone(), set.clone(), ImageFormat::Png);
    let writer = CaptureWriter::create(&path, info).unwrap();
    for (view, wo) in set.units().iter().enumerate() {
        for (light, wi) in set.units().iter().enumerate() {
            let texel = |t: usize| {
                let (x, y) = ((t % width) as f32 * 0.9, (t / width) as f32 * 0.7);
                let n = [0.3 * x.sin(), 0.3 * y.cos(), 1.0f32];
                let half = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
                let dot = |a: [f32; 3]| a.iter().zip(n).map(|(a, n)| a * n).sum::<f32>().max(0.0);
                let gloss = (dot(half) / (2.2 * dot([0.0, 0.0, 1.0]))).min(1.0).powi(12);
                [0.5, 0.4, 0.2].map(|c| c * dot(*wi) * (1.0 + 0.3 * (x * y).sin()) + 0.3 * gloss * wi[2])
            };
            writer.write(view, light, &(0..width * height).flat_map(texel).collect::<Vec<_>>()).unwrap();
        }
    }
    writer.finish().unwrap();
    path
}

/// Says that `what` is left out, and has `cargo xtask test` count it as a skipped test.
pub fn skip(what: &str) {
    println!("skipped: {what}");
    if let Some(log) = std::env::var_os("BTF_SKIP_LOG") {
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(log).expect("the skip log opens");
        writeln!(file, "{what}").expect("the skip log is written");
    }
}

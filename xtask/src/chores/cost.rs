//! `cargo xtask cost`: the constants by which the fitter tells hours, from fits of captures of btf-synth that are timed here.

use crate::arguments::asks_for_help;
use crate::failure::Failure;
use crate::shell::{cargo, root, run_checked};
use std::fs;
use std::path::Path;

const HELP: &str = "\
Writes the constants of `btf-fit library plan --estimate`, fit/src/cost/cost.toml: makes captures of many sizes with btf-synth and
times fits of them, an hour on two cores on which nothing else should run. What was timed is kept in target/cost/fits.json
and not timed again.

Usage: cargo xtask cost

Example:
  cargo xtask cost";

/// Folder of the captures, relative to the repository's root.
const FOLDER: &str = "target/cost";
/// The constants that come with the fitter.
const BUILT_IN: &str = "fit/src/cost/cost.toml";
/// Captures to learn from: name, kind, and options of btf-synth.
const LEARNT: [(&str, &str, &str); 13] = [
    ("tiny", "cloth", "--size 16 --directions random:20"),
    ("twill-64", "cloth", "--size 64"),
    ("plain-128", "cloth", "--size 128 --weave plain"),
    ("satin-256", "cloth", "--size 256 --directions random:24 --weave satin"),
    ("twill-512", "cloth", "--size 512 --directions random:16"),
    ("twill-512-more", "cloth", "--size 512 --directions random:40 --seed 3"),
    ("twill-256", "cloth", "--size 256"),
    ("calf-32", "leather", "--size 32"),
    ("calf-128", "leather", "--size 128 --directions random:40"),
    ("calf-192", "leather", "--size 192 --directions random:60 --format jpg"),
    ("calf-128-hdr", "leather", "--size 128 --directions random:40 --format exr --seed 4"),
    ("tree-64", "leaf", "--size 64 --directions dome151 --species tree"),
    (THINNED, "cloth", "--size 64 --seed 5"),
];
/// The capture of [`LEARNT`] of which most images are removed.
const THINNED: &str = "thinned-64";
/// Of so many images one is kept.
const THINNED_TO: usize = 5;
/// Captures that the estimate is judged on.
const HELD_OUT: [(&str, &str, &str); 5] = [
    ("held-out-calf-96", "leather", "--size 96 --seed 9"),
    ("held-out-satin-384", "cloth", "--size 384 --directions random:50 --weave satin --seed 9"),
    ("held-out-soybean-200", "leaf", "--size 200 --directions random:64 --species soybean"),
    ("held-out-maize-48-hdr", "leaf", "--size 48 --directions random:100 --species maize --format exr"),
    ("held-out-calf-256", "leather", "--size 256 --seed 9"),
];

/// Runs the chore.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if asks_for_help(arguments) {
        println!("{HELP}");
        return Ok(());
    }
    if !arguments.is_empty() {
        return Err(Failure::usage(format!("`cost` takes no options\n\n{HELP}")));
    }
    let folders = |captures: &[(&str, &str, &str)]| {
        captures.iter().map(|capture| made(*capture)).collect::<Result<Vec<String>, Failure>>()
    };
    let (learnt, held_out) = (folders(&LEARNT)?, folders(&HELD_OUT)?);
    let mut bench = cargo(&["run", "--release", "--quiet", "-p", "btf-fit", "--", "bench", "cost"]);
    bench.args(&learnt).args(["-o", BUILT_IN, "--measured", "target/cost/fits.json"]);
    bench.args(held_out.iter().flat_map(|folder| ["--held-out", folder.as_str()]));
    run_checked(&mut bench)
}

/// Makes a capture that is not there yet, and returns its folder.
fn made((name, kind, options): (&str, &str, &str)) -> Result<String, Failure> {
    let folder = format!("{FOLDER}/{name}");
    if root().join(&folder).exists() {
        return Ok(folder);
    }
    // A capture is whole or it is not there.
    let unfinished = format!("{folder}.unfinished");
    let _ = fs::remove_dir_all(root().join(&unfinished));
    let mut synth = cargo(&["run", "--release", "--quiet", "-p", "btf-synth", "--", kind, &unfinished, "--quiet"]);
    run_checked(synth.args(options.split(' ')))?;
    let [from, to] = [&unfinished, &folder].map(|folder| root().join(folder));
    let finish = || -> std::io::Result<()> {
        if name == THINNED {
            thin(&from)?;
        }
        fs::rename(&from, &to)
    };
    finish().map_err(|error| Failure::new(format!("making {folder} failed: {error}")))?;
    Ok(folder)
}

/// Removes most images of a capture and says so in its `capture.toml`.
fn thin(capture: &Path) -> std::io::Result<()> {
    let mut images = Vec::new();
    for view in fs::read_dir(capture)? {
        let view = view?.path();
        if view.is_dir() {
            for image in fs::read_dir(view)? {
                images.push(image?.path());
            }
        }
    }
    images.sort();
    for (number, image) in images.iter().enumerate() {
        // A view has 81 lights, which is no multiple of 5: every view and every light keeps some.
        if number % THINNED_TO != 0 {
            fs::remove_file(image)?;
        }
    }
    let manifest = capture.join("capture.toml");
    let text = fs::read_to_string(&manifest)?;
    fs::write(&manifest, format!("incomplete = true\n{text}"))
}

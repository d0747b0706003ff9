//! The package for browsers and Node.js: compiles the C interface to WebAssembly, puts it beside the scripts, and runs their
//! tests.

use super::{browser, wasm};
use crate::counts::{Counts, from_tap};
use crate::failure::Failure;
use crate::files::failed;
use crate::shell::{answer_of, cargo, folder_of, program_file, root, run_and_read, run_checked};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The scripts' folder, relative to the repository's root.
const SCRIPTS: &str = "runtime/web";
/// The package below the target folder, as npm takes it.
const PACKAGE: &str = "web/btf-runtime";
/// The files of the package that are in the repository, from its root.
const FILES: [&str; 14] = [
    "runtime/web/package.json",
    "runtime/web/README.md",
    "runtime/web/index.js",
    "runtime/web/index.d.ts",
    "runtime/web/three.js",
    "runtime/web/three.d.ts",
    "runtime/web/three_words.js",
    "runtime/web/three_worker.js",
    "runtime/web/three.html",
    "runtime/web/three_path_tracer.js",
    "runtime/web/three_path_tracer.d.ts",
    "runtime/web/wgsl.d.ts",
    "LICENSE-MIT",
    "LICENSE-APACHE",
];

/// Makes the package, and returns its folder. `profile` is cargo's.
pub fn build(target: &Path, profile: &str) -> Result<PathBuf, Failure> {
    let compiled = wasm::build(target, "btf-runtime-c", "btf.wasm", profile)?;
    let folder = target.join(PACKAGE);
    if folder.exists() {
        std::fs::remove_dir_all(&folder).map_err(|error| failed(&folder, &error))?;
    }
    std::fs::create_dir_all(&folder).map_err(|error| failed(&folder, &error))?;
    let copy = |from: &Path, name: &str| {
        std::fs::copy(from, folder.join(name)).map_err(|error| failed(from, &error)).map(|_| ())
    };
    for file in FILES {
        copy(&root().join(file), file.rsplit('/').next().unwrap_or(file))?;
    }
    copy(&compiled, "btf.wasm")?;
    let text = answer_of(&mut example(target, "wgsl_module", profile)?)
        .ok_or_else(|| Failure::new("the WGSL of the decoder was not written"))?;
    let script = folder.join("wgsl.js");
    std::fs::write(&script, text).map_err(|error| failed(&script, &error))?;
    Ok(folder)
}

/// Builds an example of the runtime and returns the command that runs it. All of the workspace is chosen, so that what it uses has the
/// features that it has in the tests, and is not compiled once more.
fn example(target: &Path, name: &str, profile: &str) -> Result<Command, Failure> {
    run_checked(&mut cargo(&["build", "--quiet", "--workspace", "--profile", profile, "--example", name]))?;
    Ok(Command::new(target.join(folder_of(profile)).join("examples").join(program_file(name))))
}

/// Runs the tests of the package in Node.js: what it answers is compared with the runtime's own answers. Those in a browser are
/// skipped where there is none.
pub fn test(target: &Path, package: &Path, profile: &str) -> Result<Counts, Failure> {
    if answer_of(Command::new("node").arg("--version")).is_none() {
        return Err(Failure::new(
            "the package for browsers is tested in Node.js: install Node.js 20 or newer, or set BTF_SKIP_WEB=1",
        ));
    }
    let answers = target.join("web/answers");
    std::fs::create_dir_all(&answers).map_err(|error| failed(&answers, &error))?;
    let asset = root().join("viewer/src/scene/builtin/weave.spmm");
    run_checked(example(target, "answers", profile)?.arg(&asset).arg(answers.join("weave.json")))?;
    std::fs::copy(&asset, answers.join("weave.spmm")).map_err(|error| failed(&asset, &error))?;
    let mut node = Command::new("node");
    node.args(["--test", "--test-reporter=tap"]).arg(root().join(SCRIPTS).join("tests"));
    node.env("BTF_WEB_PACKAGE", package).env("BTF_WEB_ANSWERS", &answers);
    browser::tell(target, &mut node);
    let (status, output) = run_and_read(&mut node)?;
    match from_tap(&output) {
        Some(counts) if status.success() || counts.failed > 0 => Ok(counts),
        _ => Err(Failure::new(format!("the tests of the package for browsers did not run: see {SCRIPTS}/tests"))),
    }
}

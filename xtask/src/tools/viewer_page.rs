//! The viewer as a page: compiles it to WebAssembly, puts it beside the page's scripts and its gallery, and tests it in a
//! browser.

use super::{browser, driver, wasm, wasm_bindgen};
use crate::counts::{Counts, from_tap};
use crate::failure::Failure;
use crate::files::{copy, copy_folder, failed, files_of};
use crate::shell::{build_programs, folder_of, root, run_and_read, run_checked};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The page's scripts and gallery, relative to the repository's root.
const PAGE: &str = "viewer/web/page";
/// The tests, relative to the repository's root.
const TESTS: &str = "viewer/web/tests";
/// The volumes of landscapes, relative to the repository's root.
const VOLUMES: &str = "viewer/src/scene/builtin";
/// The folder below the target folder.
const FOLDER: &str = "web/btf-view";
/// Licences of what the program is made of.
const LICENCES: [&str; 3] = ["LICENSE-MIT", "LICENSE-APACHE", "NOTICE"];

/// Makes the folder of static files, and returns it. `profile` is cargo's.
pub fn build(target: &Path, profile: &str) -> Result<PathBuf, Failure> {
    let compiled = wasm::build(target, "btf-viewer-web", "btf_viewer_web.wasm", profile)?;
    let folder = target.join(FOLDER);
    if folder.exists() {
        std::fs::remove_dir_all(&folder).map_err(|error| failed(&folder, &error))?;
    }
    copy_folder(&root().join(PAGE), &folder)?;
    let volumes = folder.join("volumes");
    std::fs::create_dir_all(&volumes).map_err(|error| failed(&volumes, &error))?;
    for name in files_of(&root().join(VOLUMES))?.into_iter().filter(|name| name.ends_with(".voltex")) {
        copy(&root().join(VOLUMES).join(&name), &volumes.join(&name))?;
    }
    for name in LICENCES {
        copy(&root().join(name), &folder.join(name))?;
    }
    let mut bind = Command::new(wasm_bindgen::program(target));
    bind.args(["--target", "web", "--no-typescript", "--out-name", "btf_viewer", "--out-dir"]).arg(&folder);
    run_checked(bind.arg(&compiled))?;
    Ok(folder)
}

/// Copies the files of `page`, which [`build`] has made, into a folder that a static host serves.
pub fn publish(page: &Path, folder: &Path) -> Result<(), Failure> {
    let is_free = std::fs::read_dir(folder).map_or(true, |mut entries| entries.next().is_none());
    if !is_free && !folder.join("btf_view.js").is_file() {
        return Err(Failure::new(format!(
            "{} holds other files than an earlier page's: name an empty folder or a new one",
            folder.display()
        )));
    }
    copy_folder(page, folder)
}

/// Runs the tests of the page and of the package `btf-runtime` for three.js in a browser; pictures are compared with those of
/// btf-view in this profile.
pub fn test(target: &Path, page: &Path, package: &Path, profile: &str) -> Result<Counts, Failure> {
    build_programs(profile)?;
    let binaries = target.join(folder_of(profile));
    let pictures = target.join("web/pictures");
    std::fs::create_dir_all(&pictures).map_err(|error| failed(&pictures, &error))?;
    let mut node = Command::new("node");
    // One after the other: each draws on all processors.
    node.args(["--test", "--test-reporter=tap", "--test-concurrency=1"]).arg(root().join(TESTS));
    node.env("BTF_WEB_PAGE", page).env("BTF_WEB_PICTURES", &pictures).env("BTF_WEB_PACKAGE", package);
    node.env("BTF_VIEW", binaries.join("btf-view")).env("BTF_FIT", binaries.join("btf-fit"));
    node.env("BTF_SYNTH", binaries.join("btf-synth"));
    node.envs(driver::QUICK_COMPILER);
    browser::tell(target, &mut node);
    let (status, output) = run_and_read(&mut node)?;
    match from_tap(&output) {
        Some(counts) if status.success() || counts.failed > 0 => Ok(counts),
        _ => Err(Failure::new(format!("the tests of the page did not run: see {TESTS}"))),
    }
}

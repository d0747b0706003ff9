//! A browser without a window, and what presses its buttons: Chromium, and Playwright without browsers of its own.

use super::apt::{self, Program};
use super::npm::{self, Package};
use crate::failure::Failure;
use std::path::{Path, PathBuf};
use std::process::Command;

const CHROMIUM: Program = Program { name: "chromium", package: "chromium", question: "--version" };
const PLAYWRIGHT: Package = Package {
    name: "Playwright",
    file: "tests/peers/browser/package.json",
    folder: "browser",
    purpose: "pages are tested in Chromium by Playwright",
};

/// Finds or installs both. Returns one line with their versions.
pub fn ensure(target: &Path) -> Result<String, Failure> {
    let chromium = apt::ensure(&[&CHROMIUM], &advice)?;
    Ok(format!("{chromium}; {}", npm::ensure(target, &PLAYWRIGHT)?))
}

/// Tells `command`, which runs tests in Node.js, where both are, if they are.
pub fn tell(target: &Path, command: &mut Command) {
    let playwright = target.join("peers").join(PLAYWRIGHT.folder).join("node_modules/playwright-core");
    if let (Some(chromium), true) = (path_of(CHROMIUM.name), playwright.is_dir()) {
        command.env("BTF_WEB_BROWSER", chromium).env("BTF_WEB_PLAYWRIGHT", playwright);
    }
}

/// Finds a program in the folders of `PATH`.
fn path_of(name: &str) -> Option<PathBuf> {
    std::env::split_paths(&std::env::var_os("PATH")?).map(|folder| folder.join(name)).find(|path| path.is_file())
}

fn advice(missing: &[&str]) -> String {
    format!(
        "the tests of pages need {}: install it (Debian: apt-get install {}), or set BTF_SKIP_WEB=1 to leave them out",
        missing.join(" and "),
        missing.join(" ")
    )
}

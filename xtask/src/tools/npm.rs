//! Packages of npm that judge what we write, each in a folder of its own under the target folder.

use super::python_environment::LEAVE_OUT;
use crate::failure::Failure;
use crate::shell::{answer_of, root, run_and_read};
use std::path::Path;
use std::process::Command;

/// The copy of package.json that marks a complete installation, in the package's folder.
const STAMP: &str = "package-installed.json";

/// A package that npm installs.
pub struct Package {
    /// Usual name of the package.
    pub name: &'static str,
    /// The package.json that names the version, relative to the repository's root.
    pub file: &'static str,
    /// The folder below `target`/peers in which the package is installed.
    pub folder: &'static str,
    /// Purpose of the package, as the beginning of a sentence.
    pub purpose: &'static str,
}

/// Finds the package below `target` or installs it there. Returns one line that says so.
pub fn ensure(target: &Path, package: &Package) -> Result<String, Failure> {
    let Package { name, file, purpose, .. } = package;
    let folder = target.join("peers").join(package.folder);
    let text = std::fs::read_to_string(root().join(file))
        .map_err(|error| Failure::new(format!("{file} cannot be read: {error}")))?;
    let stamp = folder.join(STAMP);
    if answer_of(Command::new("node").arg("--version")).is_none() {
        return Err(Failure::new(format!(
            "{purpose}, which runs in Node.js: install Node.js 20 or newer with npm, {LEAVE_OUT}"
        )));
    }
    if std::fs::read_to_string(&stamp).is_ok_and(|installed| installed == text) {
        return Ok(format!("{name} is in {}", folder.display()));
    }
    let write = |path: &Path| {
        std::fs::write(path, &text)
            .map_err(|error| Failure::new(format!("{} cannot be written: {error}", path.display())))
    };
    std::fs::create_dir_all(&folder)
        .map_err(|error| Failure::new(format!("{} cannot be made: {error}", folder.display())))?;
    write(&folder.join("package.json"))?;
    let mut npm = Command::new(if cfg!(windows) { "npm.cmd" } else { "npm" });
    // The packages bring all that they need along; nothing of them has to run.
    npm.args(["install", "--no-audit", "--no-fund", "--ignore-scripts"]).current_dir(&folder);
    let (status, _) = run_and_read(&mut npm)?;
    if !status.success() {
        return Err(Failure::new(format!(
            "{name} could not be installed with npm: check the network and that {file} names a version that there is, \
             {LEAVE_OUT}"
        )));
    }
    write(&stamp)?;
    Ok(format!("{name} was installed in {}", folder.display()))
}

//! The Python module: builds its wheel with maturin, installs the wheel below the target folder and runs its tests
//! there.

use super::peers;
use crate::failure::Failure;
use crate::shell::{root, run_and_read};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The package's folder, relative to the repository's root.
const PACKAGE: &str = "python";

/// Profile in which the module is compiled.
#[derive(Clone, Copy)]
pub enum Build {
    /// The profile of the module that users get.
    Release,
    /// The profile of the tests, so that common dependencies are built once.
    Tests,
}

impl Build {
    /// The name of cargo's profile.
    pub fn profile(self) -> &'static str {
        match self {
            Build::Release => "release",
            Build::Tests => "dev",
        }
    }
}

/// Returns the folder of the one wheel that [`build_and_test`] makes.
pub fn wheels(target: &Path) -> PathBuf {
    target.join("peers/wheels")
}

/// Builds, installs and tests the module with the Python of [`peers::ensure`]. Returns one line that names the wheel.
pub fn build_and_test(target: &Path, kind: Build) -> Result<String, Failure> {
    let python = peers::interpreter(target);
    let (wheels, module) = (wheels(target), target.join("peers/btf"));
    for folder in [&wheels, &module] {
        if folder.exists() {
            std::fs::remove_dir_all(folder)
                .map_err(|error| Failure::new(format!("{} cannot be removed: {error}", folder.display())))?;
        }
    }

    let mut build = Command::new(&python);
    build.args(["-m", "maturin", "build", "--profile", kind.profile(), "--manifest-path"]);
    build.arg(root().join(PACKAGE).join("Cargo.toml"));
    build.arg("--target-dir").arg(target).arg("--out").arg(&wheels).arg("--interpreter").arg(&python);
    let (status, output) = run_and_read(&mut build)?;
    if !status.success() {
        return Err(Failure::new(match output.contains("No module named maturin") {
            true => "the Python module is built by maturin: install it (pip install maturin) for the Python that \
                     BTF_PEERS_PYTHON names"
                .to_string(),
            false => "the wheel of the Python module was not built: see maturin's output above".to_string(),
        }));
    }
    let wheel = the_wheel(&wheels)?;

    // Into a folder of its own, so that the environment stays what its requirements say.
    let mut install = Command::new(&python);
    install.args(["-m", "pip", "install", "--quiet", "--no-input", "--disable-pip-version-check", "--no-deps"]);
    let (status, _) = run_and_read(install.arg("--target").arg(&module).arg(wheels.join(&wheel)))?;
    if !status.success() {
        return Err(Failure::new(format!("{wheel} was not installed: see pip's output above")));
    }

    let mut test = Command::new(&python);
    test.args(["-m", "unittest"]).current_dir(root().join(PACKAGE).join("tests"));
    test.env("PYTHONPATH", &module).env("PYTHONDONTWRITEBYTECODE", "1");
    let (status, output) = run_and_read(&mut test)?;
    let ran = output.lines().find(|line| line.starts_with("Ran ")).unwrap_or("Ran 0 tests").to_string();
    if !status.success() || ran.starts_with("Ran 0 ") {
        return Err(Failure::new(format!("the Python module's tests failed: see {PACKAGE}/tests")));
    }
    // Tests that use the module compare its time with that of the sources.
    let stamp = module.join("installed.txt");
    std::fs::write(&stamp, format!("{wheel}\n"))
        .map_err(|error| Failure::new(format!("{} cannot be written: {error}", stamp.display())))?;
    Ok(format!("{wheel}: {}", ran.to_lowercase()))
}

/// Returns the name of the one file in the folder, which must be a wheel for every Python from 3.9 on.
fn the_wheel(folder: &Path) -> Result<String, Failure> {
    let names = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = names.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    match names.pop() {
        Some(name) if names.is_empty() && name.contains("-cp39-abi3-") && name.ends_with(".whl") => Ok(name),
        other => Err(Failure::new(format!(
            "maturin made {}, where one wheel of the kind cp39-abi3 was expected",
            other.as_deref().unwrap_or("nothing")
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_one_wheel_for_all_pythons_is_taken() {
        let folder = std::env::temp_dir().join(format!("btf-wheels-{}", std::process::id()));
        let of = |names: &[&str]| {
            let _ = std::fs::remove_dir_all(&folder);
            std::fs::create_dir_all(&folder).unwrap();
            names.iter().for_each(|name| std::fs::write(folder.join(name), "").unwrap());
            the_wheel(&folder).map_err(|failure| failure.to_string())
        };
        let good = "btf-0.1.0-cp39-abi3-manylinux_2_34_x86_64.whl";
        assert_eq!(of(&[good]).as_deref(), Ok(good));
        for bad in [&[][..], &["btf-0.1.0-cp311-cp311-linux_x86_64.whl"], &[good, "more.whl"], &["btf.cp39-abi3-.txt"]]
        {
            assert!(of(bad).is_err_and(|sentence| sentence.contains("cp39-abi3 was expected")), "{bad:?}");
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }
}

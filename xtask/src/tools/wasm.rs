//! Compiles packages of ours to WebAssembly. rustup has the standard library for it (`rustup target add
//! wasm32-unknown-unknown`); where it is not installed, cargo compiles it from its sources, which rustup's component
//! rust-src has, or Debian's package of the same version.

use super::apt::{self, is_root_on_debian};
use crate::failure::Failure;
use crate::shell::{answer_of, cargo, folder_of, run_checked};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The target that browsers run.
const TARGET: &str = "wasm32-unknown-unknown";
/// Vectors of 128 bits, which all browsers have had since 2023.
const FEATURES: &str = "-C target-feature=+simd128";
/// The suite of Debian that has the sources of recent releases of Rust.
const SUITE: &str = "trixie-backports";
/// The folder below the target folder in which packages are compiled. Build scripts tell compilers of nightly features from others, so in
/// a folder that both use, everything would be compiled anew whenever one follows the other.
const FOLDER: &str = "wasm";
/// The folder of the sources below the target folder.
const SOURCES: &str = "peers/rust-src";

/// The standard library for [`TARGET`].
#[derive(Debug, Clone, PartialEq)]
enum Library {
    /// A library that rustup has installed.
    Installed,
    /// Sources that the toolchain has.
    InToolchain,
    /// Sources in a folder of their own.
    Sources(PathBuf),
}

/// Finds the standard library or its sources, or gets the latter as root on Debian. Returns one line that says where they
/// are.
pub fn ensure(target: &Path) -> Result<String, Failure> {
    if library(target).is_none() && is_root_on_debian() {
        fetch_sources(target)?;
    }
    match library(target) {
        Some(Library::Installed) => Ok(format!("the standard library for {TARGET} is installed")),
        Some(Library::InToolchain) => Ok("the sources of the standard library are the toolchain's".into()),
        Some(Library::Sources(folder)) => {
            Ok(format!("the sources of the standard library are in {}", folder.display()))
        }
        None => Err(Failure::new(format!(
            "browsers run WebAssembly: `rustup target add {TARGET}`, or set BTF_SKIP_WEB=1 to leave out what needs it"
        ))),
    }
}

/// Compiles a package to WebAssembly in a profile of cargo's, and returns the file.
pub fn build(target: &Path, package: &str, file: &str, profile: &str) -> Result<PathBuf, Failure> {
    let library = library(target).ok_or_else(|| Failure::new("the standard library is missing"))?;
    let own = target.join(FOLDER);
    let mut command = cargo(&["build", "--package", package, "--profile", profile, "--target", TARGET]);
    // Flags of the user's are for the user's own machine.
    command.env("RUSTFLAGS", FEATURES).arg("--target-dir").arg(&own);
    if library != Library::Installed {
        command.arg("-Zbuild-std=std,panic_abort").env("RUSTC_BOOTSTRAP", "1");
    }
    if let Library::Sources(folder) = library {
        command.env("__CARGO_TESTS_ONLY_SRC_ROOT", folder);
    }
    run_checked(&mut command)?;
    Ok(own.join(TARGET).join(folder_of(profile)).join(file))
}

fn library(target: &Path) -> Option<Library> {
    let rustc = |arguments: &[&str]| {
        answer_of(Command::new("rustc").args(arguments)).map(|answer| PathBuf::from(answer.trim()))
    };
    let libraries = rustc(&["--print", "target-libdir", "--target", TARGET])?;
    if std::fs::read_dir(libraries).is_ok_and(|mut files| files.next().is_some()) {
        return Some(Library::Installed);
    }
    if rustc(&["--print", "sysroot"])?.join("lib/rustlib/src/rust/library/std").is_dir() {
        return Some(Library::InToolchain);
    }
    let folder = target.join(SOURCES).join(format!("usr/src/rustc-{}/library", version()?));
    folder.join("std").is_dir().then_some(Library::Sources(folder))
}

/// Returns the version of the compiler, 1.95.0 of "rustc 1.95.0 (59807616e 2026-04-14)".
fn version() -> Option<String> {
    Some(answer_of(Command::new("rustc").arg("--version"))?.split_whitespace().nth(1)?.to_string())
}

/// Gets Debian's sources of the compiler's own version; the lists of packages are read into a folder below `target`, so that
/// nothing of the system changes.
fn fetch_sources(target: &Path) -> Result<(), Failure> {
    let missing = |what: &str| Failure::new(format!("{what}; `rustup target add {TARGET}` is the other way"));
    let version = version().ok_or_else(|| missing("rustc does not tell its version"))?;
    let codename = crate::shell::os_release("VERSION_CODENAME").unwrap_or_default();
    let source = apt::source_of_suite(&apt::present_sources(), &codename, SUITE)
        .ok_or_else(|| missing("no Debian archive was found in the package sources"))?;
    let folder = target.join(SOURCES);
    let make = |path: PathBuf| {
        std::fs::create_dir_all(&path).map_err(|error| Failure::new(format!("{}: {error}", path.display())))
    };
    ["parts", "lists/partial", "cache/archives/partial"].into_iter().try_for_each(|part| make(folder.join(part)))?;
    let list = folder.join("parts/sources.sources");
    std::fs::write(&list, source).map_err(|error| Failure::new(format!("{}: {error}", list.display())))?;
    let own = |arguments: &[&str], program: &str| {
        let mut command = Command::new(program);
        let places = [
            ("Dir::Etc::sourcelist", PathBuf::from("/dev/null")),
            ("Dir::Etc::sourceparts", folder.join("parts")),
            ("Dir::State::lists", folder.join("lists")),
            ("Dir::Cache", folder.join("cache")),
        ];
        for (name, place) in places {
            command.arg("-o").arg(format!("{name}={}", place.display()));
        }
        command.args(arguments).current_dir(&folder);
        command
    };
    run_checked(&mut own(&["update"], "apt-get"))?;
    let listed = answer_of(&mut own(&["madison", "rust-src"], "apt-cache")).unwrap_or_default();
    let package = package_of(&listed, &version)
        .ok_or_else(|| missing(&format!("Debian's {SUITE} has no sources of Rust {version}")))?;
    run_checked(&mut own(&["download", &format!("rust-src={package}")], "apt-get"))?;
    let file = std::fs::read_dir(&folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
    let file = file.into_iter().find(|path| path.extension().is_some_and(|ending| ending == "deb"));
    let file = file.ok_or_else(|| missing("the package was not downloaded"))?;
    let unpacked = run_checked(Command::new("dpkg").arg("-x").arg(&file).arg(&folder));
    // 45 MB that nobody needs again.
    let _ = std::fs::remove_file(&file);
    unpacked
}

/// Returns the version of Debian's package of a version of Rust, from the lines of `apt-cache madison`.
fn package_of(listed: &str, version: &str) -> Option<String> {
    let versions = listed.lines().filter_map(|line| line.split('|').nth(1)).map(str::trim);
    versions.into_iter().find(|package| package.starts_with(&format!("{version}+"))).map(String::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_package_of_the_compilers_version_is_chosen() {
        let listed = " rust-src | 1.96.1+dfsg1-2~bpo13+1 | http://mirror.example trixie-backports/main amd64 Packages\n \
                      rust-src | 1.95.0+dfsg1-2~bpo13+1 | http://mirror.example trixie-backports/main amd64 Packages\n";
        assert_eq!(package_of(listed, "1.95.0").as_deref(), Some("1.95.0+dfsg1-2~bpo13+1"));
        assert_eq!((package_of(listed, "1.95"), package_of(listed, "1.94.0")), (None, None));
    }
}

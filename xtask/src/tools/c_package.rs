//! libbtf as C and C++ programs find it: headers, libraries, a package for CMake and one for pkg-config, in a prefix.

use crate::failure::Failure;
use crate::files::{copy, failed, files_of, make_empty};
use crate::shell::{cargo, folder_of, root, run_and_read, run_checked};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The interface's folder, relative to the repository's root.
const PACKAGE: &str = "runtime/c";
/// The asset that the sample is run with.
const ASSET: &str = "viewer/src/scene/builtin/weave.spmm";
/// Licences of the library.
const LICENCES: [&str; 3] = ["LICENSE-MIT", "LICENSE-APACHE", "NOTICE"];

/// Builds the library in cargo's `profile` and installs it into `prefix`: include, lib, lib/cmake/btf, lib/pkgconfig and
/// share/doc/btf.
pub fn install(target: &Path, prefix: &Path, profile: &str) -> Result<(), Failure> {
    run_checked(&mut cargo(&["build", "--quiet", "--package", "btf-runtime-c", "--lib", "--profile", profile]))?;
    let built = target.join(folder_of(profile));
    let package = root().join(PACKAGE);
    let into = |folder: &str| -> Result<_, Failure> {
        let folder = prefix.join(folder);
        std::fs::create_dir_all(&folder).map_err(|error| failed(&folder, &error))?;
        Ok(folder)
    };
    let include = into("include")?;
    for name in files_of(&package.join("include"))? {
        copy(&package.join("include").join(&name), &include.join(&name))?;
    }
    for (folder, name) in libraries() {
        copy(&built.join(name), &into(folder)?.join(name))?;
    }
    for (folder, name) in
        [("lib/cmake/btf", "btfConfig.cmake"), ("lib/cmake/btf", "btfConfigVersion.cmake"), ("lib/pkgconfig", "btf.pc")]
    {
        let from = package.join("cmake").join(name);
        let text = std::fs::read_to_string(&from).map_err(|error| failed(&from, &error))?;
        let to = into(folder)?.join(name);
        // Chores have the version of the workspace, as the library has.
        let text = text.replace("@VERSION@", env!("CARGO_PKG_VERSION"));
        std::fs::write(&to, text).map_err(|error| failed(&to, &error))?;
    }
    let documents = into("share/doc/btf")?;
    for name in LICENCES {
        copy(&root().join(name), &documents.join(name))?;
    }
    Ok(())
}

/// Returns folders and names of the libraries on this platform.
fn libraries() -> &'static [(&'static str, &'static str)] {
    match std::env::consts::OS {
        "windows" => &[("bin", "btf.dll"), ("lib", "btf.dll.lib"), ("lib", "btf.lib")],
        "macos" => &[("lib", "libbtf.dylib"), ("lib", "libbtf.a")],
        _ => &[("lib", "libbtf.so"), ("lib", "libbtf.a")],
    }
}

/// Installs the library into a folder below the target folder, moves it, and builds the sample against it as users would: by
/// CMake, with either library, and by pkg-config. Returns one line that says so.
pub fn test(target: &Path, profile: &str) -> Result<String, Failure> {
    let work = target.join("c/test");
    make_empty(&work)?;
    install(target, &work.join("installed"), profile)?;
    // A prefix may be moved.
    let prefix = work.join("moved");
    std::fs::rename(work.join("installed"), &prefix).map_err(|error| failed(&prefix, &error))?;
    let sample = root().join(PACKAGE).join("examples/cmake");
    let mut answers = vec![answer(&built_by_cmake(&sample, &prefix, &work.join("shared"))?)?];
    // The same project with the other library.
    let copied = work.join("sample");
    make_empty(&copied)?;
    copy(&sample.join("evaluate.cpp"), &copied.join("evaluate.cpp"))?;
    let list = sample.join("CMakeLists.txt");
    let text = std::fs::read_to_string(&list).map_err(|error| failed(&list, &error))?;
    let list = copied.join("CMakeLists.txt");
    std::fs::write(&list, text.replace("btf::btf", "btf::static")).map_err(|error| failed(&list, &error))?;
    answers.push(answer(&built_by_cmake(&copied, &prefix, &work.join("static"))?)?);
    // Planted difference: a version that is not there.
    std::fs::write(&list, text.replace("btf 0.1", "btf 0.2")).map_err(|error| failed(&list, &error))?;
    if configured(&copied, &prefix, &work.join("other"))? {
        return Err(Failure::new("CMake took version 0.1 of btf for 0.2".to_string()));
    }
    answers.push(answer(&built_by_pkg_config(&sample.join("evaluate.cpp"), &prefix, &work)?)?);
    match answers.iter().all(|text| text == &answers[0]) && answers[0].lines().count() == 6 {
        true => Ok("C++ programs find libbtf by CMake, shared and static, and by pkg-config".to_string()),
        false => Err(Failure::new(format!("the samples answer differently: {answers:?}"))),
    }
}

/// Configures a project of CMake; returns whether it could be.
fn configured(sample: &Path, prefix: &Path, build: &Path) -> Result<bool, Failure> {
    let mut configure = Command::new("cmake");
    configure.arg("-S").arg(sample).arg("-B").arg(build);
    configure.arg(format!("-DCMAKE_PREFIX_PATH={}", prefix.display())).arg("-DCMAKE_BUILD_TYPE=Release");
    Ok(run_and_read(&mut configure)?.0.success())
}

/// Builds a project of CMake; returns the program.
fn built_by_cmake(sample: &Path, prefix: &Path, build: &Path) -> Result<PathBuf, Failure> {
    if !configured(sample, prefix, build)? {
        return Err(Failure::new("CMake did not find the package btf: see its output above".to_string()));
    }
    run_checked(Command::new("cmake").arg("--build").arg(build))?;
    Ok(build.join("evaluate"))
}

/// Builds a source with the flags of pkg-config; returns the program.
fn built_by_pkg_config(source: &Path, prefix: &Path, work: &Path) -> Result<PathBuf, Failure> {
    let mut ask = Command::new("pkg-config");
    ask.args(["--cflags", "--libs", "btf"]).env("PKG_CONFIG_PATH", prefix.join("lib/pkgconfig"));
    let (status, flags) = run_and_read(&mut ask)?;
    if !status.success() {
        return Err(Failure::new("pkg-config did not find btf: see its output above".to_string()));
    }
    let program = work.join("by-pkg-config");
    let mut compile = Command::new("c++");
    compile.arg("-std=c++17").arg(source).args(flags.split_whitespace()).arg("-o").arg(&program);
    run_checked(compile.arg(format!("-Wl,-rpath,{}", prefix.join("lib").display())))?;
    Ok(program)
}

/// Runs the sample and returns what it prints.
fn answer(program: &Path) -> Result<String, Failure> {
    let mut sample = Command::new(program);
    // Cargo's search path holds another library of the name.
    sample.env_remove("LD_LIBRARY_PATH").arg(root().join(ASSET));
    let (status, output) = run_and_read(&mut sample)?;
    match status.success() {
        true => Ok(output),
        false => Err(Failure::new(format!("{} failed: see its output above", program.display()))),
    }
}

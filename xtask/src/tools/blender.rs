//! The add-on for Blender: stages it with the Python module and the programs, has Blender's own tool pack it, and tests the
//! packed extension in Blender.

use super::python_environment::Environment;
use super::python_module::{self, Build};
use crate::counts::{Counts, from_unittest};
use crate::failure::Failure;
use crate::files::{copy, copy_folder, failed, files_of, make_empty};
use crate::shell::{build_programs, folder_of, program_file, root, run_and_read, run_checked};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The add-on's folder, relative to the repository's root.
const ADDON: &str = "runtime/blender";
/// What of it is not packed.
const NOT_PACKED: [&str; 4] = ["tests", "examples", "README.md", "__pycache__"];
/// Licences of what is packed with it.
const LICENCES: [&str; 3] = ["LICENSE-MIT", "LICENSE-APACHE", "NOTICE"];
/// Blender's tool for extensions, within the module `bpy`.
const PACKER: &str = "scripts/addons_core/bl_pkg/cli/blender_ext.py";
/// The programs that are packed: those that the add-on calls.
const PACKED_PROGRAMS: [&str; 2] = ["btf-view", "btf-fit"];

const BLENDER: Environment = Environment {
    what: "Blender",
    folder: "blender",
    requirements: "tests/peers/requirements-blender.txt",
    makers: if cfg!(windows) { &["python"] } else { &["python3.11", "python3"] },
    python: "3.11",
    version: "import bpy; print(bpy.app.version_string)",
};

/// Finds or makes the environment with Blender in it. Returns one line that says which.
pub fn ensure(target: &Path) -> Result<String, Failure> {
    BLENDER.ensure(target)
}

/// Packs the extension with the wheel that [`python_module::build_and_test`] has made, and returns the file. The programs
/// are packed with it in the profile that users get.
pub fn build(target: &Path, kind: Build) -> Result<PathBuf, Failure> {
    // Users' extension is not replaced by that of the tests.
    let folder = match kind {
        Build::Release => target.join("blender"),
        Build::Tests => target.join("blender/tests"),
    };
    let stage = folder.join("stage");
    std::fs::create_dir_all(&folder).map_err(|error| failed(&folder, &error))?;
    for old in files_of(&folder)?.iter().filter(|name| name.ends_with(".zip")) {
        std::fs::remove_file(folder.join(old)).map_err(|error| failed(&folder, &error))?;
    }
    make_empty(&stage)?;
    let addon = root().join(ADDON);
    for name in files_of(&addon)?.iter().filter(|name| !NOT_PACKED.contains(&name.as_str())) {
        copy(&addon.join(name), &stage.join(name))?;
    }
    for name in LICENCES {
        copy(&root().join(name), &stage.join(name))?;
    }
    copy_folder(&python_module::wheels(target), &stage.join("wheels"))?;
    build_programs(kind.profile())?;
    if let Build::Release = kind {
        std::fs::create_dir_all(stage.join("bin")).map_err(|error| failed(&stage, &error))?;
        for name in PACKED_PROGRAMS.map(program_file) {
            copy(&programs(target, kind).join(&name), &stage.join("bin").join(&name))?;
        }
    }
    complete_manifest(&stage)?;
    let mut pack = Command::new(BLENDER.interpreter(target));
    pack.arg(packer(target)?).arg("build").arg("--source-dir").arg(&stage).arg("--output-dir").arg(&folder);
    run_checked(&mut pack)?;
    let packed = files_of(&folder)?.into_iter().find(|name| name.ends_with(".zip"));
    packed.map(|name| folder.join(name)).ok_or_else(|| Failure::new("Blender packed no extension".to_string()))
}

/// Installs the extension in Blender, in a folder of its own, and runs the add-on's tests there.
pub fn test(target: &Path, extension: &Path, kind: Build) -> Result<Counts, Failure> {
    let resources = target.join("blender/resources");
    make_empty(&resources)?;
    let mut test = Command::new(BLENDER.interpreter(target));
    test.args(["-m", "unittest"]).current_dir(root().join(ADDON).join("tests"));
    test.env("BLENDER_USER_RESOURCES", &resources).env("BTF_BLENDER_EXTENSION", extension);
    if let Build::Release = kind {
        // The programs within are those that run.
        test.env("BTF_BLENDER_PACKED", "1");
    }
    for (variable, name) in [("BTF_VIEW", "btf-view"), ("BTF_FIT", "btf-fit"), ("BTF_SYNTH", "btf-synth")] {
        test.env(variable, programs(target, kind).join(program_file(name)));
    }
    let (status, output) = run_and_read(test.env("PYTHONDONTWRITEBYTECODE", "1"))?;
    match from_unittest(&output) {
        Some(counts) if counts.passed > 0 && status.success() == (counts.failed == 0) => Ok(counts),
        _ => Err(Failure::new(format!("the add-on's tests did not run: see {ADDON}/tests"))),
    }
}

/// Returns the folder of the programs.
fn programs(target: &Path, kind: Build) -> PathBuf {
    target.join(folder_of(kind.profile()))
}

/// Names the staged wheel in the staged manifest, and the one platform that it is for.
fn complete_manifest(stage: &Path) -> Result<(), Failure> {
    let path = stage.join("blender_manifest.toml");
    let manifest = std::fs::read_to_string(&path).map_err(|error| failed(&path, &error))?;
    let wheels = files_of(&stage.join("wheels"))?;
    let completed = completed(&manifest, &wheels, platform());
    std::fs::write(&path, completed).map_err(|error| failed(&path, &error))
}

/// Returns the manifest with wheels and a platform, which belong before its first table.
fn completed(manifest: &str, wheels: &[String], platform: &str) -> String {
    let paths: Vec<String> = wheels.iter().map(|wheel| format!("\"./wheels/{wheel}\"")).collect();
    let lines = format!("platforms = [\"{platform}\"]\nwheels = [{}]\n\n", paths.join(", "));
    let at = manifest.find("\n[").map_or(manifest.len(), |at| at + 1);
    format!("{}{lines}{}", &manifest[..at], &manifest[at..])
}

/// Returns Blender's name of this platform.
fn platform() -> &'static str {
    match (std::env::consts::OS, std::env::consts::ARCH) {
        ("windows", "aarch64") => "windows-arm64",
        ("windows", _) => "windows-x64",
        ("macos", "aarch64") => "macos-arm64",
        ("macos", _) => "macos-x64",
        _ => "linux-x64",
    }
}

/// Returns the path of Blender's tool for extensions.
fn packer(target: &Path) -> Result<PathBuf, Failure> {
    let python = BLENDER.interpreter(target);
    let script = "import bpy; print('resources:' + bpy.utils.resource_path('LOCAL'))";
    let (_, output) = run_and_read(Command::new(python).args(["-c", script]))?;
    let resources = output.lines().find_map(|line| line.trim().strip_prefix("resources:"));
    let packer = resources.map(|path| Path::new(path).join(PACKER)).filter(|path| path.is_file());
    packer.ok_or_else(|| Failure::new(format!("this Blender has no {PACKER}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wheels_stand_before_the_tables_of_the_manifest() {
        let manifest = "id = \"a\"\ntags = [\"Material\"]\n\n[permissions]\nfiles = \"x\"\n";
        let completed = completed(manifest, &["a.whl".into()], "linux-x64");
        let expected =
            "tags = [\"Material\"]\n\nplatforms = [\"linux-x64\"]\nwheels = [\"./wheels/a.whl\"]\n\n[permissions]";
        assert!(completed.contains(expected), "{completed}");
    }
}

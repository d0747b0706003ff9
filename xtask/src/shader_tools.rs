//! Programs of others that judge our shaders: spirv-val, glslangValidator, and Dawn, whose WGSL compiler is Tint.

use crate::failure::Failure;
use crate::peers::LEAVE_OUT;
use crate::shell::{answer_of, is_root_on_debian, root, run_and_read, run_checked};
use std::path::Path;
use std::process::Command;

/// Programs, the Debian packages that have them, and an argument with which they only answer.
const PROGRAMS: [(&str, &str, &str); 2] =
    [("spirv-val", "spirv-tools", "--version"), ("glslangValidator", "glslang-tools", "--version")];

/// Relative to the repository's root: what npm installs, with its version.
const PACKAGE: &str = "shaders/tests/dawn/package.json";

/// In the folder of Dawn when it is complete: the package file that it was made from.
const STAMP: &str = "package-installed.json";

/// Finds or installs all of them, Dawn in `target`/peers/dawn; the sentence says so.
pub fn ensure(target: &Path) -> Result<String, Failure> {
    let programs = ensure_programs()?;
    let dawn = ensure_dawn(&target.join("peers").join("dawn"))?;
    Ok(format!("{programs}; {dawn}"))
}

fn ensure_programs() -> Result<String, Failure> {
    let missing = || PROGRAMS.iter().filter(|(program, _, argument)| !answers(program, argument));
    let packages: Vec<&str> = missing().map(|(_, package, _)| *package).collect();
    if packages.is_empty() {
        return Ok("spirv-val and glslangValidator are here".to_string());
    }
    if !is_root_on_debian() {
        return Err(Failure::new(advice(&packages)));
    }
    let apt = |arguments: &[&str]| {
        run_checked(Command::new("apt-get").args(arguments).env("DEBIAN_FRONTEND", "noninteractive"))
    };
    apt(&["update"])?;
    apt(&[&["install", "-y", "--no-install-recommends"], &packages[..]].concat())?;
    match missing().next() {
        None => Ok(format!("{} installed", packages.join(" and "))),
        Some((program, package, _)) => {
            Err(Failure::new(format!("{package} was installed, but {program} does not answer; {}", advice(&packages))))
        }
    }
}

fn advice(packages: &[&str]) -> String {
    format!(
        "the shaders are checked by spirv-val and glslangValidator: install them (Debian, Ubuntu: apt-get install {}; \
         elsewhere SPIRV-Tools and glslang, or the Vulkan SDK), {LEAVE_OUT}",
        packages.join(" ")
    )
}

fn ensure_dawn(folder: &Path) -> Result<String, Failure> {
    let package = std::fs::read_to_string(root().join(PACKAGE))
        .map_err(|error| Failure::new(format!("{PACKAGE} cannot be read: {error}")))?;
    let stamp = folder.join(STAMP);
    if !answers("node", "--version") {
        return Err(Failure::new(format!(
            "the WGSL is checked by Dawn's compiler, which runs in Node.js: install Node.js 20 or newer with npm, \
             {LEAVE_OUT}"
        )));
    }
    if std::fs::read_to_string(&stamp).is_ok_and(|text| text == package) {
        return Ok(format!("Dawn is in {}", folder.display()));
    }
    let write = |path: &Path| {
        std::fs::write(path, &package)
            .map_err(|error| Failure::new(format!("{} cannot be written: {error}", path.display())))
    };
    std::fs::create_dir_all(folder)
        .map_err(|error| Failure::new(format!("{} cannot be made: {error}", folder.display())))?;
    write(&folder.join("package.json"))?;
    let mut npm = Command::new(if cfg!(windows) { "npm.cmd" } else { "npm" });
    // The package brings its library along; nothing of it has to run.
    npm.args(["install", "--no-audit", "--no-fund", "--ignore-scripts"]).current_dir(folder);
    let (status, _) = run_and_read(&mut npm)?;
    if !status.success() {
        return Err(Failure::new(format!(
            "Dawn could not be installed with npm: check the network and that {PACKAGE} names a version that there is, \
             {LEAVE_OUT}"
        )));
    }
    write(&stamp)?;
    Ok(format!("Dawn was installed in {}", folder.display()))
}

fn answers(program: &str, argument: &str) -> bool {
    answer_of(Command::new(program).arg(argument)).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn advice_is_one_sentence_with_the_remedy() {
        let sentence = advice(&["spirv-tools", "glslang-tools"]);
        assert!(sentence.contains("apt-get install spirv-tools glslang-tools") && !sentence.contains('\n'));
        assert!(sentence.contains("BTF_SKIP_PEERS=1"));
    }

    #[test]
    fn a_program_that_is_not_there_does_not_answer() {
        assert!(!answers("btf-no-such-program", "--version"));
        assert!(answers("cargo", "--version"));
    }
}

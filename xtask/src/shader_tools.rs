//! Programs of others that judge our shaders: spirv-val, glslangValidator, and Dawn, whose WGSL compiler is Tint.

use crate::failure::Failure;
use crate::npm::{self, Package};
use crate::peers::LEAVE_OUT;
use crate::shell::{answer_of, is_root_on_debian, run_checked};
use std::path::Path;
use std::process::Command;

/// Programs, the Debian packages that have them, and an argument with which they only answer.
const PROGRAMS: [(&str, &str, &str); 2] =
    [("spirv-val", "spirv-tools", "--version"), ("glslangValidator", "glslang-tools", "--version")];

const DAWN: Package = Package {
    name: "Dawn",
    file: "runtime/shaders/tests/dawn/package.json",
    folder: "dawn",
    purpose: "the WGSL is checked by Dawn's compiler",
};

/// Finds or installs all of them, Dawn in `target`/peers/dawn; the sentence says so.
pub fn ensure(target: &Path) -> Result<String, Failure> {
    let programs = ensure_programs()?;
    let dawn = npm::ensure(target, &DAWN)?;
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

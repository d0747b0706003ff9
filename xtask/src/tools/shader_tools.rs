//! Programs that judge our shaders: spirv-val, glslangValidator, and Dawn, whose WGSL compiler is Tint.

use super::apt::{self, Program};
use super::npm::{self, Package};
use super::python_environment::LEAVE_OUT;
use crate::failure::Failure;
use std::path::Path;

const PROGRAMS: [Program; 2] = [
    Program { name: "spirv-val", package: "spirv-tools", question: "--version" },
    Program { name: "glslangValidator", package: "glslang-tools", question: "--version" },
];

const DAWN: Package = Package {
    name: "Dawn",
    file: "runtime/shaders/tests/dawn/package.json",
    folder: "dawn",
    purpose: "the WGSL is checked by Dawn's compiler",
};

/// Finds or installs spirv-val and glslangValidator. Returns one line that says so.
pub fn ensure_validators() -> Result<String, Failure> {
    apt::ensure(&PROGRAMS.each_ref(), &advice).map(|_| "spirv-val and glslangValidator are here".to_string())
}

/// Finds Dawn in `target`/peers/dawn or installs it there with npm. Returns one line that says so.
pub fn ensure_dawn(target: &Path) -> Result<String, Failure> {
    npm::ensure(target, &DAWN)
}

fn advice(packages: &[&str]) -> String {
    format!(
        "the shaders are checked by spirv-val and glslangValidator: install them (Debian, Ubuntu: apt-get install {}; \
         elsewhere SPIRV-Tools and glslang, or the Vulkan SDK), {LEAVE_OUT}",
        packages.join(" ")
    )
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
}

//! valgrind, under which the test program in C runs, and the system's C compiler, which builds it.

use crate::failure::Failure;
use crate::shell::{answer_of, is_root_on_debian, run_checked};
use std::process::Command;

/// Programs that the tests in C start, with Debian's packages of them.
const TOOLS: [(&str, &str); 3] = [("cc", "gcc"), ("c++", "g++"), ("valgrind", "valgrind")];

/// Whether the user leaves valgrind out.
pub fn left_out() -> bool {
    std::env::var_os("BTF_SKIP_VALGRIND").is_some_and(|value| value == "1")
}

/// Finds the tools or installs them (Debian, as root); the sentence says which.
pub fn ensure() -> Result<String, Failure> {
    let missing = missing();
    if missing.is_empty() {
        return Ok(found());
    }
    if !is_root_on_debian() {
        return Err(Failure::new(advice(&missing)));
    }
    println!("installing {}", missing.join(" "));
    let apt = |arguments: &[&str]| {
        run_checked(Command::new("apt-get").args(arguments).env("DEBIAN_FRONTEND", "noninteractive"))
    };
    apt(&["update"])?;
    apt(&[&["install", "-y", "--no-install-recommends"][..], &missing].concat())?;
    match self::missing() {
        still if still.is_empty() => Ok(found()),
        still => Err(Failure::new(advice(&still))),
    }
}

/// Packages of the tools that are not there.
fn missing() -> Vec<&'static str> {
    let wanted = TOOLS.into_iter().filter(|(program, _)| *program != "valgrind" || !left_out());
    wanted.filter(|(program, _)| version_of(program).is_none()).map(|(_, package)| package).collect()
}

fn version_of(program: &str) -> Option<String> {
    let answer = answer_of(Command::new(program).arg("--version"))?;
    Some(answer.lines().next().unwrap_or_default().trim().to_string())
}

fn found() -> String {
    let versions = TOOLS.iter().filter_map(|(program, _)| version_of(program));
    format!("tools for the tests in C: {}", versions.collect::<Vec<_>>().join("; "))
}

fn advice(missing: &[&str]) -> String {
    format!(
        "the tests in C need {}: install it (Debian: apt-get install {}); where there is no valgrind, \
         BTF_SKIP_VALGRIND=1 leaves its run out",
        missing.join(", "),
        missing.join(" ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_advice_is_a_command_that_can_be_typed() {
        let advice = advice(&["g++", "valgrind"]);
        assert!(advice.contains("apt-get install g++ valgrind)") && !advice.contains('\n'), "{advice}");
    }

    #[test]
    fn a_program_that_is_not_there_has_no_version() {
        assert_eq!(version_of("btf-no-such-program"), None);
        assert!(version_of("cargo").is_some_and(|version| version.starts_with("cargo ")));
    }
}

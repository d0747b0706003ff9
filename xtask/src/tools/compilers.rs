//! The system's C and C++ compilers, CMake and pkg-config, which build the test programs in C and C++, and valgrind, under
//! which some of them run.

use super::apt::{self, Program};
use crate::failure::Failure;

const COMPILERS: [Program; 4] = [
    Program { name: "cc", package: "gcc", question: "--version" },
    Program { name: "c++", package: "g++", question: "--version" },
    Program { name: "cmake", package: "cmake", question: "--version" },
    Program { name: "pkg-config", package: "pkg-config", question: "--version" },
];
const VALGRIND: Program = Program { name: "valgrind", package: "valgrind", question: "--version" };

/// Returns whether `BTF_SKIP_VALGRIND=1` leaves valgrind out.
pub fn valgrind_is_left_out() -> bool {
    std::env::var_os("BTF_SKIP_VALGRIND").is_some_and(|value| value == "1")
}

/// Finds the compilers, CMake, pkg-config and, unless it is left out, valgrind, or installs them. Returns one line with their versions.
pub fn ensure() -> Result<String, Failure> {
    let valgrind = (!valgrind_is_left_out()).then_some(&VALGRIND);
    let programs: Vec<&Program> = COMPILERS.iter().chain(valgrind).collect();
    Ok(format!("tools for the tests in C: {}", apt::ensure(&programs, &advice)?))
}

fn advice(missing: &[&str]) -> String {
    let packages = missing.join(" ");
    format!(
        "the tests in C need {}: install it (Debian: apt-get install {packages}); where there is no valgrind, \
         BTF_SKIP_VALGRIND=1 leaves its run out",
        missing.join(", ")
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
}

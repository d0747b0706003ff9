//! Slurm, the scheduler of clusters, for the test in which it fits a library.

use super::apt::{self, Program};
use crate::failure::Failure;

/// The controller and the daemon of a node; Debian has both, and the commands, in one package.
const PROGRAMS: [Program; 2] = [
    Program { name: "slurmctld", package: "slurm-wlm", question: "-V" },
    Program { name: "slurmd", package: "slurm-wlm", question: "-V" },
];

/// Finds Slurm or installs it. Returns one line with its version.
pub fn ensure() -> Result<String, Failure> {
    apt::ensure(&PROGRAMS.each_ref(), &|_| {
        "no Slurm: the test in which it fits a library is left out (Debian, Ubuntu: apt-get install slurm-wlm)"
            .to_string()
    })
}

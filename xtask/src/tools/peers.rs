//! The renderer that our optics is compared with: Mitsuba 3 in a Python environment of its own under the target folder,
//! with the other packages of `tests/peers/requirements.txt`.

use super::apt;
use super::python_environment::{Environment, LEAVE_OUT};
use crate::failure::Failure;
use crate::shell::{answer_of, root, run_and_read};
use std::path::{Path, PathBuf};
use std::process::Command;

const MITSUBA: Environment = Environment {
    what: "Mitsuba",
    folder: "mitsuba",
    requirements: "tests/peers/requirements.txt",
    makers: if cfg!(windows) { &["python"] } else { &["python3"] },
    python: "3.9 or newer",
    version: "import mitsuba; print(mitsuba.__version__)",
};

/// Returns whether `BTF_SKIP_PEERS=1` leaves the comparisons out.
pub fn left_out() -> bool {
    std::env::var_os("BTF_SKIP_PEERS").is_some_and(|value| value == "1")
}

/// Finds or makes the environment in `target`/peers. Returns one line that says which. An interpreter that
/// `BTF_PEERS_PYTHON` names is taken as it is.
pub fn ensure(target: &Path) -> Result<String, Failure> {
    let Some(named) = std::env::var_os("BTF_PEERS_PYTHON") else { return MITSUBA.ensure(target) };
    let python = PathBuf::from(named);
    MITSUBA.version_of(&python).map(|version| format!("Mitsuba {version} of {}", python.display())).ok_or_else(|| {
        Failure::new(format!(
            "BTF_PEERS_PYTHON names {}, which cannot import mitsuba: unset it so that Mitsuba is installed, {LEAVE_OUT}",
            python.display()
        ))
    })
}

/// Finds LLVM, by which Mitsuba's vectorised variants compile, or installs it. Returns one line that says so.
pub fn ensure_llvm(target: &Path) -> Result<String, Failure> {
    let works = || {
        let program =
            "import mitsuba as mi; mi.set_variant('llvm_ad_rgb'); import drjit as dr; print(dr.arange(mi.Float, 2))";
        answer_of(Command::new(interpreter(target)).args(["-c", program])).is_some()
    };
    if !works() && apt::is_root_on_debian() {
        apt::install(&["llvm"])?;
    }
    match works() {
        true => Ok("Mitsuba finds LLVM".to_string()),
        false => Err(Failure::new(format!(
            "Mitsuba's vectorised variants need LLVM's shared library: install it (Debian: apt-get install llvm) or name it \
             in DRJIT_LIBLLVM_PATH, {LEAVE_OUT}"
        ))),
    }
}

/// Runs the self-checks of the rival codecs and of the synthetic materials with the Python that [`ensure`] found or made.
/// Returns one line that says so.
pub fn check_peers(target: &Path) -> Result<String, Failure> {
    let folder = root().join("tests").join("peers");
    for (what, test, folder) in [
        ("the rival codecs", "test_rivals", folder.clone()),
        ("the synthetic materials", "test_materials", folder.join("materials")),
    ] {
        let mut command = Command::new(interpreter(target));
        command.args(["-m", "unittest", test]).current_dir(folder);
        let (status, output) = run_and_read(&mut command)?;
        if !status.success() && output.contains("No module named 'numpy'") {
            return Err(Failure::new(format!("the self-check of {what} needs numpy: install it, {LEAVE_OUT}")));
        }
        if !status.success() {
            return Err(Failure::new(format!("the self-check of {what} failed: see {test}.py in tests/peers")));
        }
    }
    Ok("the rival codecs and the synthetic materials agree with themselves".to_string())
}

/// Returns the Python that [`ensure`] found or made.
pub fn interpreter(target: &Path) -> PathBuf {
    std::env::var_os("BTF_PEERS_PYTHON").map_or_else(|| MITSUBA.interpreter(target), PathBuf::from)
}

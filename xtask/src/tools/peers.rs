//! The renderer that our optics is compared with: Mitsuba 3 in a Python environment of its own under the target folder.

use crate::failure::Failure;
use crate::shell::{answer_of, root, run_and_read};
use std::path::{Path, PathBuf};
use std::process::Command;

/// List of the Python packages with their versions, relative to the repository's root.
const REQUIREMENTS: &str = "tests/peers/requirements.txt";

/// The copy of the requirements that marks a complete environment.
const STAMP: &str = "requirements-installed.txt";

/// End of every sentence about a missing tool that comparisons use.
pub const LEAVE_OUT: &str = "or set BTF_SKIP_PEERS=1 to leave these comparisons out";

/// Returns whether `BTF_SKIP_PEERS=1` leaves the comparisons out.
pub fn left_out() -> bool {
    std::env::var_os("BTF_SKIP_PEERS").is_some_and(|value| value == "1")
}

/// Finds or makes the environment in `target`/peers. Returns one line that says which. An interpreter that
/// `BTF_PEERS_PYTHON` names is taken as it is.
pub fn ensure(target: &Path) -> Result<String, Failure> {
    if let Some(named) = std::env::var_os("BTF_PEERS_PYTHON") {
        let python = PathBuf::from(named);
        return answer_of_mitsuba(&python)
            .map(|version| format!("Mitsuba {version} of {}", python.display()))
            .ok_or_else(|| {
                Failure::new(format!(
                    "BTF_PEERS_PYTHON names {}, which cannot import mitsuba: unset it so that Mitsuba is installed, \
                     {LEAVE_OUT}",
                    python.display()
                ))
            });
    }
    let requirements = std::fs::read_to_string(root().join(REQUIREMENTS))
        .map_err(|error| Failure::new(format!("{REQUIREMENTS} cannot be read: {error}")))?;
    let folder = target.join("peers").join("mitsuba");
    let stamp = folder.join(STAMP);
    let python = interpreter_in(&folder);
    if std::fs::read_to_string(&stamp).is_ok_and(|text| text == requirements)
        && let Some(version) = answer_of_mitsuba(&python)
    {
        return Ok(format!("Mitsuba {version} is in {}", folder.display()));
    }
    if folder.exists() {
        std::fs::remove_dir_all(&folder)
            .map_err(|error| Failure::new(format!("{} cannot be removed: {error}", folder.display())))?;
    }
    make(&folder, &python)?;
    std::fs::write(&stamp, requirements)
        .map_err(|error| Failure::new(format!("{} cannot be written: {error}", stamp.display())))?;
    let version = answer_of_mitsuba(&python).ok_or_else(|| {
        Failure::new(format!("Mitsuba was installed but cannot be imported: remove {}, {LEAVE_OUT}", folder.display()))
    })?;
    Ok(format!("Mitsuba {version} was installed in {}", folder.display()))
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
    match std::env::var_os("BTF_PEERS_PYTHON") {
        Some(named) => PathBuf::from(named),
        None => interpreter_in(&target.join("peers").join("mitsuba")),
    }
}

/// Makes the environment and installs the requirements into it, over the network.
fn make(folder: &Path, python: &Path) -> Result<(), Failure> {
    let system = if cfg!(windows) { "python" } else { "python3" };
    if answer_of(Command::new(system).arg("--version")).is_none() {
        return Err(Failure::new(format!(
            "the comparison with Mitsuba needs Python 3.9 or newer: install it (Debian: apt-get install python3 \
             python3-venv), {LEAVE_OUT}"
        )));
    }
    let (status, output) = run_and_read(Command::new(system).args(["-m", "venv"]).arg(folder))?;
    if !status.success() {
        return Err(Failure::new(venv_sentence(&output)));
    }
    let mut pip = Command::new(python);
    pip.args(["-m", "pip", "install", "--quiet", "--no-input", "--disable-pip-version-check"]);
    // A wheel or nothing: building Mitsuba takes a compiler and an hour.
    pip.args(["--only-binary", ":all:", "--requirement", REQUIREMENTS]).current_dir(root());
    let (status, output) = run_and_read(&mut pip)?;
    match status.success() {
        true => Ok(()),
        false => Err(Failure::new(pip_sentence(&output))),
    }
}

/// Returns a sentence that says why `python3 -m venv` failed.
fn venv_sentence(output: &str) -> String {
    // Debian packs the module that venv needs apart from Python.
    match output.contains("ensurepip") || output.contains("No module named venv") {
        true => format!(
            "this Python cannot make environments because its venv module is not complete: install it (Debian: apt-get \
             install python3-venv), {LEAVE_OUT}"
        ),
        false => format!(
            "`python3 -m venv` failed ({}): check that the target folder can be written and has room, {LEAVE_OUT}",
            last_line(output)
        ),
    }
}

/// Returns a sentence that says why pip failed.
fn pip_sentence(output: &str) -> String {
    format!(
        "Mitsuba could not be installed ({}): check the network, the proxy and that {REQUIREMENTS} has wheels for this \
         Python, {LEAVE_OUT}",
        last_line(output)
    )
}

/// Returns the last line that is not empty, shortened.
fn last_line(output: &str) -> String {
    let line = output.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("no message");
    line.trim().chars().take(200).collect()
}

fn interpreter_in(folder: &Path) -> PathBuf {
    folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" })
}

/// Returns Mitsuba's version, where the interpreter has it.
fn answer_of_mitsuba(python: &Path) -> Option<String> {
    let version = answer_of(Command::new(python).args(["-c", "import mitsuba; print(mitsuba.__version__)"]))?;
    Some(version.trim().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_are_one_sentence_with_the_remedy() {
        let debian = "The virtual environment was not created successfully because ensurepip is not\navailable.  On \
                      Debian/Ubuntu systems, you need to install the python3-venv\npackage using the following command.\n";
        let sentences = [
            venv_sentence(debian),
            venv_sentence("/usr/bin/python3: No module named venv\n"),
            venv_sentence("Error: [Errno 28] No space left on device\n\n"),
            pip_sentence("WARNING: Retrying\nERROR: No matching distribution found for eradiate-mitsuba==0.5.0\n"),
            pip_sentence(""),
        ];
        for sentence in &sentences {
            assert!(!sentence.contains('\n') && sentence.contains("BTF_SKIP_PEERS=1"), "{sentence}");
        }
        assert!(sentences[0].contains("apt-get install python3-venv") && sentences[0] == sentences[1]);
        assert!(sentences[2].contains("No space left"));
        assert!(sentences[3].contains("No matching distribution"));
    }

    #[test]
    fn an_interpreter_that_is_not_there_has_no_mitsuba() {
        assert_eq!(answer_of_mitsuba(Path::new("btf-no-such-python")), None);
    }
}

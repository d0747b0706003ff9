//! Python environments of their own under the target folder, with packages from the network.

use crate::failure::Failure;
use crate::shell::{answer_of, root, run_and_read};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The copy of the requirements that marks a complete environment.
const STAMP: &str = "requirements-installed.txt";

/// End of every sentence about a missing tool that comparisons use.
pub const LEAVE_OUT: &str = "or set BTF_SKIP_PEERS=1 to leave these comparisons out";

/// What an environment holds.
pub struct Environment {
    /// Name for messages.
    pub what: &'static str,
    /// Folder below `target`/peers.
    pub folder: &'static str,
    /// List of packages with their versions, relative to the repository's root.
    pub requirements: &'static str,
    /// Interpreters that can make it, the best first, and the version that is asked for in words.
    pub makers: &'static [&'static str],
    /// Oldest version of Python, or the only one, for messages.
    pub python: &'static str,
    /// Program whose one line of output is the version of what was installed.
    pub version: &'static str,
}

impl Environment {
    /// Finds or makes the environment. Returns one line that says which.
    pub fn ensure(&self, target: &Path) -> Result<String, Failure> {
        let requirements = std::fs::read_to_string(root().join(self.requirements))
            .map_err(|error| Failure::new(format!("{} cannot be read: {error}", self.requirements)))?;
        let (what, folder) = (self.what, self.path(target));
        let stamp = folder.join(STAMP);
        let python = self.interpreter(target);
        if std::fs::read_to_string(&stamp).is_ok_and(|text| text == requirements)
            && let Some(version) = self.version_of(&python)
        {
            return Ok(format!("{what} {version} is in {}", folder.display()));
        }
        if folder.exists() {
            std::fs::remove_dir_all(&folder)
                .map_err(|error| Failure::new(format!("{} cannot be removed: {error}", folder.display())))?;
        }
        self.make(&folder, &python)?;
        std::fs::write(&stamp, requirements)
            .map_err(|error| Failure::new(format!("{} cannot be written: {error}", stamp.display())))?;
        let version = self.version_of(&python).ok_or_else(|| {
            Failure::new(format!(
                "{what} was installed but cannot be imported: remove {}, {LEAVE_OUT}",
                folder.display()
            ))
        })?;
        Ok(format!("{what} {version} was installed in {}", folder.display()))
    }

    /// Returns the environment's folder.
    fn path(&self, target: &Path) -> PathBuf {
        target.join("peers").join(self.folder)
    }

    /// Returns the environment's Python.
    pub fn interpreter(&self, target: &Path) -> PathBuf {
        self.path(target).join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" })
    }

    /// Returns the version of what is installed for an interpreter, where it has it.
    pub fn version_of(&self, python: &Path) -> Option<String> {
        Some(answer_of(Command::new(python).args(["-c", self.version]))?.trim().to_string())
    }

    /// Makes the environment and installs the requirements into it, over the network.
    fn make(&self, folder: &Path, python: &Path) -> Result<(), Failure> {
        let there = |name: &&&str| answer_of(Command::new(name).arg("--version")).is_some();
        let Some(system) = self.makers.iter().find(there) else {
            return Err(Failure::new(format!(
                "{} needs Python {}: install it (Debian: apt-get install python3 python3-venv), {LEAVE_OUT}",
                self.what, self.python
            )));
        };
        let (status, output) = run_and_read(Command::new(system).args(["-m", "venv"]).arg(folder))?;
        if !status.success() {
            return Err(Failure::new(venv_sentence(&output)));
        }
        let mut pip = Command::new(python);
        pip.args(["-m", "pip", "install", "--quiet", "--no-input", "--disable-pip-version-check"]);
        // A wheel or nothing: building Mitsuba takes a compiler and an hour.
        pip.args(["--only-binary", ":all:", "--requirement", self.requirements]).current_dir(root());
        let (status, output) = run_and_read(&mut pip)?;
        match status.success() {
            true => Ok(()),
            false => Err(Failure::new(self.pip_sentence(&output))),
        }
    }

    /// Returns a sentence that says why pip failed.
    fn pip_sentence(&self, output: &str) -> String {
        format!(
            "{} could not be installed ({}): check the network, the proxy and that {} has wheels for this Python, which \
             must be {}, {LEAVE_OUT}",
            self.what,
            last_line(output),
            self.requirements,
            self.python
        )
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

/// Returns the last line that is not empty, shortened.
fn last_line(output: &str) -> String {
    let line = output.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("no message");
    line.trim().chars().take(200).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: Environment = Environment {
        what: "Nothing",
        folder: "none",
        requirements: "tests/peers/requirements.txt",
        makers: &["btf-no-such-python"],
        python: "3.9 or newer",
        version: "import nothing",
    };

    #[test]
    fn failures_are_one_sentence_with_the_remedy() {
        let debian = "The virtual environment was not created successfully because ensurepip is not\navailable.  On \
                      Debian/Ubuntu systems, you need to install the python3-venv\npackage using the following command.\n";
        let sentences = [
            venv_sentence(debian),
            venv_sentence("/usr/bin/python3: No module named venv\n"),
            venv_sentence("Error: [Errno 28] No space left on device\n\n"),
            NONE.pip_sentence("WARNING: Retrying\nERROR: No matching distribution found for eradiate-mitsuba==0.5.0\n"),
            NONE.pip_sentence(""),
            NONE.make(Path::new("none"), Path::new("none")).unwrap_err().to_string(),
        ];
        for sentence in &sentences {
            assert!(!sentence.contains('\n') && sentence.contains("BTF_SKIP_PEERS=1"), "{sentence}");
        }
        assert!(sentences[0].contains("apt-get install python3-venv") && sentences[0] == sentences[1]);
        assert!(sentences[2].contains("No space left"));
        assert!(sentences[3].contains("No matching distribution"));
    }

    #[test]
    fn an_interpreter_that_is_not_there_has_nothing() {
        assert_eq!(NONE.version_of(Path::new("btf-no-such-python")), None);
    }
}

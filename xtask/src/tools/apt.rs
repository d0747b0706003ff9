//! Programs from Debian's archive: finds them, installs them as root on Debian, or says what is missing.

use crate::failure::Failure;
use crate::shell::{answer_of, os_release, run_checked};
use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

/// A program that tests start.
pub struct Program {
    /// Name of the program on the command line.
    pub name: &'static str,
    /// Debian's package of it.
    pub package: &'static str,
    /// An argument with which the program only answers and ends.
    pub question: &'static str,
}

impl Program {
    /// Returns the first line that the program answers, or `None` where it is absent.
    pub fn version(&self) -> Option<String> {
        let answer = answer_of(Command::new(self.name).arg(self.question))?;
        Some(answer.lines().next().unwrap_or_default().trim().to_string())
    }
}

/// Finds programs or installs the packages of those that are missing. Returns one line with their versions; a failure
/// is the sentence that `advice` makes of the packages that are still missing.
pub fn ensure(programs: &[&Program], advice: &dyn Fn(&[&str]) -> String) -> Result<String, Failure> {
    let missing = || -> Vec<&str> {
        programs.iter().filter(|program| program.version().is_none()).map(|program| program.package).collect()
    };
    let absent = missing();
    if !absent.is_empty() {
        if !is_root_on_debian() {
            return Err(Failure::new(advice(&absent)));
        }
        install(&absent)?;
        let still = missing();
        if !still.is_empty() {
            return Err(Failure::new(advice(&still)));
        }
    }
    // A program that prints its version on the error stream answers with an empty line.
    let told = |program: &&Program| program.version().filter(|line| !line.is_empty()).unwrap_or(program.name.into());
    Ok(programs.iter().map(told).collect::<Vec<_>>().join("; "))
}

/// Returns whether packages can be installed with apt-get.
pub fn is_root_on_debian() -> bool {
    let is_root = answer_of(Command::new("id").arg("-u")).is_some_and(|id| id.trim() == "0");
    is_root && os_release("ID").as_deref() == Some("debian")
}

/// Installs Debian packages without what they only recommend.
pub fn install(packages: &[&str]) -> Result<(), Failure> {
    println!("installing {}", packages.join(" "));
    update()?;
    apt_get(&[&["install", "-y", "--no-install-recommends"], packages].concat())
}

/// Set when the lists of the archive have been read in this run.
static LISTS: OnceLock<()> = OnceLock::new();

/// Reads the lists of the archive, once a run.
fn update() -> Result<(), Failure> {
    if LISTS.get().is_some() { Ok(()) } else { refresh() }
}

/// Reads the lists of the archive, for example after a source was added.
pub fn refresh() -> Result<(), Failure> {
    apt_get(&["update"])?;
    let _ = LISTS.set(());
    Ok(())
}

/// Runs apt-get without questions.
fn apt_get(arguments: &[&str]) -> Result<(), Failure> {
    run_checked(Command::new("apt-get").args(arguments).env("DEBIAN_FRONTEND", "noninteractive"))
}

/// Returns the text of every file that lists package sources.
pub fn present_sources() -> Vec<String> {
    let folder =
        std::fs::read_dir("/etc/apt/sources.list.d").into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
    folder
        .chain([PathBuf::from("/etc/apt/sources.list")])
        .filter_map(|path| std::fs::read_to_string(path).ok())
        .collect()
}

/// Returns a stanza for `suite` on the mirror that the machine already uses for `codename`.
pub fn source_of_suite(sources: &[String], codename: &str, suite: &str) -> Option<String> {
    const KEYRING: &str = "/usr/share/keyrings/debian-archive-keyring.gpg";
    let stanza = |uri: &str, key: &str| {
        format!("Types: deb\nURIs: {uri}\nSuites: {suite}\nComponents: main\nSigned-By: {key}\n")
    };
    for text in sources {
        // The newer form: stanzas of `Key: value`.
        for block in text.split("\n\n") {
            let value = |key: &str| {
                block.lines().find_map(|line| Some(line.strip_prefix(key)?.strip_prefix(':')?.trim().to_string()))
            };
            if let (Some(uri), Some(suites)) = (value("URIs"), value("Suites"))
                && suites.split_whitespace().any(|listed| listed == codename)
                && uri.contains("debian")
            {
                return Some(stanza(
                    uri.split_whitespace().next()?,
                    &value("Signed-By").unwrap_or(KEYRING.to_string()),
                ));
            }
        }
        // The older form: `deb [options] uri suite components`.
        for line in text.lines().filter(|line| line.starts_with("deb ")) {
            let words: Vec<&str> = line
                .split_whitespace()
                .skip(1)
                .skip_while(|word| word.starts_with('[') || word.ends_with(']'))
                .collect();
            if let [uri, listed, ..] = words[..]
                && listed == codename
                && uri.contains("debian")
            {
                return Some(stanza(uri, KEYRING));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    const ABSENT: Program = Program { name: "btf-no-such-program", package: "btf-none", question: "--version" };
    const CARGO: Program = Program { name: "cargo", package: "cargo", question: "--version" };

    #[test]
    fn the_mirror_in_use_is_used_for_backports() {
        let new = "Types: deb\n# a comment\nURIs: http://mirror.example/debian\nSuites: bookworm bookworm-updates\nComponents: main\nSigned-By: /k.gpg\n";
        let source = source_of_suite(
            &["deb http://tools.example/apt cloud main\n".into(), new.into()],
            "bookworm",
            "bookworm-backports",
        )
        .unwrap();
        assert!(
            source.contains("URIs: http://mirror.example/debian\nSuites: bookworm-backports\n")
                && source.contains("/k.gpg"),
            "{source}"
        );
        let old = "deb [signed-by=/x.gpg] http://old.example/debian bookworm main\n";
        assert!(
            source_of_suite(&[old.into()], "bookworm", "bookworm-backports")
                .unwrap()
                .contains("http://old.example/debian")
        );
        assert_eq!(
            source_of_suite(&["deb http://tools.example/apt nodistro main\n".into()], "bookworm", "bookworm-backports"),
            None
        );
    }

    #[test]
    fn a_program_that_is_not_there_has_no_version() {
        assert_eq!(ABSENT.version(), None);
        assert!(CARGO.version().is_some_and(|version| version.starts_with("cargo ")));
    }

    #[test]
    fn programs_that_are_there_are_told_with_their_versions() {
        let told = ensure(&[&CARGO], &|missing| missing.join(" ")).unwrap();
        assert!(told.starts_with("cargo "), "{told}");
    }
}

//! No file of the repository names a folder of one developer's machine.

use crate::shell;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Beginnings of paths that exist on one machine only. Written in two halves, so that this file passes its own check.
const LOCAL: [&str; 5] = [
    concat!("/ro", "ot/"),
    concat!("/wo", "rk/"),
    concat!("/ho", "me/"),
    concat!("/Us", "ers/"),
    concat!("C:\\Us", "ers\\"),
];

/// Only tests may name the temporary folder.
const TEMPORARY: &str = concat!("/t", "mp/");

/// Larger files are data, not text that somebody wrote.
const LARGEST_BYTES: u64 = 4 << 20;

/// Checks every file that git tracks or would track. `Ok` holds one line that says what was read; `Err` every offence.
pub fn check(root: &Path) -> Result<String, String> {
    let (files, how) = files(root);
    let mut offences = Vec::new();
    for file in &files {
        let path = root.join(file);
        let is_text_sized = path.symlink_metadata().is_ok_and(|data| data.is_file() && data.len() <= LARGEST_BYTES);
        if let (true, Ok(text)) = (is_text_sized, std::fs::read_to_string(&path)) {
            offences.extend(local_paths(file, &text));
        }
    }
    match offences.is_empty() {
        true => Ok(format!("no local path in the {} files that {how}", files.len())),
        false => Err(offences.join("\n")),
    }
}

/// Lists the repository's files, relative to `root`, and says where the list comes from.
pub fn files(root: &Path) -> (Vec<PathBuf>, &'static str) {
    match tracked_files(root) {
        Some(files) => (files, "git lists"),
        // An unpacked archive, or a machine without git.
        None => (walked_files(root), "are here (without git, so ignored ones are among them)"),
    }
}

/// Finds the lines of `text` that name a local path. Returns them as `file:line: ...`.
fn local_paths(file: &Path, text: &str) -> Vec<String> {
    let mut in_tests = file.components().any(|part| part.as_os_str() == "tests");
    let mut offences = Vec::new();
    for (index, line) in text.lines().enumerate() {
        in_tests |= line.trim_start().starts_with("#[cfg(test)]");
        let temporary = (!in_tests).then_some(TEMPORARY);
        for word in LOCAL.into_iter().chain(temporary) {
            if names_path(line, word) {
                let place = format!("{}:{}", file.display(), index + 1);
                offences
                    .push(format!("{place}: '{word}...' is a folder of one machine; use a relative path or an option"));
            }
        }
    }
    offences
}

/// Returns whether `word` starts a path in `line`, rather than going on from one, as in an address or a relative path.
fn names_path(line: &str, word: &str) -> bool {
    line.match_indices(word).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        before.is_none_or(|c| !c.is_alphanumeric() && !"_.-~}/".contains(c))
    })
}

/// Returns the files that git tracks, and new ones that it does not ignore. Returns `None` without git or outside a
/// checkout.
fn tracked_files(root: &Path) -> Option<Vec<PathBuf>> {
    let arguments = ["ls-files", "-z", "--cached", "--others", "--exclude-standard"];
    let list = shell::answer_of(Command::new("git").args(arguments).current_dir(root))?;
    let mut files: Vec<PathBuf> = list.split('\0').filter(|name| !name.is_empty()).map(PathBuf::from).collect();
    files.dedup();
    (!files.is_empty()).then_some(files)
}

/// Returns all files below `root`, relative to it, without build outputs and git's own folder.
fn walked_files(root: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![PathBuf::new()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(root.join(&folder)).into_iter().flatten().flatten() {
            let path = folder.join(entry.file_name());
            match entry.file_type() {
                Ok(kind) if kind.is_dir() && ![Path::new("target"), Path::new(".git")].contains(&path.as_path()) => {
                    folders.push(path);
                }
                Ok(kind) if kind.is_file() => files.push(path),
                _ => {}
            }
        }
    }
    files.sort();
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offences(file: &str, text: &str) -> usize {
        local_paths(Path::new(file), text).len()
    }

    #[test]
    fn a_planted_local_path_is_found_in_every_file_and_also_in_tests() {
        for word in LOCAL {
            for file in ["README.md", "fit/src/pipeline.rs", "tests/src/bytes.rs"] {
                assert_eq!(offences(file, &format!("cd {word}project")), 1, "{word} in {file}");
                assert_eq!(offences(file, &format!("(\"{word}project\")")), 1, "{word} in {file}");
            }
        }
    }

    #[test]
    fn the_temporary_folder_is_for_tests_only() {
        let line = format!("let path = \"{TEMPORARY}a\";");
        assert_eq!(offences("fit/src/pipeline.rs", &line), 1);
        assert_eq!(offences("docs/README.md", &line), 1);
        assert_eq!(offences("tests/src/bytes.rs", &line), 0);
        assert_eq!(offences("fit/src/pipeline.rs", &format!("#[cfg(test)]\nmod tests {{ {line} }}")), 0);
    }

    #[test]
    fn addresses_and_relative_paths_pass() {
        for word in LOCAL.iter().filter(|word| word.starts_with('/')) {
            assert_eq!(
                offences("README.md", &format!("https://example.org{word}page and ..{word}page and our{word}page")),
                0
            );
        }
    }

    #[test]
    fn both_ways_of_listing_files_find_this_one() {
        let this = Path::new("xtask/src/checks/words.rs");
        assert!(walked_files(&shell::root()).iter().any(|file| file == this));
        if let Some(files) = tracked_files(&shell::root()) {
            assert!(files.iter().any(|file| file == this));
        }
    }
}

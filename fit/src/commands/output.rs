//! Writing results: checks before the work, whole files after it, text that survives a closed pipe.

use super::failure::Failure;
use btf_capture::{AtomicFile, write_file_atomically};
use btf_fit::{output_fault, real_path};
use serde::Serialize;
use std::io::{Write, stderr, stdout};
use std::path::{Path, PathBuf};

/// Tells whether `--json` writes to standard output: its target is `-`.
pub(super) fn is_stdout(target: &Path) -> bool {
    target == Path::new("-")
}

/// Writes `result` where `--json` says, and `text` for people to standard output, unless that is quiet or taken.
pub(super) fn tell<T: Serialize>(
    json: Option<&Path>,
    quiet: bool,
    result: &T,
    text: impl FnOnce() -> String,
) -> Result<(), Failure> {
    if let Some(target) = json {
        write_json(target, result)?;
    }
    if !quiet && !json.is_some_and(is_stdout) {
        say(&text());
    }
    Ok(())
}

/// Checks, before hours of work, that `path` can become a file: its folder takes a new file, it is no
/// folder itself, and it neither is nor lies in one of `inputs`.
pub(super) fn check_file(path: &Path, inputs: &[PathBuf]) -> Result<(), Failure> {
    if is_stdout(path) {
        return Ok(());
    }
    if let Some(sentence) = output_fault(path, inputs) {
        return Err(Failure::Path(sentence));
    }
    // The temporary file goes with the drop.
    drop(AtomicFile::create(path)?);
    Ok(())
}

/// Checks that no two of `paths` are the same file.
pub(super) fn check_distinct(paths: &[&Path]) -> Result<(), Failure> {
    for (i, path) in paths.iter().enumerate().filter(|(_, path)| !is_stdout(path)) {
        if paths[..i].iter().any(|other| real_path(other) == real_path(path)) {
            return Err(Failure::Usage(format!(
                "{} is named for two outputs; give each of them its own name",
                path.display()
            )));
        }
    }
    Ok(())
}

/// Writes `whole` to `out` and files that it names beside it, it last; returns their paths. Nothing is written unless all can be,
/// and each is another file than `json` and the inputs.
pub(super) fn write_with_files_beside(
    out: &Path,
    whole: &[u8],
    beside: &[(String, Vec<u8>)],
    json: Option<&Path>,
    inputs: &[PathBuf],
) -> Result<Vec<PathBuf>, Failure> {
    let folder = out.parent().unwrap_or(Path::new(""));
    let paths: Vec<PathBuf> = beside.iter().map(|(name, _)| folder.join(name)).collect();
    for path in &paths {
        check_file(path, inputs)?;
    }
    let outputs: Vec<&Path> = paths.iter().map(PathBuf::as_path).chain(json).chain([out]).collect();
    check_distinct(&outputs)?;
    for (path, (_, bytes)) in paths.iter().zip(beside) {
        write_file_atomically(path, bytes)?;
    }
    write_file_atomically(out, whole)?;
    Ok(paths)
}

/// Writes `value` as JSON to `target` (`-` is standard output).
pub(super) fn write_json(target: &Path, value: &impl Serialize) -> Result<(), Failure> {
    // Numbers and strings under string keys: serialising cannot fail.
    let text = serde_json::to_string_pretty(value).unwrap_or_default() + "\n";
    if is_stdout(target) {
        say(text.trim_end());
        return Ok(());
    }
    Ok(write_file_atomically(target, text.as_bytes())?)
}

/// Prints a line. A reader that has gone away (`| head`) is no error.
pub(super) fn say(text: &str) {
    let _ = writeln!(stdout(), "{text}");
}

/// Prints a line to stderr.
pub(super) fn complain(text: &str) {
    let _ = writeln!(stderr(), "{text}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_that_cannot_be_written_are_refused_before_the_work() {
        let folder = tempfile::tempdir().unwrap();
        let capture = folder.path().join("capture");
        std::fs::create_dir_all(capture.join("tv000_pv000")).unwrap();
        let zip = folder.path().join("capture.zip");
        std::fs::write(&zip, b"x").unwrap();
        let inputs = [capture.clone(), zip.clone()];
        let refused = |path: PathBuf| check_file(&path, &inputs).unwrap_err().to_string();
        assert!(refused(folder.path().to_path_buf()).contains("is a folder"));
        assert!(refused(folder.path().join("no/such/a.spmm")).contains("could not be written"));
        assert!(refused(capture.join("a.spmm")).contains("lies in the input folder"));
        assert!(refused(capture.join("tv000_pv000/../tv000_pv000/a.spmm")).contains("lies in the input folder"));
        assert!(refused(zip).contains("is an input"));
        check_file(&folder.path().join("capture.spmm"), &inputs).unwrap();
        check_file(Path::new("-"), &inputs).unwrap();
        let names: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(names.len(), 2, "the check leaves nothing behind: {names:?}");
    }

    #[test]
    fn two_outputs_of_one_name_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a"), folder.path().join("b"));
        check_distinct(&[&a, &b, Path::new("-"), Path::new("-")]).unwrap();
        assert!(check_distinct(&[&a, &b, &folder.path().join("./a")]).is_err());
    }

    #[test]
    fn json_is_written_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        write_json(&path, &[1.5, 2.0]).unwrap();
        let read: Vec<f64> = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        assert_eq!(read, [1.5, 2.0]);
    }
}

//! `cargo xtask gpu-report`: the results of `btf-view bench gpu` as a page of the documents.

use crate::arguments::asks_for_help;
use crate::failure::Failure;
use crate::gpu_page::page;
use crate::gpu_results::is_of_a_gpu;
use crate::shell::{answer_of, root};
use std::path::{Path, PathBuf};
use std::process::Command;

const HELP: &str = "\
Writes what `btf-view bench gpu -o DIR` measured as the page gpu.md of docs/results: adapter, goals with what was measured
beside them, and a table for each step. What was not run says so.

Usage: cargo xtask gpu-report DIR [--out FILE.md]

  --out FILE.md   another page; also for a software driver or a quick run, whose figures docs/results is not for

Example: btf-view bench gpu cloth.spmm -o gpu-run && cargo xtask gpu-report gpu-run";

/// Folder of the page, below the repository's root, and its name.
const PAGE: [&str; 2] = ["docs/results", "gpu.md"];

/// Writes the page.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if asks_for_help(arguments) {
        println!("{HELP}");
        return Ok(());
    }
    let (folder, out) = parse(arguments)?;
    let file = folder.join("gpu.json");
    let failed = |reason: String| Failure::new(format!("{}: {reason}", file.display()));
    let text = std::fs::read_to_string(&file)
        .map_err(|error| failed(format!("{error}; write it with `btf-view bench gpu -o {}`", folder.display())))?;
    let results: serde_json::Value = serde_json::from_str(&text).map_err(|error| failed(error.to_string()))?;
    if out.is_none() && !is_of_a_gpu(&results) {
        return Err(failed("these are no figures of a GPU, write them to a page of your own with --out".into()));
    }
    let head = answer_of(Command::new("git").args(["rev-parse", "--short=7", "HEAD"]).current_dir(root()));
    let page = page(&results, head.as_deref().map(str::trim)).map_err(failed)?;
    let out = out.unwrap_or_else(|| root().join(PAGE[0]).join(PAGE[1]));
    write(&out, &page)?;
    println!("{}", out.display());
    if out.ends_with(Path::new(PAGE[0]).join(PAGE[1])) {
        println!("a new page needs its line in docs/SUMMARY.md");
    }
    Ok(())
}

/// Returns the folder of the results, and the page where another one is asked for.
fn parse(arguments: &[String]) -> Result<(PathBuf, Option<PathBuf>), Failure> {
    let (mut folder, mut out) = (None, None);
    let mut rest = arguments.iter();
    while let Some(argument) = rest.next() {
        match argument.as_str() {
            "--out" => {
                let value = rest.next().ok_or_else(|| Failure::usage(format!("`--out` needs a value\n\n{HELP}")))?;
                out = Some(PathBuf::from(value));
            }
            option if option.starts_with('-') => {
                return Err(Failure::usage(format!("`gpu-report` has no option '{option}'\n\n{HELP}")));
            }
            path if folder.is_none() => folder = Some(PathBuf::from(path)),
            more => return Err(Failure::usage(format!("`gpu-report` takes one folder, and '{more}' is another"))),
        }
    }
    let folder = folder.ok_or_else(|| Failure::usage(format!("a folder is missing\n\n{HELP}")))?;
    Ok((folder, out))
}

/// Writes beside the page and renames, so that no half page is left.
fn write(path: &Path, page: &str) -> Result<(), Failure> {
    let beside = path.with_extension("md.tmp");
    std::fs::write(&beside, page)
        .and_then(|()| std::fs::rename(&beside, path))
        .map_err(|error| Failure::new(format!("{}: {error}", path.display())))
}

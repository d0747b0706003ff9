//! `cargo xtask book`: the documents as a site, by mdBook.

use crate::arguments::asks_for_help;
use crate::checks::links;
use crate::failure::Failure;
use crate::metadata::Metadata;
use crate::shell::{answer_of, cargo, root, run_checked};
use std::path::Path;
use std::process::Command;

const HELP: &str = "\
Makes a site of the documents in docs/ with mdBook, which is installed from the crate registry into the target folder.
Stops at a dead link. The first run builds mdBook, which takes some minutes. The first page is target/book/index.html.

Usage: cargo xtask book

Example: cargo xtask book";

/// The version that makes the site; its major version decides what docs/book.toml may say.
const MDBOOK_VERSION: &str = "0.5.4";

/// The chore.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if asks_for_help(arguments) {
        println!("{HELP}");
        return Ok(());
    }
    if !arguments.is_empty() {
        return Err(Failure::usage(format!("`book` does not know '{}'\n\n{HELP}", arguments.join(" "))));
    }
    println!("{}", links::check(&root()).map_err(Failure::new)?);
    let target = Metadata::read()?.target_directory;
    let tools = target.join("book-tools");
    let program = tools.join("bin").join(format!("mdbook{}", std::env::consts::EXE_SUFFIX));
    if !is_installed(&program) {
        println!("mdBook {MDBOOK_VERSION} is built once, in {}", tools.display());
        let mut install = cargo(&["install", "mdbook", "--version", MDBOOK_VERSION, "--locked", "--force"]);
        // Without the web server and the file watcher, which are most of what it is built from.
        install.args(["--no-default-features", "--features", "search", "--root"]).arg(&tools);
        run_checked(&mut install)?;
    }
    let out = target.join("book");
    run_checked(Command::new(&program).arg("build").arg(root().join("docs")).arg("--dest-dir").arg(&out))?;
    println!("{}", out.join("index.html").display());
    Ok(())
}

/// Returns whether `program` is the mdBook that makes the site.
fn is_installed(program: &Path) -> bool {
    answer_of(Command::new(program).arg("--version"))
        .is_some_and(|version| version.trim().trim_start_matches("mdbook v") == MDBOOK_VERSION)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_program_is_not_taken_for_the_one_that_makes_the_site() {
        assert!(!is_installed(Path::new("btf-no-such-program")));
        assert!(!is_installed(Path::new(cargo(&[]).get_program())));
    }
}

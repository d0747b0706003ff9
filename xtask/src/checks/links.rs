//! Every link of the documents leads somewhere, every page stands in the book, and every file that a page or a source
//! names exists.

use crate::checks::words;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

/// The folder of the documents.
const DOCUMENTS: &str = "docs";
/// The list of the book's pages, in the folder of the documents.
const SUMMARY: &str = "SUMMARY.md";
/// Ends of the names of files that may name a document.
const NAMING: [&str; 10] = ["md", "rs", "wgsl", "py", "toml", "c", "h", "js", "json", "yml"];
/// Folders of the packages: a span of code that begins with one names a path.
const FOLDERS: [&str; 8] = ["capture", "datasets-synth", "fit", "models", "runtime", "tests", "viewer", "xtask"];
/// Beginnings of links that lead out of the repository; nothing is asked of a network.
const ELSEWHERE: [&str; 3] = ["http://", "https://", "mailto:"];

/// Checks all files of the repository. `Ok` holds one line that says what was read; `Err` every offence, one a line.
pub fn check(root: &Path) -> Result<String, String> {
    let (files, _) = words::files(root);
    let mut texts = BTreeMap::new();
    for file in files {
        let naming = file.extension().and_then(|end| end.to_str()).is_some_and(|end| NAMING.contains(&end));
        if let (true, Ok(text)) = (naming, std::fs::read_to_string(root.join(&file))) {
            texts.insert(file, text);
        }
    }
    let exists = |path: &Path| root.join(path).exists();
    let (links, offences) = offences(&texts, &exists);
    match offences.is_empty() {
        true => Ok(format!("{links} links and names of documents lead somewhere")),
        false => Err(offences.join("\n")),
    }
}

/// Counts the links of `texts` and lists what is wrong with them. `exists` tells of any path of the repository.
fn offences(texts: &BTreeMap<PathBuf, String>, exists: &dyn Fn(&Path) -> bool) -> (usize, Vec<String>) {
    let anchors: BTreeMap<&Path, BTreeSet<String>> =
        texts.iter().filter(|(file, _)| is_page(file)).map(|(file, text)| (file.as_path(), anchors_of(text))).collect();
    let (mut count, mut offences) = (0, Vec::new());
    for (file, text) in texts {
        if is_page(file) {
            for (line, link) in links_of(text) {
                count += 1;
                if let Some(reason) = fault_of(file, &link, &anchors, exists) {
                    offences.push(format!("{}:{line}: {link} {reason}", file.display()));
                }
            }
        }
        let spans = if is_page(file) { paths_in_spans(text) } else { Vec::new() };
        for (line, name) in documents_named(text).into_iter().chain(spans) {
            count += 1;
            if !exists(Path::new(&name)) {
                offences.push(format!("{}:{line}: there is no {name}", file.display()));
            }
        }
    }
    offences.extend(missing_pages(texts));
    (count, offences)
}

fn is_page(file: &Path) -> bool {
    file.extension().is_some_and(|end| end == "md")
}

/// Says what is wrong with a link of `file`, if anything is.
fn fault_of(
    file: &Path,
    link: &str,
    anchors: &BTreeMap<&Path, BTreeSet<String>>,
    exists: &dyn Fn(&Path) -> bool,
) -> Option<&'static str> {
    if ELSEWHERE.iter().any(|beginning| link.starts_with(beginning)) {
        return None;
    }
    let (path, anchor) = link.split_once('#').map_or((link, None), |(path, anchor)| (path, Some(anchor)));
    let folder = file.parent().unwrap_or(Path::new(""));
    let goal = if path.is_empty() { Some(file.to_path_buf()) } else { joined(folder, path) };
    let Some(goal) = goal else { return Some("leads out of the repository") };
    if !exists(&goal) {
        return Some("leads nowhere");
    }
    if file.starts_with(DOCUMENTS) && !goal.starts_with(DOCUMENTS) {
        return Some("leads out of docs, where the book has nothing: name the path in backticks");
    }
    let known = anchors.get(goal.as_path());
    match (anchor, known) {
        (Some(anchor), Some(known)) if !known.contains(anchor) => Some("names a heading that is not there"),
        _ => None,
    }
}

/// `folder`/`path` without `..`; `None` where it leaves the repository.
fn joined(folder: &Path, path: &str) -> Option<PathBuf> {
    let mut whole = PathBuf::new();
    for part in folder.join(path).components() {
        match part {
            Component::ParentDir if !whole.pop() => return None,
            Component::ParentDir | Component::CurDir => {}
            Component::Normal(name) => whole.push(name),
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(whole)
}

/// Pages of the documents that the summary does not list, or lists twice.
fn missing_pages(texts: &BTreeMap<PathBuf, String>) -> Vec<String> {
    let folder = Path::new(DOCUMENTS);
    let summary = folder.join(SUMMARY);
    let pages: Vec<&PathBuf> =
        texts.keys().filter(|file| is_page(file) && file.starts_with(folder) && **file != summary).collect();
    let Some(text) = texts.get(&summary) else {
        let fault = format!("{} is missing, and lists the pages of the book", summary.display());
        return if pages.is_empty() { Vec::new() } else { vec![fault] };
    };
    let listed: Vec<PathBuf> = links_of(text).into_iter().filter_map(|(_, link)| joined(folder, &link)).collect();
    let times = |page: &PathBuf| listed.iter().filter(|listed| *listed == page).count();
    pages
        .into_iter()
        .filter(|page| times(page) != 1)
        .map(|page| format!("{} stands {} times in {}, not once", page.display(), times(page), summary.display()))
        .collect()
}

/// The lines of a page that are text, with their numbers, from 1: blocks of code are left out, spans of code are blanked.
fn text_lines(text: &str) -> Vec<(usize, String)> {
    let mut lines = Vec::new();
    let mut is_code = false;
    for (number, line) in text.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            is_code = !is_code;
        } else if !is_code {
            let spans = line.split('`').enumerate();
            let kept: Vec<&str> = spans.map(|(i, span)| if i % 2 == 0 { span } else { " " }).collect();
            lines.push((number + 1, kept.join("`")));
        }
    }
    lines
}

/// The goals of `[text](goal)` and `![text](goal)`, and of `[name]: goal` at a line's start, with the numbers of their lines.
fn links_of(text: &str) -> Vec<(usize, String)> {
    let mut links = Vec::new();
    for (number, line) in text_lines(text) {
        for part in line.split("](").skip(1) {
            let goal = part.split([')', ' ']).next().unwrap_or_default();
            links.push((number, goal.trim_matches(['<', '>']).to_string()));
        }
        let definition = line.strip_prefix('[').and_then(|rest| rest.split_once("]: "));
        let goal = definition.map(|(_, goal)| goal.trim()).filter(|goal| !goal.contains(' '));
        links.extend(goal.map(|goal| (number, goal.to_string())));
    }
    links
}

/// Returns the names that a link can have in a page: its headings, as GitHub and mdBook write them.
fn anchors_of(text: &str) -> BTreeSet<String> {
    let mut anchors = BTreeSet::new();
    let mut is_code = false;
    for line in text.lines() {
        is_code ^= line.trim_start().starts_with("```");
        let heading = line.trim_start_matches('#');
        if is_code || heading.len() == line.len() || !heading.starts_with(' ') {
            continue;
        }
        let name: String = heading
            .trim()
            .to_lowercase()
            .chars()
            .filter(|c| c.is_alphanumeric() || " _-".contains(*c))
            .map(|c| if c == ' ' { '-' } else { c })
            .collect();
        let again = (0..).map(|n| if n == 0 { name.clone() } else { format!("{name}-{n}") });
        anchors.extend(again.into_iter().find(|name| !anchors.contains(name)));
    }
    anchors
}

/// Paths below the folder of the documents that a text names from the repository's root, with the numbers of their lines.
fn documents_named(text: &str) -> Vec<(usize, String)> {
    let folder = format!("{DOCUMENTS}/");
    let mut names = Vec::new();
    for (number, line) in text.lines().enumerate() {
        for (at, _) in line.match_indices(&folder) {
            let before = &line[..at];
            let is_root =
                before.ends_with("../") || !before.ends_with(|c: char| c.is_alphanumeric() || "/_-.".contains(c));
            let name = line[at..].split(|c: char| !c.is_alphanumeric() && !"/_-.".contains(c)).next();
            let name = name.unwrap_or_default().trim_end_matches('.');
            if is_root && name.len() > folder.len() {
                names.push((number + 1, name.to_string()));
            }
        }
    }
    names
}

/// Paths that a page names in spans of code, from the repository's root, with the numbers of their lines.
fn paths_in_spans(text: &str) -> Vec<(usize, String)> {
    let is_path = |span: &str| {
        let of_path = |c: char| c.is_alphanumeric() || "/_-.".contains(c);
        span.split_once('/').is_some_and(|(folder, _)| FOLDERS.contains(&folder)) && span.chars().all(of_path)
    };
    let mut is_code = false;
    let mut names = Vec::new();
    for (number, line) in text.lines().enumerate() {
        is_code ^= line.trim_start().starts_with("```");
        let spans = line.split('`').skip(1).step_by(2).filter(|span| !is_code && is_path(span));
        names.extend(spans.map(|span| (number + 1, span.to_string())));
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A page as a source would name it; in two halves, so that this file passes its own check.
    const MISSING: &str = concat!("do", "cs/missing.md");

    fn found(files: &[(&str, &str)]) -> Vec<String> {
        let texts: BTreeMap<PathBuf, String> =
            files.iter().map(|(name, text)| (PathBuf::from(name), text.to_string())).collect();
        let folders: Vec<&Path> = texts.keys().flat_map(|file| file.ancestors()).collect();
        offences(&texts, &|path| folders.contains(&path) || path == Path::new("docs/results/models.png")).1
    }

    const SUMMARY_OF_ONE: (&str, &str) = ("docs/SUMMARY.md", "- [A](README.md)\n");

    #[test]
    fn good_links_pass() {
        let page = "# One thing\n## Two: `x`, done\n## One thing\n[b](#one-thing-1) ![p](results/models.png) [u](https://example.org/x)\n\
                    [c](#two-x-done) `[no](link.md)`\n```\n[no](link.md)\n# no heading\n```\n[d](../docs/README.md#one-thing)\n";
        let readme =
            "[a](docs/README.md#one-thing) and [a](<docs/README.md>), [folder](docs)\n\n[named]: docs/README.md\n";
        assert_eq!(found(&[SUMMARY_OF_ONE, ("docs/README.md", page), ("CHANGELOG.md", readme)]), Vec::<String>::new());
    }

    #[test]
    fn a_planted_dead_link_picture_anchor_or_definition_is_found() {
        for link in
            ["[a](b.md)", "![a](b.png)", "[a](#nothing)", "[a](README.md#nothing)", "[a]: b.md", "[a](../../x.md)"]
        {
            let text = format!("# A\n{link}\n");
            let offences = found(&[SUMMARY_OF_ONE, ("docs/README.md", &text)]);
            assert_eq!(offences.len(), 1, "{link}: {offences:?}");
            assert!(offences[0].starts_with("docs/README.md:2: "), "{offences:?}");
        }
    }

    #[test]
    fn a_heading_within_code_is_no_goal() {
        assert_eq!(found(&[("README.md", "```\n# no\n```\n[a](#no)\n")]).len(), 1);
    }

    #[test]
    fn a_page_that_the_book_lacks_or_has_twice_is_found() {
        let page = ("docs/README.md", "# A\n");
        assert_eq!(found(&[page]).len(), 1);
        assert_eq!(found(&[("docs/SUMMARY.md", ""), page]).len(), 1);
        assert_eq!(found(&[("docs/SUMMARY.md", "[A](README.md)\n[A](README.md)\n"), page]).len(), 1);
    }

    #[test]
    fn a_page_of_the_book_may_not_link_out_of_it() {
        let offences = found(&[SUMMARY_OF_ONE, ("docs/README.md", "[r](../README.md)\n"), ("README.md", "# R\n")]);
        assert!(offences.len() == 1 && offences[0].contains("out of docs"), "{offences:?}");
    }

    #[test]
    fn a_path_in_a_span_of_code_must_exist_from_the_root() {
        assert_eq!(
            found(&[("README.md", "`fit/a.rs` and `fit/b.rs x` and `light/c.rs`\n"), ("fit/a.rs", "")]).len(),
            0
        );
        assert_eq!(found(&[("README.md", "# R\n`fit/b.rs`\n")]), ["README.md:2: there is no fit/b.rs"]);
        assert_eq!(found(&[("README.md", "```\n`fit/b.rs`\n```\n")]).len(), 0);
    }

    #[test]
    fn a_document_that_a_source_names_must_exist() {
        let source = |name: &str| format!("//! See {name}.\n");
        assert_eq!(
            found(&[SUMMARY_OF_ONE, ("docs/README.md", "# A\n"), ("fit/a.rs", &source("docs/README.md"))]).len(),
            0
        );
        assert_eq!(found(&[("fit/a.rs", &source(MISSING))]).len(), 1);
        assert_eq!(found(&[("fit/a.rs", &source(&format!("../../{MISSING}")))]).len(), 1);
        assert_eq!(found(&[("fit/a.rs", &source(&format!("https://example.org/{MISSING}")))]).len(), 0);
    }
}

//! Checks which package uses which against docs/ARCHITECTURE.md, and the crates that the runtime must not use.

use crate::metadata::Metadata;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Our packages and those of ours that each may use. What is not here is forbidden, in tests too.
const ALLOWED: [(&str, &[&str]); 15] = [
    ("btf-capture", &[]),
    ("btf-leaf-quantities", &[]),
    ("btf-models", &["btf-capture", "btf-leaf-quantities"]),
    ("btf-synth", &["btf-capture", "btf-models"]),
    ("btf-runtime", &["btf-leaf-quantities"]),
    ("btf-runtime-c", &["btf-runtime"]),
    ("btf-shaders", &["btf-runtime"]),
    ("btf-textures", &[]),
    ("btf-voxelize", &["btf-capture", "btf-models", "btf-runtime"]),
    ("btf-fit", &["btf-capture", "btf-models", "btf-runtime", "btf-voxelize"]),
    ("btf-python", &["btf-capture", "btf-fit", "btf-runtime", "btf-synth"]),
    ("btf-viewer", &["btf-capture", "btf-models", "btf-runtime"]),
    ("btf-viewer-web", &["btf-capture", "btf-models", "btf-runtime", "btf-viewer"]),
    (
        "btf-tests",
        &[
            "btf-capture",
            "btf-fit",
            "btf-models",
            "btf-runtime",
            "btf-synth",
            "btf-textures",
            "btf-viewer",
            "btf-voxelize",
        ],
    ),
    ("xtask", &[]),
];

/// Name of the package that reads bytes and returns numbers, and does nothing else.
const RUNTIME: &str = "btf-runtime";

/// Crates (and families, `name-*`) that would bring the runtime a GPU, an image codec, threads, files or a window.
const RUNTIME_FORBIDS: [&str; 33] = [
    // GPU and windows.
    "wgpu",
    "wgpu-*",
    "naga",
    "ash",
    "metal",
    "vulkano",
    "winit",
    "egui",
    "egui-*",
    // Image codecs.
    "image",
    "image-*",
    "exr",
    "png",
    "jpeg-*",
    "zune-*",
    "gif",
    "tiff",
    "ktx2",
    // Threads.
    "rayon",
    "rayon-*",
    "crossbeam",
    "crossbeam-*",
    "threadpool",
    "tokio",
    "async-*",
    // Files and the operating system.
    "memmap2",
    "tempfile",
    "walkdir",
    "zip",
    "rustix",
    "fs-err",
    "gltf",
    "tobj",
];

/// Modules of the standard library that the runtime's sources may not name, for the same reason.
const RUNTIME_FORBIDS_IN_STD: [&str; 5] = ["fs", "thread", "net", "env", "process"];

/// Checks all three kinds of arrow. `Ok` holds one line that says what was found; `Err` every offence, one a line.
pub fn check(metadata: &Metadata, root: &Path) -> Result<String, String> {
    let declared = arrows_of(metadata);
    let linked = metadata.linked_with(RUNTIME);
    let mut offences = forbidden_arrows(&declared);
    offences.extend(forbidden_crates(&linked));
    let sources = rust_files(&root.join("runtime/src"));
    if sources.is_empty() {
        offences.push("runtime/src holds no Rust file, so its sources were not checked".to_string());
    }
    for path in &sources {
        let text =
            std::fs::read_to_string(path).map_err(|error| format!("{} is not readable: {error}", path.display()))?;
        let name = path.strip_prefix(root).unwrap_or(path).display().to_string();
        offences.extend(forbidden_words(&name, &text));
    }
    if !offences.is_empty() {
        return Err(offences.join("\n"));
    }
    let count = declared.iter().map(|(_, uses)| uses.len()).sum::<usize>();
    Ok(format!(
        "{} packages, {count} arrows between them; the runtime links {} crates, none of them forbidden",
        declared.len(),
        linked.len()
    ))
}

/// Returns each of our packages with those of ours that it declares, for normal use, tests and build scripts alike.
fn arrows_of(metadata: &Metadata) -> Vec<(&str, BTreeSet<&str>)> {
    let ours = metadata.packages.iter().filter(|package| package.source.is_none());
    ours.map(|package| {
        let uses = package.dependencies.iter().filter(|dependency| dependency.path.is_some());
        (package.name.as_str(), uses.map(|dependency| dependency.name.as_str()).collect())
    })
    .collect()
}

fn forbidden_arrows(declared: &[(&str, BTreeSet<&str>)]) -> Vec<String> {
    let mut offences = Vec::new();
    for (package, uses) in declared {
        let Some((_, allowed)) = ALLOWED.iter().find(|(name, _)| name == package) else {
            offences.push(format!(
                "{package} is no package of xtask/src/checks/arrows.rs: add it there and to docs/ARCHITECTURE.md"
            ));
            continue;
        };
        for other in uses.iter().filter(|other| !allowed.contains(other)) {
            offences.push(format!("{package} uses {other}, and docs/ARCHITECTURE.md has no such arrow"));
        }
    }
    offences
}

fn forbidden_crates(linked: &BTreeSet<&str>) -> Vec<String> {
    let forbids = |name: &str| {
        RUNTIME_FORBIDS.iter().any(|pattern| match pattern.strip_suffix('*') {
            Some(family) => name.starts_with(family),
            None => *pattern == name,
        })
    };
    let bad = linked.iter().filter(|name| forbids(name));
    bad.map(|name| format!("{RUNTIME} links {name}; the runtime has no GPU, image codec, thread or file crate"))
        .collect()
}

/// Finds the lines of a source file that name a forbidden module. Comments and the test module at the end are left out.
fn forbidden_words(name: &str, text: &str) -> Vec<String> {
    let mut offences = Vec::new();
    for (index, line) in text.lines().enumerate() {
        if line.trim_start().starts_with("#[cfg(test)]") {
            break;
        }
        let code = line.split("//").next().unwrap_or_default();
        for module in RUNTIME_FORBIDS_IN_STD {
            if names_std_module(code, module) {
                offences
                    .push(format!("{name}:{}: std::{module} is not for the runtime: bytes in, numbers out", index + 1));
            }
        }
    }
    offences
}

/// Returns whether a line has `std::module` or `std::{.., module, ..}`.
fn names_std_module(code: &str, module: &str) -> bool {
    code.match_indices("std::").any(|(at, found)| {
        let rest = &code[at + found.len()..];
        match rest.strip_prefix('{') {
            None => words_of(rest).next() == Some(module),
            // The first word of each member of the group; nested groups are further members, which is on the strict
            // side.
            Some(group) => {
                group.split(['{', ',', '}']).any(|member| words_of(member.trim_start()).next() == Some(module))
            }
        }
    })
}

fn words_of(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_alphanumeric() && c != '_')
}

/// Returns all `.rs` files below a folder, sorted.
fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files.sort();
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes up an answer of `cargo metadata`: a package of ours with its arrows, and what the runtime resolves to.
    fn metadata(package: &str, uses: &[&str], runtime_links: &str, kind: Option<&str>) -> Metadata {
        let dependencies: Vec<_> =
            uses.iter().map(|name| serde_json::json!({ "name": name, "path": format!("../{name}") })).collect();
        let ours = |name: &str, dependencies| serde_json::json!({ "name": name, "version": "0.1.0", "id": name, "dependencies": dependencies });
        let mut packages = vec![ours(package, serde_json::json!(dependencies))];
        if package != RUNTIME {
            packages.push(ours(RUNTIME, serde_json::json!([])));
        }
        packages.push(serde_json::json!({ "name": "middle", "version": "1.0.0", "id": "m", "source": "registry", "dependencies": [] }));
        packages.push(serde_json::json!({ "name": runtime_links, "version": "1.0.0", "id": "x", "source": "registry", "dependencies": [] }));
        serde_json::from_value(serde_json::json!({
            "packages": packages,
            "target_directory": "target",
            "resolve": { "nodes": [
                { "id": RUNTIME, "deps": [{ "pkg": "m", "dep_kinds": [{ "kind": null }] }] },
                { "id": "m", "deps": [{ "pkg": "x", "dep_kinds": [{ "kind": kind }] }] },
            ] },
        }))
        .unwrap()
    }

    fn offences(package: &str, uses: &[&str]) -> Vec<String> {
        forbidden_arrows(&arrows_of(&metadata(package, uses, "half", None)))
    }

    #[test]
    fn the_arrows_of_the_plan_pass() {
        assert_eq!(offences("btf-fit", &["btf-capture", "btf-runtime"]), [""; 0]);
        assert_eq!(offences("btf-synth", &["btf-capture"]), [""; 0]);
        assert_eq!(
            offences("btf-tests", &["btf-fit", "btf-viewer", "btf-synth", "btf-capture", "btf-runtime"]),
            [""; 0]
        );
    }

    #[test]
    fn a_planted_arrow_is_found_and_both_ends_named() {
        for (package, other) in [
            ("btf-synth", "btf-runtime"),
            ("btf-synth", "btf-fit"),
            ("btf-viewer", "btf-fit"),
            ("btf-fit", "btf-viewer"),
            ("btf-runtime", "btf-capture"),
            ("btf-capture", "btf-runtime"),
            ("btf-fit", "btf-synth"),
            ("btf-viewer", "btf-tests"),
        ] {
            let found = offences(package, &["btf-capture", other]).into_iter().find(|text| text.contains(other));
            assert!(found.is_some_and(|text| text.starts_with(package)), "{package} -> {other} passed");
        }
    }

    #[test]
    fn a_package_that_the_plan_does_not_know_is_found() {
        assert!(offences("btf-cloud", &[]).iter().any(|text| text.contains("btf-cloud")));
    }

    #[test]
    fn a_crate_that_the_runtime_must_not_link_is_found_behind_another_one() {
        for name in ["rayon", "rayon-core", "wgpu-types", "image", "memmap2", "zune-jpeg"] {
            let offences = forbidden_crates(&metadata(RUNTIME, &[], name, None).linked_with(RUNTIME));
            assert!(offences.len() == 1 && offences[0].contains(name), "{name}: {offences:?}");
        }
        assert_eq!(forbidden_crates(&metadata(RUNTIME, &[], "half", None).linked_with(RUNTIME)), [""; 0]);
        // What only a build script or a test of a dependency uses is not linked.
        assert_eq!(forbidden_crates(&metadata(RUNTIME, &[], "rayon", Some("dev")).linked_with(RUNTIME)), [""; 0]);
    }

    #[test]
    fn forbidden_modules_are_found_in_every_spelling() {
        for line in [
            "use std::fs::File;",
            "let x = std::env::var(\"X\");",
            "use std::{collections::HashMap, thread};",
            "use std::{fmt, net::{TcpStream}};",
            "    std::process::exit(1);",
        ] {
            assert_eq!(forbidden_words("a.rs", line).len(), 1, "{line}");
        }
    }

    #[test]
    fn harmless_lines_pass() {
        for line in [
            "use std::fmt;",
            "// std::fs is not for us",
            "let path = env!(\"CARGO_MANIFEST_DIR\");",
            "use std::{collections::HashMap, fmt};",
            "fn std_fs() {}",
            "#[cfg(test)]\nmod tests { use std::fs; }",
        ] {
            assert_eq!(forbidden_words("a.rs", line), [""; 0], "{line}");
        }
    }
}

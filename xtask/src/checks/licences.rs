//! The licences of everything that we build on, on every platform: each must be one that we may ship.

use crate::checks::spdx;
use crate::metadata::{Metadata, Package};

/// Licences that ask for no more than naming the authors, so that MIT OR Apache-2.0 can stand over the whole.
///
/// MPL-2.0 is left out: what we ship does without it. A tool of ours may have it, see [`TOOLS`].
const ACCEPTED: [&str; 13] = [
    "MIT",
    "Apache-2.0",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "ISC",
    "Zlib",
    "0BSD",
    "BSL-1.0",
    "CC0-1.0",
    "Unlicense",
    // Unicode's tables, inside text crates.
    "Unicode-3.0",
    // The fonts that egui brings; they are named in NOTICE because the viewer's program carries them.
    "OFL-1.1",
    "Ubuntu-font-1.0",
];

/// Crates under another licence that only our chores run, with the licence: nothing of them gets into what we ship.
/// cbindgen's licence covers its own files, not the headers that it writes.
const TOOLS: [(&str, &str); 1] = [("cbindgen", "MPL-2.0")];

/// Name of the package that may link [`TOOLS`].
const CHORES: &str = "xtask";

/// Checks every package. `Ok` holds one line that says what was found; `Err` holds every offence, one a line.
pub fn check(metadata: &Metadata) -> Result<String, String> {
    let mut offences: Vec<String> = metadata.packages.iter().filter_map(offence).collect();
    offences.extend(shipped_tools(metadata));
    if !offences.is_empty() {
        return Err(offences.join("\n"));
    }
    // Which of the accepted licences some package really leaves no way around, so that the list above can be kept
    // short.
    let mut needed: Vec<&str> = ACCEPTED
        .into_iter()
        .filter(|licence| metadata.packages.iter().any(|package| !is_accepted_without(package, licence)))
        .collect();
    needed.sort_unstable();
    Ok(format!(
        "{} packages, all under accepted licences; those that some package needs: {}",
        metadata.packages.len(),
        needed.join(", ")
    ))
}

/// Returns what is wrong with a package's licence, with the package's name.
fn offence(package: &Package) -> Option<String> {
    let who = format!("{} {}", package.name, package.version);
    let Some(expression) = package.license.as_deref().filter(|text| !text.trim().is_empty()) else {
        return Some(match &package.license_file {
            Some(file) => format!("{who} names no licence, only the file {file}: read it and decide"),
            None => format!("{who} names no licence, so nobody may use it"),
        });
    };
    let accepts = |licence: &str| ACCEPTED.contains(&licence) || TOOLS.contains(&(&*package.name, licence));
    match spdx::is_satisfied(expression, &accepts) {
        Ok(true) => None,
        Ok(false) => Some(format!("{who} is under '{expression}', which xtask/src/checks/licences.rs does not accept")),
        Err(reason) => {
            Some(format!("{who} has the licence text '{expression}', which is no SPDX expression: {reason}"))
        }
    }
}

/// Finds our packages besides [`CHORES`] that link one of [`TOOLS`].
fn shipped_tools(metadata: &Metadata) -> Vec<String> {
    let ours = metadata.packages.iter().filter(|package| package.source.is_none() && package.name != CHORES);
    let linked = ours.flat_map(|package| {
        let linked = metadata.linked_with(&package.name);
        let tools = TOOLS.into_iter().filter(move |(tool, _)| linked.contains(tool));
        tools.map(|(tool, licence)| {
            format!("{} links {tool}, which is under {licence}: only {CHORES} may", package.name)
        })
    });
    linked.collect()
}

fn is_accepted_without(package: &Package, licence: &str) -> bool {
    let accepts = |other: &str| other != licence && ACCEPTED.contains(&other);
    package.license.as_deref().is_some_and(|expression| spdx::is_satisfied(expression, &accepts) == Ok(true))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn package(license: Option<&str>, license_file: Option<&str>) -> Package {
        Package {
            name: "planted".to_string(),
            version: "1.2.3".to_string(),
            id: String::new(),
            source: None,
            license: license.map(str::to_string),
            license_file: license_file.map(str::to_string),
            dependencies: Vec::new(),
            targets: Vec::new(),
        }
    }

    #[test]
    fn a_planted_bad_licence_is_found_and_its_crate_named() {
        for expression in
            ["GPL-3.0-only", "MIT AND GPL-3.0-only", "AGPL-3.0-or-later", "MPL-2.0", "LicenseRef-Mine", "MIT;"]
        {
            let offence = offence(&package(Some(expression), None)).unwrap_or_else(|| panic!("{expression} passed"));
            assert!(offence.contains("planted 1.2.3") && offence.contains(expression), "{offence}");
        }
    }

    #[test]
    fn a_tool_s_licence_is_for_that_tool_and_for_the_chores_alone() {
        let tool = Package { name: "cbindgen".to_string(), ..package(Some("MPL-2.0"), None) };
        assert_eq!(offence(&tool), None);
        assert!(offence(&Package { license: Some("GPL-3.0-only".to_string()), ..tool }).is_some());
        let linked_by = |name: &str| {
            let package = |name: &str, source| {
                let dependencies: [&str; 0] = [];
                serde_json::json!({ "name": name, "version": "1", "id": name, "source": source, "dependencies": dependencies })
            };
            let metadata = serde_json::from_value(serde_json::json!({
                "packages": [package(name, None), package("cbindgen", Some("registry"))],
                "target_directory": "target",
                "resolve": { "nodes": [
                    { "id": name, "deps": [{ "pkg": "cbindgen", "dep_kinds": [{ "kind": null }] }] },
                ] },
            }));
            shipped_tools(&metadata.unwrap())
        };
        assert_eq!(linked_by("xtask"), [""; 0]);
        assert!(linked_by("btf-runtime-c")[0].contains("btf-runtime-c links cbindgen"));
    }

    #[test]
    fn a_missing_licence_is_found_and_its_crate_named() {
        assert!(offence(&package(None, None)).unwrap().contains("planted 1.2.3 names no licence"));
        assert!(offence(&package(Some(" "), None)).unwrap().contains("planted 1.2.3 names no licence"));
        assert!(offence(&package(None, Some("EULA.txt"))).unwrap().contains("EULA.txt"));
    }

    #[test]
    fn the_licences_of_our_dependencies_pass() {
        for expression in [
            "MIT OR Apache-2.0",
            "MIT OR GPL-3.0",
            "(MIT OR Apache-2.0) AND OFL-1.1 AND Ubuntu-font-1.0",
            "(MIT OR Apache-2.0) AND Unicode-3.0",
            "MIT OR Apache-2.0 OR LGPL-2.1-or-later",
            "CC0-1.0 OR MIT-0 OR Apache-2.0",
        ] {
            assert_eq!(offence(&package(Some(expression), None)), None);
        }
    }
}

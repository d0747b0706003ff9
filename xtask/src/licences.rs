//! The licences of everything that we build on, on every platform: each must be one that we may ship.

use crate::metadata::{Metadata, Package};
use crate::spdx;

/// Licences that ask for no more than naming the authors, so that MIT OR Apache-2.0 can stand over the whole.
///
/// MPL-2.0 is left out: nothing of ours needs it, and a crate that brings it should be a decision.
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

/// Checks every package. `Ok` holds one line that says what was found; `Err` holds every offence, one a line.
pub fn check(metadata: &Metadata) -> Result<String, String> {
    let offences: Vec<String> = metadata.packages.iter().filter_map(offence).collect();
    if !offences.is_empty() {
        return Err(offences.join("\n"));
    }
    // Which of the accepted licences some package really leaves no way around, so that the list above can be kept short.
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

/// What is wrong with a package's licence, with the package's name.
fn offence(package: &Package) -> Option<String> {
    let who = format!("{} {}", package.name, package.version);
    let Some(expression) = package.license.as_deref().filter(|text| !text.trim().is_empty()) else {
        return Some(match &package.license_file {
            Some(file) => format!("{who} names no licence, only the file {file}: read it and decide"),
            None => format!("{who} names no licence, so nobody may use it"),
        });
    };
    match spdx::is_satisfied(expression, &|licence| ACCEPTED.contains(&licence)) {
        Ok(true) => None,
        Ok(false) => Some(format!("{who} is under '{expression}', which xtask/src/licences.rs does not accept")),
        Err(reason) => {
            Some(format!("{who} has the licence text '{expression}', which is no SPDX expression: {reason}"))
        }
    }
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

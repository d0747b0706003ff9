//! Reads `cargo metadata`: our packages and everything that they depend on.

use crate::failure::Failure;
use crate::shell;
use serde::Deserialize;
use std::collections::{BTreeSet, HashMap};
use std::path::PathBuf;

/// The parts of `cargo metadata --format-version 1` that the checks read. Dependencies of every platform are included.
#[derive(Deserialize)]
pub struct Metadata {
    pub packages: Vec<Package>,
    pub resolve: Resolve,
    pub target_directory: PathBuf,
}

#[derive(Deserialize)]
pub struct Package {
    pub name: String,
    pub version: String,
    pub id: String,
    /// The registry, or `None` for a package of this workspace.
    pub source: Option<String>,
    /// The licence as an SPDX expression.
    pub license: Option<String>,
    pub license_file: Option<String>,
    /// Dependencies as Cargo.toml declares them: normal ones, those of tests and build scripts, and optional ones.
    pub dependencies: Vec<Dependency>,
    /// Targets that cargo builds of the package: library, programs, tests, examples.
    #[serde(default)]
    pub targets: Vec<Target>,
}

#[derive(Deserialize)]
pub struct Target {
    pub name: String,
    /// `lib`, `bin`, `test`, `example` and others.
    pub kind: Vec<String>,
}

#[derive(Deserialize)]
pub struct Dependency {
    pub name: String,
    /// The folder of a dependency that is one of our packages.
    pub path: Option<String>,
}

#[derive(Deserialize)]
pub struct Resolve {
    pub nodes: Vec<Node>,
}

/// A package in the resolved graph, with the dependencies that its chosen features switch on.
#[derive(Deserialize)]
pub struct Node {
    pub id: String,
    pub deps: Vec<NodeDependency>,
}

#[derive(Deserialize)]
pub struct NodeDependency {
    pub pkg: String,
    pub dep_kinds: Vec<DependencyKind>,
}

#[derive(Deserialize)]
pub struct DependencyKind {
    /// `None` for a normal dependency, else `dev` or `build`.
    pub kind: Option<String>,
}

impl Metadata {
    /// Asks cargo. Needs no network where the dependencies are downloaded.
    pub fn read() -> Result<Metadata, Failure> {
        let mut command = shell::cargo(&["metadata", "--format-version", "1"]);
        let output = command
            .output()
            .map_err(|error| Failure::new(format!("`{}` does not start: {error}", shell::line_of(&command))))?;
        if !output.status.success() {
            let reason = String::from_utf8_lossy(&output.stderr);
            return Err(Failure::new(format!("`{}` failed: {}", shell::line_of(&command), reason.trim())));
        }
        serde_json::from_slice(&output.stdout)
            .map_err(|error| Failure::new(format!("`cargo metadata` answered something unexpected: {error}")))
    }

    /// Returns the names of the integration tests of our packages, sorted.
    pub fn integration_tests(&self) -> Vec<&str> {
        let targets =
            self.packages.iter().filter(|package| package.source.is_none()).flat_map(|package| &package.targets);
        let tests = targets.filter(|target| target.kind.iter().any(|kind| kind == "test"));
        let mut names: Vec<&str> = tests.map(|target| target.name.as_str()).collect();
        names.sort_unstable();
        names
    }

    /// Returns the names of all packages that `name` is linked with: its normal dependencies and theirs, itself left
    /// out.
    ///
    /// Cargo metadata unites the features that all packages of the workspace ask for, so the set may be larger than
    /// what a build of `name` alone links, never smaller.
    pub fn linked_with(&self, name: &str) -> BTreeSet<&str> {
        let nodes: HashMap<&str, &Node> = self.resolve.nodes.iter().map(|node| (node.id.as_str(), node)).collect();
        let names: HashMap<&str, &str> = self.packages.iter().map(|p| (p.id.as_str(), p.name.as_str())).collect();
        let mut waiting: Vec<&str> =
            self.packages.iter().filter(|p| p.source.is_none() && p.name == name).map(|p| p.id.as_str()).collect();
        let mut seen: BTreeSet<&str> = waiting.iter().copied().collect();
        let mut linked = BTreeSet::new();
        while let Some(id) = waiting.pop() {
            for dependency in nodes.get(id).map_or(&[][..], |node| &node.deps) {
                let is_linked = dependency.dep_kinds.iter().any(|kind| kind.kind.is_none());
                if is_linked && seen.insert(&dependency.pkg) {
                    waiting.push(&dependency.pkg);
                    linked.extend(names.get(dependency.pkg.as_str()));
                }
            }
        }
        linked
    }
}

/// Returns whether the subcommand `cargo NAME` is installed.
pub fn has_subcommand(name: &str) -> bool {
    shell::answer_of(&mut shell::cargo(&[name, "--version"])).is_some()
}

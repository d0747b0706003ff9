//! The plan of a library: which captures become which assets, with which options. A TOML file that people write and
//! edit, and that [`LibraryPlan::of_captures`] writes first.

use crate::error::FitError;
use crate::library::options::MaterialOptions;
use btf_capture::toml_text::{bounded_text, line_and_reason};
use glob::Pattern;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Version of the file.
const VERSION: u32 = 1;
/// Largest file that is read: a material takes some 100 bytes.
const MAX_PLAN_BYTES: u64 = 64 << 20;
/// Largest part of a capture's path that becomes a part of a name: numbers still fit behind it.
const MAX_PART_BYTES: usize = 150;
/// First lines of every plan.
const HEADER: &str = "\
# A library of materials: `btf-fit library run` fits what is not yet done, `collect` checks it and writes a catalogue.
# Paths are relative to this file. The options of a material are its own, else those of the last rule whose `match`
# (a glob over names, as in leather*) fits, else those of [options]. docs/guide/libraries.md

";

/// A library of materials and how each is fitted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LibraryPlan {
    /// Version of the file, 1.
    version: u32,
    /// Folder of the assets, relative to the plan.
    pub assets: PathBuf,
    /// Options of every material.
    #[serde(default)]
    pub options: MaterialOptions,
    /// Options of the materials whose names match; a later rule wins over an earlier one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rules: Vec<PlanRule>,
    /// The materials, in the order of their names.
    #[serde(default)]
    pub materials: Vec<PlannedMaterial>,
}

/// Options of the materials whose names match a glob.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanRule {
    /// Glob over names: `*`, `?`, `[a-z]`.
    #[serde(rename = "match")]
    pub matching: String,
    /// The options.
    #[serde(flatten)]
    pub options: MaterialOptions,
}

/// A material of the library.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlannedMaterial {
    /// Name: that of its asset without `.spmm`.
    pub name: String,
    /// Captures, one for each layer, relative to the plan.
    pub captures: Vec<PathBuf>,
    /// Options of this material alone.
    #[serde(flatten)]
    pub options: MaterialOptions,
}

impl FromStr for PlanRule {
    type Err = String;

    /// Reads `GLOB: option=value option=value ...`.
    fn from_str(text: &str) -> Result<PlanRule, String> {
        let form = "a rule is a glob and options, as in 'leather*: bytes=4MB heights=true priority=2'";
        let (glob, options) = text.split_once(':').ok_or(form)?;
        let mut table = String::new();
        for option in options.split_whitespace() {
            let (name, value) = option.split_once('=').ok_or(form)?;
            // Numbers and true or false stand as they are; everything else is text.
            let plain = value.parse::<f64>().is_ok() || value == "true" || value == "false";
            table += &if plain { format!("{name} = {value}\n") } else { format!("{name} = {value:?}\n") };
        }
        let options = toml::from_str(&table).map_err(|error| format!("{}; {form}", error.message()))?;
        Pattern::new(glob.trim()).map_err(|error| format!("`{glob}` is no glob: {error}; {form}"))?;
        Ok(PlanRule { matching: glob.trim().into(), options })
    }
}

impl LibraryPlan {
    /// Makes a plan that lists `captures`, relative to the plan or absolute, each as a material. Names are the captures'
    /// own; where two would be equal, with the folders above.
    pub fn of_captures(
        assets: PathBuf,
        options: MaterialOptions,
        rules: Vec<PlanRule>,
        captures: &[PathBuf],
    ) -> LibraryPlan {
        let mut plan = LibraryPlan { version: VERSION, assets, options, rules, materials: Vec::new() };
        plan.add_captures(captures);
        plan
    }

    /// Adds each of `captures` that no material has yet, as a material, and returns how many that were.
    pub fn add_captures(&mut self, captures: &[PathBuf]) -> usize {
        let known: BTreeSet<PathBuf> = self.materials.iter().flat_map(|material| material.captures.clone()).collect();
        let mut names: BTreeSet<String> = self.materials.iter().map(|material| file_key(&material.name)).collect();
        let before = self.materials.len();
        for capture in captures.iter().filter(|capture| !known.contains(*capture)) {
            let name = free_name(capture, &names);
            names.insert(file_key(&name));
            let options = MaterialOptions::default();
            self.materials.push(PlannedMaterial { name, captures: vec![capture.clone()], options });
        }
        self.materials.sort_by(|a, b| a.name.cmp(&b.name));
        self.materials.len() - before
    }

    /// Reads and checks a plan.
    ///
    /// # Errors
    /// [`FitError::Library`], one sentence with the line where there is one.
    pub fn read(path: &Path) -> Result<LibraryPlan, FitError> {
        let refuse = |reason: String| FitError::Library(format!("{} {reason}", path.display()));
        let text = bounded_text(path, MAX_PLAN_BYTES, "a plan").map_err(&refuse)?;
        let plan: LibraryPlan = toml::from_str(&text).map_err(|error| {
            let (line, reason) = line_and_reason(&text, &error);
            refuse(format!("line {line}: {reason}; correct it, or write a new plan with `btf-fit library plan`"))
        })?;
        plan.check_options(path)?;
        Ok(plan)
    }

    /// Checks the options as [`LibraryPlan::read`] does; `path` is the plan's, for the message.
    ///
    /// # Errors
    /// [`FitError::Library`], one sentence.
    pub fn check_options(&self, path: &Path) -> Result<(), FitError> {
        self.check().map_err(|reason| FitError::Library(format!("{} {reason}", path.display())))
    }

    /// Returns the plan as a file's text.
    pub fn to_toml(&self) -> String {
        // Tables of strings and numbers: serialising cannot fail.
        format!("{HEADER}{}", toml::to_string(self).unwrap_or_default())
    }

    /// Returns the options of `material`: its own, else the last matching rule's, else the plan's.
    pub fn options_of(&self, material: &PlannedMaterial) -> MaterialOptions {
        let matches = |rule: &&PlanRule| Pattern::new(&rule.matching).is_ok_and(|glob| glob.matches(&material.name));
        let below = self.rules.iter().filter(matches).fold(self.options.clone(), |all, rule| rule.options.over(&all));
        material.options.over(&below)
    }

    /// Returns a verb phrase about the first fault.
    fn check(&self) -> Result<(), String> {
        if self.version != VERSION {
            return Err(format!("has version {}, and this program reads version {VERSION}", self.version));
        }
        for rule in &self.rules {
            Pattern::new(&rule.matching)
                .map_err(|error| format!("has the rule `{}`, which is no glob: {error}", rule.matching))?;
        }
        let mut names = BTreeSet::new();
        for material in &self.materials {
            let name = &material.name;
            if let Some(fault) = name_fault(name) {
                return Err(format!("names a material `{name}`: {fault}"));
            }
            if !names.insert(file_key(name)) {
                return Err(format!(
                    "has two materials `{name}`; give each its own name, also without regard to capitals"
                ));
            }
            if material.captures.is_empty() {
                return Err(format!("gives `{name}` no capture; name at least one in `captures`"));
            }
            let refused = |fault: FitError| format!("asks for `{name}`: {fault}");
            self.options_of(material).params(Path::new(".")).check().map_err(refused)?;
        }
        Ok(())
    }
}

/// Returns what two names share whose files some file systems would take for one.
fn file_key(name: &str) -> String {
    name.to_lowercase()
}

/// Returns why `name` cannot be the name of a file on every system, if so.
fn name_fault(name: &str) -> Option<&'static str> {
    let odd = |letter: char| letter.is_control() || r#"/\:*?"<>|"#.contains(letter);
    match name {
        _ if name.is_empty() || name.starts_with('.') || name.ends_with('.') => Some("a name has no dot at its ends"),
        _ if name.len() > 200 => Some("a name has at most 200 bytes"),
        _ if name.chars().any(odd) => Some("a name has none of / \\ : * ? \" < > |"),
        _ => None,
    }
}

/// Returns a name for `capture` that is not among `taken`: its own, with as many folders above as make it one of a kind.
fn free_name(capture: &Path, taken: &BTreeSet<String>) -> String {
    let clean = |part: &str| -> String {
        let kept = part.chars().map(|c| if c.is_alphanumeric() || "-_+.,".contains(c) { c } else { '_' });
        let mut kept: String = kept.collect();
        while kept.len() > MAX_PART_BYTES {
            kept.pop();
        }
        kept.trim_matches('.').to_string()
    };
    // Only what tells the kind of a file is cut off: leather-0.5 and leather-0.7 are two folders.
    let kind = capture.extension().filter(|kind| ["zip", "btf"].iter().any(|known| kind.eq_ignore_ascii_case(known)));
    let whole = if kind.is_some() { capture.with_extension("") } else { capture.to_path_buf() };
    let parts: Vec<String> = whole
        .components()
        .map(|part| clean(&part.as_os_str().to_string_lossy()))
        .filter(|part| !part.is_empty())
        .collect();
    let longer = (0..parts.len()).rev().map(|first| parts[first..].join("_"));
    let numbered = (2..).map(|number| format!("{}_{number}", parts.last().map_or("material", String::as_str)));
    let free = |name: &String| name_fault(name).is_none() && !taken.contains(&file_key(name));
    longer.chain(numbered).find(free).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> LibraryPlan {
        let text = r#"
            version = 1
            assets = "assets"
            options = { bytes = "2MB", seed = 7 }
            rules = [
                { match = "leather*", bytes = "4MB", priority = 2 },
                { match = "*-hdr", psnr = 36.0 },
            ]
            [[materials]]
            name = "leather-hdr"
            captures = ["leather"]
            [[materials]]
            name = "wool"
            captures = ["wool", "wool-back"]
            clusters = 9
        "#;
        toml::from_str(text).unwrap()
    }

    #[test]
    fn a_later_rule_wins_and_a_material_wins_over_rules() {
        let plan = plan();
        plan.check().unwrap();
        let leather = plan.options_of(&plan.materials[0]).params(Path::new("."));
        // A size and an error exclude each other: the later rule's error takes the place of the size.
        assert_eq!((leather.bytes, leather.psnr_db, leather.seed), (None, Some(36.0), 7));
        assert_eq!(plan.options_of(&plan.materials[0]).priority, Some(2));
        let wool = plan.options_of(&plan.materials[1]);
        assert_eq!((wool.bytes.as_deref(), wool.clusters), (Some("2MB"), Some(9)));
    }

    #[test]
    fn a_written_plan_is_read_back_and_faults_are_told_with_their_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.toml");
        std::fs::write(&path, plan().to_toml()).unwrap();
        assert_eq!(LibraryPlan::read(&path).unwrap(), plan());
        let refused = |change: fn(&mut LibraryPlan)| {
            let mut plan = plan();
            change(&mut plan);
            std::fs::write(&path, plan.to_toml()).unwrap();
            LibraryPlan::read(&path).unwrap_err().to_string()
        };
        assert!(refused(|plan| plan.version = 2).contains("version 2"));
        assert!(refused(|plan| plan.materials[1].name = "Leather-HDR".into()).contains("two materials"));
        assert!(refused(|plan| plan.materials[1].name = "a/b".into()).contains("none of /"));
        assert!(refused(|plan| plan.materials[1].captures.clear()).contains("no capture"));
        assert!(refused(|plan| plan.rules[0].matching = "[".into()).contains("no glob"));
        assert!(refused(|plan| plan.rules[0].options.clusters = Some(300)).contains("--clusters"));
        assert!(refused(|plan| plan.options.bytes = Some("lots".into())).contains("`lots`"));
        for table in ["[options]", "[[rules]]\nmatch = 'a*'", "[[materials]]\nname = 'a'\ncaptures = ['a']"] {
            std::fs::write(&path, format!("version = 1\nassets = 'a'\n\n{table}\nbites = '2MB'\n")).unwrap();
            let told = LibraryPlan::read(&path).unwrap_err().to_string();
            assert!(told.contains(" line ") && told.contains("bites"), "{told}");
        }
    }

    #[test]
    fn rules_of_the_command_line_are_those_of_the_file() {
        let rule: PlanRule = "leather*: bytes=4MB priority=2".parse().unwrap();
        assert_eq!(rule, plan().rules[0]);
        for odd in ["leather*", "a: bytes", "a: bites=2", "[: bytes=2MB", "a: bytes=lots"] {
            assert!(odd.parse::<PlanRule>().is_err(), "{odd}");
        }
    }

    #[test]
    fn names_are_the_captures_own_with_folders_where_two_are_equal() {
        let captures = ["a/wool", "b/wool", "b/silk red.zip", "b/silk red.btf"].map(PathBuf::from);
        let mut plan = LibraryPlan::of_captures("out".into(), MaterialOptions::default(), Vec::new(), &captures);
        let names = |plan: &LibraryPlan| plan.materials.iter().map(|m| m.name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&plan), ["b_silk_red", "b_wool", "silk_red", "wool"]);
        plan.check().unwrap();
        assert_eq!(plan.add_captures(&captures), 0);
        assert_eq!(plan.add_captures(&[PathBuf::from("a/../b/WOOL")]), 1);
        let long = "x".repeat(250);
        assert_eq!(
            plan.add_captures(&["leather-0.5", "leather-0.7", &long, &format!("a/{long}")].map(PathBuf::from)),
            4
        );
        plan.check().unwrap();
        assert_eq!(names(&plan).len(), 9);
        assert!(names(&plan).contains(&"leather-0.7".to_string()));
    }
}

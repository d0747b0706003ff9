//! Reads and writes the description file of a leaf, which holds everything about one leaf as TOML.
//!
//! ```toml
//! [contents]                      # per area of leaf
//! chlorophyll_ug_per_cm2 = 40.0
//! carotenoid_ug_per_cm2 = 8.0
//! anthocyanin_ug_per_cm2 = 0.0
//! brown = 0.0
//! water_cm = 0.01
//! dry_matter_g_per_cm2 = 0.005
//! structure = 1.5
//!
//! [gloss]
//! index = 1.42
//! gamma_along = 0.3               # roughness along the veins and across them
//! gamma_across = 0.3
//!
//! [look]
//! species = "maize"               # maize, soybean, tree, grass or spruce; without it a plain leaf
//! deficiency = "nitrogen"         # nitrogen or magnesium; without it a healthy leaf
//! severity = 0.7
//! seed = 1
//! size_mm = 30.0
//! textures = "maize-textures"     # folder, relative to this file; without it everything is grown
//!
//! [variation]                     # coefficients of variation from plant to plant
//! chlorophyll = 0.0
//! carotenoid = 0.0
//! brown = 0.0
//! thickness = 0.0
//! seed = 1
//! ```
//!
//! Every key may be missing. Contents, gloss and size are then those of the species ([`crate::Species::preset`]) or of
//! the plain leaf. A deficient leaf has [`Deficiency::BROWN`] of brown pigment and [`Deficiency::SEVERITY`]; seeds are
//! 1, and nothing varies. For the ranges see [`LEAF_QUANTITIES`]. Unknown keys are refused, so that a misspelt key is
//! noticed.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use crate::error::ModelError;
use crate::leaf::description::LeafDescription;
use crate::leaf::quantity::LEAF_QUANTITIES;
use crate::leaf::species::{Deficiency, Species};
use btf_capture::atomic::{parent_of, write_file_atomically};
use btf_capture::toml_text::{bounded_text, line_and_reason, one_line};

/// Largest description file in bytes.
const MAX_DESCRIPTION_BYTES: u64 = 1 << 16;

/// Tables of the file, in its order.
const TABLES: [&str; 4] = ["contents", "gloss", "look", "variation"];

/// Keys of the file beside the [`LEAF_QUANTITIES`].
const OTHER_KEYS: [(&str, &str); 5] =
    [("look", "species"), ("look", "deficiency"), ("look", "seed"), ("look", "textures"), ("variation", "seed")];

impl LeafDescription {
    /// Reads a description file.
    ///
    /// # Errors
    /// [`ModelError::Leaf`] for a file that cannot be read, is no TOML, has an unknown key, or a value of the
    /// wrong kind or out of its range.
    pub fn read(path: impl AsRef<Path>) -> Result<LeafDescription, ModelError> {
        let path = path.as_ref();
        let bad = |fault: String, remedy| ModelError::leaf(path, fault, remedy);
        let text = bounded_text(path, MAX_DESCRIPTION_BYTES, "a leaf's description")
            .map_err(|fault| bad(fault, "point to the description of a leaf (.toml)"))?;
        LeafDescription::parse(&text).map_err(|fault| bad(one_line(&fault), "correct it"))
    }

    /// Tells whether a file describes a leaf, right or wrong, by the names of its tables; `false` for what is no TOML.
    pub fn is_one(path: impl AsRef<Path>) -> bool {
        let text = bounded_text(path.as_ref(), MAX_DESCRIPTION_BYTES, "a leaf's description").unwrap_or_default();
        let tables = text.parse::<toml::Table>().unwrap_or_default();
        TABLES.iter().any(|table| tables.contains_key(*table))
    }

    /// Writes the description, whole or not at all. [`LeafDescription::read`] returns the same description again.
    ///
    /// # Errors
    /// [`ModelError::Leaf`] for a number out of its range, a seed beyond 2^63 - 1 (TOML has no larger
    /// integers) or a folder whose name is no Unicode; [`ModelError::File`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), ModelError> {
        let path = path.as_ref();
        let text = self.to_toml().map_err(|fault| ModelError::leaf(path, fault, "change that value"))?;
        Ok(write_file_atomically(path, text.as_bytes())?)
    }

    /// Returns the path of the folder of textures, for the description that was read from the file `path`.
    pub fn textures_beside(&self, path: impl AsRef<Path>) -> Option<PathBuf> {
        self.textures.as_ref().map(|folder| parent_of(path.as_ref()).join(folder))
    }

    /// Parses the text of a description. The error is a verb phrase.
    fn parse(text: &str) -> Result<LeafDescription, String> {
        let file: toml::Table = text.parse().map_err(|error: toml::de::Error| {
            let (line, reason) = line_and_reason(text, &error);
            format!("is no TOML in line {line} ({reason})")
        })?;
        check_keys(&file)?;
        let value = |section: &str, key: &str| file.get(section).and_then(|table| table.get(key));
        let word = |key: &str| match value("look", key) {
            None => Ok(None),
            Some(toml::Value::String(word)) => Ok(Some(word.as_str())),
            Some(other) => Err(format!("has `{key}` in [look] as {other}, which is no text in quotes")),
        };
        let species = named("species", word("species")?, &Species::ALL, Species::name)?;
        let deficiency = named("deficiency", word("deficiency")?, &Deficiency::ALL, Deficiency::name)?;
        let mut leaf = LeafDescription::of(species, deficiency);
        leaf.textures = word("textures")?.map(PathBuf::from);
        for quantity in &LEAF_QUANTITIES {
            let Some(value) = value(quantity.section, quantity.key) else { continue };
            let number = value.as_float().or_else(|| value.as_integer().map(|integer| integer as f64));
            let number = number.ok_or_else(|| {
                format!("has `{}` in [{}] as {value}, which is no number", quantity.key, quantity.section)
            })?;
            quantity.fault(number).map_or(Ok(()), Err)?;
            quantity.set(&mut leaf, number);
        }
        for (section, seed) in [("look", &mut leaf.seed), ("variation", &mut leaf.variation.seed)] {
            let Some(value) = value(section, "seed") else { continue };
            *seed = value.as_integer().and_then(|integer| u64::try_from(integer).ok()).ok_or_else(|| {
                format!("has `seed` in [{section}] as {value}, which is not a whole number from 0 to {}", i64::MAX)
            })?;
        }
        Ok(leaf)
    }

    /// Returns the text of the file. The error is a verb phrase.
    fn to_toml(&self) -> Result<String, String> {
        let mut text = String::from("# A leaf: what it holds and how it looks. Every key may be left out.\n");
        // Writing to a string does not fail.
        for section in TABLES {
            let _ = writeln!(text, "\n[{section}]");
            let mut put = |key: &str, value: toml::Value| {
                let _ = writeln!(text, "{key} = {value}");
            };
            if section == "look" {
                if let Some(species) = self.species {
                    put("species", species.name().into());
                }
                if let Some(deficiency) = self.deficiency {
                    put("deficiency", deficiency.name().into());
                }
                if let Some(folder) = &self.textures {
                    let name = folder.to_str().ok_or("would have `textures` in [look] as a name that is no Unicode")?;
                    put("textures", name.into());
                }
            }
            for quantity in LEAF_QUANTITIES.iter().filter(|quantity| quantity.section == section) {
                let value = quantity.of(self);
                quantity.fault(value).map_or(Ok(()), Err)?;
                put(quantity.key, value.into());
            }
            let seed = match section {
                "look" => self.seed,
                "variation" => self.variation.seed,
                _ => continue,
            };
            let seed = i64::try_from(seed).map_err(|_| {
                format!("would have `seed` in [{section}] as {seed}, which is not within 0 to {}", i64::MAX)
            })?;
            put("seed", seed.into());
        }
        Ok(text)
    }
}

/// Refuses tables and keys that a description does not have.
fn check_keys(file: &toml::Table) -> Result<(), String> {
    let known = || LEAF_QUANTITIES.iter().map(|q| (q.section, q.key)).chain(OTHER_KEYS);
    for (section, table) in file {
        if !known().any(|(name, _)| name == section) {
            return Err(format!("has `{section}`, and only [contents], [gloss], [look] and [variation] are known"));
        }
        let toml::Value::Table(table) = table else {
            return Err(format!("has `{section}` as something else than a table"));
        };
        let keys = || known().filter(|(name, _)| name == section).map(|(_, key)| key);
        if let Some(unknown) = table.keys().find(|key| !keys().any(|name| name == key.as_str())) {
            let known = keys().collect::<Vec<_>>().join(", ");
            return Err(format!("has the unknown key `{unknown}` in [{section}], which may have {known}"));
        }
    }
    Ok(())
}

/// Returns the value of `all` that `word` names; `None` without a word.
fn named<T: Copy>(key: &str, word: Option<&str>, all: &[T], name: fn(T) -> &'static str) -> Result<Option<T>, String> {
    let Some(word) = word else { return Ok(None) };
    all.iter().copied().find(|&thing| name(thing) == word).map(Some).ok_or_else(|| {
        let names = all.iter().map(|&thing| name(thing)).collect::<Vec<_>>().join(", ");
        format!("has `{key}` in [look] as \"{word}\", which is none of {names}")
    })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::leaf::description::PlantVariation;
    use crate::leaf::preset::LeafPreset;

    fn full() -> LeafDescription {
        let mut leaf = LeafDescription::of(Some(Species::Soybean), Some(Deficiency::Magnesium));
        for (i, quantity) in LEAF_QUANTITIES.iter().enumerate() {
            let [least, most] = quantity.range;
            quantity.set(&mut leaf, least + (most - least) * (i as f64 + 0.37) / 17.0);
        }
        let variation = PlantVariation { seed: u64::MAX >> 1, ..leaf.variation };
        LeafDescription { seed: 77, textures: Some("a \"folder\"/of mine".into()), variation, ..leaf }
    }

    #[test]
    fn a_written_description_is_read_back_exactly() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("leaf.toml");
        let albino = LeafDescription { contents: LeafPreset::Albino.contents(), ..LeafDescription::default() };
        for leaf in [full(), LeafDescription::default(), LeafDescription::of(Some(Species::Tree), None), albino] {
            leaf.write(&path).unwrap();
            assert_eq!(LeafDescription::read(&path).unwrap(), leaf);
            // Planted difference: in every number.
            for quantity in &LEAF_QUANTITIES {
                let mut other = leaf.clone();
                quantity.set(&mut other, f64::midpoint(quantity.of(&leaf), quantity.range[1] * 0.9));
                other.write(&path).unwrap();
                assert_ne!(LeafDescription::read(&path).unwrap(), leaf, "{}", quantity.key);
            }
        }
        assert_eq!(full().textures_beside(&path), Some(dir.path().join("a \"folder\"/of mine")));
        assert_eq!(LeafDescription::default().textures_beside(&path), None);
    }

    #[test]
    fn what_is_missing_is_the_species_or_the_plain_leafs() {
        let of = |text: &str| LeafDescription::parse(text).unwrap();
        assert_eq!(of(""), LeafDescription::default());
        assert_eq!(of("[look]\nspecies = \"maize\""), LeafDescription::of(Some(Species::Maize), None));
        let starved = of("[look]\ndeficiency = \"nitrogen\"");
        assert_eq!((starved.contents.brown, starved.severity), (Deficiency::BROWN, Deficiency::SEVERITY));
        // What stands there wins, and whole numbers will do.
        let mixed = of(
            "[contents]\nbrown = 0\nchlorophyll_ug_per_cm2 = 7\n[look]\nspecies = \"maize\"\ndeficiency = \"nitrogen\"",
        );
        assert_eq!((mixed.contents.brown, mixed.contents.chlorophyll_ug_per_cm2), (0.0, 7.0));
        assert_eq!(mixed.contents.carotenoid_ug_per_cm2, Species::Maize.preset().contents.carotenoid_ug_per_cm2);
    }

    #[test]
    fn the_documented_example_is_a_description() {
        let text: String = include_str!("description_file.rs")
            .lines()
            .skip_while(|line| !line.contains("```toml"))
            .skip(1)
            .take_while(|line| !line.contains("```"))
            .map(|line| line.trim_start_matches("//!").to_string() + "\n")
            .collect();
        let leaf = LeafDescription::parse(&text).unwrap();
        assert_eq!((leaf.species, leaf.textures), (Some(Species::Maize), Some("maize-textures".into())));
        // Every key stands in it.
        let file: toml::Table = text.parse().unwrap();
        let count: usize = file.values().map(|section| section.as_table().unwrap().len()).sum();
        assert_eq!(count, LEAF_QUANTITIES.len() + OTHER_KEYS.len());
    }

    #[test]
    fn what_cannot_be_used_is_named_with_file_key_value_and_range() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mine.toml");
        for (text, parts) in [
            ("[contents]\nbrown = 1.5", ["`brown` in [contents] as 1.5", "within 0 to 1"]),
            ("[contents]\nchlorophyll_ug_per_cm2 = -1", ["as -1", "within 0 to 100 ug/cm2"]),
            ("[contents]\nstructure = nan", ["as NaN", "within 1 to 3"]),
            ("[gloss]\ngamma_along = 0", ["`gamma_along` in [gloss] as 0", "0.05 to 1"]),
            ("[look]\nsize_mm = inf", ["`size_mm` in [look] as inf", "1 to 200 mm"]),
            ("[look]\nseed = -1", ["`seed` in [look] as -1", "whole number from 0"]),
            ("[variation]\nseed = 1.5", ["`seed` in [variation] as 1.5", "whole number"]),
            (
                "[look]\nspecies = \"oak\"",
                ["`species` in [look] as \"oak\"", "none of maize, soybean, tree, grass, spruce"],
            ),
            ("[look]\ndeficiency = 3", ["`deficiency` in [look] as 3", "no text in quotes"]),
            ("[contents]\nbrown = \"a lot\"", ["as \"a lot\"", "no number"]),
            ("[look]\nspecies = \"ma\\nize\"", ["as \"ma\\nize\", which", "maize"]),
            ("[look]\nseed = \"a\\nb\"", ["`seed` in [look]", "not a whole number"]),
            ("[contents]\n\"a\\nb\" = 3", ["unknown key `a\\nb` in [contents]", "chlorophyll"]),
            ("[contents]\nchlorophyl = 3", ["unknown key `chlorophyl` in [contents]", "chlorophyll_ug_per_cm2, "]),
            ("[leaf]\nx = 1", ["has `leaf`", "[variation] are known"]),
            ("look = 1", ["`look` as something else", "table"]),
            ("\n[look\n", ["no TOML in line 2", "correct"]),
        ] {
            fs::write(&path, text).unwrap();
            let message = LeafDescription::read(&path).unwrap_err().to_string();
            assert!(message.contains("mine.toml ") && message.ends_with("; correct it"), "{message}");
            assert!(parts.iter().all(|part| message.contains(part)) && !message.contains('\n'), "{text}: {message}");
        }
        fs::write(&path, vec![b'#'; 1 << 17]).unwrap();
        assert!(LeafDescription::read(&path).unwrap_err().to_string().contains("larger than the 65536 bytes"));
        fs::write(&path, [0xFF, 0xFE]).unwrap();
        assert!(LeafDescription::read(&path).unwrap_err().to_string().contains("is no text"));
        assert!(LeafDescription::read(dir.path().join("none")).unwrap_err().to_string().contains("cannot be read"));
    }

    #[test]
    fn what_cannot_be_read_again_is_not_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("leaf.toml");
        let mut wet = full();
        wet.contents.water_cm = 1.0;
        for leaf in [wet, LeafDescription { seed: u64::MAX, ..full() }] {
            assert!(matches!(leaf.write(&path), Err(ModelError::Leaf { .. })));
        }
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
    }

    #[test]
    fn presets_are_leaves_and_differ() {
        let of = |preset: LeafPreset| LeafDescription { contents: preset.contents(), ..LeafDescription::default() };
        for (i, preset) in LeafPreset::ALL.into_iter().enumerate() {
            assert!(LEAF_QUANTITIES.iter().all(|quantity| quantity.fault(quantity.of(&of(preset))).is_none()));
            assert!(LeafPreset::ALL[..i].iter().all(|other| other.contents() != preset.contents()));
        }
        // [Miao, Fig. 2a].
        let maize = Species::Maize.preset().contents;
        let figure = (maize.chlorophyll_ug_per_cm2, maize.carotenoid_ug_per_cm2, maize.brown, maize.structure);
        assert_eq!(figure, (40.0, 5.0, 0.0, 1.5));
        for species in Species::ALL {
            let leaf = LeafDescription::of(Some(species), None);
            assert!(LEAF_QUANTITIES.iter().all(|quantity| quantity.fault(quantity.of(&leaf)).is_none()));
            assert!(leaf.gloss.gamma_along <= leaf.gloss.gamma_across);
        }
    }

    #[test]
    fn every_prefix_is_a_description_or_refused_in_one_line() {
        let text = full().to_toml().unwrap();
        for end in (0..text.len()).filter(|&end| text.is_char_boundary(end)) {
            if let Err(fault) = LeafDescription::parse(&text[..end]) {
                assert!(!fault.contains('\n'), "{fault}");
            }
        }
    }
}

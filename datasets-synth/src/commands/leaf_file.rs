//! Description of a leaf as an option, and as a file that is written.

use std::path::{Component, Path, PathBuf};

use btf_synth::{LeafContents, LeafDescription};
use clap::Args;

use super::failure::Failure;
use super::model::ContentsArgs;

#[derive(Args)]
pub(super) struct LeafFileArgs {
    /// Description of the leaf (leaf.toml): contents, gloss, look and textures; options win over it
    #[arg(long = "leaf", value_name = "FILE")]
    file: Option<PathBuf>,
}

impl LeafFileArgs {
    /// Returns the description, where one is given.
    pub fn read(&self) -> Result<Option<LeafDescription>, Failure> {
        let read = |file| LeafDescription::read(file).map_err(|error| Failure::Failed(error.to_string()));
        self.file.as_ref().map(read).transpose()
    }

    /// Returns the folder of textures that the description that was read names.
    pub fn textures(&self, leaf: &LeafDescription) -> Option<PathBuf> {
        leaf.textures_beside(self.file.as_ref()?)
    }
}

impl ContentsArgs {
    /// Returns chlorophyll and carotenoids for the algorithmic models, from the options or from the contents of a whole
    /// leaf. Without either, the models keep those of their own leaf.
    pub(super) fn own_pigments(&self, whole: Option<&LeafContents>) -> [Option<f64>; 2] {
        [
            self.cab.or(whole.map(|contents| contents.chlorophyll_ug_per_cm2)),
            self.car.or(whole.map(|contents| contents.carotenoid_ug_per_cm2)),
        ]
    }
}

/// Writes a description to `file`, with the path of its `textures` relative to the folder of `file`.
pub(super) fn write(leaf: &LeafDescription, textures: Option<&Path>, file: &Path) -> Result<(), Failure> {
    let textures = textures.map(|folder| seen_from(file, folder));
    let leaf = LeafDescription { textures, ..leaf.clone() };
    leaf.write(file).map_err(|error| Failure::Failed(error.to_string()))
}

/// Returns the path of `folder` relative to the folder that holds `file`; absolute where there is no relative one.
fn seen_from(file: &Path, folder: &Path) -> PathBuf {
    // Links are followed where they exist, so that `..` leads where it says.
    let whole =
        |path: &Path| path.canonicalize().or_else(|_| std::path::absolute(path)).unwrap_or_else(|_| path.into());
    let parent = file.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let (from, to) = (whole(parent), whole(folder));
    let common = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    if common == 0 {
        return to;
    }
    let up = from.components().skip(common).map(|_| Component::ParentDir);
    up.chain(to.components().skip(common)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_named_as_seen_from_the_file() {
        for (file, folder, expected) in [
            ("/a/b/leaf.toml", "/a/b/textures", "textures"),
            ("/a/b/leaf.toml", "/a/c/d", "../c/d"),
            ("leaf.toml", "deep/textures", "deep/textures"),
            ("deep/leaf.toml", "textures", "../textures"),
        ] {
            assert_eq!(seen_from(Path::new(file), Path::new(folder)), Path::new(expected), "{file} {folder}");
        }
    }
}

//! Description of a file of any of the toolkit's forms: for `info`.

use crate::error::FitError;
use crate::inspect::describe::{Description, describe};
use crate::inspect::describe_resident::{ResidentDescription, describe_resident};
use crate::inspect::describe_voltex::{VoltexDescription, describe_voltex, is_voltex};
use crate::inspect::load::{read_file, with_path};
use btf_runtime::ResidentFile;
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::Path;

/// Contents of a file: an asset in either form, or a volumetric texture.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum FileDescription {
    /// The file form.
    File(Box<Description>),
    /// The resident form.
    Resident(Box<ResidentDescription>),
    /// A volumetric texture.
    Voltex(Box<VoltexDescription>),
}

impl Display for FileDescription {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FileDescription::File(description) => description.fmt(f),
            FileDescription::Resident(description) => description.fmt(f),
            FileDescription::Voltex(description) => description.fmt(f),
        }
    }
}

/// Describes a file by [`describe`], [`describe_resident`] or [`describe_voltex`], as its first bytes say.
///
/// # Errors
/// As they, or if it cannot be read; the message names the file.
pub fn describe_file(path: &Path) -> Result<FileDescription, FitError> {
    let bytes = read_file(path)?;
    let described = if is_voltex(path, &bytes) {
        describe_voltex(&bytes).map(|description| FileDescription::Voltex(Box::new(description)))
    } else if ResidentFile::is_one(&bytes) {
        describe_resident(bytes).map(|description| FileDescription::Resident(Box::new(description)))
    } else {
        describe(&bytes).map(|description| FileDescription::File(Box::new(description)))
    };
    described.map_err(|error| with_path(path, error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::load::load_asset;
    use crate::provenance::{FitRecord, Material};
    use crate::sample_asset::sample_asset;
    use btf_runtime::{Asset, pack};

    fn bytes() -> Vec<u8> {
        let material = Material { name: "felt".into(), fit: Some(FitRecord::default()), ..Material::default() };
        pack(&Asset { material: material.to_json(), ..sample_asset() }).unwrap()
    }

    #[test]
    fn a_message_names_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let (absent, junk) = (folder.path().join("absent.spmm"), folder.path().join("junk.spmm"));
        std::fs::write(&junk, b"junk").unwrap();
        let nameless = folder.path().join("nameless.spmm");
        std::fs::write(&nameless, pack(&Asset { material: "[]x".into(), ..sample_asset() }).unwrap()).unwrap();
        for (path, name) in [(&absent, "absent.spmm"), (&junk, "junk.spmm"), (&nameless, "nameless.spmm")] {
            let message = describe_file(path).unwrap_err().to_string();
            assert!(message.contains(name) && !message.contains('\n'), "{message}");
        }
        assert!(load_asset(&junk).unwrap_err().to_string().contains("junk.spmm"));
        std::fs::write(&junk, bytes()).unwrap();
        assert!(load_asset(&junk).is_ok());
    }
}

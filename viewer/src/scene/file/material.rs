//! `[[material]]` of a scene file.

use super::defaults::ones2;
use super::source::Source;
use crate::error::ViewerError;
use crate::scene::asset::SceneAsset;
use crate::scene::leaf::SceneLeaf;
use crate::scene::material::{Body, Material, Shown};
use btf_models::DiffuseColour;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::Arc;

/// `[[material]]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MaterialEntry {
    name: String,
    asset: Option<AssetEntry>,
    leaf: Option<String>,
    diffuse: Option<[f32; 3]>,
    transmitted: Option<[f32; 3]>,
    noise: Option<[f32; 3]>,
    mirror: Option<[f32; 3]>,
    #[serde(default)]
    physical: bool,
    #[serde(default = "ones2")]
    uv_scale: [f32; 2],
    #[serde(default)]
    displacement: f32,
}

/// An asset of a material: a number on the command line, from 0, or a file.
#[derive(Deserialize)]
#[serde(untagged)]
enum AssetEntry {
    Number(usize),
    Path(String),
}

/// The materials of a scene file by name.
pub(super) struct Materials<'a> {
    by_name: BTreeMap<&'a str, Material>,
    /// Names of those with `physical = true`.
    physical: Vec<&'a str>,
}

impl<'a> Materials<'a> {
    /// Reads all materials with the assets and leaves that they name, which are appended to `shown`.
    ///
    /// # Errors
    /// [`ViewerError::Scene`] for a material that is there twice, contradicts itself or is out of range; the error of
    /// an asset or a leaf.
    pub(super) fn read(
        entries: &'a [MaterialEntry],
        source: Source,
        shown: &mut Shown,
    ) -> Result<Materials<'a>, ViewerError> {
        let named = shown.assets.len();
        let mut by_name = BTreeMap::new();
        for entry in entries {
            let material = entry.material(named, source, shown)?;
            if by_name.insert(entry.name.as_str(), material).is_some() {
                return Err(source.fault(format!("material '{}' is there twice", entry.name)));
            }
        }
        let physical = entries.iter().filter(|entry| entry.physical).map(|entry| entry.name.as_str()).collect();
        Ok(Materials { by_name, physical })
    }

    /// Returns the material of a name.
    ///
    /// # Errors
    /// [`ViewerError::Scene`] where the file has none.
    pub(super) fn find(&self, name: &str, source: Source) -> Result<Material, ViewerError> {
        let missing = || source.fault(format!("there is no [[material]] with name = \"{name}\""));
        self.by_name.get(name).copied().ok_or_else(missing)
    }

    /// Tells whether a material is repeated so often that it has the size that its asset tells.
    pub(super) fn is_physical(&self, name: &str) -> bool {
        self.physical.contains(&name)
    }
}

impl MaterialEntry {
    /// Makes the material; its asset and its leaf are appended to `shown`, the first `named` assets of which are those
    /// of the command line.
    fn material(&self, named: usize, source: Source, shown: &mut Shown) -> Result<Material, ViewerError> {
        let asset = self.asset_number(named, source, shown)?;
        self.check_kind(asset, source)?;
        let mirror = self.mirror.unwrap_or([0.0; 3]);
        if !mirror.iter().all(|x| (0.0..=1.0).contains(x)) {
            return Err(source.fault(format!("material '{}' has a mirror that is not 0 to 1", self.name)));
        }
        let body = match (asset, &self.leaf) {
            (Some(asset), _) => Body::Asset(asset),
            (None, Some(file)) => {
                shown.leaves.push(SceneLeaf::load(&source.beside(file))?);
                Body::Leaf(shown.leaves.len() - 1)
            }
            // What is a mirror and nothing else shows nothing below it.
            (None, None) => Body::Plain(DiffuseColour {
                reflectance: self.diffuse.unwrap_or([0.0; 3]),
                transmittance: self.transmitted.unwrap_or([0.0; 3]),
            }),
        };
        let material = Material {
            mirror,
            displacement: self.displacement,
            noise: self.noise,
            ..Material::new(body, self.uv_scale)
        };
        self.check_numbers(&material, source)?;
        Ok(material)
    }

    /// Returns the number of the material's asset in `shown`; a file is loaded where it was not named before.
    fn asset_number(&self, named: usize, source: Source, shown: &mut Shown) -> Result<Option<usize>, ViewerError> {
        match &self.asset {
            None => Ok(None),
            Some(AssetEntry::Number(number)) if *number < named => Ok(Some(*number)),
            Some(AssetEntry::Number(number)) => Err(source
                .fault(format!("material '{}' names asset {number}, but the command line has {named}", self.name))),
            Some(AssetEntry::Path(file)) => {
                let file = source.beside(file);
                let known = shown.assets.iter().position(|asset| asset.path.as_ref() == Some(&file));
                if known.is_none() {
                    shown.assets.push(Arc::new(SceneAsset::load(&file)?));
                }
                Ok(known.or(Some(shown.assets.len() - 1)))
            }
        }
    }

    /// Checks that the material is of one kind.
    fn check_kind(&self, asset: Option<usize>, source: Source) -> Result<(), ViewerError> {
        let kinds = [asset.is_some(), self.leaf.is_some(), self.diffuse.is_some()];
        match kinds.into_iter().filter(|is_there| *is_there).count() {
            0 if self.mirror.is_none() => {
                Err(source.fault(format!("material '{}' needs asset, leaf, diffuse or mirror", self.name)))
            }
            0 | 1 => Ok(()),
            _ => Err(source
                .fault(format!("material '{}' has more than one of asset, leaf and diffuse, leave one", self.name))),
        }
    }

    /// Checks that the material's numbers are within their ranges.
    fn check_numbers(&self, material: &Material, source: Source) -> Result<(), ViewerError> {
        if let (Some(passed), diffuse) = (self.transmitted, self.diffuse) {
            let fits = |(passed, diffuse): (f32, f32)| (0.0..=1.0).contains(&passed) && passed + diffuse <= 1.0;
            if !diffuse.is_some_and(|diffuse| passed.into_iter().zip(diffuse).all(fits)) {
                return Err(source.fault(format!(
                    "material '{}' has transmitted, which needs diffuse beside it and is 0 to 1 together with that",
                    self.name
                )));
            }
        }
        if let Some(noise) = self.noise {
            let passed = self.transmitted.unwrap_or_default();
            let fits = |c: usize, diffuse: [f32; 3]| {
                (0.0..=2.0).contains(&noise[c]) && (0.0..=1.0).contains(&(diffuse[c] * noise[c] + passed[c]))
            };
            if !self.diffuse.is_some_and(|diffuse| (0..3).all(|c| fits(c, diffuse))) {
                return Err(source.fault(format!(
                    "material '{}' has noise, which needs diffuse beside it; it is 0 to 2, and diffuse times noise at most 1",
                    self.name
                )));
            }
        }
        if !(material.displacement.is_finite() && material.displacement >= 0.0) {
            return Err(source.fault(format!("material '{}' needs a displacement of at least 0", self.name)));
        }
        if material.displacement > 0.0 && !material.uv_scale.iter().all(|scale| *scale > 0.0) {
            return Err(
                source.fault(format!("material '{}' has a displacement, so its uv_scale must be above 0", self.name))
            );
        }
        if !self.diffuse.iter().flatten().chain(&material.uv_scale).all(|x| x.is_finite()) {
            return Err(source.fault(format!("material '{}' has a number that is not finite", self.name)));
        }
        Ok(())
    }
}

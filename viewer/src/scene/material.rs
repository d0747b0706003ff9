//! What surfaces are made of, and what their materials show.

use crate::scene::asset::SceneAsset;
use crate::scene::leaf::SceneLeaf;
use crate::scene::mesh::MeshPart;
use btf_models::DiffuseColour;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Assets and live leaves that a scene's materials refer to by index.
#[derive(Debug, Clone, Default)]
pub struct Shown {
    /// Packed assets.
    pub assets: Vec<Arc<SceneAsset>>,
    /// Leaves.
    pub leaves: Vec<SceneLeaf>,
}

impl From<Vec<Arc<SceneAsset>>> for Shown {
    fn from(assets: Vec<Arc<SceneAsset>>) -> Shown {
        Shown { assets, leaves: Vec::new() }
    }
}

impl Shown {
    /// Returns all bodies in order: assets, then leaves.
    pub(crate) fn bodies(&self) -> Vec<Body> {
        (0..self.assets.len()).map(Body::Asset).chain((0..self.leaves.len()).map(Body::Leaf)).collect()
    }

    /// Tells whether a body is plain or one of these assets and leaves.
    pub(crate) fn has(&self, body: Body) -> bool {
        match body {
            Body::Plain(_) => true,
            Body::Asset(asset) => asset < self.assets.len(),
            Body::Leaf(leaf) => leaf < self.leaves.len(),
        }
    }

    /// Returns how often the picture of a body fits into a millimetre, along u and v.
    pub(crate) fn tiles_per_mm(&self, body: Body) -> [f32; 2] {
        match body {
            Body::Plain(_) => [1.0; 2],
            Body::Asset(asset) => self.assets[asset].tiles_per_mm(),
            Body::Leaf(leaf) => [1.0 / self.leaves[leaf].description.size_mm as f32; 2],
        }
    }

    /// Adds what a file's own materials show, whose numbers in `bodies` are then those of this.
    pub(crate) fn append(&mut self, own: OwnBodies) -> BTreeMap<usize, Body> {
        let (assets, leaves) = (self.assets.len(), self.leaves.len());
        self.assets.extend(own.shown.assets);
        self.leaves.extend(own.shown.leaves);
        let moved = |body| match body {
            Body::Plain(_) => body,
            Body::Asset(asset) => Body::Asset(asset + assets),
            Body::Leaf(leaf) => Body::Leaf(leaf + leaves),
        };
        own.bodies.into_iter().map(|(group, body)| (group, moved(body))).collect()
    }
}

/// Assets and leaves of a file, and the bodies of its materials that use them.
#[derive(Debug, Clone, Default)]
pub struct OwnBodies {
    /// Assets and leaves of the file.
    pub shown: Shown,
    /// By number of the material, which is a part's group.
    pub bodies: BTreeMap<usize, Body>,
}

/// What reflects and transmits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Body {
    /// A diffuse surface.
    Plain(DiffuseColour),
    /// Index into [`Shown::assets`].
    Asset(usize),
    /// Index into [`Shown::leaves`].
    Leaf(usize),
}

/// Octaves of the noise of plain bodies: a unit of the texture is halved 13 times.
pub(crate) const NOISE_OCTAVES: u32 = 14;

/// Material of a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// What reflects and transmits.
    pub body: Body,
    /// Factors on what an asset, or a leaf without its gloss, reflects and transmits; a plain body has its own colour.
    pub tint: [f32; 3],
    /// Reflectance of a perfect mirror on top, RGB, 0 to 1; 0 for none. It adds to what lies below.
    pub mirror: [f32; 3],
    /// Factors on the texture coordinates: how often the asset is repeated.
    pub uv_scale: [f32; 2],
    /// What the asset's heights are multiplied by where they displace the surface: 1 as they are, 0 for none. The mesh
    /// is where the highest point lies.
    pub displacement: f32,
    /// Factors on what a plain body reflects where a fractal noise over the texture coordinates is 1, 0 to 2 in steps of
    /// 1/127; where it is 0, the colour is its own. `None` where the colour is even.
    pub noise: Option<[f32; 3]>,
}

impl Material {
    /// Makes a material without a mirror.
    pub fn new(body: Body, uv_scale: [f32; 2]) -> Material {
        Material { body, tint: [1.0; 3], mirror: [0.0; 3], uv_scale, displacement: 0.0, noise: None }
    }

    /// Makes a material that shows asset number `asset`.
    pub fn from_asset(asset: usize, uv_scale: [f32; 2]) -> Material {
        Material::new(Body::Asset(asset), uv_scale)
    }

    /// Makes an opaque diffuse material of a linear sRGB reflectance, 0 to 1.
    pub fn plain(reflectance: [f32; 3]) -> Material {
        Material::diffuse(DiffuseColour::opaque(reflectance))
    }

    /// Makes a diffuse material.
    pub fn diffuse(colour: DiffuseColour) -> Material {
        Material::new(Body::Plain(colour), [1.0; 2])
    }

    /// Makes the material of a part of a file: `body`, if the part has texture coordinates, else plain in its own
    /// colour.
    pub(crate) fn of_part(part: &MeshPart, body: Option<Body>, uv_scale: [f32; 2]) -> Material {
        match body {
            Some(body) if part.has_uv => Material::new(body, uv_scale),
            _ => Material::diffuse(part.colour),
        }
    }

    /// Returns the material with its body's colour times `tint`; a plain one never sends on more than all light.
    pub(crate) fn tinted(self, tint: [f32; 3]) -> Material {
        match self.body {
            Body::Plain(colour) => Material { body: Body::Plain(colour.tinted(tint)), ..self },
            _ => Material { tint: std::array::from_fn(|i| self.tint[i] * tint[i]), ..self },
        }
    }

    /// Returns the number of the asset that the material shows.
    pub fn asset(&self) -> Option<usize> {
        match self.body {
            Body::Asset(asset) => Some(asset),
            _ => None,
        }
    }
}

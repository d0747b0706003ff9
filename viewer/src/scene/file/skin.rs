//! `[[skin]]` of a scene file: thick skins with volumetric textures.

use super::defaults::{ones2, ones3};
use super::volume::VolumeFiles;
use crate::error::ViewerError;
use crate::scene::mesh_file::FileMesh;
use crate::scene::volume::AS_IT_IS;
use crate::volume::skin::{
    DiscreteJitter, Jitter, MAX_MERGED, Merged, NO_VOLUME, Noise, Pattern, ShellParams, Skin, SkinVertex,
};
use crate::volume::volumes::SceneSkin;
use glam::{Mat4, Vec3};
use serde::Deserialize;

/// Largest factor of a tint: from black to white.
const MAX_TINT: f32 = 1e3;
/// How far the texture may lie from where it belongs, voxels of the finest volume.
const TOLERANCE_VOXELS: f32 = 0.5;

/// `[[skin]]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SkinEntry {
    pub mesh: Option<String>,
    patches: Option<[u32; 2]>,
    height: f32,
    #[serde(default)]
    lean: [f32; 3],
    #[serde(default = "ones2")]
    uv_scale: [f32; 2],
    #[serde(default)]
    pub translate: [f32; 3],
    #[serde(default)]
    pub rotate_deg: [f32; 3],
    #[serde(default = "ones3")]
    pub scale: [f32; 3],
    volumes: Vec<Alternative>,
    #[serde(default = "no_tint")]
    tints: Vec<[f32; 3]>,
    jitter: Option<JitterEntry>,
    texels: Option<TexelsEntry>,
}

fn no_tint() -> Vec<[f32; 3]> {
    vec![AS_IT_IS]
}

/// What may be in a texel: a volume, or several at once.
#[derive(Deserialize)]
#[serde(untagged)]
enum Alternative {
    One(String),
    Merged(Vec<String>),
}

/// `jitter` of a `[[skin]]`, see [`Jitter`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JitterEntry {
    wavelength: f32,
    #[serde(default)]
    coordinates: f32,
    #[serde(default)]
    length: f32,
    #[serde(default)]
    angle_deg: f32,
    #[serde(default)]
    seed: u32,
}

/// `texels` of a `[[skin]]`, see [`DiscreteJitter`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TexelsEntry {
    #[serde(default)]
    empty: f32,
    #[serde(default = "ones2")]
    scale: [f32; 2],
    #[serde(default)]
    displacement: f32,
    #[serde(default)]
    margin: f32,
    #[serde(default)]
    turns: bool,
    #[serde(default)]
    mirrors: bool,
    #[serde(default)]
    seed: u32,
}

impl SkinEntry {
    /// Makes the skin with its volumes, over `meshes` where it names one.
    ///
    /// # Errors
    /// A sentence for what is out of range; the errors of a volume's file.
    pub(crate) fn skin(
        &self,
        meshes: Vec<FileMesh>,
        world_from_skin: Mat4,
        files: &mut VolumeFiles,
    ) -> Result<SceneSkin, ViewerError> {
        let pattern = self.pattern(files)?;
        let used = pattern.alternatives.as_flattened().iter().filter(|volume| **volume != NO_VOLUME);
        let finest = used.map(|volume| files.finest_level(*volume as usize)).max().unwrap_or(0);
        let fault = |reason: String| files.fault(format!("a [[skin]] cannot be made: {reason}"));
        pattern.check().map_err(fault)?;
        let skin = self.mapped(meshes, world_from_skin).map_err(fault)?;
        let tolerance = TOLERANCE_VOXELS / (1u32 << finest) as f32;
        SceneSkin::new(skin, &ShellParams { tolerance, ..ShellParams::default() }, vec![pattern], 0.0).map_err(fault)
    }

    fn pattern(&self, files: &mut VolumeFiles) -> Result<Pattern, ViewerError> {
        if self.tints.is_empty() || !self.tints.as_flattened().iter().all(|x| (0.0..=MAX_TINT).contains(x)) {
            return Err(files.fault(format!("a [[skin]]'s tints are factors from 0 to {MAX_TINT}, one tint at least")));
        }
        let mut alternatives = Vec::new();
        for entry in &self.volumes {
            let names = match entry {
                Alternative::One(name) => std::slice::from_ref(name),
                Alternative::Merged(names) => names,
            };
            if names.len() > MAX_MERGED {
                return Err(files.fault(format!(
                    "a [[skin]] merges {} volumes in one texel, and {MAX_MERGED} are allowed",
                    names.len()
                )));
            }
            for tint in &self.tints {
                let mut merged: Merged = [NO_VOLUME; MAX_MERGED];
                for (place, name) in merged.iter_mut().zip(names) {
                    *place = files.number(name, *tint)? as u32;
                }
                alternatives.push(merged);
            }
        }
        let jitter = self.texels.as_ref().map(|texels| DiscreteJitter {
            empty: texels.empty,
            scale: texels.scale,
            displacement: texels.displacement,
            margin: texels.margin,
            turns: texels.turns,
            mirrors: texels.mirrors,
        });
        let seed = self.texels.as_ref().map_or(0, |texels| texels.seed);
        Ok(Pattern { alternatives, jitter, seed, cells: None })
    }

    /// Makes the skin in the world, jittered.
    fn mapped(&self, meshes: Vec<FileMesh>, world_from_skin: Mat4) -> Result<Skin, String> {
        let straight = match (self.patches, meshes.is_empty()) {
            (Some(patches), true) => self.over_patches(patches, world_from_skin)?,
            (None, false) => self.over_mesh(meshes, world_from_skin)?,
            _ => return Err("it needs either mesh or patches, give one".into()),
        };
        let lean = Vec3::from(self.lean) * self.height;
        let skin = straight.with_vertices(|vertex| SkinVertex {
            height: vertex.height + lean,
            texture: vertex.texture * Vec3::new(self.uv_scale[0], self.uv_scale[1], 1.0),
            ..*vertex
        });
        // Once more, since what leans may have lost its volume.
        let skin = Skin::new(skin.vertices().to_vec(), skin.faces().to_vec())?;
        match &self.jitter {
            None => Ok(skin),
            Some(JitterEntry { wavelength, coordinates, length, angle_deg, seed }) => {
                let noise = Noise { wavelength: *wavelength, period: [0; 3], seed: *seed };
                Jitter { noise, coordinates: *coordinates, length: *length, angle_deg: *angle_deg }.apply(&skin)
            }
        }
    }

    /// Makes unit patches on the floor about the origin; u grows with x, v against z.
    fn over_patches(&self, [columns, rows]: [u32; 2], world_from_skin: Mat4) -> Result<Skin, String> {
        let up = world_from_skin.inverse().transpose().transform_vector3(Vec3::Y).normalize_or_zero() * self.height;
        let vertex = |column: u32, row: u32| {
            let [u, v] = [column as f32, row as f32];
            let place = Vec3::new(u - 0.5 * columns as f32, 0.0, 0.5 * rows as f32 - v);
            SkinVertex::new(world_from_skin.transform_point3(place), up, [u, v])
        };
        Skin::from_grid(columns, rows, vertex, |_, _| 0)
    }

    fn over_mesh(&self, meshes: Vec<FileMesh>, world_from_skin: Mat4) -> Result<Skin, String> {
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for FileMesh { parts, places } in meshes {
            if let Some(part) = parts.iter().find(|part| !part.has_uv) {
                return Err(format!("the part '{}' has no texture coordinates, export it with them", part.name));
            }
            for place in places {
                for mut part in parts.clone() {
                    part.transform(world_from_skin * place);
                    let first = vertices.len() as u32;
                    triangles.extend(part.triangles.iter().map(|corners| corners.map(|corner| first + corner)));
                    vertices.append(&mut part.vertices);
                }
            }
        }
        Skin::from_mesh(&vertices, &triangles, self.height, 0)
    }
}

//! `[[object]]` of a scene file, and the materials of meshes.

use super::defaults::ones3;
use super::material::Materials;
use super::mesh_name::{BUILT_IN_MESHES, meshes_of};
use super::source::Source;
use super::transform::world_from_entry;
use super::volume::Model;
use crate::error::ViewerError;
use crate::scene::gltf_asset::own_bodies;
use crate::scene::material::{Body, Material, OwnBodies, Shown};
use crate::scene::mesh::MeshPart;
use crate::scene::mesh_file::FileMesh;
use crate::scene::scene::{SceneMesh, SceneObject};
use glam::Mat4;
use serde::Deserialize;
use std::collections::BTreeMap;

/// `[[object]]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectEntry {
    mesh: String,
    material: Option<String>,
    #[serde(default)]
    parts: BTreeMap<String, String>,
    #[serde(default)]
    translate: [f32; 3],
    #[serde(default)]
    rotate_deg: [f32; 3],
    #[serde(default = "ones3")]
    scale: [f32; 3],
}

/// Gives the parts of meshes their materials.
pub(super) struct Dresser<'a> {
    pub source: Source<'a>,
    pub materials: &'a Materials<'a>,
    /// Millimetres of a unit, where the file tells them.
    pub unit_mm: Option<f32>,
    /// What materials show; what the materials of a glTF file point at is appended.
    pub shown: &'a mut Shown,
}

/// Which materials the parts of a mesh have.
struct Dress<'a> {
    /// The mesh as the scene file names it.
    mesh: &'a str,
    /// The material of parts that have no other one.
    material: Option<&'a String>,
    /// Materials by name of the part.
    parts: &'a BTreeMap<String, String>,
}

impl Dresser<'_> {
    /// Loads the objects. The first mesh holds all objects that stand once, in the coordinates of the world; the others
    /// stand more often.
    ///
    /// # Errors
    /// [`ViewerError::Scene`] for a part or a material that is not there and for an object without volume; the error of
    /// a mesh's file.
    pub(super) fn objects(&mut self, entries: &[ObjectEntry]) -> Result<Vec<SceneMesh>, ViewerError> {
        let (mut objects, mut meshes) = (Vec::new(), Vec::new());
        for entry in entries {
            let mut own_meshes = meshes_of(&entry.mesh, self.source)?;
            let matrix = world_from_entry(entry.scale, entry.rotate_deg, entry.translate)
                .ok_or_else(|| self.source.fault(format!("object '{}' is flattened by its scale", entry.mesh)))?;
            own_meshes.iter_mut().for_each(|mesh| mesh.moved(matrix));
            let dress = Dress { mesh: &entry.mesh, material: entry.material.as_ref(), parts: &entry.parts };
            for mesh in self.dressed(own_meshes, &dress)? {
                match mesh.places.len() {
                    1 => objects.extend(mesh.objects),
                    _ => meshes.push(mesh),
                }
            }
        }
        if !objects.is_empty() {
            meshes.insert(0, SceneMesh { objects, places: vec![Mat4::IDENTITY] });
        }
        Ok(meshes)
    }

    /// Gives a model that volumes stand in for its materials.
    ///
    /// # Errors
    /// The errors of [`Dresser::objects`].
    pub(super) fn model(&mut self, model: Model) -> Result<Vec<SceneMesh>, ViewerError> {
        self.dressed(model.meshes, &Dress { mesh: model.file, material: model.material, parts: model.parts })
    }

    fn dressed(&mut self, own_meshes: Vec<FileMesh>, dress: &Dress) -> Result<Vec<SceneMesh>, ViewerError> {
        let parts = || own_meshes.iter().flat_map(|mesh| &mesh.parts);
        if let Some(missing) = dress.parts.keys().find(|name| parts().all(|part| part.name != **name)) {
            return Err(self.source.fault(format!("object '{}' has no part called '{missing}'", dress.mesh)));
        }
        let own = match BUILT_IN_MESHES.contains(&dress.mesh) || dress.material.is_some() {
            true => OwnBodies::default(),
            false => own_bodies(&self.source.beside(dress.mesh))?,
        };
        let bodies = self.shown.append(own);
        let mut meshes = Vec::new();
        for FileMesh { parts, places } in own_meshes {
            let mut objects = Vec::new();
            for mut part in parts {
                let name = dress.parts.get(&part.name).or(dress.material);
                let material = match name {
                    Some(name) => self.materials.find(name, self.source)?,
                    None => Material::of_part(&part, bodies.get(&part.group).copied(), [1.0; 2]),
                };
                if name.is_some_and(|name| self.materials.is_physical(name)) {
                    self.scale_to_size(&mut part, &material, places[0])?;
                }
                objects.push(SceneObject { part, material });
            }
            meshes.push(SceneMesh { objects, places });
        }
        Ok(meshes)
    }

    /// Scales the texture coordinates of a part so that its material has the size that it tells. A part that stands in
    /// several places has that size in the first of them.
    fn scale_to_size(&self, part: &mut MeshPart, material: &Material, first_place: Mat4) -> Result<(), ViewerError> {
        if matches!(material.body, Body::Plain(_)) {
            return Ok(());
        }
        let unit_mm = self
            .unit_mm
            .filter(|unit| unit.is_finite() && *unit > 0.0)
            .ok_or_else(|| self.source.fault("a material is physical, but unit_mm does not tell the size of a unit"))?;
        let size = first_place.determinant().abs().cbrt();
        let tile_mm = part.tile_length().unwrap_or(1.0) * size * unit_mm;
        part.scale_uv(self.shown.tiles_per_mm(material.body).map(|tiles| tiles * tile_mm));
        Ok(())
    }
}

//! Models of plants: the meshes that a landscape's volumes stand in for.

use super::planted::Plant;
use super::stand_ins::plant_places;
use crate::error::ViewerError;
use crate::scene::gltf_asset::own_bodies;
use crate::scene::material::{Material, Shown};
use crate::scene::mesh::MeshPart;
use crate::scene::mesh_file::load_meshes;
use crate::scene::scene::SceneMesh;
use crate::scene::volume::{standing, usual_leaf_width_m};
use crate::volume::skin::{Pattern, Shell, SkinPlace};
use btf_runtime::voltex::Voltex;
use glam::{Mat4, Quat, Vec3};
use std::path::PathBuf;
use std::sync::Arc;

/// The land that models are placed on.
pub(super) struct Land<'a> {
    pub volumes: &'a [Arc<Voltex>],
    /// Finest level of each volume's file, counted from the coarsest.
    pub finest_levels: &'a [u32],
    pub shell: &'a Shell,
    pub patterns: &'a [Pattern],
}

/// Models of plants, placed.
#[derive(Default)]
pub(super) struct Models {
    /// A mesh for each part of a model and each tint, with all its places.
    pub meshes: Vec<SceneMesh>,
    /// What the models' own materials show.
    pub shown: Shown,
    /// Width of the leaves where they are widest, metres; 0 without models.
    pub leaf_width: f32,
    /// Where each instance of the meshes stands in the skin.
    pub stand_ins: Vec<SkinPlace>,
}

/// Places the models of `files`, one for each of `plants` or none, wherever the skin has the plants' volumes.
///
/// # Errors
/// Those of a model's file.
pub(super) fn place_models(files: &[PathBuf], plants: &[Plant], land: &Land) -> Result<Models, ViewerError> {
    let mut models = Models::default();
    let Land { volumes, finest_levels, shell, patterns } = *land;
    for (file, Plant { volume, scale, foot_m, tints }) in files.iter().zip(plants) {
        let voltex = &volumes[*volume as usize];
        let own = load_meshes(file)?;
        let bodies = models.shown.append(own_bodies(file)?);
        models.leaf_width =
            models.leaf_width.max(usual_leaf_width_m(voltex, finest_levels[*volume as usize], &own) * scale);
        let volume_from_model = standing(voltex, Vec3::ZERO, 0.0, 1.0).inverse()
            * Mat4::from_scale_rotation_translation(Vec3::splat(*scale), Quat::IDENTITY, *foot_m);
        let places = plant_places(shell, patterns, volume_from_model.transform_point3(Vec3::ZERO));
        // A volume in several tints is as many volumes.
        for (tinted, tint) in (*volume..).zip(*tints) {
            let here =
                || places.iter().filter(|(own, _)| *own == tinted).map(|(_, place)| place.with(volume_from_model));
            for mut mesh in own.clone() {
                let parts: Vec<SkinPlace> =
                    here().flat_map(|plant| mesh.places.iter().map(move |part| plant.with(*part))).collect();
                mesh.places = parts.iter().map(|part| part.world_from_object(shell)).collect();
                models.stand_ins.extend(parts);
                let body = |part: &MeshPart| bodies.get(&part.group).copied();
                let material = |part: &MeshPart| Material::of_part(part, body(part), [1.0; 2]).tinted(*tint);
                models.meshes.push(SceneMesh::of_file(mesh, material));
            }
        }
    }
    Ok(models)
}

//! A model's meshes in the open, as many as asked for: what drawing is measured by.

use crate::error::ViewerError;
use crate::scene::builtin;
use crate::scene::camera::Camera;
use crate::scene::gltf_asset::own_bodies;
use crate::scene::material::{Body, Material, Shown};
use crate::scene::mesh::MeshPart;
use crate::scene::mesh_file::{FileMesh, load_meshes};
use crate::scene::scene::{Scene, SceneMesh};
use btf_models::DiffuseColour;
use glam::{Mat4, Vec3};
use std::path::Path;

/// Field of view, degrees.
const FIELD_OF_VIEW_DEG: f32 = 40.0;
/// The camera looks down by this share of the way to the ground.
const LOOK_DOWN: f32 = 0.55;
/// Plants along a side of the field of plants that is repeated.
const FIELD_SIDE: usize = 4;
/// Distance between the rows of plants, and between plants in a row, metres: those of maize.
const ROW_SPACING_M: f32 = 0.75;
const PLANT_SPACING_M: f32 = 0.2;
/// Turn from a plant to the next, radians.
const PLANT_TURN_RAD: f32 = 2.1;
/// Linear sRGB reflectance and transmittance of a green leaf, about.
const LEAF_REFLECTANCE: [f32; 3] = [0.05, 0.11, 0.03];
const LEAF_TRANSMITTANCE: [f32; 3] = [0.04, 0.1, 0.02];

/// Makes a scene of the meshes of the file at `path` with what its materials show, the file's whole world repeated side
/// by side, of which those placements nearest to the middle are kept that have about `triangles` triangles together (at
/// least one). The camera sees them all from above.
///
/// # Errors
/// The errors of [`load_meshes`] and [`Scene::from_meshes`].
pub fn instanced_scene(path: &Path, triangles: u64) -> Result<Scene, ViewerError> {
    let mut shown = Shown::default();
    let bodies = shown.append(own_bodies(path)?);
    let material = |part: &MeshPart| Material::of_part(part, bodies.get(&part.group).copied(), [1.0; 2]);
    repeated(path, load_meshes(path)?, shown, &material, triangles)
}

/// Makes such a scene of the plant that comes with the viewer, diffuse sheets in the colours of a green leaf.
///
/// # Errors
/// The errors of [`Scene::from_meshes`].
pub fn instanced_plants(triangles: u64) -> Result<Scene, ViewerError> {
    let place = |number: usize| {
        let [column, row] = [number % FIELD_SIDE, number / FIELD_SIDE].map(|x| x as f32);
        let at = Vec3::new(ROW_SPACING_M * column, 0.0, PLANT_SPACING_M * row);
        Mat4::from_translation(at) * Mat4::from_rotation_y(PLANT_TURN_RAD * number as f32)
    };
    let places = (0..FIELD_SIDE * FIELD_SIDE).map(place).collect();
    let field = FileMesh { parts: builtin::plant(), places };
    let green = DiffuseColour { reflectance: LEAF_REFLECTANCE, transmittance: LEAF_TRANSMITTANCE };
    let material = |_: &MeshPart| Material::new(Body::Plain(green), [1.0; 2]);
    repeated(Path::new("plant"), vec![field], Shown::default(), &material, triangles)
}

/// Repeats the world of `meshes` as [`instanced_scene`] says.
fn repeated(
    origin: &Path,
    meshes: Vec<FileMesh>,
    shown: Shown,
    material: &dyn Fn(&MeshPart) -> Material,
    triangles: u64,
) -> Result<Scene, ViewerError> {
    let counts: Vec<u64> =
        meshes.iter().map(|mesh| mesh.parts.iter().map(|part| part.triangles.len() as u64).sum()).collect();
    let once: u64 = meshes.iter().zip(&counts).map(|(mesh, count)| mesh.places.len() as u64 * count).sum();
    let [width, depth] = extent(&meshes);
    // An odd number of tiles on a side, so that one is in the middle.
    let tiles = (triangles as f64 / once.max(1) as f64).sqrt().ceil().max(1.0) as i32 | 1;
    let mut all: Vec<(usize, Mat4)> = Vec::new();
    for row in -(tiles / 2)..=tiles / 2 {
        for column in -(tiles / 2)..=tiles / 2 {
            let tile = Mat4::from_translation(Vec3::new(column as f32 * width, 0.0, row as f32 * depth));
            let placed = |(number, mesh): (usize, &FileMesh)| -> Vec<(usize, Mat4)> {
                mesh.places.iter().map(|place| (number, tile * *place)).collect()
            };
            all.extend(meshes.iter().enumerate().flat_map(placed));
        }
    }
    let away = |place: &Mat4| place.w_axis.x.hypot(place.w_axis.z);
    all.sort_by(|(_, a), (_, b)| away(a).total_cmp(&away(b)));
    let mut sum = 0;
    let mut kept = 0;
    while kept < all.len() && sum < triangles {
        sum += counts[all[kept].0];
        kept += 1;
    }
    let of_mesh = |(number, mesh): (usize, FileMesh)| {
        let places = all[..kept].iter().filter(|(mesh, _)| *mesh == number).map(|(_, place)| *place).collect();
        SceneMesh::of_file(FileMesh { places, ..mesh }, material)
    };
    let mut scene = Scene::from_meshes(origin, meshes.into_iter().enumerate().map(of_mesh).collect(), shown)?;
    let (centre, radius) = scene.geometry.bounding_sphere();
    scene.camera = Camera::framing(centre, 0.7 * radius, Vec3::new(0.0, LOOK_DOWN, 1.0), FIELD_OF_VIEW_DEG);
    Ok(scene)
}

/// Returns how far the file's world reaches along x and z.
fn extent(meshes: &[FileMesh]) -> [f32; 2] {
    let (mut lo, mut hi) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for mesh in meshes {
        for place in &mesh.places {
            let at = place.w_axis.truncate();
            (lo, hi) = (lo.min(at), hi.max(at));
        }
    }
    let placed: usize = meshes.iter().map(|mesh| mesh.places.len()).sum();
    // Of what stands on a grid of so many places, one step more; of one mesh its own size.
    let size = (hi - lo).max(Vec3::ZERO);
    let step = 1.0 + 1.0 / (placed.max(2) as f32).sqrt();
    let own = |axis: usize| {
        let reach = meshes.iter().flat_map(|mesh| &mesh.parts).flat_map(|part| &part.vertices);
        let (least, most) =
            reach.map(|vertex| vertex.position[axis]).fold((f32::MAX, f32::MIN), |(a, b), x| (a.min(x), b.max(x)));
        most - least
    };
    [0, 2].map(|axis| (size[axis] * step).max(own(axis)).max(1e-3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plants_are_repeated_as_files_are() {
        let scene = instanced_plants(1_000_000).unwrap();
        let has = scene.geometry.placed_triangles();
        assert!((1_000_000..1_010_000).contains(&has), "{has}");
        assert!(scene.geometry.instances().len() > 300 && scene.assets.is_empty());
    }

    #[test]
    fn has_as_many_triangles_as_asked_for_and_no_two_in_one_place() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("two.obj");
        std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n").unwrap();
        for asked in [1, 2, 50, 1000] {
            let scene = instanced_scene(&path, asked).unwrap();
            let has = scene.geometry.placed_triangles();
            assert!(has >= asked && has < asked + 2, "{has} for {asked}");
            assert_eq!(scene.geometry.triangles().len(), 2);
            let mut at: Vec<[u32; 2]> = scene
                .geometry
                .instances()
                .iter()
                .map(|instance| {
                    [instance.world_from_object[0][3].to_bits(), instance.world_from_object[2][3].to_bits()]
                })
                .collect();
            at.sort_unstable();
            at.dedup();
            assert_eq!(at.len(), scene.geometry.instances().len());
        }
    }
}

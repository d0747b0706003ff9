//! A cell of a canopy that repeats without end along x and z, over flat soil at y = 0.

use crate::error::ViewerError;
use crate::geometry::bvh::{AnyHit, Hit, NO_HIT};
use crate::geometry::geometry::{Geometry, Mesh, Placement, Triangle, Vertex};
use crate::geometry::surface::corners_of;
use crate::sampler;
use crate::scene::mesh::MeshPart;
use crate::scene::mesh_file::{FileMesh, load_meshes};
use glam::{Mat4, Vec3};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f32::consts::TAU;
use std::path::Path;

/// Cells that a ray passes at most before it counts as lost: only rays along the soil get there.
const MAX_CELLS: usize = 10_000;
/// Number of a triangle that belongs to no leaf.
const NO_LEAF: u32 = u32::MAX;
/// Part of the cell's greatest length by which rays start beside a surface.
const OFFSET: f32 = 2e-5;
/// Names of the parts that are soil, which the cell has of itself.
const GROUND: [&str; 2] = ["ground", "soil"];

/// What a surface of plants is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Organ {
    /// A leaf, which transmits; its upper face is the one that its triangles wind counterclockwise.
    Leaf,
    /// Stems, bark, flowers and fruits, which do not.
    Other,
}

/// Plants in a cell.
#[derive(Debug)]
pub struct CanopyCell {
    geometry: Geometry,
    /// Corner of the least x and z, and the lengths along both, in metres.
    low_m: [f32; 2],
    size_m: [f32; 2],
    top_m: f32,
    /// Leaf of each triangle within its mesh, or [`NO_LEAF`].
    leaf_of_triangle: Vec<u32>,
    /// Leaves of each mesh.
    leaves_of_mesh: Vec<u32>,
    /// Placements as the file has them, without the repetitions: mesh and place.
    plants: Vec<Placement>,
    /// First leaf of each of `plants`.
    first_leaf: Vec<u32>,
    /// Number in `plants` of each placement that the geometry has.
    plant_of_placement: Vec<u32>,
}

/// The end of a ray.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Met {
    Surface(Surface),
    /// The place on the soil.
    Soil(Vec3),
    /// The ray left upwards.
    Sky,
    /// The ray passed more cells than are followed.
    Lost,
}

/// A surface of a plant that a ray met.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Surface {
    pub(crate) at: Vec3,
    /// Unit normal of the upper face.
    pub(crate) normal: Vec3,
    pub(crate) organ: Organ,
    /// Number of the leaf in the cell; meaningless for other organs.
    pub(crate) leaf: u32,
}

/// A triangle of a plant as it stands in the cell.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlacedTriangle {
    pub(crate) middle: Vec3,
    pub(crate) normal: Vec3,
    pub(crate) area_m2: f64,
    pub(crate) organ: Organ,
    pub(crate) leaf: u32,
}

impl PlacedTriangle {
    /// Returns the inclination from the horizontal in degrees, 0 to 90.
    pub(crate) fn inclination_deg(&self) -> f64 {
        f64::from(self.normal.y).abs().clamp(0.0, 1.0).acos().to_degrees()
    }
}

impl CanopyCell {
    /// Reads a canopy of a file, metres with y up. Parts whose material is named one of `leaf_names` are leaves; those named
    /// `ground` or `soil` are left out. `size_m` are the lengths of the cell along x and z about the origin.
    ///
    /// # Errors
    /// [`ViewerError::Mesh`] for a file that cannot be read, has no leaf or leaves nothing above the soil, and
    /// [`ViewerError::Usage`] for a cell without an area or one that is so small that plants repeat too often.
    pub fn load(path: &Path, leaf_names: &[String], size_m: [f64; 2]) -> Result<CanopyCell, ViewerError> {
        let meshes = load_meshes(path)?;
        CanopyCell::of_meshes(meshes, leaf_names, size_m).map_err(|sentence| ViewerError::mesh(path, sentence))
    }

    /// Strews square leaves at random with normals of all directions in a cell of `size_m`, x, y and z: what closed forms call a
    /// turbid medium with a spherical distribution of leaf angles, the nearer the smaller `side_m` is.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] for more leaves than a mesh holds, or none.
    pub fn strewn(leaf_area_index: f64, side_m: f32, size_m: [f32; 3], seed: u64) -> Result<CanopyCell, ViewerError> {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let [x, height, z] = size_m;
        let leaves = (leaf_area_index * f64::from(x * z) / f64::from(side_m * side_m)).round() as usize;
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for _ in 0..leaves {
            let mut at = || random.r#gen::<f32>();
            // All of a leaf is above the soil and below the top.
            let y = side_m + (height - 2.0 * side_m) * at();
            let middle = Vec3::new(x * (at() - 0.5), y, z * (at() - 0.5));
            let normal = sampler::sphere([at(), at()]);
            let (a, b) = normal.any_orthonormal_pair();
            let turn = at() * TAU;
            let (a, b) = (a * turn.cos() + b * turn.sin(), b * turn.cos() - a * turn.sin());
            let first = vertices.len() as u32;
            for (u, v) in [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)] {
                let position = (middle + (a * u + b * v) * side_m).to_array();
                let tangent = [1.0, 0.0, 0.0, 1.0];
                vertices.push(Vertex { position, u: 0.0, normal: normal.to_array(), v: 0.0, tangent });
            }
            triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
        let part = MeshPart::built_in("leaf", vertices, triangles);
        let mesh = FileMesh { parts: vec![part], places: vec![Mat4::IDENTITY] };
        CanopyCell::of_meshes(vec![mesh], &["leaf".into()], [x, z].map(f64::from)).map_err(ViewerError::Usage)
    }

    fn of_meshes(meshes: Vec<FileMesh>, leaf_names: &[String], size_m: [f64; 2]) -> Result<CanopyCell, String> {
        if !size_m.iter().all(|side| side.is_finite() && *side > 0.0) {
            return Err(
                "the cell has no area; give --cell its lengths along x and z in metres, such as 0.75,0.18".into()
            );
        }
        let size_m = size_m.map(|side| side as f32);
        let low_m = size_m.map(|side| -0.5 * side);
        let (mut whole, mut plants) = (Vec::new(), Vec::new());
        for mesh in meshes {
            let mut one = Mesh::default();
            for part in mesh.parts.into_iter().filter(|part| !GROUND.contains(&part.name.as_str())) {
                let organ = if leaf_names.contains(&part.name) { Organ::Leaf } else { Organ::Other };
                let first = one.vertices.len() as u32;
                one.vertices.extend(part.vertices);
                let moved = |corners: [u32; 3]| corners.map(|corner| corner + first);
                let material = u32::from(organ == Organ::Other);
                one.triangles.extend(part.triangles.iter().map(|t| Triangle { vertices: moved(*t), material }));
            }
            if !one.triangles.is_empty() {
                let place = |world_from_object| Placement { mesh: whole.len(), world_from_object };
                plants.extend(mesh.places.into_iter().map(place));
                whole.push(one);
            }
        }
        if !whole.iter().flat_map(|mesh| &mesh.triangles).any(|triangle| triangle.material == 0) {
            return Err(format!(
                "none of its materials is named {}; name the leaves' with --leaf-parts",
                leaf_names.join(" or ")
            ));
        }
        let (mut placements, mut plant_of_placement) = (Vec::new(), Vec::new());
        let mut top_m = 0f32;
        for (number, plant) in plants.iter().enumerate() {
            let [least, most] = bounds_of(&whole[plant.mesh].vertices, plant.world_from_object);
            top_m = top_m.max(most.y);
            for shift in shifts(low_m, size_m, [least, most])? {
                let world_from_object = Mat4::from_translation(shift) * plant.world_from_object;
                placements.push(Placement { mesh: plant.mesh, world_from_object });
                plant_of_placement.push(number as u32);
            }
        }
        if top_m <= 0.0 {
            return Err("nothing of it stands above the soil, which is y = 0; y is up".into());
        }
        let geometry = Geometry::placed(whole, &placements)?;
        let (leaf_of_triangle, leaves_of_mesh) = numbered_leaves(&geometry);
        let mut leaves = 0u32;
        let first_leaf = plants.iter().map(|plant| {
            leaves += leaves_of_mesh[plant.mesh];
            leaves - leaves_of_mesh[plant.mesh]
        });
        let first_leaf = first_leaf.collect();
        let top_m = top_m * (1.0 + 1e-5);
        Ok(CanopyCell {
            geometry,
            low_m,
            size_m,
            top_m,
            leaf_of_triangle,
            leaves_of_mesh,
            plants,
            first_leaf,
            plant_of_placement,
        })
    }

    /// Returns the area of the soil in square metres.
    pub fn ground_m2(&self) -> f64 {
        f64::from(self.size_m[0]) * f64::from(self.size_m[1])
    }

    /// Returns the height of the highest point above the soil in metres.
    pub fn height_m(&self) -> f64 {
        f64::from(self.top_m)
    }

    /// Returns the layer of a height, of `layers` of equal thickness from the soil up.
    pub(crate) fn layer_of(&self, y: f32, layers: usize) -> usize {
        ((f64::from(y).max(0.0) / self.height_m() * layers as f64) as usize).min(layers - 1)
    }

    /// Returns the number of plants, or of whatever the file places.
    pub fn plants(&self) -> usize {
        self.plants.len()
    }

    /// Returns the number of leaves in the cell.
    pub fn leaves(&self) -> usize {
        self.plants.iter().map(|plant| self.leaves_of_mesh[plant.mesh] as usize).sum()
    }

    /// Returns the plant that a leaf is of.
    pub(crate) fn plant_of_leaf(&self, leaf: u32) -> usize {
        self.first_leaf.partition_point(|first| *first <= leaf).max(1) - 1
    }

    /// Returns the triangles of all plants, each once.
    pub(crate) fn triangles(&self) -> impl Iterator<Item = PlacedTriangle> {
        self.plants.iter().zip(&self.first_leaf).flat_map(move |(plant, first_leaf)| {
            let range = self.geometry.meshes()[plant.mesh];
            (range.first_triangle..range.first_triangle + range.triangles).map(move |primitive| {
                let corners = self.geometry.corners(primitive).map(|at| plant.world_from_object.transform_point3(at));
                let [a, b, c] = corners.map(|corner| corner.as_dvec3());
                let cross = (b - a).cross(c - a) * f64::from(plant.world_from_object.determinant().signum());
                let area_m2 = 0.5 * cross.length();
                PlacedTriangle {
                    middle: ((a + b + c) / 3.0).as_vec3(),
                    normal: cross.normalize_or_zero().as_vec3(),
                    area_m2,
                    organ: self.organ(primitive),
                    leaf: first_leaf.wrapping_add(self.leaf_of_triangle[primitive as usize]),
                }
            })
        })
    }

    fn organ(&self, primitive: u32) -> Organ {
        if self.leaf_of_triangle[primitive as usize] == NO_LEAF { Organ::Other } else { Organ::Leaf }
    }

    /// Returns the place of a ray from above, by two numbers in [0, 1).
    pub(crate) fn above(&self, at: [f32; 2]) -> Vec3 {
        let [x, z] = [0, 1].map(|k| self.low_m[k] + at[k] * self.size_m[k]);
        Vec3::new(x, self.top_m, z)
    }

    /// Returns a point beside a surface, on the side of `normal`.
    pub(crate) fn beside(&self, at: Vec3, normal: Vec3) -> Vec3 {
        let length = self.size_m[0].max(self.size_m[1]).max(self.top_m);
        let mut moved = at + normal * (OFFSET * length);
        moved.y = moved.y.clamp(0.0, self.top_m);
        moved.x = moved.x.clamp(self.low_m[0], self.low_m[0] + self.size_m[0]);
        moved.z = moved.z.clamp(self.low_m[1], self.low_m[1] + self.size_m[1]);
        moved
    }

    /// Follows a ray from a point of the cell, through as many repetitions as it takes.
    pub(crate) fn follow(&self, mut origin: Vec3, direction: Vec3) -> Met {
        for _ in 0..MAX_CELLS {
            let (leave, side) = self.leaves_at(origin, direction);
            let hit = self.geometry.trace(origin, direction, leave, AnyHit::No);
            if hit.primitive != NO_HIT {
                return Met::Surface(self.surface(&hit, origin + direction * hit.t));
            }
            let at = origin + direction * leave;
            match side {
                Side::Top => return Met::Sky,
                Side::Soil => return Met::Soil(Vec3::new(at.x, 0.0, at.z)),
                Side::Beside(k) => origin = self.entered(at, direction, k),
            }
        }
        Met::Lost
    }

    /// Tells whether a ray from a point of the cell leaves it upwards.
    pub(crate) fn sees_sky(&self, mut origin: Vec3, direction: Vec3) -> bool {
        for _ in 0..MAX_CELLS {
            let (leave, side) = self.leaves_at(origin, direction);
            if self.geometry.trace(origin, direction, leave, AnyHit::Yes).primitive != NO_HIT {
                return false;
            }
            match side {
                Side::Top => return true,
                Side::Soil => return false,
                Side::Beside(k) => origin = self.entered(origin + direction * leave, direction, k),
            }
        }
        false
    }

    /// Returns how far a ray goes in the cell, and where it leaves.
    fn leaves_at(&self, origin: Vec3, direction: Vec3) -> (f32, Side) {
        let to = |from: f32, speed: f32, low: f32, high: f32| match speed {
            speed if speed > 0.0 => (high - from) / speed,
            speed if speed < 0.0 => (low - from) / speed,
            _ => f32::INFINITY,
        };
        let vertical = if direction.y > 0.0 { Side::Top } else { Side::Soil };
        let mut least = (to(origin.y, direction.y, 0.0, self.top_m), vertical);
        for (k, [from, speed]) in [[origin.x, direction.x], [origin.z, direction.z]].into_iter().enumerate() {
            let t = to(from, speed, self.low_m[k], self.low_m[k] + self.size_m[k]);
            if t < least.0 {
                least = (t, Side::Beside(k));
            }
        }
        (least.0.max(0.0), least.1)
    }

    /// Returns the place at which a ray that leaves at a side comes in at the other.
    fn entered(&self, at: Vec3, direction: Vec3, k: usize) -> Vec3 {
        let mut entered = at;
        let (speed, value) = if k == 0 { (direction.x, &mut entered.x) } else { (direction.z, &mut entered.z) };
        *value = if speed > 0.0 { self.low_m[k] } else { self.low_m[k] + self.size_m[k] };
        entered
    }

    fn surface(&self, hit: &Hit, at: Vec3) -> Surface {
        let [a, b, c] = corners_of(&self.geometry, hit).map(|corner| Vec3::from(corner.position));
        let handedness = self.geometry.instances()[hit.instance as usize].handedness;
        let mirrored = if handedness < 0.0 { -1.0 } else { 1.0 };
        let placement = self.geometry.placement_of(hit.instance as usize);
        let first = self.first_leaf[self.plant_of_placement[placement] as usize];
        Surface {
            at,
            normal: (b - a).cross(c - a).normalize_or(Vec3::Y) * mirrored,
            organ: self.organ(hit.primitive),
            leaf: first.wrapping_add(self.leaf_of_triangle[hit.primitive as usize]),
        }
    }
}

/// The side at which a ray leaves the cell; `Beside` holds 0 for x and 1 for z.
#[derive(Debug, Clone, Copy)]
enum Side {
    Top,
    Soil,
    Beside(usize),
}

fn bounds_of(vertices: &[Vertex], world_from_object: Mat4) -> [Vec3; 2] {
    let places = vertices.iter().map(|vertex| world_from_object.transform_point3(vertex.position.into()));
    places.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[least, most], at| [least.min(at), most.max(at)])
}

/// Returns the shifts by whole cells with which something within `bounds` reaches into the cell.
fn shifts(low_m: [f32; 2], size_m: [f32; 2], bounds: [Vec3; 2]) -> Result<Vec<Vec3>, String> {
    /// Repetitions of one plant at most.
    const MAX_SHIFTS: i64 = 4096;
    let range = |k: usize, least: f32, most: f32| {
        let first = ((low_m[k] - most) / size_m[k]).ceil() as i64;
        let last = ((low_m[k] + size_m[k] - least) / size_m[k]).floor() as i64;
        [first, last]
    };
    let (x, z) = (range(0, bounds[0].x, bounds[1].x), range(1, bounds[0].z, bounds[1].z));
    if (x[1] - x[0] + 1).saturating_mul(z[1] - z[0] + 1) > MAX_SHIFTS {
        return Err("its plants are many times as wide as the cell; give a larger --cell, in metres".into());
    }
    let of = |i: i64| (z[0]..=z[1]).map(move |j| Vec3::new(i as f32 * size_m[0], 0.0, j as f32 * size_m[1]));
    Ok((x[0]..=x[1]).flat_map(of).collect())
}

/// Numbers the leaves of every mesh: triangles that share vertices are one leaf. Returns the leaf
/// of each triangle, and how many each mesh has.
fn numbered_leaves(geometry: &Geometry) -> (Vec<u32>, Vec<u32>) {
    let vertices = geometry.vertices();
    let mut parent: Vec<u32> = (0..vertices.len() as u32).collect();
    let mut leaf_of_triangle = vec![NO_LEAF; geometry.triangles().len()];
    let mut leaves_of_mesh = Vec::new();
    for range in geometry.meshes() {
        let of_mesh = range.first_triangle as usize..(range.first_triangle + range.triangles) as usize;
        let triangles = &geometry.triangles()[of_mesh.clone()];
        for triangle in triangles.iter().filter(|triangle| triangle.material == 0) {
            let [a, b, c] = triangle.vertices.map(|vertex| root_of(&mut parent, vertex));
            let least = a.min(b).min(c);
            [a, b, c].into_iter().for_each(|vertex| parent[vertex as usize] = least);
        }
        let mut numbers = std::collections::BTreeMap::new();
        for (triangle, leaf) in triangles.iter().zip(&mut leaf_of_triangle[of_mesh]) {
            if triangle.material == 0 {
                let next = numbers.len() as u32;
                *leaf = *numbers.entry(root_of(&mut parent, triangle.vertices[0])).or_insert(next);
            }
        }
        leaves_of_mesh.push(numbers.len() as u32);
    }
    (leaf_of_triangle, leaves_of_mesh)
}

/// Returns the first vertex of a leaf, and shortens the way to it.
fn root_of(parent: &mut [u32], vertex: u32) -> u32 {
    let mut at = vertex;
    while parent[at as usize] != at {
        parent[at as usize] = parent[parent[at as usize] as usize];
        at = parent[at as usize];
    }
    at
}

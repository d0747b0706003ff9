//! Triangles as both tracers see them: meshes with shared vertices, triangles in the order of the BVH's leaves, so that
//! a primitive has one number on the CPU, in the compute BVH and in the acceleration structure; and instances, which
//! place meshes in the world.

use crate::geometry::bvh_build::{build, fit};
use crate::geometry::bvh_node::{Bounds, BvhNode, CHILDREN};
use crate::geometry::lanes::Corners;
use glam::{Mat4, Vec3, Vec4};

/// Triangles of a leaf of a mesh's hierarchy, and instances of a leaf of the hierarchy over them, at most.
const TRIANGLES: u32 = 3;
const INSTANCES: u32 = 1;
/// Triangles that all meshes have together at most.
const MAX_TRIANGLES: usize = 1 << 24;
/// Instances at most: as many as the smallest storage binding of 128 MiB holds.
pub const MAX_INSTANCES: usize = 1 << 20;

/// A vertex. Twin: `Vertex` in `scene.wgsl`; positions come first, so that the acceleration structure is built from
/// the same buffer.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Vertex {
    /// Position, in the mesh's space.
    pub position: [f32; 3],
    /// Texture coordinate to the right.
    pub u: f32,
    /// Unit normal.
    pub normal: [f32; 3],
    /// Texture coordinate upwards.
    pub v: f32,
    /// Unit tangent towards growing u; w = +1 or -1 so that `cross(normal, tangent) * w` points to growing v.
    pub tangent: [f32; 4],
}

/// A triangle. Twin: `Triangle` in `scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Triangle {
    /// Vertex numbers.
    pub vertices: [u32; 3],
    /// Material number.
    pub material: u32,
}

/// A mesh in the world. Twin: `Instance` in `scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Instance {
    /// Rows of the map from the world into the mesh's space.
    pub object_from_world: [[f32; 4]; 3],
    /// Rows of the map back.
    pub world_from_object: [[f32; 4]; 3],
    /// Factors of the contents of the instance's leaves: chlorophyll, carotenoids, brown pigment, thickness.
    pub factors: [f32; 4],
    /// Node where the mesh's hierarchy begins.
    pub root: u32,
    /// The mesh's first triangle.
    pub first_triangle: u32,
    /// 0 where the mesh's space is the world; else -1 where it is mirrored, 1 where it is not.
    pub handedness: f32,
    /// Width of the instance's leaves in the world; 0 where no volume stands in for them.
    pub leaf_width: f32,
}

/// Vertices and triangles of one mesh, in a space of their own.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Vertices.
    pub vertices: Vec<Vertex>,
    /// Triangles over them.
    pub triangles: Vec<Triangle>,
}

/// The place of a mesh in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Number of the mesh.
    pub mesh: usize,
    /// Affine and invertible.
    pub world_from_object: Mat4,
}

/// The place of a mesh in the arrays.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MeshRange {
    pub first_triangle: u32,
    pub triangles: u32,
    root: u32,
    bounds: Bounds,
    /// Boxes of the hierarchy's first children, which together are tighter around a placed mesh than `bounds`.
    parts: [Bounds; CHILDREN],
}

impl MeshRange {
    /// Returns a box around the mesh where an affine map takes it.
    fn placed(&self, map: Mat4) -> Bounds {
        self.parts
            .iter()
            .filter(|part| part.lo.x <= part.hi.x)
            .fold(Bounds::EMPTY, |all, part| all.add(part.placed(map)))
    }
}

/// All triangles of a scene, its instances and their hierarchies.
#[derive(Debug, Clone)]
pub struct Geometry {
    vertices: Vec<Vertex>,
    triangles: Vec<Triangle>,
    /// Of each triangle, where the CPU finds them together.
    corners: Vec<Corners>,
    meshes: Vec<MeshRange>,
    instances: Vec<Instance>,
    /// For each instance: the number of its mesh, and its number among the placements that were given.
    origins: Vec<[usize; 2]>,
    /// The meshes' hierarchies one after the other, then the one over the instances.
    nodes: Vec<BvhNode>,
    root: u32,
    /// Around everything.
    bounds: Bounds,
}

impl Geometry {
    /// Builds the geometry of one mesh that stands where it is.
    ///
    /// # Errors
    /// As [`Geometry::placed`].
    pub fn new(vertices: Vec<Vertex>, triangles: Vec<Triangle>) -> Result<Geometry, String> {
        Geometry::placed(
            vec![Mesh { vertices, triangles }],
            &[Placement { mesh: 0, world_from_object: Mat4::IDENTITY }],
        )
    }

    /// Builds the geometry of meshes that are placed as often as `placements` say. Leaves out triangles without an
    /// area, sorts the others into the leaves of a hierarchy for each mesh, and builds one over the instances.
    ///
    /// # Errors
    /// A sentence if a number is not finite, a vertex or mesh number is out of range, a placement flattens its mesh, no
    /// triangle is left or there are too many.
    pub fn placed(meshes: Vec<Mesh>, placements: &[Placement]) -> Result<Geometry, String> {
        let vertices: usize = meshes.iter().map(|mesh| mesh.vertices.len()).sum();
        let triangles: usize = meshes.iter().map(|mesh| mesh.triangles.len()).sum();
        if vertices > u32::MAX as usize / 4 || triangles > MAX_TRIANGLES {
            return Err("the scene has more than 2^24 triangles or 2^30 vertices, simplify it".into());
        }
        if placements.len() > MAX_INSTANCES {
            return Err(format!("the scene has {} instances, and 2^20 are allowed", placements.len()));
        }
        let mut geometry = Geometry {
            vertices: Vec::with_capacity(vertices),
            triangles: Vec::with_capacity(triangles),
            corners: Vec::with_capacity(triangles),
            meshes: Vec::with_capacity(meshes.len()),
            instances: Vec::new(),
            origins: Vec::new(),
            nodes: Vec::new(),
            root: 0,
            bounds: Bounds::EMPTY,
        };
        for mesh in meshes {
            geometry.add_mesh(mesh)?;
        }
        geometry.place(placements)?;
        Ok(geometry)
    }

    fn add_mesh(&mut self, Mesh { vertices, mut triangles }: Mesh) -> Result<(), String> {
        let finite = |vertex: &Vertex| bytemuck::cast_ref::<Vertex, [f32; 12]>(vertex).iter().all(|x| x.is_finite());
        if !vertices.iter().all(finite) {
            return Err("a vertex has a coordinate that is not a finite number".into());
        }
        if triangles.iter().any(|triangle| triangle.vertices.iter().any(|index| *index as usize >= vertices.len())) {
            return Err("a triangle names a vertex that is not there".into());
        }
        let corners =
            |triangle: &Triangle| triangle.vertices.map(|index| Vec3::from(vertices[index as usize].position));
        triangles.retain(|triangle| {
            let [a, b, c] = corners(triangle);
            (b - a).cross(c - a).length_squared() > 0.0
        });
        let corners: Vec<Corners> = triangles.iter().map(|triangle| Corners::new(corners(triangle))).collect();
        let boxes: Vec<Bounds> = corners.iter().map(Corners::bounds).collect();
        let (first_vertex, first_triangle) = (self.vertices.len() as u32, self.triangles.len());
        let root = self.nodes.len();
        if !boxes.is_empty() {
            let (nodes, order) = build(&boxes, TRIANGLES, root, first_triangle);
            self.nodes.extend(nodes);
            self.corners.extend(order.iter().map(|number| corners[*number as usize]));
            self.triangles.extend(order.iter().map(|number| {
                let triangle = triangles[*number as usize];
                Triangle { vertices: triangle.vertices.map(|index| index + first_vertex), ..triangle }
            }));
        }
        self.vertices.extend(vertices);
        self.meshes.push(MeshRange {
            first_triangle: first_triangle as u32,
            triangles: boxes.len() as u32,
            root: root as u32,
            bounds: Bounds::EMPTY,
            parts: [Bounds::EMPTY; CHILDREN],
        });
        self.fit_meshes(self.meshes.len() - 1, self.nodes.len());
        Ok(())
    }

    /// Gives the nodes over the triangles of the meshes from number `first` on, which end before `end`, their boxes, and the
    /// meshes theirs.
    fn fit_meshes(&mut self, first: usize, end: usize) {
        let (root, corners) = (self.meshes[first].root as usize, &self.corners);
        let all = fit(&mut self.nodes[root..end], root, |number| corners[number as usize].bounds());
        for mesh in self.meshes[first..].iter_mut().filter(|mesh| mesh.triangles > 0) {
            let own = mesh.root as usize;
            (mesh.bounds, mesh.parts) = (all[own - root], self.nodes[own].boxes());
        }
    }

    fn place(&mut self, placements: &[Placement]) -> Result<(), String> {
        let mut placed = Vec::new();
        let mut boxes = Vec::new();
        for (number, placement) in placements.iter().enumerate() {
            let mesh = self.meshes.get(placement.mesh).ok_or("an instance names a mesh that is not there")?;
            let map = placement.world_from_object;
            let inverse = map.inverse();
            if !(map.is_finite() && inverse.is_finite() && map.determinant() != 0.0) {
                return Err("an instance flattens its mesh, correct its scale".into());
            }
            if mesh.triangles == 0 {
                continue;
            }
            boxes.push(mesh.placed(map));
            self.bounds = self.bounds.add(mesh.bounds.placed(map));
            placed.push((number, placement.mesh, map, inverse));
        }
        if boxes.is_empty() {
            return Err("no triangle with an area is left".into());
        }
        let root = self.nodes.len();
        let (mut nodes, order) = build(&boxes, INSTANCES, root, 0);
        fit(&mut nodes, root, |instance| boxes[order[instance as usize] as usize]);
        self.root = root as u32;
        self.nodes.extend(nodes);
        for number in order {
            let (number, mesh, map, inverse) = placed[number as usize];
            let MeshRange { root, first_triangle, .. } = self.meshes[mesh];
            self.origins.push([mesh, number]);
            self.instances.push(Instance {
                object_from_world: rows(inverse),
                world_from_object: rows(map),
                factors: [1.0; 4],
                root,
                first_triangle,
                handedness: if map == Mat4::IDENTITY { 0.0 } else { map.determinant().signum() },
                leaf_width: 0.0,
            });
        }
        Ok(())
    }

    /// Appends `other` to a copy of `self`, whose elements keep their numbers. Also returns the node where the
    /// hierarchy over the instances of `other` begins.
    pub(crate) fn followed_by(&self, other: &Geometry) -> (Geometry, u32) {
        let mut all = self.clone();
        let [vertices, triangles, nodes] =
            [all.vertices.len(), all.triangles.len(), all.nodes.len()].map(|count| count as u32);
        let meshes = all.meshes.len();
        all.vertices.extend(&other.vertices);
        all.triangles.extend(
            other
                .triangles
                .iter()
                .map(|triangle| Triangle { vertices: triangle.vertices.map(|vertex| vertex + vertices), ..*triangle }),
        );
        all.corners.extend(&other.corners);
        all.nodes.extend(self.nodes_behind(other));
        all.meshes.extend(other.meshes.iter().map(|mesh| MeshRange {
            first_triangle: mesh.first_triangle + triangles,
            root: mesh.root + nodes,
            ..*mesh
        }));
        all.instances.extend(other.instances.iter().map(|instance| Instance {
            root: instance.root + nodes,
            first_triangle: instance.first_triangle + triangles,
            ..*instance
        }));
        all.origins.extend(other.origins.iter().map(|[mesh, number]| [mesh + meshes, *number]));
        (all, other.root + nodes)
    }

    /// Iterates over the nodes of `other`, numbered as [`followed_by`](Geometry::followed_by) appends them.
    pub(crate) fn nodes_behind(&self, other: &Geometry) -> impl Iterator<Item = BvhNode> {
        let [triangles, nodes, instances] =
            [self.triangles.len(), self.nodes.len(), self.instances.len()].map(|count| count as u32);
        // The hierarchy over the instances is the last.
        other.nodes.iter().zip(0..).map(move |(node, number)| BvhNode {
            first_child: node.first_child + nodes,
            first_primitive: node.first_primitive + if number < other.root { triangles } else { instances },
            ..*node
        })
    }

    /// Moves the vertices from number `first` on to `positions`. Triangles and hierarchies keep their order, which is
    /// as good as a new one where nothing moves far; boxes follow. Cost: a pass over the nodes.
    pub(crate) fn move_vertices(&mut self, first: usize, positions: impl Iterator<Item = Vec3>) {
        for (vertex, position) in self.vertices[first..].iter_mut().zip(positions) {
            vertex.position = position.to_array();
        }
        for (corners, triangle) in self.corners.iter_mut().zip(&self.triangles) {
            *corners = Corners::new(triangle.vertices.map(|index| self.vertices[index as usize].position.into()));
        }
        self.fit_meshes(0, self.root as usize);
        self.refit_instances();
    }

    /// Moves instances to where `place` has them, by their number among the placements; those that it says nothing of,
    /// or a map without an inverse, stay. The hierarchy over the instances keeps its order. Cost: a pass over the
    /// instances.
    pub(crate) fn move_instances(&mut self, place: impl Fn(usize) -> Option<Mat4>) {
        for (instance, [_, number]) in self.instances.iter_mut().zip(&self.origins) {
            let Some(map) = place(*number) else { continue };
            let inverse = map.inverse();
            if map.is_finite() && inverse.is_finite() {
                (instance.object_from_world, instance.world_from_object) = (rows(inverse), rows(map));
                instance.handedness = map.determinant().signum();
            }
        }
        self.refit_instances();
    }

    /// Gives the nodes over the instances their boxes.
    fn refit_instances(&mut self) {
        let instances = 0..self.instances.len();
        self.bounds = instances.clone().map(|instance| self.instance_bounds(instance)).fold(Bounds::EMPTY, Bounds::add);
        let placed = |instance: usize| self.mesh_and_map(instance);
        let boxes: Vec<Bounds> = instances.map(placed).map(|(mesh, map)| mesh.placed(map)).collect();
        let root = self.root as usize;
        fit(&mut self.nodes[root..], root, |instance| boxes[instance as usize]);
    }

    /// Returns the box around an instance's mesh, placed in the world and boxed there.
    fn instance_bounds(&self, instance: usize) -> Bounds {
        let (mesh, map) = self.mesh_and_map(instance);
        mesh.bounds.placed(map)
    }

    /// Returns the mesh of an instance, and the map that places it.
    fn mesh_and_map(&self, instance: usize) -> (&MeshRange, Mat4) {
        (&self.meshes[self.mesh_of(instance)], affine(self.instances[instance].world_from_object))
    }

    /// Returns a copy with `triangles` that differ from the present ones in their materials only.
    pub(crate) fn with_triangles(&self, triangles: Vec<Triangle>) -> Geometry {
        Geometry { triangles, ..self.clone() }
    }

    /// Multiplies the contents of each instance's leaves by what `factors` says for its mesh and its number among the
    /// placements. Those that volumes stand in for stay as described, since a volume has one colour wherever it stands.
    pub fn set_factors(&mut self, factors: impl Fn(usize, usize) -> [f32; 4]) {
        for (instance, [mesh, placement]) in self.instances.iter_mut().zip(&self.origins) {
            let is_as_described = instance.leaf_width > 0.0;
            instance.factors = if is_as_described { [1.0; 4] } else { factors(*mesh, *placement) };
        }
    }

    /// Says of which instances a volume stands in for the mesh where it is small
    /// ([`LodTransition`](crate::LodTransition)): `widths` gives, for a mesh and a number among the placements, how
    /// wide its leaves are in the world, 0 where none does.
    pub fn set_leaf_widths(&mut self, widths: impl Fn(usize, usize) -> f32) {
        for (instance, [mesh, number]) in self.instances.iter_mut().zip(&self.origins) {
            instance.leaf_width = widths(*mesh, *number);
            instance.factors = if instance.leaf_width > 0.0 { [1.0; 4] } else { instance.factors };
        }
    }

    /// Multiplies the leaf widths of all instances that volumes stand in for.
    pub(crate) fn scale_leaf_widths(&mut self, factor: f32) {
        self.instances.iter_mut().for_each(|instance| instance.leaf_width *= factor);
    }

    /// Returns the greatest leaf width of all instances that volumes stand in for, in the world; 0 where there are
    /// none.
    pub fn widest_leaf(&self) -> f32 {
        self.instances.iter().map(|instance| instance.leaf_width).fold(0.0, f32::max)
    }

    /// Returns all vertices.
    pub fn vertices(&self) -> &[Vertex] {
        &self.vertices
    }

    /// Returns all triangles; a hit's primitive number is an index into these.
    pub fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// Returns all instances; a hit's instance number is an index into these.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// Returns the box around all instances, in the world.
    pub(crate) fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Returns the least and greatest corner of a mesh, in its space.
    pub(crate) fn mesh_bounds(&self, mesh: usize) -> [Vec3; 2] {
        let Bounds { lo, hi } = self.meshes[mesh].bounds;
        [lo, hi]
    }

    /// Returns the number of the mesh that an instance places.
    pub fn mesh_of(&self, instance: usize) -> usize {
        self.origins[instance][0]
    }

    /// Returns the number of an instance among the placements that the geometry was built of.
    pub(crate) fn placement_of(&self, instance: usize) -> usize {
        self.origins[instance][1]
    }

    /// Returns where the meshes lie in the arrays.
    pub(crate) fn meshes(&self) -> &[MeshRange] {
        &self.meshes
    }

    /// Iterates over the triangles of each mesh.
    pub fn mesh_triangles(&self) -> impl Iterator<Item = &[Triangle]> {
        self.meshes.iter().map(|mesh| &self.triangles[mesh.first_triangle as usize..][..mesh.triangles as usize])
    }

    /// Counts the triangles that can be hit: those of each mesh as often as it is placed.
    pub fn placed_triangles(&self) -> u64 {
        self.origins.iter().map(|[mesh, _]| u64::from(self.meshes[*mesh].triangles)).sum()
    }

    /// Returns the hierarchies.
    pub fn nodes(&self) -> &[BvhNode] {
        &self.nodes
    }

    /// Returns the nodes for tests that break them.
    #[cfg(test)]
    pub(crate) fn nodes_mut(&mut self) -> &mut [BvhNode] {
        &mut self.nodes
    }

    /// Returns the node where the hierarchy over the instances begins.
    pub fn root(&self) -> u32 {
        self.root
    }

    /// Returns the corners of a triangle, in its mesh's space.
    pub fn corners(&self, primitive: u32) -> [Vec3; 3] {
        self.corners[primitive as usize].points()
    }

    /// Returns the corners of a triangle as they are intersected.
    #[inline(always)]
    pub(crate) fn corner_lanes(&self, primitive: u32) -> &Corners {
        &self.corners[primitive as usize]
    }

    /// Returns the centre and radius of a sphere around everything.
    pub fn bounding_sphere(&self) -> (Vec3, f32) {
        let Bounds { lo, hi } = self.bounds;
        let centre = (lo + hi) * 0.5;
        let reach = |points: &mut dyn Iterator<Item = Vec3>| points.map(|p| p.distance(centre)).fold(0.0, f32::max);
        let radius = match self.instances.as_slice() {
            [one] if one.handedness == 0.0 => reach(&mut self.vertices.iter().map(|vertex| vertex.position.into())),
            all => reach(&mut (0..all.len()).flat_map(|instance| self.instance_bounds(instance).corners())),
        };
        (centre, radius)
    }
}

/// Returns the affine map of three rows.
fn affine(rows: [[f32; 4]; 3]) -> Mat4 {
    let [x, y, z] = rows.map(Vec4::from);
    Mat4::from_cols(x, y, z, Vec4::W).transpose()
}

/// Returns the three rows of an affine map.
fn rows(map: Mat4) -> [[f32; 4]; 3] {
    [0, 1, 2].map(|row| map.row(row).to_array())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vertex(position: [f32; 3]) -> Vertex {
        Vertex { position, u: 0.0, normal: [0.0, 0.0, 1.0], v: 0.0, tangent: [1.0, 0.0, 0.0, 1.0] }
    }

    fn corners() -> Vec<Vertex> {
        vec![vertex([0.0; 3]), vertex([1.0, 0.0, 0.0]), vertex([0.0, 1.0, 0.0])]
    }

    fn triangle(vertices: [u32; 3]) -> Triangle {
        Triangle { vertices, material: 0 }
    }

    #[test]
    fn refuses_bad_numbers_and_drops_flat_triangles() {
        let good = Geometry::new(corners(), vec![triangle([0, 1, 2]), triangle([0, 0, 1])]).unwrap();
        assert_eq!(good.triangles().len(), 1);
        assert!(Geometry::new(corners(), vec![triangle([0, 1, 3])]).is_err());
        assert!(Geometry::new(corners(), vec![triangle([1, 1, 1])]).is_err());
        let mut bad = corners();
        bad[1].u = f32::NAN;
        assert!(Geometry::new(bad, vec![triangle([0, 1, 2])]).is_err());
    }

    #[test]
    fn moved_vertices_are_met_where_they_are() {
        use crate::geometry::bvh::AnyHit;
        use btf_runtime::testing::Random;
        let mut random = Random::new(8);
        let mut point = |reach: f32| Vec3::from([(); 3].map(|()| random.within(-reach, reach)));
        let mut soup = |count: u32, at: Vec3| {
            let corners: Vec<Vec3> = (0..count).flat_map(|_| [point(2.0) + at; 3].map(|a| a + point(0.5))).collect();
            let triangles = (0..count).map(|i| triangle([3 * i, 3 * i + 1, 3 * i + 2])).collect();
            Mesh { vertices: corners.iter().map(|at| vertex(at.to_array())).collect(), triangles }
        };
        let [still, moving] = [soup(60, Vec3::ZERO), soup(90, Vec3::X)];
        let places = [
            Mat4::IDENTITY,
            Mat4::from_scale_rotation_translation(Vec3::splat(0.7), glam::Quat::from_rotation_x(1.0), Vec3::Y * 3.0),
        ];
        let placements: Vec<Placement> =
            (0..2).flat_map(|mesh| places.map(|world_from_object| Placement { mesh, world_from_object })).collect();
        let moved: Vec<Vec3> = moving
            .vertices
            .iter()
            .map(|v| Vec3::from(v.position))
            .map(|p| p + 0.4 * Vec3::new(p.y.sin(), 1.0, p.x.cos()))
            .collect();
        let mut there = moving.clone();
        there.vertices.iter_mut().zip(&moved).for_each(|(vertex, at)| vertex.position = at.to_array());
        let rest = Geometry::placed(vec![still.clone(), moving], &placements).unwrap();
        let built = Geometry::placed(vec![still, there], &placements).unwrap();
        let mut refit = rest.clone();
        refit.move_vertices(180, moved.into_iter());
        assert_eq!(built.mesh_bounds(1), refit.mesh_bounds(1));
        assert_eq!(built.bounding_sphere().0, refit.bounding_sphere().0);
        let mut counts = [0; 2];
        for _ in 0..500 {
            let (origin, direction) = (point(6.0), point(1.0).normalize());
            let t = |geometry: &Geometry| geometry.trace(origin, direction, 20.0, AnyHit::No).t;
            assert_eq!(t(&built), t(&refit));
            counts[0] += usize::from(t(&built) < 20.0);
            counts[1] += usize::from(t(&built) != t(&rest));
        }
        // Planted: what has not moved is met elsewhere.
        assert!(counts[0] > 20 && counts[1] > 20, "{counts:?}");
    }

    #[test]
    fn places_a_mesh_as_often_as_asked_and_refuses_what_flattens_it() {
        let mesh = || Mesh { vertices: corners(), triangles: vec![triangle([0, 1, 2])] };
        let at = |mesh, map| Placement { mesh, world_from_object: map };
        let shifted = |x: f32| Mat4::from_translation(Vec3::X * x);
        let placements = [at(0, shifted(4.0)), at(1, Mat4::IDENTITY), at(0, shifted(-4.0))];
        let mut placed = Geometry::placed(vec![mesh(), mesh()], &placements).unwrap();
        assert_eq!((placed.triangles().len(), placed.placed_triangles()), (2, 3));
        let (centre, radius) = placed.bounding_sphere();
        assert!((centre - Vec3::new(0.5, 0.5, 0.0)).length() < 1e-6 && radius > 4.5 && radius < 4.6);
        placed.set_factors(|_, placement| [placement as f32; 4]);
        let mut along_x = placed.instances().to_vec();
        along_x.sort_by(|a, b| a.world_from_object[0][3].total_cmp(&b.world_from_object[0][3]));
        assert_eq!(along_x.len(), 3);
        for (instance, map) in along_x.iter().zip([shifted(-4.0), Mat4::IDENTITY, shifted(4.0)]) {
            // Numbered as they were given.
            assert_eq!(instance.world_from_object, rows(map));
            let given = placements.iter().position(|placement| placement.world_from_object == map).unwrap();
            assert_eq!(instance.factors, [given as f32; 4]);
        }
        for bad in [at(2, Mat4::IDENTITY), at(0, Mat4::from_scale(Vec3::new(1.0, 0.0, 1.0))), at(0, Mat4::NAN)] {
            assert!(Geometry::placed(vec![mesh(), mesh()], &[bad]).is_err());
        }
    }

    #[test]
    fn what_stands_behind_another_geometry_is_hit_as_before() {
        let mesh = || Mesh { vertices: corners(), triangles: vec![triangle([0, 1, 2])] };
        let at = |x: f32| Placement { mesh: 0, world_from_object: Mat4::from_translation(Vec3::X * x) };
        let first = Geometry::placed(vec![mesh()], &[at(0.0), at(4.0)]).unwrap();
        let second = Geometry::placed(vec![mesh(), mesh()], &[at(8.0), Placement { mesh: 1, ..at(12.0) }]).unwrap();
        let (all, root) = first.followed_by(&second);
        let behind = Geometry { root, ..all.clone() };
        let hit = |geometry: &Geometry, x: f32| {
            let hit = geometry.trace(Vec3::new(x + 0.25, 0.25, 1.0), Vec3::NEG_Z, 10.0, crate::AnyHit::No);
            (hit.primitive != crate::NO_HIT).then(|| (all.mesh_of(hit.instance as usize), hit.primitive, hit.instance))
        };
        assert_eq!([0.0, 4.0, 8.0, 12.0].map(|x| hit(&all, x)), [Some((0, 0, 0)), Some((0, 0, 1)), None, None]);
        assert_eq!([0.0, 4.0, 8.0, 12.0].map(|x| hit(&behind, x)), [None, None, Some((1, 1, 2)), Some((2, 2, 3))]);
        assert_eq!(all.placed_triangles(), 4);
    }
}

//! Converts organs to triangles: blades to grids, axes to closed tubes.
//!
//! Triangles are wound counterclockwise seen from where their normals point: from the upper face of a blade, from
//! outside an axis. Tangents run along u; with w = 1, the cross product of normal and tangent points along the organ.
//! Texture coordinates are those of glTF, whose v counts downwards: `1 - v` grows towards the tip.

use std::f64::consts::TAU;

use crate::plants::blade::{Blade, BladePoint, Outline};
use crate::plants::plant::{Axis, Part, Plant};
use crate::plants::vec3::{Vec3, along, direction_or, scale, sub};
use crate::vector::{cross, dot};

/// Radius of an axis that has eight sides, in metres; thinner ones have fewer.
const EIGHT_SIDES_RADIUS_M: f64 = 0.012;

/// Smallest distance between the rings of an axis, in radii.
const MIN_STEP_IN_RADII: f64 = 0.25;

/// Period of a texture on axes, in metres.
const AXIS_TEXTURE_M: f64 = 0.1;

/// Triangles of one material, as arrays by vertex.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Mesh {
    /// Positions in metres.
    pub positions: Vec<[f32; 3]>,
    /// Unit normals.
    pub normals: Vec<[f32; 3]>,
    /// Unit tangents, with w = 1.
    pub tangents: Vec<[f32; 4]>,
    pub uvs: Vec<[f32; 2]>,
    /// Indices, three for each triangle.
    pub indices: Vec<u32>,
}

impl Mesh {
    pub fn triangle_count(&self) -> usize {
        self.indices.len() / 3
    }

    /// Appends a vertex and returns its index. `along` is the texture coordinate that grows along the organ.
    fn push(&mut self, position_m: Vec3, normal: Vec3, tangent: Vec3, across: f64, along: f64) -> u32 {
        // Orthogonal in the precision that is stored, too.
        let tangent = direction_or(sub(tangent, scale(normal, dot(tangent, normal))), tangent);
        let single = |v: Vec3| v.map(|x| x as f32);
        let [x, y, z] = single(tangent);
        self.positions.push(single(position_m));
        self.normals.push(single(normal));
        self.tangents.push([x, y, z, 1.0]);
        self.uvs.push([across as f32, 1.0 - along as f32]);
        (self.positions.len() - 1) as u32
    }

    /// Returns the area of all triangles in square metres.
    pub fn area_m2(&self) -> f64 {
        let corner = |index: &u32| self.positions[*index as usize].map(f64::from);
        let area = |corners: &[u32]| {
            let [a, b, c] = [&corners[0], &corners[1], &corners[2]].map(corner);
            let (u, v) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
            let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            0.5 * cross.iter().map(|x| x * x).sum::<f64>().sqrt()
        };
        self.indices.chunks_exact(3).map(area).sum()
    }

    /// Returns a rectangle of soil around the bounds of `[x, z]` positions.
    pub fn ground(least_m: [f64; 2], most_m: [f64; 2]) -> Mesh {
        let mut mesh = Mesh::default();
        let corners = [[least_m[0], most_m[1]], most_m, [most_m[0], least_m[1]], least_m];
        for [x, z] in corners {
            mesh.push([x, 0.0, z], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], x, -z);
        }
        mesh.indices = vec![0, 1, 2, 0, 2, 3];
        mesh
    }
}

/// Returns the meshes of a plant, by part and in the order of the parts; `detail` is the number of triangles of a
/// blade.
pub(crate) fn meshes(plant: &Plant, detail: usize) -> Vec<(Part, Mesh)> {
    let mut parts: Vec<Part> = plant.axes.iter().map(|axis| axis.part).collect();
    let sheets = [(Part::Leaf, &plant.blades), (Part::Petal, &plant.petals)];
    parts.extend(sheets.iter().filter(|(_, blades)| !blades.is_empty()).map(|(part, _)| *part));
    parts.sort();
    parts.dedup();
    let of = |part: Part| {
        let mut mesh = Mesh::default();
        plant.axes.iter().filter(|axis| axis.part == part).for_each(|axis| push_axis(&mut mesh, axis));
        for (_, blades) in sheets.iter().filter(|(of, _)| *of == part) {
            blades.iter().for_each(|blade| push_blade(&mut mesh, blade, detail));
        }
        (part, mesh)
    };
    // What is too small to be drawn leaves nothing.
    parts.into_iter().map(of).filter(|(_, mesh)| !mesh.indices.is_empty()).collect()
}

/// Vertex of a blade: position across and along, and the point there.
pub(crate) struct BladeVertex {
    pub u: f64,
    pub v: f64,
    pub point: BladePoint,
}

/// Returns a blade as rows of vertices with an even number of columns, so that the midrib is a line; an end of no width
/// is a point.
pub(crate) fn blade_rows(blade: &Blade, detail: usize) -> impl Iterator<Item = Vec<BladeVertex>> {
    let columns = match detail {
        0..24 => 2,
        24..160 => 4,
        160..600 => 6,
        _ => 8,
    };
    // A pointed end has half the triangles of a row.
    let points = if blade.shape.outline == Outline::Grass { 1 } else { 2 };
    let rows = ((detail as f64 / columns as f64 + f64::from(points)) / 2.0).round().max(2.0) as usize;
    (0..=rows).map(move |row| {
        let v = row as f64 / rows as f64;
        let is_point = blade.shape.outline.width(v) < 1e-9;
        let places = if is_point { 0..=0 } else { 0..=columns };
        let vertex = |column: usize| {
            let u = if is_point { 0.5 } else { column as f64 / columns as f64 };
            BladeVertex { u, v, point: blade.point(u, v) }
        };
        places.map(vertex).collect()
    })
}

fn push_blade(mesh: &mut Mesh, blade: &Blade, detail: usize) {
    let mut last: Vec<u32> = Vec::new();
    for row in blade_rows(blade, detail) {
        let push = |BladeVertex { u, v, point }: BladeVertex| {
            mesh.push(point.position_m, point.normal, point.tangent, u, blade.texture_v(v))
        };
        let next: Vec<u32> = row.into_iter().map(push).collect();
        match (last.as_slice(), next.as_slice()) {
            ([], _) => {}
            ([point], row) => row.windows(2).for_each(|pair| mesh.indices.extend([*point, pair[1], pair[0]])),
            (row, [point]) => row.windows(2).for_each(|pair| mesh.indices.extend([pair[0], pair[1], *point])),
            (below, above) => {
                for (b, a) in below.windows(2).zip(above.windows(2)) {
                    mesh.indices.extend([b[0], b[1], a[1], b[0], a[1], a[0]]);
                }
            }
        }
        last = next;
    }
}

/// Appends an axis as a tube with both ends closed.
fn push_axis(mesh: &mut Mesh, axis: &Axis) {
    let mut nodes = axis.nodes.clone();
    // Rings nearer than this would cut through each other where the axis bends.
    nodes.dedup_by(|b, a| {
        let step = sub(b.position_m, a.position_m);
        dot(step, step).sqrt() < MIN_STEP_IN_RADII * a.radius_m.max(b.radius_m)
    });
    if nodes.len() < 2 {
        return;
    }
    let thickest = nodes.iter().map(|node| node.radius_m).fold(0.0, f64::max);
    let sides = (3.0 + 5.0 * (thickest / EIGHT_SIDES_RADIUS_M).powf(0.7)).floor().min(16.0) as usize;
    let count = nodes.len();
    let headings: Vec<Vec3> = (0..count)
        .map(|i| {
            let between = sub(nodes[(i + 1).min(count - 1)].position_m, nodes[i.saturating_sub(1)].position_m);
            direction_or(between, [0.0, 1.0, 0.0])
        })
        .collect();
    // Any direction across the first heading, carried along without a twist.
    let first = headings[0];
    let least = (0..3).min_by(|&a, &b| first[a].abs().total_cmp(&first[b].abs())).unwrap_or(0);
    let mut side = direction_or(cross(first, std::array::from_fn(|k| f64::from(k == least))), [1.0, 0.0, 0.0]);
    let (mut rings, mut length_m) = (Vec::with_capacity(count), 0.0);
    for (i, node) in nodes.iter().enumerate() {
        let heading = headings[i];
        side = direction_or(sub(side, scale(heading, dot(side, heading))), side);
        let other = cross(heading, side);
        let (before, after) = (&nodes[i.saturating_sub(1)], &nodes[(i + 1).min(count - 1)]);
        let step = sub(after.position_m, before.position_m);
        // Steps at nodes are rounded, not shown as discs.
        let slope = ((after.radius_m - before.radius_m) / dot(step, step).sqrt()).clamp(-1.0, 1.0);
        if i > 0 {
            let step = sub(node.position_m, nodes[i - 1].position_m);
            length_m += dot(step, step).sqrt();
        }
        let ring: Vec<(u32, Vec3, Vec3)> = (0..=sides)
            .map(|k| {
                let (sin, cos) = (TAU * (k % sides) as f64 / sides as f64).sin_cos();
                let out = along(scale(side, cos), other, sin);
                let position_m = along(node.position_m, out, node.radius_m);
                let normal = direction_or(along(out, heading, -slope), out);
                let (u, v) = (k as f64 / sides as f64, length_m / AXIS_TEXTURE_M);
                (mesh.push(position_m, normal, cross(heading, out), u, v), position_m, out)
            })
            .collect();
        rings.push(ring);
    }
    for pair in rings.windows(2) {
        for (below, above) in pair[0].windows(2).zip(pair[1].windows(2)) {
            let [b0, b1, a0, a1] = [below[0].0, below[1].0, above[0].0, above[1].0];
            mesh.indices.extend([b0, b1, a1, b0, a1, a0]);
        }
    }
    for (end, outwards) in [(0, -1.0), (count - 1, 1.0)] {
        let normal = scale(headings[end], outwards);
        let tangent = rings[end][0].2;
        let v = if end == 0 { 0.0 } else { length_m / AXIS_TEXTURE_M };
        let cap: Vec<u32> = rings[end][..sides]
            .iter()
            .map(|&(_, position_m, out)| {
                let u = (0.5 + 0.5 * dot(out, tangent)).clamp(0.0, 1.0);
                mesh.push(position_m, normal, tangent, u, v)
            })
            .collect();
        for pair in cap[1..].windows(2) {
            let [b, c] = if outwards > 0.0 { [pair[0], pair[1]] } else { [pair[1], pair[0]] };
            mesh.indices.extend([cap[0], b, c]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plants::plant::Node;

    fn tube() -> Mesh {
        let node = |x: f64, y: f64, radius_m: f64| Node { position_m: [x, y, 0.0], radius_m };
        let nodes = vec![node(0.0, 0.0, 0.01), node(0.0, 0.1, 0.008), node(0.0, 0.1, 0.008), node(0.03, 0.2, 0.004)];
        let mut mesh = Mesh::default();
        push_axis(&mut mesh, &Axis { part: Part::Stem, nodes });
        mesh
    }

    /// Returns whether every edge between two positions is traversed as often in one direction as in the other.
    fn is_closed(mesh: &Mesh) -> bool {
        let mut edges = std::collections::HashMap::new();
        let place = |index: u32| mesh.positions[index as usize].map(f32::to_bits);
        for triangle in mesh.indices.chunks_exact(3) {
            for k in 0..3 {
                let (a, b) = (place(triangle[k]), place(triangle[(k + 1) % 3]));
                *edges.entry((a, b)).or_insert(0) += 1;
                *edges.entry((b, a)).or_insert(0) -= 1;
            }
        }
        edges.values().all(|count| *count == 0)
    }

    #[test]
    fn an_axis_is_a_closed_tube_whose_normals_face_out() {
        let mesh = tube();
        // 7 sides: two pieces of 14 triangles and two caps of 5.
        assert_eq!(mesh.triangle_count(), 2 * 14 + 2 * 5);
        assert!(is_closed(&mesh));
        // Its volume is positive: faces face out. A cone of 0.01 to 0.004 over 0.2 m, less what seven sides lack.
        let corner = |index: u32| mesh.positions[index as usize].map(f64::from);
        let volume: f64 =
            mesh.indices.chunks_exact(3).map(|t| dot(corner(t[0]), cross(corner(t[1]), corner(t[2]))) / 6.0).sum();
        assert!((2.2e-5..3.3e-5).contains(&volume), "{volume}");
        // Planted difference: a tube without its last triangle.
        let open = Mesh { indices: mesh.indices[..mesh.indices.len() - 3].to_vec(), ..mesh };
        assert!(!is_closed(&open));
    }
}

//! Writes a canopy as a script of shapes: axes as chains of cones, blades as sheets.
//!
//! The script has z up where a plant has y up: (x, y, z) of a plant is (x, -z, y) there. The space of the script is one
//! period of the field; for a lone plant that is no patch of lawn it is the box around the plant.

use btf_models::shapes::{Material, PaintMode, Point, Script, Shape, Space, Stroke};

use crate::error::SynthError;
use crate::plants::blade::Blade;
use crate::plants::canopy::{Canopy, Instance};
use crate::plants::gltf::look;
use crate::plants::mesh::{BladeVertex, blade_rows};
use crate::plants::plant::{Axis, Part};
use crate::plants::vec3::{UP, Vec3, direction_or, scale, sub, turned};

/// Largest number of shapes of a script; with more, its text no longer makes sense for a model.
pub const MAX_SHAPES: usize = 500_000;

/// Specular reflectance of everything but leaves: an index of 1.5.
const SPECULAR: f64 = 0.04;

/// Smallest extent of a box in metres.
const MIN_EXTENT_M: f64 = 1e-4;

/// Returns the script of a canopy; `leaf` is the name of the description beside it, `detail` the number of triangles of
/// a blade.
///
/// # Errors
/// [`SynthError::BadParameter`] for more than [`MAX_SHAPES`].
pub(crate) fn canopy_script(canopy: &Canopy, detail: usize, leaf: &str) -> Result<Script, SynthError> {
    let count: usize = canopy.instances.iter().map(|one| canopy.variants[one.variant].plant.organs()).sum();
    if count > MAX_SHAPES {
        return Err(SynthError::BadParameter {
            name: "--plants",
            value: format!("{} plants of {count} organs together", canopy.instances.len()),
            allowed: format!("fewer, or --form mesh: a script may have {MAX_SHAPES} shapes"),
        });
    }
    let mut drawn: Vec<(Part, Shape)> = Vec::with_capacity(count);
    for one in &canopy.instances {
        let plant = &canopy.variants[one.variant].plant;
        drawn.extend(plant.axes.iter().map(|axis| (axis.part, limb(axis, one))));
        drawn.extend(plant.blades.iter().map(|blade| (Part::Leaf, sheet(blade, detail, one))));
        drawn.extend(plant.petals.iter().map(|petal| (Part::Petal, sheet(petal, detail, one))));
    }
    if canopy.ground.is_some() {
        let [x, y] = canopy.field_m.map(|side_m| micrometres(0.5 * side_m));
        let rows_m = [-y, y].map(|y| vec![[-x, y, 0.0], [x, y, 0.0]]).to_vec();
        drawn.push((Part::Ground, Shape::Sheet { rows_m }));
    }
    let space = space(canopy, &drawn);
    let mut parts: Vec<Part> = drawn.iter().map(|(part, _)| *part).collect();
    parts.sort();
    parts.dedup();
    let material = |part: Part| match part {
        Part::Leaf => Material { name: part.name().into(), from: Some(leaf.into()), ..Material::default() },
        _ => {
            let (colour, roughness) = look(part);
            Material {
                name: part.name().into(),
                reflectance: Some(colour.map(decimal)),
                transmittance: (part == Part::Petal).then_some([0.15; 3]),
                specular: Some(SPECULAR),
                roughness: Some(roughness),
                ..Material::default()
            }
        }
    };
    let materials = parts.iter().map(|part| material(*part)).collect();
    let mut strokes: Vec<Stroke> = parts
        .iter()
        .map(|part| Stroke { material: Some(part.name().into()), mode: PaintMode::Add, shapes: Vec::new() })
        .collect();
    for (part, shape) in drawn {
        if let Ok(number) = parts.binary_search(&part) {
            strokes[number].shapes.push(shape);
        }
    }
    Ok(Script { space, materials, strokes })
}

/// Returns a position of a plant in the script, in whole micrometres.
fn place(position_m: Vec3, one: &Instance) -> Point {
    let [x, y, z] = turned(scale(position_m, one.scale), UP, one.yaw_rad);
    [x + one.x_m, -(z + one.z_m), y].map(micrometres)
}

fn micrometres(x: f64) -> f64 {
    // Plus zero, so that there is no -0.
    (x * 1e6).round() / 1e6 + 0.0
}

/// Converts a number through its decimal form, so that the file has no digits of single-precision noise.
fn decimal(x: f32) -> f64 {
    format!("{x:.4}").parse().unwrap_or_default()
}

fn limb(axis: &Axis, one: &Instance) -> Shape {
    Shape::Limb {
        points_m: axis.nodes.iter().map(|node| place(node.position_m, one)).collect(),
        radii_m: axis.nodes.iter().map(|node| micrometres(node.radius_m * one.scale).max(1e-6)).collect(),
    }
}

fn sheet(blade: &Blade, detail: usize, one: &Instance) -> Shape {
    let row = |row: Vec<BladeVertex>| row.iter().map(|vertex| place(vertex.point.position_m, one)).collect();
    Shape::Sheet { rows_m: blade_rows(blade, detail).map(row).collect() }
}

fn space(canopy: &Canopy, drawn: &[(Part, Shape)]) -> Space {
    let (mut least_m, mut most_m) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let mut extend = |point: &Point, reach_m: Vec3| {
        for k in 0..3 {
            least_m[k] = least_m[k].min(point[k] - reach_m[k]);
            most_m[k] = most_m[k].max(point[k] + reach_m[k]);
        }
    };
    for (_, shape) in drawn {
        match shape {
            Shape::Limb { points_m, radii_m } => {
                for (ends, radii_m) in points_m.windows(2).zip(radii_m.windows(2)) {
                    // So far a disc across the cone's axis reaches.
                    let axis = direction_or(sub(ends[1], ends[0]), UP);
                    let reach = axis.map(|x| (1.0 - x * x).max(0.0).sqrt());
                    ends.iter().zip(radii_m).for_each(|(end, radius_m)| extend(end, scale(reach, *radius_m)));
                }
            }
            Shape::Sheet { rows_m } => rows_m.iter().flatten().for_each(|p| extend(p, [0.0; 3])),
            _ => {}
        }
    }
    if canopy.is_field {
        for k in 0..2 {
            [least_m[k], most_m[k]] = [-0.5, 0.5].map(|side| side * canopy.field_m[k]);
        }
        // Soil is where w begins.
        least_m[2] = 0.0;
    }
    for k in 0..3 {
        most_m[k] = most_m[k].max(least_m[k] + MIN_EXTENT_M);
    }
    Space { least_m: least_m.map(micrometres), most_m: most_m.map(micrometres), cyclic: [canopy.is_field; 2] }
}

#[cfg(test)]
mod tests {
    use btf_models::Species;

    use super::*;
    use crate::plants::mesh::Mesh;
    use crate::plants::params::{CanopySize, Ground, PlantsParams};
    use crate::plants::vec3::length;
    use crate::vector::cross;

    fn script(params: &PlantsParams) -> (Canopy, Script) {
        let canopy = Canopy::new(params).unwrap();
        let script = canopy_script(&canopy, params.detail, "x-leaf.toml").unwrap();
        (canopy, script)
    }

    /// Returns the area of triangles between rows, as a reader of scripts has it.
    fn sheet_area_m2(rows_m: &[Vec<Point>]) -> f64 {
        let area = |a: Point, b: Point, c: Point| 0.5 * length(cross(sub(b, a), sub(c, a)));
        let pair = |below: &Vec<Point>, above: &Vec<Point>| match (below.as_slice(), above.as_slice()) {
            ([tip], row) | (row, [tip]) => row.windows(2).map(|edge| area(*tip, edge[0], edge[1])).sum::<f64>(),
            (below, above) => below
                .windows(2)
                .zip(above.windows(2))
                .map(|(b, a)| area(b[0], b[1], a[1]) + area(b[0], a[1], a[0]))
                .sum(),
        };
        rows_m.windows(2).map(|rows| pair(&rows[0], &rows[1])).sum()
    }

    fn mesh_area_m2(mesh: &Mesh) -> f64 {
        let corner = |index: u32| mesh.positions[index as usize].map(f64::from);
        let area = |t: &[u32]| 0.5 * length(cross(sub(corner(t[1]), corner(t[0])), sub(corner(t[2]), corner(t[0]))));
        mesh.indices.chunks_exact(3).map(area).sum()
    }

    #[test]
    fn sheets_have_the_area_of_the_mesh() {
        for species in Species::ALL {
            let params = PlantsParams { branches: 60, leaves: 200, ..PlantsParams::of(species) };
            let (canopy, script) = script(&params);
            for part in [Part::Leaf, Part::Petal] {
                let Some((_, mesh)) = canopy.variants[0].meshes.iter().find(|(of, _)| *of == part) else { continue };
                let stroke =
                    script.strokes.iter().find(|stroke| stroke.material.as_deref() == Some(part.name())).unwrap();
                let area = |shape: &Shape| match shape {
                    Shape::Sheet { rows_m } => sheet_area_m2(rows_m),
                    _ => panic!("a leaf is a sheet"),
                };
                let (painted, meshed) = (stroke.shapes.iter().map(area).sum::<f64>(), mesh_area_m2(mesh));
                assert!((painted / meshed - 1.0).abs() < 1e-3, "{species:?} {part:?}: {painted} {meshed}");
                // Planted difference: one blade more.
                let one = area(&stroke.shapes[0]);
                assert!(((painted + one) / meshed - 1.0).abs() > 1e-3);
            }
        }
    }

    #[test]
    fn neyrets_tree_has_its_branches_and_leaves_in_either_form() {
        let params = PlantsParams { branches: 2154, leaves: 6336, ..PlantsParams::of(Species::Tree) };
        let (canopy, script) = script(&params);
        let count = |name: &str| {
            let stroke = script.strokes.iter().find(|stroke| stroke.material.as_deref() == Some(name));
            stroke.map_or(0, |stroke| stroke.shapes.len())
        };
        assert_eq!((count("bark"), count("leaf"), canopy.leaves()), (2154, 6336, 6336));
        assert_eq!(script.space.cyclic, [false; 2]);
        // z is up, and the box is the tree's.
        assert!(script.space.least_m[2].abs() < 0.01 && script.space.most_m[2] > 4.0, "{:?}", script.space);
    }

    #[test]
    fn a_lawn_is_one_period_edge_to_edge() {
        let size = CanopySize::Rows(3, 4);
        let params = PlantsParams { size, ground: Ground::Soil, ..PlantsParams::of(Species::Grass) };
        let (canopy, script) = script(&params);
        assert_eq!(
            (script.space.least_m[..2].to_vec(), script.space.most_m[..2].to_vec()),
            (vec![-0.08, -0.06], vec![0.08, 0.06])
        );
        assert_eq!((script.space.cyclic, canopy.flowers(), canopy.leaves()), ([true; 2], 6, 192));
        assert!(canopy.instances.iter().all(|one| one.scale == 1.0));
        // The soil is the whole period.
        let soil = script.strokes.iter().find(|stroke| stroke.material.as_deref() == Some("ground")).unwrap();
        let Shape::Sheet { rows_m } = &soil.shapes[0] else { panic!() };
        assert!((sheet_area_m2(rows_m) - 0.16 * 0.12).abs() < 1e-12);
    }

    #[test]
    fn more_shapes_than_a_script_should_have_are_refused() {
        let size = CanopySize::Plants(60);
        let params = PlantsParams { size, variants: 1, ..PlantsParams::of(Species::Tree) };
        let canopy = Canopy::new(&params).unwrap();
        canopy_script(&canopy, params.detail, "x").unwrap();
        let mut more = canopy;
        more.instances = vec![more.instances[0]; 63];
        let message = canopy_script(&more, params.detail, "x").unwrap_err().to_string();
        assert!(message.contains("--plants is 63 plants of 504000 organs") && message.contains("500000"), "{message}");
    }
}

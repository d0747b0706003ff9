//! Painting of a script, stroke by stroke.

use std::path::Path;
use std::sync::Arc;

use btf_models::shapes::{Material, PaintMode, Point, Script, Shape, Stroke};
use glam::DVec3;

use super::brush::{Brush, Coat};
use super::canvas::{CLOSED, Canvas, Facet};
use super::descent::{coverage, polygonise};
use super::field::{Field, Hypertexture, Scan, paint_field};
use super::frustum::Frustum;
use super::fur::{Fur, MAX_CYLINDERS};
use super::ground::area_m2;
use super::noise::NoiseField;
use super::particles::{self, MAX_PIECES, paint_particles};
use super::solid::{Placement, Solid};
use super::surface::{box_triangles, mesh_facets, sheet_facets, sphere_triangles};
use super::tint::TintMap;
use super::unusable;
use crate::error::VoxelizeError;
use crate::model::leaf_colour::MaterialFile;
use crate::model::microflakes::{MicroflakeColour, MicroflakeSums};

/// Paints of a script: its path and coats.
pub struct Paints<'a> {
    /// Path of the script, beside which its files stand.
    pub script: &'a Path,
    /// Coat of each of the script's materials before tints.
    pub coats: &'a [Coat],
}

/// Returns the colour of a material that is given by numbers.
pub fn colour_of(material: &Material) -> MicroflakeColour {
    let single = |colour: [f64; 3]| colour.map(|x| x as f32);
    MicroflakeColour {
        reflectance: single(material.reflectance()),
        transmittance: single(material.transmittance()),
        specular: material.specular() as f32,
        roughness: material.roughness() as f32,
    }
}

/// Returns the coat of every material of a script, whose path is `script`.
///
/// # Errors
/// For leaves and assets that cannot be read.
pub fn coats_of(script: &Path, materials: &[Material]) -> Result<Vec<Coat>, VoxelizeError> {
    let coat = |material: &Material| match &material.from {
        Some(file) => {
            let shown = MaterialFile::read(&Script::beside(script, file))?;
            Ok(Coat::of_table(shown.colour(), Arc::new(shown.light_table())))
        }
        None => Ok(colour_of(material).into()),
    };
    materials.iter().map(coat).collect()
}

/// Paints a script on a canvas of `resolution` voxels along its longest side. The same script gives the same bits.
///
/// # Errors
/// For files that the script names and that cannot be used, and for more strands of fur or paths of particles than is sensible.
pub fn paint(script: &Script, resolution: u32, paints: &Paints) -> Result<Canvas, VoxelizeError> {
    let brush = |(material, coat): (&Material, &Coat)| {
        let tint = material.tint.as_ref().map(|tint| TintMap::new(tint, &script.space, paints.script));
        Ok(Brush { coat: coat.clone(), tint: tint.transpose()? })
    };
    let brushes: Vec<Brush> =
        script.materials.iter().zip(paints.coats).map(brush).collect::<Result<_, VoxelizeError>>()?;
    let mut canvas = Canvas::new(&script.space, resolution);
    for stroke in &script.strokes {
        let number = stroke.material.as_ref().and_then(|name| script.material_number(name));
        let brush = number.and_then(|number| brushes.get(number)).cloned().unwrap_or_default();
        paint_stroke(stroke, paints, &brush, &mut canvas)?;
    }
    Ok(canvas)
}

fn paint_stroke(stroke: &Stroke, paints: &Paints, brush: &Brush, canvas: &mut Canvas) -> Result<(), VoxelizeError> {
    for shape in &stroke.shapes {
        if let (PaintMode::Set | PaintMode::Subtract, Some(solid)) = (stroke.mode, Solid::of(shape)) {
            take_away(&solid, canvas);
        }
        match stroke.mode {
            PaintMode::Add | PaintMode::Set => draw(shape, &Placement::NONE, paints, brush, canvas)?,
            PaintMode::Subtract => {}
            PaintMode::Normals => {
                let mut other = canvas.blank();
                draw(shape, &Placement::NONE, paints, brush, &mut other)?;
                take_normals(&other, canvas);
            }
        }
    }
    Ok(())
}

/// Removes the microflakes inside a solid: of a voxel, the share that the solid covers.
fn take_away(solid: &Solid, canvas: &mut Canvas) {
    let [least, most] = solid.bounds(0.0).map(|corner| canvas.grid_from_m(corner));
    let mut shifts = Vec::new();
    canvas.each_copy(least, most, |shift| shifts.push(shift));
    let side_m = canvas.side_m;
    let inside = |triangle: &[glam::Vec3; 3]| {
        let middle_m = canvas.least_m() + (triangle.iter().sum::<glam::Vec3>() / 3.0).as_dvec3() * side_m;
        shifts.iter().any(|shift| solid.value(middle_m - *shift * canvas.voxel_m()) < 0.0)
    };
    let seen = canvas.triangles.iter().zip(&canvas.coats).filter(|(triangle, _)| !inside(triangle));
    let (triangles, coats) = seen.map(|(triangle, coat)| (*triangle, coat.clone())).unzip();
    let left = |cell: [u32; 3]| {
        let from = DVec3::from(cell.map(f64::from));
        shifts.iter().map(|shift| 1.0 - coverage(solid, canvas, from - *shift)).product::<f64>()
    };
    let voxels = canvas.voxels.iter().map(|(cell, sums)| (*cell, sums.scaled(left(*cell) as f32)));
    let voxels = voxels.filter(|(_, sums)| sums.all().area > 0.0).collect();
    (canvas.triangles, canvas.coats, canvas.voxels) = (triangles, coats, voxels);
}

/// Replaces the normals of the voxels of `canvas` by those of another canvas, where that has any.
fn take_normals(of: &Canvas, canvas: &mut Canvas) {
    for (cell, shape) in &of.voxels {
        let shape = shape.all();
        if let Some(sums) = canvas.voxels.get_mut(cell).filter(|_| shape.area > 0.0) {
            for sort in [&mut sums.translucent, &mut sums.opaque] {
                let MicroflakeSums { projected, moment, .. } = shape.scaled(sort.area / shape.area);
                (sort.projected, sort.moment) = (projected, moment);
            }
        }
    }
}

fn draw(
    shape: &Shape,
    place: &Placement,
    paints: &Paints,
    brush: &Brush,
    canvas: &mut Canvas,
) -> Result<(), VoxelizeError> {
    let held = |canvas: &Canvas, [least_m, most_m]: [DVec3; 2]| {
        if canvas.holds(least_m, most_m) {
            return Ok(());
        }
        let fault = format!("has a {} that covers its cyclic [space] again and again", shape.kind());
        Err(unusable(paints.script, fault, "enlarge the space, or make it smaller"))
    };
    if let Some(solid) = Solid::of(shape) {
        let solid = Solid::Placed { of: solid.into(), place: *place };
        held(canvas, solid.bounds(0.0))?;
        let mut facets = Vec::new();
        polygonise(&solid, canvas, &mut |corners_m| facets.push(corners_m));
        for corners_m in facets {
            canvas.facet(&Facet { corners_m, uvs: None }, CLOSED, brush);
        }
        return Ok(());
    }
    match shape {
        Shape::Placed { of, scale, turn_deg, move_m } => {
            let place = place.after(&Placement::new(*scale, *turn_deg, *move_m));
            draw(of, &place, paints, brush, canvas)?;
        }
        Shape::Limb { points_m, radii_m } => {
            let radius_m = radii_m.iter().copied().fold(0.0, f64::max) * place.scale();
            let [least_m, most_m] = hull(points_m.iter().map(|&point| place.apply(point.into())));
            held(canvas, [least_m - radius_m, most_m + radius_m])?;
            draw_limb(points_m, radii_m, place, brush, canvas);
        }
        Shape::Sheet { .. } | Shape::Mesh { .. } => {
            for (facet, weight) in facets(shape, place, paints)? {
                held(canvas, hull(facet.corners_m.into_iter()))?;
                canvas.facet(&facet, weight, brush);
            }
        }
        Shape::Fur { on, .. } => {
            let ground: Vec<[DVec3; 3]> = ground(on, place, paints)?;
            let Some(fur) = Fur::of(shape) else { return Ok(()) };
            let cylinders = fur.cylinders(fur.strands(area_m2(&ground)));
            if cylinders > MAX_CYLINDERS {
                let fault = format!("has fur of {cylinders} cylinders, and {MAX_CYLINDERS} are allowed");
                return Err(unusable(paints.script, fault, "lower its strands_per_m2 or segments"));
            }
            held(canvas, hull(ground.iter().flatten().copied()))?;
            held(canvas, [DVec3::ZERO, DVec3::splat(fur.reach_m())])?;
            fur.paint(&ground, canvas, brush);
        }
        Shape::Particles(system) => {
            let ground: Vec<[DVec3; 3]> = ground(&system.from, place, paints)?;
            let pieces = particles::pieces(system);
            if pieces > MAX_PIECES {
                let fault = format!("has particles whose paths have {pieces} pieces, and {MAX_PIECES} are allowed");
                return Err(unusable(paints.script, fault, "lower their number or segments"));
            }
            held(canvas, hull(ground.iter().flatten().copied()))?;
            held(canvas, [DVec3::ZERO, DVec3::splat(particles::reach_m(system))])?;
            paint_particles(system, &ground, canvas, brush);
        }
        Shape::Hypertexture { of, rim_m, amplitude_m, noise, area_per_m3 } => {
            let Some(solid) = Solid::of(of) else { return Ok(()) };
            let noise = NoiseField::new(noise, canvas.space());
            let field = Hypertexture { solid, rim_m: *rim_m, amplitude_m: *amplitude_m, noise };
            held(canvas, field.bounds())?;
            paint_field(&field, *area_per_m3, canvas, brush);
        }
        Shape::Density { data, least_m, most_m, range, area_per_m3 } => {
            held(canvas, [*least_m, *most_m].map(DVec3::from))?;
            let scan = Scan::read(data, paints.script, [*least_m, *most_m].map(DVec3::from), *range)?;
            paint_field(&scan, *area_per_m3, canvas, brush);
        }
        // Solids, which have been drawn.
        _ => {}
    }
    Ok(())
}

fn draw_limb(points_m: &[Point], radii_m: &[f64], place: &Placement, brush: &Brush, canvas: &mut Canvas) {
    let nodes: Vec<(DVec3, f64)> =
        points_m.iter().zip(radii_m).map(|(&p, r)| (place.apply(p.into()), r * place.scale())).collect();
    let mut cones = nodes
        .windows(2)
        .map(|pair| Frustum { ends_m: [pair[0].0, pair[1].0], radii_m: [pair[0].1, pair[1].1] })
        // Pieces without length have no direction.
        .filter(|cone| cone.ends_m[0] != cone.ends_m[1])
        .collect::<Vec<_>>();
    if let Some(first) = cones.first() {
        first.paint_end(0, canvas, brush);
    }
    if let Some(last) = cones.last() {
        last.paint_end(1, canvas, brush);
    }
    cones.drain(..).for_each(|cone| cone.paint(canvas, brush));
}

/// Returns the corners of the box around points.
fn hull(points: impl Iterator<Item = DVec3>) -> [DVec3; 2] {
    points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[least, most], point| [least.min(point), most.max(point)])
}

/// Returns the facets of a sheet or mesh, with the share of their area that counts.
fn facets(shape: &Shape, place: &Placement, paints: &Paints) -> Result<Vec<(Facet, f64)>, VoxelizeError> {
    let mut facets = match shape {
        Shape::Sheet { rows_m } => sheet_facets(rows_m).into_iter().map(|facet| (facet, 1.0)).collect(),
        Shape::Mesh { file, up } => mesh_facets(&Script::beside(paints.script, file), *up)?,
        _ => Vec::new(),
    };
    for (facet, _) in &mut facets {
        facet.corners_m = facet.corners_m.map(|corner| place.apply(corner));
    }
    Ok(facets)
}

/// Returns the triangles that fur grows on and particles leave.
fn ground(on: &Shape, place: &Placement, paints: &Paints) -> Result<Vec<[DVec3; 3]>, VoxelizeError> {
    let placed = |triangles: Vec<[DVec3; 3]>| {
        triangles.into_iter().map(|triangle| triangle.map(|corner| place.apply(corner))).collect()
    };
    Ok(match on {
        Shape::Sphere { centre_m, radius_m } => placed(sphere_triangles((*centre_m).into(), *radius_m)),
        Shape::Box { least_m, most_m } => placed(box_triangles((*least_m).into(), (*most_m).into())),
        Shape::Placed { of, scale, turn_deg, move_m } => {
            ground(of, &place.after(&Placement::new(*scale, *turn_deg, *move_m)), paints)?
        }
        _ => facets(on, place, paints)?.into_iter().map(|(facet, _)| facet.corners_m).collect(),
    })
}

#[cfg(test)]
mod tests;

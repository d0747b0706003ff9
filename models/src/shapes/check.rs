//! Checks what must hold in a script beyond its form: ranges, names, counts, and which shape may stand where.

use crate::shapes::material::{Material, Tint};
use crate::shapes::noise::Noise;
use crate::shapes::point::{Point, cross, length};
use crate::shapes::script::{PaintMode, Script, Stroke};
use crate::shapes::shape::{BlendElement, DensityData, MAX_NESTING, ParticleSystem, Shape, Trail};

/// Largest coordinate in metres: a thousand kilometres.
const MAX_COORDINATE_M: f64 = 1e6;

/// Smallest length in metres, below an atom; a smaller one is a mistake.
const MIN_LENGTH_M: f64 = 1e-9;

/// Largest number of materials, more than a volumetric texture tells apart.
const MAX_MATERIALS: usize = 256;

/// Largest number of values of a scanned volume: 1024 in each direction.
const MAX_DENSITY_CELLS: u64 = 1 << 30;

/// Largest number of particles of a system.
const MAX_PARTICLES: u64 = 1 << 20;

/// Range of lengths that must not be 0.
const LENGTHS_M: [f64; 2] = [MIN_LENGTH_M, MAX_COORDINATE_M];

/// Checks a whole script. The error is a verb phrase.
pub(super) fn check(script: &Script) -> Result<(), String> {
    let space = &script.space;
    corners("space", space.least_m, space.most_m).map_err(|fault| format!("has {fault} in [space]"))?;
    if script.materials.len() > MAX_MATERIALS {
        return Err(format!("has {} materials, and {MAX_MATERIALS} are allowed", script.materials.len()));
    }
    for (i, material) in script.materials.iter().enumerate() {
        check_material(material).map_err(|fault| format!("has {fault} in the material \"{}\"", material.name))?;
        if script.material_number(&material.name) != Some(i) {
            return Err(format!("has two materials of the name \"{}\"", material.name));
        }
    }
    for (i, stroke) in script.strokes.iter().enumerate() {
        check_stroke(script, stroke).map_err(|fault| format!("has {fault} in stroke {}", i + 1))?;
    }
    Ok(())
}

fn check_material(material: &Material) -> Result<(), String> {
    if material.name.is_empty() {
        return Err("no `name`".into());
    }
    match &material.from {
        None if material.reflectance.is_none() => return Err("neither `reflectance` nor `from`".into()),
        None => {}
        Some(file) => {
            let numbers = [
                ("reflectance", material.reflectance.is_some()),
                ("transmittance", material.transmittance.is_some()),
                ("specular", material.specular.is_some()),
                ("roughness", material.roughness.is_some()),
            ];
            if let Some((key, _)) = numbers.iter().find(|(_, there)| *there) {
                return Err(format!("`{key}` beside `from`, which tells it already"));
            }
            let ending = file.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
            if !["toml", "spmm"].contains(&ending) {
                return Err(format!("`from` as {}, which ends neither in .toml nor in .spmm", file.display()));
            }
        }
    }
    let (reflectance, transmittance) = (material.reflectance(), material.transmittance());
    for k in 0..3 {
        within("reflectance", reflectance[k], [0.0, 1.0])?;
        within("transmittance", transmittance[k], [0.0, 1.0])?;
        if reflectance[k] + transmittance[k] > 1.0 {
            let sum = reflectance[k] + transmittance[k];
            return Err(format!("`reflectance` and `transmittance` that are {sum} together, more than the light"));
        }
    }
    within("specular", material.specular(), [0.0, 1.0])?;
    within("roughness", material.roughness(), [0.05, 1.0])?;
    material.tint.as_ref().map_or(Ok(()), check_tint)
}

fn check_tint(tint: &Tint) -> Result<(), String> {
    let colours = match tint {
        Tint::Picture { projection: None, .. } => return Ok(()),
        Tint::Picture { projection: Some(projection), .. } => {
            place("corner_m", projection.corner_m)?;
            let edges = [("right_m", projection.right_m), ("up_m", projection.up_m)];
            for (key, edge) in edges {
                place(key, edge)?;
                within(&format!("length of `{key}`"), length(edge), LENGTHS_M)?;
            }
            let [right, up] = edges.map(|(_, edge)| edge);
            if length(cross(right, up)) < 1e-6 * length(right) * length(up) {
                return Err("`right_m` and `up_m` along one line".into());
            }
            return Ok(());
        }
        Tint::Noise { noise, colours } => {
            check_noise(noise)?;
            colours
        }
        Tint::Stripes { period_m, colours } => {
            place("period_m", *period_m)?;
            within("length of `period_m`", length(*period_m), LENGTHS_M)?;
            colours
        }
        Tint::Checker { box_m, colours } => {
            box_m.iter().try_for_each(|&side| within("box_m", side, LENGTHS_M))?;
            colours
        }
    };
    colours.iter().flatten().try_for_each(|&factor| within("colours", factor, [0.0, 1.0]))
}

fn check_noise(noise: &Noise) -> Result<(), String> {
    noise.cells.iter().try_for_each(|&cells| within("cells", f64::from(cells), [1.0, 256.0]))?;
    within("octaves", f64::from(noise.octaves), [1.0, 8.0])?;
    within("gain", noise.gain, [0.0, 1.0])?;
    seed(noise.seed)
}

fn check_stroke(script: &Script, stroke: &Stroke) -> Result<(), String> {
    let needs_material = matches!(stroke.mode, PaintMode::Add | PaintMode::Set);
    match &stroke.material {
        None if needs_material => return Err("no `material`".into()),
        Some(name) if script.material_number(name).is_none() => {
            return Err(format!("`material` as \"{name}\", which [[materials]] does not name"));
        }
        _ => {}
    }
    for (i, shape) in stroke.shapes.iter().enumerate() {
        let checked = match stroke.mode {
            PaintMode::Subtract => solid(shape, "a stroke that subtracts"),
            _ => Ok(()),
        };
        let checked = checked.and_then(|()| check_shape(shape, 1));
        checked.map_err(|fault| format!("{fault}, shape {}", i + 1))?;
    }
    Ok(())
}

/// Checks a shape at depth `nesting`. The error ends with the kind of the shape.
fn check_shape(shape: &Shape, nesting: usize) -> Result<(), String> {
    if nesting > MAX_NESTING {
        return Err(format!("shapes more than {MAX_NESTING} deep"));
    }
    let of_kind = |fault: String| format!("{fault} of a {}", shape.kind());
    check_numbers(shape).map_err(of_kind)?;
    match shape {
        Shape::Union { of } | Shape::Intersection { of } | Shape::Difference { of } => {
            if of.is_empty() {
                return Err(of_kind("nothing in `of`".into()));
            }
            of.iter().try_for_each(|part| solid(part, &format!("a {}", shape.kind())))?;
        }
        Shape::Hypertexture { of, .. } => solid(of, "a hypertexture")?,
        Shape::Placed { of, .. } if !is_placeable(of) => {
            return Err(format!("a {} in placed, which holds solids, sheets, limbs and meshes", of.kind()));
        }
        Shape::Fur { on, .. } if !is_ground(on) => {
            return Err(format!("a {} under fur, which grows on a sheet, mesh, sphere or box", on.kind()));
        }
        Shape::Particles(system) if !is_ground(&system.from) => {
            let kind = system.from.kind();
            return Err(format!("particles from a {kind}, which leave a sheet, mesh, sphere or box"));
        }
        _ => {}
    }
    shape.parts().iter().try_for_each(|part| check_shape(part, nesting + 1))
}

fn check_numbers(shape: &Shape) -> Result<(), String> {
    match shape {
        Shape::Sphere { centre_m, radius_m } => {
            place("centre_m", *centre_m)?;
            within("radius_m", *radius_m, LENGTHS_M)
        }
        Shape::Box { least_m, most_m } => corners("box", *least_m, *most_m),
        Shape::Cylinder { ends_m, radius_m } => {
            axis(ends_m)?;
            within("radius_m", *radius_m, LENGTHS_M)
        }
        Shape::Cone { ends_m, radii_m } => {
            axis(ends_m)?;
            radii(radii_m)
        }
        Shape::Limb { points_m, radii_m } => {
            if points_m.len() < 2 || points_m.len() != radii_m.len() {
                let [points, radii] = [points_m.len(), radii_m.len()];
                return Err(format!("{points} `points_m` and {radii} `radii_m`, not two of each and more"));
            }
            points_m.iter().try_for_each(|&point| place("points_m", point))?;
            radii(radii_m)
        }
        Shape::Sheet { rows_m } => {
            let widest = rows_m.iter().map(Vec::len).max().unwrap_or(0);
            if rows_m.len() < 2 || widest < 2 || rows_m.iter().any(|row| row.len() != widest && row.len() != 1) {
                return Err("`rows_m` that are not two and more, each of as many points or of one".into());
            }
            rows_m.iter().flatten().try_for_each(|&point| place("rows_m", point))
        }
        Shape::Blend { elements, threshold } => {
            if elements.is_empty() {
                return Err("no `elements`".into());
            }
            within("threshold", *threshold, [1e-6, 1e6])?;
            elements.iter().try_for_each(check_element)
        }
        Shape::Placed { scale, turn_deg, move_m, .. } => {
            within("scale", *scale, [1e-6, 1e6])?;
            turn_deg.iter().try_for_each(|&turn| within("turn_deg", turn, [-360.0, 360.0]))?;
            place("move_m", *move_m)
        }
        Shape::Fur { .. } => check_fur(shape),
        Shape::Particles(system) => check_particles(system),
        Shape::Hypertexture { rim_m, amplitude_m, noise, area_per_m3, .. } => {
            within("rim_m", *rim_m, LENGTHS_M)?;
            within("amplitude_m", *amplitude_m, [0.0, MAX_COORDINATE_M])?;
            within("area_per_m3", *area_per_m3, [1e-9, 1e9])?;
            check_noise(noise)
        }
        Shape::Density { data, least_m, most_m, range, area_per_m3 } => {
            corners("density", *least_m, *most_m)?;
            within("area_per_m3", *area_per_m3, [1e-9, 1e9])?;
            check_density(data, range)
        }
        Shape::Union { .. } | Shape::Intersection { .. } | Shape::Difference { .. } | Shape::Mesh { .. } => Ok(()),
    }
}

/// Checks the numbers of a [`Shape::Fur`].
fn check_fur(shape: &Shape) -> Result<(), String> {
    let Shape::Fur {
        strands_per_m2,
        length_m,
        radius_m,
        lean_deg,
        lean_towards,
        bend_deg,
        curl_turns,
        curl_radius_m,
        jitter,
        segments,
        seed: first,
        ..
    } = shape
    else {
        return Ok(());
    };
    within("strands_per_m2", *strands_per_m2, [1e-6, 1e12])?;
    within("length_m", *length_m, LENGTHS_M)?;
    within("radius_m", *radius_m, LENGTHS_M)?;
    within("lean_deg", *lean_deg, [0.0, 89.0])?;
    place("lean_towards", *lean_towards)?;
    within("length of `lean_towards`", length(*lean_towards), LENGTHS_M)?;
    within("bend_deg", *bend_deg, [-180.0, 180.0])?;
    within("curl_turns", *curl_turns, [0.0, 100.0])?;
    within("curl_radius_m", *curl_radius_m, [0.0, MAX_COORDINATE_M])?;
    within("jitter", *jitter, [0.0, 1.0])?;
    within("segments", f64::from(*segments), [1.0, 64.0])?;
    seed(*first)
}

/// Checks the numbers of [`Shape::Particles`].
fn check_particles(system: &ParticleSystem) -> Result<(), String> {
    within("particles", system.particles as f64, [1.0, MAX_PARTICLES as f64])?;
    within("speed_m_per_s", system.speed_m_per_s, LENGTHS_M)?;
    if let Some(towards) = system.towards {
        place("towards", towards)?;
        within("length of `towards`", length(towards), LENGTHS_M)?;
    }
    within("spread_deg", system.spread_deg, [0.0, 180.0])?;
    place("acceleration_m_per_s2", system.acceleration_m_per_s2)?;
    within("drag_per_s", system.drag_per_s, [0.0, 1e3])?;
    within("life_s", system.life_s, [1e-6, 1e6])?;
    within("jitter", system.jitter, [0.0, 1.0])?;
    within("segments", f64::from(system.segments), [1.0, 64.0])?;
    match system.trail {
        Trail::Strand { radii_m } => radii(&radii_m)?,
        Trail::Blade { widths_m, fold_deg } => {
            widths_m.iter().try_for_each(|&width| within("widths_m", width, [0.0, MAX_COORDINATE_M]))?;
            if widths_m.iter().all(|&width| width < MIN_LENGTH_M) {
                return Err("`widths_m` of 0 alone".into());
            }
            within("fold_deg", fold_deg, [0.0, 89.0])?;
        }
    }
    seed(system.seed)
}

/// Checks how the file of a [`Shape::Density`] is read.
fn check_density(data: &DensityData, range: &[f64; 2]) -> Result<(), String> {
    if !(range.iter().all(|end| end.is_finite()) && range[0] != range[1]) {
        return Err(format!("`range` as {range:?}, which is not two different numbers"));
    }
    match data {
        DensityData::Raw { cells, .. } => {
            let count = cells.iter().try_fold(1u64, |product, &n| product.checked_mul(u64::from(n)));
            match count {
                Some(1..=MAX_DENSITY_CELLS) => Ok(()),
                _ => Err(format!("`cells` as {cells:?}, which is not within 1 and {MAX_DENSITY_CELLS} of them")),
            }
        }
        DensityData::Slices { .. } => Ok(()),
    }
}

fn check_element(element: &BlendElement) -> Result<(), String> {
    if !(1..=3).contains(&element.points_m.len()) {
        return Err(format!("{} `points_m` of an element, not 1, 2 or 3", element.points_m.len()));
    }
    element.points_m.iter().try_for_each(|&point| place("points_m", point))?;
    within("weight_m2", element.weight_m2, [MIN_LENGTH_M * MIN_LENGTH_M, MAX_COORDINATE_M * MAX_COORDINATE_M])
}

/// Returns whether a shape can be scaled and turned. Fur and particles, whose lengths are their own, and fields cannot.
fn is_placeable(shape: &Shape) -> bool {
    !matches!(shape, Shape::Fur { .. } | Shape::Particles(_) | Shape::Hypertexture { .. } | Shape::Density { .. })
}

/// Returns whether fur can grow on a shape, which needs a surface that points can be drawn from.
fn is_ground(shape: &Shape) -> bool {
    match shape {
        Shape::Sheet { .. } | Shape::Mesh { .. } | Shape::Sphere { .. } | Shape::Box { .. } => true,
        Shape::Placed { of, .. } => is_ground(of),
        _ => false,
    }
}

fn solid(shape: &Shape, whose: &str) -> Result<(), String> {
    if shape.is_solid() { Ok(()) } else { Err(format!("a {}, which is no solid, in {whose}", shape.kind())) }
}

fn corners(whose: &str, least_m: Point, most_m: Point) -> Result<(), String> {
    place("least_m", least_m)?;
    place("most_m", most_m)?;
    for k in 0..3 {
        if most_m[k] - least_m[k] < MIN_LENGTH_M {
            return Err(format!("a {whose} without extent along {}", ["x", "y", "z"][k]));
        }
    }
    Ok(())
}

fn axis(ends_m: &[Point; 2]) -> Result<(), String> {
    ends_m.iter().try_for_each(|&end| place("ends_m", end))?;
    let between = std::array::from_fn(|k| ends_m[1][k] - ends_m[0][k]);
    within("distance between `ends_m`", length(between), LENGTHS_M)
}

/// Checks radii, of which all but one may be 0.
fn radii(radii_m: &[f64]) -> Result<(), String> {
    radii_m.iter().try_for_each(|&radius| within("radii_m", radius, [0.0, MAX_COORDINATE_M]))?;
    within("greatest of `radii_m`", radii_m.iter().copied().fold(0.0, f64::max), LENGTHS_M)
}

fn place(key: &str, point: Point) -> Result<(), String> {
    point.iter().try_for_each(|&x| within(key, x, [-MAX_COORDINATE_M, MAX_COORDINATE_M]))
}

fn seed(seed: u64) -> Result<(), String> {
    // TOML has no larger integers.
    if seed <= i64::MAX as u64 {
        Ok(())
    } else {
        Err(format!("`seed` as {seed}, which is not within 0 to {}", i64::MAX))
    }
}

fn within(key: &str, value: f64, [least, most]: [f64; 2]) -> Result<(), String> {
    // Not `<`, so that a NaN is refused, too.
    if (least..=most).contains(&value) {
        return Ok(());
    }
    let key = if key.contains('`') { key.to_string() } else { format!("`{key}`") };
    Err(format!("{key} as {value}, which is not within {least} to {most}"))
}

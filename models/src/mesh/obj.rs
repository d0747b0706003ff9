//! Reads meshes from OBJ files.

use super::diffuse::DiffuseColour;
use super::gltf_file::read_file;
use super::model::{ModelPart, checked, fault};
use crate::error::ModelError;
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::path::Path;
use tobj::{LoadError, MTLLoadResult};

/// Reads the parts of an OBJ file. A missing .mtl file only costs the colours.
pub(super) fn read(path: &Path) -> Result<Vec<ModelPart>, ModelError> {
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let unreadable = |error: &dyn std::fmt::Display| {
        fault(path, format!("the OBJ file cannot be read: {error}; copy or export it again"))
    };
    let bytes = read_file(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::InvalidInput => unreadable(&error),
        _ => unreadable(&LoadError::OpenFileFailed),
    })?;
    check_indices(&bytes).map_err(|error| unreadable(&error))?;
    let libraries = RefCell::new(BTreeSet::new());
    let (models, materials) = tobj::load_obj_buf(&mut bytes.as_slice(), &options, |library| {
        // A library that is named twice is read once.
        match libraries.borrow_mut().insert(library.to_path_buf()) {
            true => read_materials(&path.parent().unwrap_or(Path::new("")).join(library)),
            false => Ok((Vec::new(), Default::default())),
        }
    })
    .map_err(|error| unreadable(&error))?;
    let materials = materials.unwrap_or_default();
    let mut parts = Vec::new();
    for model in models {
        let mesh = model.mesh;
        if mesh.positions.is_empty() || mesh.indices.is_empty() {
            continue;
        }
        let count = mesh.positions.len() / 3;
        let triples = |numbers: &[f32]| numbers.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect::<Vec<_>>();
        let material = mesh.material_id.and_then(|id| materials.get(id));
        let part = ModelPart {
            name: material.map_or(model.name, |material| material.name.clone()),
            group: mesh.material_id.unwrap_or(0),
            colour: DiffuseColour::opaque(material.and_then(|material| material.diffuse).unwrap_or([0.5; 3])),
            positions: triples(&mesh.positions),
            normals: (mesh.normals.len() == 3 * count).then(|| triples(&mesh.normals)),
            uvs: (mesh.texcoords.len() == 2 * count)
                .then(|| mesh.texcoords.chunks_exact(2).map(|uv| [uv[0], uv[1]]).collect()),
            triangles: mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
            ..ModelPart::default()
        };
        parts.push(checked(path, part)?);
    }
    Ok(parts)
}

/// Refuses faces with indices so far out of range that the arithmetic of the `tobj` crate overflows: relative indices
/// that reach before the first vertex, and others beyond the number of lines. The crate checks the rest.
fn check_indices(bytes: &[u8]) -> Result<(), LoadError> {
    // The crate refuses what is no text as well, but only when it comes to that line.
    let text = std::str::from_utf8(bytes).map_err(|_| LoadError::ReadError)?;
    let lines = text.lines().count() as i64;
    let mut counts = [0i64; 3];
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => counts[0] += 1,
            Some("vt") => counts[1] += 1,
            Some("vn") => counts[2] += 1,
            Some("f" | "l") => {
                for (part, count) in words.flat_map(|word| word.split('/').zip(counts)) {
                    // What is no number is refused by the crate.
                    if part.parse().is_ok_and(|index: i64| !(-count..=lines).contains(&index)) {
                        return Err(LoadError::FaceVertexOutOfBounds);
                    }
                }
            }
            _ => {}
        }
    }
    Ok(())
}

/// Reads a material library (`.mtl`). The `tobj` crate needs three numbers for a colour, but one alone stands for all
/// three [Wavefront, Advanced Visualizer, appendix B1].
fn read_materials(path: &Path) -> MTLLoadResult {
    let bytes = read_file(path).map_err(|_| LoadError::OpenFileFailed)?;
    let text = std::str::from_utf8(&bytes).map_err(|_| LoadError::ReadError)?;
    let mut completed = String::with_capacity(text.len());
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().take(4).collect();
        match words[..] {
            ["Ka" | "Kd" | "Ks" | "Ke"] | ["Ka" | "Kd" | "Ks" | "Ke", _, _] => {
                return Err(LoadError::MaterialParseError);
            }
            [key @ ("Ka" | "Kd" | "Ks" | "Ke"), grey] => completed += &format!("{key} {grey} {grey} {grey}"),
            _ => completed += line,
        }
        completed.push('\n');
    }
    tobj::load_mtl_buf(&mut completed.as_bytes())
}

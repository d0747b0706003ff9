//! Writes a scene file again, for other assets and another folder.

use super::mesh_name::BUILT_IN_MESHES;
use crate::error::ViewerError;
use crate::scene::asset::SceneAsset;
use std::path::Path;
use std::sync::Arc;

/// Returns the text of the scene description at `path` with other asset files: `files[i]` in place of `assets[i]`,
/// which are those that [`load_scene`](super::load_scene) made of the description. The text is meant for a file in
/// `folder`: other paths are written so that they are found from there.
///
/// # Errors
/// [`ViewerError::Read`], [`ViewerError::Scene`].
pub fn scene_with_assets(
    path: &Path,
    assets: &[Arc<SceneAsset>],
    files: &[String],
    folder: &Path,
) -> Result<String, ViewerError> {
    let read = |source| ViewerError::Read { path: path.into(), source };
    let fault = |error: &dyn std::fmt::Display| ViewerError::scene(path, error.to_string().replace('\n', " "));
    let text = std::fs::read_to_string(path).map_err(read)?;
    let mut table: toml::Table = text.parse().map_err(|error: toml::de::Error| fault(&error))?;
    let from = path.parent().unwrap_or(Path::new("."));
    let list = |value: Option<&mut toml::Value>| value.and_then(toml::Value::as_array_mut).map(std::mem::take);
    let moved = |value: &mut toml::Value| {
        let name = value.as_str().unwrap_or_default();
        if !BUILT_IN_MESHES.contains(&name) {
            *value = relative(folder, &from.join(name)).into();
        }
    };
    let mut materials = list(table.get_mut("material")).unwrap_or_default();
    materials.iter_mut().filter_map(|material| material.get_mut("leaf")).for_each(moved);
    for asset in materials.iter_mut().filter_map(|material| material.get_mut("asset")) {
        let number = match &*asset {
            toml::Value::Integer(number) => usize::try_from(*number).ok(),
            value => assets.iter().position(|known| {
                known.path.as_deref() == Some(from.join(value.as_str().unwrap_or_default()).as_path())
            }),
        };
        if let Some(file) = number.and_then(|number| files.get(number)) {
            *asset = file.as_str().into();
        }
    }
    let mut objects = list(table.get_mut("object")).unwrap_or_default();
    objects.iter_mut().filter_map(|object| object.get_mut("mesh")).for_each(moved);
    let mut volumes = list(table.get_mut("volume")).unwrap_or_default();
    for key in ["file", "mesh"] {
        volumes.iter_mut().filter_map(|volume| volume.get_mut(key)).for_each(moved);
    }
    let mut skins = list(table.get_mut("skin")).unwrap_or_default();
    skins.iter_mut().filter_map(|skin| skin.get_mut("mesh")).for_each(moved);
    let of_skins = skins.iter_mut().filter_map(|skin| skin.get_mut("volumes")?.as_array_mut()).flatten();
    for alternative in of_skins {
        match alternative {
            toml::Value::Array(merged) => merged.iter_mut().for_each(moved),
            one => moved(one),
        }
    }
    for (name, entries) in [("material", materials), ("object", objects), ("volume", volumes), ("skin", skins)] {
        table.insert(name.into(), entries.into());
    }
    table.get_mut("environment").and_then(|sky| sky.get_mut("file")).into_iter().for_each(moved);
    toml::to_string(&table).map_err(|error| fault(&error))
}

/// Returns the path of `file` as seen from `folder`, where both exist; else `file` as it is.
fn relative(folder: &Path, file: &Path) -> String {
    let (Ok(folder), Ok(file)) = (folder.canonicalize(), file.canonicalize()) else {
        return file.to_string_lossy().into_owned();
    };
    if folder.components().next() != file.components().next() {
        return file.to_string_lossy().into_owned();
    }
    let common = folder.components().zip(file.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(common).map(|_| "..".to_string());
    let down = file.components().skip(common).map(|part| part.as_os_str().to_string_lossy().into_owned());
    up.chain(down).collect::<Vec<_>>().join("/")
}

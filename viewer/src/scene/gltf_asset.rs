//! Assets and leaves that a glTF file's materials point at: the extensions `BTF_materials_spmm` (docs/reference/gltf.md) and
//! `BTF_materials_leaf` (docs/guide/plants.md).

use crate::error::ViewerError;
use crate::scene::asset::SceneAsset;
use crate::scene::leaf::SceneLeaf;
use crate::scene::material::{Body, OwnBodies};
use btf_models::{beside, gltf_buffers, open_gltf};
use btf_runtime::{VERSION, read_directory};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

const EXTENSION: &str = "BTF_materials_spmm";
const LEAF_EXTENSION: &str = "BTF_materials_leaf";

/// Loads what the materials of a glTF file show; nothing of files of other kinds.
///
/// # Errors
/// [`ViewerError::Model`] for a file that cannot be read, [`ViewerError::Mesh`] for an extension that cannot be followed or an
/// asset that is not the one it tells of; the errors of [`SceneAsset::load`] and [`SceneLeaf::load`].
pub fn own_bodies(path: &Path) -> Result<OwnBodies, ViewerError> {
    let mut own = OwnBodies::default();
    let Some(gltf) = open(path)? else { return Ok(own) };
    let fault = |reason: String| ViewerError::mesh(path, reason);
    let mut loaded: BTreeMap<String, Body> = BTreeMap::new();
    for (number, material) in gltf.materials().enumerate() {
        if let Some(told) = material.extension_value(LEAF_EXTENSION) {
            let Some(uri) = told["leaf"].as_str() else {
                return Err(fault(format!("{LEAF_EXTENSION} of material {number} names no leaf, export it again")));
            };
            let body = match loaded.get(uri) {
                Some(known) => *known,
                None => {
                    own.shown.leaves.push(SceneLeaf::load(&beside(path, uri))?);
                    Body::Leaf(own.shown.leaves.len() - 1)
                }
            };
            loaded.insert(uri.into(), body);
            own.bodies.insert(number, body);
            continue;
        }
        let Some(told) = material.extension_value(EXTENSION) else { continue };
        let wrong = |what: &str| fault(format!("{EXTENSION} of material {number} {what}, export it again"));
        if !told["version"].as_u64().is_some_and(|version| (1..=u64::from(VERSION)).contains(&version)) {
            return Err(wrong("names a version of the format that is not known"));
        }
        let source = told["asset"].to_string();
        if let Some(known) = loaded.get(&source) {
            own.bodies.insert(number, *known);
            continue;
        }
        let (asset, bytes) = match (&told["asset"]["uri"], told["asset"]["bufferView"].as_u64()) {
            (Value::String(uri), None) => {
                let file = beside(path, uri);
                let asset = SceneAsset::load(&file)?;
                let bytes =
                    btf_capture::files::read(&file).map_err(|source| ViewerError::Read { path: file, source })?;
                (asset, bytes)
            }
            (Value::Null, Some(view)) => {
                let bytes =
                    view_bytes(&gltf, path, view).ok_or_else(|| wrong("names a buffer view that is not there"))?;
                let asset = SceneAsset::from_bytes(material.name().unwrap_or("asset"), bytes.clone())
                    .map_err(|source| ViewerError::Asset { path: path.into(), source })?;
                (asset, bytes)
            }
            _ => return Err(wrong("names neither a uri nor a buffer view")),
        };
        let checksum = read_directory(&bytes).map(|directory| format!("{:016x}", directory.checksum));
        if told["byteLength"] != bytes.len() || !checksum.is_ok_and(|checksum| told["checksum"] == checksum) {
            return Err(wrong("tells of another asset than the one that is there"));
        }
        own.shown.assets.push(Arc::new(asset));
        let body = Body::Asset(own.shown.assets.len() - 1);
        loaded.insert(source, body);
        own.bodies.insert(number, body);
    }
    Ok(own)
}

/// Returns the numbers of the materials of a glTF file that show something of their own, be it there or not; none of
/// files of other kinds.
///
/// # Errors
/// [`ViewerError::Model`] for a file that cannot be read.
pub(crate) fn groups_with_own_bodies(path: &Path) -> Result<Vec<usize>, ViewerError> {
    let Some(gltf) = open(path)? else { return Ok(Vec::new()) };
    let has_own = |material: &gltf::Material| {
        [EXTENSION, LEAF_EXTENSION].iter().any(|name| material.extension_value(name).is_some())
    };
    Ok(gltf.materials().enumerate().filter(|(_, material)| has_own(material)).map(|(number, _)| number).collect())
}

/// Opens a glTF file; `None` for files of other kinds.
fn open(path: &Path) -> Result<Option<gltf::Gltf>, ViewerError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    if !["gltf", "glb"].contains(&extension.as_str()) {
        return Ok(None);
    }
    Ok(Some(open_gltf(path)?))
}

/// Returns the bytes of a buffer view.
fn view_bytes(gltf: &gltf::Gltf, path: &Path, view: u64) -> Option<Vec<u8>> {
    let view = gltf.views().nth(usize::try_from(view).ok()?)?;
    let buffers = gltf_buffers(path, gltf).ok()?;
    let end = view.offset().checked_add(view.length())?;
    buffers.get(view.buffer().index())?.get(view.offset()..end).map(<[u8]>::to_vec)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::file::load_scene;
    use crate::scene::mesh_file::tests::write_gltf_with_material;
    use crate::scene::scene::{MeshChoice, Scene};
    use serde_json::json;

    const WEAVE: &[u8] = include_bytes!("builtin/weave.spmm");

    fn told(asset: Value) -> Value {
        let checksum = format!("{:016x}", read_directory(WEAVE).unwrap().checksum);
        json!({ "asset": asset, "version": 1, "byteLength": WEAVE.len(), "checksum": checksum })
    }

    #[test]
    fn a_material_that_points_at_an_asset_carries_it() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("grey weave.spmm"), WEAVE).unwrap();
        let extension = told(json!({ "uri": "grey%20weave.spmm" }));
        let path = write_gltf_with_material(dir.path(), &json!({ "extensions": { EXTENSION: extension } }));
        let expected = SceneAsset::built_in();
        let found = own_bodies(&path).unwrap();
        assert_eq!((found.bodies[&0], found.shown.assets[0].resident()), (Body::Asset(0), expected.resident()));

        let scene = Scene::built_in(&MeshChoice::File(path.clone()), Vec::new(), [1.0; 2]).unwrap();
        assert_eq!(scene.assets[0].resident(), expected.resident());
        std::fs::write(dir.path().join("s.toml"), "[[object]]\nmesh = \"t.gltf\"\n").unwrap();
        let scene = load_scene(&dir.path().join("s.toml"), Vec::new()).unwrap();
        assert_eq!((scene.assets.len(), scene.materials[0].asset()), (1, Some(0)));

        // A material without it needs an asset from elsewhere.
        let plain = write_gltf_with_material(dir.path(), &json!({}));
        assert!(own_bodies(&plain).unwrap().bodies.is_empty());
        assert!(Scene::built_in(&MeshChoice::File(plain), Vec::new(), [1.0; 2]).is_err());
    }

    #[test]
    fn what_is_given_takes_the_place_of_what_a_file_points_at_and_has_not() {
        let dir = tempfile::tempdir().unwrap();
        for extension in [
            json!({ EXTENSION: told(json!({ "uri": "gone.spmm" })) }),
            json!({ LEAF_EXTENSION: { "leaf": "gone.toml" } }),
        ] {
            let path = write_gltf_with_material(dir.path(), &json!({ "extensions": extension }));
            assert!(own_bodies(&path).unwrap_err().to_string().contains("gone."));
            let mesh = MeshChoice::File(path);
            assert!(Scene::built_in(&mesh, Vec::new(), [1.0; 2]).is_err());
            let asset = Arc::new(SceneAsset::built_in());
            for given in [vec![asset.clone()], vec![asset.clone(), asset]] {
                let scene = Scene::built_in(&mesh, given, [1.0; 2]).unwrap();
                assert_eq!(scene.materials[0].asset(), Some(0));
            }
        }
    }

    #[test]
    fn an_extension_that_tells_of_another_asset_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("w.spmm"), WEAVE).unwrap();
        let right = told(json!({ "uri": "w.spmm" }));
        let with = |key: &str, value: Value| {
            let mut wrong = right.clone();
            wrong[key] = value;
            wrong
        };
        for (wrong, word) in [
            (with("checksum", json!("0000000000000000")), "another asset"),
            (with("byteLength", json!(3)), "another asset"),
            (with("version", json!(9)), "not known"),
            (with("asset", json!({})), "neither"),
            (with("asset", json!({ "bufferView": 99 })), "not there"),
            (with("asset", json!({ "uri": "none.spmm" })), "none.spmm"),
        ] {
            let path = write_gltf_with_material(dir.path(), &json!({ "extensions": { EXTENSION: wrong } }));
            let message = own_bodies(&path).unwrap_err().to_string();
            assert!(message.contains(word) && !message.contains('\n'), "{message}");
        }
    }
}

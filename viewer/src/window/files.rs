//! Files that the window takes in and gives out: dropped or named ones, and names that are free.

use crate::error::ViewerError;
use crate::light::environment::Environment;
use crate::scene::asset::SceneAsset;
use crate::scene::file::{load_scene, volume_scene};
use crate::scene::leaf::SceneLeaf;
use crate::scene::material::Shown;
use crate::scene::scene::{MeshChoice, Scene};
use btf_models::LeafDescription;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The part of the scene that an opened file replaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Replaced {
    /// Neither an asset nor a leaf.
    Nothing,
    /// The asset of a number.
    Asset(usize),
    /// The whole scene.
    Scene,
}

impl Replaced {
    /// Returns what a file replaces, where it is an asset that of number `asset`; see [`open_file`].
    pub(crate) fn by(path: &Path, asset: usize) -> Replaced {
        match extension(path).as_str() {
            "spmm" => Replaced::Asset(asset),
            "toml" | "voltex" => Replaced::Scene,
            _ => Replaced::Nothing,
        }
    }

    /// Tells whether the scene still has the asset of a number.
    pub(crate) fn keeps_asset(self, number: usize) -> bool {
        match self {
            Replaced::Nothing => true,
            Replaced::Asset(asset) => asset != number,
            Replaced::Scene => false,
        }
    }

    /// Tells whether the scene still has its leaves.
    pub(crate) fn keeps_leaves(self) -> bool {
        self != Replaced::Scene
    }
}

/// Extensions of the files that the window opens.
const KNOWN: [&str; 8] = ["spmm", "obj", "gltf", "glb", "hdr", "exr", "toml", "voltex"];

/// Tells whether a file is of a kind that [`open_file`] takes, by its name.
pub(crate) fn is_known(path: &Path) -> bool {
    KNOWN.contains(&extension(path).as_str())
}

/// Returns the extension of a file in small letters, without the dot.
fn extension(path: &Path) -> String {
    path.extension().map(|extension| extension.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// Takes a file into the scene: an asset in place of number `asset`, a mesh in place of all objects, a picture of light
/// around it, or another scene, a leaf on a blade or a volume in place of all.
///
/// # Errors
/// The errors of the file's kind; [`ViewerError::Usage`] for another kind. The scene is then as it was.
pub(crate) fn open_file(scene: &mut Scene, asset: usize, path: &Path) -> Result<(), ViewerError> {
    match extension(path).as_str() {
        "spmm" => {
            let loaded = Arc::new(SceneAsset::load(path)?);
            match scene.assets.get_mut(asset) {
                Some(known) => *known = loaded,
                None => scene.assets.push(loaded),
            }
        }
        "obj" | "gltf" | "glb" => {
            let shown = Shown { assets: scene.assets.clone(), leaves: scene.leaves.clone() };
            let other = Scene::built_in(&MeshChoice::File(path.into()), shown, [1.0; 2])?;
            // Light from all around stays, and then is all the light.
            let exposure_ev = scene.exposure_ev;
            *scene = match scene.environment.take() {
                None => Scene { exposure_ev, ..other },
                environment => Scene {
                    environment,
                    sun: scene.sun,
                    outdoors: scene.outdoors.take(),
                    ambient: scene.ambient,
                    lights: Vec::new(),
                    exposure_ev,
                    ..other
                },
            };
        }
        "hdr" | "exr" => {
            let lights = std::mem::take(&mut scene.lights);
            match Environment::load(path, 1.0) {
                Ok(environment) => scene.surround(environment),
                Err(error) => {
                    scene.lights = lights;
                    return Err(error.into());
                }
            }
        }
        "toml" if LeafDescription::is_one(path) => {
            let shown = Shown { leaves: vec![SceneLeaf::load(path)?], ..Shown::default() };
            *scene = Scene::built_in(&MeshChoice::Leaf, shown, [1.0; 2])?;
        }
        "toml" => *scene = load_scene(path, Vec::new())?,
        "voltex" => *scene = volume_scene(path)?,
        _ => {
            return Err(ViewerError::Usage(format!(
                "{}: drop an asset (.spmm), a mesh (.obj, .gltf, .glb), a picture of light (.hdr, .exr), a volume (.voltex), a leaf or a scene (.toml)",
                path.display()
            )));
        }
    }
    Ok(())
}

/// Returns `name_001suffix`, with the first number that is free in the folder where the program runs.
pub(crate) fn free_name(name: &str, suffix: &str) -> PathBuf {
    let numbered = |number: u32| PathBuf::from(format!("{name}_{number:03}{suffix}"));
    (1..).map(numbered).find(|path| !path.exists()).unwrap_or_else(|| numbered(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_that_is_known_is_opened() {
        let asset = Arc::new(SceneAsset::built_in());
        let mut scene = Scene::built_in(&MeshChoice::Plane, vec![asset], [1.0; 2]).unwrap();
        for extension in KNOWN {
            let path = PathBuf::from(format!("none.{extension}"));
            let refused = open_file(&mut scene, 0, &path).unwrap_err();
            assert!(is_known(&path) && !matches!(refused, ViewerError::Usage(_)), "{extension}: {refused}");
        }
        let other = Path::new("none.txt");
        assert!(!is_known(other) && matches!(open_file(&mut scene, 0, other), Err(ViewerError::Usage(_))));
    }

    #[test]
    fn files_of_every_kind_are_taken_in_and_bad_ones_leave_the_scene_alone() {
        let dir = tempfile::tempdir().unwrap();
        let asset = Arc::new(SceneAsset::built_in());
        let mut scene = Scene::built_in(&MeshChoice::Plane, vec![asset], [1.0; 2]).unwrap();
        let write = |name: &str, bytes: &[u8]| {
            let path = dir.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            path
        };
        let weave = include_bytes!("../scene/builtin/weave.spmm");
        open_file(&mut scene, 0, &write("other.spmm", weave)).unwrap();
        assert_eq!(scene.assets[0].name, "other");
        let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
        open_file(&mut scene, 0, &write("m.OBJ", mesh.as_bytes())).unwrap();
        assert_eq!(scene.geometry.triangles().len(), 1);
        let text =
            "[[material]]\nname = \"a\"\nasset = \"other.spmm\"\n[[object]]\nmesh = \"cube\"\nmaterial = \"a\"\n";
        open_file(&mut scene, 0, &write("s.toml", text.as_bytes())).unwrap();
        assert_eq!(scene.geometry.triangles().len(), 12);
        let lights = scene.lights.clone();
        let mut other = scene.clone();
        open_file(&mut other, 0, &write("leaf.toml", b"[look]\nspecies = \"maize\"\n")).unwrap();
        assert!(other.leaves.len() == 1 && other.assets.is_empty());
        let wrong = open_file(&mut other, 0, &write("wrong.toml", b"[look]\nspecies = \"oak\"\n")).unwrap_err();
        assert!(wrong.to_string().contains("species"), "{wrong}");
        let tree = include_bytes!("../scene/builtin/tree.voltex");
        open_file(&mut other, 0, &write("tree.voltex", tree)).unwrap();
        assert!(other.volumes.is_some() && other.sun.is_some() && other.assets.is_empty());
        for (name, bytes) in [("x.spmm", &weave[..200]), ("x.obj", b"f 1 2 3"), ("x.hdr", b"no"), ("x.txt", b"")] {
            let path = write(name, bytes);
            let message = open_file(&mut scene, 0, &path).unwrap_err().to_string();
            assert!(message.contains(name), "{message}");
            assert_eq!((scene.geometry.triangles().len(), &scene.lights), (12, &lights), "{name}");
            assert_eq!(scene.assets[0].name, "other");
        }
    }
}

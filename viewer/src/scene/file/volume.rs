//! `[[volume]]` of a scene file: volumes that stand on their own, and the models that they stand in for.

use super::defaults::one;
use crate::error::ViewerError;
use crate::scene::mesh_file::{FileMesh, load_meshes};
use crate::scene::volume::{AS_IT_IS, open_volume, standing, usual_leaf_width_m, volume_from_model};
use crate::volume::source::VolumeSource;
use crate::volume::volumes::VolumePlace;
use btf_runtime::voltex::Voltex;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The volumes that a scene's file names, each in each of its tints read once.
pub(crate) struct VolumeFiles {
    scene: PathBuf,
    names: Vec<(String, [f32; 3])>,
    /// The volumes in the order in which they were first named; of those that are stored by brick the coarse levels.
    pub volumes: Vec<Arc<Voltex>>,
    /// Where the bricks of each volume are, if it is stored by brick.
    pub sources: Vec<Option<Arc<VolumeSource>>>,
}

impl VolumeFiles {
    /// Begins without volumes; `scene` is the scene's file.
    pub(crate) fn new(scene: &Path) -> VolumeFiles {
        VolumeFiles { scene: scene.into(), names: Vec::new(), volumes: Vec::new(), sources: Vec::new() }
    }

    /// Returns the number of the volume with this name, relative to the scene's file, with its materials' colours times
    /// `tint`.
    ///
    /// # Errors
    /// The errors of [`load_volume`].
    pub(crate) fn number(&mut self, name: &str, tint: [f32; 3]) -> Result<usize, ViewerError> {
        if let Some(known) = self.names.iter().position(|known| *known == (name.into(), tint)) {
            return Ok(known);
        }
        let (volume, source) = open_volume(&self.folder().join(name), tint)?;
        self.volumes.push(volume);
        self.sources.push(source);
        self.names.push((name.into(), tint));
        Ok(self.volumes.len() - 1)
    }

    /// Returns the finest level of a volume's file, counted from the coarsest.
    pub(crate) fn finest_level(&self, volume: usize) -> u32 {
        let of_file = self.sources[volume].as_ref().map(|source| source.file().finest_level());
        of_file.unwrap_or(self.volumes[volume].level_count())
    }

    /// Returns the folder that the scene's file is in.
    fn folder(&self) -> &Path {
        self.scene.parent().unwrap_or(Path::new("."))
    }

    /// Makes an error of the scene's file.
    pub(crate) fn fault(&self, reason: impl Into<String>) -> ViewerError {
        ViewerError::scene(&self.scene, reason)
    }
}

/// `[[volume]]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct VolumeEntry {
    file: String,
    #[serde(default)]
    translate: [f32; 3],
    #[serde(default)]
    yaw_deg: f32,
    #[serde(default = "one")]
    scale: f32,
    pub mesh: Option<String>,
    material: Option<String>,
    #[serde(default)]
    parts: BTreeMap<String, String>,
    leaf_size: Option<f32>,
}

impl VolumeEntry {
    /// Tells whether the same model with the same materials stands for both.
    fn has_mesh_of(&self, other: &VolumeEntry) -> bool {
        (&self.file, &self.mesh, &self.material, &self.parts, self.leaf_size)
            == (&other.file, &other.mesh, &other.material, &other.parts, other.leaf_size)
    }
}

/// Least and greatest side of a volume in the world: beyond them its map has no inverse in single precision.
const VOLUME_SIDES: [f32; 2] = [1e-9, 1e9];

/// Returns where volumes stand on their own.
///
/// # Errors
/// [`ViewerError::Scene`] for what is out of range; the errors of a volume's file.
pub(crate) fn places_of(entries: &[VolumeEntry], files: &mut VolumeFiles) -> Result<Vec<VolumePlace>, ViewerError> {
    let place = |entry: &VolumeEntry| {
        let volume = files.number(&entry.file, AS_IT_IS)?;
        let voltex = &files.volumes[volume];
        let [least, most] = VOLUME_SIDES;
        let side = entry.scale * voltex.side_m();
        if !(least..=most).contains(&side) {
            return Err(files.fault(format!(
                "volume '{}' would be {side} large, and {least:e} to {most:e} is allowed; correct its scale",
                entry.file
            )));
        }
        if !entry.translate.iter().chain([&entry.yaw_deg]).all(|x| x.is_finite()) {
            return Err(files.fault(format!("volume '{}' has a number that is not finite", entry.file)));
        }
        let yaw = entry.yaw_deg.to_radians();
        let world_from_volume = standing(voltex, entry.translate.into(), yaw, entry.scale);
        Ok(VolumePlace { volume, world_from_volume, leaf_width: 0.0 })
    };
    entries.iter().map(place).collect()
}

/// A model that volumes stand in for.
pub(crate) struct Model<'a> {
    /// The model's file as the scene's file names it; material and parts are as there, too.
    pub file: &'a str,
    pub material: Option<&'a String>,
    pub parts: &'a BTreeMap<String, String>,
    /// The model's meshes, wherever one of its volumes stands.
    pub meshes: Vec<FileMesh>,
    /// Width of the leaves in the world, of each place of each mesh.
    pub leaf_widths: Vec<f32>,
}

/// Loads the models that volumes stand in for, each once. `places`, those of the entries, are told how wide the leaves
/// are.
///
/// # Errors
/// [`ViewerError::Scene`] for what is out of range and where volume and model differ; the errors of a model's file.
pub(crate) fn models_of<'a>(
    entries: &'a [VolumeEntry],
    places: &mut [VolumePlace],
    files: &VolumeFiles,
) -> Result<Vec<Model<'a>>, ViewerError> {
    let mut models = Vec::new();
    for (first, entry) in entries.iter().enumerate() {
        let Some(file) = &entry.mesh else {
            if entry.material.is_some() || !entry.parts.is_empty() || entry.leaf_size.is_some() {
                return Err(
                    files.fault(format!("volume '{}' has material, parts or leaf_size, but no mesh", entry.file))
                );
            }
            continue;
        };
        if entries[..first].iter().any(|earlier| earlier.has_mesh_of(entry)) {
            continue;
        }
        if entry.leaf_size.is_some_and(|size| !(size.is_finite() && size > 0.0)) {
            return Err(files.fault(format!("volume '{}' needs a leaf_size above 0", entry.file)));
        }
        let mut meshes = load_meshes(&files.folder().join(file))?;
        let voltex = &files.volumes[places[first].volume];
        let volume_from_model = volume_from_model(voltex, &meshes)
            .map_err(|reason| files.fault(format!("volume '{}' and its mesh '{file}' differ: {reason}", entry.file)))?;
        let leaf_width_m = entry
            .leaf_size
            .unwrap_or_else(|| usual_leaf_width_m(voltex, files.finest_level(places[first].volume), &meshes));
        let mut stands = Vec::new();
        for (other, place) in entries.iter().zip(&mut *places).filter(|(other, _)| other.has_mesh_of(entry)) {
            place.leaf_width = leaf_width_m * other.scale.abs();
            stands.push((place.world_from_volume * volume_from_model, place.leaf_width));
        }
        let mut leaf_widths = Vec::new();
        for mesh in &mut meshes {
            let placed = || stands.iter().flat_map(|stand| mesh.places.iter().map(move |place| (stand, place)));
            leaf_widths.extend(placed().map(|((_, width), _)| *width));
            mesh.places = placed().map(|((stand, _), place)| *stand * *place).collect();
        }
        models.push(Model { file, material: entry.material.as_ref(), parts: &entry.parts, meshes, leaf_widths });
    }
    Ok(models)
}

#[cfg(test)]
pub(crate) mod tests {
    use crate::geometry::bvh::{AnyHit, NO_HIT};
    use crate::geometry::lod_transition::LodTransition;
    use crate::scene::file::{load_scene, scene_with_assets};
    use glam::Vec3;

    /// A folder with a mesh of a triangle, as large as a volume of one voxel in it stands for.
    pub(crate) fn folder_with_volume() -> tempfile::TempDir {
        use btf_runtime::testing::{Random, random_volume};
        let dir = tempfile::tempdir().unwrap();
        let mut volume = random_volume(&mut Random::new(1), 2, 0.9);
        (volume.side_m, volume.extent, volume.cyclic) = (4.004, [1.0; 3], [false; 2]);
        std::fs::write(dir.path().join("v.voltex"), volume.pack().unwrap()).unwrap();
        std::fs::write(dir.path().join("m.obj"), "v 1 0 0\nv 1.01 0 0\nv 1 4 0\nf 1 2 3\n").unwrap();
        dir
    }

    #[test]
    fn a_volume_with_its_mesh_stands_in_for_it_as_large_and_in_the_same_place() {
        let dir = folder_with_volume();
        let path = dir.path().join("s.toml");
        let text = "[[object]]\nmesh = \"plane\"\n[[volume]]\nfile = \"v.voltex\"\n\
                    [[volume]]\nfile = \"v.voltex\"\nmesh = \"m.obj\"\ntranslate = [5, 0, 0]\nscale = 2.0\n\
                    [[volume]]\nfile = \"v.voltex\"\nmesh = \"m.obj\"\nleaf_size = 0.5\n\
                    [[volume]]\nfile = \"v.voltex\"\nmesh = \"m.obj\"\ntranslate = [0, 0, 9]\nyaw_deg = 180.0\n";
        std::fs::write(&path, text).unwrap();
        let scene = load_scene(&path, Vec::new()).unwrap();
        assert!(scene.hands_over());
        // The triangle once for those that are alike, once for the one whose leaves are told.
        assert_eq!((scene.geometry.triangles().len(), scene.geometry.placed_triangles()), (4, 5));
        let widths = |mesh: usize| -> Vec<f32> {
            let all = 0..scene.geometry.instances().len() as u32;
            let mut own: Vec<f32> = all
                .filter(|instance| scene.geometry.mesh_of(*instance as usize) == mesh)
                .map(|instance| scene.geometry.instances()[instance as usize].leaf_width)
                .collect();
            own.sort_by(f32::total_cmp);
            own
        };
        // No voxel is smaller than the blade: 4.004 m in four.
        let voxel = 4.004 / 4.0;
        assert_eq!([widths(0), widths(1), widths(2)], [vec![0.0], vec![voxel, 2.0 * voxel], vec![0.5]]);
        // The tip is over the middle of the volume's floor, to half of the triangle's width.
        let is_met = |x: f32, y: f32, z: f32, lod_transition: &LodTransition| {
            let from = Vec3::new(x, y, z + 1.0);
            let hit = scene.geometry.trace_with_lod(from, Vec3::NEG_Z, 2.0, AnyHit::Yes, lod_transition);
            hit.primitive != NO_HIT
        };
        let all = LodTransition::MESHES;
        assert_eq!([7.0, 8.1].map(|y| is_met(4.9905, y, 0.0, &all)), [true, false]);
        assert_eq!([3.5, 4.1].map(|y| is_met(0.0048, y, 9.0, &all)), [true, false]);
        // From far away it is a volume's.
        let far = LodTransition::new(Vec3::Y * 1e4, 0.01, 1.0);
        assert!(!is_met(4.9905, 7.0, 0.0, &far));

        for (bad, reason) in [
            (text.replace("0.5\n", "0.0\n"), "leaf_size above 0"),
            (text.replace("v.voltex\"\n[[volume]]", "v.voltex\"\nleaf_size = 1.0\n[[volume]]"), "no mesh"),
            (text.replace("m.obj", "n.obj"), "build the volume of this mesh"),
            (text.replace("yaw_deg", "material = \"x\"\nyaw_deg"), "name = \"x\""),
        ] {
            std::fs::write(dir.path().join("n.obj"), "v 1 0 0\nv 1.01 0 0\nv 1 5 0\nf 1 2 3\n").unwrap();
            std::fs::write(&path, &bad).unwrap();
            let message = load_scene(&path, Vec::new()).unwrap_err().to_string();
            assert!(message.contains(reason) && message.contains("s.toml: ") && !message.contains('\n'), "{message}");
        }
        // Written for another folder, it finds them.
        std::fs::write(&path, text).unwrap();
        let out = dir.path().join("out");
        std::fs::create_dir(&out).unwrap();
        std::fs::write(out.join("s.toml"), scene_with_assets(&path, &[], &[], &out).unwrap()).unwrap();
        let again = load_scene(&out.join("s.toml"), Vec::new()).unwrap();
        assert_eq!(again.geometry.placed_triangles(), scene.geometry.placed_triangles());
    }
}

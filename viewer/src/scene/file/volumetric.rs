//! `[[volume]]`, `[[skin]]` and `[wind]` of a scene file.

use super::mesh_name::meshes_of;
use super::skin::SkinEntry;
use super::source::Source;
use super::transform::world_from_entry;
use super::volume::VolumeFiles;
use crate::error::ViewerError;
use crate::scene::scene::Scene;
use crate::volume::skin::Wind;
use crate::volume::volumes::{SceneSkin, VolumePlace, Volumes};
use std::sync::Arc;

/// Gives the scene the volumes that stand on their own and the thick skins, where there are any.
///
/// # Errors
/// [`ViewerError::Scene`] for a skin that cannot be made; the errors of a mesh's or a volume's file.
pub(super) fn put_volumes_into(
    scene: &mut Scene,
    places: &[VolumePlace],
    skins: &[SkinEntry],
    mut files: VolumeFiles,
    source: Source,
) -> Result<(), ViewerError> {
    let skins = skins_of(skins, &mut files, source)?;
    if !(places.is_empty() && skins.is_empty()) {
        let mut volumes = Volumes::new(files.volumes, places, skins).map_err(|reason| source.fault(reason))?;
        volumes.set_sources(files.sources);
        scene.volumes = Some(Arc::new(volumes));
    }
    Ok(())
}

fn skins_of(entries: &[SkinEntry], files: &mut VolumeFiles, source: Source) -> Result<Vec<SceneSkin>, ViewerError> {
    let skin = |entry: &SkinEntry| {
        let meshes = entry.mesh.as_ref().map_or(Ok(Vec::new()), |mesh| meshes_of(mesh, source))?;
        let world_from_skin = world_from_entry(entry.scale, entry.rotate_deg, entry.translate)
            .ok_or_else(|| files.fault("a [[skin]] is flattened by its scale"))?;
        entry.skin(meshes, world_from_skin, files)
    };
    entries.iter().map(skin).collect()
}

/// Lets the wind blow over the scene's skins, at time 0.
///
/// # Errors
/// [`ViewerError::Scene`] for a wind that is out of range and for a scene without skins.
pub(super) fn put_wind_into(
    scene: &mut Scene,
    wind: Wind,
    skins: &[SkinEntry],
    source: Source,
) -> Result<(), ViewerError> {
    wind.check().map_err(|reason| source.fault(format!("[wind]: {reason}")))?;
    if skins.is_empty() {
        return Err(source.fault("[wind] blows over skins and there is none, add a [[skin]]"));
    }
    scene.wind = Some(wind);
    scene.blow(0.0)
}

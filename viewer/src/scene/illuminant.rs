//! The light under which a scene's assets in bands are shown: one of the illuminants that have a name.

use crate::scene::scene::Scene;
use btf_capture::{Illuminant, Observer, shown_weights};
use std::sync::Arc;

/// Illuminants to choose from, daylight first, with what they are.
pub(crate) const ILLUMINANTS: [(&str, &str); 3] =
    [("D65", "daylight"), ("A", "a tungsten lamp of 2856 K"), ("E", "equal power at all wavelengths")];

/// Tells whether an asset of the scene has bands.
pub(crate) fn has_bands(scene: &Scene) -> bool {
    scene.assets.iter().any(|asset| asset.has_bands())
}

/// Returns the illuminant under which the first asset in bands is shown to the CIE's observer; `None` for another one, such
/// as one of a table, and for a scene without bands.
pub(crate) fn illuminant_of(scene: &Scene) -> Option<&'static str> {
    let asset = scene.assets.iter().find(|asset| asset.has_bands())?;
    if asset.shows_as_stored() {
        return Some(ILLUMINANTS[0].0);
    }
    let shown = asset.spectrum()?.shown;
    let is_shown = |name: &&str| lamp(name).and_then(|lamp| asset.shown_for(|nm| colours_of(&lamp, nm))) == Some(shown);
    ILLUMINANTS.iter().map(|(name, _)| *name).find(is_shown)
}

/// Shows the assets in bands under one of [`ILLUMINANTS`]; any other name changes nothing.
pub(crate) fn show_under(scene: &mut Scene, name: &str) {
    let Some(lamp) = lamp(name) else { return };
    for asset in scene.assets.iter_mut().filter(|asset| asset.has_bands()) {
        match name == ILLUMINANTS[0].0 {
            true => Arc::make_mut(asset).show_as_stored(),
            false => Arc::make_mut(asset).show_bands(|nm| colours_of(&lamp, nm)),
        }
    }
}

/// Returns one of [`ILLUMINANTS`] by its name.
fn lamp(name: &str) -> Option<Illuminant> {
    ILLUMINANTS.iter().find(|(known, _)| *known == name)?;
    Illuminant::by_name(name).ok()
}

/// Returns the weights of bands at wavelengths in nanometres in the colours that the CIE's observer sees.
fn colours_of(lamp: &Illuminant, nm: &[f64]) -> Vec<[f32; 3]> {
    shown_weights(nm, lamp, &Observer::cie_1931())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::asset::SceneAsset;
    use crate::scene::scene::MeshChoice;
    use btf_runtime::testing::sample_spectral_asset;

    #[test]
    fn the_light_is_known_again_and_daylight_gives_back_what_the_file_has() {
        let asset = SceneAsset::new("bands", sample_spectral_asset(6, 8, 8));
        let stored = asset.spectrum().unwrap().shown;
        let mut scene = Scene::built_in(&MeshChoice::Sphere, vec![Arc::new(asset)], [1.0; 2]).unwrap();
        assert!(has_bands(&scene));
        let mut seen = Vec::new();
        for name in ["D65", "A", "E", "A", "D65"] {
            show_under(&mut scene, name);
            assert_eq!(illuminant_of(&scene), Some(name));
            seen.push(scene.assets[0].spectrum().unwrap().shown);
        }
        assert!(seen[0] == stored && seen[4] == stored && seen[1] == seen[3] && seen[1] != seen[2]);
        // What is saved is what the file has, under whatever light it is seen.
        show_under(&mut scene, "A");
        let saved = &scene.assets[0].file_form().unwrap().asset;
        assert_eq!(saved.spectrum.as_ref().unwrap().shown, stored);
        Arc::make_mut(&mut scene.assets[0]).show_bands(|nm| vec![[0.5; 3]; nm.len()]);
        assert_eq!(illuminant_of(&scene), None);
        show_under(&mut scene, "moonlight");
        assert_eq!(illuminant_of(&scene), None);
        let weave = vec![Arc::new(SceneAsset::built_in())];
        let plain = Scene::built_in(&MeshChoice::Sphere, weave, [1.0; 2]).unwrap();
        assert!(!has_bands(&plain) && illuminant_of(&plain).is_none());
    }
}

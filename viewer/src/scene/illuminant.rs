//! The light under which a scene's assets in bands are shown: one of the illuminants that have a name.

use crate::scene::scene::Scene;
use btf_capture::{Illuminant, Observer, shown_weights};
use std::sync::Arc;

/// Illuminants to choose from, daylight first, with what they are.
pub(crate) const ILLUMINANTS: [(&str, &str); 3] =
    [("D65", "daylight"), ("A", "a tungsten lamp of 2856 K"), ("E", "equal power at all wavelengths")];

/// Tells whether an asset of the scene has bands.
pub(crate) fn has_bands(scene: &Scene) -> bool {
    scene.assets.iter().any(|asset| asset.spectrum().is_some())
}

/// Returns the illuminant under which the first asset in bands is shown to the CIE's observer; `None` for another one, such
/// as one of a table, and for a scene without bands.
pub(crate) fn illuminant_of(scene: &Scene) -> Option<&'static str> {
    let asset = scene.assets.iter().find(|asset| asset.spectrum().is_some())?;
    if asset.shows_as_stored() {
        return Some(ILLUMINANTS[0].0);
    }
    let spectrum = asset.spectrum()?;
    let nm: Vec<f64> = spectrum.wavelengths_nm.iter().map(|nm| f64::from(*nm)).collect();
    let is_shown = |name: &&str| {
        weights_under(name, &nm).is_some_and(|weights| spectrum.shown_through(&weights) == spectrum.shown)
    };
    ILLUMINANTS.iter().map(|(name, _)| *name).find(is_shown)
}

/// Shows the assets in bands under one of [`ILLUMINANTS`]; any other name changes nothing.
pub(crate) fn show_under(scene: &mut Scene, name: &str) {
    for asset in scene.assets.iter_mut().filter(|asset| asset.spectrum().is_some()) {
        let asset = Arc::make_mut(asset);
        if name == ILLUMINANTS[0].0 {
            asset.show_as_stored();
        } else if ILLUMINANTS.iter().any(|(known, _)| *known == name) {
            asset.show_bands(|nm| weights_under(name, nm).unwrap_or_default());
        }
    }
}

/// Returns the weights of bands in colours under an illuminant other than daylight; `None` for a name that is none.
fn weights_under(name: &str, nm: &[f64]) -> Option<Vec<[f32; 3]>> {
    ILLUMINANTS.iter().find(|(known, _)| *known == name)?;
    let illuminant = Illuminant::by_name(name).ok()?;
    Some(shown_weights(nm, &illuminant, &Observer::cie_1931()))
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

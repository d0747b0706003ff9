//! How a scene is seen, as text that fits into a link: whoever follows it sees what the sender saw.

use super::panels::panel::Panel;
use super::pictures::split::{Against, Split};
use crate::options::{MAX_DEPTH, RenderMode, ShadeOptions, SkyLight};
use crate::scene::camera::Camera;
use crate::scene::illuminant::{illuminant_of, show_under};
use crate::scene::scene::{Ambient, PointLight, Scene};
use crate::window::panels::lights::MAX_LIGHTS;
use btf_runtime::{HeightUse, Interpolation};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Exposures that a link may ask for, stops on either side of 0.
const MAX_EXPOSURE_EV: f32 = 20.0;

/// Camera, light and settings of a picture. What a link leaves out stays as it is.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct LinkedView {
    /// Eye, target and up of the camera, and its field of view in degrees.
    camera: Option<(Vec3, Vec3, Vec3, f32)>,
    exposure: Option<f32>,
    /// Illuminant of assets in bands.
    illuminant: Option<String>,
    /// Position and intensity of each point light.
    lights: Option<Vec<(Vec3, [f32; 3])>>,
    /// Radiance and reach of the ambient light; both 0 for none.
    ambient: Option<(f32, f32)>,
    /// Whether paths are traced, and their length.
    paths: Option<(bool, u32)>,
    /// Components and lobes at most.
    components: Option<u32>,
    lobes: Option<u32>,
    exact: Option<bool>,
    heights: Option<usize>,
    displacement: Option<f32>,
    irradiance: Option<bool>,
    /// Where the split view's line is, whether it shows differences, and their factor.
    split: Option<(f32, bool, f32)>,
    /// What it compares with: 0 all detail, 1 path tracing, 2 as measured.
    against: Option<u8>,
}

impl LinkedView {
    /// Returns how `scene` is seen, without what is as in `usual`, the scene as it was opened.
    pub fn of(scene: &Scene, usual: &Scene, shade: &ShadeOptions, split: &Split) -> LinkedView {
        let Camera { eye, target, up, fov_deg } = scene.camera;
        let plain = ShadeOptions::default();
        let decode = (shade.decode, plain.decode);
        let lights = || scene.lights.iter().take(MAX_LIGHTS).map(|light| (light.position, light.intensity)).collect();
        let displacement = |scene: &Scene| scene.materials.iter().map(|it| it.displacement).fold(0.0, f32::max);
        LinkedView {
            camera: (scene.camera != usual.camera).then_some((eye, target, up, fov_deg)),
            exposure: (scene.exposure_ev != usual.exposure_ev).then_some(scene.exposure_ev),
            illuminant: illuminant_of(scene).filter(|name| Some(*name) != illuminant_of(usual)).map(str::to_owned),
            lights: (scene.lights != usual.lights).then(lights),
            ambient: (scene.ambient != usual.ambient).then_some((scene.ambient.radiance[1], scene.ambient.distance)),
            paths: ((shade.mode, shade.depth) != (plain.mode, plain.depth))
                .then_some((shade.mode == RenderMode::Path, shade.depth)),
            components: (decode.0.components != decode.1.components).then_some(decode.0.components),
            lobes: (decode.0.lobes != decode.1.lobes).then_some(decode.0.lobes),
            exact: (decode.0.interpolation != decode.1.interpolation)
                .then_some(decode.0.interpolation == Interpolation::Exact),
            heights: (decode.0.heights != decode.1.heights)
                .then(|| HeightUse::ALL.iter().position(|it| *it == decode.0.heights))
                .flatten(),
            displacement: (displacement(scene) != displacement(usual)).then(|| displacement(scene)),
            irradiance: (shade.sky != plain.sky).then_some(shade.sky == SkyLight::Irradiance),
            split: split.on.then_some((split.place, split.difference, split.gain)),
            against: Some(split.against).filter(|_| split.on).and_then(|against| match against {
                Against::Everything => Some(0),
                Against::Paths => Some(1),
                Against::Measured => Some(2),
                Against::Asset(_) | Against::Opened => None,
            }),
        }
    }

    /// Returns the text of a link; [`LinkedView::read`] reads it.
    pub fn text(&self) -> String {
        let value = serde_json::to_value(self).unwrap_or_default();
        let told = value.as_object().cloned().unwrap_or_default().into_iter().filter(|(_, value)| !value.is_null());
        serde_json::Value::Object(told.collect()).to_string()
    }

    /// Reads the text of a link; what is no such text asks for nothing.
    pub fn read(text: &str) -> LinkedView {
        serde_json::from_str(text).unwrap_or_default()
    }

    /// Has a scene seen so, as far as the numbers are usable.
    pub fn apply(&self, scene: &mut Scene, panel: &mut Panel, split: &mut Split) {
        let usable = |x: &Vec3| x.is_finite();
        if let Some((eye, target, up, fov_deg)) = self.camera
            && [eye, target, up].iter().all(usable)
            && eye != target
            && up.length() > 0.0
            && (0.1..=170.0).contains(&fov_deg)
        {
            scene.camera = Camera { eye, target, up, fov_deg };
        }
        if let Some(exposure) = self.exposure.filter(|exposure| exposure.abs() <= MAX_EXPOSURE_EV) {
            scene.exposure_ev = exposure;
        }
        if let Some(illuminant) = &self.illuminant {
            show_under(scene, illuminant);
        }
        if let Some(lights) = &self.lights {
            let bright = |intensity: &[f32; 3]| intensity.iter().all(|x| x.is_finite() && *x >= 0.0);
            let lights = lights.iter().filter(|(position, intensity)| usable(position) && bright(intensity));
            scene.lights = lights
                .take(MAX_LIGHTS)
                .map(|(position, intensity)| PointLight { position: *position, intensity: *intensity })
                .collect();
        }
        if let Some((radiance, distance)) = self.ambient.filter(|(r, d)| r.is_finite() && d.is_finite()) {
            scene.ambient = match radiance > 0.0 && distance > 0.0 {
                true => Ambient { radiance: [radiance; 3], distance },
                false => Ambient::NONE,
            };
        }
        if let Some(displacement) = self.displacement.filter(|scale| (0.0..=100.0).contains(scale)) {
            scene.displace(displacement);
        }
        let shade = self.shade(panel.shade);
        *panel = Panel::new(scene, shade, panel.renderer);
        if let Some((place, difference, gain)) = self.split {
            split.on = true;
            split.difference = difference;
            split.place = if place.is_finite() { place.clamp(0.0, 1.0) } else { split.place };
            split.gain = if gain.is_finite() && gain > 0.0 { gain } else { split.gain };
            split.against = match self.against {
                Some(1) => Against::Paths,
                Some(2) => Against::Measured,
                _ => Against::Everything,
            };
        }
    }

    fn shade(&self, before: ShadeOptions) -> ShadeOptions {
        let mut shade = before;
        if let Some((paths, depth)) = self.paths {
            shade.mode = if paths { RenderMode::Path } else { RenderMode::Direct };
            shade.depth = depth.clamp(1, MAX_DEPTH);
        }
        shade.decode.components = self.components.unwrap_or(shade.decode.components);
        shade.decode.lobes = self.lobes.unwrap_or(shade.decode.lobes);
        if let Some(exact) = self.exact {
            shade.decode.interpolation = if exact { Interpolation::Exact } else { Interpolation::Fast };
        }
        if let Some(heights) = self.heights.and_then(|number| HeightUse::ALL.get(number)) {
            shade.decode.heights = *heights;
        }
        if let Some(irradiance) = self.irradiance {
            shade.sky = if irradiance { SkyLight::Irradiance } else { SkyLight::Rays };
        }
        shade
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::backend::GpuTracer;
    use crate::scene::asset::SceneAsset;
    use crate::scene::scene::MeshChoice;
    use crate::window::pictures::renderer::Renderer;
    use btf_runtime::testing::sample_spectral_asset;
    use std::sync::Arc;

    fn seen() -> (Scene, Panel, Split) {
        let scene = Scene::built_in(&MeshChoice::Sphere, vec![Arc::new(SceneAsset::built_in())], [1.0; 2]).unwrap();
        let panel = Panel::new(&scene, ShadeOptions::default(), Renderer::Gpu(GpuTracer::Bvh));
        (scene, panel, Split::new(8.0))
    }

    #[test]
    fn what_the_sender_saw_comes_back_and_what_is_usual_takes_no_room() {
        let (usual, _, unsplit) = seen();
        assert_eq!(LinkedView::of(&usual, &usual, &ShadeOptions::default(), &unsplit).text(), "{}");
        let (mut scene, mut panel, mut split) = seen();
        scene.camera.orbit(0.3, 0.2);
        scene.exposure_ev = 1.5;
        scene.lights.push(PointLight { position: Vec3::Y, intensity: [3.0, 2.0, 1.0] });
        scene.ambient = scene.usual_ambient();
        panel.shade.mode = RenderMode::Path;
        panel.shade.decode.components = 3;
        (split.on, split.difference, split.against) = (true, true, Against::Measured);
        let sent = LinkedView::of(&scene, &usual, &panel.shade, &split).text();
        let (mut received, mut other_panel, mut other_split) = seen();
        LinkedView::read(&sent).apply(&mut received, &mut other_panel, &mut other_split);
        assert_eq!((received.camera, received.exposure_ev), (scene.camera, scene.exposure_ev));
        assert_eq!((&received.lights, received.ambient), (&scene.lights, scene.ambient));
        assert_eq!(other_panel.shade, panel.shade);
        assert!(other_split.on && other_split.difference && other_split.against == Against::Measured);
        assert_eq!(LinkedView::of(&received, &usual, &other_panel.shade, &other_split).text(), sent);
    }

    #[test]
    fn a_link_tells_the_illuminant_of_assets_in_bands() {
        let bands = Arc::new(SceneAsset::new("bands", sample_spectral_asset(6, 8, 8)));
        let usual = Scene::built_in(&MeshChoice::Sphere, vec![bands], [1.0; 2]).unwrap();
        let (mut scene, split) = (usual.clone(), Split::new(1.0));
        show_under(&mut scene, "A");
        let sent = LinkedView::of(&scene, &usual, &ShadeOptions::default(), &split).text();
        assert_eq!(sent, r#"{"illuminant":"A"}"#);
        let mut received = usual.clone();
        let mut panel = Panel::new(&received, ShadeOptions::default(), Renderer::Gpu(GpuTracer::Bvh));
        LinkedView::read(&sent).apply(&mut received, &mut panel, &mut Split::new(1.0));
        assert_eq!(illuminant_of(&received), Some("A"));
        assert_eq!(illuminant_of(&usual), Some("D65"));
    }

    #[test]
    fn links_that_are_none_or_ask_for_nonsense_change_nothing() {
        let usual = seen().0;
        for text in [
            "",
            "nonsense",
            "[1]",
            r#"{"camera":[[0,0,0],[0,0,0],[0,1,0],40]}"#,
            r#"{"camera":[[1e39,0,0],[0,0,0],[0,1,0],40]}"#,
            r#"{"exposure":1e9}"#,
            r#"{"heights":77,"displacement":-1}"#,
        ] {
            let (mut scene, mut panel, mut split) = seen();
            LinkedView::read(text).apply(&mut scene, &mut panel, &mut split);
            assert_eq!((scene.camera, scene.exposure_ev), (usual.camera, usual.exposure_ev), "{text}");
            assert_eq!(panel.shade, ShadeOptions::default(), "{text}");
        }
    }
}

//! The split view: the picture beside another one of the same scene, or the difference of both.

use super::side::Side;
use crate::gpu::Gpu;
use crate::options::{RenderMode, ShadeOptions};
use crate::scene::{Body, Scene};
use btf_runtime::{DecodeOptions, Edits, Interpolation};
use std::sync::Arc;

/// What the picture is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Against {
    /// Everything that the assets have: all components and lobes, exact interpolation, the finest texels.
    #[default]
    Everything,
    /// Traced paths.
    Paths,
    /// The assets without their edits.
    Measured,
    /// Another asset in place of the one that is edited.
    Asset(usize),
}

impl Against {
    pub(crate) fn name(self, scene: &Scene) -> String {
        match self {
            Against::Everything => "all detail".into(),
            Against::Paths => "path tracing".into(),
            Against::Measured => "as measured".into(),
            Against::Asset(asset) => scene.assets.get(asset).map_or_else(String::new, |asset| asset.name.clone()),
        }
    }

    /// What can be compared with in a scene, `edited` being its asset at hand.
    pub(crate) fn choices(scene: &Scene, edited: usize) -> Vec<Against> {
        let others = (0..scene.assets.len()).filter(|asset| *asset != edited).map(Against::Asset);
        [Against::Everything, Against::Paths, Against::Measured].into_iter().chain(others).collect()
    }

    /// Settings of the other picture.
    pub(crate) fn shade(self, shade: &ShadeOptions) -> ShadeOptions {
        match self {
            Against::Everything => {
                let all = DecodeOptions { interpolation: Interpolation::Exact, ..DecodeOptions::default() };
                ShadeOptions { decode: all, levels: false, ..*shade }
            }
            Against::Paths => ShadeOptions { mode: RenderMode::Path, ..*shade },
            Against::Measured | Against::Asset(_) => *shade,
        }
    }

    /// The other picture's scene, `edited` being the asset at hand.
    fn scene(self, scene: &Scene, edited: usize) -> Scene {
        let mut other = scene.clone();
        match self {
            Against::Everything | Against::Paths => {}
            Against::Measured => {
                for asset in other
                    .assets
                    .iter_mut()
                    .filter(|asset| asset.file.as_ref().is_some_and(|file| !file.asset.edits.list.is_empty()))
                {
                    Arc::make_mut(asset).set_edits(Edits::default());
                }
            }
            Against::Asset(shown) => {
                for material in other.materials.iter_mut().filter(|material| material.asset() == Some(edited)) {
                    material.body = Body::Asset(shown);
                }
            }
        }
        other
    }
}

/// The split view's state.
pub(crate) struct Split {
    pub on: bool,
    pub against: Against,
    /// Show `|a - b|` times [`Split::gain`] in place of both.
    pub difference: bool,
    pub gain: f32,
    /// Where the other picture begins, share of the width.
    pub place: f32,
    pub side: Side,
    scene: Option<Scene>,
}

impl Split {
    pub(crate) fn new(gain: f32) -> Split {
        Split {
            on: false,
            against: Against::default(),
            difference: false,
            gain,
            place: 0.5,
            side: Side::default(),
            scene: None,
        }
    }

    /// Begins anew, with another choice or another scene, in which asset `edited` is at hand.
    pub(crate) fn reset(&mut self, scene: &Scene, edited: usize) {
        (self.side, self.scene) = (Side::default(), None);
        if !Against::choices(scene, edited).contains(&self.against) {
            self.against = Against::default();
        }
    }

    /// Takes over an asset's edits, where the other picture shows them.
    pub(crate) fn update_edits(&mut self, gpu: &Gpu, scene: &Scene, asset: usize) {
        if let (Some(other), true) = (&mut self.scene, self.against != Against::Measured) {
            other.assets.clone_from(&scene.assets);
            self.side.update_edits(gpu, other, asset);
        }
    }

    /// The other picture's scene, with the camera, lights and surroundings of `scene`.
    pub(crate) fn scene(&mut self, scene: &Scene, edited: usize) -> (&mut Side, &Scene) {
        let against = self.against;
        let other = self.scene.get_or_insert_with(|| against.scene(scene, edited));
        let (assets, materials) = (std::mem::take(&mut other.assets), std::mem::take(&mut other.materials));
        let mut materials = materials;
        for (other, own) in materials.iter_mut().zip(&scene.materials) {
            other.displacement = own.displacement;
        }
        *other = Scene { assets, materials, ..scene.clone() };
        (&mut self.side, other)
    }
}

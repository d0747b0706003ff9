//! What pipelines are compiled for: WGSL's pipeline-overridable constants. What a picture does not need is left out, for the
//! more registers a shader takes the fewer of its threads a GPU has at a time (docs/results/gpu-cost.md).

use crate::gpu::results::timer::Pass;
use crate::options::{DecoderForm, ShadeOptions};
use crate::scene::scene::Scene;
use btf_runtime::{HeightUse, Interpolation};

/// Lights at a point from which on rows of residual are kept from one to the next: fewer seldom share a measured light.
const LIGHTS_THAT_SHARE_ROWS: usize = 4;

/// What the pipelines of a picture can do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct PipelineConstants {
    /// Everything is decoded anew for every light.
    pub whole_decoder: bool,
    /// There are assets.
    pub assets: bool,
    /// There are leaves.
    pub leaves: bool,
    /// Meshes fade into the volumes that stand for them, or shells of skins into coarser ones.
    pub lod_transition: bool,
    /// Materials are displaced by their heights.
    pub displacement: bool,
    /// A picture of light from all around is sampled.
    pub environment: bool,
    /// Point lights are drawn from more than are asked.
    pub drawn_lights: bool,
    /// Light after one bounce is cached.
    pub irradiance_volume: bool,
    /// Assets are decoded by the exact rule.
    pub exact: bool,
    /// The most that is made of heights, as [`HeightUse`] numbers it.
    pub heights: u32,
    /// Assets are edited.
    pub edits: bool,
    /// Bases of assets are packed.
    pub packed_bases: bool,
    /// Rows of bases, not packed, are not whole quads of words.
    pub uneven_rows: bool,
    /// Rows of residual are kept from light to light.
    pub kept_rows: bool,
}

impl PipelineConstants {
    /// Returns what a picture of `scene` needs.
    pub(crate) fn of(scene: &Scene, options: &ShadeOptions, decoder: DecoderForm) -> PipelineConstants {
        let heads = || scene.assets.iter().map(|asset| asset.head());
        let uses_heights = options.decode.heights != HeightUse::None && heads().any(|head| head.has_heights());
        let asked = scene.lights.len().min(options.light_samples as usize);
        let around = scene.environment.is_some() || scene.ambient.radiance.iter().any(|x| *x > 0.0);
        PipelineConstants {
            whole_decoder: decoder == DecoderForm::Whole,
            assets: !scene.assets.is_empty(),
            leaves: !scene.leaves.is_empty(),
            lod_transition: scene.hands_over(),
            displacement: scene.materials.iter().any(|material| material.displacement > 0.0),
            environment: scene.environment.is_some(),
            drawn_lights: asked < scene.lights.len(),
            irradiance_volume: options.uses_irradiance_volume(),
            exact: options.decode.interpolation == Interpolation::Exact,
            heights: if uses_heights { options.decode.heights as u32 } else { HeightUse::None as u32 },
            edits: heads().any(|head| head.has_edits()),
            packed_bases: heads().any(|head| head.has_packed_bases()),
            uneven_rows: heads().any(|head| head.has_uneven_rows()),
            kept_rows: asked + usize::from(scene.sun.is_some()) + usize::from(around) >= LIGHTS_THAT_SHARE_ROWS,
        }
    }

    /// Returns what serves both.
    pub(crate) fn and(self, other: PipelineConstants) -> PipelineConstants {
        PipelineConstants {
            whole_decoder: self.whole_decoder | other.whole_decoder,
            assets: self.assets | other.assets,
            leaves: self.leaves | other.leaves,
            lod_transition: self.lod_transition | other.lod_transition,
            displacement: self.displacement | other.displacement,
            environment: self.environment | other.environment,
            drawn_lights: self.drawn_lights | other.drawn_lights,
            irradiance_volume: self.irradiance_volume | other.irradiance_volume,
            exact: self.exact | other.exact,
            heights: self.heights.max(other.heights),
            edits: self.edits | other.edits,
            packed_bases: self.packed_bases | other.packed_bases,
            uneven_rows: self.uneven_rows | other.uneven_rows,
            kept_rows: self.kept_rows | other.kept_rows,
        }
    }

    /// Tells whether these pipelines also serve what `needed` asks for.
    pub(crate) fn serve(self, needed: PipelineConstants) -> bool {
        self.and(needed) == self
    }

    /// Returns the values by name, for the pipeline of a pass.
    pub(crate) fn values(self, pass: Pass) -> [(&'static str, f64); 14] {
        // The ray that goes on from a surface is one light.
        let kept_rows = self.kept_rows && pass != Pass::Scatter;
        [
            ("whole_decoder", u32::from(self.whole_decoder)),
            ("with_assets", u32::from(self.assets)),
            ("with_leaves", u32::from(self.leaves)),
            ("with_lod_transition", u32::from(self.lod_transition)),
            ("with_displacement", u32::from(self.displacement)),
            ("with_environment", u32::from(self.environment)),
            ("with_drawn_lights", u32::from(self.drawn_lights)),
            ("with_irradiance_volume", u32::from(self.irradiance_volume)),
            ("with_exact_rule", u32::from(self.exact)),
            ("most_heights", self.heights),
            ("with_edits", u32::from(self.edits)),
            ("with_packed_bases", u32::from(self.packed_bases)),
            ("with_uneven_rows", u32::from(self.uneven_rows)),
            ("with_kept_rows", u32::from(kept_rows)),
        ]
        .map(|(name, value)| (name, f64::from(value)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::environment::Environment;
    use crate::scene::asset::SceneAsset;
    use crate::scene::scene::MeshChoice;
    use btf_runtime::{Edit, Edits, PackedGoal};
    use std::sync::Arc;

    #[test]
    fn pictures_need_what_their_scene_and_options_have() {
        let shade = ShadeOptions::default();
        let of = |scene: &Scene, shade: &ShadeOptions| PipelineConstants::of(scene, shade, DecoderForm::default());
        let scene = Scene::built_in(&MeshChoice::Sphere, vec![Arc::new(SceneAsset::built_in())], [1.0; 2]).unwrap();
        let plain = of(&scene, &shade);
        let changed = |change: &dyn Fn(&mut Scene, &mut ShadeOptions)| {
            let (mut scene, mut shade) = (scene.clone(), shade);
            change(&mut scene, &mut shade);
            of(&scene, &shade)
        };
        assert!(plain.assets && !plain.edits && !plain.kept_rows && plain.heights == 0);
        let lights = |count: usize| changed(&|scene, _| scene.place_lights(count));
        assert!(!lights(1).kept_rows && lights(8).kept_rows && !lights(8).drawn_lights);
        let few = changed(&|scene, shade| {
            scene.place_lights(8);
            shade.light_samples = 2;
        });
        assert!(few.drawn_lights && !few.kept_rows);
        assert!(!plain.irradiance_volume && changed(&|_, shade| shade.irradiance_cells = 8).irradiance_volume);
        assert!(changed(&|_, shade| shade.decode.interpolation = Interpolation::Exact).exact);
        assert!(changed(&|scene, _| scene.materials[0].displacement = 1.0).displacement);
        assert!(
            changed(&|scene, _| scene.assets.clear())
                == PipelineConstants { assets: false, uneven_rows: false, ..plain }
        );
        let grey = || Some(Arc::new(Environment::new(4, 2, &[1.0; 24])));
        assert!(changed(&|scene, _| scene.environment = grey()).environment);
        let texels = (scene.assets[0].head().width() * scene.assets[0].head().height()) as usize;
        let edited = changed(&|scene, _| {
            let edits = Edits { list: vec![Edit { tint: [0.5; 3], ..Edit::default() }], texels: vec![1; texels] };
            Arc::make_mut(&mut scene.assets[0]).set_edits(edits);
        });
        assert!(edited.edits);
        let packed = changed(&|scene, _| {
            scene.assets[0] = Arc::new(scene.assets[0].packed(PackedGoal::of_psnr(40.0)));
        });
        assert!(packed.packed_bases && !plain.packed_bases);
        // Pipelines serve what they were compiled for and less.
        assert!(edited.serve(plain) && !plain.serve(edited) && plain.and(edited).serve(edited));
        let value = |constants: PipelineConstants, pass, name| {
            constants.values(pass).into_iter().find(|(other, _)| *other == name).map(|(_, value)| value)
        };
        assert_eq!(value(lights(8), Pass::Light, "with_kept_rows"), Some(1.0));
        assert_eq!(value(lights(8), Pass::Scatter, "with_kept_rows"), Some(0.0));
    }
}

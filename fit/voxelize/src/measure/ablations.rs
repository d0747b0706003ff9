//! Volumes that lack one of their terms each, and volumes by the rule of 1996 that the terms replace: what each term is
//! worth.

use crate::build::build::{BuildRule, VoltexParams, build_voltex, build_with};
use crate::build::extinction::extinction_of;
use crate::build::refit::RefitParams;
use crate::build::shadow::ShadowParams;
use crate::error::VoxelizeError;
use crate::model::microflakes::MicroflakeSums;
use crate::model::triangle_model::TriangleModel;
use crate::rays::march::{MarchParams, Reflection};
use btf_runtime::voltex::{LevelShadow, LightCorrection, Sym3, Volume, Voxel, moment_of};

/// Term that is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ablation {
    /// Extinction as the microflakes' areas give it, without a refit.
    NoRefit,
    /// Linear S: the sum of the microflakes' own matrices in place of least squares of their projected areas.
    LinearS,
    /// Linear S without the refit, which makes up for a part.
    LinearSNoRefit,
    /// Isotropic extinction: equal in all directions.
    Isotropic,
    /// Isotropic extinction without the refit.
    IsotropicNoRefit,
    /// Shadows without a fit: rays to the light begin at the microflakes, and eye and light share no gaps.
    NoShadowFit,
    /// The rule of 1996: the same extinction in all directions, light summed over an ellipsoid's normals, nothing
    /// fitted, voxels of a pixel and one ray [Neyret 1996].
    Rule1996,
    /// Leaves and what bears them as microflakes of one sort.
    OneSort,
    /// Clumping that is equal in all directions.
    EvenClumping,
    /// Four rays a pixel through voxels of one pixel in place of half of one.
    WideVoxels,
    /// One ray a pixel, through voxels of one.
    OneRay,
    /// One ray a pixel, through voxels of half of one.
    OneRayNarrowVoxels,
    /// Sixteen rays a pixel, through voxels of a quarter of one.
    SixteenRays,
    /// Sixteen rays a pixel, through voxels of half of one.
    SixteenRaysWideVoxels,
}

impl Ablation {
    /// All ablations.
    pub const ALL: [Ablation; 14] = [
        Ablation::NoRefit,
        Ablation::LinearS,
        Ablation::LinearSNoRefit,
        Ablation::Isotropic,
        Ablation::IsotropicNoRefit,
        Ablation::NoShadowFit,
        Ablation::Rule1996,
        Ablation::OneSort,
        Ablation::EvenClumping,
        Ablation::OneRay,
        Ablation::SixteenRays,
        Ablation::OneRayNarrowVoxels,
        Ablation::WideVoxels,
        Ablation::SixteenRaysWideVoxels,
    ];

    /// Returns the name of the ablation.
    pub fn name(self) -> &'static str {
        match self {
            Ablation::NoRefit => "extinction not refitted",
            Ablation::LinearS => "S linear",
            Ablation::LinearSNoRefit => "S linear, not refitted",
            Ablation::Isotropic => "isotropic extinction",
            Ablation::IsotropicNoRefit => "isotropic extinction, not refitted",
            Ablation::NoShadowFit => "shadows not fitted",
            Ablation::Rule1996 => "rule of 1996",
            Ablation::OneSort => "one sort of microflakes a voxel",
            Ablation::EvenClumping => "clumping the same in all directions",
            Ablation::WideVoxels => "voxels of one pixel",
            Ablation::OneRay => "1 ray a pixel",
            Ablation::OneRayNarrowVoxels => "1 ray a pixel, voxels of half a pixel",
            Ablation::SixteenRays => "16 rays a pixel",
            Ablation::SixteenRaysWideVoxels => "16 rays a pixel, voxels of half a pixel",
        }
    }

    /// Returns the volume of a model without the term, as fine as `volume`, and how to look at it.
    ///
    /// Cost: that of building one, for those that differ in the volume.
    ///
    /// # Errors
    /// As [`build_voltex`].
    pub fn apply(self, model: &TriangleModel, volume: &Volume) -> Result<(Volume, MarchParams), VoxelizeError> {
        let params = VoltexParams { resolution: 1 << volume.level_count(), ..VoltexParams::default() };
        let not_refitted = VoltexParams { refit: RefitParams { views: 0, ..params.refit }, ..params };
        let march = MarchParams::default();
        Ok(match self {
            Ablation::NoRefit => (build_voltex(model, &not_refitted)?, march),
            Ablation::LinearS => (build_with(model, &params, LINEAR)?, march),
            Ablation::LinearSNoRefit => (build_with(model, &not_refitted, LINEAR)?, march),
            Ablation::Isotropic => (build_with(model, &params, ISOTROPIC)?, march),
            Ablation::IsotropicNoRefit => (build_with(model, &not_refitted, ISOTROPIC)?, march),
            Ablation::NoShadowFit => (without_shadows(volume.clone()), march),
            Ablation::Rule1996 => {
                let plain = VoltexParams { shadow: ShadowParams { views: 0, ..params.shadow }, ..not_refitted };
                let volume = without_shadows(build_with(model, &plain, BuildRule { sorted: false, ..ISOTROPIC })?);
                (volume, MarchParams { rays: 1, finer: 0, reflection: Reflection::Ellipsoid })
            }
            Ablation::OneSort => {
                (build_with(model, &params, BuildRule { sorted: false, ..BuildRule::default() })?, march)
            }
            Ablation::EvenClumping => (evenly_clumped(volume.clone()), march),
            Ablation::WideVoxels => (volume.clone(), MarchParams { finer: 0, ..march }),
            Ablation::OneRay => (volume.clone(), MarchParams { rays: 1, finer: 0, ..march }),
            Ablation::OneRayNarrowVoxels => (volume.clone(), MarchParams { rays: 1, ..march }),
            Ablation::SixteenRays => (volume.clone(), MarchParams { rays: 4, finer: 2, ..march }),
            Ablation::SixteenRaysWideVoxels => (volume.clone(), MarchParams { rays: 4, ..march }),
        })
    }
}

fn without_shadows(mut volume: Volume) -> Volume {
    for level in &mut volume.levels {
        (level.shadow, level.light_correction) = (LevelShadow::default(), LightCorrection::default());
    }
    volume
}

fn evenly_clumped(mut volume: Volume) -> Volume {
    for level in &mut volume.levels {
        let mean = level.clumping.trace() / 3.0;
        level.clumping = Sym3([mean, mean, mean, 0.0, 0.0, 0.0]);
    }
    volume
}

const LINEAR: BuildRule = BuildRule { voxel: linear, sorted: true };
const ISOTROPIC: BuildRule = BuildRule { voxel: isotropic, sorted: true };

/// Returns a voxel with the linear S: area A times the sum of `a n n'`, per volume squared [Heitz 2015].
fn linear(sums: &MicroflakeSums, volume: f32, material: u32) -> Voxel {
    Voxel::new(Sym3(sums.moment).scale(sums.area / (volume * volume)), material)
}

/// Returns a voxel whose microflakes hide half of their area from everywhere, and reflect as they lie.
fn isotropic(sums: &MicroflakeSums, volume: f32, material: u32) -> Voxel {
    let square = (0.5 * sums.area / volume).powi(2);
    let moment = moment_of(&extinction_of(sums, volume));
    Voxel { extinction: Sym3([square, square, square, 0.0, 0.0, 0.0]), moment, material }
}

//! From a model to a volume.

use super::extinction::extinction_of;
use super::flakes::FlakeSums;
use super::gather::{Gather, VoxelSums};
use super::model::TriangleModel;
use super::occluder::Occluder;
use super::palette::Palette;
use super::refit::{RefitParams, refit};
use super::shadow::{Lit, ShadowParams, fit_shadow};
use crate::error::FitError;
use btf_runtime::voltex::{Voltex, Volume, VolumeLevel, Voxel, order};
use glam::Vec3;

/// How a volume is built.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VoltexParams {
    /// Voxels a side of the finest level, a power of two from 1 to 4096.
    pub resolution: u32,
    /// How extinction is refitted.
    pub refit: RefitParams,
    /// How shadows are fitted.
    pub shadow: ShadowParams,
}

impl Default for VoltexParams {
    fn default() -> VoltexParams {
        VoltexParams { resolution: 64, refit: RefitParams::default(), shadow: ShadowParams::default() }
    }
}

/// Levels that have fewer voxels a side than this are not refitted: all of a plant is in a few of them.
const LEAST_SIDE: u32 = 2;

impl Lit for TriangleModel {
    fn surface(&self, triangle: usize) -> ([f32; 2], Vec3) {
        let colour = &self.colours[self.materials[triangle] as usize];
        let grey = |rgb: [f32; 3]| (rgb[0] + rgb[1] + rgb[2]) / 3.0;
        ([grey(colour.reflectance), grey(colour.transmittance)], self.normal(triangle))
    }
}

/// Where a model lies in the unit cube.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// The corner of the cube, metres.
    pub origin: Vec3,
    /// Its side, metres.
    pub side_m: f32,
}

impl Frame {
    /// The cube over a model: it stands on the cube's floor, in the middle.
    ///
    /// # Errors
    /// [`FitError::Model`] for a model without extent.
    pub fn around([lo, hi]: [Vec3; 2]) -> Result<Frame, FitError> {
        let side_m = (hi - lo).max_element() * MARGIN;
        if !(side_m.is_finite() && side_m > 0.0) {
            return Err(FitError::Voltex("the model has no extent, so there is nothing to make a volume of".into()));
        }
        let middle = 0.5 * (lo + hi);
        Ok(Frame {
            origin: Vec3::new(middle.x - 0.5 * side_m, middle.y - 0.5 * side_m, lo.z - 0.5 * (MARGIN - 1.0) * side_m),
            side_m,
        })
    }

    /// A point in metres as one of the cube.
    pub fn cube_from_m(&self, p: Vec3) -> Vec3 {
        (p - self.origin) / self.side_m
    }
}

/// How much larger than the model the cube is, so that nothing lies on its faces.
const MARGIN: f32 = 1.001;

/// Builds a volume of triangles.
///
/// # Errors
/// [`FitError::Voltex`] for a model without extent.
pub fn build_voltex(model: &TriangleModel, params: &VoltexParams) -> Result<Volume, FitError> {
    build_with(model, params, voxel_of)
}

/// What makes a voxel of flakes in a cell of a volume, and of the number of their material.
pub(super) type VoxelRule = fn(&FlakeSums, f32, u32) -> Voxel;

/// The rule that volumes are built by.
fn voxel_of(sums: &FlakeSums, volume: f32, material: u32) -> Voxel {
    Voxel::new(extinction_of(sums, volume), material)
}

/// As [`build_voltex`], with another rule.
pub(super) fn build_with(
    model: &TriangleModel,
    params: &VoltexParams,
    voxel_of: VoxelRule,
) -> Result<Volume, FitError> {
    let frame = Frame::around(model.bounds())?;
    let cube = model.in_cube(&frame);
    let mut gather = Gather::new(params.resolution);
    for (triangle, material) in cube.triangles.iter().zip(&cube.materials) {
        let material = *material as usize;
        gather.add_triangle(*triangle, &cube.colours[material], cube.weights[material]);
    }
    let mut volume = volume_with(&gather.levels(), voxel_of);
    volume.side_m = frame.side_m;
    fit_to_rays(&mut volume, &Occluder::new(&cube.triangles), &cube, params);
    Ok(volume)
}

/// The volume of levels of flakes, finest first, as if flakes lay anywhere in their voxels. It fills the cube.
pub(super) fn volume_of(levels: &[VoxelSums]) -> Volume {
    volume_with(levels, voxel_of)
}

fn volume_with(levels: &[VoxelSums], voxel_of: VoxelRule) -> Volume {
    let mut palette = Palette::default();
    let finest = (1u32 << (levels.len() - 1)) as f32;
    let levels = levels
        .iter()
        .enumerate()
        .map(|(level, cells)| {
            let side = (1u32 << level) as f32 / finest;
            let voxel = |sums| voxel_of(sums, side * side * side, palette.number(sums));
            let mut voxels: Vec<_> = cells
                .iter()
                .map(|(at, sums)| (*at, sums))
                .map({
                    let mut voxel = voxel;
                    move |(at, sums)| (at, voxel(sums))
                })
                .collect();
            voxels.sort_by_key(|(at, _)| order(*at));
            VolumeLevel { voxels, ..VolumeLevel::default() }
        })
        .collect();
    Volume { side_m: 1.0, extent: [1.0; 3], levels, materials: palette.materials(), ..Volume::default() }
}

/// Fits extinction and shadows of every level to rays past the triangles that the volume was made of.
pub(super) fn fit_to_rays(volume: &mut Volume, occluder: &Occluder, lit: &impl Lit, params: &VoltexParams) {
    let mut voltex = Voltex::new(volume);
    for level in 0..=voltex.level_count() {
        if params.resolution >> level >= LEAST_SIDE {
            refit(&mut voltex, level, occluder, &params.refit);
        }
        let shadow = fit_shadow(&voltex, level, occluder, lit, &params.shadow);
        voltex.set_shadow(level, &shadow);
        let numbers = voltex.numbers_at(level);
        let own = &mut volume.levels[level as usize];
        own.shadow = shadow;
        own.voxels.iter_mut().zip(numbers).for_each(|((_, voxel), number)| *voxel = voltex.voxel(number));
    }
}

//! How leaves of a canopy stand: area, inclination, and the gaps between them.

use super::cell::{CanopyCell, Met, Organ};
use crate::sampler;
use glam::{Vec2, Vec3};
use serde::Serialize;
use std::f32::consts::{FRAC_PI_2, TAU};

/// Classes of inclination, 10 degrees each.
pub const INCLINATION_CLASSES: usize = 9;
/// Angles from the zenith in degrees at which gaps are measured.
const GAP_ANGLES_DEG: [f64; 6] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0];
/// Azimuths that the projection of leaves is averaged over.
const AZIMUTHS: usize = 36;

/// Structure of a canopy.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CanopyStructure {
    /// Area of one face of all leaves over that of the soil, of the triangles that are drawn.
    pub leaf_area_index: f64,
    /// Area of the surfaces of all other organs over that of the soil, inner sides not counted.
    pub other_area_index: f64,
    /// Leaves in the cell.
    pub leaves: usize,
    /// Plants in the cell.
    pub plants: usize,
    /// Area of the soil in square metres.
    pub ground_m2: f64,
    /// Height of the highest point in metres.
    pub height_m: f64,
    /// Share of leaf area with an inclination from the horizontal of 0 to 10, 10 to 20, ... 80 to 90 degrees.
    pub inclination_shares: [f64; INCLINATION_CLASSES],
    /// Mean inclination by area in degrees.
    pub mean_inclination_deg: f64,
    /// Gaps by direction.
    pub gaps: Vec<Gap>,
}

/// Share of rays from a direction that reach the soil.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gap {
    /// Angle from the zenith in degrees; the mean over azimuths.
    pub zenith_deg: f64,
    /// Share of rays that meet nothing.
    pub gap_fraction: f64,
    /// Standard error of the share.
    pub standard_error: f64,
    /// Mean projection of a unit of leaf area onto a plane across the direction, Ross' G.
    pub projection: f64,
    /// `-ln(gap) cos / (G x leaf area index)`: 1 where leaves are strewn at random, less where they are clumped [Nilson 1971].
    /// Other organs close gaps, too. None where no ray came through.
    pub clumping: Option<f64>,
}

/// Measures a canopy's structure with `rays` rays for each direction.
pub(crate) fn structure(cell: &CanopyCell, rays: u32, seed: u32) -> CanopyStructure {
    let mut shares = [0.0; INCLINATION_CLASSES];
    let (mut leaf_m2, mut other_m2, mut sum_deg) = (0.0, 0.0, 0.0);
    let mut projected = [0.0; GAP_ANGLES_DEG.len()];
    for triangle in cell.triangles() {
        if triangle.organ == Organ::Other {
            other_m2 += triangle.area_m2;
            continue;
        }
        let inclination_deg = triangle.inclination_deg();
        let class = ((inclination_deg / 10.0) as usize).min(INCLINATION_CLASSES - 1);
        shares[class] += triangle.area_m2;
        leaf_m2 += triangle.area_m2;
        sum_deg += inclination_deg * triangle.area_m2;
        for (sum, zenith_deg) in projected.iter_mut().zip(GAP_ANGLES_DEG) {
            *sum += triangle.area_m2 * projection(triangle.normal, zenith_deg);
        }
    }
    let leaf_area_index = leaf_m2 / cell.ground_m2();
    let gap = |(at, zenith_deg): (usize, f64)| {
        let gap_fraction = gap_fraction(cell, zenith_deg, rays, seed.wrapping_add(at as u32));
        let projection = projected[at] / leaf_m2.max(f64::MIN_POSITIVE);
        let depth = projection * leaf_area_index / zenith_deg.to_radians().cos();
        Gap {
            zenith_deg,
            gap_fraction,
            standard_error: (gap_fraction * (1.0 - gap_fraction) / f64::from(rays)).sqrt(),
            projection,
            clumping: (gap_fraction > 0.0 && depth > 0.0).then(|| -gap_fraction.ln() / depth),
        }
    };
    CanopyStructure {
        leaf_area_index,
        other_area_index: other_m2 / cell.ground_m2(),
        leaves: cell.leaves(),
        plants: cell.plants(),
        ground_m2: cell.ground_m2(),
        height_m: cell.height_m(),
        inclination_shares: shares.map(|share| share / leaf_m2.max(f64::MIN_POSITIVE)),
        mean_inclination_deg: sum_deg / leaf_m2.max(f64::MIN_POSITIVE),
        gaps: GAP_ANGLES_DEG.into_iter().enumerate().map(gap).collect(),
    }
}

/// Returns the direction of an angle from the zenith and an azimuth from north (-z) over east (+x).
pub(crate) fn direction(zenith_rad: f32, azimuth_rad: f32) -> Vec3 {
    let across = Vec2::new(azimuth_rad.sin(), -azimuth_rad.cos()) * zenith_rad.sin();
    Vec3::new(across.x, zenith_rad.cos(), across.y)
}

/// Returns the mean over azimuths of how large a unit of area appears.
fn projection(normal: Vec3, zenith_deg: f64) -> f64 {
    let zenith = zenith_deg.to_radians() as f32;
    let at = |i: usize| direction(zenith, TAU * (i as f32 + 0.5) / AZIMUTHS as f32).dot(normal).abs();
    (0..AZIMUTHS).map(|i| f64::from(at(i))).sum::<f64>() / AZIMUTHS as f64
}

fn gap_fraction(cell: &CanopyCell, zenith_deg: f64, rays: u32, seed: u32) -> f64 {
    // Rays along the soil meet everything.
    let zenith = (zenith_deg.to_radians() as f32).min(FRAC_PI_2 - 1e-3);
    let comes_through = |ray: &u32| {
        let azimuth = TAU * sampler::two(*ray, seed ^ 0x5bd1_e995)[0];
        let from = cell.above(sampler::two(*ray, seed));
        matches!(cell.follow(from, -direction(zenith, azimuth)), Met::Soil(_))
    };
    (0..rays).filter(comes_through).count() as f64 / f64::from(rays)
}

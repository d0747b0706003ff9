//! Mountains under forest: 25,000 trees on 1,404 patches, two to a texel.
//!
//! | where | species |
//! |---|---|
//! | valleys | broad-leaved trees |
//! | heights, from a third of the peaks' on, with both in a zone between | spruces, smaller towards the peaks |
//! | steep places | broad-leaved trees in the colours of autumn |
//!
//! Both trees of a texel are within their texel, on no line of its symmetry: in eight ways, by turns and mirrors, they stand in 16
//! places, and no rows are seen.

use super::counts::LandscapeCounts;
use super::planted::{
    Flora, Plant, Planted, Soil, TREE_FLUTTER, TREE_LEANING_M_PER_S, TREE_SHAPES, TURNED, chance, densest, inland, look,
};
use super::terrain::{Terrain, over_land, with_border_of};
use crate::volume::skin::{CellMap, Jitter, Noise, Pattern, Wind};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// Patches from west to east and from south to north.
const PATCHES: [u32; 2] = [36, 39];
/// Texels of a patch along both.
const TEXELS_OF_PATCH: [u32; 2] = [4, 3];
/// Texels with trees.
const TEXELS: usize = 12_500;
/// Trees of a texel.
const TREES: u64 = 2;
/// Floor of a forest, and meadows.
const SOIL: Soil = Soil { reflectance: [0.026, 0.04, 0.013], noise: [2.0, 1.65, 1.7], unit_m: 1280.0 };
/// Height of the mountains.
const PEAK_TEXELS: f32 = 22.0;
/// Width of mountains and of their ridges.
const MOUNTAIN_TEXELS: f32 = 48.0;

/// Width of the mountains' foot, along the border.
const FOOT_TEXELS: f32 = 46.0;
/// Width of the border where trees become fewer.
const BORDER_TEXELS: f32 = 10.0;
/// Width of groups of trees.
const GROUP_TEXELS: f32 = 11.0;
/// A clearing: its middle, from the middle of the southern border to the east and north, and its radius.
const CLEARING_TEXELS: [f32; 3] = [-6.0, 8.0, 3.6];
/// Heights from which spruces are the usual species, and from which trees stand apart, in shares of the peaks'.
const UPPER: f32 = 0.33;
/// See [`UPPER`].
const TREE_LINE: f32 = 0.8;
/// How much smaller trees are at the peaks.
const STUNTED: f32 = 0.4;
/// Numbers of the alternatives, which are volumes.
pub(super) const IN_VALLEYS: u8 = 0;
/// See [`IN_VALLEYS`].
pub(super) const ON_STEEP_PLACES: u8 = 1;
/// See [`IN_VALLEYS`].
pub(super) const ON_HEIGHTS: u8 = 2;
/// Factors on what leaves and bark reflect and transmit, by alternative, where one kind of trees stands for all.
const ALIKE_TINTS: [[f32; 3]; 3] = [[1.15, 1.1, 0.95], [1.6, 1.2, 0.7], [0.55, 0.7, 0.75]];
/// Factors on what broad-leaved trees reflect and transmit.
const BROAD_TINTS: [[f32; 3]; 2] = [ALIKE_TINTS[IN_VALLEYS as usize], ALIKE_TINTS[ON_STEEP_PLACES as usize]];
/// Factors on what spruces reflect and transmit.
const SPRUCE_TINTS: [[f32; 3]; 1] = [[0.75, 0.8, 0.9]];

/// Broad-leaved trees and spruces; or one kind of trees in three colours. Each volume is two trees in a cube, as `cargo xtask volumes` sets
/// them out.
pub(super) const FLORAS: [Flora; 2] = [
    Flora {
        told: "two broad-leaved trees, then two spruces",
        built_in: &[built_in!("forest"), built_in!("forest_spruce")],
        tints: &[&BROAD_TINTS, &SPRUCE_TINTS],
        plants: &[
            broad(0, &BROAD_TINTS),
            broad(1, &BROAD_TINTS),
            Plant { volume: 2, scale: 1.65, foot_m: Vec3::new(-1.6, 0.0, 0.55), tints: &SPRUCE_TINTS },
            Plant { volume: 2, scale: 1.5, foot_m: Vec3::new(1.75, 0.0, -1.15), tints: &SPRUCE_TINTS },
        ],
    },
    Flora {
        told: "two trees for all species",
        built_in: &[built_in!("forest")],
        tints: &[&ALIKE_TINTS],
        plants: &[broad(0, &ALIKE_TINTS), broad(1, &ALIKE_TINTS)],
    },
];

/// Returns one of the two broad-leaved trees of a texel.
const fn broad(number: usize, tints: &'static [[f32; 3]]) -> Plant {
    let (scale, foot_m) = [(0.9, Vec3::new(-1.15, 0.0, 0.5)), (0.85, Vec3::new(1.45, 0.0, -1.3))][number];
    Plant { volume: 0, scale, foot_m, tints }
}

/// Plants the forest; `side_m` is that of the volume, a texel's width.
pub(super) fn planted(times: u32, side_m: f32) -> Result<Planted, String> {
    let texels_of_patch = TEXELS_OF_PATCH.map(|count| count as f32);
    let terrain = Terrain::times(PATCHES, Vec2::from(texels_of_patch) * side_m, times, |size_m| {
        let peaks = Noise { wavelength: MOUNTAIN_TEXELS * side_m, period: [0; 3], seed: 2 };
        let ridges = Noise { wavelength: 0.4 * MOUNTAIN_TEXELS * side_m, period: [0; 3], seed: 9 };
        Box::new(move |at: Vec2| {
            // Level at the border, where the land goes on without a forest.
            let inland = inland(at, size_m, FOOT_TEXELS * side_m);
            let at = Vec3::new(at.x, at.y, 0.37 * peaks.wavelength);
            let shape = 0.45 + 0.8 * peaks.at(at) + 0.22 * (0.4 - ridges.at(at).abs());
            PEAK_TEXELS * side_m * shape.max(0.0) * inland
        })
    });
    let cells = grown(&terrain, times, side_m);
    // Smaller where it is high.
    let height = |at: Vec2| Vec3::Y * side_m * (1.0 - STUNTED * share_of_peak(&terrain, at, side_m).min(1.0));
    let rest = terrain.skin(cells.size.map(|count| count as f32), height, |_| Some(0))?;
    let jitter = Jitter {
        noise: Noise { wavelength: 6.1 * side_m, period: [0; 3], seed: 4 },
        coordinates: 2.0,
        length: 0.35,
        angle_deg: 0.0,
    };
    let skin = with_border_of(&jitter.apply(&rest)?, &rest)?;
    let texels = cells.content.iter().filter(|content| **content > 0).count() as u64;
    let trees = TREES * texels;
    let counts = LandscapeCounts {
        patches: skin.faces().len() as u64,
        texels,
        trees,
        primitives: TREE_SHAPES * trees,
        ..LandscapeCounts::default()
    };
    let south = -0.5 * terrain.size_m.y;
    let above = |east: f32, north: f32, height: f32| {
        terrain.on_ground(Vec2::new(east * side_m, south + north * side_m)) + Vec3::Y * height * side_m
    };
    let clearing = above(-5.4, 9.4, 0.3);
    let cameras = [
        look(above(-36.0, -16.0, 22.0), above(4.0, 55.0, 9.0), 42.0),
        look(above(-30.0, 12.0, 8.0), above(8.0, 64.0, 3.0), 45.0),
        look(clearing, clearing + Vec3::new(9.0, 1.9, -5.0) * side_m, 60.0),
    ];
    let wind = Wind { leaning_speed_m_per_s: TREE_LEANING_M_PER_S, flutter: TREE_FLUTTER, ..Wind::default() };
    let pattern =
        Pattern { cells: Some(Arc::new(cells)), ..Pattern::isolated(0, TURNED, 3).one_of(ALIKE_TINTS.len() as u32) };
    Ok(Planted { terrain, skin, patterns: vec![pattern], soil: SOIL, cameras, wind, counts })
}

/// Returns the height of the land over that of the peaks, nearly.
fn share_of_peak(terrain: &Terrain, at: Vec2, side_m: f32) -> f32 {
    (terrain.height_m)(at) / (PEAK_TEXELS * side_m)
}

/// Returns which texels have trees, and of which species: by height and slope, in groups, fewer towards the border and on
/// the peaks, none in a clearing.
fn grown(terrain: &Terrain, times: u32, side_m: f32) -> CellMap {
    let size = [0, 1].map(|axis| TEXELS_OF_PATCH[axis] * terrain.patches[axis]);
    let groups = Noise { wavelength: GROUP_TEXELS * side_m, period: [0; 3], seed: 17 };
    let [east, north, radius] = CLEARING_TEXELS.map(|texels| texels * side_m);
    let clearing = Vec2::new(east, north - 0.5 * terrain.size_m.y);
    let texels: Vec<([u32; 2], Vec2)> = (0..size[1])
        .flat_map(|row| (0..size[0]).map(move |column| [column, row]))
        .map(|texel| {
            let share = (Vec2::from(texel.map(|x| x as f32)) + 0.5) / Vec2::from(size.map(|x| x as f32));
            (texel, (share - 0.5) * terrain.size_m)
        })
        .collect();
    let density = |(texel, at): &([u32; 2], Vec2)| {
        let height = share_of_peak(terrain, *at, side_m);
        let cleared = 1.0 - (((*at - clearing).length() / radius - 0.8) / 0.4).clamp(0.0, 1.0);
        1.6 * inland(*at, terrain.size_m, BORDER_TEXELS * side_m)
            + 0.7 * over_land(&groups, *at)
            + 0.5 * chance(*texel, 3)
            - 1.5 * (height - TREE_LINE).max(0.0)
            - 3.0 * cleared
    };
    let densities: Vec<f32> = texels.par_iter().map(density).collect();
    let grows = densest(TEXELS * times as usize, &densities);
    let species = |(texel, at): &([u32; 2], Vec2)| {
        let height =
            share_of_peak(terrain, *at, side_m) + 0.25 * over_land(&groups, *at) + 0.55 * (chance(*texel, 11) - 0.5);
        let steep = 1.0 - terrain.normal(*at).y;
        match (height > UPPER, steep + 0.25 * (chance(*texel, 8) - 0.5) > 0.22) {
            (_, true) => ON_STEEP_PLACES,
            (true, false) => ON_HEIGHTS,
            (false, false) => IN_VALLEYS,
        }
    };
    let content = texels.par_iter().zip(&grows).map(|(texel, grows)| if *grows { 1 + species(texel) } else { 0 });
    CellMap { size, content: content.collect() }
}

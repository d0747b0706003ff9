//! Mountains under forest: 25,000 trees on 1,404 patches, two to a texel.
//!
//! Both are within their texel, on no line of its symmetry: in eight ways, by turns and mirrors, they stand in 16
//! places, and no rows are seen.

use super::counts::LandscapeCounts;
use super::planted::{Plant, Planted, TREE_FLUTTER, TREE_LEANING_M_PER_S, TREE_SHAPES, TURNED, look};
use super::terrain::{Terrain, texels_of, with_border_of};
use crate::scene::volume::AS_IT_IS;
use crate::volume::skin::{Jitter, Noise, Pattern, Wind};
use glam::{Vec2, Vec3};

/// Patches from west to east and from south to north.
const PATCHES: [u32; 2] = [36, 39];
/// Texels along both: the texture is not bound to the patches.
const TEXELS: [f32; 2] = [100.0, 125.0];
/// Trees of a texel.
const TREES: u64 = 2;
/// Floor of a forest.
const SOIL: [f32; 3] = [0.035, 0.05, 0.018];
/// Height of the mountains.
const PEAK_TEXELS: f32 = 26.0;
/// Width of mountains and of their ridges.
const MOUNTAIN_TEXELS: f32 = 48.0;

/// Width of the mountains' foot, along the border.
const FOOT_TEXELS: f32 = 22.0;

/// The volume that comes with the viewer: two trees in a cube.
pub(super) const VOLUMES: [&[u8]; 1] = [built_in!("forest")];

/// The trees of a texel, as `cargo xtask volumes` sets them out.
pub(super) const PLANTS: [Plant; TREES as usize] = [
    Plant { volume: 0, scale: 0.9, foot_m: Vec3::new(-1.15, 0.0, 0.5), tints: &[AS_IT_IS] },
    Plant { volume: 0, scale: 0.85, foot_m: Vec3::new(1.45, 0.0, -1.3), tints: &[AS_IT_IS] },
];

/// Plants the forest; `side_m` is that of the volume, a texel's width.
pub(super) fn planted(times: u32, side_m: f32) -> Result<Planted, String> {
    let texels_of_patch = [TEXELS[0] / PATCHES[0] as f32, TEXELS[1] / PATCHES[1] as f32];
    let terrain = Terrain::times(PATCHES, Vec2::from(texels_of_patch) * side_m, times, |size_m| {
        let peaks = Noise { wavelength: MOUNTAIN_TEXELS * side_m, period: [0; 3], seed: 2 };
        let ridges = Noise { wavelength: 0.4 * MOUNTAIN_TEXELS * side_m, period: [0; 3], seed: 9 };
        Box::new(move |at: Vec2| {
            // Level at the border, where the land goes on without a forest.
            let inland = ((0.5 * size_m - at.abs()).min_element() / (FOOT_TEXELS * side_m)).clamp(0.0, 1.0);
            let at = Vec3::new(at.x, at.y, 0.37 * peaks.wavelength);
            let shape = 0.45 + 0.8 * peaks.at(at) + 0.22 * (0.4 - ridges.at(at).abs());
            PEAK_TEXELS * side_m * shape.max(0.0) * inland * inland * (3.0 - 2.0 * inland)
        })
    });
    let texels = [0, 1].map(|axis| terrain.patches[axis] as f32 * texels_of_patch[axis]);
    let rest = terrain.skin(texels, |_| Vec3::Y * side_m, |_, _| 0)?;
    let jitter = Jitter {
        noise: Noise { wavelength: 6.1 * side_m, period: [0; 3], seed: 4 },
        coordinates: 2.0,
        length: 0.35,
        angle_deg: 0.0,
    };
    let skin = with_border_of(&jitter.apply(&rest)?, &rest)?;
    let texels = texels_of(&skin).round() as u64;
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
        terrain.at(Vec2::new(east * side_m, south + north * side_m)) + Vec3::Y * height * side_m
    };
    let cameras = [
        look(above(-42.0, -30.0, 36.0), above(0.0, 55.0, 0.0), 42.0),
        look(above(-25.0, 8.0, 16.0), above(6.0, 60.0, 0.0), 45.0),
        look(above(-14.0, 30.0, 3.2), above(-6.0, 44.0, 1.0), 50.0),
    ];
    let wind = Wind { leaning_speed_m_per_s: TREE_LEANING_M_PER_S, flutter: TREE_FLUTTER, ..Wind::default() };
    Ok(Planted { terrain, skin, patterns: vec![Pattern::isolated(0, TURNED, 3)], soil: SOIL, cameras, wind, counts })
}

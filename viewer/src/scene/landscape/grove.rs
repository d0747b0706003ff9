//! Trees that stand apart on flat land: 512 on 1,024 patches, each another size, turn, place and colour of one tree.

use super::counts::LandscapeCounts;
use super::planted::{
    Flora, Plant, Planted, Soil, TREE_FLUTTER, TREE_LEANING_M_PER_S, TREE_SHAPES, chance, densest, inland, look,
};
use super::terrain::{Terrain, over_land};
use crate::volume::skin::{DiscreteJitter, Noise, Pattern, Wind};
use glam::{Vec2, Vec3};

/// Patches from west to east and from south to north.
const PATCHES: [u32; 2] = [32, 32];
/// Meadow.
const SOIL: Soil = Soil { reflectance: [0.06, 0.085, 0.028], noise: [1.75, 1.3, 1.45], unit_m: 320.0 };
/// Width of groups of trees and of clearings, patches.
const GROUP_PATCHES: f32 = 7.0;
/// Width of the land's border where trees become fewer, patches.
const BORDER_PATCHES: f32 = 7.0;
/// Factors on what leaves and bark reflect and transmit: the materials of the trees.
const TINTS: [[f32; 3]; 3] = [[1.0; 3], [1.45, 1.12, 0.7], [0.72, 0.85, 0.9]];
/// Numbers of the patterns.
const CLEARING: u32 = 0;
/// See [`CLEARING`].
const TREE: u32 = 1;
/// Content of the volume that comes with the viewer ends so far from its sides.
const MARGIN: f32 = 0.14;

/// A tree in the middle of a cube.
pub(super) const FLORAS: [Flora; 1] =
    [Flora { told: "a tree", built_in: &[built_in!("tree")], tints: &[&TINTS], plants: &[Plant::alone(0, &TINTS)] }];

/// Plants the grove; `side_m` is that of the volume, a texel's width.
pub(super) fn planted(times: u32, side_m: f32) -> Result<Planted, String> {
    let terrain = Terrain::times(PATCHES, Vec2::splat(side_m), times, |_| Box::new(|_| 0.0));
    // Half of the patches have a tree: those in groups, and fewer towards the border.
    let groups = Noise { wavelength: GROUP_PATCHES * side_m, period: [0; 3], seed: 6 };
    let density = |patch: [u32; 2]| {
        let at = terrain.middle(patch);
        0.9 * inland(at, terrain.size_m, BORDER_PATCHES * side_m)
            + 0.8 * over_land(&groups, at)
            + 1.1 * chance(patch, 11)
    };
    let densities: Vec<f32> = terrain.all_patches().map(density).collect();
    let grows = densest(densities.len() / 2, &densities);
    let pattern = |patch: usize| Some(if grows[patch] { TREE } else { CLEARING });
    let skin = terrain.skin(terrain.patches.map(|count| count as f32), |_| Vec3::Y * side_m, pattern)?;
    let jitter =
        DiscreteJitter { empty: 0.0, scale: [0.6, 1.0], displacement: 0.5, margin: MARGIN, turns: true, mirrors: true };
    let patterns = vec![
        Pattern::isolated(0, DiscreteJitter { empty: 1.0, ..jitter }, 1),
        Pattern::isolated(0, jitter, 2).one_of(TINTS.len() as u32),
    ];
    let trees = skin.faces().iter().filter(|face| face.pattern == TREE).count() as u64;
    let counts = LandscapeCounts {
        patches: skin.faces().len() as u64,
        texels: trees,
        trees,
        primitives: TREE_SHAPES * trees,
        ..LandscapeCounts::default()
    };
    let south = 0.5 * terrain.size_m.y;
    let cameras = [
        look(
            Vec3::new(-4.0 * side_m, 2.4 * side_m, south + 1.0 * side_m),
            Vec3::new(0.0, 0.0, south - 8.0 * side_m),
            42.0,
        ),
        look(
            Vec3::new(0.0, 1.1 * side_m, south - 4.0 * side_m),
            Vec3::new(0.0, 0.7 * side_m, south - 10.0 * side_m),
            50.0,
        ),
        look(Vec3::new(0.0, 0.3 * side_m, south - 8.0 * side_m), Vec3::new(0.6, 0.42, south - 10.0 * side_m), 55.0),
    ];
    let wind = Wind { leaning_speed_m_per_s: TREE_LEANING_M_PER_S, flutter: TREE_FLUTTER, ..Wind::default() };
    Ok(Planted { terrain, skin, patterns, soil: SOIL, cameras, wind, counts })
}

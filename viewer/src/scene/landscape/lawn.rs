//! A lawn on a hill: 1,400 patches with a texel of 16 blades each and a flower in half of them.

use super::counts::LandscapeCounts;
use super::planted::{Flora, Plant, Planted, Soil, TURNED, chance, densest, look};
use super::terrain::{Terrain, over_land};
use crate::scene::volume::AS_IT_IS;
use crate::volume::skin::{Jitter, Noise, Pattern, Wind};
use glam::{Vec2, Vec3};

/// Patches with grass.
const PATCHES: usize = 1_400;
/// Patches of the land from west to east and from south to north: around the lawn there is grass here and there.
const LAND: [u32; 2] = [56, 48];
/// How far from the middle the lawn is half as dense as there, in shares of the way to the land's border.
const EDGE: f32 = 0.78;
/// Blades of a texel, as `btf-synth plants --species grass` grows them.
const BLADES: u64 = 16;
/// Shapes of a flower: stem, petals and its middle.
const FLOWER_SHAPES: u64 = 15;
/// Height of the hill over the shorter side of the land.
const HILL: f32 = 0.22;
/// Soil under moss.
const SOIL: Soil = Soil { reflectance: [0.045, 0.065, 0.02], noise: [2.0, 1.45, 1.6], unit_m: 40.0 };
/// How height vectors differ: tufts of some texels lean together.
const TUFT_TEXELS: f32 = 5.0;
/// Numbers of the patterns, and of the volumes.
const BARE: u32 = 0;
/// See [`BARE`].
const FLOWERING: u32 = 1;

/// Texels without and with a flower.
pub(super) const FLORAS: [Flora; 1] = [Flora {
    told: "grass without and with a flower",
    built_in: &[built_in!("lawn"), built_in!("lawn_flower")],
    tints: &[&[AS_IT_IS], &[AS_IT_IS]],
    plants: &[Plant::alone(BARE, &[AS_IT_IS]), Plant::alone(FLOWERING, &[AS_IT_IS])],
}];

/// Plants the lawn; `side_m` is that of the volumes, a texel's width.
pub(super) fn planted(times: u32, side_m: f32) -> Result<Planted, String> {
    let swell = Noise { wavelength: 12.0 * side_m, period: [0; 3], seed: 5 };
    let terrain = Terrain::times(LAND, Vec2::splat(side_m), times, |size_m| {
        Box::new(move |at| {
            let height = HILL * size_m.min_element();
            let out = (at / (0.5 * size_m)).length_squared().min(1.0);
            height * (1.0 - out).powi(2) * (1.0 + 0.25 * swell.at(Vec3::new(at.x, at.y, 0.0)))
        })
    });
    // Grass is dense in the middle and has a border of tufts; flowers are in half of it, where chance has them together.
    let tufts = Noise { wavelength: 6.0 * side_m, period: [0; 3], seed: 8 };
    let density = |patch: [u32; 2]| {
        let at = terrain.middle(patch);
        let out = (at / (0.5 * EDGE * terrain.size_m)).length();
        0.3 * over_land(&tufts, at) + 0.35 * chance(patch, 7) - out
    };
    let densities: Vec<f32> = terrain.all_patches().map(density).collect();
    let grows = densest(PATCHES * times as usize, &densities);
    let beds = Noise { wavelength: 9.0 * side_m, period: [0; 3], seed: 14 };
    let flowering = |(number, patch): (usize, [u32; 2])| {
        if grows[number] { over_land(&beds, terrain.middle(patch)) + chance(patch, 9) } else { f32::MIN }
    };
    let flowerings: Vec<f32> = terrain.all_patches().enumerate().map(flowering).collect();
    let flowers = densest(PATCHES * times as usize / 2, &flowerings);
    let pattern = |patch: usize| grows[patch].then_some(if flowers[patch] { FLOWERING } else { BARE });
    let texels = terrain.patches.map(|count| count as f32);
    let skin = terrain.skin(texels, |place| terrain.normal(place) * side_m, pattern)?;
    let jitter = Jitter {
        noise: Noise { wavelength: TUFT_TEXELS * side_m, period: [0; 3], seed: 3 },
        coordinates: 0.0,
        length: 0.3,
        angle_deg: 30.0,
    };
    let skin = jitter.apply(&skin)?;
    // Blades that a neighbour would go on with are cut where it is turned otherwise; repetition would be seen sooner.
    let patterns = vec![Pattern::isolated(BARE, TURNED, 1), Pattern::isolated(FLOWERING, TURNED, 2)];
    let flowers = skin.faces().iter().filter(|face| face.pattern == FLOWERING).count() as u64;
    let blades = BLADES * skin.faces().len() as u64;
    let counts = LandscapeCounts {
        patches: skin.faces().len() as u64,
        texels: skin.faces().len() as u64,
        blades,
        flowers,
        primitives: blades + FLOWER_SHAPES * flowers,
        ..LandscapeCounts::default()
    };
    // Whatever the land's extent, the pictures show its southern part from where its grass has the same size.
    let depth = terrain.size_m.y;
    let top = terrain.at(Vec2::ZERO);
    let front = terrain.at(Vec2::new(0.0, -0.2 * depth));
    let cameras = [
        look(Vec3::new(0.3 * depth, 0.27 * depth, 0.85 * depth), 0.7 * top, 36.0),
        look(top + Vec3::new(4.0, 6.5, 17.0) * side_m, top + Vec3::new(0.0, -0.5, 4.0) * side_m, 40.0),
        look(front + Vec3::new(1.0, 2.3, 4.2) * side_m, front + Vec3::new(0.0, 0.8, 0.0) * side_m, 45.0),
    ];
    // Land of a metre or two has gusts of its size, and blades give way to a breeze.
    let wind = Wind { gust_wavelength_m: 25.0 * side_m, leaning_speed_m_per_s: 5.0, flutter: 0.1, ..Wind::default() };
    Ok(Planted { terrain, skin, patterns, soil: SOIL, cameras, wind, counts })
}

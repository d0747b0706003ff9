//! Small volumetric textures of random microflakes, and rays through them.

use crate::testing::random::{Random, sphere_direction};
use crate::voltex::{
    Facets, LevelShadow, LightCorrection, MicroflakeMaterial, Sym3, VoltexRay, Volume, VolumeLevel, Voxel, order,
};
use std::collections::BTreeSet;

/// Returns a volume of `levels` levels (1 to 13), with `count` voxels at the finest or as many as there is room for.
pub fn sample_volume(seed: u64, levels: usize, count: usize) -> Volume {
    let mut random = Random::new(seed);
    let side = 1usize << (levels - 1);
    let mut cells: BTreeSet<[u32; 3]> = (0..count.max(1)).map(|_| [0; 3].map(|_| random.below(side) as u32)).collect();
    let mut all = Vec::new();
    for _ in 0..levels {
        let mut voxels: Vec<([u32; 3], Voxel)> = cells.iter().map(|at| (*at, sample_voxel(&mut random))).collect();
        voxels.sort_by_key(|(at, _)| order(*at));
        let shared = std::array::from_fn(|i| 0.9 - 0.19 * i as f32);
        let shadow = LevelShadow { offset: random.within(0.0, 2.0), shared };
        let clumping = Sym3([0.5, -0.25, -0.125, 0.25, 0.0, -0.375]);
        let others = some_others(&mut random, voxels.len(), sample_voxel);
        let facets = Facets(std::array::from_fn(|i| 0.25 * (i as f32 - 7.0)));
        let light_correction = LightCorrection(std::array::from_fn(|i| 0.0625 * (i as f32 - 12.0)));
        all.push(VolumeLevel { shadow, clumping, facets, light_correction, voxels, others });
        cells = cells.iter().map(|at| at.map(|x| x / 2)).collect();
    }
    // Numbers that half precision has.
    let material = |i: u16| MicroflakeMaterial {
        reflectance: [0.125, 0.25, 0.0625 * f32::from(i)],
        transmittance: [0.0, 0.375, 0.5],
        specular: 0.046875,
        roughness: 0.25,
    };
    Volume {
        description: "{\"name\": \"sample\"}".into(),
        side_m: random.within(0.5, 20.0),
        extent: [1.0, 0.75, 0.5],
        cyclic: [random.below(2) == 0, random.below(2) == 0],
        materials: (0..3).map(material).collect(),
        levels: all,
    }
}

/// Returns a second sort of microflakes in a third of `count` cells.
fn some_others(random: &mut Random, count: usize, voxel: impl Fn(&mut Random) -> Voxel) -> Vec<(u32, Voxel)> {
    let numbers = (0..count as u32).filter(|_| random.below(3) == 0).collect::<Vec<_>>();
    numbers.into_iter().map(|number| (number, voxel(random))).collect()
}

/// Returns three microflakes of one of three materials.
fn sample_voxel(random: &mut Random) -> Voxel {
    let extinction = (0..3).fold(Sym3::default(), |sum, _| {
        let microflake = Sym3::outer(random.direction(), random.within(0.1, 40.0));
        sum.plus(&microflake)
    });
    Voxel::new(extinction, random.below(3) as u32)
}

/// Returns a volume of random microflakes with 2^`level_count` voxels a side: each of the eight children of a voxel
/// exists with probability `share`, and one in any case.
pub fn random_volume(random: &mut Random, level_count: u32, share: f32) -> Volume {
    const MATERIALS: usize = 3;
    let mut levels: Vec<VolumeLevel> = Vec::new();
    let mut cells = vec![[0u32; 3]];
    for level in (0..=level_count).rev() {
        cells.sort_by_key(|cell| order(*cell));
        let mut children = Vec::new();
        for cell in &cells {
            let kept = random.below(8);
            let there = (0..8).filter(|child| *child == kept || random.within(0.0, 1.0) < share).collect::<Vec<_>>();
            children
                .extend(there.iter().map(|child| [0, 1, 2].map(|axis| 2 * cell[axis] + (child >> axis & 1) as u32)));
        }
        fn voxel(random: &mut Random) -> Voxel {
            let area = 2f32.powf(random.within(-3.0, 6.0));
            let microflakes = (0..1 + random.below(4)).map(|_| Sym3::outer(sphere_direction(random), area * area));
            Voxel::new(
                microflakes.fold(Sym3::default(), |sum, microflake| sum.plus(&microflake)),
                random.below(MATERIALS) as u32,
            )
        }
        let voxels: Vec<_> = cells.iter().map(|cell| (*cell, voxel(random))).collect();
        let others = some_others(random, voxels.len(), voxel);
        let mut correction = Random::new(61 + u64::from(level));
        levels.push(VolumeLevel {
            shadow: LevelShadow {
                offset: level as f32 + random.within(0.0, 1.0),
                shared: std::array::from_fn(|_| random.within(-1.0, 1.0)),
            },
            clumping: Sym3(std::array::from_fn(|_| random.within(-0.5, 0.5))),
            facets: Facets(std::array::from_fn(|_| random.within(-2.0, 2.0))),
            light_correction: LightCorrection(std::array::from_fn(|_| correction.within(-0.3, 0.3))),
            voxels,
            others,
        });
        cells = children;
    }
    levels.reverse();
    let mut shares = || std::array::from_fn(|_| random.within(0.0, 1.0));
    let materials = (0..MATERIALS)
        .map(|number| MicroflakeMaterial {
            reflectance: shares(),
            transmittance: shares(),
            specular: 0.04 * number as f32,
            roughness: 0.5,
        })
        .collect();
    let extent = shares();
    Volume {
        description: "{}".into(),
        side_m: 1.0 + level_count as f32,
        extent,
        cyclic: [level_count & 1 == 1, level_count & 2 == 2],
        materials,
        levels,
    }
}

/// Takes all children away from each voxel of an even level, counted from the finest, with probability `share`, as
/// where bricks are not loaded.
pub fn take_children(random: &mut Random, volume: &mut Volume, share: f32) {
    for level in (2..volume.levels.len()).step_by(2).rev() {
        let parents: BTreeSet<u64> = volume.levels[level].voxels.iter().map(|(at, _)| order(*at)).collect();
        let parents: BTreeSet<u64> = parents.into_iter().filter(|_| random.within(0.0, 1.0) < share).collect();
        for finer in 0..level {
            let up = 3 * (level - finer);
            let own = &mut volume.levels[finer];
            let kept: Vec<bool> = own.voxels.iter().map(|(at, _)| !parents.contains(&(order(*at) >> up))).collect();
            let mut number = 0;
            let numbers: Vec<u32> = kept.iter().map(|kept| (number, number += u32::from(*kept)).0).collect();
            own.others.retain(|(number, _)| kept[*number as usize]);
            own.others.iter_mut().for_each(|(number, _)| *number = numbers[*number as usize]);
            let mut kept = kept.into_iter();
            own.voxels.retain(|_| kept.next() == Some(true));
        }
    }
}

/// Number of kinds of [`sample_ray`].
pub const RAY_KINDS: usize = 8;

/// Returns a random ray that meets the unit cube of 2^`level_count` voxels a side, by kind: 0 anyhow, 1 along an axis,
/// 2 from corner to corner of voxels, 3 within a plane between voxels, 4 from inside, 5 with a large direction, 6 with
/// a small one, 7 nearly along a plane.
pub fn sample_ray(random: &mut Random, level_count: u32, kind: usize) -> VoltexRay {
    let resolution = (1u32 << level_count) as f32;
    let inside = |random: &mut Random| -> [f32; 3] { std::array::from_fn(|_| random.within(0.0, 1.0)) };
    let corner = |random: &mut Random| -> [f32; 3] {
        std::array::from_fn(|_| random.below(resolution as usize + 1) as f32 / resolution)
    };
    let (mut aim, mut direction) = (inside(random), sphere_direction(random));
    let mut back = random.within(1.0, 4.0);
    let axis = random.below(3);
    match kind {
        1 => {
            let sign = if random.below(2) == 0 { 1.0 } else { -1.0 };
            direction = std::array::from_fn(|i| if i == axis { sign } else { 0.0 * sign });
            if random.below(2) == 0 {
                aim = corner(random);
            }
        }
        2 => {
            aim = corner(random);
            let other = corner(random);
            direction = std::array::from_fn(|i| other[i] - aim[i]);
        }
        3 => {
            aim = corner(random);
            direction[axis] = 0.0;
        }
        4 => back = 0.0,
        7 => direction[axis] *= 10f32.powi(-(random.below(30) as i32)),
        _ => {}
    }
    let origin = std::array::from_fn(|i| aim[i] - back * direction[i]);
    let length = match kind {
        5 => 1e10,
        6 => 1e-10,
        _ => 1.0,
    };
    VoltexRay { origin, direction: direction.map(|x| x * length) }
}

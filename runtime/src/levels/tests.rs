//! Tests of the levels against the finest level.

use crate::asset::asset::{Asset, LobeRole};
use crate::asset::dictionary::LobeRef;
use crate::asset::residual::ResidualKind;
use crate::decode::decode::decode;
use crate::decode::options::{DecodeOptions, HeightUse};
use crate::levels::footprint::footprint;
use crate::levels::levels::with_levels;
use crate::pack;
use crate::resident::resident::Resident;
use crate::testing::{sample_asset, sample_heights};
use crate::threads::serial;

fn levels_of(asset: &Asset) -> (Resident, Vec<Asset>) {
    let wider = with_levels(asset, &serial);
    (Resident::from_asset(&wider), (1..=wider.levels.len()).map(|number| wider.level(number)).collect())
}

/// Returns an asset whose residual seldom makes a value negative, which decoders clamp.
fn tame_asset(seed: u64, width: usize, height: usize, kind: ResidualKind, role: LobeRole) -> Asset {
    let mut asset = sample_asset(seed, width, height, kind);
    let layer = &mut asset.layers[0];
    layer.lobe_role = role;
    let residual = layer.residual.as_mut().unwrap();
    residual.shared.steps.iter_mut().for_each(|step| *step *= 0.2);
    asset
}

/// Returns the mean squared error, in the root domain, of a level's texels against the mean of the covered texels at
/// measured pairs.
fn error_of(resident: &Resident, asset: &Asset, level: u32, texel_of: impl Fn(usize) -> (u32, u32)) -> f64 {
    let options = DecodeOptions { heights: HeightUse::None, ..DecodeOptions::default() };
    let layer = &asset.layers[0];
    let [width, height] = resident.size(level).map(|side| side as usize);
    let (mut sum, mut count) = (0.0, 0);
    for texel in 0..width * height {
        for pair in (0..layer.views.len() * layer.lights.len()).step_by(7) {
            let wo = layer.views.direction((pair / layer.lights.len()) as u32);
            let wi = layer.lights.direction((pair % layer.lights.len()) as u32);
            let mut mean = [0.0f32; 3];
            for (row, tall) in footprint(texel / width, height, asset.height) {
                for (column, wide) in footprint(texel % width, width, asset.width) {
                    let value = decode(resident, 0, (row * asset.width + column) as u32, wi, wo, &options);
                    (0..3).for_each(|c| mean[c] += tall * wide * value[c]);
                }
            }
            let (layer_number, shown) = texel_of(texel);
            let value = decode(resident, layer_number, shown, wi, wo, &options);
            for c in 0..3 {
                let curve = |x: f32| f64::from(x + 0.01).powf(1.0 / 2.4);
                sum += (curve(mean[c]) - curve(value[c])).powi(2);
                count += 1;
            }
        }
    }
    sum / f64::from(count)
}

#[test]
fn a_level_shows_the_mean_of_what_it_covers() {
    for (seed, kind) in [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root].into_iter().enumerate() {
        for role in [LobeRole::Base, LobeRole::Guide] {
            let asset = tame_asset(50 + seed as u64, 12, 10, kind, role);
            let (resident, levels) = levels_of(&asset);
            assert_eq!(
                levels.iter().map(|level| [level.width, level.height]).collect::<Vec<_>>(),
                [[6, 5], [3, 2], [1, 1]]
            );
            for level in 1..=3u32 {
                let error = error_of(&resident, &asset, level, |texel| (level, texel as u32));
                // Planted difference: the texel in the middle of the footprint.
                let [width, height] = resident.size(level).map(|side| side as usize);
                let nearest = error_of(&resident, &asset, level, |texel| {
                    let middle = |index: usize, count: usize, finer: usize| (2 * index + 1) * finer / (2 * count);
                    let row = middle(texel / width, height, asset.height);
                    (0, (row * asset.width + middle(texel % width, width, asset.width)) as u32)
                });
                eprintln!("{kind:?} {role:?} level {level}: {error:.2e}, nearest texel {nearest:.2e}");
                assert!(error < 0.85 * nearest, "{kind:?} {role:?} {level}: {error} {nearest}");
            }
        }
    }
}

#[test]
fn an_even_asset_is_the_same_at_every_level() {
    let mut asset = tame_asset(7, 8, 8, ResidualKind::Root, LobeRole::Base);
    let layer = &mut asset.layers[0];
    layer.texel_clusters.fill(1);
    layer.texel_lobe_counts.fill(2);
    let pair = [layer.lobe_refs[0], LobeRef { lobe: 3, weight: [40, 50, 60] }];
    layer.lobe_refs = (0..64).flat_map(|_| pair).collect();
    for plane in &mut layer.residual.as_mut().unwrap().coefficients {
        plane.codes.fill(9);
    }
    let (resident, levels) = levels_of(&asset);
    for level in 1..=3u32 {
        let error = error_of(&resident, &asset, level, |texel| (level, texel as u32));
        eprintln!("level {level}: {error:.2e}");
        assert!(error < 2e-6);
    }
    // Each is an asset that can be written and read.
    for level in &levels {
        assert_eq!(&Asset::parse(&pack(level).unwrap()).unwrap(), level);
    }
}

#[test]
fn heights_keep_their_size_in_the_world() {
    let mut asset = sample_asset(4, 16, 16, ResidualKind::Root);
    asset.layers[0].heights = Some(sample_heights(4, 256));
    asset.layers[0].heights.as_mut().unwrap().codes.fill(40);
    let step = asset.layers[0].heights.as_ref().unwrap().step;
    let (_, levels) = levels_of(&asset);
    let coarse = levels[1].layers[0].heights.as_ref().unwrap();
    assert_eq!((coarse.step, coarse.codes.as_slice()), (step / 4.0, &[40i8; 16][..]));
}

#[test]
fn threads_change_nothing() {
    let asset = sample_asset(9, 7, 9, ResidualKind::Root);
    let backwards = with_levels(&asset, &|n, work| (0..n).rev().for_each(work));
    assert_eq!(with_levels(&asset, &serial), backwards);
}

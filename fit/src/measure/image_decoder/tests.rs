//! Tests of `image_decoder.rs`.

use super::*;
use crate::sample_asset::{sample_asset, sample_asset_with};
use btf_runtime::testing::sample_heights;
use btf_runtime::{HeightUse, ResidualKind, TexelPlace, decode, decode_measured, lobe_tables, pack};

const KINDS: [ResidualKind; 3] = [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root];

const ROLES: [LobeRole; 3] = [LobeRole::Base, LobeRole::Guide, LobeRole::OldBase];

/// Returns one asset per curve and role.
fn assets() -> impl Iterator<Item = (ResidualKind, LobeRole, Asset)> {
    KINDS.into_iter().flat_map(|kind| ROLES.map(|role| (kind, role, asset(kind, role))))
}

fn asset(kind: ResidualKind, role: LobeRole) -> Asset {
    let (views, lights) = (DirectionSet::random(7, 3).unwrap(), DirectionSet::random(9, 4).unwrap());
    let mut asset = sample_asset_with(5, 3, &views, &lights, kind);
    asset.layers[0].lobe_role = role;
    if kind == ResidualKind::Root {
        asset.layers[0].heights = Some(sample_heights(1, 15));
    }
    Asset::parse(&pack(&asset).unwrap()).unwrap()
}

fn image(decoder: &ImageDecoder, texels: usize, view: Spot, light: Spot) -> Vec<f32> {
    let mut out = vec![f32::NAN; texels * 3];
    decoder.decode_image(&decoder.plan(view, light), &mut out);
    out
}

#[test]
fn measured_pairs_are_bit_for_bit_those_of_the_runtime() {
    for (kind, role, asset) in assets() {
        let resident = Resident::from_asset(&asset);
        let layer = &asset.layers[0];
        for (components, lobes) in [(u32::MAX, u32::MAX), (2, u32::MAX), (1, 1), (0, 2)] {
            let options = DecodeOptions { components, lobes, ..DecodeOptions::default() };
            let decoder = ImageDecoder::new(&asset, &resident, 0, &options);
            let mut first_ref = 0;
            for texel in 0..asset.texel_count() {
                let cluster = usize::from(layer.texel_clusters[texel]);
                let lobes: Vec<_> = layer.dictionary[cluster].iter().map(|entry| entry.lobe).collect();
                let tables = lobe_tables(&lobes, &layer.views, &layer.lights);
                let mut slow = vec![0.0; 7 * 9 * 3];
                let place = TexelPlace { layer: 0, texel, first_ref };
                decode_measured(&resident, &asset, place, &tables, &options, &mut slow);
                first_ref += usize::from(layer.texel_lobe_counts[texel]);
                for pair in 0..7 * 9 {
                    let fast = image(&decoder, 15, Spot::Measured(pair / 9), Spot::Measured(pair % 9));
                    assert_eq!(fast[texel * 3..texel * 3 + 3], slow[pair * 3..pair * 3 + 3], "{kind:?} {role:?}");
                }
            }
        }
    }
}

#[test]
fn other_directions_agree_with_the_runtime_under_both_rules_and_at_the_horizon() {
    let near = |a: f32, b: f32| (a - b).abs() <= 1e-5 + 1e-4 * b.abs();
    let directions = DirectionSet::random(12, 99).unwrap().units();
    let grazing = [[1.0, 0.0, 0.0], [0.9999, 0.0, 0.014_141], [0.0, -0.6, -0.8]];
    for (kind, role, asset) in assets() {
        let resident = Resident::from_asset(&asset);
        let (lights, views) = (&asset.layers[0].lights, &asset.layers[0].views);
        for interpolation in [Interpolation::Fast, Interpolation::Exact] {
            let options = DecodeOptions { interpolation, ..DecodeOptions::default() };
            let decoder = ImageDecoder::new(&asset, &resident, 0, &options);
            let (mut rules_differ, mut heights_matter) = (false, false);
            for wi in directions.iter().chain(&grazing).chain([&lights.direction(4)]) {
                for wo in directions.iter().chain(&grazing).chain([&views.direction(2)]) {
                    let fast = image(&decoder, 15, Spot::find(views, *wo), Spot::find(lights, *wi));
                    for texel in 0..15 {
                        let slow = decode(&resident, 0, texel as u32, *wi, *wo, &options);
                        let other = match interpolation {
                            Interpolation::Fast => Interpolation::Exact,
                            Interpolation::Exact => Interpolation::Fast,
                        };
                        let other = DecodeOptions { interpolation: other, ..options };
                        let planted = decode(&resident, 0, texel as u32, *wi, *wo, &other);
                        let flat = DecodeOptions { heights: HeightUse::None, ..options };
                        let flat = decode(&resident, 0, texel as u32, *wi, *wo, &flat);
                        for c in 0..3 {
                            let got = fast[texel * 3 + c];
                            assert!(near(got, slow[c]), "{kind:?} {role:?} {wi:?} {wo:?}: {got} {slow:?}");
                            rules_differ |= !near(got, planted[c]);
                            heights_matter |= !near(got, flat[c]);
                        }
                    }
                }
            }
            assert!(rules_differ, "the planted rule must not agree");
            assert_eq!(heights_matter, asset.layers[0].heights.is_some());
        }
    }
}

#[test]
fn an_asset_without_residual_decodes_to_its_lobes() {
    let mut asset = sample_asset();
    asset.layers[0].residual = None;
    let resident = Resident::from_asset(&asset);
    let options = DecodeOptions::default();
    let decoder = ImageDecoder::new(&asset, &resident, 0, &options);
    let (wi, wo) = (asset.layers[0].lights.direction(3), asset.layers[0].views.direction(5));
    let fast = image(&decoder, 15, Spot::Measured(5), Spot::Measured(3));
    for texel in 0..15 {
        assert_eq!(fast[texel * 3..texel * 3 + 3], decode(&resident, 0, texel as u32, wi, wo, &options));
    }
    assert!(fast.iter().any(|x| *x > 0.0));
}

#[test]
fn a_direction_is_measured_within_a_hundredth_of_a_degree_only() {
    let set = DirectionSet::bonn81();
    let sphere = Sphere::new(&set.units()).unwrap();
    let shifted = |by: f64| btf_capture::Direction::new(75.0 + by, 345.0).unit();
    assert_eq!(Spot::find(&sphere, shifted(0.009)), Spot::Measured(80));
    assert!(matches!(Spot::find(&sphere, shifted(0.011)), Spot::Other(_)));
    assert_eq!(Spot::of_set(&sphere, &set, Side::Front), (0..81).map(Spot::Measured).collect::<Vec<_>>());
}

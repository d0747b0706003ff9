//! Tests of the decoders against the format's text and against each other.

use crate::asset::asset::{Asset, Layer, LobeRole, SurfaceSide};
use crate::asset::lobe_tables::lobe_tables;
use crate::asset::residual::{ResidualKind, core_at_pair};
use crate::asset::sphere::Neighbours;
use crate::decode::decode::decode;
use crate::decode::measured::{TexelPlace, decode_from_file_form, decode_measured};
use crate::decode::options::{DecodeOptions, Interpolation};
use crate::error::FormatError;
use crate::pack;
use crate::resident::resident::Resident;
use crate::testing::{Random, direction_from_degrees, first_ref, sample_asset};

const KINDS: [ResidualKind; 3] = [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root];
const RULES: [Interpolation; 2] = [Interpolation::Fast, Interpolation::Exact];

fn options(interpolation: Interpolation) -> DecodeOptions {
    DecodeOptions { interpolation, ..DecodeOptions::default() }
}

/// Returns whether two values agree within the rounding of the resident bases, which are half precision (2^-11
/// relative), and of f32.
fn close(a: [f32; 3], b: [f32; 3]) -> bool {
    (0..3).all(|c| (a[c] - b[c]).abs() <= 1e-3 + 1e-3 * a[c].abs())
}

fn book_lobes(layer: &Layer, texel: usize, wi: [f32; 3], wo: [f32; 3]) -> [f64; 3] {
    let cluster = usize::from(layer.texel_clusters[texel]);
    let first = first_ref(layer, texel);
    let mut sum = [0.0; 3];
    for reference in &layer.lobe_refs[first..first + usize::from(layer.texel_lobe_counts[texel])] {
        let entry = layer.dictionary[cluster][usize::from(reference.lobe)];
        let value = f64::from(entry.lobe.setup().eval(wi, wo));
        for c in 0..3 {
            let q = f64::from(reference.weight[c]) / 255.0;
            sum[c] += f64::from(entry.weight_scale) * q * q * value;
        }
    }
    sum
}

fn book_residual(layer: &Layer, texel: usize, view: u32, light: u32) -> [f64; 3] {
    let residual = layer.residual.as_ref().unwrap();
    let cluster = usize::from(layer.texel_clusters[texel]);
    let mut sum = [0.0; 3];
    for index in 0..residual.bases.len() {
        let weight = index.checked_sub(1).map_or(1.0, |i| {
            let plane = &residual.coefficients[i];
            f64::from(plane.codes[texel]) * f64::from(plane.step)
        });
        let core = residual.core(index, cluster);
        let value = core_at_pair(&residual.factors, &core, view as usize, light as usize);
        for c in 0..3 {
            sum[c] += weight * f64::from(value[c]);
        }
    }
    sum
}

/// Decodes a value by format.md's rules, word by word, from the file form in double precision.
fn decode_by_the_book(asset: &Asset, texel: usize, wi: [f32; 3], wo: [f32; 3], rule: Interpolation) -> [f32; 3] {
    let layer = &asset.layers[0];
    let epsilon = f64::from(layer.epsilon);
    let curve = |x: f64| match layer.residual_kind {
        ResidualKind::Additive => x,
        ResidualKind::Log => (x + epsilon).ln(),
        ResidualKind::Root => (x + epsilon).powf(1.0 / 2.4),
    };
    let inverse = |y: f64| match layer.residual_kind {
        ResidualKind::Additive => y,
        ResidualKind::Log => y.exp() - epsilon,
        ResidualKind::Root => y.max(0.0).powf(2.4) - epsilon,
    };
    let (light, view) = (layer.lights.locate(wi), layer.views.locate(wo));
    let fade = (f64::from(wi[2]) / 0.1).min(1.0);
    let guide = layer.lobe_role == LobeRole::Guide;
    let nearest = layer.lobe_role == LobeRole::Base && rule == Interpolation::Fast;
    let toward = if nearest && light.beyond < 1.0 { nearest_in_hull(layer, &light) } else { wi };
    let here = book_lobes(layer, texel, toward, wo);
    let (mut r, mut decoded, mut lobes) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    for v in 0..3 {
        for l in 0..3 {
            let weight = f64::from(view.weights[v]) * f64::from(light.weights[l]);
            let residual = book_residual(layer, texel, view.ids[v], light.ids[l]);
            let s = book_lobes(layer, texel, layer.lights.direction(light.ids[l]), layer.views.direction(view.ids[v]));
            for c in 0..3 {
                r[c] += weight * residual[c];
                lobes[c] += weight * s[c];
                let base = if guide { 0.0 } else { s[c] };
                decoded[c] += weight * inverse(curve(base) + residual[c]).max(0.0);
            }
        }
    }
    let beyond = f64::from(light.beyond);
    [0, 1, 2].map(|c| {
        let value = match rule {
            Interpolation::Fast => {
                let scale = match layer.residual_kind {
                    ResidualKind::Additive => beyond,
                    ResidualKind::Log => 1.0,
                    ResidualKind::Root => beyond.powf(1.0 / 2.4),
                };
                match layer.lobe_role {
                    LobeRole::OldBase => inverse(curve(here[c]) + scale * r[c]).max(0.0),
                    LobeRole::Guide => beyond * inverse(curve(0.0) + r[c]).max(0.0),
                    LobeRole::Base => beyond * inverse(curve(here[c]) + r[c]).max(0.0),
                }
            }
            Interpolation::Exact => decoded[c] * ((here[c] + 0.03) / (lobes[c] + 0.03)).clamp(0.3, 4.0),
        };
        (value * fade) as f32
    })
}

/// Returns the direction of the lights' hull that the neighbours on its edge give.
fn nearest_in_hull(layer: &Layer, light: &Neighbours) -> [f32; 3] {
    let [p, q] = [0, 1].map(|i| layer.lights.direction(light.ids[i]));
    let [x, y] = [0, 1].map(|axis| light.weights[0] * p[axis] + light.weights[1] * q[axis]);
    [x, y, (1.0 - x * x - y * y).sqrt()]
}

#[test]
fn every_kind_and_rule_decodes_as_the_format_says() {
    let roles = [LobeRole::Base, LobeRole::Guide, LobeRole::OldBase];
    for (seed, (kind, role)) in KINDS.into_iter().flat_map(|kind| roles.map(|role| (kind, role))).enumerate() {
        let mut asset = sample_asset(seed as u64, 6, 5, kind);
        asset.layers[0].lobe_role = role;
        let resident = Resident::from_asset(&asset);
        for rule in RULES {
            let mut random = Random::new(77);
            let mut differs = 0;
            for i in 0..3000 {
                let (texel, mut wi, wo) = (random.below(30), random.direction(), random.direction());
                if i % 3 == 0 {
                    // Between the hull and the horizon.
                    wi = direction_from_degrees(random.within(75.0, 90.0).into(), random.within(0.0, 360.0).into());
                }
                let got = decode(&resident, 0, texel as u32, wi, wo, &options(rule));
                let expected = decode_by_the_book(&asset, texel, wi, wo, rule);
                assert!(close(expected, got), "{kind:?} {rule:?} {texel} {wi:?} {wo:?}: {expected:?} {got:?}");
                // Planted difference: the other rule is not this one.
                let other = if rule == Interpolation::Fast { Interpolation::Exact } else { Interpolation::Fast };
                differs += u32::from(!close(expected, decode(&resident, 0, texel as u32, wi, wo, &options(other))));
            }
            assert!(differs > 50, "{kind:?} {rule:?}: {differs}");
        }
    }
}

#[test]
fn all_decoders_agree_at_the_measured_directions() {
    for (seed, kind) in KINDS.into_iter().enumerate() {
        let asset = sample_asset(10 + seed as u64, 6, 5, kind);
        let resident = Resident::from_asset(&asset);
        let layer = &asset.layers[0];
        let (views, lights) = (layer.views.len(), layer.lights.len());
        let tables: Vec<Vec<Vec<f32>>> = layer
            .dictionary
            .iter()
            .map(|lobes| {
                let lobes: Vec<_> = lobes.iter().map(|entry| entry.lobe).collect();
                lobe_tables(&lobes, &layer.views, &layer.lights)
            })
            .collect();
        let mut planted = 0;
        for texel in 0..asset.texel_count() {
            let first = first_ref(layer, texel);
            let tables = &tables[usize::from(layer.texel_clusters[texel])];
            let mut measured = vec![0.0; views * lights * 3];
            let all = DecodeOptions::default();
            let place = TexelPlace { layer: 0, texel, first_ref: first };
            decode_measured(&resident, &asset, place, tables, &all, &mut measured);
            for pair in 0..views * lights {
                let (view, light) = (pair / lights, pair % lights);
                let (wi, wo) = (layer.lights.direction(light as u32), layer.views.direction(view as u32));
                let quick = [0, 1, 2].map(|c| measured[pair * 3 + c]);
                let slow = decode_from_file_form(&asset, place, view, light);
                assert!(close(quick, slow), "{kind:?} texel {texel} pair {pair}: {quick:?} {slow:?}");
                for rule in RULES {
                    let full = decode(&resident, 0, texel as u32, wi, wo, &options(rule));
                    assert!(close(quick, full), "{kind:?} {rule:?} texel {texel} pair {pair}: {quick:?} {full:?}");
                }
                // Planted differences: the transposed pair index, and the neighbouring light.
                let transposed = (light * views + view) % (views * lights) * 3;
                let next = decode_from_file_form(&asset, place, view, (light + 1) % lights);
                planted += u32::from(!close(quick, [0, 1, 2].map(|c| measured[transposed + c])));
                planted += u32::from(!close(quick, next));
            }
        }
        assert!(planted > 10_000, "{kind:?}: {planted}");
    }
}

/// Returns where `f` jumps while its argument goes from 0 to 90 degrees in steps of 0.1, and by how much: the
/// difference of a step must shrink with the step, as that of any continuous function does.
fn jump(f: impl Fn(f64) -> [f32; 3]) -> Option<(f64, f32)> {
    let gap = |a: [f32; 3], b: [f32; 3]| (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max);
    let mut before = f(0.0);
    for step in 0..900 {
        let (mut low, mut high) = (f64::from(step) * 0.1, f64::from(step + 1) * 0.1);
        let (mut at_low, mut at_high) = (before, f(high));
        assert!(at_high.iter().all(|x| x.is_finite() && *x >= 0.0), "{high} degrees: {at_high:?}");
        before = at_high;
        let first = gap(at_low, at_high);
        if first < 2e-3 {
            continue;
        }
        for _ in 0..8 {
            let middle = 0.5 * (low + high);
            let at_middle = f(middle);
            if gap(at_low, at_middle) > gap(at_middle, at_high) {
                (high, at_high) = (middle, at_middle);
            } else {
                (low, at_low) = (middle, at_middle);
            }
        }
        // A square root at its zero, the steepest that a lobe has, shrinks to 1/16.
        if gap(at_low, at_high) > first / 8.0 + 3e-4 {
            return Some((low, gap(at_low, at_high)));
        }
    }
    None
}

#[test]
fn the_decoded_value_is_continuous_from_the_pole_to_the_horizon() {
    for (seed, kind) in KINDS.into_iter().enumerate() {
        let asset = sample_asset(20 + seed as u64, 3, 2, kind);
        let resident = Resident::from_asset(&asset);
        for rule in RULES {
            for i in 0..10 {
                let (texel, azimuth, other_azimuth) = (i % 6, 41.0 * f64::from(i), 17.0 + 67.0 * f64::from(i));
                // Inside the hull, at its edge and beyond it.
                let other = direction_from_degrees([5.0, 40.0, 66.0, 74.0, 88.0][i as usize % 5], other_azimuth);
                let evaluate = |wi, wo| decode(&resident, 0, texel, wi, wo, &options(rule));
                let light = |theta: f64| evaluate(direction_from_degrees(theta, azimuth), other);
                let view = |theta: f64| evaluate(other, direction_from_degrees(theta, azimuth));
                assert_eq!(jump(light), None, "{kind:?} {rule:?} light {i}");
                assert_eq!(jump(view), None, "{kind:?} {rule:?} view {i}");
                // Planted: a step of 1 % at the hull is seen.
                let broken = |theta: f64| light(theta).map(|x| if theta > 73.33 { x + 0.01 } else { x });
                assert!(jump(broken).is_some_and(|(theta, _)| (theta - 73.33).abs() < 0.1));
                let [x, y, _] = direction_from_degrees(90.0, azimuth);
                for z in [0.0, -1e-9, -0.3] {
                    assert_eq!(evaluate([x, y, z], other), [0.0; 3], "no light from the horizon or below it");
                    assert_eq!(evaluate(other, [x, y, z]), [0.0; 3], "no eye at the horizon or below it");
                }
            }
        }
    }
}

#[test]
fn fewer_components_decode_as_the_coarser_tier_does() -> Result<(), FormatError> {
    let asset = sample_asset(30, 6, 5, ResidualKind::Root);
    let bytes = pack(&asset)?;
    let tiers = crate::read_directory(&bytes)?.tiers;
    assert_eq!(tiers.len(), 6, "lobes, mean and four components");
    let whole = Resident::from_asset(&asset);
    assert_eq!(whole.components(0), 4);
    let mut random = Random::new(31);
    let mut others = 0;
    for (tier, length) in tiers.iter().enumerate() {
        let coarse = Resident::from_asset(&Asset::parse(&bytes[..*length as usize])?);
        assert_eq!(coarse.components(0), tier.saturating_sub(1) as u32);
        for _ in 0..300 {
            let (texel, wi, wo) = (random.below(30) as u32, random.direction(), random.direction());
            let expected = decode(&coarse, 0, texel, wi, wo, &DecodeOptions::default());
            let limited = |components| {
                decode(&whole, 0, texel, wi, wo, &DecodeOptions { components, ..DecodeOptions::default() })
            };
            if tier > 0 {
                assert_eq!(limited(tier as u32 - 1), expected, "tier {tier}");
            }
            // Planted difference: without a component the value is another.
            if tier == 5 && limited(3) != expected {
                others += 1;
            }
            assert_eq!(limited(4), limited(u32::MAX));
        }
    }
    assert!(others > 100, "{others}");
    Ok(())
}

#[test]
fn fewer_lobes_leave_the_last_ones_out() {
    let mut asset = sample_asset(32, 6, 5, ResidualKind::Additive);
    asset.layers[0].residual = None;
    let resident = Resident::from_asset(&asset);
    let layer = &asset.layers[0];
    let texel = layer.texel_lobe_counts.iter().position(|count| *count == 4).unwrap();
    let (wi, wo) = (direction_from_degrees(30.0, 10.0), direction_from_degrees(20.0, 200.0));
    let limited =
        |lobes| decode(&resident, 0, texel as u32, wi, wo, &DecodeOptions { lobes, ..DecodeOptions::default() });
    assert_eq!(limited(0), [0.0; 3]);
    for count in 0..=4usize {
        let mut shorter = asset.clone();
        let layer = &mut shorter.layers[0];
        let first = first_ref(layer, texel);
        layer.lobe_refs.drain(first + count..first + 4);
        layer.texel_lobe_counts[texel] = count as u8;
        let all = decode(&Resident::from_asset(&shorter), 0, texel as u32, wi, wo, &DecodeOptions::default());
        assert_eq!(limited(count as u32), all, "{count} lobes");
    }
    assert_eq!(limited(4), limited(u32::MAX));
    assert_ne!(limited(1), limited(0), "the diffuse lobe must show");
}

#[test]
fn a_back_side_layer_is_the_front_one_mirrored_and_a_missing_one_is_named() -> Result<(), FormatError> {
    let mut asset = sample_asset(40, 4, 3, ResidualKind::Log);
    let front = asset.layers[0].clone();
    use SurfaceSide::{Back, Front};
    let sides = [(Back, Back), (Back, Front)];
    for (light_side, view_side) in sides {
        asset.layers.push(Layer { light_side, view_side, ..front.clone() });
    }
    let asset = Asset::parse(&pack(&asset)?)?;
    let resident = Resident::from_asset(&asset);
    assert_eq!(resident.layer_for_sides(0, Front, Front), Some(0));
    assert_eq!(resident.layer_for_sides(0, Back, Back), Some(1));
    assert_eq!(resident.layer_for_sides(0, Back, Front), Some(2));
    assert_eq!(resident.layer_for_sides(0, Front, Back), None, "a missing layer is black: the caller draws nothing");
    let mut random = Random::new(41);
    let flip = |v: [f32; 3]| [v[0], v[1], -v[2]];
    for rule in RULES {
        for _ in 0..300 {
            let (texel, wi, wo) = (random.below(12) as u32, random.direction(), random.direction());
            let at = |layer, wi, wo| decode(&resident, layer, texel, wi, wo, &options(rule));
            let expected = at(0, wi, wo);
            assert_eq!(at(1, flip(wi), flip(wo)), expected);
            assert_eq!(at(2, flip(wi), wo), expected);
            // Directions on another side than the layer's.
            for wrong in [at(0, flip(wi), wo), at(1, wi, wo), at(2, wi, wo), at(2, flip(wi), flip(wo))] {
                assert_eq!(wrong, [0.0; 3]);
            }
            // Planted difference: mirroring x as well is another value.
            if rule == Interpolation::Fast && expected[0] > 0.01 {
                assert_ne!(at(0, [-wi[0], wi[1], wi[2]], wo), expected);
            }
        }
    }
    Ok(())
}

#[test]
fn the_largest_numbers_of_the_format_decode_to_finite_values() -> Result<(), FormatError> {
    for kind in KINDS {
        let mut asset = sample_asset(50, 3, 2, kind);
        let residual = asset.layers[0].residual.as_mut().unwrap();
        let most = half::f16::MAX;
        residual.factors.view.iter_mut().chain(&mut residual.factors.light).for_each(|matrix| matrix.fill(most));
        let extreme = |values: &mut [i16]| {
            values.iter_mut().enumerate().for_each(|(i, q)| *q = if i % 2 == 0 { i16::MAX } else { i16::MIN });
        };
        residual.shared.steps.fill(crate::MAX_BASIS_STEP);
        extreme(&mut residual.shared.values);
        for basis in &mut residual.bases {
            basis.steps.fill(crate::MAX_BASIS_STEP);
            extreme(&mut basis.values);
        }
        for plane in &mut residual.coefficients {
            plane.step = crate::MAX_COEFFICIENT_STEP;
            plane.codes.iter_mut().enumerate().for_each(|(i, q)| *q = if i % 2 == 0 { i8::MAX } else { i8::MIN });
        }
        for entry in asset.layers[0].dictionary.iter_mut().flatten() {
            entry.weight_scale = most.to_f32();
        }
        let resident = Resident::from_asset(&Asset::parse(&pack(&asset)?)?);
        let mut random = Random::new(51);
        for _ in 0..500 {
            let (texel, wi, wo) = (random.below(6) as u32, random.direction(), random.direction());
            for rule in RULES {
                // An even count of bases leaves an unused half, whose weight is 0.
                for components in [0, 1, 4] {
                    let dial = DecodeOptions { components, interpolation: rule, ..DecodeOptions::default() };
                    let value = decode(&resident, 0, texel, wi, wo, &dial);
                    assert!(value.iter().all(|x| x.is_finite()), "{kind:?} {rule:?} {components}: {value:?}");
                }
            }
        }
    }
    Ok(())
}

//! Compares the values of this crate with those of the reader that was written in Python from docs/reference/format.md alone.

use super::second_reader::{
    Lines, SHARED_OF_FIRST_PART, add_extreme_lobes, asset_of_two_parts, edits, parsed, read_by_the_document,
    resident_bytes, wide,
};
use super::{document_bytes, named};
use btf_runtime::testing::{
    Random, sample_asset, sample_grouped_spectrum, sample_heights, sample_predicted_asset, sample_relief_asset,
    sample_spectral_asset,
};
use btf_runtime::{
    Asset, DecodeOptions, Interpolation, Layer, LobeRole, PackedGoal, Relief, Resident, ResidentFile, ResidualKind,
    SurfaceSide, decode, pack, read_directory, serial, with_levels,
};

/// A value to decode: a layer, a level, a texel, light and eye, a rule.
#[derive(Clone, Copy)]
struct Query {
    layer: usize,
    level: usize,
    texel: usize,
    wi: [f32; 3],
    wo: [f32; 3],
    interpolation: Interpolation,
}

impl Query {
    /// Returns the line for the reader in Python. Singles are written as the doubles that they are.
    fn line(&self) -> String {
        let rule = match self.interpolation {
            Interpolation::Fast => "fast",
            Interpolation::Exact => "exact",
        };
        let directions: Vec<String> = wide(&[self.wi, self.wo].concat()).iter().map(f64::to_string).collect();
        format!("{rule} {} {} {} {}", self.layer, self.level, self.texel, directions.join(" "))
    }

    fn value(&self, resident: &Resident) -> [f32; 3] {
        let options = DecodeOptions { interpolation: self.interpolation, ..DecodeOptions::default() };
        let layer = self.level as u32 * resident.layers() + self.layer as u32;
        decode(resident, layer, self.texel as u32, self.wi, self.wo, &options)
    }
}

fn random_queries(asset: &Asset, count: usize, random: &mut Random) -> Vec<Query> {
    (0..count)
        .map(|i| {
            // Half of them at the finest level.
            let (layer, coarser) = (random.below(asset.layers.len()), random.below(asset.levels.len() + 1));
            let level = if random.below(2) == 0 { 0 } else { coarser };
            let texels = match level {
                0 => asset.texel_count(),
                _ => asset.levels[level - 1].layers[layer].clusters.len(),
            };
            let (mut wi, wo) = (random.direction(), random.direction());
            wi[2] *= if asset.layers[layer].light_side == SurfaceSide::Back { -1.0 } else { 1.0 };
            let interpolation = [Interpolation::Fast, Interpolation::Exact][i % 2];
            Query { layer, level, texel: random.below(texels), wi, wo, interpolation }
        })
        .collect()
}

/// Returns assets of every kind of residual and role, with and without heights, each of two layers, with levels and
/// edits.
fn assets_to_decode() -> Vec<Asset> {
    [
        (1, ResidualKind::Additive, LobeRole::Base, true, true),
        (2, ResidualKind::Log, LobeRole::Base, true, true),
        (3, ResidualKind::Root, LobeRole::Base, true, true),
        (4, ResidualKind::Root, LobeRole::Guide, true, true),
        (5, ResidualKind::Additive, LobeRole::Guide, false, true),
        (6, ResidualKind::Log, LobeRole::Base, true, false),
        (7, ResidualKind::Additive, LobeRole::OldBase, true, true),
        (8, ResidualKind::Root, LobeRole::OldBase, false, true),
    ]
    .map(|(seed, kind, role, has_heights, has_residual)| {
        let mut asset = sample_asset(seed, 9, 7, kind);
        let texels = asset.texel_count();
        let layer = &mut asset.layers[0];
        layer.lobe_role = role;
        layer.heights = has_heights.then(|| sample_heights(seed, texels));
        if !has_residual {
            layer.residual = None;
        }
        add_extreme_lobes(layer);
        let lit_from_behind = Layer { light_side: SurfaceSide::Back, ..layer.clone() };
        asset.layers.push(lit_from_behind);
        asset.edits = edits(texels);
        let mut asset = with_levels(&asset, &serial);
        if has_heights {
            let level = &mut asset.levels[0];
            level.layers[1].heights = Some(sample_heights(seed + 10, level.layers[1].clusters.len()));
        }
        asset
    })
    .into()
}

/// Returns the first query whose value differs from the second reader's by more than `share` of the larger of 1 and the
/// value, and by more than its spread.
fn first_other_value(read: &Lines, values: &[[f32; 3]], share: f64) -> Option<usize> {
    values.iter().enumerate().find_map(|(i, value)| {
        let [own, spread] = ["value", "spread"].map(|name| parsed(&read[&format!("{name} {i}")]));
        let far = |c: usize| (own[c] - f64::from(value[c])).abs() > share * own[c].abs().max(1.0) + spread[c];
        (0..3).any(far).then_some(i)
    })
}

/// Both decoders compute the same in double and in single precision. They agree within 1e-6 except at the peak of sharp
/// lobes, where the last bit of a cosine matters more; the second reader prints how much (its "spread").
#[test]
fn the_resident_form_decodes_to_the_values_of_a_decoder_written_from_the_document() {
    let mut random = Random::new(1);
    let (mut largest, mut wider, mut count) = (0.0f64, 0, 0);
    for (number, asset) in assets_to_decode().iter().enumerate() {
        let queries = random_queries(asset, 150, &mut random);
        let lines: String = queries.iter().map(|query| query.line() + "\n").collect();
        let read = read_by_the_document(&format!("decoded-{number}"), &resident_bytes(asset), &[], &lines);
        let values_of = |asset: &Asset, queries: &[Query]| -> Vec<[f32; 3]> {
            let resident = Resident::from_asset(asset);
            queries.iter().map(|query| query.value(&resident)).collect()
        };
        let values = values_of(asset, &queries);
        assert_eq!(first_other_value(&read, &values, 1e-6), None, "asset {number}: {lines}");
        for (i, value) in values.iter().enumerate() {
            let [own, spread] = ["value", "spread"].map(|name| parsed(&read[&format!("{name} {i}")]));
            let off = |c: usize| (own[c] - f64::from(value[c])).abs() / own[c].abs().max(1.0);
            largest = (0..3).map(off).fold(largest, f64::max);
            wider += usize::from(spread.iter().any(|x| *x > 1e-6));
            count += 1;
        }

        // The same with packed bases; planted difference: the bases that were packed.
        let packed = Resident::packed_on(asset, PackedGoal::Noise(0.01), &serial);
        let of_packed: Vec<[f32; 3]> = queries.iter().map(|query| query.value(&packed)).collect();
        let bytes = ResidentFile::with_words(asset.clone(), packed).pack().unwrap();
        let read_packed = read_by_the_document(&format!("decoded-packed-{number}"), &bytes, &[], &lines);
        assert_eq!(first_other_value(&read_packed, &of_packed, 2e-6), None, "packed asset {number}: {lines}");
        let differs = first_other_value(&read_packed, &values, 2e-6).is_some();
        assert_eq!(differs, asset.layers.iter().any(|layer| layer.residual.is_some()), "packed asset {number}");

        // Planted differences: one weight, one code, one edit, the other rule.
        let differs = |change: &dyn Fn(&mut Asset)| {
            let mut other = asset.clone();
            change(&mut other);
            first_other_value(&read, &values_of(&other, &queries), 1e-6).is_some()
        };
        let layer = &asset.layers[0];
        // Not every weight and code reaches every direction.
        let is_of_finest = |query: &&Query| query.level == 0 && query.layer == 0;
        let one_weight = |query: &Query| {
            let lobes = |texels: &[u8]| texels.iter().map(|count| usize::from(*count)).sum::<usize>();
            let [first, end] = [0, 1].map(|more| lobes(&layer.texel_lobe_counts[..query.texel + more]));
            (first..end).any(|at| differs(&|a| a.layers[0].lobe_refs[at].weight[1] ^= 128))
        };
        assert!(queries.iter().filter(is_of_finest).any(one_weight), "asset {number}: a weight");
        if layer.residual.is_some() {
            let one_code = |query: &Query| {
                differs(&|a| a.layers[0].residual.as_mut().unwrap().coefficients[0].codes[query.texel] ^= 16)
            };
            assert!(queries.iter().filter(is_of_finest).any(one_code), "asset {number}: a code");
            let swapped = queries.iter().map(|query| match query.interpolation {
                Interpolation::Fast => Query { interpolation: Interpolation::Exact, ..*query },
                Interpolation::Exact => Query { interpolation: Interpolation::Fast, ..*query },
            });
            let other = values_of(asset, &swapped.collect::<Vec<_>>());
            assert!(first_other_value(&read, &other, 1e-6).is_some(), "asset {number}: the other rule");
        }
        assert!(differs(&|a| a.edits.list[0].tint[2] *= 1.01), "asset {number}: an edit");

        // The file form's bases are not rounded to halves.
        let read = read_by_the_document(&format!("decoded-file-{number}"), &pack(asset).unwrap(), &[], &lines);
        assert_eq!(first_other_value(&read, &values, 1e-4), None, "asset {number}: {lines}");
    }
    println!("{count} values, the largest difference {largest:.1e}, {wider} at the peak of a sharp lobe");
    assert!(count == 1200 && wider <= count / 100, "{wider} of {count} values are known to less than 1e-6");
}

/// Lobes whose weights follow from the coefficients, of which a tier may hold some only, and whose part of the value the
/// bases lack.
#[test]
fn predicted_lobes_of_every_tier_decode_to_the_second_readers_values() {
    let mut random = Random::new(2);
    let kinds = [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root];
    // With plain coefficients in eight tiers, and with predicted ones in five.
    let made = [(sample_predicted_asset as fn(u64, usize, usize, ResidualKind) -> Asset, 8), (asset_of_two_parts, 5)];
    for (kind, (sample, count)) in kinds.into_iter().flat_map(|kind| made.map(|made| (kind, made))) {
        let mut asset = sample(kind as u64, 9, 7, kind);
        if kind == ResidualKind::Log {
            // Nodes that are stored: those of texels without the last one.
            let weights = asset.layers[0].lobe_weights.as_mut().unwrap();
            weights.nodes[1].pop();
        }
        let bytes = pack(&asset).unwrap();
        let tiers = read_directory(&bytes).unwrap().tiers;
        assert_eq!(tiers.len(), count);
        for (number, tier) in tiers.iter().enumerate() {
            let cut = &bytes[..*tier as usize];
            let asset = Asset::parse(cut).unwrap();
            let queries = random_queries(&asset, 30, &mut random);
            let lines: String = queries.iter().map(|query| query.line() + "\n").collect();
            let read = read_by_the_document(&format!("predicted-{}-{count}-{number}", kind as u32), cut, &[], &lines);
            let other = |asset: &Asset| {
                let resident = Resident::from_asset(asset);
                let values: Vec<[f32; 3]> = queries.iter().map(|query| query.value(&resident)).collect();
                // Bases are halves.
                first_other_value(&read, &values, 4e-3)
            };
            assert_eq!(other(&asset), None, "{kind:?} {number}: {lines}");
            // Planted differences: bases from which nothing is subtracted, and another weight.
            let mut whole = asset.clone();
            whole.layers[0].lobe_weights = None;
            assert_eq!(other(&whole).is_some(), asset.layers[0].residual.is_some(), "{kind:?} {number}");
            // Shared bases of the second part, which the first two tiers with a residual differ in.
            let mut first_part = asset.clone();
            if let Some(residual) = &mut first_part.layers[0].residual {
                let first = SHARED_OF_FIRST_PART * residual.factors.core_len();
                let second = residual.shared.values.get_mut(first..).unwrap_or_default();
                let has_second = !second.is_empty();
                assert_eq!(has_second, count == 5 && number > 2, "{kind:?} {number}");
                second.fill(0);
                assert_eq!(other(&first_part).is_some(), has_second, "{kind:?} {number}");
            }
            let mut weights = asset.clone();
            weights.layers[0].lobe_refs.iter_mut().for_each(|reference| reference.weight[1] ^= 64);
            assert!(other(&weights).is_some(), "{kind:?} {number}");
        }
    }
}

#[test]
fn the_documents_decoded_values_are_what_the_second_reader_decodes() {
    let bytes = document_bytes();
    let tiers = read_directory(&bytes).unwrap().tiers;
    let rows = named("decoded");
    for (tier, length) in tiers.iter().enumerate() {
        let of_tier = rows.iter().filter(|(input, _)| input.starts_with(&format!("tier {tier} ")));
        let (mut lines, mut expected) = (String::new(), vec![]);
        for (input, output) in of_tier {
            let words: Vec<&str> = input.split_whitespace().collect();
            let [_, _, rule, "level", level, "texel", texel, "wi", direction @ ..] = &words[..] else {
                panic!("{input}")
            };
            lines += &format!("{rule} 0 {level} {texel} {} 0 0 1\n", direction.join(" "));
            let value: Vec<f32> = parsed(output).into_iter().map(|x| x as f32).collect();
            expected.push([value[0], value[1], value[2]]);
        }
        assert!(!expected.is_empty(), "tier {tier}");
        let read = read_by_the_document(&format!("tier-{tier}"), &bytes[..*length as usize], &[], &lines);
        assert_eq!(first_other_value(&read, &expected, 1e-4), None, "tier {tier}");
        expected.last_mut().expect("a value")[2] += 3e-4;
        assert_eq!(first_other_value(&read, &expected, 1e-4), Some(expected.len() - 1), "planted in tier {tier}");
    }
}

#[test]
fn a_spectrum_decodes_to_the_values_of_a_decoder_written_from_the_document() {
    for (at, asset) in [sample_spectral_asset(5, 8, 6), sample_grouped_spectrum(5, 8, 6)].iter().enumerate() {
        let asset = with_levels(asset, &serial);
        let queries = random_queries(&asset, 200, &mut Random::new(5));
        let lines: String = queries.iter().map(|query| query.line() + "\n").collect();
        for (name, bytes, share) in [("file", pack(&asset).unwrap(), 2e-3), ("resident", resident_bytes(&asset), 1e-5)]
        {
            let read = read_by_the_document(&format!("spectrum-{at}-{name}"), &bytes, &[], &lines);
            let others = |asset: &Asset| {
                let resident = Resident::from_asset(asset);
                let far = |(i, query): &(usize, &Query)| {
                    let (own, value) = (parsed(&read[&format!("value {i}")]), query.value(&resident));
                    (0..3).any(|c| (own[c] - f64::from(value[c])).abs() > share * own[c].abs().max(1.0))
                };
                queries.iter().enumerate().filter(far).count()
            };
            assert_eq!(others(&asset), 0, "{name}");
            // Planted differences: another weight, and colours.
            let mut other = asset.clone();
            other.spectrum.iter_mut().for_each(|spectrum| spectrum.shown[1][2] += 0.3);
            assert!(others(&other) > 50 && others(&Asset { spectrum: None, ..asset.clone() }) > 100, "{name}");
        }
    }
}

/// Relief follows rays through the heights, which may meet them at another step with another rounding: a few values may
/// differ.
#[test]
fn relief_decodes_to_the_values_of_a_decoder_written_from_the_document() {
    let asset = with_levels(&sample_relief_asset(9, 12, 10), &serial);
    let queries = random_queries(&asset, 300, &mut Random::new(9));
    let lines: String = queries.iter().map(|query| query.line() + "\n").collect();
    let count_others = |read: &Lines, asset: &Asset, share: f64| {
        let resident = Resident::from_asset(asset);
        let far = |(i, query): &(usize, &Query)| {
            let (own, value) = (parsed(&read[&format!("value {i}")]), query.value(&resident));
            (0..3).any(|c| (own[c] - f64::from(value[c])).abs() > share * own[c].abs().max(1.0))
        };
        queries.iter().enumerate().filter(far).count()
    };
    // The file form has no bases that are rounded to halves.
    for (name, bytes, share) in [("file", pack(&asset).unwrap(), 2e-3), ("resident", resident_bytes(&asset), 1e-5)] {
        let read = read_by_the_document(&format!("relief-{name}"), &bytes, &[], &lines);
        let others = count_others(&read, &asset, share);
        assert!(others <= 3, "{name}: {others}");
        // Planted differences: no relief, and each of its numbers.
        let planted = |change: &dyn Fn(&mut Relief)| {
            let mut other = asset.clone();
            other.layers[0].relief.iter_mut().for_each(change);
            count_others(&read, &other, share)
        };
        let mut without = asset.clone();
        without.layers[0].relief = None;
        let counts = [
            count_others(&read, &without, share),
            planted(&|relief| relief.likeness *= 2.0),
            planted(&|relief| relief.shading = 0.6),
            planted(&|relief| relief.gloss = 0.3),
        ];
        // The wider tolerance of the file form sees relief as a whole.
        let seen = if name == "file" { 1 } else { counts.len() };
        assert!(counts[..seen].iter().all(|count| *count > 3 * others.max(3)), "{name}: {counts:?}");
    }
}

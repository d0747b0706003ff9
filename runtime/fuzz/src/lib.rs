//! The work of the fuzz targets on one input, as plain functions. `fuzz_targets` calls them with libFuzzer's inputs,
//! `runtime/tests/corpus.rs` with the corpus and its own mutations, on any toolchain. A function that returns has found
//! nothing.

mod any_asset;
mod mutate;

pub use any_asset::any_asset;
pub use mutate::{mutate, mutate_in_place};

use btf_runtime::testing::Random;
use btf_runtime::voltex::{NO_VOXEL, Voltex, VoltexRay, Volume, Walk, read_voltex_directory};
use btf_runtime::{
    Asset, DecodeOptions, Interpolation, Query, Resident, ResidentFile, decode, density, evaluate, pack,
    read_directory, sample, serial,
};
use std::sync::Arc;

/// Largest number of words of expanded bases of an asset that is made resident: the limit of the format is 1 GiB, that
/// of a fuzzer's input some milliseconds.
const MAX_BASIS_WORDS: usize = 1 << 16;
/// Largest number of texels of an asset that is made resident.
const MAX_TEXELS: usize = 1 << 12;

/// Decodes any bytes: they are refused, or they and every tier of them decode to finite values, and the asset can be
/// written and read again.
pub fn parse(bytes: &[u8]) {
    let Ok(asset) = Asset::parse(bytes) else { return };
    let directory = read_directory(bytes).expect("an asset was read, so its directory can be");
    let mut random =
        Random::new(bytes.iter().fold(bytes.len() as u64, |seed, byte| seed * 31 % 0xffff_fffb + u64::from(*byte)));
    for length in &directory.tiers[..directory.tier] {
        // A tier of forged files may end before what every tier needs.
        if let Ok(tier) = Asset::parse(&bytes[..*length as usize]) {
            decode_somewhere(&tier, &mut random);
        }
    }
    decode_somewhere(&asset, &mut random);
    if directory.tier + 1 == directory.tiers.len() {
        let again = pack(&asset).expect("what was read can be written");
        assert!(Asset::parse(&again).as_ref() == Ok(&asset), "and read again");
    }
}

/// Opens any bytes as a resident form: they are refused, or the asset is evaluated to finite values and written as it
/// was read.
pub fn resident(bytes: &[u8]) {
    let Ok(file) = ResidentFile::open(Arc::new(bytes.to_vec()), &serial) else { return };
    let mut random = Random::new(bytes.len() as u64);
    let resident = &file.resident;
    for _ in 0..4 {
        let uv = [random.within(-1.0, 1.0), random.within(0.0, 2.0)];
        let (wi, wo) = (either_side(&mut random), either_side(&mut random));
        let query = Query { uv, wi, wo };
        let level = random.below(resident.levels() as usize + 1) as u32;
        let options = options(&mut random);
        let value = evaluate(resident, level, &query, &options);
        assert!(value.iter().all(|x| x.is_finite() && *x >= 0.0), "{value:?}");
        assert!(density(resident, level, &query, &options).is_finite());
        if let Some(drawn) = sample(resident, level, uv, wo, [0.1, 0.7, random.within(0.0, 1.0)], &options) {
            assert!(drawn.density.is_finite() && drawn.value.iter().all(|x| x.is_finite()), "{drawn:?}");
        }
    }
    let again = file.pack().expect("what was read can be written");
    let reread = ResidentFile::open(Arc::new(again), &serial).expect("and read again");
    assert!(reread == file, "and is the same");
}

/// Validates any bytes: the report has an error if and only if they cannot be opened, and the first error is that of
/// opening.
pub fn validate(bytes: &[u8]) {
    let report = btf_runtime::validate(Arc::new(bytes.to_vec()), &serial);
    let opened = match ResidentFile::is_one(bytes) {
        true => ResidentFile::open(Arc::new(bytes.to_vec()), &serial).map(|_| ()),
        false => Asset::parse(bytes).map(|_| ()),
    };
    match opened {
        Ok(()) => assert!(report.is_valid(), "{:?}", report.findings),
        Err(error) => assert_eq!(report.findings.first().map(|finding| finding.rule), error.rule(), "{error}"),
    }
    for finding in &report.findings {
        assert_eq!(finding.to_string().lines().count(), 1, "{finding:?}");
        assert!(finding.offset.is_none_or(|offset| offset <= bytes.len() as u64), "{finding:?}");
    }
}

/// Makes an asset of any bytes: it packs, parses to the same asset, and packs to the same bytes.
pub fn round_trip(bytes: &[u8]) {
    let asset = any_asset(bytes);
    let packed = pack(&asset).expect("it keeps to the format");
    let parsed = Asset::parse(&packed).expect("what was written can be read");
    assert!(parsed == asset, "it is read as it was written");
    assert!(pack(&parsed).as_ref() == Ok(&packed), "the same asset has the same bytes");
}

/// Reads any bytes as a volumetric texture: they are refused, or the volume and every tier of it are traversed to
/// finite depths, and the volume can be written and read again. Validation has an error if and only if the bytes are
/// refused.
pub fn voltex(bytes: &[u8]) {
    let report = btf_runtime::voltex::validate(bytes, &serial);
    for finding in &report.findings {
        assert_eq!(finding.to_string().lines().count(), 1, "{finding:?}");
        assert!(finding.offset.is_none_or(|offset| offset <= bytes.len() as u64), "{finding:?}");
    }
    let volume = match Volume::parse(bytes) {
        Ok(volume) => volume,
        Err(error) => {
            assert_eq!(report.findings.first().map(|finding| finding.rule), error.rule(), "{error}");
            return;
        }
    };
    assert!(report.is_valid(), "{:?}", report.findings);
    let directory = read_voltex_directory(bytes).expect("a volume was read, so its directory can be");
    for length in &directory.tiers[..directory.tier] {
        // A tier of forged files may end before what every tier needs.
        if let Ok(tier) = Volume::parse(&bytes[..*length as usize]) {
            assert!(volume.levels.ends_with(&tier.levels), "a tier is the coarser volume");
        }
    }
    let again = volume.pack().expect("what was read can be written");
    assert!(Volume::parse(&again).as_ref() == Ok(&volume), "and read again");
    if volume.levels[0].voxels.len() <= MAX_TEXELS {
        walk_somewhere(&volume, &mut Random::new(bytes.len() as u64));
    }
}

/// Traverses a volume along some rays; asserts that their optical depths are finite.
fn walk_somewhere(volume: &Volume, random: &mut Random) {
    let voltex = Voltex::new(volume);
    for _ in 0..4 {
        let (origin, direction) = ([0; 3].map(|_| random.within(-0.2, 1.2)), either_side(random));
        let level = random.below(volume.levels.len()) as u32;
        let mut walk = Walk::new(VoltexRay { origin, direction }, 0.0, 4.0, voltex.level_count());
        let mut depth = 0.0;
        while let Some(segment) = walk.next(&voltex, level) {
            if segment.cell.voxel != NO_VOXEL {
                let voxel = voltex.voxel(segment.cell.voxel);
                depth += voxel.extinction.form(direction, direction).max(0.0).sqrt() * (segment.t1 - segment.t0);
            }
        }
        assert!(depth.is_finite() && depth >= 0.0, "{depth}");
    }
}

fn either_side(random: &mut Random) -> [f32; 3] {
    let [x, y, z] = random.direction();
    [x, y, if random.below(2) == 0 { z } else { -z }]
}

fn options(random: &mut Random) -> DecodeOptions {
    DecodeOptions {
        interpolation: [Interpolation::Fast, Interpolation::Exact][random.below(2)],
        components: [u32::MAX, random.below(4) as u32][random.below(2)],
        lobes: [u32::MAX, random.below(3) as u32][random.below(2)],
        ..DecodeOptions::default()
    }
}

/// Evaluates some values of every layer of every level of an asset of moderate size; asserts that all are finite.
fn decode_somewhere(asset: &Asset, random: &mut Random) {
    let basis_words = |layer: &btf_runtime::Layer| {
        let bases = layer.residual.as_ref().map_or(0, |residual| residual.bases.len());
        layer.views.len() * layer.lights.len() * 3 * layer.dictionary.len() * bases.div_ceil(2)
    };
    let words: usize = asset.layers.iter().map(basis_words).sum();
    // An edited dictionary is as long as the measured one.
    let lobes = asset.layers.iter().flat_map(|layer| &layer.dictionary).map(Vec::len).sum::<usize>();
    let edited = (1 + asset.edits.list.len()) * lobes;
    if words > MAX_BASIS_WORDS || asset.texel_count() > MAX_TEXELS || edited > MAX_TEXELS {
        return;
    }
    let resident = Resident::from_asset(asset);
    for layer in 0..resident.layers() * resident.levels() {
        let of_level = &asset.layers[(layer % resident.layers()) as usize];
        let [width, height] = resident.size(layer).map(|side| side as usize);
        for _ in 0..2 {
            let (mut wi, mut wo) = (random.direction(), random.direction());
            for (z, side) in [(&mut wi[2], of_level.light_side), (&mut wo[2], of_level.view_side)] {
                *z *= if side as u32 == 1 { -1.0 } else { 1.0 };
            }
            let texel = random.below(width * height) as u32;
            let value = decode(&resident, layer, texel, wi, wo, &options(random));
            assert!(value.iter().all(|x| x.is_finite() && *x >= 0.0), "{value:?}");
        }
    }
}

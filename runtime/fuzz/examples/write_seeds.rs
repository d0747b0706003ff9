//! Writes the first inputs of the fuzz targets to `corpus`. A fuzzer's `-merge=1` adds the inputs that it finds.

use btf_runtime::testing::{
    Random, sample_grouped_asset, sample_grouped_spectrum, sample_spectral_asset, sample_volume,
};
use btf_runtime::{PackedGoal, Resident, ResidentFile, ResidualKind, pack, serial};
use btf_runtime_fuzz::any_asset;
use std::path::Path;

fn main() -> std::io::Result<()> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    for target in ["parse", "resident", "round_trip", "voltex"] {
        std::fs::create_dir_all(corpus.join(target))?;
    }
    for seed in 0..24 {
        let mut random = Random::new(seed);
        let bytes: Vec<u8> = (0..100 + random.below(900)).map(|_| random.bits() as u8).collect();
        let asset = any_asset(&bytes);
        let name = format!("seed-{seed:02}");
        std::fs::write(corpus.join("round_trip").join(&name), &bytes)?;
        std::fs::write(corpus.join("parse").join(&name), pack(&asset).expect("it keeps to the format"))?;
        let resident = ResidentFile::of_asset(asset, &serial);
        std::fs::write(corpus.join("resident").join(&name), resident.pack().expect("it is small"))?;
    }
    for (seed, kind) in [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root].into_iter().enumerate() {
        let asset = sample_grouped_asset(seed as u64, 12, 9, kind);
        let packed = pack(&asset).expect("it keeps to the format");
        std::fs::write(corpus.join("parse").join(format!("grouped-{seed:02}")), packed)?;
        let resident = Resident::packed_on(&asset, PackedGoal::Noise(0.01), &serial);
        let packed = ResidentFile::with_words(asset, resident).pack().expect("it is small");
        std::fs::write(corpus.join("resident").join(format!("packed-{seed:02}")), packed)?;
    }
    for (seed, asset) in [sample_spectral_asset(1, 6, 5), sample_grouped_spectrum(2, 6, 5)].into_iter().enumerate() {
        let name = format!("bands-{seed:02}");
        std::fs::write(corpus.join("parse").join(&name), pack(&asset).expect("it keeps to the format"))?;
        let resident = ResidentFile::of_asset(asset, &serial);
        std::fs::write(corpus.join("resident").join(&name), resident.pack().expect("it is small"))?;
    }
    for seed in 0..12 {
        let volume = sample_volume(seed, 1 + seed as usize % 10, 1 + 3 * seed as usize);
        let packed = volume.pack().expect("it keeps to the format");
        std::fs::write(corpus.join("voltex").join(format!("seed-{seed:02}")), packed)?;
    }
    Ok(())
}

//! Small deterministic assets and file surgery for the tests of this package and of its users. Not part of the promised
//! interface.

mod assets;
mod dense_asset;
mod file_parts;
mod random;
mod traffic;
mod volumes;

pub use crate::asset::residual::core_at_pair;
pub use crate::leaf::figures::{BAND_SHARES, THREE_ROWS};
pub use crate::leaf::theta::{rational_theta, three_piece_theta};
pub use assets::{
    first_ref, huge_asset, random_lobe, sample_asset, sample_grouped_asset, sample_grouped_spectrum, sample_heights,
    sample_predicted_asset, sample_relief_asset, sample_spectral_asset,
};
pub use dense_asset::dense_asset;
pub use file_parts::{FileParts, SectionPart, repair_header_checksum};
pub use random::{Random, direction_from_degrees, ring_directions, sphere_direction};
pub use traffic::{EvaluationTraffic, evaluation_traffic};
pub use volumes::{RAY_KINDS, random_volume, sample_ray, sample_volume, take_children};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::asset::Asset;
    use crate::asset::residual::ResidualKind;
    use crate::pack;

    const KINDS: [ResidualKind; 3] = [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root];

    #[test]
    fn a_sample_asset_survives_packing_and_parsing() {
        for (seed, kind) in KINDS.into_iter().enumerate() {
            let asset = sample_asset(seed as u64, 6, 5, kind);
            let bytes = pack(&asset).unwrap();
            assert_eq!(Asset::parse(&bytes).unwrap(), asset);
            assert_eq!(pack(&sample_asset(seed as u64, 6, 5, kind)).unwrap(), bytes, "same seed, same bytes");
            // Planted difference: another seed is another asset.
            assert_ne!(pack(&sample_asset(seed as u64 + 100, 6, 5, kind)).unwrap(), bytes);
        }
    }

    #[test]
    fn a_file_taken_apart_and_put_together_is_the_same_file() {
        let bytes = pack(&sample_asset(4, 6, 5, ResidualKind::Root)).unwrap();
        let mut parts = FileParts::from_bytes(&bytes).unwrap();
        assert_eq!(parts.to_bytes(), bytes);
        parts.sections[0].bytes.push(b' ');
        assert_ne!(parts.to_bytes(), bytes);
        assert!(Asset::parse(&parts.to_bytes()).is_ok());
    }
}

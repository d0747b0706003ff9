//! Conversion of an asset to other shapes: with coarser levels, or in its resident form.

use crate::error::FitError;
use crate::inspect::load::{packed_in_parallel, parallel};
use btf_runtime::{Asset, PackedGoal, ResidentFile, pack, with_levels};

/// Shape that [`convert`] makes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// The file form without levels.
    Plain,
    /// The file form with levels: about a quarter more bytes, and a reader need not make the levels.
    Levels,
    /// The resident form with levels: many times the bytes; it is mapped into memory and nothing is decoded.
    Resident,
    /// The resident form with levels and packed bases.
    Packed(PackedGoal),
    /// One level alone as an asset of its own; 0 is the finest, and numbers beyond the last give the coarsest.
    Level(usize),
}

/// Returns the bytes of `asset` in another shape. The same asset gives the same bytes on any number of threads.
///
/// Cost: making levels takes some seconds for 256 x 256 texels.
///
/// # Errors
/// [`FitError::Pack`] for a resident form of 4 GiB and more, [`FitError::Budget`] for bytes that are too few.
pub fn convert(asset: &Asset, shape: Shape) -> Result<Vec<u8>, FitError> {
    match shape {
        Shape::Plain => Ok(pack(&asset.without_levels())?),
        Shape::Levels => Ok(pack(&with_levels(asset, &parallel))?),
        Shape::Level(number) => Ok(pack(&with_levels(asset, &parallel).level(number))?),
        Shape::Packed(goal) => {
            let asset = with_levels(asset, &parallel);
            let resident = packed_in_parallel(&asset, goal)?;
            Ok(ResidentFile::with_words(asset, resident).pack()?)
        }
        Shape::Resident => Ok(ResidentFile::of_asset(with_levels(asset, &parallel), &parallel).pack()?),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_asset::sample_asset;
    use btf_runtime::Resident;
    use std::sync::Arc;

    #[test]
    fn every_shape_is_read_back_and_levels_can_be_taken_away_again() {
        let asset = Asset::parse(&pack(&sample_asset()).unwrap()).unwrap();
        let leveled = Asset::parse(&convert(&asset, Shape::Levels).unwrap()).unwrap();
        assert!(!leveled.levels.is_empty());
        // What levels were made from decodes as before; only the cluster that they use is more.
        assert_eq!(convert(&leveled, Shape::Plain).unwrap(), pack(&asset).unwrap());
        let second = Asset::parse(&convert(&leveled, Shape::Level(2)).unwrap()).unwrap();
        let expected = &leveled.levels[1];
        assert_eq!((second.width, second.height, second.levels.len()), (expected.width, expected.height, 0));
        assert_eq!(second.layers[0].lobe_refs, expected.layers[0].lobe_refs);
        let file = ResidentFile::open(Arc::new(convert(&asset, Shape::Resident).unwrap()), &parallel).unwrap();
        assert_eq!(file.resident, Resident::from_asset(&leveled));
        assert_ne!(file.resident, Resident::from_asset(&asset), "planted: without levels");
    }
}

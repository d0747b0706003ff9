//! Opens an asset in either form, ready to be evaluated.

use crate::asset::asset::Asset;
use crate::error::FormatError;
use crate::file::resident_file::ResidentFile;
use crate::levels::levels::with_levels;
use crate::resident::resident::ResidentBytes;
use crate::threads::Threads;

/// The levels with which an asset is opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Levels {
    /// The levels that the file has.
    AtHand,
    /// All levels down to one texel. They are made if the file has none, which takes some seconds for 256 x 256 texels.
    All,
}

/// Checks the bytes of an asset in either form and makes the resident form that decoders read. The words of a resident
/// form are used where they lie; a file form, or a tier of one, is decoded and expanded on `threads`.
///
/// Errors: those of [`Asset::parse`] and [`ResidentFile::open`].
pub fn open(bytes: ResidentBytes, levels: Levels, threads: Threads) -> Result<ResidentFile, FormatError> {
    let all: &[u8] = (*bytes).as_ref();
    if ResidentFile::is_one(all) {
        return ResidentFile::open(bytes, threads);
    }
    let mut asset = Asset::parse_on(all, threads)?;
    if levels == Levels::All {
        asset = with_levels(&asset, threads);
    }
    Ok(ResidentFile::of_asset(asset, threads))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::residual::ResidualKind;
    use crate::pack;
    use crate::testing::sample_asset;
    use crate::threads::serial;
    use std::sync::Arc;

    #[test]
    fn both_forms_open_to_the_same_words() {
        let asset = sample_asset(3, 8, 6, ResidualKind::Root);
        let file = Arc::new(pack(&asset).unwrap());
        let whole = open(file.clone(), Levels::All, &serial).unwrap();
        let again = open(Arc::new(whole.pack().unwrap()), Levels::AtHand, &serial).unwrap();
        assert_eq!(again, whole);
        let finest = open(file, Levels::AtHand, &serial).unwrap();
        assert_eq!((finest.resident.levels(), whole.resident.levels()), (1, 4));
        assert_ne!(finest, whole, "planted: without levels");
        assert!(open(Arc::new(vec![0; 100]), Levels::All, &serial).is_err());
    }
}

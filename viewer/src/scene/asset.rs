//! A packed asset of a scene, in either form.

use crate::error::ViewerError;
use btf_capture::SharedBytes;
use btf_runtime::{
    Asset, Channels, Edits, FormatError, HeightField, PackedGoal, Resident, ResidentFile, Spectrum, SurfaceSide,
    with_levels,
};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// Width and height of an asset that does not tell its own, millimetres.
pub const UNKNOWN_SIZE_MM: f32 = 100.0;

/// A packed asset, ready to be decoded.
#[derive(Debug, Clone)]
pub struct SceneAsset {
    /// File stem, for messages and the panel.
    pub name: String,
    /// File of the asset, if it was read from one.
    pub path: Option<PathBuf>,
    /// Physical width and height in millimetres, where the asset tells them.
    pub size_mm: Option<[f32; 2]>,
    /// The asset in its file form; `None` where only the resident form is at hand.
    pub file: Option<FileForm>,
    /// The asset with its levels in resident form; the bases of one that came in file form are zeros, unless they are
    /// packed.
    head: Resident,
    /// Whether `head` has the bases.
    has_bases: bool,
    /// The asset with its bases, once somebody has asked for them.
    expanded: OnceLock<Resident>,
    most_lobes: u32,
    /// What an asset in bands shows by its file: colours under D65.
    stored: Option<[Channels; 3]>,
}

/// An asset in its file form: what editing and planning go by.
#[derive(Debug, Clone)]
pub struct FileForm {
    /// The asset as the file has it.
    pub asset: Asset,
    /// The asset with coarser levels, made here where the file has none.
    pub whole: Asset,
}

impl FileForm {
    /// Returns the asset at a level, 0 the finest; the coarsest beyond them all. Cost: a copy.
    pub fn level(&self, level: usize) -> Asset {
        if level == 0 { self.asset.clone() } else { self.whole.level(level) }
    }
}

/// Does `count` pieces of the runtime's work on all threads.
fn parallel(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(work);
}

impl SceneAsset {
    /// Reads and checks an asset in either form; maps a resident one.
    ///
    /// # Errors
    /// [`ViewerError::Read`] or [`ViewerError::Asset`], both naming the file.
    pub fn load(path: &Path) -> Result<SceneAsset, ViewerError> {
        let bad = |source| ViewerError::Asset { path: path.into(), source };
        // What cannot be opened is told in our own words.
        btf_capture::files::open(path).map_err(|source| ViewerError::Read { path: path.into(), source })?;
        let bytes = SharedBytes::map(path)?;
        let name = path.file_stem().map_or_else(|| "asset".into(), |stem| stem.to_string_lossy().into_owned());
        let made = match bytes {
            Some(bytes) if ResidentFile::is_one(bytes.as_ref()) => {
                SceneAsset::of_resident(name, ResidentFile::open(Arc::new(bytes), &parallel).map_err(bad)?)
            }
            bytes => {
                let bytes = bytes.as_ref().map_or(&[][..], AsRef::as_ref);
                SceneAsset::new(name, Asset::parse_on(bytes, &parallel).map_err(bad)?)
            }
        };
        Ok(SceneAsset { path: Some(path.into()), ..made })
    }

    /// Checks an asset in either form that lies in memory.
    ///
    /// # Errors
    /// What is wrong with the bytes.
    pub fn from_bytes(name: impl Into<String>, bytes: Vec<u8>) -> Result<SceneAsset, FormatError> {
        if ResidentFile::is_one(&bytes) {
            return Ok(SceneAsset::of_resident(name.into(), ResidentFile::open(Arc::new(bytes), &parallel)?));
        }
        Ok(SceneAsset::new(name, Asset::parse_on(&bytes, &parallel)?))
    }

    fn of_resident(name: String, file: ResidentFile) -> SceneAsset {
        let (head, size_mm) = (file.resident, file.size_mm);
        let (most_lobes, stored) = (head.most_lobes(), head.spectrum().map(|spectrum| spectrum.shown));
        SceneAsset {
            name,
            path: None,
            size_mm,
            file: None,
            head,
            has_bases: true,
            expanded: OnceLock::new(),
            most_lobes,
            stored,
        }
    }

    /// Returns the file form, for what needs it.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] where only the resident form is at hand.
    pub fn file_form(&self) -> Result<&FileForm, ViewerError> {
        self.file.as_ref().ok_or_else(|| {
            ViewerError::Usage(format!(
                "{} is in its resident form, which can be shown but neither changed nor trimmed; open the asset that it \
                 was converted from",
                self.name
            ))
        })
    }

    /// Returns the file in file form that an asset in resident form was made of, where both lie as pages have them:
    /// `cloth.spmm` of `expanded/cloth.spmm`.
    pub fn original(&self) -> Option<PathBuf> {
        let original = self.path.as_ref()?.strip_prefix("expanded").ok()?;
        (self.file.is_none() && btf_capture::files::exists(original)).then(|| original.into())
    }

    /// Makes the small asset that comes with the viewer: 64 x 64 texels of woven cloth, 4 components. It was made by
    /// `btf-synth cloth C --size 64 --size-mm 4` and `btf-fit fit C -o weave.spmm --bytes 48kB`.
    pub fn built_in() -> SceneAsset {
        let asset = Asset::parse(include_bytes!("builtin/weave.spmm"));
        #[allow(clippy::expect_used, reason = "a test parses the same bytes")]
        SceneAsset::new("weave", asset.expect("the built-in asset is whole"))
    }

    /// Makes an asset of one that is already in memory, with its levels.
    pub fn new(name: impl Into<String>, asset: Asset) -> SceneAsset {
        let whole = with_levels(&asset, &parallel);
        let head = Resident::without_bases(&whole);
        let (size_mm, most_lobes) = (asset.size_mm, head.most_lobes());
        let stored = head.spectrum().map(|spectrum| spectrum.shown);
        SceneAsset {
            name: name.into(),
            path: None,
            size_mm,
            file: Some(FileForm { asset, whole }),
            head,
            has_bases: false,
            expanded: OnceLock::new(),
            most_lobes,
            stored,
        }
    }

    /// Returns the asset with packed bases ([`Resident::packed_on`]), for a scene that is to take little memory; one that
    /// came in resident form stays as it is. Cost: two expansions of the bases, on all threads.
    pub fn packed(&self, goal: PackedGoal) -> SceneAsset {
        let Some(file) = &self.file else { return self.clone() };
        let head = Resident::packed_on(&file.whole, goal, &parallel);
        SceneAsset { head, has_bases: true, expanded: OnceLock::new(), ..self.clone() }
    }

    /// Returns the asset with its levels in resident form, but for the bases: those of one that came in file form are
    /// zeros, unless they are packed.
    pub fn head(&self) -> &Resident {
        &self.head
    }

    /// Returns the asset with its levels in resident form, as decoders on the CPU take it. Cost: the first time, for
    /// one that came in file form, its bases are expanded on all threads.
    pub fn resident(&self) -> &Resident {
        let Some(file) = self.file.as_ref().filter(|_| !self.has_bases) else { return &self.head };
        self.expanded.get().unwrap_or_else(|| {
            // Made before the cell is locked: a thread that waits for others may take up work that asks for this as
            // well.
            let made = Resident::from_asset_on(&file.whole, &parallel);
            self.expanded.get_or_init(|| made)
        })
    }

    /// Tells whether [`SceneAsset::resident`] has its bases at hand.
    pub fn is_expanded(&self) -> bool {
        self.has_bases || self.expanded.get().is_some()
    }

    /// Puts `edits` in place of those at hand, where the file form is at hand.
    pub fn set_edits(&mut self, edits: Edits) {
        let Some(file) = &mut self.file else { return };
        self.head.set_edits(&edits, &file.whole.layers);
        self.expanded.get_mut().into_iter().for_each(|resident| resident.set_edits(&edits, &file.whole.layers));
        file.whole.edits = edits.clone();
        file.asset.edits = edits;
    }

    /// Returns the bands of the asset; `None` where its channels are colours.
    pub fn spectrum(&self) -> Option<Spectrum> {
        self.head.spectrum()
    }

    /// Shows what `weights` make of the bands of an asset that has any, in place of colours under D65: of the bands'
    /// wavelengths in nanometres the weights `[band][channel]`.
    pub fn show_bands(&mut self, weights: impl Fn(&[f64]) -> Vec<[f32; 3]>) {
        if let Some(shown) = self.shown_for(weights) {
            self.set_shown(shown);
        }
    }

    /// Returns the sums of channels by which [`SceneAsset::show_bands`] shows the bands; `None` for an asset without any.
    pub(crate) fn shown_for(&self, weights: impl Fn(&[f64]) -> Vec<[f32; 3]>) -> Option<[Channels; 3]> {
        let spectrum = self.spectrum()?;
        let nm: Vec<f64> = spectrum.wavelengths_nm.iter().map(|nm| f64::from(*nm)).collect();
        Some(spectrum.shown_through(&weights(&nm)))
    }

    /// Returns whether the asset has bands.
    pub(crate) fn has_bands(&self) -> bool {
        self.stored.is_some()
    }

    /// Shows an asset in bands as its file has it: in colours under D65.
    pub(crate) fn show_as_stored(&mut self) {
        if let Some(stored) = self.stored {
            self.set_shown(stored);
        }
    }

    /// Returns whether an asset in bands is shown as its file has it.
    pub(crate) fn shows_as_stored(&self) -> bool {
        self.spectrum().map(|spectrum| spectrum.shown) == self.stored
    }

    /// Shows an asset in bands as another one is shown.
    pub(crate) fn show_like(&mut self, other: &SceneAsset) {
        if let Some(other) = other.spectrum().filter(|_| self.has_bands()) {
            self.set_shown(other.shown);
        }
    }

    /// Shows other sums of the channels; what is saved stays as the file has it.
    fn set_shown(&mut self, shown: [Channels; 3]) {
        self.head.set_shown(shown);
        if let Some(resident) = self.expanded.get_mut() {
            resident.set_shown(shown);
        }
        if let Some(file) = &mut self.file {
            file.whole.spectrum.iter_mut().for_each(|spectrum| spectrum.shown = shown);
        }
    }

    /// Returns the residual components of the layer that has most.
    pub fn most_components(&self) -> u32 {
        self.head.most_components()
    }

    /// Tells whether the asset's front has heights.
    pub fn has_heights(&self) -> bool {
        let heights = |layer| HeightField::of_resident(&self.head, layer).is_some();
        self.head.layer_for_sides(0, SurfaceSide::Front, SurfaceSide::Front).is_some_and(heights)
    }

    /// Returns the lobes of the texel that has most.
    pub fn most_lobes(&self) -> u32 {
        self.most_lobes
    }

    /// Returns how often the asset's picture fits into a millimetre, along u and v; [`UNKNOWN_SIZE_MM`] where it does
    /// not tell.
    pub fn tiles_per_mm(&self) -> [f32; 2] {
        self.size_mm.unwrap_or([UNKNOWN_SIZE_MM; 2]).map(|size| 1.0 / size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_runtime::Edit;

    #[test]
    fn packed_assets_hold_their_bases_in_fewer_words_and_take_edits() {
        let whole = SceneAsset::built_in();
        let mut packed = whole.packed(PackedGoal::Noise(0.01));
        assert!(packed.is_expanded() && packed.resident().is_packed(0) && !whole.resident().is_packed(0));
        assert!(packed.resident().words().len() < whole.resident().words().len() / 2);
        assert_eq!(packed.resident(), packed.head());
        let texels = vec![1; packed.head().width() as usize * packed.head().height() as usize];
        packed.set_edits(Edits { list: vec![Edit { tint: [0.5; 3], ..Edit::default() }], texels });
        assert!(!packed.resident().edited_ranges().is_empty());
        assert_eq!(packed.file_form().unwrap().asset.edits.list.len(), 1);
        // Nothing was written in place of the bases.
        assert!(packed.resident().is_packed(0));
    }
}

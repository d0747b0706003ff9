//! The handle: opens an asset, returns what it holds, closes it.

use crate::border::{Target, call, read, read_many};
use crate::code::{Code, Fault};
use crate::threads::spread;
use btf_runtime::{Resident, ResidentBytes, Spectrum, SurfaceSide, read_version};
use std::ffi::{CStr, c_char};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// An open asset. A call only reads what the handle points to, so any number of threads may use one handle at once, in
/// all calls but btf_close.
pub struct Handle {
    pub(crate) resident: Resident,
    /// Bands of an asset that has any.
    pub(crate) spectrum: Option<Spectrum>,
    info: Info,
    /// Material description with a zero behind the text.
    material: Vec<u8>,
}

// What lets many threads read one handle: no call takes it as `&mut`, and the compiler agrees that `&Handle` may be
// shared.
const _: fn() = || {
    fn may_be_shared<T: Send + Sync>() {}
    may_be_shared::<Handle>();
};

/// The levels with which an asset is opened. A level is half as wide and high as the one before, for places where a
/// pixel covers several texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Levels {
    /// The levels that the file has.
    AtHand = 0,
    /// All levels down to a single texel. Missing ones are made, which takes seconds for large assets.
    All = 1,
}

/// Options of opening an asset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub struct OpenOptions {
    /// Levels: a btf_levels.
    pub levels: u32,
    /// Number of threads that opening may use, all gone when it returns; 0 for as many as there are processors.
    pub threads: u32,
}

/// Light and eye in front of the surface: reflection. A bit of btf_info.sides.
pub const BTF_FRONT_LIT_FRONT: u32 = 1;
/// Light behind the surface, eye in front: transmission. A bit of btf_info.sides.
pub const BTF_FRONT_LIT_BACK: u32 = 2;
/// Light in front of the surface, eye behind: transmission. A bit of btf_info.sides.
pub const BTF_BACK_LIT_FRONT: u32 = 4;
/// Light and eye behind the surface: reflection of its back. A bit of btf_info.sides.
pub const BTF_BACK_LIT_BACK: u32 = 8;

/// Properties of an asset.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct Info {
    /// Version of the file's format.
    pub format_version: u32,
    /// Number of texels in a row of the finest level.
    pub width: u32,
    /// Number of rows of the finest level.
    pub height: u32,
    /// Number of layers, 1 to 4: one for each pair of sides below.
    pub layers: u32,
    /// Number of levels, the finest included.
    pub levels: u32,
    /// Largest number of residual components that a layer has; 0 without residual.
    pub components: u32,
    /// Largest number of lobes that a texel has.
    pub lobes: u32,
    /// Sides of eye and light for which the asset has a layer: bits BTF_FRONT_LIT_FRONT to BTF_BACK_LIT_BACK. Other
    /// pairs of sides are black.
    pub sides: u32,
    /// Bit 0: the left edge continues the right one; bit 1: the bottom edge continues the top one.
    pub seamless: u32,
    /// Physical width in millimetres; 0 with the height where it is not known.
    pub width_mm: f32,
    /// Physical height in millimetres.
    pub height_mm: f32,
}

/// Bit of each pair of sides: of the light, of the eye.
const SIDES: [(u32, SurfaceSide, SurfaceSide); 4] = [
    (BTF_FRONT_LIT_FRONT, SurfaceSide::Front, SurfaceSide::Front),
    (BTF_FRONT_LIT_BACK, SurfaceSide::Back, SurfaceSide::Front),
    (BTF_BACK_LIT_FRONT, SurfaceSide::Front, SurfaceSide::Back),
    (BTF_BACK_LIT_BACK, SurfaceSide::Back, SurfaceSide::Back),
];

impl Handle {
    fn open(bytes: ResidentBytes, options: &OpenOptions) -> Result<Handle, Fault> {
        let levels = match options.levels {
            levels if levels == Levels::AtHand as u32 => btf_runtime::Levels::AtHand,
            levels if levels == Levels::All as u32 => btf_runtime::Levels::All,
            levels => {
                let sentence = format!("levels is {levels}: take BTF_LEVELS_AT_HAND or BTF_LEVELS_ALL");
                return Err(Fault::new(Code::Argument, sentence));
            }
        };
        let format_version = read_version((*bytes).as_ref()).unwrap_or_default();
        let file = btf_runtime::open(bytes, levels, &|count, work| spread(options.threads, count, work))?;
        let resident = file.resident;
        let sides = SIDES.into_iter().filter(|(_, light, view)| resident.layer_for_sides(0, *light, *view).is_some());
        let info = Info {
            format_version,
            width: resident.width(),
            height: resident.height(),
            layers: resident.layers(),
            levels: resident.levels(),
            components: resident.most_components(),
            lobes: resident.most_lobes(),
            sides: sides.map(|(bit, _, _)| bit).sum(),
            seamless: u32::from(file.seamless[0]) | u32::from(file.seamless[1]) << 1,
            width_mm: file.size_mm.unwrap_or_default()[0],
            height_mm: file.size_mm.unwrap_or_default()[1],
        };
        let mut material = file.material.into_bytes();
        material.push(0);
        let spectrum = resident.spectrum();
        Ok(Handle { resident, spectrum, info, material })
    }

    /// Returns the level, if the asset has it.
    pub(crate) fn level(&self, level: u32) -> Result<u32, Fault> {
        let levels = self.info.levels;
        if level < levels {
            return Ok(level);
        }
        Err(Fault::new(
            Code::Argument,
            format!("level {level} was asked for, the asset has {levels}, from 0; open it with BTF_LEVELS_ALL for all"),
        ))
    }
}

/// Returns the options that null stands for: levels of the file, all processors.
#[unsafe(no_mangle)]
pub extern "C" fn btf_default_open_options() -> OpenOptions {
    OpenOptions { levels: Levels::AtHand as u32, threads: 0 }
}

/// # Safety
/// As [`btf_open_memory`].
unsafe fn open_into(
    bytes: ResidentBytes,
    options: *const OpenOptions,
    asset: &Target<*mut Handle>,
    prefix: &str,
) -> Result<(), Fault> {
    let default = btf_default_open_options();
    // SAFETY: as the caller promised.
    let options = if options.is_null() { &default } else { unsafe { read(options, "options")? } };
    let handle = Handle::open(bytes, options)
        .map_err(|fault| Fault { sentence: format!("{prefix}{}", fault.sentence), ..fault })?;
    asset.set(Box::into_raw(Box::new(handle)));
    Ok(())
}

/// Opens an asset that lies in memory: checks it, and expands it to the form that is evaluated.
///
/// `bytes`, `length`: the whole `.spmm` file, or a prefix that ends where a tier does; not needed afterwards.
/// `options`: null for btf_default_open_options().
/// `asset`: receives the handle, which the caller owns and gives to btf_close; null where the call fails.
/// Errors: BTF_POINTER, BTF_ARGUMENT, and BTF_NOT_AN_ASSET to BTF_INVALID.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn btf_open_memory(
    bytes: *const u8,
    length: usize,
    options: *const OpenOptions,
    asset: *mut *mut Handle,
) -> Code {
    call(|| {
        // SAFETY: the caller gives a place for a pointer, `length` bytes, and options or null.
        unsafe {
            let asset = Target::new(asset, "asset")?;
            asset.set(std::ptr::null_mut());
            if bytes.is_null() {
                return Err(Fault::new(Code::Pointer, "the pointer 'bytes' is null"));
            }
            open_into(Arc::new(read_many(bytes, length, "bytes")?.to_vec()), options, &asset, "")
        }
    })
}

/// Opens an asset file, like btf_open_memory. A resident form is mapped, not read: it must not be changed in place
/// until the asset is closed. A file form is not needed afterwards.
///
/// `path`: text that ends with a zero; UTF-8, on Unix any bytes.
/// Errors: those of btf_open_memory, and BTF_FILE. The sentence of btf_last_error() begins with the path.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn btf_open_file(
    path: *const c_char,
    options: *const OpenOptions,
    asset: *mut *mut Handle,
) -> Code {
    call(|| {
        // SAFETY: the caller gives a place for a pointer, text that ends with a zero, and options or null.
        unsafe {
            let asset = Target::new(asset, "asset")?;
            asset.set(std::ptr::null_mut());
            if path.is_null() {
                return Err(Fault::new(Code::Pointer, "the pointer 'path' is null"));
            }
            let path = path_of(CStr::from_ptr(path))?;
            let bytes = bytes_of(&path)
                .map_err(|error| Fault::new(Code::File, format!("{} cannot be read: {error}", path.display())))?;
            open_into(bytes, options, &asset, &format!("{}: ", path.display()))
        }
    })
}

/// Maps the bytes of a file; an empty file has no mapping.
fn bytes_of(path: &Path) -> std::io::Result<ResidentBytes> {
    let file = std::fs::File::open(path)?;
    if file.metadata()?.len() == 0 {
        return Ok(Arc::new(Vec::new()));
    }
    // SAFETY: the header asks that the file is not changed in place; btf-fit never does.
    Ok(Arc::new(unsafe { memmap2::Mmap::map(&file) }?))
}

#[cfg(unix)]
fn path_of(text: &CStr) -> Result<PathBuf, Fault> {
    use std::os::unix::ffi::OsStrExt;
    Ok(std::ffi::OsStr::from_bytes(text.to_bytes()).into())
}

#[cfg(not(unix))]
fn path_of(text: &CStr) -> Result<PathBuf, Fault> {
    let path = text.to_str().map_err(|_| Fault::new(Code::Argument, "the path is not UTF-8"))?;
    Ok(path.into())
}

/// Closes an asset and frees all that belongs to it. Null does nothing. No other call may be using the handle, and none
/// may use it afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn btf_close(asset: *mut Handle) {
    if !asset.is_null() {
        // SAFETY: the caller gives a handle of `btf_open_*` that was not closed, and nobody else uses it.
        let handle = unsafe { Box::from_raw(asset) };
        call(|| {
            drop(handle);
            Ok(())
        });
    }
}

/// Returns the properties of an asset.
///
/// `info`: receives the properties.
/// Errors: BTF_POINTER.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn btf_query(asset: *const Handle, info: *mut Info) -> Code {
    call(|| {
        // SAFETY: the caller gives an open handle and a place for the answer.
        let (asset, info) = unsafe { (read(asset, "asset")?, Target::new(info, "info")?) };
        info.set(asset.info);
        Ok(())
    })
}

/// Returns the description of an asset: JSON, UTF-8, with its name and origin.
///
/// `text`: receives a pointer to the description, which belongs to the asset and stays until btf_close. A zero follows
/// the text.
/// `length`: receives the number of bytes without that zero; may be null.
/// Errors: BTF_POINTER.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn btf_material(asset: *const Handle, text: *mut *const c_char, length: *mut usize) -> Code {
    call(|| {
        // SAFETY: the caller gives an open handle and places for the answers, the second one or null.
        unsafe {
            let (asset, text) = (read(asset, "asset")?, Target::new(text, "text")?);
            if !length.is_null() {
                Target::new(length, "length")?.set(asset.material.len() - 1);
            }
            text.set(asset.material.as_ptr().cast());
        }
        Ok(())
    })
}

/// Returns the wavelengths of an asset's bands in nanometres, ascending.
///
/// `wavelengths_nm`: receives a pointer to them, which belongs to the asset and stays until btf_close; null for an asset of
/// colours.
/// `count`: receives their number; 0 for an asset of colours.
/// Errors: BTF_POINTER.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn btf_bands(asset: *const Handle, wavelengths_nm: *mut *const f32, count: *mut usize) -> Code {
    call(|| {
        // SAFETY: the caller gives an open handle and places for the answers.
        unsafe {
            let asset = read(asset, "asset")?;
            let (wavelengths_nm, count) =
                (Target::new(wavelengths_nm, "wavelengths_nm")?, Target::new(count, "count")?);
            let nm = asset.spectrum.as_ref().map_or(&[][..], |spectrum| &spectrum.wavelengths_nm);
            wavelengths_nm.set(if nm.is_empty() { std::ptr::null() } else { nm.as_ptr() });
            count.set(nm.len());
        }
        Ok(())
    })
}

/// Makes a second handle of an asset in bands whose values are other sums of them than linear sRGB under D65: colours under
/// another light, what a camera sees, or three of the bands. The caller gives both to btf_close.
///
/// `weights`: 3 x `count` numbers, for each band of btf_bands the weights in the three values.
/// `count`: number of bands; must be that of the asset.
/// `shown`: receives the handle; null where the call fails.
/// Errors: BTF_POINTER, BTF_ARGUMENT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn btf_show_bands(
    asset: *const Handle,
    weights: *const f32,
    count: usize,
    shown: *mut *mut Handle,
) -> Code {
    call(|| {
        // SAFETY: the caller gives an open handle, `count` times three numbers and a place for a pointer.
        unsafe {
            let shown = Target::new(shown, "shown")?;
            shown.set(std::ptr::null_mut());
            let asset = read(asset, "asset")?;
            let bands = asset.spectrum.as_ref().map_or(0, |spectrum| spectrum.wavelengths_nm.len());
            let Some(spectrum) = asset.spectrum.as_ref().filter(|_| count == bands) else {
                let sentence = format!("weights are for {count} bands and the asset has {bands}; ask btf_bands");
                return Err(Fault::new(Code::Argument, sentence));
            };
            let weights = read_many(weights.cast::<[f32; 3]>(), count, "weights")?;
            let (mut resident, material) = (asset.resident.clone(), asset.material.clone());
            resident.set_shown(spectrum.shown_through(weights));
            let handle = Handle { spectrum: resident.spectrum(), resident, info: asset.info, material };
            shown.set(Box::into_raw(Box::new(handle)));
        }
        Ok(())
    })
}

/// Returns an asset as the words of one storage buffer, for the WGSL decoder (`cargo xtask shaders` writes it as
/// btf.wgsl): all levels and layers, with offsets in words from the first, so that several assets may lie in one
/// buffer.
///
/// `words`: receives a pointer to the words, which belongs to the asset and stays until btf_close.
/// `count`: receives their number; a word has 4 bytes, in the machine's order.
/// Errors: BTF_POINTER.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn btf_resident(asset: *const Handle, words: *mut *const u32, count: *mut usize) -> Code {
    call(|| {
        // SAFETY: the caller gives an open handle and places for the answers.
        unsafe {
            let asset = read(asset, "asset")?;
            let (words, count) = (Target::new(words, "words")?, Target::new(count, "count")?);
            words.set(asset.resident.words().as_ptr());
            count.set(asset.resident.words().len());
        }
        Ok(())
    })
}

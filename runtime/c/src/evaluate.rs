//! Evaluates, samples, and returns densities.

use crate::asset::Handle;
use crate::border::{Target, call, check_many, read, read_many};
use crate::code::{Code, Fault};
use btf_runtime::{
    DecodeOptions, HeightUse, Query, density as density_of, evaluate, evaluate_bands, evaluate_many, sample,
};
use std::mem::offset_of;

/// Number of values that are computed before they are written to the caller's array.
const BATCH: usize = 256;

/// A place of the surface with a light and an eye.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct Place {
    /// Texture coordinate: u to the right, v up, one repetition of the asset a unit.
    pub uv: [f32; 2],
    /// Unit vector to the light, in the frame of tangent (along u), bitangent (along v) and normal; z < 0 is behind the
    /// surface. Its length may be off by half a percent.
    pub wi: [f32; 3],
    /// Unit vector to the eye, in the frame of wi. Its length may be off by half a percent.
    pub wo: [f32; 3],
}

// `read_many` hands places of C's to the runtime as its own.
const _: () = assert!(
    size_of::<Place>() == size_of::<Query>()
        && align_of::<Place>() == align_of::<Query>()
        && offset_of!(Place, uv) == offset_of!(Query, uv)
        && offset_of!(Place, wi) == offset_of!(Query, wi)
        && offset_of!(Place, wo) == offset_of!(Query, wo)
);

/// A direction that btf_sample has drawn, with its density and value.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C)]
pub struct Drawn {
    /// Unit vector to the light.
    pub wi: [f32; 3],
    /// Probability density, per steradian. 0: nothing was drawn, the path ends, and all else is 0 too.
    pub density: f32,
    /// Value of btf_evaluate for a light in this direction.
    pub value: [f32; 3],
}

/// The rule by which a value between the measured directions is computed from theirs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Interpolation {
    /// Evaluates the lobes in the asked directions and interpolates the residual: one evaluation of the lobes.
    Fast = 0,
    /// Scales the nine measured values around by the lobes: smoother between sparse directions, nine times the cost of
    /// the lobes.
    Exact = 1,
}

/// The use of an asset's heights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Heights {
    /// Ignores them.
    None = 0,
    /// Removes the parallax of eyes outside the measured ones.
    Parallax = 1,
    /// Also corrects what is interpolated between the measured directions; fast interpolation only.
    Relief = 2,
}

/// Options of an evaluation, from fast to exact. At the measured directions interpolation and heights change nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub struct Options {
    /// Largest number of residual components that are used; UINT32_MAX for all, 0 for the residual's mean alone.
    pub components: u32,
    /// Largest number of lobes of a texel that are used; UINT32_MAX for all.
    pub lobes: u32,
    /// Interpolation: a btf_interpolation.
    pub interpolation: u32,
    /// Use of the heights, where the asset has any: a btf_heights.
    pub heights: u32,
}

impl Options {
    fn checked(&self) -> Result<DecodeOptions, Fault> {
        let interpolation = match self.interpolation {
            rule if rule == Interpolation::Fast as u32 => btf_runtime::Interpolation::Fast,
            rule if rule == Interpolation::Exact as u32 => btf_runtime::Interpolation::Exact,
            rule => {
                let sentence =
                    format!("interpolation is {rule}: take BTF_INTERPOLATION_FAST or BTF_INTERPOLATION_EXACT");
                return Err(Fault::new(Code::Argument, sentence));
            }
        };
        let heights = match self.heights {
            heights if heights == Heights::None as u32 => HeightUse::None,
            heights if heights == Heights::Parallax as u32 => HeightUse::Parallax,
            heights if heights == Heights::Relief as u32 => HeightUse::Relief,
            heights => {
                let sentence =
                    format!("heights is {heights}: take BTF_HEIGHTS_NONE, BTF_HEIGHTS_PARALLAX or BTF_HEIGHTS_RELIEF");
                return Err(Fault::new(Code::Argument, sentence));
            }
        };
        Ok(DecodeOptions { components: self.components, lobes: self.lobes, interpolation, heights })
    }
}

/// Returns the options that null stands for: all components and lobes, fast interpolation, heights for parallax and relief.
#[unsafe(no_mangle)]
pub extern "C" fn btf_default_options() -> Options {
    let DecodeOptions { components, lobes, interpolation, heights } = DecodeOptions::default();
    let interpolation = match interpolation {
        btf_runtime::Interpolation::Fast => Interpolation::Fast,
        btf_runtime::Interpolation::Exact => Interpolation::Exact,
    };
    let heights = match heights {
        HeightUse::None => Heights::None,
        HeightUse::Parallax => Heights::Parallax,
        HeightUse::Relief => Heights::Relief,
    };
    Options { components, lobes, interpolation: interpolation as u32, heights: heights as u32 }
}

/// Returns the asset, its level and the options of a call.
///
/// # Safety
/// `asset` must be an open handle or null, `options` must point to options or be null.
unsafe fn asked<'a>(
    asset: *const Handle,
    level: u32,
    options: *const Options,
) -> Result<(&'a Handle, u32, DecodeOptions), Fault> {
    // SAFETY: as the caller promised.
    let asset = unsafe { read(asset, "asset")? };
    let options = if options.is_null() {
        DecodeOptions::default()
    } else {
        // SAFETY: as the caller promised.
        unsafe { read(options, "options")? }.checked()?
    };
    Ok((asset, asset.level(level)?, options))
}

/// # Safety
/// A pointer that is not null must point to `N` numbers that nothing changes while `'a` lasts.
unsafe fn numbers<'a, const N: usize>(pointer: *const f32, name: &str) -> Result<&'a [f32; N], Fault> {
    // SAFETY: as the caller promised; an array is aligned as its items.
    unsafe { read(pointer.cast(), name) }
}

/// Evaluates one place: pi x BRDF x |cosine of wi|, linear RGB, at least 0 and finite. With light and eye on different
/// sides it is the BTDF. A white Lambertian surface lit at normal incidence gives 1; the cosine is inside, so a
/// renderer multiplies by irradiance at normal incidence / pi, and by no further cosine.
///
/// `level`: 0 the finest, below btf_info.levels. The texel nearest to uv is evaluated.
/// `place`: texture coordinate, light and eye. The value is black where the asset has no layer for these sides, where a
/// number is not finite, and where wi or wo is not of length 1 within half a percent.
/// `options`: null for btf_default_options().
/// `value`: receives 3 numbers.
/// Errors: BTF_POINTER, BTF_ARGUMENT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn btf_evaluate(
    asset: *const Handle,
    level: u32,
    place: *const Place,
    options: *const Options,
    value: *mut f32,
) -> Code {
    call(|| {
        // SAFETY: the caller gives an open handle, a place, options or null, and room for 3 numbers.
        unsafe {
            let (asset, level, options) = asked(asset, level, options)?;
            let place = read(place.cast::<Query>(), "place")?;
            let value = Target::new(value.cast::<[f32; 3]>(), "value")?;
            value.set(evaluate(&asset.resident, level, place, &options));
        }
        Ok(())
    })
}

/// Evaluates the bands of one place of an asset that has any, as btf_evaluate does its colours, each at least 0.
///
/// `values`: receives a number for each wavelength of btf_bands.
/// `count`: room in `values`; must be the number of bands.
/// Errors: BTF_POINTER, BTF_ARGUMENT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn btf_evaluate_bands(
    asset: *const Handle,
    level: u32,
    place: *const Place,
    options: *const Options,
    values: *mut f32,
    count: usize,
) -> Code {
    call(|| {
        // SAFETY: the caller gives an open handle, a place, options or null, and room for `count` numbers.
        unsafe {
            let (asset, level, options) = asked(asset, level, options)?;
            let place = read(place.cast::<Query>(), "place")?;
            let bands = asset.spectrum.as_ref().map_or(0, |spectrum| spectrum.wavelengths_nm.len());
            let Some(spectrum) = asset.spectrum.as_ref().filter(|_| count == bands) else {
                let sentence = format!("there is room for {count} bands and the asset has {bands}; ask btf_bands");
                return Err(Fault::new(Code::Argument, sentence));
            };
            check_many(values, count, "values")?;
            let mut told = vec![0.0; count];
            evaluate_bands(&asset.resident, spectrum, level, place, &options, &mut told);
            std::ptr::copy_nonoverlapping(told.as_ptr(), values, count);
        }
        Ok(())
    })
}

/// Evaluates many places, each like btf_evaluate, on the calling thread. Several threads may share the work: give each
/// a part of the arrays.
///
/// `places`: `count` of them; `count` may be 0, and then no array is read.
/// `values`: receives 3 x `count` numbers, red, green and blue of each place. Untouched where the call fails.
/// Errors: BTF_POINTER, BTF_ARGUMENT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn btf_evaluate_many(
    asset: *const Handle,
    level: u32,
    places: *const Place,
    count: usize,
    options: *const Options,
    values: *mut f32,
) -> Code {
    call(|| {
        // SAFETY: the caller gives an open handle and options or null.
        let (asset, level, options) = unsafe { asked(asset, level, options)? };
        let (places, values) = (places.cast::<Query>(), values.cast::<[f32; 3]>());
        check_many(places, count, "places")?;
        check_many(values, count, "values")?;
        let mut batch = [[0.0; 3]; BATCH];
        for first in (0..count).step_by(BATCH) {
            let length = BATCH.min(count - first);
            // SAFETY: `count` places are there, so these are; the slice is gone before anything is written.
            let places = unsafe { read_many(places.add(first), length, "places")? };
            evaluate_many(&asset.resident, level, places, &options, &mut batch[..length]);
            // SAFETY: there is room for `count` values, which may hold anything before; `batch` is ours.
            unsafe { values.add(first).copy_from_nonoverlapping(batch.as_ptr(), length) };
        }
        Ok(())
    })
}

/// Draws a direction to light that matters to an eye: by the lobes, and a share by the cosine. Where the eye sees light
/// from both sides, either has the same probability. value / (pi x density) is the weight of a path that continues in
/// the direction.
///
/// `level`: as for btf_evaluate.
/// `uv`: 2 numbers, `wo`: 3 numbers, as in btf_place.
/// `at`: 3 numbers, each 0 to 1, 1 not included: random, or of a low-discrepancy sequence.
/// `options`: null for btf_default_options().
/// `drawn`: receives the direction. Its density is 0 where nothing was drawn, which is no error.
/// Errors: BTF_POINTER, BTF_ARGUMENT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn btf_sample(
    asset: *const Handle,
    level: u32,
    uv: *const f32,
    wo: *const f32,
    at: *const f32,
    options: *const Options,
    drawn: *mut Drawn,
) -> Code {
    call(|| {
        // SAFETY: the caller gives an open handle, 2, 3 and 3 numbers, options or null, and a place for the result.
        unsafe {
            let (asset, level, options) = asked(asset, level, options)?;
            let (uv, wo, at) = (numbers(uv, "uv")?, numbers(wo, "wo")?, numbers(at, "at")?);
            let drawn = Target::new(drawn, "drawn")?;
            let found = sample(&asset.resident, level, *uv, *wo, *at, &options);
            drawn.set(found.map_or(Drawn::default(), |found| Drawn {
                wi: found.wi,
                density: found.density,
                value: found.value,
            }));
        }
        Ok(())
    })
}

/// Draws one of the four texels around a texture coordinate: with evenly spread numbers the mean of their values is
/// their bilinear interpolation, so that an asset whose texels are larger than pixels looks smooth. Give btf_evaluate,
/// btf_sample and btf_density of one vertex of a path the coordinate that this returns in place of the vertex's own.
///
/// `level`: as for btf_evaluate.
/// `uv`: 2 numbers, as in btf_place.
/// `at`: 2 numbers, each 0 to 1, 1 not included: random, or of a low-discrepancy sequence; 0.5 twice for the nearest
/// texel.
/// `between`: receives 2 numbers, the middle of the texel, from 0 to 1.
/// Errors: BTF_POINTER, BTF_ARGUMENT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn btf_uv_between(
    asset: *const Handle,
    level: u32,
    uv: *const f32,
    at: *const f32,
    between: *mut f32,
) -> Code {
    call(|| {
        // SAFETY: the caller gives an open handle, 2 and 2 numbers, and room for 2.
        unsafe {
            let (asset, level, _) = asked(asset, level, std::ptr::null())?;
            let (uv, at) = (numbers(uv, "uv")?, numbers(at, "at")?);
            let between = Target::new(between.cast::<[f32; 2]>(), "between")?;
            between.set(asset.resident.uv_between(level, *uv, *at));
        }
        Ok(())
    })
}

/// Returns the density with which btf_sample draws the light's direction of a place, per steradian; 0 where it never
/// does.
///
/// `level`, `place`: as for btf_evaluate. `options`: those that btf_sample had.
/// `density`: receives 1 number.
/// Errors: BTF_POINTER, BTF_ARGUMENT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn btf_density(
    asset: *const Handle,
    level: u32,
    place: *const Place,
    options: *const Options,
    density: *mut f32,
) -> Code {
    call(|| {
        // SAFETY: the caller gives an open handle, a place, options or null, and room for a number.
        unsafe {
            let (asset, level, options) = asked(asset, level, options)?;
            let place = read(place.cast::<Query>(), "place")?;
            let density = Target::new(density, "density")?;
            density.set(density_of(&asset.resident, level, place, &options));
        }
        Ok(())
    })
}

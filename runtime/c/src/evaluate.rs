//! Values, samples and densities.

use crate::asset::Handle;
use crate::border::{Target, call, check_many, read, read_many};
use crate::code::{Code, Fault};
use btf_runtime::{DecodeOptions, Query, density as density_of, evaluate, evaluate_many, sample};
use std::mem::offset_of;

/// Values that are computed before they are handed over.
const BATCH: usize = 256;

/// A place of the surface, a light and an eye.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct Place {
    /// Texture coordinate: u to the right, v up, one repetition of the asset a unit.
    pub uv: [f32; 2],
    /// Unit vector to the light, in the frame of tangent (along u), bitangent (along v) and normal; z < 0 is behind the
    /// surface. Its length may be off by half a percent.
    pub wi: [f32; 3],
    /// Unit vector to the eye, likewise.
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

/// A direction that btf_sample has drawn.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C)]
pub struct Drawn {
    /// Unit vector to the light.
    pub wi: [f32; 3],
    /// Probability density, per steradian. 0: nothing was drawn, the path ends, and all else is 0 too.
    pub density: f32,
    /// What btf_evaluate gives in this direction.
    pub value: [f32; 3],
}

/// How a value between the measured directions is made of theirs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Interpolation {
    /// The lobes in the asked directions, the residual interpolated: one evaluation of the lobes.
    Fast = 0,
    /// The nine measured values around, scaled by the lobes: smoother between sparse directions, nine times the
    /// lobes' cost.
    Exact = 1,
}

/// How exactly to evaluate. At the measured directions interpolation and parallax change nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub struct Options {
    /// Residual components at most; UINT32_MAX for all, 0 for the residual's mean alone.
    pub components: u32,
    /// Lobes of a texel at most; UINT32_MAX for all.
    pub lobes: u32,
    /// A btf_interpolation.
    pub interpolation: u32,
    /// 1: parallax of eyes outside the measured ones is removed where the asset has heights. 0: it is left.
    pub parallax: u32,
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
        let parallax = match self.parallax {
            0 => false,
            1 => true,
            other => return Err(Fault::new(Code::Argument, format!("parallax is {other}: take 0 or 1"))),
        };
        Ok(DecodeOptions { components: self.components, lobes: self.lobes, interpolation, parallax })
    }
}

/// The options that null stands for: all components and lobes, fast interpolation, parallax removed.
#[unsafe(no_mangle)]
pub extern "C" fn btf_default_options() -> Options {
    let DecodeOptions { components, lobes, interpolation, parallax } = DecodeOptions::default();
    let interpolation = match interpolation {
        btf_runtime::Interpolation::Fast => Interpolation::Fast,
        btf_runtime::Interpolation::Exact => Interpolation::Exact,
    };
    Options { components, lobes, interpolation: interpolation as u32, parallax: parallax.into() }
}

/// The asset, its level and the options of a call.
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

/// Evaluates one place: pi x BRDF x |cosine of wi|, linear RGB, at least 0 and finite. With light and eye on
/// different sides it is the BTDF. A white Lambertian lit at normal incidence gives 1; the cosine is inside, so a
/// renderer multiplies irradiance at normal incidence / pi, and no further cosine.
///
/// `level`: 0 the finest, below btf_info.levels. The texel nearest to uv answers.
/// `place`: where, lit from where, seen from where. Black where the asset has no layer for these sides, where a
/// number is not finite, and where wi or wo is not of length 1 within half a percent.
/// `options`: null for btf_default_options().
/// `value`: takes 3 numbers.
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

/// Evaluates many places, as btf_evaluate does one, on the calling thread. Several threads may share the work: give
/// each a part of the arrays.
///
/// `places`: `count` of them; `count` may be 0, and then no array is looked at.
/// `values`: takes 3 x `count` numbers, red, green and blue of each place. Untouched where the call fails.
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
/// from both sides, either is as likely. value / (pi x density) is the weight of a path that goes on there.
///
/// `level`: as btf_evaluate.
/// `uv`: 2 numbers, `wo`: 3 numbers, as in btf_place.
/// `at`: 3 numbers, each 0 to 1, 1 not included: random, or of a low-discrepancy sequence.
/// `options`: null for btf_default_options().
/// `drawn`: takes the direction. Its density is 0 where nothing was drawn, which is no error.
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

/// The density with which btf_sample draws the light's direction of a place, per steradian; 0 where it never does.
///
/// `level`, `place`, `options`: as btf_evaluate; the same options as btf_sample had.
/// `density`: takes 1 number.
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

//! Powers of non-negative numbers, for the root curve and for lobes. They use single-precision additions,
//! multiplications and at most one division, without branches and tables, so that the compiler can use SIMD and every
//! machine computes the same bits.
//!
//! `x^p = 2^(p log2 x)` with `x = 2^e m`, `m` in `[1/sqrt 2, sqrt 2)`. `p e` alone can be large; its integer part goes
//! into the exponent of the result before the small rest is rounded, so that the error does not grow with `e`.
//!
//! The WGSL twin has the language's `pow`, which is less exact (WGSL allows `exp2(y * log2(x))`, whose relative error
//! is a few 1e-6 between 1e-3 and 10): Rust and shaders agree within a tolerance, not bit for bit.

/// Largest relative error of [`root`] and of its inverse where the result is a normal number.
pub const POWER_RELATIVE_ERROR: f64 = 4e-7;

/// Returns `x^(1 / 2.4)`. Numbers below `f32::MIN_POSITIVE` and NaN give 0, infinity a finite number.
#[inline(always)]
pub fn root(x: f32) -> f32 {
    power(x, ONE_OVER_ROOT)
}

/// Returns `y^2.4`, the inverse of [`root`]; at most `2^127.5`, so always finite. Numbers below `f32::MIN_POSITIVE` and
/// NaN give 0.
#[inline(always)]
pub fn from_root(y: f32) -> f32 {
    power(y, ROOT)
}

/// An exponent, whole and in two parts.
#[derive(Clone, Copy)]
struct Exponent {
    whole: f32,
    /// First 12 bits of the exponent: their product with the exponent of a float is exact.
    head: f32,
    tail: f32,
}

impl Exponent {
    const fn new(exponent: f64) -> Exponent {
        let head = f32::from_bits((exponent as f32).to_bits() & 0xffff_f000);
        Exponent { whole: exponent as f32, head, tail: (exponent - head as f64) as f32 }
    }
}

const ROOT: Exponent = Exponent::new(2.4);
const ONE_OVER_ROOT: Exponent = Exponent::new(1.0 / 2.4);

/// Bits of `1 / sqrt 2`, the lower end of the range of mantissas.
const MIN_MANTISSA: u32 = 0x3f35_04f3;
/// Coefficients of `log2 m = s (L0 + L1 s^2 + L2 s^4 + L3 s^6)` with `s = (m - 1) / (m + 1)`. They minimise the largest
/// relative error, which is 7e-10.
const LOG: [f32; 4] = [2.885_39, 0.961_798_85, 0.576_713_6, 0.431_756_15];
/// Coefficients of the polynomial for `2^f` with `f` in `[-0.5, 0.5]`. They minimise the largest relative error, which
/// is 1.9e-9.
const EXP: [f32; 7] =
    [1.0, std::f32::consts::LN_2, 0.240_226_47, 0.055_503_29, 0.009_618_489, 0.001_339_993_1, 0.000_153_458_12];
/// Number that rounds another one below 2^22 to an integer when it is added; the integer then stands in the low bits.
const ROUNDER: f32 = 12_582_912.0;

#[inline(always)]
fn power(x: f32, exponent: Exponent) -> f32 {
    let (e, log2_m) = exponent_and_log2_mantissa(x);
    let large = exponent.head * e;
    let small = exponent.tail * e + exponent.whole * log2_m;
    let whole = rounded(large + small);
    let result = two_to(whole, (large - whole) + small);
    if x >= f32::MIN_POSITIVE { result } else { 0.0 }
}

/// Returns `2^x`. `x` is clamped to -126 to 127.
#[inline(always)]
pub(crate) fn exp2(x: f32) -> f32 {
    let x = if x > -126.0 { x } else { -126.0 };
    let x = if x < 127.0 { x } else { 127.0 };
    let whole = rounded(x);
    two_to(whole, x - whole)
}

/// Returns `e^x`. `x` is clamped to -87 to 88.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    // ln 2 in two parts: the first times a whole number below 256 is exact.
    const LN_2: [f32; 2] = [0.693_145_75, 1.428_606_8e-6];
    let x = if x > -87.0 { x } else { -87.0 };
    let x = if x < 88.0 { x } else { 88.0 };
    let whole = rounded(x * std::f32::consts::LOG2_E);
    two_to(whole, ((x - whole * LN_2[0]) - whole * LN_2[1]) * std::f32::consts::LOG2_E)
}

/// Returns `log2 x` of a normal number above 0, and a finite number for any other `x`.
#[inline(always)]
pub(crate) fn log2(x: f32) -> f32 {
    let (e, log2_m) = exponent_and_log2_mantissa(x);
    e + log2_m
}

/// Returns `e` and `log2 m` of `x = 2^e m`.
#[inline(always)]
fn exponent_and_log2_mantissa(x: f32) -> (f32, f32) {
    let bits = positive(x).to_bits();
    let e = bits.wrapping_sub(MIN_MANTISSA) as i32 >> 23;
    let m = f32::from_bits(bits.wrapping_sub((e << 23) as u32));
    let s = (m - 1.0) / (m + 1.0);
    let t = s * s;
    (e as f32, s * (LOG[0] + t * (LOG[1] + t * (LOG[2] + t * LOG[3]))))
}

/// Returns `x` where it is above 0, and 0 elsewhere, for NaN, too. A comparison is one instruction everywhere; [`f32::max`] is a
/// call in WebAssembly.
#[inline(always)]
pub(crate) fn positive(x: f32) -> f32 {
    if x > 0.0 { x } else { 0.0 }
}

/// Returns the nearest integer to a number below 2^22.
#[inline(always)]
fn rounded(x: f32) -> f32 {
    (x + ROUNDER) - ROUNDER
}

/// Returns `2^(whole + f)` with `f` in `[-0.5, 0.5]` and an integer `whole`, which gives 0 below -126 and counts as 127
/// above that.
#[inline(always)]
fn two_to(whole: f32, f: f32) -> f32 {
    let mantissa = EXP[0] + f * (EXP[1] + f * (EXP[2] + f * (EXP[3] + f * (EXP[4] + f * (EXP[5] + f * EXP[6])))));
    // The exponent's bits: -127 makes the factor 0.
    let whole = if whole > -127.0 { whole } else { -127.0 };
    let whole = if whole < 127.0 { whole } else { 127.0 };
    mantissa * f32::from_bits((whole + (ROUNDER + 127.0)).to_bits() << 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the largest relative error of `power` against double precision over the normal floats: every 977th (a
    /// prime, so that all mantissas are met) whose exact power is a normal number too.
    fn largest_error(power: impl Fn(f32) -> f32, exponent: f64) -> f64 {
        let mut largest = 0.0f64;
        for bits in (f32::MIN_POSITIVE.to_bits()..f32::INFINITY.to_bits()).step_by(977) {
            let x = f32::from_bits(bits);
            let exact = f64::from(x).powf(exponent);
            if (f64::from(f32::MIN_POSITIVE)..2f64.powf(127.4)).contains(&exact) {
                largest = largest.max((f64::from(power(x)) / exact - 1.0).abs());
            }
        }
        largest
    }

    #[test]
    fn the_stated_error_holds_from_the_smallest_to_the_largest_number() {
        let errors = [largest_error(root, 1.0 / 2.4), largest_error(from_root, 2.4)];
        assert!(errors.iter().all(|error| *error <= POWER_RELATIVE_ERROR), "{errors:?}");
        // Planted differences: an error twice as large, and another exponent.
        assert!(largest_error(|x| root(x) * (1.0 + 8e-7), 1.0 / 2.4) > POWER_RELATIVE_ERROR);
        assert!(largest_error(root, 1.0 / 2.400_001) > POWER_RELATIVE_ERROR);
    }

    #[test]
    fn the_extremes_are_finite_and_nothing_stays_nothing() {
        for power in [root, from_root] {
            assert_eq!(power(1.0), 1.0);
            for x in [0.0, -0.0, -1.0, f32::NEG_INFINITY, f32::NAN, 1e-40] {
                assert_eq!(power(x).to_bits(), 0, "{x}");
            }
            for x in [f32::MIN_POSITIVE, 1e-30, 1e30, f32::MAX, f32::INFINITY] {
                assert!(power(x).is_finite() && power(x) >= 0.0, "{x}: {}", power(x));
            }
        }
        assert!(from_root(f32::MAX) > 1e38 && from_root(1e-30) == 0.0);
    }

    #[test]
    fn exponentials_and_logarithms_are_those_of_double_precision() {
        /// Returns the largest relative error over `-range..range`.
        fn largest(range: f32, of: impl Fn(f32) -> f32, exact: impl Fn(f64) -> f64) -> f64 {
            let at = |i: i32| range * i as f32 / 100_003.0;
            let error = |x: f32| (f64::from(of(x)) / exact(f64::from(x)) - 1.0).abs();
            (-100_003..100_003).map(|i| error(at(i))).fold(0.0, f64::max)
        }
        let errors = [largest(87.0, exp, f64::exp), largest(125.9, exp2, f64::exp2)];
        assert!(errors.iter().all(|error| *error <= POWER_RELATIVE_ERROR), "{errors:?}");
        assert!(largest(87.0, |x| exp2(x * std::f32::consts::LOG2_E), f64::exp) > POWER_RELATIVE_ERROR, "planted");
        for i in 1..200_000u32 {
            let x = f32::from_bits(i * 10_007 + f32::MIN_POSITIVE.to_bits());
            if x.is_finite() {
                let exact = f64::from(x).log2();
                assert!((f64::from(log2(x)) - exact).abs() <= 2e-7 * exact.abs(), "{x}: {} {exact}", log2(x));
            }
        }
        for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -1.0, 1e-42, f32::MAX] {
            assert!(exp(x).is_finite() && exp2(x).is_finite() && log2(x).is_finite(), "{x}");
        }
        assert_eq!([exp(0.0), exp2(0.0), exp2(-3.0), log2(1.0), log2(0.125)], [1.0, 1.0, 0.125, 0.0, -3.0]);
    }

    #[test]
    fn the_bits_are_those_of_every_other_machine() {
        // Recorded once; single-precision arithmetic leaves no room.
        let sum = |power: fn(f32) -> f32| {
            (1..100_000u32).fold(0u32, |sum, i| sum.wrapping_mul(31).wrapping_add(power(i as f32 * 1e-4).to_bits()))
        };
        assert_eq!([sum(root), sum(from_root)], [1_257_431_709, 3_252_121_067]);
    }

    #[test]
    fn a_loop_over_neighbours_rises() {
        // Steps of the pieces do not go down by more than the error.
        for i in 1..200_000u32 {
            let x = 0.4 + i as f32 * 1e-5;
            for power in [root, from_root] {
                assert!(power(x.next_up()) >= power(x) * (1.0 - 2.0 * POWER_RELATIVE_ERROR as f32));
            }
        }
    }
}

//! Numbers for which a model is evaluated: one, or several side by side.

use std::ops::{Add, Div, Mul, Sub};
use wide::{CmpGt, f32x8};

/// One or several single-precision numbers.
pub trait Real: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    /// Returns `x`, in all places.
    fn of(x: f32) -> Self;
    /// Returns the square root.
    fn root(self) -> Self;
    /// Returns e to this power.
    fn power_of_e(self) -> Self;
    /// Returns the greater of two numbers.
    fn at_least(self, x: Self) -> Self;
    /// Returns the smaller of two numbers.
    fn at_most(self, x: Self) -> Self;
    /// Returns `yes` where this is above 0, else `no`.
    fn if_positive(self, yes: Self, no: Self) -> Self;

    /// Returns the number cut to a range.
    #[inline(always)]
    fn within(self, least: f32, most: f32) -> Self {
        self.at_least(Self::of(least)).at_most(Self::of(most))
    }
}

impl Real for f32 {
    #[inline(always)]
    fn of(x: f32) -> f32 {
        x
    }

    #[inline(always)]
    fn root(self) -> f32 {
        self.sqrt()
    }

    #[inline(always)]
    fn power_of_e(self) -> f32 {
        self.exp()
    }

    #[inline(always)]
    fn at_least(self, x: f32) -> f32 {
        self.max(x)
    }

    #[inline(always)]
    fn at_most(self, x: f32) -> f32 {
        self.min(x)
    }

    #[inline(always)]
    fn if_positive(self, yes: f32, no: f32) -> f32 {
        if self > 0.0 { yes } else { no }
    }
}

impl Real for f32x8 {
    #[inline(always)]
    fn of(x: f32) -> f32x8 {
        f32x8::splat(x)
    }

    #[inline(always)]
    fn root(self) -> f32x8 {
        self.sqrt()
    }

    #[inline(always)]
    fn power_of_e(self) -> f32x8 {
        self.exp()
    }

    #[inline(always)]
    fn at_least(self, x: f32x8) -> f32x8 {
        self.fast_max(x)
    }

    #[inline(always)]
    fn at_most(self, x: f32x8) -> f32x8 {
        self.fast_min(x)
    }

    #[inline(always)]
    fn if_positive(self, yes: f32x8, no: f32x8) -> f32x8 {
        self.cmp_gt(f32x8::ZERO).blend(yes, no)
    }
}

//! The numbers that a network computes with: f32 for work, f64 to check derivatives.

use std::fmt::Debug;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// A floating-point number, f32 or f64; sealed, because the matrix product knows these two only.
pub trait Real:
    Copy
    + Send
    + Sync
    + 'static
    + Default
    + Debug
    + PartialEq
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
    + Sum
    + sealed::Sealed
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;

    /// The nearest number of this type.
    fn from_f64(value: f64) -> Self;
    /// The same number, exactly.
    fn to_f64(self) -> f64;
    /// e to the power of the number.
    #[must_use]
    fn exp(self) -> Self;
    /// The natural logarithm.
    #[must_use]
    fn ln(self) -> Self;
    /// The square root.
    #[must_use]
    fn sqrt(self) -> Self;
    /// The magnitude.
    #[must_use]
    fn abs(self) -> Self;
    /// The hyperbolic tangent that the networks use.
    ///
    /// For f32 a rational function without branches, so that loops over it vectorize; within 5e-7 of the truth,
    /// relative. For f64, where derivatives are checked, the standard library's.
    #[must_use]
    fn tanh(self) -> Self;
    /// Whether the number is neither infinite nor NaN.
    fn is_finite(self) -> bool;
}

mod sealed {
    /// Keeps [`super::Real`] to the types of this crate.
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

macro_rules! real {
    ($number:ident, $tanh:path) => {
        impl Real for $number {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;

            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                value as $number
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn exp(self) -> Self {
                $number::exp(self)
            }
            #[inline(always)]
            fn ln(self) -> Self {
                $number::ln(self)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $number::sqrt(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $number::abs(self)
            }
            #[inline(always)]
            fn tanh(self) -> Self {
                $tanh(self)
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                $number::is_finite(self)
            }
        }
    };
}

real!(f32, rational_tanh);
real!(f64, f64::tanh);

/// tanh x ≈ x P(x²) / Q(x²) on [−9, 9]; beyond, tanh is 1 in f32.
///
/// The coefficients come from `tests/references/tanh.py`; the fit's own relative error is 2e-8.
#[inline(always)]
fn rational_tanh(x: f32) -> f32 {
    let x = limit(x, 9.0);
    let y = x * x;
    let p =
        (((1.335_305_2e-8 * y + 2.060_802e-5) * y + 3.495_529_3e-3) * y + 0.133_809_78) * y + 0.999_999_98;
    let q = (((7.775_926e-7 * y + 3.285_534_2e-4) * y + 0.025_876_766) * y + 0.467_142_94) * y + 1.0;
    limit(x * p / q, 1.0)
}

/// x between ±limit; unlike `f32::max` it keeps NaN, which must reach the check for divergence.
#[inline(always)]
fn limit(x: f32, limit: f32) -> f32 {
    let x = if x > limit { limit } else { x };
    if x < -limit { -limit } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tanh_of_f32_is_close_to_the_standard_one_everywhere() {
        let mut worst = 0.0_f64;
        for step in -240_000..=240_000 {
            let x = step as f32 * 5e-5;
            let truth = f64::from(x).tanh();
            let found = f64::from(Real::tanh(x));
            worst = worst.max((found - truth).abs() / truth.abs().max(1e-30));
            assert!(found.abs() <= 1.0);
        }
        assert!(worst < 5e-7, "relative error {worst:e}");
    }

    #[test]
    fn tanh_of_f32_behaves_at_the_ends() {
        assert_eq!(Real::tanh(0.0_f32), 0.0);
        assert!((Real::tanh(f32::INFINITY) - 1.0).abs() < 2e-7);
        assert!((Real::tanh(-1e30_f32) + 1.0).abs() < 2e-7);
        assert!(Real::tanh(f32::NAN).is_nan());
    }
}

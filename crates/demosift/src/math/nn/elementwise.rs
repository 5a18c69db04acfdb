//! Loops over elements, compiled for several instruction sets of which the best is chosen at run time.

use crate::math::nn::Real;
use pulp::{Arch, NullaryFnOnce};
use std::sync::LazyLock;

/// Runs a loop with the best instructions of this processor.
///
/// The loop and all that it calls must be `#[inline(always)]`, or it is compiled for the oldest processor after all.
#[inline(always)]
pub(crate) fn vectorized<R>(run: impl FnMut() -> R) -> R {
    static ARCH: LazyLock<Arch> = LazyLock::new(Arch::new);
    ARCH.dispatch(Loop(run))
}

/// Calls the loop as `FnMut`: called as `FnOnce`, the way pulp takes closures, a shim that is not always inlined would
/// stand between the dispatch and the loop.
struct Loop<F>(F);

impl<R, F: FnMut() -> R> NullaryFnOnce for Loop<F> {
    type Output = R;

    #[inline(always)]
    fn call(mut self) -> R {
        (self.0)()
    }
}

/// softplus x = ln(1 + eˣ) = max(x, 0) + ln(1 + e^−|x|), for each number; right at both ends.
pub fn softplus_in_place(values: &mut [f32]) {
    vectorized(
        #[inline(always)]
        || {
            for x in values.iter_mut() {
                *x = x.max(0.0) + ln_one_plus(exp_of_negative(-x.abs()));
            }
        },
    );
}

/// σ(x) = 1 / (1 + e^−x), for each number; right at both ends.
pub fn sigmoid_in_place(values: &mut [f32]) {
    vectorized(
        #[inline(always)]
        || {
            for x in values.iter_mut() {
                // With e^−|x| nothing overflows: σ(|x|) = 1/(1+u), σ(−|x|) = u/(1+u).
                let u = exp_of_negative(-x.abs());
                *x = if *x >= 0.0 { 1.0 } else { u } / (1.0 + u);
            }
        },
    );
}

/// eˣ for x ≤ 0, without branches; below −87, where f32 runs out of normal numbers, e⁻⁸⁷.
///
/// x = n ln 2 + r with |r| ≤ ln 2 / 2; e^r by its Taylor polynomial of degree 7 (remainder 5e-9), 2ⁿ by its bits.
#[inline(always)]
fn exp_of_negative(x: f32) -> f32 {
    const LN_2_HIGH: f32 = 0.693_359_4; // few bits, so that n times it is exact
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    const ROUND: f32 = 12_582_912.0; // 1.5 · 2²³: adding it rounds to an integer held in the low bits
    // NaN must stay NaN, so the limit is a comparison and not `max`.
    let x = if x < -87.0 { -87.0 } else { x };
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = (x - n * LN_2_HIGH) - n * LN_2_LOW;
    let taylor =
        ((((((r / 5040.0 + 1.0 / 720.0) * r + 1.0 / 120.0) * r + 1.0 / 24.0) * r + 1.0 / 6.0) * r + 0.5) * r
            + 1.0)
            * r
            + 1.0;
    let exponent = shifted.to_bits().wrapping_sub(ROUND.to_bits()).wrapping_add(127);
    taylor * f32::from_bits(exponent << 23)
}

/// ln(1 + u) for u in [0, 1], = 2 artanh z with z = u / (2 + u) ≤ 1/3, by its series to z¹³ (remainder 3e-8 relative).
#[inline(always)]
fn ln_one_plus(u: f32) -> f32 {
    let z = u / (2.0 + u);
    let y = z * z;
    let series =
        (((((y / 13.0 + 1.0 / 11.0) * y + 1.0 / 9.0) * y + 1.0 / 7.0) * y + 0.2) * y + 1.0 / 3.0) * y + 1.0;
    2.0 * z * series
}

/// target += source, element by element.
#[inline(always)]
pub(crate) fn add_to<T: Real>(target: &mut [T], source: &[T]) {
    for (target, source) in target.iter_mut().zip(source) {
        *target += *source;
    }
}

/// Σ f(i) for i in 0..len, summed in eight lanes so that it vectorizes.
#[inline(always)]
pub(crate) fn sum_of<T: Real>(len: usize, f: impl Fn(usize) -> T) -> T {
    const LANES: usize = 8;
    let mut lanes = [T::ZERO; LANES];
    let whole = len / LANES * LANES;
    for start in (0..whole).step_by(LANES) {
        for (lane, sum) in lanes.iter_mut().enumerate() {
            *sum += f(start + lane);
        }
    }
    let rest: T = (whole..len).map(&f).sum();
    lanes.into_iter().sum::<T>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn worst(found: impl Fn(&mut [f32]), truth: impl Fn(f64) -> f64) -> f64 {
        let inputs: Vec<f32> = (-80_000..=80_000).map(|step| step as f32 * 1e-3).collect();
        let mut outputs = inputs.clone();
        found(&mut outputs);
        let relative = |(x, y): (&f32, &f32)| {
            let truth = truth(f64::from(*x));
            (f64::from(*y) - truth).abs() / truth.abs()
        };
        inputs.iter().zip(&outputs).map(relative).fold(0.0, f64::max)
    }

    #[test]
    fn softplus_is_close_to_its_definition() {
        let error = worst(softplus_in_place, |x| x.max(0.0) + (-x.abs()).exp().ln_1p());
        assert!(error < 4e-7, "relative error {error:e}");
    }

    #[test]
    fn sigmoid_is_close_to_its_definition() {
        let error = worst(sigmoid_in_place, |x| 1.0 / (1.0 + (-x).exp()));
        assert!(error < 4e-7, "relative error {error:e}");
    }

    #[test]
    fn the_ends_are_finite_and_nan_stays() {
        let mut values = [-1e30, 1e30, f32::NAN];
        softplus_in_place(&mut values);
        assert!(values[0] < 1e-37 && values[1] == 1e30 && values[2].is_nan(), "{values:?}");
        let mut values = [-1e30, 1e30, f32::NAN];
        sigmoid_in_place(&mut values);
        assert!(values[0] < 1e-37 && values[1] == 1.0 && values[2].is_nan(), "{values:?}");
    }

    #[test]
    fn sum_of_sums_every_length() {
        for len in 0..40 {
            assert_eq!(sum_of(len, |i| i as f64), (len * len.saturating_sub(1) / 2) as f64);
        }
    }
}

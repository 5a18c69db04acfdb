//! The method of conjugate gradients (Hestenes & Stiefel, 1952) for a matrix that is known by its products only.

use crate::math::nn::Real;
use crate::math::nn::elementwise::{sum_of, vectorized};

/// Solves A x = b from x = 0, for a symmetric positive definite A.
///
/// `apply(v, out)` fills `out` with A v. Stops after `iterations`, or as soon as the residual is small:
/// ‖b − A x‖ ≤ `residual_tolerance` · ‖b‖. Not converging is no error: x is then the best found.
/// It also stops where A proves not to be positive definite, or where a number is not finite, with the last good x.
pub fn conjugate_gradient<T: Real>(
    mut apply: impl FnMut(&[T], &mut [T]),
    right_side: &[T],
    iterations: usize,
    residual_tolerance: f64,
) -> Vec<T> {
    let mut solution = vec![T::ZERO; right_side.len()];
    let mut residual = right_side.to_vec();
    let mut direction = right_side.to_vec();
    let mut image = vec![T::ZERO; right_side.len()];
    let mut squared = dot(&residual, &residual);
    let enough = squared * residual_tolerance * residual_tolerance;
    for _ in 0..iterations {
        if squared <= enough {
            break;
        }
        apply(&direction, &mut image);
        let curvature = dot(&direction, &image);
        let step = squared / curvature;
        if !(curvature > 0.0 && step.is_finite()) {
            break;
        }
        add_scaled(&mut solution, step, &direction);
        add_scaled(&mut residual, -step, &image);
        let squared_before = std::mem::replace(&mut squared, dot(&residual, &residual));
        turn(&mut direction, squared / squared_before, &residual);
    }
    solution
}

/// a · b, accumulated in f64: thousands of terms of unlike size in f32 would lose the conjugacy.
fn dot<T: Real>(a: &[T], b: &[T]) -> f64 {
    assert_eq!(a.len(), b.len(), "lengths of a dot product");
    vectorized(
        #[inline(always)]
        || {
            sum_of(
                a.len(),
                #[inline(always)]
                |i| a[i].to_f64() * b[i].to_f64(),
            )
        },
    )
}

/// target ← target + scale · vector
fn add_scaled<T: Real>(target: &mut [T], scale: f64, vector: &[T]) {
    let scale = T::from_f64(scale);
    vectorized(
        #[inline(always)]
        || target.iter_mut().zip(vector).for_each(|(target, value)| *target += scale * *value),
    );
}

/// direction ← residual + scale · direction
fn turn<T: Real>(direction: &mut [T], scale: f64, residual: &[T]) {
    let scale = T::from_f64(scale);
    vectorized(
        #[inline(always)]
        || direction.iter_mut().zip(residual).for_each(|(target, value)| *target = *value + scale * *target),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basics::seed::Seed;
    use rand::Rng as _;

    const SIZE: usize = 40;

    /// A = BᵀB + I, dense, of numbers from a seed.
    fn positive_definite() -> Vec<f64> {
        let mut rng = Seed::new(5).into_rng();
        let b: Vec<f64> = (0..SIZE * SIZE).map(|_| f64::from(rng.next_u32()) / 2f64.powi(32) - 0.5).collect();
        let entry = |at: usize| {
            let (row, column) = (at / SIZE, at % SIZE);
            let product: f64 = (0..SIZE).map(|k| b[k * SIZE + row] * b[k * SIZE + column]).sum();
            product + f64::from(u8::from(row == column))
        };
        (0..SIZE * SIZE).map(entry).collect()
    }

    fn times(matrix: &[f64], x: &[f64]) -> Vec<f64> {
        matrix.chunks_exact(SIZE).map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum()).collect()
    }

    fn largest_residual(matrix: &[f64], x: &[f64], b: &[f64]) -> f64 {
        times(matrix, x).iter().zip(b).map(|(ax, b)| (ax - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn residual_vanishes_on_a_dense_system() {
        let matrix = positive_definite();
        let b: Vec<f64> = (0..SIZE).map(|i| (i as f64).sin()).collect();
        let apply = |v: &[f64], out: &mut [f64]| out.copy_from_slice(&times(&matrix, v));
        let x = conjugate_gradient(apply, &b, 2 * SIZE, 1e-13);
        assert!(largest_residual(&matrix, &x, &b) < 1e-11);
    }

    #[test]
    fn f32_reaches_the_residual_that_f32_can() {
        let matrix = positive_definite();
        let b: Vec<f32> = (0..SIZE).map(|i| (i as f32).sin()).collect();
        let apply = |v: &[f32], out: &mut [f32]| {
            let v: Vec<f64> = v.iter().map(|v| f64::from(*v)).collect();
            out.iter_mut().zip(times(&matrix, &v)).for_each(|(out, value)| *out = value as f32);
        };
        let x: Vec<f64> = conjugate_gradient(apply, &b, 2 * SIZE, 1e-7).into_iter().map(f64::from).collect();
        let b: Vec<f64> = b.into_iter().map(f64::from).collect();
        assert!(largest_residual(&matrix, &x, &b) < 1e-5);
    }

    #[test]
    fn stops_when_the_residual_is_small_enough() {
        let mut products = 0;
        let apply = |v: &[f64], out: &mut [f64]| {
            products += 1;
            out.copy_from_slice(v);
        };
        assert_eq!(conjugate_gradient(apply, &[3.0, -4.0], 10, 1e-10), [3.0, -4.0]);
        assert_eq!(products, 1, "the identity needs one product");
    }

    #[test]
    fn gives_zero_for_zero_and_for_what_is_not_positive_definite() {
        let negate = |v: &[f64], out: &mut [f64]| out.iter_mut().zip(v).for_each(|(out, v)| *out = -v);
        assert_eq!(conjugate_gradient(negate, &[1.0, 2.0], 10, 1e-10), [0.0, 0.0]);
        assert_eq!(conjugate_gradient(negate, &[0.0, 0.0], 10, 1e-10), [0.0, 0.0]);
        let spoil = |_: &[f64], out: &mut [f64]| out.fill(f64::NAN);
        assert_eq!(conjugate_gradient(spoil, &[1.0, 2.0], 10, 1e-10), [0.0, 0.0]);
    }
}

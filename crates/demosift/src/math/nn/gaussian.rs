//! The diagonal Gaussian π(a) = 𝒩(a; μ, diag σ²) with free log standard deviations: means come from a network, one
//! row for each observation, the log standard deviations `log_std` `[act]` are parameters and the same for all rows.
//!
//! Log-probabilities are sums over the action's dimensions, as the likelihood ratio of a policy gradient needs them.

use crate::basics::seed;
use crate::math::nn::Real;
use crate::math::nn::elementwise::{sum_of, vectorized};
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::{E, PI};

/// log π(a) = Σ_d −½ ((a_d − μ_d)/σ_d)² − log σ_d − ½ log 2π
pub fn log_probability<T: Real>(mean: &[T], log_std: &[T], action: &[T]) -> T {
    assert_eq!(mean.len(), log_std.len(), "dimensions of the mean");
    assert_eq!(action.len(), log_std.len(), "dimensions of the action");
    squared_distance(mean, action, &inverse_std(log_std)) * T::from_f64(-0.5) - log_normalizer(log_std)
}

/// [`log_probability`] of each row: means and actions `[batch, act]`, out `[batch]`.
pub fn log_probabilities<T: Real>(means: &[T], log_std: &[T], actions: &[T], out: &mut Vec<T>) {
    check(means, log_std, actions);
    let (inverse, normalizer, half) = (inverse_std(log_std), log_normalizer(log_std), T::from_f64(0.5));
    out.clear();
    out.resize(means.len() / log_std.len(), T::ZERO);
    vectorized(
        #[inline(always)]
        || {
            let rows = means.chunks_exact(inverse.len()).zip(actions.chunks_exact(inverse.len()));
            for (out, (mean, action)) in out.iter_mut().zip(rows) {
                *out = -(half * squared_distance(mean, action, &inverse)) - normalizer;
            }
        },
    );
}

/// a = μ + σ ε with ε ~ 𝒩(0, 1)
pub fn sample(mean: &[f32], log_std: &[f32], rng: &mut seed::Rng, action: &mut [f32]) {
    check(mean, log_std, action);
    for ((action, mean), log_std) in action.iter_mut().zip(mean).zip(log_std) {
        let normal: f32 = StandardNormal.sample(rng);
        *action = mean + log_std.exp() * normal;
    }
}

/// KL(old ‖ new) = Σ_d log(σ'_d/σ_d) + (σ_d² + (μ_d − μ'_d)²) / (2 σ'_d²) − ½, the mean over the batch; ' marks the new.
///
/// Means `[batch, act]`, log standard deviations `[act]`.
pub fn kl<T: Real>(old_means: &[T], old_log_std: &[T], new_means: &[T], new_log_std: &[T]) -> T {
    check(old_means, old_log_std, new_means);
    assert_eq!(old_log_std.len(), new_log_std.len(), "dimensions of the new distribution");
    let width = old_log_std.len();
    let inverse = inverse_std(new_log_std);
    let mut distance = 0.0;
    vectorized(
        #[inline(always)]
        || {
            for (old, new) in old_means.chunks_exact(width).zip(new_means.chunks_exact(width)) {
                distance += squared_distance(old, new, &inverse).to_f64();
            }
        },
    );
    let spread = old_log_std.iter().zip(new_log_std).map(|(old, new)| {
        let change = new.to_f64() - old.to_f64();
        change + 0.5 * ((-2.0 * change).exp() - 1.0)
    });
    T::from_f64(spread.sum::<f64>() + 0.5 * distance / (old_means.len() / width) as f64)
}

/// H = Σ_d log σ_d + ½ log 2πe
pub fn entropy<T: Real>(log_std: &[T]) -> T {
    log_std.iter().copied().sum::<T>() + T::from_f64(0.5 * (2.0 * PI * E).ln() * log_std.len() as f64)
}

/// The gradient of Σ_b w_b log π(a_b), rows b of means and actions `[batch, act]`, weights w `[batch]`:
///
/// ∂/∂μ_bd = w_b (a_bd − μ_bd)/σ_d²  — replaces `mean_cotangents` `[batch, act]`
///
/// ∂/∂log σ_d = Σ_b w_b ((a_bd − μ_bd)²/σ_d² − 1)  — is added to `log_std_gradient` `[act]`
pub fn log_probability_gradient<T: Real>(
    means: &[T],
    log_std: &[T],
    actions: &[T],
    row_weights: &[T],
    mean_cotangents: &mut Vec<T>,
    log_std_gradient: &mut [T],
) {
    check(means, log_std, actions);
    let width = log_std.len();
    assert_eq!(row_weights.len(), means.len() / width, "weights of the rows");
    assert_eq!(log_std_gradient.len(), width, "length of the gradient");
    let inverse = inverse_std(log_std);
    mean_cotangents.resize(means.len(), T::ZERO);
    vectorized(
        #[inline(always)]
        || {
            let rows = means.chunks_exact(width).zip(actions.chunks_exact(width));
            let targets = mean_cotangents.chunks_exact_mut(width).zip(row_weights);
            for ((mean, action), (cotangent, weight)) in rows.zip(targets) {
                for d in 0..width {
                    let z = (action[d] - mean[d]) * inverse[d];
                    cotangent[d] = *weight * z * inverse[d];
                    log_std_gradient[d] += *weight * (z * z - T::ONE);
                }
            }
        },
    );
}

/// M v: the Hessian of [`kl`] at old = new, applied in place to tangents of the means `[batch, act]` and of `log_std` `[act]`.
///
/// ∂²KL/∂μ_bd² = 1/(B σ_d²),  ∂²KL/∂(log σ_d)² = 2;  all others are 0.
/// The 1/B belongs to it, since [`kl`] is the mean over the B rows. So Jᵀ M J v is the Fisher-vector product.
pub fn fisher_metric<T: Real>(log_std: &[T], mean_tangents: &mut [T], log_std_tangents: &mut [T]) {
    let width = log_std.len();
    assert!(mean_tangents.len().is_multiple_of(width), "tangents of the means in rows of {width}");
    assert_eq!(log_std_tangents.len(), width, "tangents of the log standard deviations");
    let batch = T::from_f64((mean_tangents.len() / width) as f64);
    let scale: Vec<T> = inverse_std(log_std).into_iter().map(|inverse| inverse * inverse / batch).collect();
    vectorized(
        #[inline(always)]
        || {
            for row in mean_tangents.chunks_exact_mut(width) {
                row.iter_mut().zip(&scale).for_each(|(tangent, scale)| *tangent *= *scale);
            }
        },
    );
    log_std_tangents.iter_mut().for_each(|tangent| *tangent *= T::from_f64(2.0));
}

/// Σ_d ((a_d − b_d)/σ_d)²
#[inline(always)]
fn squared_distance<T: Real>(a: &[T], b: &[T], inverse_std: &[T]) -> T {
    let (a, b) = (&a[..inverse_std.len()], &b[..inverse_std.len()]);
    sum_of(
        inverse_std.len(),
        #[inline(always)]
        |d| {
            let z = (a[d] - b[d]) * inverse_std[d];
            z * z
        },
    )
}

/// Σ_d log σ_d + ½ log 2π
fn log_normalizer<T: Real>(log_std: &[T]) -> T {
    log_std.iter().copied().sum::<T>() + T::from_f64(0.5 * (2.0 * PI).ln() * log_std.len() as f64)
}

fn inverse_std<T: Real>(log_std: &[T]) -> Vec<T> {
    log_std.iter().map(|value| (-*value).exp()).collect()
}

fn check<T>(means: &[T], log_std: &[T], others: &[T]) {
    assert!(!log_std.is_empty() && means.len().is_multiple_of(log_std.len()), "means in rows of the action");
    assert_eq!(means.len(), others.len(), "as many numbers as means");
}

#[cfg(test)]
#[path = "gaussian_tests.rs"]
mod tests;

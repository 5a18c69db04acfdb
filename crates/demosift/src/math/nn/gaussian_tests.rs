use super::*;
use crate::basics::seed::Seed;
use crate::math::nn::check::{dot, gradient_error, normal};
use crate::math::nn::{Mlp, Tape};

const WIDTH: usize = 11;
const BATCH: usize = 9;

struct Example {
    means: Vec<f64>,
    log_std: Vec<f64>,
    actions: Vec<f64>,
    weights: Vec<f64>,
}

fn example() -> Example {
    Example {
        means: normal(BATCH * WIDTH, "means"),
        log_std: normal(WIDTH, "log_std").into_iter().map(|x| 0.4 * x - 0.5).collect(),
        actions: normal(BATCH * WIDTH, "actions"),
        weights: normal(BATCH, "weights"),
    }
}

/// Midpoint sum over [center − 12σ, center + 12σ], which for a Gaussian is exact to rounding.
fn integral(center: f64, std: f64, f: impl Fn(f64) -> f64) -> f64 {
    let (count, width) = (4000, 24.0 * std);
    let step = width / f64::from(count);
    (0..count).map(|i| f(center - 0.5 * width + (f64::from(i) + 0.5) * step) * step).sum()
}

/// The density in one dimension by our function.
fn density(mean: f64, log_std: f64, x: f64) -> f64 {
    log_probability(&[mean], &[log_std], &[x]).exp()
}

#[test]
fn log_probability_is_of_a_density_with_the_right_moments() {
    let (mean, log_std) = (0.7, -0.4_f64);
    let std = log_std.exp();
    assert!((integral(mean, std, |x| density(mean, log_std, x)) - 1.0).abs() < 1e-12);
    assert!((integral(mean, std, |x| x * density(mean, log_std, x)) - mean).abs() < 1e-12);
    let variance = integral(mean, std, |x| (x - mean).powi(2) * density(mean, log_std, x));
    assert!((variance - std * std).abs() < 1e-12);
}

#[test]
fn log_probability_equals_numbers_from_elsewhere() {
    // math.log(statistics.NormalDist(mu, sigma).pdf(a)) of Python's standard library, summed.
    let found = log_probability(&[0.0, 1.0, -2.0], &[0.0, 0.5_f64.ln(), 2.0_f64.ln()], &[0.5, 0.0, 1.0]);
    assert!((found - -6.0068155996140185).abs() < 1e-13, "{found}");
}

#[test]
fn log_probability_sums_over_dimensions() {
    let Example { means, log_std, actions, .. } = example();
    let sum: f64 = (0..WIDTH).map(|d| log_probability(&means[d..=d], &log_std[d..=d], &actions[d..=d])).sum();
    assert!((log_probability(&means[..WIDTH], &log_std, &actions[..WIDTH]) - sum).abs() < 1e-12);
}

#[test]
fn log_probabilities_equal_those_of_single_rows() {
    let Example { means, log_std, actions, .. } = example();
    let mut out = vec![7.0; 3];
    log_probabilities(&means, &log_std, &actions, &mut out);
    assert_eq!(out.len(), BATCH);
    for (row, found) in out.iter().enumerate() {
        let at = row * WIDTH..(row + 1) * WIDTH;
        let alone = log_probability(&means[at.clone()], &log_std, &actions[at]);
        assert!((found - alone).abs() < 1e-12);
    }
}

#[test]
fn entropy_equals_the_integral() {
    let log_stds = [0.3_f64, -1.2];
    let brute: f64 = log_stds
        .iter()
        .map(|log_std| {
            integral(0.0, log_std.exp(), |x| {
                -density(0.0, *log_std, x) * log_probability(&[0.0], &[*log_std], &[x])
            })
        })
        .sum();
    assert!((entropy(&log_stds) - brute).abs() < 1e-11);
}

#[test]
fn kl_equals_the_integral_and_is_the_mean_over_the_batch() {
    let (old, new) = ([0.2, -0.1, 1.5, 0.3], [0.5, 0.0, 1.0, -0.6]);
    let (old_log_std, new_log_std) = ([-0.3, 0.2], [0.1, -0.4]);
    let mut brute = 0.0;
    for at in 0..4 {
        let (p, q) = (old_log_std[at % 2], new_log_std[at % 2]);
        let ratio =
            |x: f64| log_probability(&[old[at]], &[p], &[x]) - log_probability(&[new[at]], &[q], &[x]);
        brute += integral(old[at], p.exp(), |x| density(old[at], p, x) * ratio(x));
    }
    assert!((kl(&old, &old_log_std, &new, &new_log_std) - brute / 2.0).abs() < 1e-11);
    assert_eq!(kl(&old, &old_log_std, &old, &old_log_std), 0.0);
}

#[test]
fn sample_has_the_mean_and_the_spread() {
    let (mut rng, count) = (Seed::new(4).into_rng(), 40_000);
    let (mean, log_std) = ([1.0_f32, -2.0], [0.0_f32, -1.0]);
    let (mut sums, mut squares, mut action) = ([0.0_f64; 2], [0.0_f64; 2], [0.0_f32; 2]);
    for _ in 0..count {
        sample(&mean, &log_std, &mut rng, &mut action);
        for d in 0..2 {
            sums[d] += f64::from(action[d]);
            squares[d] += f64::from(action[d] - mean[d]).powi(2);
        }
    }
    for d in 0..2 {
        let std = f64::from(log_std[d]).exp();
        assert!((sums[d] / f64::from(count) - f64::from(mean[d])).abs() < 0.03 * std);
        assert!(((squares[d] / f64::from(count)).sqrt() / std - 1.0).abs() < 0.02);
    }
}

#[test]
fn log_probability_gradient_passes_finite_differences() {
    let Example { means, log_std, actions, weights } = example();
    let (mut cotangents, mut log_std_gradient) = (Vec::new(), vec![0.0; WIDTH]);
    log_probability_gradient(&means, &log_std, &actions, &weights, &mut cotangents, &mut log_std_gradient);
    let mut rows = Vec::new();
    let mut weighted = |means: &[f64], log_std: &[f64]| {
        log_probabilities(means, log_std, &actions, &mut rows);
        dot(&weights, &rows)
    };
    let error = gradient_error(|means| weighted(means, &log_std), &means, &cotangents);
    assert!(error < 4e-10, "means: {error:e}");
    let error = gradient_error(|log_std| weighted(&means, log_std), &log_std, &log_std_gradient);
    assert!(error < 4e-10, "log_std: {error:e}");
    log_probability_gradient(&means, &log_std, &actions, &weights, &mut cotangents, &mut log_std_gradient);
    let error = gradient_error(|log_std| 2.0 * weighted(&means, log_std), &log_std, &log_std_gradient);
    assert!(error < 4e-10, "added: {error:e}");
}

/// ∇KL(old ‖ new) with respect to the new parameters θ = (network, log_std), by vjp and the derivative of Eq. kl.
fn kl_gradient(mlp: &Mlp, inputs: &[f64], old: &[f64], new: &[f64]) -> Vec<f64> {
    let count = mlp.parameter_count();
    let ((old_network, old_log_std), (network, log_std)) = (old.split_at(count), new.split_at(count));
    let (mut tape, mut gradient) = (Tape::default(), vec![0.0; new.len()]);
    let old_means = mlp.forward(old_network, inputs, &mut tape).to_vec();
    let means = mlp.forward(network, inputs, &mut tape).to_vec();
    let (width, batch) = (log_std.len(), means.len() / log_std.len());
    let mut cotangents = vec![0.0; means.len()];
    for (at, (old, new)) in old_means.iter().zip(&means).enumerate() {
        let variance = (2.0 * log_std[at % width]).exp();
        let old_variance = (2.0 * old_log_std[at % width]).exp();
        cotangents[at] = (new - old) / variance / batch as f64;
        gradient[count + at % width] +=
            (1.0 - (old_variance + (old - new).powi(2)) / variance) / batch as f64;
    }
    mlp.vjp(network, inputs, &mut tape, &cotangents, &mut gradient[..count]);
    gradient
}

#[test]
fn fisher_vector_product_passes_finite_differences_of_the_kl_gradient() {
    let (mlp, width) = (Mlp::new(&[5, 8, 6, 3]), 3);
    let count = mlp.parameter_count();
    let mut theta: Vec<f64> = mlp.initial_parameters(1.0, Seed::new(6)).into_iter().map(f64::from).collect();
    theta.extend([-0.5, 0.1, 0.3]);
    let inputs = normal(13 * 5, "inputs");
    let vector = normal(theta.len(), "vector");

    // The helper's gradient of KL itself first, so that what the Hessian is compared with is right.
    let moved: Vec<f64> = theta.iter().zip(&vector).map(|(t, v)| t + 0.05 * v).collect();
    let divergence = |new: &[f64]| {
        let mut tape = Tape::default();
        let old_means = mlp.forward(&theta[..count], &inputs, &mut tape).to_vec();
        let new_means = mlp.forward(&new[..count], &inputs, &mut tape);
        kl(&old_means, &theta[count..], new_means, &new[count..])
    };
    let error = gradient_error(divergence, &moved, &kl_gradient(&mlp, &inputs, &theta, &moved));
    assert!(error < 4e-10, "gradient of KL: {error:e}");

    // F v = Jᵀ M J v
    let mut tape = Tape::default();
    mlp.forward(&theta[..count], &inputs, &mut tape);
    let mut tangents = mlp.jvp(&theta[..count], &inputs, &mut tape, &vector[..count]).to_vec();
    let mut product = vec![0.0; count];
    let mut log_std_product = vector[count..].to_vec();
    fisher_metric(&theta[count..], &mut tangents, &mut log_std_product);
    mlp.vjp(&theta[..count], &inputs, &mut tape, &tangents, &mut product);
    product.extend(log_std_product);
    assert_eq!(product.len(), count + width);

    // F v is the gradient of v · ∇KL at new = old, since the Hessian is symmetric.
    let along = |new: &[f64]| dot(&vector, &kl_gradient(&mlp, &inputs, &theta, new));
    let error = gradient_error(along, &theta, &product);
    assert!(error < 4e-10, "Fisher-vector product: {error:e}");
}

#[test]
fn f32_agrees_with_f64() {
    let narrow = |values: &[f64]| values.iter().map(|value| *value as f32).collect::<Vec<f32>>();
    let Example { means, log_std, actions, .. } = example();
    let (mut wide, mut short) = (Vec::new(), Vec::new());
    log_probabilities(&means, &log_std, &actions, &mut wide);
    log_probabilities(&narrow(&means), &narrow(&log_std), &narrow(&actions), &mut short);
    for (wide, short) in wide.iter().zip(&short) {
        assert!((wide - f64::from(*short)).abs() < 1e-5 * wide.abs());
    }
    let wide = kl(&means, &log_std, &actions, &log_std);
    let short = kl(&narrow(&means), &narrow(&log_std), &narrow(&actions), &narrow(&log_std));
    assert!((wide - f64::from(short)).abs() < 1e-5 * wide);
}

//! The one place where derivatives are checked: central differences in f64.

use crate::basics::seed::{self, Seed};
use rand_distr::{Distribution, StandardNormal};

/// Step of the differences: with the fourth-order formula truncation and rounding are both near 1e-12 here.
const STEP: f64 = 1e-3;

/// `len` normal numbers.
pub(crate) fn normal(len: usize, name: &str) -> Vec<f64> {
    let mut rng: seed::Rng = Seed::new(11).of(name).into_rng();
    (0..len).map(|_| StandardNormal.sample(&mut rng)).collect()
}

/// The derivative of `function` at `at` along `direction`.
///
/// f'(0) ≈ (f(−2h) − 8 f(−h) + 8 f(h) − f(2h)) / 12h, remainder of order h⁴.
pub(crate) fn derivative(function: &mut impl FnMut(&[f64]) -> f64, at: &[f64], direction: &[f64]) -> f64 {
    let mut shifted = |steps: f64| {
        let point: Vec<f64> = at.iter().zip(direction).map(|(x, d)| x + steps * STEP * d).collect();
        function(&point)
    };
    (shifted(-2.0) - 8.0 * shifted(-1.0) + 8.0 * shifted(1.0) - shifted(2.0)) / (12.0 * STEP)
}

/// The largest error of an analytic gradient of `function` at `at`, relative where the derivative is above 1:
/// along thirty coordinates spread over the vector and along ten random directions of length one.
pub(crate) fn gradient_error(mut function: impl FnMut(&[f64]) -> f64, at: &[f64], gradient: &[f64]) -> f64 {
    assert_eq!(at.len(), gradient.len(), "length of the gradient");
    let stride = (at.len() / 30).max(1);
    let coordinates = (0..at.len()).step_by(stride).map(|index| {
        let mut direction = vec![0.0; at.len()];
        direction[index] = 1.0;
        direction
    });
    let random = (0..10).map(|index| {
        let direction = normal(at.len(), &format!("direction {index}"));
        let length = dot(&direction, &direction).sqrt();
        direction.into_iter().map(|value| value / length).collect()
    });
    coordinates
        .chain(random)
        .map(|direction: Vec<f64>| {
            let numeric = derivative(&mut function, at, &direction);
            (numeric - dot(gradient, &direction)).abs() / numeric.abs().max(1.0)
        })
        .fold(0.0, f64::max)
}

/// a · b
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[test]
fn a_known_gradient_passes_and_a_wrong_one_does_not() {
    let function = |x: &[f64]| x[0].sin() * x[1].exp();
    let right = [0.3_f64.cos() * 0.2_f64.exp(), 0.3_f64.sin() * 0.2_f64.exp()];
    assert!(gradient_error(function, &[0.3, 0.2], &right) < 1e-11);
    assert!(gradient_error(function, &[0.3, 0.2], &[right[0], right[1] + 1e-6]) > 1e-7);
}

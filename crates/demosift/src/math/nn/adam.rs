//! Adam (Kingma & Ba, 2015, Algorithm 1) on one flat parameter vector.

use crate::math::nn::elementwise::vectorized;
use serde::{Deserialize, Serialize};

/// β₁, β₂ and ε as the authors recommend (Kingma & Ba, §2).
const BETA_1: f32 = 0.9;
const BETA_2: f32 = 0.999;
const EPSILON: f32 = 1e-8;

/// The moments of the gradients seen so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Adam {
    first: Vec<f32>,
    second: Vec<f32>,
    steps: u32,
}

impl Adam {
    /// No gradient seen yet.
    pub fn new(parameter_count: usize) -> Self {
        Self { first: vec![0.0; parameter_count], second: vec![0.0; parameter_count], steps: 0 }
    }

    /// Takes one step against the gradient, which makes the loss smaller.
    ///
    /// m ← β₁ m + (1−β₁) g,  v ← β₂ v + (1−β₂) g²,  θ ← θ − η · m/(1−β₁ᵗ) / (√(v/(1−β₂ᵗ)) + ε)
    ///
    /// # Panics
    /// If a length differs from `parameter_count`: a bug of the caller.
    pub fn descend(&mut self, learning_rate: f32, gradient: &[f32], parameters: &mut [f32]) {
        let Self { first, second, steps } = self;
        assert_eq!(gradient.len(), first.len(), "length of the gradient");
        assert_eq!(parameters.len(), first.len(), "number of parameters");
        *steps = steps.saturating_add(1);
        // In f64: near t = 1 the corrections are differences of numbers close to one.
        let exponent = i32::try_from(*steps).unwrap_or(i32::MAX);
        let first_scale = (1.0 / (1.0 - f64::from(BETA_1).powi(exponent))) as f32;
        let second_scale = (1.0 / (1.0 - f64::from(BETA_2).powi(exponent))) as f32;
        vectorized(
            #[inline(always)]
            || {
                let moments = first.iter_mut().zip(second.iter_mut());
                for ((parameter, g), (m, v)) in parameters.iter_mut().zip(gradient).zip(moments) {
                    *m = BETA_1 * *m + (1.0 - BETA_1) * g;
                    *v = BETA_2 * *v + (1.0 - BETA_2) * g * g;
                    *parameter -= learning_rate * (*m * first_scale) / ((*v * second_scale).sqrt() + EPSILON);
                }
            },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From `tests/references/adam.py`: parameters after so many steps.
    const REFERENCE: [(u32, [f32; 3]); 4] = [
        (1, [0.95, -0.95, 0.45]),
        (2, [0.900_083_24, -0.900_037, 0.399_970_62]),
        (10, [0.512_293, -0.504_956, -0.002_466_75]),
        (200, [2.845e-5, 0.999_933, -1.570_888]),
    ];

    #[test]
    fn steps_equal_those_of_the_reference() {
        let mut parameters = [1.0_f32, -1.0, 0.5];
        let mut adam = Adam::new(3);
        let mut steps = 0;
        for (until, wanted) in REFERENCE {
            while steps < until {
                let [x, y, z] = parameters;
                adam.descend(0.05, &[2.0 * x, 20.0 * (y - 1.0), z.cos()], &mut parameters);
                steps += 1;
            }
            for (found, wanted) in parameters.iter().zip(wanted) {
                assert!((found - wanted).abs() < 2e-5, "step {until}: {parameters:?}");
            }
        }
    }

    #[test]
    fn continues_after_being_written_and_read() {
        let gradient = |parameters: &[f32; 2]| [parameters[0].sin() + 0.1, parameters[1]];
        let (mut here, mut there) = (Adam::new(2), Adam::new(2));
        let (mut a, mut b) = ([0.3_f32, -2.0], [0.3_f32, -2.0]);
        for _ in 0..7 {
            here.descend(0.01, &gradient(&a), &mut a);
            there.descend(0.01, &gradient(&b), &mut b);
            there = serde_json::from_str(&serde_json::to_string(&there).unwrap()).unwrap();
        }
        assert_eq!((a, &here), (b, &there));
    }
}

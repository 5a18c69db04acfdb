//! How a policy that one natural-gradient step adapted moves with the policy that it was adapted from.
//!
//! θ' = θ + η (F + λI)⁻¹ g(θ) with g the gradient of the surrogate objective, so that, with the Fisher matrix F and the
//! step's size η held fixed, dθ'/dθ = I + η (F + λI)⁻¹ H with H = ∂g/∂θ.
//! A loss after adaptation then has the gradient (dθ'/dθ)ᵀ ∇L(θ') = ∇L + η H (F + λI)⁻¹ ∇L: conjugate gradient on
//! Fisher-vector products, then one Hessian-vector product.
//!
//! H is that of the likelihood ratio, E[Â (∇²log π + ∇log π ∇log πᵀ)]: at each step the action's distribution is
//! differentiated through its score.
//! That is the low-variance-curvature estimator of ProMP (Rothfuss et al. 2019, §5), where the inner step of MAML-RL
//! (Finn et al. 2017a) uses log π and lacks the second term.
//! Held fixed are the states that were visited, the advantages of the actions, the discriminator that was fitted to
//! them, and the share of a demonstration that exploration before the step has in what is learned (Stadie et al. 2018).
//!
//! Where the step itself stopped conjugate gradient after some iterations, so does this: where they were too few to
//! solve the system, the derivative is that of the system and not that of the unfinished solution.

use super::{Experience, TrustRegion, fisher_vector_product};
use crate::math::nn::Real;
use crate::math::nn::gaussian::{self, Moving};
use crate::math::nn::mlp::{Mlp, Tape};
use crate::math::solve::conjugate_gradient;

/// dθ'/dθ of one natural-gradient step.
#[derive(Debug)]
pub struct Adaptation<'a, T> {
    chunks: Vec<Chunk<'a, T>>,
    size: f64,
    damping: f64,
    iterations: usize,
}

/// Some of the experience on which the step was taken.
#[derive(Debug)]
struct Chunk<'a, T> {
    network: &'a Mlp,
    /// The network's parameters, then the logarithms of the standard deviations, `[P + act]`.
    parameters: &'a [T],
    observations: &'a [T],
    actions: &'a [T],
    /// Weight of each action in the objective, `[B]`.
    row_weights: Vec<T>,
    /// Share in the Fisher matrix.
    weight: f64,
}

impl<'a> Adaptation<'a, f32> {
    /// The step of size η that was taken on `experiences` within `region`, as [`super::step`] says of both.
    pub fn new(experiences: &[Experience<'a>], region: &TrustRegion, size: f64) -> Self {
        let chunk = |experience: &Experience<'a>| {
            let Experience { policy, observations, actions, advantages, weight } = *experience;
            let scale = (weight / advantages.len() as f64) as f32;
            Chunk {
                network: policy.network(),
                parameters: policy.parameters(),
                observations,
                actions,
                row_weights: advantages.iter().map(|advantage| advantage * scale).collect(),
                weight,
            }
        };
        Self {
            chunks: experiences.iter().map(chunk).collect(),
            size,
            damping: region.damping,
            iterations: region.conjugate_gradient_iterations,
        }
    }
}

impl<T: Real> Adaptation<'_, T> {
    /// (dθ'/dθ) v = v + η (F + λI)⁻¹ H v: how θ' moves where θ moves along v, `[P + act]`.
    pub fn carried_along(&self, direction: &[T]) -> Vec<T> {
        self.plus(direction, |adaptation| adaptation.natural(&adaptation.hessian_product(direction)))
    }

    /// (dθ'/dθ)ᵀ g = g + η H (F + λI)⁻¹ g: the gradient at θ of what has the gradient g at θ', `[P + act]`.
    pub fn pulled_back(&self, gradient: &[T]) -> Vec<T> {
        self.plus(gradient, |adaptation| adaptation.hessian_product(&adaptation.natural(gradient)))
    }

    fn plus(&self, vector: &[T], term: impl Fn(&Self) -> Vec<T>) -> Vec<T> {
        if self.size == 0.0 {
            return vector.to_vec();
        }
        let size = T::from_f64(self.size);
        vector.iter().zip(term(self)).map(|(value, term)| *value + size * term).collect()
    }

    /// (F + λI)⁻¹ v
    fn natural(&self, vector: &[T]) -> Vec<T> {
        let damping = T::from_f64(self.damping);
        let mut tapes: Vec<Tape<T>> = self.chunks.iter().map(Chunk::forward).collect();
        let fisher = |direction: &[T], product: &mut [T]| {
            product.iter_mut().zip(direction).for_each(|(product, v)| *product = damping * *v);
            for (chunk, tape) in self.chunks.iter().zip(&mut tapes) {
                let Chunk { network, parameters, observations, weight, .. } = chunk;
                let found = fisher_vector_product(network, parameters, observations, tape, direction);
                let weight = T::from_f64(*weight);
                product.iter_mut().zip(&found).for_each(|(product, value)| *product += weight * *value);
            }
        };
        conjugate_gradient(fisher, vector, self.iterations, super::RESIDUAL_TOLERANCE)
    }

    /// H v
    fn hessian_product(&self, direction: &[T]) -> Vec<T> {
        let mut product = vec![T::ZERO; direction.len()];
        self.chunks.iter().for_each(|chunk| chunk.add_hessian_product(direction, &mut product));
        product
    }
}

impl<T: Real> Chunk<'_, T> {
    fn forward(&self) -> Tape<T> {
        let mut tape = Tape::default();
        let count = self.network.parameter_count();
        self.network.forward(&self.parameters[..count], self.observations, &mut tape);
        tape
    }

    fn add_hessian_product(&self, direction: &[T], product: &mut [T]) {
        let Self { network, observations, actions, row_weights, .. } = self;
        let count = network.parameter_count();
        let (parameters, log_std) = self.parameters.split_at(count);
        let (direction, log_std_tangents) = direction.split_at(count);
        let (product, log_std_product) = product.split_at_mut(count);
        let mut tape = self.forward();
        let means = tape.outputs().to_vec();
        let mean_tangents = network.jvp(parameters, observations, &mut tape, direction).to_vec();
        let (mut cotangents, mut unused) = (Vec::new(), vec![T::ZERO; log_std.len()]);
        gaussian::log_probability_gradient(
            &means,
            log_std,
            actions,
            row_weights,
            &mut cotangents,
            &mut unused,
        );
        let moving = Moving { means: &means, log_std, mean_tangents: &mean_tangents, log_std_tangents };
        let tangents = gaussian::likelihood_ratio_tangents(moving, actions, row_weights, log_std_product);
        network.vjp_tangents(
            [parameters, direction],
            observations,
            &mut tape,
            [&cotangents, &tangents],
            product,
        );
    }
}

#[cfg(test)]
#[path = "adaptation_tests.rs"]
mod tests;

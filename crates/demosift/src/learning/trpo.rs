//! Trust region policy optimization (Schulman et al. 2015): the update rule of every policy here.
//!
//! It maximizes the advantage-weighted likelihood ratio within a bound on the mean KL divergence: natural gradient
//! by conjugate gradient on Fisher-vector products, then a backtracking line search.
//! The step is a displacement δ of the parameters that several policies make together, each on its own experience and
//! with its own weight; one policy on one batch is the ordinary case, and the meta-update of Eq. 2 (first order) is
//! the case in which each adapted policy θ'_i has its own.
//!
//! Where we differ: the paper's step size α scales TRPO's largest step, so that the line search accepts α²·KL.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::math::nn::gaussian;
use crate::math::nn::mlp::{Mlp, Tape};
use crate::math::solve::backtrack;
use crate::math::solve::conjugate_gradient;
use crate::world::policy::Policy;

/// How far and how carefully a step goes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrustRegion {
    /// Largest mean KL divergence of a step with α = 1 (A.2.1: 0.15 for the inner update).
    pub max_kl: f64,
    /// Added to the Fisher matrix's diagonal; not in the paper, 0.1 in the reference implementations of TRPO.
    pub damping: f64,
    /// Iterations of conjugate gradient; not in the paper, 10 in the reference implementations.
    pub conjugate_gradient_iterations: usize,
    /// Share of the linearly predicted improvement that a step must reach; not in the paper, 0.1 in the references.
    pub accept_ratio: f64,
}

impl Default for TrustRegion {
    fn default() -> Self {
        Self { max_kl: 0.01, damping: 0.1, conjugate_gradient_iterations: 10, accept_ratio: 0.1 }
    }
}

/// By how much the line search shortens a step.
const SHRINK: f64 = 0.5;
/// How often it does.
const ATTEMPTS: usize = 10;
const RESIDUAL_TOLERANCE: f64 = 1e-10;

/// Actions that a policy took, and how good each was.
#[derive(Clone, Copy, Debug)]
pub struct Experience<'a> {
    /// The policy that acted; its step starts from its own parameters.
    pub policy: &'a Policy,
    /// Filtered observations, `[B, obs]`.
    pub observations: &'a [f32],
    /// The actions as they were drawn, `[B, act]`.
    pub actions: &'a [f32],
    /// Advantages of the actions, `[B]`.
    pub advantages: &'a [f32],
    /// Share of this experience in objective and KL; the shares of all experiences sum to 1.
    pub weight: f64,
}

/// The result of a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// δ, to be added to the parameters of each policy; zeros if no step was taken, `[P + act]`.
    pub displacement: Vec<f32>,
    /// Mean KL divergence that was reached.
    pub kl: f64,
    /// η: the displacement is η (F + damping)⁻¹ g; 0 if no step was taken.
    pub size: f64,
    /// Improvement of the surrogate objective.
    pub improvement: f64,
    /// Why it ended so.
    pub end: StepEnd,
}

/// Why a step ended; not moving is an answer, not an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum StepEnd {
    /// The line search accepted a step.
    Moved,
    /// The gradient was zero: nothing to learn from this batch.
    NoGradient,
    /// No step along the direction improved enough within the bound.
    SearchFailed,
}

/// One TRPO step of α times the largest length.
pub fn step(experiences: &[Experience<'_>], region: &TrustRegion, alpha: f64) -> Result<Step> {
    let mut batches: Vec<Batch<'_>> = experiences.par_iter().map(Batch::new).collect();
    let gradient = total(&mut batches, Batch::surrogate_gradient);
    if gradient.iter().any(|value| !value.is_finite()) {
        return Err(Error::diverged("the policy gradient is not a finite number"));
    }
    if gradient.iter().all(|value| *value == 0.0) {
        return Ok(Step::none(gradient.len(), StepEnd::NoGradient));
    }
    let fisher = |direction: &[f32], product: &mut [f32]| {
        product.copy_from_slice(&total(&mut batches, |batch| batch.fisher_vector_product(direction)));
        for (product, direction) in product.iter_mut().zip(direction) {
            *product += region.damping as f32 * direction;
        }
    };
    let (direction, curvature) = natural_direction(fisher, &gradient, region);
    if curvature.is_nan() || curvature <= 0.0 {
        return Ok(Step::none(gradient.len(), StepEnd::SearchFailed));
    }
    // ½ s² δᵀFδ = KL
    let largest = (2.0 * region.max_kl / curvature).sqrt() * alpha;
    let predicted = largest * dot(&gradient, &direction);
    let bound = region.max_kl * alpha * alpha;
    let accepted = backtrack(SHRINK, ATTEMPTS, |fraction| {
        let size = largest * fraction;
        let displacement: Vec<f32> = direction.iter().map(|value| value * size as f32).collect();
        let (improvement, kl) = improvement_and_kl(&mut batches, &displacement);
        let accept =
            improvement >= region.accept_ratio * predicted * fraction && improvement > 0.0 && kl <= bound;
        accept.then_some(Step { displacement, kl, size, improvement, end: StepEnd::Moved })
    });
    Ok(accepted.map_or(Step::none(gradient.len(), StepEnd::SearchFailed), |(_, step)| step))
}

impl Step {
    fn none(parameters: usize, end: StepEnd) -> Self {
        Self { displacement: vec![0.0; parameters], kl: 0.0, size: 0.0, improvement: 0.0, end }
    }
}

/// F⁻¹g by conjugate gradient, and xᵀFx at it.
fn natural_direction(
    mut fisher: impl FnMut(&[f32], &mut [f32]),
    gradient: &[f32],
    region: &TrustRegion,
) -> (Vec<f32>, f64) {
    let direction =
        conjugate_gradient(&mut fisher, gradient, region.conjugate_gradient_iterations, RESIDUAL_TOLERANCE);
    let mut product = vec![0.0; direction.len()];
    fisher(&direction, &mut product);
    let curvature = dot(&direction, &product);
    (direction, curvature)
}

/// An experience with the activations at its policy's parameters, which all products with the Fisher matrix share.
struct Batch<'a> {
    experience: &'a Experience<'a>,
    tape: Tape<f32>,
    trial_tape: Tape<f32>,
    means: Vec<f32>,
    log_probabilities: Vec<f32>,
}

impl<'a> Batch<'a> {
    fn new(experience: &'a Experience<'a>) -> Self {
        let Experience { policy, observations, actions, .. } = experience;
        let mut tape = Tape::default();
        let means = policy.network().forward(policy.network_parameters(), observations, &mut tape).to_vec();
        let mut log_probabilities = Vec::new();
        gaussian::log_probabilities(&means, policy.log_std(), actions, &mut log_probabilities);
        Self { experience, tape, trial_tape: Tape::default(), means, log_probabilities }
    }

    /// ∇_θ E[π_θ(a|s) / π_old(a|s) · Â] at θ = θ_old, times the weight.
    fn surrogate_gradient(&mut self) -> Vec<f32> {
        let Experience { policy, observations, actions, advantages, weight } = *self.experience;
        let scale = (weight / advantages.len() as f64) as f32;
        let row_weights: Vec<f32> = advantages.iter().map(|advantage| advantage * scale).collect();
        let mut gradient = vec![0.0; policy.parameters().len()];
        let (network_gradient, log_std_gradient) = gradient.split_at_mut(policy.network().parameter_count());
        let mut mean_cotangents = Vec::new();
        gaussian::log_probability_gradient(
            &self.means,
            policy.log_std(),
            actions,
            &row_weights,
            &mut mean_cotangents,
            log_std_gradient,
        );
        let parameters = policy.network_parameters();
        policy.network().vjp(parameters, observations, &mut self.tape, &mean_cotangents, network_gradient);
        gradient
    }

    /// F v = Jᵀ M J v, times the weight.
    fn fisher_vector_product(&mut self, direction: &[f32]) -> Vec<f32> {
        let Experience { policy, observations, weight, .. } = *self.experience;
        let (network, parameters) = (policy.network(), policy.parameters());
        let mut product = fisher_vector_product(network, parameters, observations, &mut self.tape, direction);
        product.iter_mut().for_each(|value| *value *= weight as f32);
        product
    }

    /// Surrogate improvement and KL divergence at θ_old + δ, both times the weight.
    fn improvement_and_kl(&mut self, displacement: &[f32]) -> (f64, f64) {
        let Experience { policy, observations, actions, advantages, weight } = *self.experience;
        let moved = policy.moved(displacement);
        let means = moved.network().forward(moved.network_parameters(), observations, &mut self.trial_tape);
        let kl = f64::from(gaussian::kl(&self.means, policy.log_std(), means, moved.log_std()));
        let mut log_probabilities = Vec::new();
        gaussian::log_probabilities(means, moved.log_std(), actions, &mut log_probabilities);
        let gains = log_probabilities
            .iter()
            .zip(&self.log_probabilities)
            .zip(advantages)
            .map(|((new, old), advantage)| (f64::from(new - old).exp() - 1.0) * f64::from(*advantage));
        (weight * gains.sum::<f64>() / advantages.len() as f64, weight * kl)
    }
}

/// F v = Jᵀ M J v of a network's parameters followed by log standard deviations, `[P + act]`, on observations `[B, obs]`
/// with which `forward` has run on the tape.
fn fisher_vector_product(
    network: &Mlp,
    parameters: &[f32],
    observations: &[f32],
    tape: &mut Tape<f32>,
    direction: &[f32],
) -> Vec<f32> {
    let count = network.parameter_count();
    let (parameters, log_std) = parameters.split_at(count);
    let (network_direction, log_std_direction) = direction.split_at(count);
    let mut tangents = network.jvp(parameters, observations, tape, network_direction).to_vec();
    let mut log_std_tangents = log_std_direction.to_vec();
    gaussian::fisher_metric(log_std, &mut tangents, &mut log_std_tangents);
    let mut product = vec![0.0; direction.len()];
    let (network_product, log_std_product) = product.split_at_mut(count);
    network.vjp(parameters, observations, tape, &tangents, network_product);
    log_std_product.copy_from_slice(&log_std_tangents);
    product
}

/// The batches' vectors, made in parallel and summed in order, so that threads do not change a bit.
fn total<'a>(
    batches: &mut [Batch<'a>],
    vector: impl Fn(&mut Batch<'a>) -> Vec<f32> + Sync + Send,
) -> Vec<f32> {
    let vectors: Vec<Vec<f32>> = batches.par_iter_mut().map(vector).collect();
    let mut vectors = vectors.into_iter();
    let mut sum = vectors.next().unwrap_or_default();
    for vector in vectors {
        sum.iter_mut().zip(&vector).for_each(|(sum, value)| *sum += value);
    }
    sum
}

fn improvement_and_kl(batches: &mut [Batch<'_>], displacement: &[f32]) -> (f64, f64) {
    let parts: Vec<(f64, f64)> =
        batches.par_iter_mut().map(|batch| batch.improvement_and_kl(displacement)).collect();
    parts.iter().fold((0.0, 0.0), |sum, part| (sum.0 + part.0, sum.1 + part.1))
}

fn dot(left: &[f32], right: &[f32]) -> f64 {
    left.iter().zip(right).map(|(left, right)| f64::from(*left) * f64::from(*right)).sum()
}

#[cfg(test)]
mod tests;

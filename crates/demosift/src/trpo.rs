//! Trust region policy optimization (Schulman et al. 2015): the update rule of every policy here.
//!
//! It maximizes the advantage-weighted likelihood ratio within a bound on the mean KL divergence: natural gradient
//! by conjugate gradient on Fisher-vector products, then a backtracking line search.
//! The step is a displacement δ of the parameters that several policies make together, each on its own experience and
//! with its own weight; one policy on one batch is the ordinary case, and the meta-update of Eq. 2 (first order) is
//! the case in which each adapted policy θ'_i has its own.
//! In the exact meta-update (second order) each θ'_i moves as its adaptation carries it along: see [`Adaptation`].
//!
//! Where we differ: the paper's step size α scales TRPO's largest step, so that the line search accepts α²·KL.

mod adaptation;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::nn::Real;
use crate::nn::gaussian;
use crate::nn::mlp::{Mlp, Tape};
use crate::policy::Policy;
use crate::solve::conjugate_gradient::conjugate_gradient;
use crate::solve::line_search::backtrack;

pub use adaptation::Adaptation;

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

const SHRINK: f64 = 0.5;
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

/// What came of a step.
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
#[serde(rename_all = "snake_case")]
pub enum StepEnd {
    /// The line search accepted a step.
    Moved,
    /// The gradient was zero: nothing to learn from this batch.
    NoGradient,
    /// No step along the direction improved enough within the bound.
    SearchFailed,
}

/// Policies with what they did, and how they move with the θ that the step is taken from.
#[derive(Debug, Default)]
pub struct Branch<'a> {
    /// What was done; all of it by policies that move alike.
    pub experiences: Vec<Experience<'a>>,
    /// How a displacement of θ moves these policies; where there is none, as it moves θ itself.
    pub adaptation: Option<Adaptation<'a, f32>>,
}

/// One TRPO step of α times the largest length.
pub fn step(experiences: &[Experience<'_>], region: &TrustRegion, alpha: f64) -> Result<Step> {
    step_through(vec![Branch { experiences: experiences.to_vec(), adaptation: None }], region, alpha)
}

/// One TRPO step of α times the largest length, taken by a θ that the acting policies were adapted from.
///
/// The gradient is pulled back through each branch's adaptation, and objective and KL divergence are those of the
/// policies that a displacement leads to, to first order in the displacement.
/// The Fisher matrix under which the direction is chosen is that of the adapted policies as if all moved alike: any
/// positive definite one gives an ascent direction, and this one costs a tenth of the one pulled back.
pub fn step_through(branches: Vec<Branch<'_>>, region: &TrustRegion, alpha: f64) -> Result<Step> {
    let (mut limbs, mut adaptations) = (Vec::new(), Vec::new());
    for Branch { experiences, adaptation } in &branches {
        limbs.push(experiences.par_iter().map(Batch::new).collect::<Vec<_>>());
        adaptations.push(adaptation.as_ref());
    }
    let gradients = each(&mut limbs, |_, batches| total(batches, Batch::surrogate_gradient));
    let gradient = sum(adapted(&adaptations, gradients, Adaptation::pulled_back));
    if gradient.iter().any(|value| !value.is_finite()) {
        return Err(Error::diverged("the policy gradient is not a finite number"));
    }
    if gradient.iter().all(|value| *value == 0.0) {
        return Ok(Step::none(gradient.len(), StepEnd::NoGradient));
    }
    let fisher = |direction: &[f32], product: &mut [f32]| {
        let products =
            each(&mut limbs, |_, batches| total(batches, |batch| batch.fisher_vector_product(direction)));
        product.copy_from_slice(&sum(products));
        for (product, direction) in product.iter_mut().zip(direction) {
            *product += region.damping as f32 * direction;
        }
    };
    let (direction, mut curvature) = natural_direction(fisher, &gradient, region);
    let directions =
        adapted(&adaptations, vec![direction.clone(); adaptations.len()], Adaptation::carried_along);
    if adaptations.iter().any(Option::is_some) {
        let curvatures = each(&mut limbs, |index, batches| {
            let direction = &directions[index];
            dot(direction, &total(batches, |batch| batch.fisher_vector_product(direction)))
        });
        curvature = curvatures.iter().sum::<f64>() + region.damping * dot(&direction, &direction);
    }
    if curvature.is_nan() || curvature <= 0.0 {
        return Ok(Step::none(gradient.len(), StepEnd::SearchFailed));
    }
    // ½ s² δᵀFδ = KL
    let largest = (2.0 * region.max_kl / curvature).sqrt() * alpha;
    let predicted = largest * dot(&gradient, &direction);
    let bound = region.max_kl * alpha * alpha;
    let accepted = backtrack(SHRINK, ATTEMPTS, |fraction| {
        let size = largest * fraction;
        let along =
            |direction: &[f32]| -> Vec<f32> { direction.iter().map(|value| value * size as f32).collect() };
        let (improvement, kl) = sum_of_pairs(each(&mut limbs, |index, batches| {
            improvement_and_kl(batches, &along(&directions[index]))
        }));
        let accept =
            improvement >= region.accept_ratio * predicted * fraction && improvement > 0.0 && kl <= bound;
        accept.then(|| Step { displacement: along(&direction), kl, size, improvement, end: StepEnd::Moved })
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
        let seen = (observations, &mut self.tape);
        let mut product = fisher_vector_product(policy.network(), policy.parameters(), seen, direction);
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
fn fisher_vector_product<T: Real>(
    network: &Mlp,
    parameters: &[T],
    (observations, tape): (&[T], &mut Tape<T>),
    direction: &[T],
) -> Vec<T> {
    let count = network.parameter_count();
    let (parameters, log_std) = parameters.split_at(count);
    let (network_direction, log_std_direction) = direction.split_at(count);
    let mut tangents = network.jvp(parameters, observations, tape, network_direction).to_vec();
    let mut log_std_tangents = log_std_direction.to_vec();
    gaussian::fisher_metric(log_std, &mut tangents, &mut log_std_tangents);
    let mut product = vec![T::ZERO; direction.len()];
    let (network_product, log_std_product) = product.split_at_mut(count);
    network.vjp(parameters, observations, tape, &tangents, network_product);
    log_std_product.copy_from_slice(&log_std_tangents);
    product
}

/// What each branch says, in parallel, in order.
fn each<'a, R: Send>(
    limbs: &mut [Vec<Batch<'a>>],
    say: impl Fn(usize, &mut [Batch<'a>]) -> R + Sync + Send,
) -> Vec<R> {
    limbs.par_iter_mut().enumerate().map(|(index, batches)| say(index, batches)).collect()
}

/// Each branch's vector through its adaptation, if it has one.
fn adapted<'a>(
    adaptations: &[Option<&Adaptation<'a, f32>>],
    vectors: Vec<Vec<f32>>,
    through: impl Fn(&Adaptation<'a, f32>, &[f32]) -> Vec<f32> + Sync,
) -> Vec<Vec<f32>> {
    let map = |(adaptation, vector): (&Option<&Adaptation<'a, f32>>, Vec<f32>)| match adaptation {
        Some(adaptation) => through(adaptation, &vector),
        None => vector,
    };
    adaptations.par_iter().zip(vectors).map(map).collect()
}

/// The batches' vectors, made in parallel and summed in order, so that threads do not change a bit.
fn total<'a>(
    batches: &mut [Batch<'a>],
    vector: impl Fn(&mut Batch<'a>) -> Vec<f32> + Sync + Send,
) -> Vec<f32> {
    sum(batches.par_iter_mut().map(vector).collect())
}

fn sum(vectors: Vec<Vec<f32>>) -> Vec<f32> {
    let mut vectors = vectors.into_iter();
    let mut sum = vectors.next().unwrap_or_default();
    for vector in vectors {
        sum.iter_mut().zip(&vector).for_each(|(sum, value)| *sum += value);
    }
    sum
}

fn improvement_and_kl(batches: &mut [Batch<'_>], displacement: &[f32]) -> (f64, f64) {
    sum_of_pairs(batches.par_iter_mut().map(|batch| batch.improvement_and_kl(displacement)).collect())
}

fn sum_of_pairs(pairs: Vec<(f64, f64)>) -> (f64, f64) {
    pairs.iter().fold((0.0, 0.0), |sum, part| (sum.0 + part.0, sum.1 + part.1))
}

fn dot(left: &[f32], right: &[f32]) -> f64 {
    left.iter().zip(right).map(|(left, right)| f64::from(*left) * f64::from(*right)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::check::{self, gradient_error};
    use crate::observation_filter::ObservationFilter;
    use crate::policy::PolicyShape;
    use crate::rows::Rows;
    use crate::seed::Seed;
    use rand_distr::{Distribution, StandardNormal};

    const OBSERVATIONS: usize = 3;
    const ACTIONS: usize = 2;

    /// What an experience borrows.
    struct Sample {
        policy: Policy,
        observations: Vec<f32>,
        actions: Vec<f32>,
        advantages: Vec<f32>,
    }

    impl Sample {
        /// A policy far from its start, what it did, and advantages that are noise.
        fn new(seed: u64, rows: usize) -> Self {
            let mut rng = Seed::new(seed).of("sample").into_rng();
            let mut normal = |count: usize, scale: f32| -> Vec<f32> {
                (0..count).map(|_| scale * Distribution::<f32>::sample(&StandardNormal, &mut rng)).collect()
            };
            let shape = PolicyShape { hidden: vec![8, 6], initial_std: 0.7 };
            let filter = ObservationFilter::identity(OBSERVATIONS);
            let policy = Policy::untrained(&shape, filter, ACTIONS, Seed::new(seed));
            let policy = policy.moved(&normal(policy.parameters().len(), 0.3));
            let observations = normal(rows * OBSERVATIONS, 1.0);
            let advantages = normal(rows, 1.0);
            let means =
                policy.means(&Rows::from_flat(observations.clone(), OBSERVATIONS).expect("whole rows"));
            let mut actions = vec![0.0; rows * ACTIONS];
            let mut rng = Seed::new(seed).of("act").into_rng();
            for (mean, action) in means.iter().zip(actions.chunks_exact_mut(ACTIONS)) {
                gaussian::sample(mean, policy.log_std(), &mut rng, action);
            }
            Self { policy, observations, actions, advantages }
        }

        fn experience(&self, weight: f64) -> Experience<'_> {
            self.rows(0, self.advantages.len(), weight)
        }

        fn rows(&self, from: usize, to: usize, weight: f64) -> Experience<'_> {
            Experience {
                policy: &self.policy,
                observations: &self.observations[from * OBSERVATIONS..to * OBSERVATIONS],
                actions: &self.actions[from * ACTIONS..to * ACTIONS],
                advantages: &self.advantages[from..to],
                weight,
            }
        }
    }

    fn doubles(values: &[f32]) -> Vec<f64> {
        values.iter().map(|value| f64::from(*value)).collect()
    }

    /// Surrogate improvement and KL at θ + δ, in f64 and from the definitions alone.
    fn improvement_and_kl_of(experiences: &[Experience<'_>], displacement: &[f64]) -> (f64, f64) {
        let mut sums = (0.0, 0.0);
        for Experience { policy, observations, actions, advantages, weight } in experiences {
            let (observations, actions) = (doubles(observations), doubles(actions));
            let old = doubles(policy.parameters());
            let new: Vec<f64> = old.iter().zip(displacement).map(|(here, by)| here + by).collect();
            let count = policy.network().parameter_count();
            let means = |parameters: &[f64]| {
                let mut tape = Tape::default();
                policy.network().forward(&parameters[..count], &observations, &mut tape).to_vec()
            };
            let (old_means, new_means) = (means(&old), means(&new));
            for (row, advantage) in advantages.iter().enumerate() {
                let (mut log_ratio, mut kl) = (0.0, 0.0);
                for column in 0..ACTIONS {
                    let at = row * ACTIONS + column;
                    let (old_std, new_std) = (old[count + column].exp(), new[count + column].exp());
                    let squared = |mean: f64, std: f64| ((actions[at] - mean) / std).powi(2);
                    log_ratio += (squared(old_means[at], old_std) - squared(new_means[at], new_std)) / 2.0
                        - (new_std / old_std).ln();
                    let shift = (old_means[at] - new_means[at]).powi(2);
                    kl += (new_std / old_std).ln() + (old_std * old_std + shift) / (2.0 * new_std * new_std)
                        - 0.5;
                }
                let share = weight / advantages.len() as f64;
                sums.0 += share * (log_ratio.exp() - 1.0) * f64::from(*advantage);
                sums.1 += share * kl;
            }
        }
        sums
    }

    #[test]
    fn surrogate_gradient_is_that_of_the_likelihood_ratio() {
        let (one, other) = (Sample::new(1, 300), Sample::new(2, 170));
        let experiences = [one.experience(0.7), other.experience(0.3)];
        let mut batches: Vec<Batch<'_>> = experiences.iter().map(Batch::new).collect();
        let gradient = doubles(&total(&mut batches, Batch::surrogate_gradient));
        let objective = |at: &[f64]| improvement_and_kl_of(&experiences, at).0;
        let error = gradient_error(objective, &vec![0.0; gradient.len()], &gradient);
        assert!(error < 1e-5, "error {error}");
    }

    #[test]
    fn fisher_product_is_the_second_derivative_of_the_kl_divergence() {
        let (one, other) = (Sample::new(3, 300), Sample::new(4, 170));
        let experiences = [one.experience(0.4), other.experience(0.6)];
        let mut batches: Vec<Batch<'_>> = experiences.iter().map(Batch::new).collect();
        let parameters = one.policy.parameters().len();
        let directions: Vec<Vec<f64>> =
            (0..6).map(|index| check::normal(parameters, &format!("fisher {index}"))).collect();
        // vᵀFv ≈ (KL(hv) + KL(−hv)) / h², and uᵀFv from the values at u + v and u − v.
        let curvature = |u: &[f64], v: &[f64], sign: f64| {
            let at = |h: f64| {
                let point: Vec<f64> = u.iter().zip(v).map(|(u, v)| h * (u + sign * v)).collect();
                improvement_and_kl_of(&experiences, &point).1
            };
            (at(1e-4) + at(-1e-4)) / 1e-8
        };
        for u in &directions {
            let direction: Vec<f32> = u.iter().map(|value| *value as f32).collect();
            let product = doubles(&total(&mut batches, |batch| batch.fisher_vector_product(&direction)));
            for v in &directions {
                let numeric = (curvature(u, v, 1.0) - curvature(u, v, -1.0)) / 4.0;
                let found = check::dot(&product, v);
                let scale = check::dot(&product, u).abs();
                assert!((numeric - found).abs() < 1e-3 * scale, "{found}, numerically {numeric}");
            }
        }
    }

    #[test]
    fn accepted_steps_improve_and_never_reach_more_kl_than_allowed() {
        let mut moved = 0;
        for seed in 0..60 {
            let samples: Vec<Sample> =
                (0..1 + seed % 3).map(|part| Sample::new(100 * seed + part, 64)).collect();
            let weight = 1.0 / samples.len() as f64;
            let experiences: Vec<_> = samples.iter().map(|sample| sample.experience(weight)).collect();
            let alpha = [0.5, 1.0, 2.0][(seed / 3 % 3) as usize];
            let region =
                TrustRegion { max_kl: [0.15, 0.01, 1.0][(seed / 9 % 3) as usize], ..TrustRegion::default() };
            let step = step(&experiences, &region, alpha).expect("finite numbers");
            let (improvement, kl) = improvement_and_kl_of(&experiences, &doubles(&step.displacement));
            assert!((kl - step.kl).abs() < 1e-5 + 1e-3 * kl, "KL {kl}, reported {}", step.kl);
            assert!((improvement - step.improvement).abs() < 1e-5 + 1e-3 * improvement.abs());
            assert!(kl <= alpha * alpha * region.max_kl * (1.0 + 1e-4), "KL {kl}");
            match step.end {
                StepEnd::Moved => assert!(improvement > 0.0),
                _ => assert!(step.displacement.iter().all(|value| *value == 0.0)),
            }
            moved += usize::from(step.end == StepEnd::Moved);
        }
        assert!(moved >= 55, "only {moved} of 60 steps were accepted");
    }

    #[test]
    fn appendix_a_2_1_alpha_scales_the_step_and_its_square_the_kl() {
        let sample = Sample::new(5, 400);
        let region = TrustRegion { max_kl: 1e-3, ..TrustRegion::default() };
        let of = |alpha| step(&[sample.experience(1.0)], &region, alpha).expect("finite numbers");
        let (whole, half) = (of(1.0), of(0.5));
        assert_eq!((whole.end, half.end), (StepEnd::Moved, StepEnd::Moved));
        for (whole, half) in whole.displacement.iter().zip(&half.displacement) {
            assert!((whole - 2.0 * half).abs() <= 1e-6 * whole.abs().max(1e-3));
        }
        assert!((whole.kl / half.kl - 4.0).abs() < 0.1, "{} and {}", whole.kl, half.kl);
    }

    /// (F + λI) δ = η g, by which the derivative of the step goes on.
    #[test]
    fn the_size_of_a_step_is_how_far_it_went_along_the_natural_gradient() {
        let sample = Sample::new(5, 400);
        let region = TrustRegion { conjugate_gradient_iterations: 100, ..TrustRegion::default() };
        let experiences = [sample.experience(1.0)];
        let step = step(&experiences, &region, 0.5).expect("finite numbers");
        let mut batch = Batch::new(&experiences[0]);
        let gradient = batch.surrogate_gradient();
        let product = batch.fisher_vector_product(&step.displacement);
        assert!(step.size > 0.0);
        let (mut error, mut scale) = (0.0, 0.0);
        for ((product, by), slope) in product.iter().zip(&step.displacement).zip(gradient) {
            let wanted = step.size * f64::from(slope);
            error += (f64::from(product + region.damping as f32 * by) - wanted).powi(2);
            scale += wanted.powi(2);
        }
        assert!(error.sqrt() < 1e-3 * scale.sqrt(), "{} of {}", error.sqrt(), scale.sqrt());
    }

    /// Second order after steps of size 0 is first order.
    #[test]
    fn policies_that_did_not_adapt_are_carried_along_as_they_are() {
        let (one, other) = (Sample::new(9, 200), Sample::new(10, 200));
        let experiences = [one.experience(0.5), other.experience(0.5)];
        let region = TrustRegion::default();
        let whole = step(&experiences, &region, 1.0).expect("finite numbers");
        let branch = |adaptation| Branch { experiences: experiences.to_vec(), adaptation };
        let still = Adaptation::new(&experiences, &region, 0.0);
        let branched = step_through(vec![branch(Some(still))], &region, 1.0).expect("finite numbers");
        for (branched, whole) in branched.displacement.iter().zip(&whole.displacement) {
            assert!((branched - whole).abs() < 1e-4 * whole.abs().max(1e-3));
        }
        assert!((branched.kl - whole.kl).abs() < 1e-4 * whole.kl);
    }

    #[test]
    fn without_advantages_there_is_no_gradient_and_no_step() {
        let mut sample = Sample::new(6, 50);
        sample.advantages.fill(0.0);
        let step = step(&[sample.experience(1.0)], &TrustRegion::default(), 1.0).expect("finite numbers");
        assert_eq!(step, Step::none(sample.policy.parameters().len(), StepEnd::NoGradient));
    }

    #[test]
    fn advantages_that_are_no_numbers_are_divergence() {
        for broken in [f32::NAN, f32::INFINITY] {
            let mut sample = Sample::new(7, 50);
            sample.advantages[3] = broken;
            let error = step(&[sample.experience(1.0)], &TrustRegion::default(), 1.0).expect_err("diverged");
            assert!(error.is_diverged(), "{error}");
        }
    }

    #[test]
    fn a_batch_in_two_parts_gives_the_same_step() {
        let sample = Sample::new(8, 500);
        let parts = [sample.rows(0, 320, 0.64), sample.rows(320, 500, 0.36)];
        let region = TrustRegion::default();
        let whole = step(&[sample.experience(1.0)], &region, 1.0).expect("finite numbers");
        let parted = step(&parts, &region, 1.0).expect("finite numbers");
        let length = dot(&whole.displacement, &whole.displacement).sqrt();
        let difference: Vec<f32> =
            whole.displacement.iter().zip(&parted.displacement).map(|(a, b)| a - b).collect();
        assert!(dot(&difference, &difference).sqrt() < 1e-3 * length);
        assert!((whole.kl - parted.kl).abs() < 1e-3 * whole.kl);
    }

    #[test]
    fn a_policy_without_weight_does_not_pull_on_the_shared_step() {
        let (one, other) = (Sample::new(9, 200), Sample::new(10, 200));
        let region = TrustRegion::default();
        let alone = step(&[one.experience(1.0)], &region, 1.0).expect("finite numbers");
        let both = step(&[one.experience(1.0), other.experience(0.0)], &region, 1.0).expect("finite numbers");
        assert_eq!(alone, both);
        let half = step(&[one.experience(0.5), other.experience(0.5)], &region, 1.0).expect("finite numbers");
        assert_ne!(half.displacement, alone.displacement);
    }

    #[test]
    fn the_spread_of_the_actions_is_part_of_the_step() {
        let mut sample = Sample::new(11, 2000);
        let observations = Rows::from_flat(sample.observations.clone(), OBSERVATIONS).expect("whole rows");
        let means = sample.policy.means(&observations);
        let means = means.flat();
        // Actions near the mean are good: the spread should shrink in every dimension.
        for row in 0..sample.advantages.len() {
            let columns = row * ACTIONS..(row + 1) * ACTIONS;
            let far: f32 = columns.map(|at| (sample.actions[at] - means[at]).powi(2)).sum();
            sample.advantages[row] = 1.0 - far;
        }
        let step = step(&[sample.experience(1.0)], &TrustRegion::default(), 1.0).expect("finite numbers");
        let spread = &step.displacement[sample.policy.network().parameter_count()..];
        assert!(spread.iter().all(|change| *change < -0.01), "{spread:?}");
    }

    /// One observation, one action, paid −(a − 0.7)²: the best mean is 0.7, and the best spread none.
    #[test]
    fn a_bandit_is_learned() {
        let shape = PolicyShape { hidden: vec![4], initial_std: 0.5 };
        let mut policy = Policy::untrained(&shape, ObservationFilter::identity(1), 1, Seed::new(1));
        let mut rng = Seed::new(2).into_rng();
        let observations = vec![1.0; 400];
        let mean_of = |policy: &Policy| {
            policy.network().forward(policy.network_parameters(), &[1.0], &mut Tape::<f32>::default())[0]
        };
        for _ in 0..40 {
            let mut actions = vec![0.0; 400];
            let means = [mean_of(&policy)];
            for action in actions.chunks_exact_mut(1) {
                gaussian::sample(&means, policy.log_std(), &mut rng, action);
            }
            let rewards: Vec<f32> = actions.iter().map(|action| -(action - 0.7) * (action - 0.7)).collect();
            let mean = rewards.iter().sum::<f32>() / 400.0;
            let advantages: Vec<f32> = rewards.iter().map(|reward| reward - mean).collect();
            let experience = Experience {
                policy: &policy,
                observations: &observations,
                actions: &actions,
                advantages: &advantages,
                weight: 1.0,
            };
            let region = TrustRegion { max_kl: 0.05, damping: 1e-3, ..TrustRegion::default() };
            let step = step(&[experience], &region, 1.0).expect("finite numbers");
            policy = policy.moved(&step.displacement);
        }
        let (mean, std) = (mean_of(&policy), policy.log_std()[0].exp());
        assert!((mean - 0.7).abs() < 0.05, "mean {mean}");
        assert!(std < 0.1, "standard deviation {std}");
    }
}

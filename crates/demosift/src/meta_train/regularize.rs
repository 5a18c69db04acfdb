//! Lines 10 to 14 of Algorithm 1: the adapted policies are moved so that their change tells what was imitated.
//!
//! | Algorithm 1 | here |
//! |---|---|
//! | 10: sample K trajectories τ'_ij using f_θ'_i | [`play_after`] |
//! | 11: update Q with τ, τ'_ij and encoded v_i | [`mutual_information::fit`] in [`regularize`] |
//! | 12: sample new trajectories using f_θ and f_θ'_i | [`play_before`](super::play_before), [`play_after`] |
//! | 13: compute R_MI_i with Q on the new trajectories as (5) | [`mutual_information::information_rewards`] in [`inform`] |
//! | 14: θ''_i = θ'_i − α∇L_MI_i(f_θ) with TRPO as (7) | [`inform`] |
//!
//! Eq. 7 takes the gradient on the old trajectories, at θ, and applies it to θ'_i, and so do we by default.
//! The box writes ∇L_MI_i(f_θ'_i) in line 14, which [`Paid::After`] does: the gradient at θ'_i on its own trajectories.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Before, Imitator, Round, play_before};
use crate::adapt::Played;
use crate::demonstration::DemonstrationSet;
use crate::environment::EnvVariant;
use crate::error::Result;
use crate::mutual_information::{
    self, Change, Credit, Paid, Posterior, PosteriorFitting, Sequences, States, advantages,
    information_rewards,
};
use crate::nn::adam::Adam;
use crate::policy::Policy;
use crate::rollout::{self, Acting};
use crate::seed::Seed;
use crate::trpo::{self, TrustRegion};

/// How adapted policies are regularized by mutual information, where the method asks for it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MutualInformation {
    /// Which trajectories are paid (Eq. 7: those before the update).
    pub paid: Paid,
    /// Which of their actions are credited (§4.2 reads as the first one; see reading 3 in `docs/paper.md`).
    pub credit: Credit,
    /// K of lines 10 and 12, as environment steps: whole episodes are played until there are this many; not in the paper.
    pub batch_steps: usize,
    /// Q's shape and fit.
    pub posterior: PosteriorFitting,
    /// The trust region of line 14 for α = 1 (A.2.1: KL 0.15).
    pub trust_region: TrustRegion,
}

impl MutualInformation {
    /// K: episodes of `horizon` steps that are played in lines 10 and 12, at least 2.
    pub fn episodes(&self, horizon: usize) -> usize {
        self.batch_steps.div_ceil(horizon).max(2)
    }
}

/// Q with Adam's moments: part of the state of meta-training, and of nothing that comes out of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PosteriorState {
    /// Q.
    pub posterior: Posterior,
    /// Moments of Q's Adam.
    pub adam: Adam,
}

impl PosteriorState {
    /// Line 1: random Q.
    pub fn start(set: &DemonstrationSet, fitting: &PosteriorFitting, seed: Seed) -> Self {
        let posterior = Posterior::untrained(set.observation_size(), fitting.lstm, fitting.dense, seed);
        let adam = Adam::new(posterior.parameters().len());
        Self { posterior, adam }
    }
}

/// What lines 10 to 14 saw and did, over all demonstrations of a round.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Report {
    /// Mean log Q on the held-out pairs, in nats; −1.42 for a posterior that knows nothing.
    pub(super) log_q: f64,
    /// Share of the encodings' variance that the predictions on held-out pairs explain; below 0, they mislead.
    pub(super) explained: f64,
    /// σ of Q, from the pairs that it was fitted to.
    pub(super) std: f64,
    /// Mean KL divergence that the steps reached.
    pub(super) kl: f64,
    /// Environment steps that were played for this.
    pub(super) environment_steps: usize,
}

/// Encoded demonstrations, Q, and how both are used.
pub(super) struct Regularizer<'a> {
    pub(super) how: &'a MutualInformation,
    pub(super) state: &'a mut PosteriorState,
    pub(super) encodings: &'a [f32],
}

/// Lines 10 to 14 for all demonstrations of a round.
pub(super) fn regularize(
    round: &Round<'_>,
    before: &[Before],
    imitators: &mut [Imitator],
    regularizer: Regularizer<'_>,
) -> Result<Report> {
    let Regularizer { how, state: PosteriorState { posterior, adam }, encodings } = regularizer;
    let encoding = |imitator: &Imitator| encodings[imitator.demo.0];
    let read = |played: &Played| round.read(played, how.posterior.readings);
    let after = play_after(round, imitators, how, "inform_train")?;
    let (sequences_before, sequences_after): (Vec<Sequences>, Vec<Sequences>) =
        (before.iter().map(|(_, played)| read(played)).collect(), after.iter().map(&read).collect());
    let changes: Vec<Change<'_>> = imitators
        .iter()
        .zip(&sequences_after)
        .map(|(imitator, after)| {
            let before = &sequences_before[place(before, imitator.variant)];
            Change { before, after, encoding: encoding(imitator) }
        })
        .collect();
    let seed = round.seed.of("inform_fit");
    *posterior = mutual_information::fit(posterior, &changes, &how.posterior, adam, seed)?;

    let new_before = play_before(round, "inform_before", how.episodes(round.horizon()))?;
    let new_after = play_after(round, imitators, how, "inform_held_out")?;
    let states: Vec<States> =
        new_before.par_iter().map(|(_, played)| posterior.read(&read(played))).collect();
    let moved: Vec<Informed> = imitators
        .par_iter()
        .zip(&new_after)
        .map(|(imitator, after)| {
            let place = place(&new_before, imitator.variant);
            let states = (&states[place], &posterior.read(&read(after)));
            let paid = match how.paid {
                Paid::Before => (&round.prior.policy, &new_before[place].1),
                Paid::After => (&imitator.adapted.policy, after),
            };
            inform(round, paid, states, (posterior, encoding(imitator)), how)
        })
        .collect::<Result<_>>()?;
    for (imitator, moved) in imitators.iter_mut().zip(&moved) {
        imitator.adapted.policy = imitator.adapted.policy.moved(&moved.displacement);
    }
    let drawn: Vec<f32> = imitators.iter().map(encoding).collect();
    let played = after.iter().chain(&new_after).chain(new_before.iter().map(|(_, played)| played));
    let environment_steps = played.map(|played| played.observations.len()).sum();
    Ok(Report::new(&moved, &drawn, posterior.std(), environment_steps))
}

/// Lines 10 and 12: what each adapted policy does, with random numbers that all demonstrations share.
fn play_after(
    round: &Round<'_>,
    imitators: &[Imitator],
    how: &MutualInformation,
    name: &str,
) -> Result<Vec<Played>> {
    let play = |imitator: &Imitator| {
        let policy = &imitator.adapted.policy;
        let seeds = round.seed.of(name).at(imitator.variant.0).many(how.episodes(round.horizon()));
        let trajectories = rollout::play(round.playground, policy, Acting::Sampled, imitator.variant, seeds)?;
        Ok(Played::new(round.playground, policy, &trajectories))
    };
    imitators.par_iter().map(play).collect()
}

/// What line 14 did to one adapted policy.
struct Informed {
    displacement: Vec<f32>,
    kl: f64,
    log_q: f64,
    squared_error: f64,
}

/// Lines 13 and 14 for one demonstration: −α∇L_MI with TRPO, on the trajectories that are paid.
fn inform(
    round: &Round<'_>,
    (policy, paid): (&Policy, &Played),
    states: (&States, &States),
    (posterior, encoding): (&Posterior, f32),
    how: &MutualInformation,
) -> Result<Informed> {
    let rewards = information_rewards(posterior, states, encoding, how.paid);
    let advantages = advantages(&rewards, &paid.lengths, how.credit);
    let step =
        trpo::step(&paid.experiences(policy, &advantages, 1.0), &how.trust_region, round.inner.alpha(0))?;
    Ok(Informed {
        displacement: step.displacement,
        kl: step.kl,
        log_q: rewards.iter().sum::<f64>() / rewards.len() as f64,
        squared_error: mutual_information::mean_squared_error(posterior, states.0, states.1, encoding),
    })
}

impl Report {
    fn new(informed: &[Informed], encodings: &[f32], std: f64, environment_steps: usize) -> Self {
        let count = informed.len() as f64;
        let mean = |value: &dyn Fn(&Informed) -> f64| informed.iter().map(value).sum::<f64>() / count;
        let center = encodings.iter().map(|c| f64::from(*c)).sum::<f64>() / count;
        let variance = encodings.iter().map(|c| (f64::from(*c) - center).powi(2)).sum::<f64>() / count;
        Self {
            log_q: mean(&|informed| informed.log_q),
            explained: match variance > 0.0 {
                true => 1.0 - mean(&|informed| informed.squared_error) / variance,
                false => 0.0,
            },
            std,
            kl: mean(&|informed| informed.kl),
            environment_steps,
        }
    }
}

fn place(before: &[Before], variant: EnvVariant) -> usize {
    before.iter().position(|(played, _)| *played == variant).expect("played for every variant of the round")
}

#[cfg(test)]
#[path = "regularize_tests.rs"]
mod tests;

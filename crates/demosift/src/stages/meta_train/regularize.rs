//! Lines 10 to 14 of Algorithm 1: the adapted policies are moved so that their change tells what was imitated.
//!
//! | Algorithm 1 | here |
//! |---|---|
//! | 10: sample K trajectories τ'_ij using f_θ'_i | [`play_quietly`] |
//! | 11: update Q with τ, τ'_ij and encoded v_i | [`mutual_information::fit`] in [`regularize`] |
//! | 12: sample new trajectories using f_θ and f_θ'_i | [`play_quietly`] |
//! | 13: compute R_MI_i with Q on the new trajectories as (5) | [`mutual_information::information_rewards`] in [`tell`] |
//! | 14: θ''_i = θ'_i − α∇L_MI_i(f_θ'_i) with TRPO | [`inform_all`] |
//!
//! The box writes ∇L_MI_i(f_θ'_i): the gradient at θ'_i on its own trajectories, which is what we take.
//! Eq. 7 takes it on the old trajectories, at θ, and applies it to θ'_i, which [`Paid::Before`] does; reading 4 in
//! `docs/paper.md` says why that works against itself.
//! The box has Q compare with the trajectories of line 7; ours are played with less noise, so that line 10 plays f_θ too.
//! The gradient of line 14 is that of the policy with less noise, and the step of its mean is added to θ'_i.
//! The box always takes the step of line 14; where Q explains nothing of the encodings on held-out pairs, its reward is noise
//! and so is the direction of the step, which is then not taken.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Imitator, Round};
use crate::basics::error::Result;
use crate::basics::seed::Seed;
use crate::data::demonstration::DemonstrationSet;
use crate::learning::adapt::{Played, Target};
use crate::learning::mutual_information::{
    self, Change, Credit, Paid, Posterior, PosteriorFitting, Sequences, advantages, information_rewards,
};
use crate::learning::trpo::{self, Step, TrustRegion};
use crate::math::nn::adam::Adam;
use crate::math::statistics::{mean, mean_and_variance, mean_of};
use crate::world::environment::EnvVariant;
use crate::world::policy::Policy;
use crate::world::rollout::{self, Acting};

/// How adapted policies are regularized by mutual information, where the method asks for it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MutualInformation {
    /// Which trajectories are paid (line 14 of Algorithm 1: those after the update; Eq. 7: those before).
    pub paid: Paid,
    /// Which of their actions are credited (§4.2 reads as the first one; see reading 3 in `docs/paper.md`).
    pub credit: Credit,
    /// K of lines 10 and 12, as environment steps: as many episodes as have so many where all last to the horizon, and no
    /// more where they end early; not in the paper.
    pub batch_steps: usize,
    /// With which share of the spread of its actions a policy plays what Q reads; not in the paper.
    ///
    /// One update changes what is done by much less than this spread does, and Q found nothing in full noise.
    pub noise: f64,
    /// Q's shape and fit.
    pub posterior: PosteriorFitting,
    /// The trust region of line 14 for α = 1: how far θ''_i, as it plays, may be from θ'_i (A.2.1: KL 0.15).
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
    /// Mean KL divergence of the policies with less noise that the steps reached, in units of the full noise, the part of their
    /// standard deviations among it, which θ''_i does not take; 0 where Q explains nothing, since none is taken then.
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
    imitators: &mut [Imitator],
    regularizer: Regularizer<'_>,
) -> Result<Report> {
    let Regularizer { how, state: PosteriorState { posterior, adam }, encodings } = regularizer;
    let encoding = |imitator: &Imitator| encodings[imitator.target.demo.0];
    let train = play_quietly(round, imitators, how, "inform_train")?;
    let read = train.read(round, how);
    let changes: Vec<Change<'_>> = imitators
        .iter()
        .zip(&read)
        .map(|(imitator, (before, after))| Change { before, after, encoding: encoding(imitator) })
        .collect();
    let seed = round.seed.of("inform_fit");
    *posterior = mutual_information::fit(posterior, &changes, &how.posterior, adam, seed)?;

    let held_out = play_quietly(round, imitators, how, "inform_held_out")?;
    let told: Vec<Told> = imitators
        .par_iter()
        .zip(held_out.read(round, how))
        .map(|(imitator, (before, after))| tell(posterior, &before, &after, encoding(imitator)))
        .collect();
    let drawn: Vec<f32> = imitators.iter().map(encoding).collect();
    let explained = explained(&told, &drawn);
    let kl = if explained > 0.0 { inform_all(round, imitators, &held_out, &told, how)? } else { 0.0 };
    let environment_steps = train.steps() + held_out.steps();
    Ok(Report { log_q: mean_log_q(&told), explained, std: posterior.std(), kl, environment_steps })
}

/// A policy with less noise, and what it did.
struct Quiet {
    policy: Policy,
    played: Played,
}

/// What θ does under each variant of the round, and what each θ'_i does.
struct Compared {
    before: Vec<(EnvVariant, Quiet)>,
    after: Vec<Quiet>,
}

/// Lines 10 and 12, with random numbers that all demonstrations share.
fn play_quietly(
    round: &Round<'_>,
    imitators: &[Imitator],
    how: &MutualInformation,
    name: &str,
) -> Result<Compared> {
    let play = |policy: &Policy, side: &str, variant: EnvVariant| {
        let policy = policy.with_spread(how.noise);
        let seeds = round.seed.of(name).of(side).at(variant.0).many(how.episodes(round.horizon()));
        let trajectories = rollout::play(round.playground, &policy, Acting::Sampled, variant, seeds)?;
        let played = Played::new(round.playground, &policy, &trajectories);
        Ok(Quiet { policy, played })
    };
    let before = round.variants().into_par_iter();
    let before = before.map(|variant| Ok((variant, play(&round.prior.policy, "before", variant)?)));
    let after = imitators.par_iter();
    let after = after.map(|imitator| play(&imitator.adapted.policy, "after", imitator.target.variant));
    Ok(Compared { before: before.collect::<Result<_>>()?, after: after.collect::<Result<_>>()? })
}

impl Compared {
    fn before_under(&self, variant: EnvVariant) -> &Quiet {
        let found = self.before.iter().find(|(played, _)| *played == variant);
        &found.expect("played for every variant of the round").1
    }

    /// Whose trajectories are paid, for each imitator.
    fn paid<'a>(&'a self, imitators: &[Imitator], paid: Paid) -> Vec<&'a Quiet> {
        let of = |(imitator, after): (&Imitator, _)| match paid {
            Paid::Before => self.before_under(imitator.target.variant),
            Paid::After => after,
        };
        imitators.iter().zip(&self.after).map(of).collect()
    }

    /// What Q reads for each imitator: the trajectories that are paid, and the mean of the other side, from which the noise
    /// of single trajectories is gone.
    fn read(&self, round: &Round<'_>, how: &MutualInformation) -> Vec<(Sequences, Sequences)> {
        let read = |quiet: &Quiet| round.read(&quiet.played, how.posterior.readings);
        let of = |(after, target): (&Quiet, &Target)| {
            let (before, after) = (read(self.before_under(target.variant)), read(after));
            match how.paid {
                Paid::Before => (before, after.averaged()),
                Paid::After => (before.averaged(), after),
            }
        };
        self.after.par_iter().zip(round.targets).map(of).collect()
    }

    fn steps(&self) -> usize {
        let played = self.before.iter().map(|(_, quiet)| quiet).chain(&self.after);
        played.map(|quiet| quiet.played.observations.len()).sum()
    }
}

/// What Q says of the held-out pairs of one demonstration.
struct Told {
    /// R_MI of each trajectory that is paid.
    rewards: Vec<f64>,
    squared_error: f64,
}

/// Line 13 for one demonstration.
fn tell(posterior: &Posterior, before: &Sequences, after: &Sequences, encoding: f32) -> Told {
    Told {
        rewards: information_rewards(posterior, before, after, encoding),
        squared_error: mutual_information::mean_squared_error(posterior, before, after, encoding),
    }
}

/// Line 14 for all demonstrations; gives the mean KL divergence of the steps.
fn inform_all(
    round: &Round<'_>,
    imitators: &mut [Imitator],
    held_out: &Compared,
    told: &[Told],
    how: &MutualInformation,
) -> Result<f64> {
    let paid = held_out.paid(imitators, how.paid);
    let steps: Vec<Step> = paid
        .par_iter()
        .zip(told)
        .map(|(paid, told)| inform(round, paid, &told.rewards, how))
        .collect::<Result<_>>()?;
    for (imitator, step) in imitators.iter_mut().zip(&steps) {
        imitator.adapted.policy = imitator.adapted.policy.moved(&step.displacement);
    }
    Ok(mean_of(steps.iter().map(|step| step.kl)))
}

/// Line 14 for one demonstration: −α∇L_MI with TRPO, on the trajectories that are paid.
fn inform(
    round: &Round<'_>,
    Quiet { policy, played }: &Quiet,
    rewards: &[f64],
    how: &MutualInformation,
) -> Result<Step> {
    let advantages = advantages(rewards, &played.lengths, how.credit);
    // With a share of the noise, the Fisher matrix of the mean and all KL divergences are larger by its square.
    let share = how.noise.powi(2);
    let TrustRegion { max_kl, damping, .. } = how.trust_region;
    let region = TrustRegion { max_kl: max_kl / share, damping: damping / share, ..how.trust_region };
    let mut step = trpo::step(&played.experiences(policy, &advantages, 1.0), &region, round.inner.alpha(0))?;
    step.kl *= share;
    // What the little noise should become says nothing of the noise that θ'_i has.
    step.displacement[policy.network_parameters().len()..].fill(0.0);
    Ok(step)
}

/// Share of the variance of the encodings that Q explains on held-out pairs; 0 where all are the same.
fn explained(told: &[Told], encodings: &[f32]) -> f64 {
    let (_, variance) = mean_and_variance(encodings.iter().map(|encoding| f64::from(*encoding)));
    let squared_error = mean_of(told.iter().map(|told| told.squared_error));
    if variance > 0.0 { 1.0 - squared_error / variance } else { 0.0 }
}

fn mean_log_q(told: &[Told]) -> f64 {
    mean_of(told.iter().map(|told| mean(&told.rewards)))
}

#[cfg(test)]
#[path = "regularize_tests.rs"]
mod tests;

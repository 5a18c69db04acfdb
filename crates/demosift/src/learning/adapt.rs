//! Learning from one demonstration within a few updates, written once (Eq. 1; Algorithm 1 lines 7–9, Algorithm 2 lines 5–10).
//!
//! By GAIL, an update plays the policy, fits the discriminator to what it did and to what was demonstrated, and improves
//! the policy on the discriminator's reward.
//! By behavioral cloning, it moves the policy's mean actions toward the demonstrated ones, and plays nothing.
//! Meta-training makes one such update per demonstration, judging makes a few, and imitation from scratch makes many.
//!
//! | Algorithm 2 | here |
//! |---|---|
//! | 3: θ_ij ← θ; 4: D_i ← D_meta | the [`Learner`] that is passed in |
//! | 5: for iter = 0 to max_iter | [`adapt`] |
//! | 6: sample K trajectories | [`InnerUpdate::play`] in [`adapt`] |
//! | 7: update D_i | [`gail::fit`] in [`update`] |
//! | 8: compute R_IL | [`gail::imitation_rewards`] in [`update`], with the *updated* discriminator |
//! | 9: θ_ij ← θ_ij − α∇L_IL with TRPO | [`trpo::step`] in [`update`] |
//! | 7 to 9 by behavioral cloning (§4.1.1) | [`behavioral_cloning::clone`] in [`update`] |
//!
//! Adam's moments, of the discriminator or of a cloned policy, are kept during an adaptation, which starts with none.

use serde::{Deserialize, Serialize};

use crate::basics::error::Result;
use crate::basics::seed::Seed;
use crate::data::demonstration::{DemoId, DemonstrationSet};
use crate::data::observation_filter::{Moments, ObservationFilter};
use crate::data::trajectory::Trajectory;
use crate::learning::advantage::{AdvantageEstimation, Rewarded, advantages};
use crate::learning::behavioral_cloning::{self, Cloned, Cloning};
use crate::learning::gail::{self, Discriminator, Fitting};
use crate::learning::trpo::{self, Experience, Step, StepEnd, TrustRegion};
use crate::math::nn::adam::Adam;
use crate::math::rows::Rows;
use crate::math::statistics;
use crate::world::environment::EnvVariant;
use crate::world::heuristic::Score;
use crate::world::policy::{Policy, PolicyShape};
use crate::world::rollout::{self, Acting, Playground};

/// The rule by which a demonstration is imitated (§4.1.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// Generative adversarial imitation learning, with TRPO.
    Gail,
    /// Supervised learning of the demonstrated actions.
    BehavioralCloning,
}

/// How one inner update is made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InnerUpdate {
    /// By which rule. Behavioral cloning reads only `alphas` and `cloning` of what follows; GAIL reads all but `cloning`.
    pub imitation: Rule,
    /// K, as environment steps: whole episodes are played before an update until they have this many, and at least four
    /// episodes; not in the paper.
    pub batch_steps: usize,
    /// α per iteration, the last one from there on (A.2.1: 1, then 0.5; Handstand and Martial Arts 2, then 0.5).
    pub alphas: Vec<f64>,
    /// The trust region for α = 1 (A.2.1: KL 0.15).
    pub trust_region: TrustRegion,
    /// How the discriminator is fitted before the policy's step.
    pub discriminator: Fitting,
    /// How rewards become advantages.
    pub advantage: AdvantageEstimation,
    /// How behavioral cloning learns.
    pub cloning: Cloning,
}

/// Fewer episodes say too little of where a policy leads, however long they are.
const LEAST_EPISODES: usize = 4;

/// A policy that ends its episodes at once would otherwise play for ever: no more than so many times the episodes of a batch that
/// last to the horizon.
const MOST_EPISODES: usize = 16;

impl InnerUpdate {
    /// What is played before an update: [`episodes`](Self::episodes) of them, each from a part of `seed` of its own, and
    /// further ones where they end early, until there are `batch_steps` steps or sixteen times as many episodes.
    ///
    /// All updates play their batch here.
    pub fn play(
        &self,
        playground: &Playground<'_>,
        policy: &Policy,
        variant: EnvVariant,
        seed: Seed,
    ) -> Result<Vec<Trajectory>> {
        let first = self.episodes(playground.specification().horizon);
        let mut played: Vec<Trajectory> = Vec::with_capacity(first);
        let mut more = first;
        while more > 0 {
            let seeds = (played.len()..played.len() + more).map(|episode| seed.at(episode)).collect();
            played.extend(rollout::play(playground, policy, Acting::Sampled, variant, seeds)?);
            more = self.lacking(&played, MOST_EPISODES * first);
        }
        Ok(played)
    }

    /// How many more episodes of the same mean length a batch needs that may have `most` of them.
    fn lacking(&self, played: &[Trajectory], most: usize) -> usize {
        let steps: usize = played.iter().map(Trajectory::steps).sum();
        match self.imitation {
            Rule::Gail if steps < self.batch_steps => {
                let more = ((self.batch_steps - steps) * played.len()).div_ceil(steps.max(1));
                more.min(most - played.len())
            }
            Rule::Gail | Rule::BehavioralCloning => 0,
        }
    }

    /// K: episodes of `horizon` steps that are played before an update, at least 4; by behavioral cloning those that are
    /// asked for.
    pub fn episodes(&self, horizon: usize) -> usize {
        match self.imitation {
            Rule::Gail => self.batch_steps.div_ceil(horizon).max(LEAST_EPISODES),
            Rule::BehavioralCloning => self.cloning.curve_episodes,
        }
    }

    /// Adam before the first update of a learner: for its discriminator, or for the policy that is cloned.
    pub fn adam(&self, learner: &Learner) -> Adam {
        Adam::new(match self.imitation {
            Rule::Gail => learner.discriminator.parameters().len(),
            Rule::BehavioralCloning => learner.policy.network_parameters().len(),
        })
    }

    /// α of an iteration.
    pub fn alpha(&self, iteration: usize) -> f64 {
        self.alphas.get(iteration).or(self.alphas.last()).copied().unwrap_or(1.0)
    }
}

/// A policy with the discriminator that teaches it: θ with D_meta before, θ'_i with D'_i after an update.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Learner {
    /// π_θ.
    pub policy: Policy,
    /// D; behavioral cloning leaves it undecided.
    pub discriminator: Discriminator,
}

/// θ and D_meta: the learner that meta-training returns, which adapts quickly to any demonstration.
pub type MetaPrior = Learner;

/// The filter that all demonstrations of a set share: their observations get mean 0 and spread 1.
pub fn filter_of(set: &DemonstrationSet) -> ObservationFilter {
    let mut moments = Moments::default();
    set.iter().for_each(|(_, demonstration)| moments.add(demonstration.observations()));
    moments.filter()
}

impl Learner {
    /// A learner that knows nothing, behind the filter that all of the set's demonstrations share: the start of
    /// meta-training and of imitation from scratch.
    pub fn untrained(
        set: &DemonstrationSet,
        shape: &PolicyShape,
        discriminator_hidden: &[usize],
        seed: &Seed,
    ) -> Self {
        Self::untrained_behind(&filter_of(set), set.action_size(), shape, discriminator_hidden, seed)
    }

    /// The same behind another filter.
    pub fn untrained_behind(
        filter: &ObservationFilter,
        action_size: usize,
        shape: &PolicyShape,
        discriminator_hidden: &[usize],
        seed: &Seed,
    ) -> Self {
        let policy = Policy::untrained(shape, filter.clone(), action_size, seed.of("policy"));
        let pair_size = filter.observation_size() + action_size;
        let discriminator =
            Discriminator::undecided(discriminator_hidden, pair_size, seed.of("discriminator"));
        Self { policy, discriminator }
    }

    /// The pairs of each demonstration behind this learner's filter, by its position in the file; none for what is not of
    /// the set.
    pub fn demonstrated_pairs(&self, set: &DemonstrationSet) -> Vec<Rows> {
        let filter = self.policy.filter();
        let pairs = set.iter().map(|(_, demonstration)| gail::demonstrated_pairs(demonstration, filter));
        set.by_position(Rows::default(), pairs)
    }
}

/// Episodes as learning sees them: filtered once, paired once, one after the other.
#[derive(Clone, Debug)]
pub struct Played {
    /// Filtered observations on which actions were taken, `[N, obs]`.
    pub observations: Rows,
    /// Pairs for the discriminator, `[N, obs + act]`.
    pub pairs: Rows,
    /// The actions as drawn, `[N, act]`.
    pub actions: Rows,
    /// Steps of each episode; they sum to N.
    pub lengths: Vec<usize>,
    /// K of each episode.
    pub scores: Vec<Score>,
}

/// What one update saw and did; what its rule does not know is not there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct UpdateReport {
    /// Mean heuristic of the episodes played before the update, if there were any.
    pub score: Option<Score>,
    /// The discriminator's loss in nats; 2 ln 2 where it knows nothing.
    pub discriminator_loss: Option<f64>,
    /// Share of pairs that the discriminator told right.
    pub discriminator_accuracy: Option<f64>,
    /// Mean of R_IL over the agent's pairs.
    pub reward_mean: Option<f64>,
    /// Standard deviation of R_IL over the agent's pairs: near 0, there is nothing to learn from.
    pub reward_std: Option<f64>,
    /// KL divergence that the step reached.
    pub kl: Option<f64>,
    /// η: how far along the natural gradient the step went.
    #[serde(default)]
    pub natural_step: Option<f64>,
    /// L_v of behavioral cloning before the update.
    #[serde(default)]
    pub cloning_loss: Option<f64>,
    /// L_v of behavioral cloning after it.
    #[serde(default)]
    pub cloning_loss_after: Option<f64>,
    /// How the step ended.
    pub end: StepEnd,
}

/// What is adapted to: a demonstration under a variant of the task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Target {
    /// v_i.
    pub demo: DemoId,
    /// e_j.
    pub variant: EnvVariant,
}

/// θ' and D', with what led there.
#[derive(Clone, Debug)]
pub struct Updated {
    /// θ' and D'.
    pub learner: Learner,
    /// What there is to tell of the update.
    pub report: UpdateReport,
}

/// How long a demonstration is adapted to.
#[derive(Clone, Copy, Debug)]
pub struct Course<'a> {
    /// How each update is made.
    pub inner: &'a InnerUpdate,
    /// max_iter of Algorithm 2.
    pub iterations: usize,
    /// The last so many θ are averaged; 1 takes the last one as it is.
    pub averaged: usize,
}

/// θ'_i with what happened on the way.
#[derive(Clone, Debug)]
pub struct Adapted {
    /// θ'_i and D_i.
    pub learner: Learner,
    /// One report an iteration: the adaptation curve.
    pub curve: Vec<UpdateReport>,
    /// Environment steps that it took.
    pub played: u64,
}

/// Adapts a learner to demonstrated pairs for some iterations (Algorithm 2, lines 3–10).
pub fn adapt(
    learner: &Learner,
    demonstrated: &[&Rows],
    playground: &Playground<'_>,
    variant: EnvVariant,
    course: &Course<'_>,
    seed: &Seed,
) -> Result<Adapted> {
    let Course { inner, iterations, averaged } = *course;
    let mut last = Vec::with_capacity(averaged);
    let mut adam = inner.adam(learner);
    let mut adapted = Adapted { learner: learner.clone(), curve: Vec::with_capacity(iterations), played: 0 };
    for iteration in 0..iterations {
        let play_seed = seed_of_batch(seed, iteration);
        let trajectories = inner.play(playground, &adapted.learner.policy, variant, play_seed)?;
        let played = Played::new(playground, &adapted.learner.policy, &trajectories);
        let (alpha, fit_seed) = (inner.alpha(iteration), seed.of("fit").at(iteration));
        let updated = update(&adapted.learner, &played, demonstrated, inner, alpha, &mut adam, fit_seed)
            .map_err(|error| error.during(&format!("adaptation, iteration {iteration}")))?;
        adapted.learner = updated.learner;
        adapted.curve.push(updated.report);
        adapted.played += trajectories.iter().map(|played| played.steps() as u64).sum::<u64>();
        if iterations - iteration <= averaged {
            last.push(adapted.learner.policy.parameters().to_vec());
        }
    }
    adapted.learner.policy = averaged_policy(&adapted.learner.policy, &last);
    Ok(adapted)
}

/// The random numbers of the batch that [`adapt`] plays with `seed` before an iteration's update.
pub fn seed_of_batch(seed: &Seed, iteration: usize) -> Seed {
    seed.of("play").at(iteration)
}

/// The policy at the mean of some parameters: policy and discriminator circle around where they would settle, so that the
/// mean of the last iterates is a steadier witness than the last one.
fn averaged_policy(policy: &Policy, iterates: &[Vec<f32>]) -> Policy {
    let mut displacement = vec![0.0; policy.parameters().len()];
    for iterate in iterates {
        for ((sum, there), here) in displacement.iter_mut().zip(iterate).zip(policy.parameters()) {
            *sum += (there - here) / iterates.len() as f32;
        }
    }
    policy.moved(&displacement)
}

/// One inner update (Eq. 1): θ, D → θ' = θ − α∇L_IL, D'; by behavioral cloning D' is D.
pub fn update(
    learner: &Learner,
    played: &Played,
    demonstrated: &[&Rows],
    inner: &InnerUpdate,
    alpha: f64,
    adam: &mut Adam,
    seed: Seed,
) -> Result<Updated> {
    if inner.imitation == Rule::BehavioralCloning {
        let (policy, cloned) =
            behavioral_cloning::clone(&learner.policy, demonstrated, &inner.cloning, alpha, adam, seed)?;
        let learner = Learner { policy, discriminator: learner.discriminator.clone() };
        return Ok(Updated { learner, report: UpdateReport::of_cloning(played, cloned) });
    }
    let (discriminator, fit) =
        gail::fit(&learner.discriminator, &[&played.pairs], demonstrated, &inner.discriminator, adam, seed)?;
    let rewards = gail::imitation_rewards(&discriminator, &played.pairs);
    let advantages = played.advantages(&rewards, &inner.advantage)?;
    let step =
        trpo::step(&played.experiences(&learner.policy, &advantages, 1.0), &inner.trust_region, alpha)?;
    let policy = learner.policy.moved(&step.displacement);
    let report = UpdateReport::of_gail(played, fit, &rewards, &step);
    Ok(Updated { learner: Learner { policy, discriminator }, report })
}

/// Rows of one experience; a fixed number, so that the number of threads does not change a sum.
const EXPERIENCE_ROWS: usize = 1000;

impl Played {
    /// Filters, pairs and scores what a policy did.
    pub fn new(playground: &Playground<'_>, policy: &Policy, trajectories: &[Trajectory]) -> Self {
        let lengths: Vec<usize> = trajectories.iter().map(Trajectory::steps).collect();
        let total = lengths.iter().sum();
        let mut observations = Rows::with_capacity(policy.filter().observation_size(), total);
        let mut actions = Rows::with_capacity(policy.action_size(), total);
        for played in trajectories {
            observations.append(&policy.filter().apply_rows(played.observations(), played.steps()));
            actions.append(played.actions());
        }
        Self {
            pairs: gail::pairs(&observations, &actions),
            scores: trajectories.iter().map(|played| playground.score(played)).collect(),
            observations,
            actions,
            lengths,
        }
    }

    /// Mean heuristic, if anything was played.
    pub fn mean_score(&self) -> Option<Score> {
        (!self.scores.is_empty()).then(|| statistics::mean(&self.scores))
    }

    /// Standardized advantages of rewards `[N]`, `[N]`.
    pub fn advantages(&self, rewards: &[f32], estimation: &AdvantageEstimation) -> Result<Vec<f32>> {
        let rewarded = Rewarded { observations: &self.observations, rewards, lengths: &self.lengths };
        advantages(rewarded, estimation)
    }

    /// The episodes as experience of the policy that played them, with `weight` shared out by length.
    pub fn experiences<'a>(
        &'a self,
        policy: &'a Policy,
        advantages: &'a [f32],
        weight: f64,
    ) -> Vec<Experience<'a>> {
        let observations = self.observations.flat().chunks(EXPERIENCE_ROWS * self.observations.width());
        let actions = self.actions.flat().chunks(EXPERIENCE_ROWS * self.actions.width());
        observations
            .zip(actions)
            .zip(advantages.chunks(EXPERIENCE_ROWS))
            .map(|((observations, actions), chunk)| Experience {
                policy,
                observations,
                actions,
                advantages: chunk,
                weight: weight * chunk.len() as f64 / advantages.len() as f64,
            })
            .collect()
    }
}

impl UpdateReport {
    fn of_gail(played: &Played, fit: gail::FitReport, rewards: &[f32], step: &Step) -> Self {
        let (reward_mean, reward_std) =
            statistics::mean_and_deviation(rewards.iter().map(|reward| f64::from(*reward)));
        Self {
            score: played.mean_score(),
            discriminator_loss: Some(fit.loss),
            discriminator_accuracy: Some(fit.accuracy),
            reward_mean: Some(reward_mean),
            reward_std: Some(reward_std),
            kl: Some(step.kl),
            natural_step: Some(step.size),
            cloning_loss: None,
            cloning_loss_after: None,
            end: step.end,
        }
    }

    fn of_cloning(played: &Played, cloned: Cloned) -> Self {
        Self {
            score: played.mean_score(),
            discriminator_loss: None,
            discriminator_accuracy: None,
            reward_mean: None,
            reward_std: None,
            kl: None,
            natural_step: None,
            cloning_loss: Some(cloned.loss_before),
            cloning_loss_after: Some(cloned.loss_after),
            end: match cloned.loss_before > 0.0 {
                true => StepEnd::Moved,
                false => StepEnd::NoGradient,
            },
        }
    }

    /// What there is to tell, by name.
    pub fn numbers(&self) -> Vec<(&'static str, f64)> {
        let numbers = [
            ("score", self.score),
            ("discriminator_loss", self.discriminator_loss),
            ("discriminator_accuracy", self.discriminator_accuracy),
            ("reward_mean", self.reward_mean),
            ("reward_std", self.reward_std),
            ("kl", self.kl),
            ("cloning_loss", self.cloning_loss),
            ("cloning_loss_after", self.cloning_loss_after),
        ];
        numbers.into_iter().filter_map(|(name, number)| Some((name, number?))).collect()
    }
}

#[cfg(test)]
mod tests;

//! Meta-imitation-learning (§4.1, §4.2; Algorithm 1): a policy and a discriminator that adapt to any demonstration.
//!
//! Each round adapts the meta-parameters to every demonstration of a batch by one inner update, moves the adapted policies
//! so that their behavior tells what they imitated (if mutual information regularizes), plays them, and moves the
//! meta-parameters so that the adapted policies would have imitated better.
//!
//! | Algorithm 1 | here |
//! |---|---|
//! | 1: initialize θ, Q, D_meta | [`MetaState::start`] |
//! | 2, 5: sample a batch of demonstrations, and of environments for each | [`tasks_of_round`] |
//! | 3: while not done | [`meta_train`] |
//! | 4, 6, 16, 17: for all v_i, for all e_j | the parallel loops in the steps of [`Round::play`] |
//! | 7: sample K trajectories using f_θ | [`play_before`]: with common random numbers they are the same for every v_i, so they are played once per variant |
//! | 8, 9: θ'_i, D'_meta,i | [`adapt::update`] in [`imitate`] |
//! | 10 to 14: Q, θ''_i | [`regularize`], line by line in its file; without it θ''_i is θ'_i |
//! | 15: sample K trajectories using f_θ''_i | [`play_adapted`] |
//! | 18: meta-update θ as (2) | [`meta_update_policy`], each demonstration counting c_i (§4.4); [`cloning::meta_update`] by behavioral cloning |
//! | 19: meta-update D_meta as (3) | [`meta_update_discriminator`], the same |
//!
//! Where we differ: the box updates D before it needs it (line 8 uses what line 9 makes), so line 9 comes first;
//! the meta-gradients are of first order by default, which Eq. 3 is as written.
//! With [`Order::Second`] that of θ is exact: through the plain steps of behavioral cloning, and through GAIL's
//! natural-gradient step with the Fisher matrix and the step's size held fixed (see [`crate::trpo::Adaptation`]).
//! What line 14 adds is held fixed too.
//! Under behavioral cloning lines 8 and 18 are supervised learning, line 19 has no discriminator to move, and nothing is
//! played but for the curve and for mutual information, whose line 14 is a policy gradient as for GAIL (§4.2).
//! The batch of line 2 is drawn anew in each round, and line 5 draws one variant for each demonstration: with few
//! trajectories, more rounds say more than more variants in each.

mod cloning;
mod cost;
mod regularize;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::adapt::{self, InnerUpdate, Learner, MetaPrior, Played, Rule, UpdateReport};
use crate::demonstration::{DemoId, DemonstrationSet};
use crate::environment::EnvVariant;
use crate::error::{Error, Result};
use crate::gail;
use crate::mutual_information::{self, Sequences};
use crate::nn::adam::Adam;
use crate::observer::{Event, Observer};
use crate::policy::{Policy, PolicyShape};
use crate::rollout::{self, Acting, Playground};
use crate::rows::Rows;
use crate::seed::Seed;
use crate::trpo::{self, Adaptation, Branch, Step, TrustRegion};
use crate::weights::Weights;

pub use cost::steps_by_round;
pub use regularize::{MutualInformation, PosteriorState};
use regularize::{Regularizer, regularize};

/// How the meta-parameters are trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MetaTraining {
    /// Meta-updates (A.2.1: up to 2,000).
    pub rounds: usize,
    /// Demonstrations in a round (A.2.1: 10, or the whole set if it is smaller).
    pub meta_batch: usize,
    /// Trust region of the meta-update of θ; the bound is on the KL divergence after adaptation; not in the paper.
    pub trust_region: TrustRegion,
    /// Whether the meta-gradient of θ goes through the inner update (Eq. 2) or stops at θ'_i (as Eq. 3 does for D_meta).
    pub order: Order,
    /// β of θ under behavioral cloning, Adam's step size; not in the paper. GAIL's θ has the trust region instead.
    pub policy_learning_rate: f64,
    /// β of D_meta, Adam's step size; not in the paper.
    pub discriminator_learning_rate: f64,
    /// Widths of the discriminator's hidden layers (Table 3: 100, 100).
    pub discriminator_hidden: Vec<usize>,
    /// Rounds between two checkpoints.
    pub checkpoint_every: usize,
}

/// Which derivative Eq. 2 takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// ∇L at θ'_i, as if θ'_i moved as θ does.
    First,
    /// ∇_θ L(f_θ'_i), through the inner update.
    Second,
}

/// Where meta-training stands after some rounds; from here it goes on to the identical result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MetaState {
    /// Rounds that are finished.
    pub rounds: usize,
    /// θ and D_meta.
    pub prior: MetaPrior,
    /// Moments of θ's Adam, which behavioral cloning uses.
    pub policy_adam: Adam,
    /// Moments of D_meta's Adam.
    pub discriminator_adam: Adam,
    /// Environment steps taken in these rounds, those of lines 10 and 12 among them.
    pub environment_steps: u64,
    /// Q, where mutual information regularizes.
    pub posterior: Option<PosteriorState>,
    /// c_i: how much each demonstration counts in the meta-updates (§4.4); all alike, unless a subset is being selected.
    pub weights: Weights,
}

/// Name of the stage in events.
pub const STAGE: &str = "meta_train";

/// Algorithm 1, continued from where `state` stands; its prior is what comes of it.
pub fn meta_train(
    set: &DemonstrationSet,
    playground: &Playground<'_>,
    (training, inner, information): (&MetaTraining, &InnerUpdate, &MutualInformation),
    mut state: MetaState,
    seed: &Seed,
    observer: &mut dyn Observer,
) -> Result<MetaState> {
    let demonstrated = state.prior.demonstrated_pairs(set);
    let encodings = mutual_information::encodings(set);
    observer.on(Event::Started { stage: STAGE, done: state.rounds, total: training.rounds });
    while state.rounds < training.rounds {
        let number = state.rounds;
        let during = |error: Error| error.during(&format!("meta-training, round {number}"));
        let tasks = tasks_of_round(set, playground, training.meta_batch, seed.of("batch").at(number));
        let seed = seed.of("round").at(number);
        let weights = &state.weights;
        let round = Round { prior: &state.prior, tasks: &tasks, weights, playground, inner, seed: &seed };
        let regularizer = state.posterior.as_mut().map(|state| Regularizer {
            how: information,
            state,
            encodings: &encodings,
        });
        let played = round.play(&demonstrated, regularizer).map_err(during)?;
        let updated = meta_update(&mut state, &demonstrated, &played, (training, inner)).map_err(during)?;
        state.rounds += 1;
        state.environment_steps += played.environment_steps as u64;
        report(&state, &played, updated, observer);
        if state.rounds.is_multiple_of(training.checkpoint_every.max(1)) {
            observer.on(Event::Checkpoint { stage: STAGE, part: "", state: &state });
        }
    }
    Ok(state)
}

impl MetaState {
    /// Line 1: random θ, undecided D_meta, behind the filter of the whole set; random Q where mutual information is to
    /// regularize.
    pub fn start(
        set: &DemonstrationSet,
        shape: &PolicyShape,
        discriminator_hidden: &[usize],
        information: Option<&MutualInformation>,
        seed: &Seed,
    ) -> Self {
        Self::from_prior(set, Learner::untrained(set, shape, discriminator_hidden, seed), information, seed)
    }

    /// From a θ and D_meta that know something, with Adam and Q as at first.
    pub fn from_prior(
        set: &DemonstrationSet,
        prior: MetaPrior,
        information: Option<&MutualInformation>,
        seed: &Seed,
    ) -> Self {
        let policy_adam = Adam::new(prior.policy.network_parameters().len());
        let discriminator_adam = Adam::new(prior.discriminator.parameters().len());
        let posterior =
            information.map(|how| PosteriorState::start(set, &how.posterior, seed.of("posterior")));
        let weights = Weights::ones(set.len());
        Self { rounds: 0, prior, policy_adam, discriminator_adam, environment_steps: 0, posterior, weights }
    }
}

/// What came of one demonstration under one variant in a round.
struct Outcome {
    demo: DemoId,
    variant: EnvVariant,
    /// c_i.
    weight: f64,
    adapted: Learner,
    after: Played,
    update: UpdateReport,
}

/// What came of a round.
struct PlayedRound {
    before: Vec<Before>,
    outcomes: Vec<Outcome>,
    information: Option<regularize::Report>,
    behavior_spread: Option<f64>,
    environment_steps: usize,
}

/// Lines 2 and 5: which demonstrations and variants this round is about.
fn tasks_of_round(
    set: &DemonstrationSet,
    playground: &Playground<'_>,
    meta_batch: usize,
    seed: Seed,
) -> Vec<(DemoId, EnvVariant)> {
    use rand::seq::{IndexedRandom, SliceRandom};
    let mut rng = seed.into_rng();
    let mut ids = set.ids();
    if meta_batch < ids.len() {
        ids.shuffle(&mut rng);
        ids.truncate(meta_batch);
        ids.sort_unstable();
    }
    let variants = playground.specification().variant_ids();
    ids.into_iter().map(|id| (id, *variants.choose(&mut rng).expect("a task has a variant"))).collect()
}

/// What a round is about.
struct Round<'a> {
    prior: &'a MetaPrior,
    tasks: &'a [(DemoId, EnvVariant)],
    weights: &'a Weights,
    playground: &'a Playground<'a>,
    inner: &'a InnerUpdate,
    seed: &'a Seed,
}

/// What θ does under a variant; with common random numbers it is the same for every v_i.
type Before = (EnvVariant, Played);

/// θ'_i and D'_meta,i, and after line 14 θ''_i.
struct Imitator {
    demo: DemoId,
    variant: EnvVariant,
    adapted: Learner,
    update: UpdateReport,
}

impl Round<'_> {
    /// Lines 4 to 17.
    fn play(&self, demonstrated: &[Rows], regularizer: Option<Regularizer<'_>>) -> Result<PlayedRound> {
        let information = regularizer.as_ref().map(|regularizer| regularizer.how);
        let before =
            play_before(self, "before", cost::episodes_before(self.inner, information, self.horizon()))?;
        let mut imitators = imitate(self, &before, demonstrated)?;
        let information = regularizer
            .map(|regularizer| regularize(self, &before, &mut imitators, regularizer))
            .transpose()?;
        let outcomes = play_adapted(self, imitators)?;
        let played = before.iter().map(|(_, before)| before).chain(outcomes.iter().map(|one| &one.after));
        let environment_steps = played.map(|played| played.observations.len()).sum::<usize>()
            + information.as_ref().map_or(0, |report| report.environment_steps);
        let behavior_spread = behavior_spread(self, &outcomes);
        Ok(PlayedRound { before, outcomes, information, behavior_spread, environment_steps })
    }

    fn horizon(&self) -> usize {
        self.playground.specification().horizon
    }

    /// Episodes as sequences of equal length.
    fn read(&self, played: &Played, readings: usize) -> Sequences {
        Sequences::read(&played.observations, &played.lengths, (self.horizon(), readings))
    }
}

/// Line 7, and the first half of line 12: what θ does under each variant of the round.
fn play_before(round: &Round<'_>, name: &str, episodes: usize) -> Result<Vec<Before>> {
    let mut variants: Vec<EnvVariant> = round.tasks.iter().map(|(_, variant)| *variant).collect();
    variants.sort_unstable();
    variants.dedup();
    let play = |variant: EnvVariant| {
        let seeds = round.seed.of(name).at(variant.0).many(episodes);
        let policy = &round.prior.policy;
        let trajectories = rollout::play(round.playground, policy, Acting::Sampled, variant, seeds)?;
        Ok((variant, Played::new(round.playground, policy, &trajectories)))
    };
    variants.into_par_iter().map(play).collect()
}

/// Lines 8 and 9.
fn imitate(round: &Round<'_>, before: &[Before], demonstrated: &[Rows]) -> Result<Vec<Imitator>> {
    let Round { prior, tasks, inner, seed, .. } = *round;
    let imitate = |(demo, variant): &(DemoId, EnvVariant)| {
        let before = before_under(before, *variant);
        let mut adam = inner.adam(prior);
        let seed = seed.of("after").at(variant.0).of("fit");
        let demonstrated = &[&demonstrated[demo.0]];
        let (adapted, update) =
            adapt::update(prior, before, demonstrated, (inner, inner.alpha(0)), &mut adam, seed)?;
        Ok(Imitator { demo: *demo, variant: *variant, adapted, update })
    };
    tasks.par_iter().map(imitate).collect()
}

/// Line 15.
fn play_adapted(round: &Round<'_>, imitators: Vec<Imitator>) -> Result<Vec<Outcome>> {
    let play = |Imitator { demo, variant, adapted, update }| {
        let seed = round.seed.of("after").at(variant.0).of("play");
        let seeds = seed.many(round.inner.episodes(round.horizon()));
        let trajectories = rollout::play(round.playground, &adapted.policy, Acting::Sampled, variant, seeds)?;
        let after = Played::new(round.playground, &adapted.policy, &trajectories);
        Ok(Outcome { demo, variant, weight: round.weights.of(demo), adapted, after, update })
    };
    imitators.into_par_iter().map(play).collect()
}

/// How far the adapted behaviors lie apart: the root mean square, over times and filtered observations, of what the mean
/// trajectory after imitating one demonstration differs from the mean over all demonstrations of the same variant.
///
/// Played with the same random numbers, policies that are the same have spread 0; where nothing was played there is none.
fn behavior_spread(round: &Round<'_>, outcomes: &[Outcome]) -> Option<f64> {
    const READINGS: usize = 50;
    if outcomes.iter().any(|one| one.after.lengths.is_empty()) {
        return None;
    }
    let means: Vec<(EnvVariant, Vec<f64>)> =
        outcomes.iter().map(|one| (one.variant, round.read(&one.after, READINGS).mean())).collect();
    let (mut squares, mut count) = (0.0, 0);
    for (variant, mean) in &means {
        let others: Vec<&Vec<f64>> =
            means.iter().filter(|(other, _)| other == variant).map(|(_, mean)| mean).collect();
        for (at, value) in mean.iter().enumerate() {
            let center = others.iter().map(|other| other[at]).sum::<f64>() / others.len() as f64;
            squares += (value - center).powi(2);
        }
        count += mean.len();
    }
    Some((squares / count.max(1) as f64).sqrt())
}

/// Lines 18 and 19; gives numbers to report.
fn meta_update(
    state: &mut MetaState,
    demonstrated: &[Rows],
    played: &PlayedRound,
    (training, inner): (&MetaTraining, &InnerUpdate),
) -> Result<Vec<(&'static str, f64)>> {
    match inner.imitation {
        Rule::Gail => {
            let step = meta_update_policy(&mut state.prior.policy, played, training, inner)?;
            meta_update_discriminator(state, demonstrated, &played.outcomes, training, inner)?;
            Ok(vec![("meta_kl", step.kl), ("meta_improvement", step.improvement)])
        }
        Rule::BehavioralCloning => {
            cloning::meta_update(state, demonstrated, &played.outcomes, (training, inner))
        }
    }
}

/// Line 18, Eq. 2: θ moves so that all adapted θ'_i imitate better, each by its weight c_i (§4.4); to first order they move
/// together with it, to second each as its adaptation carries it along.
///
/// The weights share out the trust region too, so that what counts for nothing does not hold θ back.
fn meta_update_policy(
    policy: &mut Policy,
    PlayedRound { before, outcomes, .. }: &PlayedRound,
    training: &MetaTraining,
    inner: &InnerUpdate,
) -> Result<Step> {
    let advantages: Vec<Vec<f32>> = outcomes
        .par_iter()
        .map(|outcome| {
            let rewards = gail::imitation_rewards(&outcome.adapted.discriminator, &outcome.after.pairs);
            outcome.after.advantages(&rewards, &inner.advantage)
        })
        .collect::<Result<_>>()?;
    let total = total_weight(outcomes);
    let experiences = outcomes.iter().zip(&advantages).map(|(outcome, advantages)| {
        outcome.after.experiences(&outcome.adapted.policy, advantages, outcome.weight / total)
    });
    let region = &training.trust_region;
    let step = match training.order {
        Order::First => trpo::step(&experiences.flatten().collect::<Vec<_>>(), region, 1.0)?,
        Order::Second => {
            let advantages_before = advantages_before(before, outcomes, inner)?;
            let acted = outcomes.iter().zip(&advantages_before);
            let branches = experiences.zip(acted).map(|(experiences, (outcome, advantages))| {
                let adaptation = adaptation(policy, before, (outcome, advantages), inner);
                Branch { experiences, adaptation: Some(adaptation) }
            });
            trpo::step_through(branches.collect(), region, 1.0)?
        }
    };
    *policy = policy.moved(&step.displacement);
    Ok(step)
}

/// The advantages by which line 8 adapted θ to each demonstration, from the discriminator of line 9.
fn advantages_before(before: &[Before], outcomes: &[Outcome], inner: &InnerUpdate) -> Result<Vec<Vec<f32>>> {
    let advantages = |Outcome { adapted, variant, .. }: &Outcome| {
        let before = before_under(before, *variant);
        before.advantages(&gail::imitation_rewards(&adapted.discriminator, &before.pairs), &inner.advantage)
    };
    outcomes.par_iter().map(advantages).collect()
}

/// How a θ'_i moves with θ: the step of line 8, on the trajectories of line 7.
fn adaptation<'a>(
    policy: &'a Policy,
    before: &'a [Before],
    (outcome, advantages): (&Outcome, &'a [f32]),
    inner: &InnerUpdate,
) -> Adaptation<'a, f32> {
    let experiences = before_under(before, outcome.variant).experiences(policy, advantages, 1.0);
    Adaptation::new(&experiences, &inner.trust_region, outcome.update.natural_step.unwrap_or(0.0))
}

fn before_under(before: &[Before], variant: EnvVariant) -> &Played {
    let found = before.iter().find(|(played, _)| *played == variant);
    &found.expect("played for every variant of the round").1
}

fn total_weight(outcomes: &[Outcome]) -> f64 {
    outcomes.iter().map(|outcome| outcome.weight).sum()
}

/// Line 19, Eq. 3: D_meta ← D_meta − β Σ_i c_i·(Ê_τi[∇ −log D'_i] + Ê_vi[∇ −log(1 − D'_i)]).
///
/// Adam takes the step, to which the mean over i is what the sum is.
fn meta_update_discriminator(
    state: &mut MetaState,
    demonstrated: &[Rows],
    outcomes: &[Outcome],
    training: &MetaTraining,
    inner: &InnerUpdate,
) -> Result<()> {
    let entropy = inner.discriminator.entropy;
    let gradients: Vec<Vec<f32>> = outcomes
        .par_iter()
        .map(|Outcome { demo, adapted, after, .. }| {
            let demonstrated = &[&demonstrated[demo.0]];
            gail::loss_and_gradient(&adapted.discriminator, &[&after.pairs], demonstrated, entropy).1
        })
        .collect();
    let mut gradient = vec![0.0; state.prior.discriminator.parameters().len()];
    let total = total_weight(outcomes) as f32;
    for (part, outcome) in gradients.iter().zip(outcomes) {
        let weight = outcome.weight as f32;
        gradient.iter_mut().zip(part).for_each(|(sum, value)| *sum += value * weight / total);
    }
    if gradient.iter().any(|value| !value.is_finite()) {
        return Err(Error::diverged("the gradient of the meta-discriminator is not a finite number"));
    }
    let mut parameters = state.prior.discriminator.parameters().to_vec();
    state.discriminator_adam.descend(training.discriminator_learning_rate as f32, &gradient, &mut parameters);
    state.prior.discriminator = state.prior.discriminator.with_parameters(parameters);
    Ok(())
}

fn report(
    state: &MetaState,
    played: &PlayedRound,
    updated: Vec<(&'static str, f64)>,
    observer: &mut dyn Observer,
) {
    let PlayedRound { outcomes, information, behavior_spread, .. } = played;
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    let mut numbers = Vec::new();
    let after: Vec<f64> = outcomes.iter().filter_map(|outcome| outcome.after.mean_score()).collect();
    let reports: Vec<_> = outcomes.iter().map(|outcome| outcome.update.numbers()).collect();
    for (place, (name, _)) in reports[0].iter().enumerate() {
        let name = match *name {
            "score" => "score_before",
            "kl" => "inner_kl",
            name => name,
        };
        numbers.push((name, mean(reports.iter().map(|report| report[place].1).collect())));
    }
    if !after.is_empty() {
        numbers.push(("score_after", mean(after)));
    }
    numbers.extend(updated);
    numbers.push(("environment_steps", state.environment_steps as f64));
    numbers.extend(behavior_spread.map(|spread| ("behavior_spread", spread)));
    if let Some(information) = information {
        numbers.extend([
            ("log_q", information.log_q),
            ("encoding_explained", information.explained),
            ("posterior_std", information.std),
            ("information_kl", information.kl),
        ]);
    }
    observer.on(Event::Measured { stage: STAGE, part: "", iteration: state.rounds, numbers: &numbers });
    observer.on(Event::Advanced { stage: STAGE, done: state.rounds });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::check::gradient_error;
    use crate::nn::mlp::Tape;
    use crate::point_mass::{PointMass, planted_set};
    use crate::preset::Preset;

    const BEARINGS: [f32; 3] = [0.0, 120.0, 240.0];

    fn learning() -> (MetaTraining, InnerUpdate) {
        let config = Preset::Quick.config();
        (config.meta_train, InnerUpdate { batch_steps: 180, ..config.inner })
    }

    fn doubles(values: &[f32]) -> Vec<f64> {
        values.iter().map(|value| f64::from(*value)).collect()
    }

    /// A prior after a round, and the outcomes of the next.
    fn played(set: &DemonstrationSet) -> (MetaState, Vec<Rows>, PlayedRound) {
        let shape = PolicyShape { hidden: vec![6], initial_std: 0.5 };
        let state = MetaState::start(set, &shape, &[8], None, &Seed::new(1));
        let demonstrated = state.prior.demonstrated_pairs(set);
        let played = played_from(&state, set, &demonstrated);
        (state, demonstrated, played)
    }

    fn played_from(state: &MetaState, set: &DemonstrationSet, demonstrated: &[Rows]) -> PlayedRound {
        let (task, (_, inner)) = (PointMass::new(), learning());
        let playground = Playground::new(&task);
        let tasks: Vec<_> = set.ids().into_iter().map(|id| (id, EnvVariant(0))).collect();
        let (prior, weights, seed) = (&state.prior, &Weights::ones(set.len()), Seed::new(2));
        let round =
            Round { prior, tasks: &tasks, weights, playground: &playground, inner: &inner, seed: &seed };
        round.play(demonstrated, None).expect("finite numbers")
    }

    /// With a damping that dwarfs the Fisher matrix the step goes along the meta-gradient, which first order takes to be the
    /// mean over the demonstrations of ∇E[π_θ/π_θ'ᵢ · Âᵢ] at θ'ᵢ: here by finite differences in f64.
    #[test]
    fn eq_2_the_meta_step_follows_the_mean_gradient_at_the_adapted_parameters() {
        let set = planted_set(&BEARINGS, Seed::new(1)).expect("a valid set");
        let (state, _, played) = played(&set);
        let (training, inner) = learning();
        let region = TrustRegion { max_kl: 1e-6, damping: 1e6, ..TrustRegion::default() };
        let training = MetaTraining { trust_region: region, ..training };
        let mut policy = state.prior.policy.clone();
        let step = meta_update_policy(&mut policy, &played, &training, &inner).expect("finite numbers");
        let outcomes = played.outcomes;
        let advantages: Vec<Vec<f32>> = outcomes
            .iter()
            .map(|outcome| {
                let rewards = gail::imitation_rewards(&outcome.adapted.discriminator, &outcome.after.pairs);
                outcome.after.advantages(&rewards, &inner.advantage).expect("finite numbers")
            })
            .collect();
        let objective = |displacement: &[f64]| -> f64 {
            let surrogate = |(outcome, advantages): (&Outcome, &Vec<f32>)| {
                let adapted = &outcome.adapted.policy;
                let count = adapted.network().parameter_count();
                let observations = doubles(outcome.after.observations.flat());
                let log_probabilities = |shift: f64| {
                    let parameters: Vec<f64> = doubles(adapted.parameters())
                        .iter()
                        .zip(displacement)
                        .map(|(here, by)| here + shift * by)
                        .collect();
                    let (network, log_std) = parameters.split_at(count);
                    let mut tape = Tape::default();
                    let means = adapted.network().forward(network, &observations, &mut tape);
                    let rows = means.chunks_exact(2).zip(outcome.after.actions.iter());
                    rows.map(|(mean, action)| {
                        crate::nn::gaussian::log_probability(mean, log_std, &doubles(action))
                    })
                    .collect::<Vec<f64>>()
                };
                let (new, old) = (log_probabilities(1.0), log_probabilities(0.0));
                let ratios = new.iter().zip(old).map(|(new, old)| (new - old).exp());
                ratios.zip(advantages).map(|(ratio, by)| ratio * f64::from(*by)).sum::<f64>()
                    / advantages.len() as f64
            };
            outcomes.iter().zip(&advantages).map(surrogate).sum::<f64>() / outcomes.len() as f64
        };
        // The step's direction, scaled to the gradient's slope along it.
        let displacement = doubles(&step.displacement);
        let zeros = vec![0.0; displacement.len()];
        let squared: f64 = displacement.iter().map(|value| value * value).sum();
        let mut slope_objective = objective;
        let slope = crate::nn::check::derivative(&mut slope_objective, &zeros, &displacement);
        let gradient: Vec<f64> = displacement.iter().map(|value| value * slope / squared).collect();
        let error = gradient_error(objective, &zeros, &gradient);
        assert!(error < 1e-4, "error {error}");
        let moved = state.prior.policy.moved(&step.displacement);
        assert_eq!(policy, moved, "the step is taken from θ");
    }

    /// The gradient of Σᵢ E_τᵢ[−log D] + E_vᵢ[−log(1 − D)] − c·H at D'ᵢ, by finite differences in f64; Adam's first step
    /// goes against its sign.
    #[test]
    fn eq_3_the_meta_discriminator_goes_down_the_sum_of_the_adapted_losses() {
        let set = planted_set(&BEARINGS, Seed::new(1)).expect("a valid set");
        let (mut state, demonstrated, PlayedRound { outcomes, .. }) = played(&set);
        let (training, inner) = learning();
        let loss = |displacement: &[f64]| -> f64 {
            let of = |outcome: &Outcome| {
                let discriminator = &outcome.adapted.discriminator;
                let parameters: Vec<f64> = doubles(discriminator.parameters())
                    .iter()
                    .zip(displacement)
                    .map(|(here, by)| here + by)
                    .collect();
                let mean = |rows: &Rows, label: f64| {
                    let mut tape = Tape::default();
                    let pairs = doubles(rows.flat());
                    let logits = discriminator.network().forward(&parameters, &pairs, &mut tape);
                    let losses = logits.iter().map(|logit| {
                        let d = 1.0 / (1.0 + (-logit).exp());
                        let entropy = -d * d.ln() - (1.0 - d) * (1.0 - d).ln();
                        -label * d.ln()
                            - (1.0 - label) * (1.0 - d).ln()
                            - inner.discriminator.entropy * entropy
                    });
                    losses.sum::<f64>() / rows.len() as f64
                };
                mean(&outcome.after.pairs, 1.0) + mean(&demonstrated[outcome.demo.0], 0.0)
            };
            outcomes.iter().map(of).sum()
        };
        let before = state.prior.discriminator.parameters().to_vec();
        meta_update_discriminator(&mut state, &demonstrated, &outcomes, &training, &inner)
            .expect("finite numbers");
        let mut checked = 0;
        for (index, (before, after)) in before.iter().zip(state.prior.discriminator.parameters()).enumerate()
        {
            let mut direction = vec![0.0; state.prior.discriminator.parameters().len()];
            direction[index] = 1.0;
            let mut function = loss;
            let slope = crate::nn::check::derivative(&mut function, &vec![0.0; direction.len()], &direction);
            if slope.abs() > 1e-3 {
                let rate = training.discriminator_learning_rate;
                assert!((f64::from(after - before) + slope.signum() * rate).abs() < 0.02 * rate);
                checked += 1;
            }
        }
        assert!(checked > 30, "only {checked} slopes were large enough");
    }

    /// What counts three times moves θ and D_meta as what stands in the set three times, and as nothing else does.
    #[test]
    fn section_4_4_a_weight_counts_as_so_many_of_the_same_demonstration() {
        let planted = planted_set(&BEARINGS, Seed::new(1)).expect("a valid set");
        let set_of = |ids: &[usize]| {
            let demonstrations = ids.iter().map(|id| planted.get(DemoId(*id)).clone()).collect();
            DemonstrationSet::new(demonstrations).expect("a valid set")
        };
        let (training, inner) = learning();
        let updated = |ids: &[usize], weights: &[f64]| {
            // The filter of a set depends on how often a demonstration stands there, so the prior is that of one set.
            let (mut state, _, _) = played(&planted);
            let demonstrated = state.prior.demonstrated_pairs(&set_of(ids));
            let mut played = played_from(&state, &set_of(ids), &demonstrated);
            for (outcome, weight) in played.outcomes.iter_mut().zip(weights) {
                outcome.weight = *weight;
            }
            let mut policy = state.prior.policy.clone();
            let step = meta_update_policy(&mut policy, &played, &training, &inner).expect("finite numbers");
            meta_update_discriminator(&mut state, &demonstrated, &played.outcomes, &training, &inner)
                .expect("finite numbers");
            (step.displacement, state.prior.discriminator.parameters().to_vec())
        };
        let far = |one: &[f32], other: &[f32]| {
            let distance = |pair: (&f32, &f32)| f64::from(pair.0 - pair.1).powi(2);
            one.iter().zip(other).map(distance).sum::<f64>().sqrt()
        };
        let thrice = updated(&[0, 0, 0, 1], &[1.0; 4]);
        let weighed = updated(&[0, 1], &[3.0, 1.0]);
        let (alike, other) = (updated(&[0, 1], &[1.0; 2]), updated(&[0, 1], &[0.75, 0.25]));
        assert!(far(&weighed.0, &thrice.0) < 0.02 * far(&alike.0, &thrice.0));
        assert!(far(&weighed.1, &thrice.1) < 0.2 * far(&alike.1, &thrice.1));
        assert_eq!(weighed, other, "only the shares count");
    }

    #[test]
    fn algorithm_1_line_2_draws_distinct_demonstrations_and_in_time_every_variant() {
        let bearings: Vec<f32> = (0..9).map(|index| 40.0 * index as f32).collect();
        let set = planted_set(&bearings, Seed::new(1)).expect("a valid set");
        let task = PointMass::with_goals(3);
        let playground = Playground::new(&task);
        let (mut demos, mut variants) = (vec![0; 9], vec![0; 3]);
        for number in 0..100 {
            let tasks = tasks_of_round(&set, &playground, 4, Seed::new(number));
            assert_eq!(tasks.len(), 4);
            assert!(tasks.is_sorted_by(|a, b| a.0 < b.0), "each demonstration once");
            for (demo, variant) in tasks {
                demos[demo.0] += 1;
                variants[variant.0] += 1;
            }
        }
        assert!(demos.iter().all(|count| (20..70).contains(count)), "{demos:?}");
        assert!(variants.iter().all(|count| (90..180).contains(count)), "{variants:?}");
        let whole = tasks_of_round(&set, &playground, 10, Seed::new(1));
        assert_eq!(whole.iter().map(|(demo, _)| *demo).collect::<Vec<_>>(), set.ids());
    }

    /// The same trajectories before, the same draws after: what is demonstrated twice comes out twice.
    #[test]
    fn algorithm_1_lines_4_to_17_use_the_same_random_numbers_for_every_demonstration() {
        let planted = planted_set(&BEARINGS, Seed::new(1)).expect("a valid set");
        let twice = [0, 1, 0].map(|id| planted.get(DemoId(id)).clone());
        let set = DemonstrationSet::new(twice.to_vec()).expect("a valid set");
        let (_, _, PlayedRound { outcomes, .. }) = played(&set);
        assert_eq!(outcomes[0].adapted, outcomes[2].adapted);
        assert_eq!(outcomes[0].after.scores, outcomes[2].after.scores);
        assert_ne!(outcomes[0].adapted, outcomes[1].adapted);
        assert_eq!(outcomes[0].update.score, outcomes[1].update.score, "played once before");
    }

    #[test]
    fn appendix_a_2_1_ten_demonstrations_a_round_and_two_thousand_rounds() {
        let training = Preset::Paper.config().meta_train;
        assert_eq!((training.meta_batch, training.rounds), (10, 2000));
        let set = planted_set(&[0.0; 8], Seed::new(1)).expect("a valid set");
        let task = PointMass::new();
        let tasks = tasks_of_round(&set, &Playground::new(&task), training.meta_batch, Seed::new(1));
        assert_eq!(tasks.len(), 8, "the whole set where it is smaller");
    }
}

//! Meta-imitation-learning (§4.1, §4.2; Algorithm 1): a policy and a discriminator that adapt to any demonstration.
//!
//! Each round adapts the meta-parameters to every demonstration of a batch by one inner update, moves the adapted policies
//! so that their behavior tells what they imitated (if mutual information regularizes), plays them, and moves the
//! meta-parameters so that the adapted policies would have imitated better.
//!
//! | Algorithm 1 | here |
//! |---|---|
//! | 1: initialize θ, Q, D_meta | [`MetaState::start`], or [`MetaState::from_prior`] where θ and D_meta know something |
//! | 2, 5: sample a batch of demonstrations, and of environments for each | [`targets_of_round`] |
//! | 3: while not done | [`meta_train`] |
//! | 4, 6, 16, 17: for all v_i, for all e_j | the parallel loops in the steps of [`Round::play`] |
//! | 7: sample K trajectories using f_θ | [`play_before`]: with common random numbers they are the same for every v_i, so they are played once per variant |
//! | 8, 9: θ'_i, D'_meta,i | [`adapt::update`] in [`imitate`] |
//! | 10 to 14: Q, θ''_i | [`regularize`], line by line in its file; without it θ''_i is θ'_i |
//! | 15: sample K trajectories using f_θ''_i | [`play_adapted`] |
//! | 18: meta-update θ as (2) | [`meta_update::meta_update_policy`], each demonstration counting c_i (§4.4); [`cloning::meta_update`] by behavioral cloning |
//! | 19: meta-update D_meta as (3) | [`meta_update::meta_update_discriminator`], the same |
//!
//! Where we differ: the box updates D before it needs it (line 8 uses what line 9 makes), so line 9 comes first;
//! the meta-gradients are of first order by default, which Eq. 3 is as written.
//! With [`Order::Second`] that of θ is exact, through the plain steps of behavioral cloning; through GAIL's natural-gradient
//! step it ranked worse wherever it was tried.
//! What line 14 adds is held fixed too.
//! Under behavioral cloning lines 8 and 18 are supervised learning, line 19 has no discriminator to move, and nothing is
//! played but for the curve and for mutual information, whose line 14 is a policy gradient as for GAIL (§4.2).
//! The batch of line 2 is drawn again in each round, and line 5 draws one variant for each demonstration: with few
//! trajectories, more rounds say more than more variants in each.

mod cloning;
mod cost;
mod meta_update;
mod regularize;
mod report;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::basics::observer::{Event, Observer, is_due};
use crate::basics::seed::Seed;
use crate::data::demonstration::DemonstrationSet;
use crate::data::weights::Weights;
use crate::learning::adapt::{self, InnerUpdate, Learner, MetaPrior, Played, Target, UpdateReport, Updated};
use crate::learning::mutual_information::{self, Sequences};
use crate::learning::trpo::TrustRegion;
use crate::math::nn::adam::Adam;
use crate::math::rows::Rows;
use crate::world::environment::EnvVariant;
use crate::world::policy::PolicyShape;
use crate::world::rollout::Playground;

pub use cost::steps_by_round;
use meta_update::meta_update;
pub use regularize::{MutualInformation, PosteriorState};
use regularize::{Regularizer, regularize};
pub(crate) use report::ENCODING_EXPLAINED;
use report::{behavior_spread, report};

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
    /// Whether the meta-gradient of θ goes through the inner update (Eq. 2), which it can by behavioral cloning, or stops at
    /// θ'_i (as Eq. 3 does for D_meta).
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
    /// ∇_θ L(f_θ'_i), through the inner update; by behavioral cloning only.
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

/// What is learned with.
#[derive(Clone, Copy, Debug)]
pub struct Learning<'a> {
    /// The rounds and their meta-updates.
    pub training: &'a MetaTraining,
    /// The inner update.
    pub inner: &'a InnerUpdate,
    /// Mutual information, where it regularizes.
    pub information: Option<&'a MutualInformation>,
}

impl Learning<'_> {
    /// The same without mutual information.
    #[must_use]
    pub fn plain(self) -> Self {
        Self { information: None, ..self }
    }
}

/// Name of the stage in events.
pub const STAGE: &str = "meta_train";

/// Algorithm 1, continued from where `state` stands; its prior is what comes of it.
///
/// ```
/// use demosift::basics::observer::Silent;
/// use demosift::basics::seed::Seed;
/// use demosift::run::preset::Preset;
/// use demosift::stages::meta_train::{Learning, MetaState, meta_train};
/// use demosift::world::point_mass::{PointMass, planted_set};
/// use demosift::world::rollout::Playground;
///
/// let set = planted_set(&[180.0, 10.0, 120.0], Seed::new(1))?;
/// let task = PointMass::new();
/// let playground = Playground::new(&task);
/// let mut config = Preset::Quick.config();
/// config.inner.batch_steps = 300;
///
/// let mut train = |rounds, state| {
///     config.meta_train.rounds = rounds;
///     let learning = Learning { training: &config.meta_train, inner: &config.inner, information: None };
///     meta_train(&set, &playground, &learning, state, &Seed::new(7), &mut Silent)
/// };
/// let shape = Preset::Quick.config().policy;
/// let start = MetaState::start(&set, &shape, &[32, 32], None, &Seed::new(7).of("start"));
/// let trained = train(3, start.clone())?;
///
/// // What judging takes is `trained.prior`, a policy and a discriminator that adapt quickly.
/// assert_ne!(trained.prior, start.prior);
/// // The state is complete: stopping after two rounds and going on gives the same bits.
/// let halfway = train(2, start)?;
/// assert_eq!(train(3, halfway)?, trained);
/// # Ok::<(), demosift::Error>(())
/// ```
pub fn meta_train(
    set: &DemonstrationSet,
    playground: &Playground<'_>,
    learning: &Learning<'_>,
    mut state: MetaState,
    seed: &Seed,
    observer: &mut dyn Observer,
) -> Result<MetaState> {
    let Learning { training, inner, information } = *learning;
    let demonstrated = state.prior.demonstrated_pairs(set);
    let encodings = mutual_information::encodings(set);
    observer.on(Event::Started { stage: STAGE, done: state.rounds, total: training.rounds })?;
    while state.rounds < training.rounds {
        let number = state.rounds;
        let during = |error: Error| error.during(&format!("meta-training, round {number}"));
        let targets = targets_of_round(set, playground, training.meta_batch, seed.of("batch").at(number));
        let seed = seed.of("round").at(number);
        let weights = &state.weights;
        let round = Round { prior: &state.prior, targets: &targets, weights, playground, inner, seed: &seed };
        let regularizer = information.zip(state.posterior.as_mut()).map(|(how, state)| Regularizer {
            how,
            state,
            encodings: &encodings,
        });
        let played = round.play(&demonstrated, regularizer).map_err(during)?;
        let updated = meta_update(&mut state, &demonstrated, &played, learning).map_err(during)?;
        state.rounds += 1;
        state.environment_steps += played.environment_steps as u64;
        report(&state, &played, updated, observer)?;
        if is_due(state.rounds, training.checkpoint_every) {
            observer.on(Event::Checkpoint { stage: STAGE, part: "", state: &state })?;
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
        let weights = Weights::ones(set);
        Self { rounds: 0, prior, policy_adam, discriminator_adam, environment_steps: 0, posterior, weights }
    }
}

/// The result of one demonstration under one variant in a round.
struct Outcome {
    target: Target,
    /// c_i.
    weight: f64,
    adapted: Learner,
    after: Played,
    update: UpdateReport,
}

/// The result of a round.
struct PlayedRound {
    outcomes: Vec<Outcome>,
    information: Option<regularize::Report>,
    behavior_spread: Option<f64>,
    environment_steps: usize,
}

/// Lines 2 and 5: which demonstrations and variants this round is about.
fn targets_of_round(
    set: &DemonstrationSet,
    playground: &Playground<'_>,
    meta_batch: usize,
    seed: Seed,
) -> Vec<Target> {
    use rand::seq::{IndexedRandom, SliceRandom};
    let mut rng = seed.into_rng();
    let mut ids = set.ids();
    if meta_batch < ids.len() {
        ids.shuffle(&mut rng);
        ids.truncate(meta_batch);
        ids.sort_unstable();
    }
    let variants = playground.specification().variant_ids();
    let mut draw = || *variants.choose(&mut rng).expect("a task has a variant");
    ids.into_iter().map(|demo| Target { demo, variant: draw() }).collect()
}

/// The variants of some targets, each once.
fn variants(targets: &[Target]) -> Vec<EnvVariant> {
    let mut variants: Vec<EnvVariant> = targets.iter().map(|target| target.variant).collect();
    variants.sort_unstable();
    variants.dedup();
    variants
}

/// What a round is about.
struct Round<'a> {
    prior: &'a MetaPrior,
    targets: &'a [Target],
    weights: &'a Weights,
    playground: &'a Playground<'a>,
    inner: &'a InnerUpdate,
    seed: &'a Seed,
}

/// What θ does under a variant; with common random numbers it is the same for every v_i.
type Before = (EnvVariant, Played);

/// θ'_i and D'_meta,i, and after line 14 θ''_i.
struct Imitator {
    target: Target,
    adapted: Learner,
    update: UpdateReport,
}

impl Round<'_> {
    /// Lines 4 to 17.
    fn play(&self, demonstrated: &[Rows], regularizer: Option<Regularizer<'_>>) -> Result<PlayedRound> {
        let before = play_before(self)?;
        let mut imitators = imitate(self, &before, demonstrated)?;
        let information =
            regularizer.map(|regularizer| regularize(self, &mut imitators, regularizer)).transpose()?;
        let outcomes = play_adapted(self, imitators)?;
        let played = before.iter().map(|(_, before)| before).chain(outcomes.iter().map(|one| &one.after));
        let environment_steps = played.map(|played| played.observations.len()).sum::<usize>()
            + information.as_ref().map_or(0, |report| report.environment_steps);
        let behavior_spread = behavior_spread(self, &outcomes);
        Ok(PlayedRound { outcomes, information, behavior_spread, environment_steps })
    }

    /// The variants that it is about, each once.
    fn variants(&self) -> Vec<EnvVariant> {
        variants(self.targets)
    }

    fn horizon(&self) -> usize {
        self.playground.specification().horizon
    }

    /// Episodes as sequences of equal length.
    fn read(&self, played: &Played, readings: usize) -> Sequences {
        Sequences::read(&played.observations, &played.lengths, self.horizon(), readings)
    }
}

/// Line 7: what θ does under each variant of the round.
fn play_before(round: &Round<'_>) -> Result<Vec<Before>> {
    let play = |variant: EnvVariant| {
        let policy = &round.prior.policy;
        let seed = round.seed.of("before").at(variant.0);
        let trajectories = round.inner.play(round.playground, policy, variant, seed)?;
        Ok((variant, Played::new(round.playground, policy, &trajectories)))
    };
    round.variants().into_par_iter().map(play).collect()
}

/// Lines 8 and 9.
fn imitate(round: &Round<'_>, before: &[Before], demonstrated: &[Rows]) -> Result<Vec<Imitator>> {
    let Round { prior, targets, inner, seed, .. } = *round;
    let imitate = |target: &Target| {
        let before = before_under(before, target.variant);
        let mut adam = inner.adam(prior);
        let seed = seed.of("after").at(target.variant.0).of("fit");
        let demonstrated = &[&demonstrated[target.demo.0]];
        let Updated { learner: adapted, report: update } =
            adapt::update(prior, before, demonstrated, inner, inner.alpha(0), &mut adam, seed)?;
        Ok(Imitator { target: *target, adapted, update })
    };
    targets.par_iter().map(imitate).collect()
}

/// Line 15.
fn play_adapted(round: &Round<'_>, imitators: Vec<Imitator>) -> Result<Vec<Outcome>> {
    let play = |Imitator { target, adapted, update }| {
        let seed = round.seed.of("after").at(target.variant.0).of("play");
        let trajectories = round.inner.play(round.playground, &adapted.policy, target.variant, seed)?;
        let after = Played::new(round.playground, &adapted.policy, &trajectories);
        Ok(Outcome { target, weight: round.weights.of(target.demo), adapted, after, update })
    };
    imitators.into_par_iter().map(play).collect()
}

fn before_under(before: &[Before], variant: EnvVariant) -> &Played {
    let found = before.iter().find(|(played, _)| *played == variant);
    &found.expect("played for every variant of the round").1
}

fn total_weight(outcomes: &[Outcome]) -> f64 {
    outcomes.iter().map(|outcome| outcome.weight).sum()
}

#[cfg(test)]
mod tests;

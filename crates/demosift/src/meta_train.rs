//! Meta-imitation-learning (§4.1; Algorithm 1 without lines 10 to 14): a policy and a discriminator that adapt to any demonstration.
//!
//! Each round adapts the meta-parameters to every demonstration of a batch by one inner update, plays the adapted
//! policies, and moves the meta-parameters so that the adapted policies would have imitated better.
//!
//! | Algorithm 1 | here |
//! |---|---|
//! | 1: initialize θ, D_meta | [`MetaState::start`] |
//! | 2: sample a batch of demonstrations | [`tasks_of_round`] |
//! | 4–6: for all v_i, for all e_j | the parallel loop in [`round`] |
//! | 7: sample K trajectories using f_θ | `before` in [`round`]: with common random numbers they are the same for every v_i, so they are played once per variant |
//! | 8, 9: θ'_i, D'_meta,i | [`adapt::update`] in [`adapt_and_play`] |
//! | 15: sample K trajectories using the adapted policy | [`adapt_and_play`] |
//! | 18: meta-update θ as (2) | [`meta_update_policy`] |
//! | 19: meta-update D_meta as (3) | [`meta_update_discriminator`] |
//!
//! Where we differ: the box updates D before it needs it (line 8 uses what line 9 makes), so line 9 comes first;
//! the meta-gradients are of first order, which Eq. 3 is as written.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::adapt::{self, InnerUpdate, Learner, MetaPrior, Played, UpdateReport};
use crate::demonstration::{DemoId, DemonstrationSet};
use crate::environment::EnvVariant;
use crate::error::{Error, Result};
use crate::gail;
use crate::nn::adam::Adam;
use crate::observer::{Event, Observer};
use crate::policy::{Policy, PolicyShape};
use crate::rollout::{self, Acting, Playground};
use crate::rows::Rows;
use crate::seed::Seed;
use crate::trpo::{self, Step, TrustRegion};

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
    /// β of D_meta, Adam's step size; not in the paper.
    pub discriminator_learning_rate: f64,
    /// Widths of the discriminator's hidden layers (Table 3: 100, 100).
    pub discriminator_hidden: Vec<usize>,
    /// Rounds between two checkpoints.
    pub checkpoint_every: usize,
}

/// Where meta-training stands after some rounds; from here it goes on to the identical result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MetaState {
    /// Rounds that are finished.
    pub rounds: usize,
    /// θ and D_meta.
    pub prior: MetaPrior,
    /// Moments of D_meta's Adam.
    pub discriminator_adam: Adam,
}

/// Name of the stage in events.
pub const STAGE: &str = "meta_train";

/// Algorithm 1 without its mutual-information lines.
pub fn meta_train(
    set: &DemonstrationSet,
    playground: &Playground<'_>,
    (training, inner): (&MetaTraining, &InnerUpdate),
    mut state: MetaState,
    seed: &Seed,
    observer: &mut dyn Observer,
) -> Result<MetaPrior> {
    let demonstrated = state.prior.demonstrated_pairs(set);
    observer.on(Event::Started { stage: STAGE, done: state.rounds, total: training.rounds });
    while state.rounds < training.rounds {
        let tasks = tasks_of_round(set, playground, training.meta_batch, seed.of("batch").at(state.rounds));
        let round_seed = seed.of("round").at(state.rounds);
        let outcomes = round(&state.prior, &demonstrated, &tasks, playground, inner, &round_seed)
            .map_err(|error| error.during(&format!("meta-training, round {}", state.rounds)))?;
        let step = meta_update_policy(&mut state.prior.policy, &outcomes, inner, &training.trust_region)?;
        meta_update_discriminator(&mut state, &demonstrated, &outcomes, training, inner)?;
        state.rounds += 1;
        report(&state, &outcomes, &step, observer);
        if state.rounds.is_multiple_of(training.checkpoint_every.max(1)) {
            observer.on(Event::Checkpoint { stage: STAGE, part: "", state: &state });
        }
    }
    Ok(state.prior)
}

impl MetaState {
    /// Line 1: random θ, undecided D_meta, behind the filter of the whole set.
    pub fn start(
        set: &DemonstrationSet,
        shape: &PolicyShape,
        discriminator_hidden: &[usize],
        seed: &Seed,
    ) -> Self {
        let prior = Learner::untrained(set, shape, discriminator_hidden, seed);
        let discriminator_adam = Adam::new(prior.discriminator.parameters().len());
        Self { rounds: 0, prior, discriminator_adam }
    }
}

/// What came of one demonstration under one variant in a round.
struct Outcome {
    demo: DemoId,
    adapted: Learner,
    after: Played,
    update: UpdateReport,
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

/// Lines 4 to 17.
fn round(
    prior: &MetaPrior,
    demonstrated: &[Rows],
    tasks: &[(DemoId, EnvVariant)],
    playground: &Playground<'_>,
    inner: &InnerUpdate,
    seed: &Seed,
) -> Result<Vec<Outcome>> {
    let mut variants: Vec<EnvVariant> = tasks.iter().map(|(_, variant)| *variant).collect();
    variants.sort_unstable();
    variants.dedup();
    let before: Vec<(EnvVariant, Played)> = variants
        .into_par_iter()
        .map(|variant| {
            let seeds = seed.of("before").at(variant.0).many(inner.trajectories);
            let trajectories = rollout::play(playground, &prior.policy, Acting::Sampled, variant, seeds)?;
            Ok((variant, Played::new(playground, &prior.policy, &trajectories)))
        })
        .collect::<Result<_>>()?;
    tasks
        .par_iter()
        .map(|(demo, variant)| {
            let (_, before) = before.iter().find(|(played, _)| played == variant).expect("played above");
            let seed = seed.of("after").at(variant.0);
            adapt_and_play(
                prior,
                (*demo, &demonstrated[demo.0]),
                before,
                playground,
                (*variant, inner),
                &seed,
            )
        })
        .collect()
}

/// Lines 8, 9 and 15 for one demonstration.
fn adapt_and_play(
    prior: &MetaPrior,
    (demo, demonstrated): (DemoId, &Rows),
    before: &Played,
    playground: &Playground<'_>,
    (variant, inner): (EnvVariant, &InnerUpdate),
    seed: &Seed,
) -> Result<Outcome> {
    let mut adam = Adam::new(prior.discriminator.parameters().len());
    let (adapted, update) =
        adapt::update(prior, before, &[demonstrated], (inner, inner.alpha(0)), &mut adam)?;
    let seeds = seed.of("play").many(inner.trajectories);
    let trajectories = rollout::play(playground, &adapted.policy, Acting::Sampled, variant, seeds)?;
    let after = Played::new(playground, &adapted.policy, &trajectories);
    Ok(Outcome { demo, adapted, after, update })
}

/// Line 18, Eq. 2, first order: θ moves as all adapted θ'_i would move together to imitate better.
fn meta_update_policy(
    policy: &mut Policy,
    outcomes: &[Outcome],
    inner: &InnerUpdate,
    region: &TrustRegion,
) -> Result<Step> {
    let advantages: Vec<Vec<f32>> = outcomes
        .par_iter()
        .map(|outcome| {
            let rewards = gail::imitation_rewards(&outcome.adapted.discriminator, &outcome.after.pairs);
            outcome.after.advantages(&rewards, &inner.advantage)
        })
        .collect::<Result<_>>()?;
    let weight = 1.0 / outcomes.len() as f64;
    let experiences: Vec<_> = outcomes
        .iter()
        .zip(&advantages)
        .flat_map(|(outcome, advantages)| {
            outcome.after.experiences(&outcome.adapted.policy, advantages, weight)
        })
        .collect();
    let step = trpo::step(&experiences, region, 1.0)?;
    *policy = policy.moved(&step.displacement);
    Ok(step)
}

/// Line 19, Eq. 3: D_meta ← D_meta − β Σ_i (Ê_τi[∇ −log D'_i] + Ê_vi[∇ −log(1 − D'_i)]), the step taken by Adam.
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
    for part in &gradients {
        gradient.iter_mut().zip(part).for_each(|(sum, value)| *sum += value / outcomes.len() as f32);
    }
    if gradient.iter().any(|value| !value.is_finite()) {
        return Err(Error::diverged("the gradient of the meta-discriminator is not a finite number"));
    }
    let mut parameters = state.prior.discriminator.parameters().to_vec();
    state.discriminator_adam.descend(training.discriminator_learning_rate as f32, &gradient, &mut parameters);
    state.prior.discriminator = state.prior.discriminator.with_parameters(parameters);
    Ok(())
}

fn report(state: &MetaState, outcomes: &[Outcome], step: &Step, observer: &mut dyn Observer) {
    let mean =
        |value: &dyn Fn(&Outcome) -> f64| outcomes.iter().map(value).sum::<f64>() / outcomes.len() as f64;
    let after =
        |outcome: &Outcome| outcome.after.scores.iter().sum::<f64>() / outcome.after.scores.len() as f64;
    observer.on(Event::Measured {
        stage: STAGE,
        part: "",
        iteration: state.rounds,
        numbers: &[
            ("score_before", mean(&|outcome| outcome.update.score)),
            ("score_after", mean(&after)),
            ("discriminator_loss", mean(&|outcome| outcome.update.discriminator_loss)),
            ("discriminator_accuracy", mean(&|outcome| outcome.update.discriminator_accuracy)),
            ("reward_mean", mean(&|outcome| outcome.update.reward_mean)),
            ("reward_std", mean(&|outcome| outcome.update.reward_std)),
            ("inner_kl", mean(&|outcome| outcome.update.kl)),
            ("meta_kl", step.kl),
            ("meta_improvement", step.improvement),
        ],
    });
    observer.on(Event::Advanced { stage: STAGE, done: state.rounds });
}

//! Pre-training (§5, Avg Fine-Tune): θ and D that imitate the entire set, to be fine-tuned toward each demonstration.
//!
//! All demonstrations are imitated together, by the same learner and the same inner update as in meta-training; what comes
//! out stands where the meta-parameters do, and judging fine-tunes it as it adapts those.
//!
//! The paper says no more than "a set of parameters pre-trained using the entire demonstration set".
//! What we take: Adam keeps its moments throughout, as during an adaptation, and variants take turns.

use serde::{Deserialize, Serialize};

use crate::basics::error::Result;
use crate::basics::observer::{Event, Observer, is_due};
use crate::basics::seed::Seed;
use crate::data::demonstration::DemonstrationSet;
use crate::learning::adapt::{self, InnerUpdate, MetaPrior, Played, Updated};
use crate::math::nn::adam::Adam;
use crate::math::rows::Rows;
use crate::world::environment::EnvVariant;
use crate::world::rollout::Playground;

/// Where pre-training stands after some updates; from here it goes on to the identical result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PreTrainState {
    /// Updates that are finished.
    pub updates: usize,
    /// θ and D.
    pub prior: MetaPrior,
    /// Moments of Adam: D's, or by behavioral cloning the policy's.
    pub adam: Adam,
}

/// How long is pre-trained, and how each update is made.
#[derive(Clone, Copy, Debug)]
pub struct PreTraining<'a> {
    /// Updates in all.
    pub updates: usize,
    /// One of them.
    pub inner: &'a InnerUpdate,
    /// Updates between two checkpoints.
    pub checkpoint_every: usize,
}

/// Name of the stage in events.
pub const STAGE: &str = "pre_train";

/// θ and D after they imitated the entire set, continued from where `state` stands.
pub fn pre_train(
    set: &DemonstrationSet,
    playground: &Playground<'_>,
    training: PreTraining<'_>,
    mut state: PreTrainState,
    seed: &Seed,
    observer: &mut dyn Observer,
) -> Result<MetaPrior> {
    let pairs = state.prior.demonstrated_pairs(set);
    let demonstrated: Vec<&Rows> = set.ids().iter().map(|id| &pairs[id.0]).collect();
    observer.on(Event::Started { stage: STAGE, done: state.updates, total: training.updates })?;
    while state.updates < training.updates {
        improve(&mut state, &demonstrated, playground, training.inner, seed, observer)
            .map_err(|error| error.during(&format!("pre-training, update {}", state.updates)))?;
        observer.on(Event::Advanced { stage: STAGE, done: state.updates })?;
        if is_due(state.updates, training.checkpoint_every) {
            observer.on(Event::Checkpoint { stage: STAGE, part: "", state: &state })?;
        }
    }
    Ok(state.prior)
}

/// Environment steps of an update, where episodes last to the horizon.
pub fn steps_of_update(inner: &InnerUpdate, horizon: usize) -> u64 {
    (inner.episodes(horizon) * horizon) as u64
}

impl PreTrainState {
    /// Before the first update of a learner.
    pub fn start(prior: MetaPrior, inner: &InnerUpdate) -> Self {
        Self { updates: 0, adam: inner.adam(&prior), prior }
    }
}

/// Plays and makes one update.
fn improve(
    state: &mut PreTrainState,
    demonstrated: &[&Rows],
    playground: &Playground<'_>,
    inner: &InnerUpdate,
    seed: &Seed,
    observer: &mut dyn Observer,
) -> Result<()> {
    let specification = playground.specification();
    let variant = EnvVariant(state.updates % specification.variants.len());
    let policy = &state.prior.policy;
    let trajectories = inner.play(playground, policy, variant, seed.of("play").at(state.updates))?;
    let played = Played::new(playground, policy, &trajectories);
    let (alpha, fit_seed) = (inner.alpha(state.updates), seed.of("fit").at(state.updates));
    let Updated { learner, report, .. } =
        adapt::update(&state.prior, &played, demonstrated, inner, alpha, &mut state.adam, fit_seed)?;
    state.prior = learner;
    state.updates += 1;
    observer.on(Event::Measured {
        stage: STAGE,
        part: "",
        iteration: state.updates,
        numbers: &report.numbers(),
    })
}

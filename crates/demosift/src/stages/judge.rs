//! Judging (§4.3; Algorithm 2): how much better does imitating each demonstration make the agent at the task?
//!
//! Every demonstration is adapted to from the same parameters, with the same random numbers, and the adapted policy is
//! scored by the task's heuristic on the same evaluation episodes as the parameters themselves.
//!
//! | Algorithm 2 | here |
//! |---|---|
//! | 1, 2: for all e_j, for all v_i | [`units`], each with its repeats |
//! | 3, 4: θ_ij ← θ, D_i ← D_meta | [`Start`] |
//! | 5–10: adapt | [`crate::learning::adapt::adapt`] in [`judge_unit`] |
//! | 11: evaluate θ_ij for M random seeds | [`judge_unit`] |
//! | 12: S = K(after) − K(before) (Eq. 8) | [`Suitability::gain`] |
//! | 14: i_opt (Eq. 9) | [`crate::stages::select`] |
//!
//! Where we differ: an adaptation is repeated with other random numbers and the outcomes are pooled, and what scores it are
//! the batches that its last θ played before they were updated, or evaluation episodes of the mean of these θ
//! ([`ScoredOn`]), since a single θ of one short adaptation is a noisy witness.
//! Repeats go where they are needed: who surely belongs to one side of the cut gets no more of them (`race.rs`).
//! θ may also be a policy that knows nothing: one and the same where judging from scratch is a method of the paper (§5.4), and drawn
//! again for each repeat where demonstrations are cloned.
//! Somebody else's trainer may imitate in place of our updates ([`Imitating`]); its policies are played, and not kept.

mod collecting;
mod crew;
mod effort;
mod imitating;
mod race;
mod scores;
mod unit;

pub use crew::{Crew, HandIn, JudgeUnit, ShareOfThreads, Threads};
pub use effort::Effort;
pub use imitating::Imitating;
pub use scores::{AdaptedPolicy, Evaluated, Judged, ScoreTable, Suitability};
pub use unit::{Outcome, Unit, is_kept_whole, judge_unit};

use std::borrow::Cow;
use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use collecting::Collecting;

use crate::basics::error::Result;
use crate::basics::observer::{Event, Observer};
use crate::basics::seed::Seed;
use crate::data::demonstration::{DemoId, DemonstrationSet};
use crate::data::observation_filter::ObservationFilter;
use crate::learning::adapt::{InnerUpdate, Learner, MetaPrior, Rule};
use crate::math::statistics::mean_or_zero;
use crate::world::environment::{EnvVariant, Episode, Rollout};
use crate::world::heuristic::Score;
use crate::world::policy::{Policy, PolicyShape};
use crate::world::rollout::{self, Acting, Playground};
use crate::world::trainer::TrainerIdentity;

/// How demonstrations are judged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Judging {
    /// max_iter: inner updates per adaptation (§4.3: a few).
    pub iterations: usize,
    /// How many last θ of an adaptation count: their mean is what is kept and evaluated, and their batches score it; not in
    /// the paper.
    pub averaged: usize,
    /// What scores an adaptation.
    #[serde(default)]
    pub scored_on: ScoredOn,
    /// M: evaluation seeds (Algorithm 2 line 11), fewer where episodes are long ([`episodes`](Self::episodes)); not in the
    /// paper.
    pub evaluations: usize,
    /// Adaptations per demonstration and variant, each with its own random numbers; not in the paper.
    pub repeats: usize,
    /// Up to how many adaptations a demonstration gets while it may still belong to either side of the cut; none are added
    /// where this is not more than `repeats`. Not in the paper.
    pub most_repeats: usize,
    /// How the policy acts when it is evaluated; sampling is what Algorithm 2 says, and shows what the mean action hides:
    /// an agent that imitates a noisy demonstration becomes as noisy. Batches that score are always sampled, as they are what is
    /// learned from, so there it changes replays and the adapted behaviors distance alone.
    pub acting: Acting,
}

/// What scores an adaptation (Algorithm 2, line 11).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ScoredOn {
    /// The M evaluation episodes of what came of it, as in the paper.
    #[default]
    Evaluations,
    /// The episodes of the batches that its last updates learned from, which cost nothing more and are many more episodes;
    /// not in the paper. An adaptation of which no batches or one would count has evaluation episodes.
    LastBatches,
}

/// A thousand steps say more of an agent than sixty, so an evaluation takes no more than about so many ...
const EVALUATION_STEPS: usize = 5000;

/// ... but so many episodes it always has.
const LEAST_EVALUATIONS: usize = 5;

impl Judging {
    /// How many of the M evaluation episodes are played where one may last so many steps.
    pub fn episodes(&self, horizon: usize) -> usize {
        self.evaluations.min((EVALUATION_STEPS / horizon).max(LEAST_EVALUATIONS))
    }

    /// Which iterations play the batches that score an adaptation by these updates; none where evaluation episodes do.
    pub fn scoring_batches(&self, inner: &InnerUpdate) -> std::ops::Range<usize> {
        match (self.scored_on, inner.imitation, self.averaged.min(self.iterations)) {
            (ScoredOn::LastBatches, Rule::Gail, last) if last > 1 => self.iterations - last..self.iterations,
            _ => 0..0,
        }
    }
}

/// θ and D before a demonstration is imitated (Algorithm 2, lines 3 and 4).
#[derive(Clone, Copy, Debug)]
pub enum Start<'a> {
    /// The meta-parameters, the same in every repeat.
    Prior(&'a MetaPrior),
    /// A learner that knows nothing, another one in every repeat; the same for all demonstrations.
    Untrained {
        /// Of its policy.
        shape: &'a PolicyShape,
        /// Widths of its discriminator's hidden layers.
        discriminator_hidden: &'a [usize],
        /// Through which it sees observations.
        filter: &'a ObservationFilter,
    },
}

impl<'a> Start<'a> {
    /// From where a repeat starts; `seed` is that of judging.
    pub fn learner(&self, set: &DemonstrationSet, repeat: usize, seed: &Seed) -> Cow<'a, Learner> {
        match self {
            Self::Prior(prior) => Cow::Borrowed(*prior),
            Self::Untrained { shape, discriminator_hidden, filter } => {
                let (seed, hidden) = (seed.of("start").at(repeat), discriminator_hidden);
                Cow::Owned(Learner::untrained_behind(filter, set.action_size(), shape, hidden, &seed))
            }
        }
    }

    /// How many different ones so many repeats start from.
    fn count(&self, repeats: usize) -> usize {
        match self {
            Self::Prior(_) => 1,
            Self::Untrained { .. } => repeats,
        }
    }
}

/// What is judged, and how.
#[derive(Clone, Copy)]
pub struct Trial<'a> {
    /// V.
    pub set: &'a DemonstrationSet,
    /// Which of it are judged, ascending.
    pub demos: &'a [DemoId],
    /// E with K.
    pub playground: &'a Playground<'a>,
    /// θ with D_meta.
    pub start: Start<'a>,
    /// How a demonstration is imitated.
    pub imitating: Imitating<'a>,
    /// How long, how often and on what it is evaluated.
    pub judging: &'a Judging,
    /// K of the top K of those that are judged: further repeats must separate these from the others.
    pub cut: usize,
    /// Names this judging among others in events.
    pub part: &'a str,
    /// All random numbers.
    pub seed: &'a Seed,
}

impl Trial<'_> {
    /// Whether the first repeats keep their policies: not those of many demonstrations, and not somebody else's.
    pub fn keeps_policies(&self) -> bool {
        is_kept_whole(self.demos.len()) && self.imitating.trainer().is_none()
    }
}

/// Where judging stands; from here it goes on to the identical result.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JudgingState {
    finished: BTreeMap<Unit, Outcome>,
    /// Who imitated, where that was somebody else's trainer.
    trainer: Option<TrainerIdentity>,
}

impl JudgingState {
    /// Units that are finished.
    pub fn done(&self) -> usize {
        self.finished.len()
    }

    /// Demonstrations among them, each as often as it was imitated.
    pub fn imitated(&self) -> usize {
        self.finished.keys().filter(|unit| unit.demo.is_some()).count()
    }

    /// The same where it is of this trainer, or of ours where there is none; else a new one: what another has imitated says
    /// nothing of this one.
    #[must_use]
    pub fn if_by(self, trainer: Option<&TrainerIdentity>) -> Self {
        match self.trainer.as_ref() == trainer {
            true => self,
            false => Self { finished: BTreeMap::new(), trainer: trainer.cloned() },
        }
    }

    /// Takes over the units that another state of the same judging has finished; of one that both have, either will do.
    pub fn take_over(&mut self, other: Self) {
        self.finished.extend(other.finished);
    }

    /// Environment steps that the finished units took, however often the run was killed between them.
    pub fn played(&self) -> u64 {
        self.finished.values().map(|outcome| outcome.played).sum()
    }
}

/// Name of the stage in events.
pub const STAGE: &str = "judge";

/// Algorithm 2, continued from what `state` already holds.
///
/// The crew judges each unit as a whole; what comes out does not depend on who is in it.
///
/// ```
/// use demosift::basics::observer::Silent;
/// use demosift::basics::seed::Seed;
/// use demosift::learning::adapt::Learner;
/// use demosift::run::preset::Preset;
/// use demosift::stages::judge::{Imitating, JudgingState, Start, Threads, Trial, judge};
/// use demosift::world::point_mass::{PointMass, planted_set};
/// use demosift::world::rollout::Playground;
///
/// // Degrees away from the goal; the second demonstration leads there.
/// let set = planted_set(&[180.0, 0.0, 100.0], Seed::new(1))?;
/// let mut config = Preset::Quick.config();
/// (config.inner.batch_steps, config.judge.iterations) = (600, 12);
/// config.inner.alphas = vec![1.0, 0.5]; // half steps after the first
///
/// // Any prior can be judged from; this one knows nothing, and `meta_train` makes better ones.
/// let prior = Learner::untrained(&set, &config.policy, &[32, 32], &Seed::new(7));
/// let task = PointMass::new();
/// let trial = Trial {
///     set: &set,
///     demos: &set.ids(),
///     playground: &Playground::new(&task),
///     start: Start::Prior(&prior),
///     imitating: Imitating::Updates(&config.inner),
///     judging: &config.judge,
///     cut: 1,
///     part: "",
///     seed: &Seed::new(7),
/// };
/// let mut nothing = JudgingState::default(); // or what was judged before a kill
/// let judged = judge(&trial, &Threads, &mut nothing, &mut Silent)?;
///
/// // One suitability for each demonstration under each of the task's variants, which here is one.
/// let scores: Vec<f64> = judged.scores.suitabilities.iter().map(|of| of.gain()).collect();
/// assert_eq!(scores.len(), 3);
/// assert!(scores[1] > scores[2] && scores[2] > scores[0], "{scores:?} m nearer to the goal");
/// // The policies that imitated them are there too, to be looked at.
/// assert_eq!(judged.adapted.len(), 3);
/// # Ok::<(), demosift::Error>(())
/// ```
///
/// What another trainer has imitated does not count, and `state` begins anew then.
///
/// # Errors
/// Those of a unit, with its name; what was finished before is in `state`.
pub fn judge(
    trial: &Trial<'_>,
    crew: &dyn Crew,
    state: &mut JudgingState,
    observer: &mut dyn Observer,
) -> Result<Judged> {
    let Trial { demos, playground, start, imitating, judging, .. } = trial;
    let (task, starts_anew) = (playground.specification(), matches!(start, Start::Untrained { .. }));
    let most = Effort::of(demos.len(), task, judging, imitating.inner(), starts_anew).units;
    *state = std::mem::take(state).if_by(imitating.trainer());
    observer.on(Event::Started { stage: STAGE, done: state.done(), total: most })?;
    for round in 0..rounds(trial.judging) {
        let units = units(trial, state, round);
        finish(trial, crew, &units, state, observer)?;
    }
    Ok(assemble(trial, state))
}

/// Policies and curves of some demonstrations, where [`judge`] left them out since the set is large: their first repeats are made
/// again, to the same bits.
///
/// # Errors
/// Those of a unit, with its name.
pub fn look_at(
    trial: &Trial<'_>,
    demos: &[DemoId],
    state: &mut JudgingState,
    observer: &mut dyn Observer,
) -> Result<Judged> {
    let is_bare = |unit: &Unit| state.finished.get(unit).is_some_and(|outcome| outcome.policy.is_none());
    let first = |variant| demos.iter().map(move |demo| Unit { variant, repeat: 0, demo: Some(*demo) });
    let variants = trial.playground.specification().variant_ids().into_iter();
    let mut bare: Vec<Unit> = variants.flat_map(first).filter(is_bare).collect();
    bare.sort_unstable();
    let whole: Vec<Outcome> =
        bare.par_iter().map(|unit| unit::judged_whole(trial, unit)).collect::<Result<_>>()?;
    for (unit, mut outcome) in bare.into_iter().zip(whole) {
        collecting::report(trial.part, &unit, &outcome, observer)?;
        outcome.played += state.finished.get(&unit).map_or(0, |before| before.played);
        state.finished.insert(unit, outcome);
    }
    Ok(assemble(trial, state))
}

/// Rounds of repeats: the first holds those that everybody gets, each further one holds a repeat of those still contested.
fn rounds(judging: &Judging) -> usize {
    1 + judging.most_repeats.saturating_sub(judging.repeats)
}

/// The repeats of a round.
fn repeats(judging: &Judging, round: usize) -> std::ops::Range<usize> {
    match round {
        0 => 0..judging.repeats,
        round => judging.repeats + round - 1..judging.repeats + round,
    }
}

/// What a round has to do, repeat by repeat: under each variant, those whose side of the cut is still open.
fn units(trial: &Trial<'_>, state: &JudgingState, round: usize) -> Vec<Unit> {
    let mut units = Vec::new();
    for repeat in repeats(trial.judging, round) {
        for variant in trial.playground.specification().variant_ids() {
            let contested = contested(trial, state, variant, round);
            let starts = repeat < trial.start.count(repeat + 1) && !contested.is_empty();
            units.extend(starts.then_some(Unit { variant, repeat, demo: None }));
            units.extend(contested.into_iter().map(|demo| Unit { variant, repeat, demo: Some(demo) }));
        }
    }
    units
}

/// Lines 1 and 2: for all e_j, for all v_i.
fn contested(trial: &Trial<'_>, state: &JudgingState, variant: EnvVariant, round: usize) -> Vec<DemoId> {
    let ids = trial.demos;
    if round == 0 {
        return ids.to_vec();
    }
    let before = repeats(trial.judging, round).start;
    let mut means: Vec<Vec<f64>> = vec![Vec::new(); ids.len()];
    for (unit, outcome) in &state.finished {
        if let (true, Some(demo)) = (unit.variant == variant && unit.repeat < before, unit.demo)
            && let Ok(place) = ids.binary_search(&demo)
        {
            means[place].push(mean_or_zero(&outcome.scores));
        }
    }
    let looks = rounds(trial.judging) - 1;
    let open = race::contested(&means, &race::Race { cut: trial.cut, looks, level: race::LEVEL });
    open.into_iter().map(|place| ids[place]).collect()
}

/// Lines 3 to 11 for the units that are not finished yet, by the crew.
fn finish(
    trial: &Trial<'_>,
    crew: &dyn Crew,
    units: &[Unit],
    state: &mut JudgingState,
    observer: &mut dyn Observer,
) -> Result<()> {
    let one = |unit: &Unit| judge_unit(trial, unit);
    let mut collecting = Collecting::new(trial, units, state, observer)?;
    loop {
        let missing = collecting.missing();
        if missing.is_empty() {
            break;
        }
        let judged = crew.judge(&missing, &one, &mut |unit, outcome| collecting.take(unit, outcome));
        let left = collecting.missing().len();
        if judged.is_err() || left == missing.len() {
            // What is finished need not be done again; the first error is the one to tell.
            let stored = collecting.checkpoint();
            judged?;
            stored?;
            return Err(crew.left_behind(left));
        }
    }
    collecting.checkpoint()
}

/// The units as a table.
fn assemble(trial: &Trial<'_>, state: &JudgingState) -> Judged {
    // Of each demonstration in the order of the repeats, as they are sorted.
    let mut found: BTreeMap<(EnvVariant, Option<DemoId>), Vec<&Outcome>> = BTreeMap::new();
    for (unit, outcome) in &state.finished {
        found.entry((unit.variant, unit.demo)).or_default().push(outcome);
    }
    let under = |variant, demo| found.get(&(variant, demo)).map_or(&[][..], Vec::as_slice);
    let mut judged = Judged::default();
    judged.scores.trainer = trial.imitating.trainer().cloned();
    for variant in trial.playground.specification().variant_ids() {
        let starts = under(variant, None);
        let before: Vec<Vec<Score>> = starts.iter().map(|outcome| outcome.scores.clone()).collect();
        let before_evaluated = starts.first().and_then(|outcome| outcome.evaluated.clone());
        for &demo in trial.demos {
            let of_demo = under(variant, Some(demo));
            judged.scores.suitabilities.push(Suitability {
                demo,
                variant,
                before: before.clone(),
                after: of_demo.iter().map(|outcome| outcome.scores.clone()).collect(),
                distances: of_demo.iter().map(|outcome| outcome.distance).collect(),
                curves: of_demo.iter().map(|outcome| outcome.curve.clone()).collect(),
                evaluated: before_evaluated
                    .clone()
                    .zip(of_demo.first().and_then(|outcome| outcome.evaluated.clone()))
                    .map(|(before, after)| Evaluated { before, after }),
            });
            let policy = of_demo.iter().find_map(|outcome| outcome.policy.clone());
            assert!(policy.is_some() || !trial.keeps_policies(), "the first repeat keeps its policy");
            judged.adapted.extend(policy.map(|policy| AdaptedPolicy { demo, variant, policy }));
        }
    }
    judged
}

/// An episode that was played again.
#[derive(Debug)]
pub struct Replayed {
    /// What was played, with the simulator's states where it has any.
    pub rollout: Rollout,
    /// All its random numbers.
    pub seed: Seed,
}

/// One of the episodes in which the agent was scored, played again as it was to the bit: before imitating or after, as the
/// policy is.
///
/// `seed` is that of [`judge`], and `evaluation` counts the M evaluation seeds from 0.
pub fn replay(
    playground: &Playground<'_>,
    policy: &Policy,
    judging: &Judging,
    variant: EnvVariant,
    evaluation: usize,
    seed: &Seed,
) -> Result<Replayed> {
    let episodes = judging.episodes(playground.specification().horizon);
    let mut seeds = evaluation_seeds(&seed_under(seed, playground, variant), episodes);
    let (acting, seed) = (judging.acting, seeds.swap_remove(evaluation));
    let episode = Episode { policy, acting, variant, seed: &seed, keep_states: true };
    let played = rollout::play_episodes(playground, &[episode])?;
    Ok(Replayed { rollout: played.into_iter().next().expect("one episode, one rollout"), seed })
}

/// By name, so that a task under one of its variants alone is judged by the same random numbers.
fn seed_under(seed: &Seed, playground: &Playground<'_>, variant: EnvVariant) -> Seed {
    seed.of(&playground.specification().variants[variant.0])
}

fn evaluation_seeds(seed: &Seed, evaluations: usize) -> Vec<Seed> {
    seed.of("evaluate").many(evaluations)
}

#[cfg(test)]
mod tests;

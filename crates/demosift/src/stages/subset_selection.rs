//! Optimal subset selection (§4.4, Algorithm 3): demonstrations that help count more and more, the others less and less.
//!
//! Each round fine-tunes the meta-parameters by meta-updates in which every demonstration counts by its weight, judges all
//! demonstrations by a few iterations from there, and strengthens those that made the agent better than it was before
//! imitating them, and weakens the others.
//! The subset is what ends above a threshold.
//!
//! | Algorithm 3 | here |
//! |---|---|
//! | 1: initialize all w_i to 1 | [`WeighingState::start`] |
//! | 2, 14: while not done | the loop in [`select_subset`], until [`end`] says why it ends |
//! | 3: update θ for N iterations, applying W during meta-update | [`fine_tune`], which is Algorithm 1 with weights |
//! | 4: score of θ; 5: for all v_i | [`assess`], which is Algorithm 2 with few iterations |
//! | 6: Δ_ij = S_{v_i}\|e_j − S | [`deltas`] |
//! | 7 to 11: w_i ← w_i·β^±1·exp(Δ) | [`adjusted`] |
//! | 12: end for; 13: S_prev = S | nothing reads S_prev |
//! | 15, 16: return {v_i \| w_i > ε} | [`kept`] |
//!
//! Where we differ, see also reading 5 in `docs/paper.md`:
//!
//! - Line 10 multiplies the weight of a bad demonstration by exp(−Δ) ≥ 1; we take exp(Δ).
//! - The S_{v_i|e_j} of line 6 has the score of θ subtracted already (Eq. 8), so it is Δ; subtracting S again would do it twice.
//! - Δ is divided by the spread of the scores, which frees it of the heuristic's unit; over variants the mean is taken, as
//!   a demonstration has one weight.
//! - Weights are divided by their mean after each round, and never fall below a floor. Only their shares matter to the
//!   meta-update, but ε would compare their size: once θ is as good as the good demonstrations, no Δ is above 0 and all
//!   weights would fall below any ε together. The floor lets a demonstration that was misjudged come back. No weight exceeds
//!   n, and a round multiplies by no more than β·exp(√(2 + 2n)), so that nothing overflows.
//! - "Not done" is not said: it ends when the same subset came out several times in a row, or after so many rounds. The whole
//!   set is where all weights begin, so that it comes out says nothing yet.
//! - Shares that are multiplied drift apart: of several equally good demonstrations it may end with one, the luckiest.
//!   What it drops is therefore not shown to be bad; the ranking of Algorithm 2 says more about each.
//! - Should too few end above ε, the heaviest are kept; with no lower limit the subset could be empty.

use serde::{Deserialize, Serialize};

use crate::basics::error::Result;
use crate::basics::observer::{Event, Observer};
use crate::basics::seed::Seed;
use crate::data::demonstration::{DemoId, DemonstrationSet};
use crate::data::weights::Weights;
use crate::learning::adapt::MetaPrior;
use crate::math::statistics;
use crate::stages::judge::{
    self, Imitating, Judging, JudgingState, ScoreTable, ScoredOn, Start, Suitability, Threads, Trial,
};
use crate::stages::meta_train::{self, Learning, MetaState, MetaTraining, MutualInformation};
use crate::world::heuristic::Score;
use crate::world::rollout::Playground;

/// How a subset is selected by weights; the paper gives none of these values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SubsetSelection {
    /// Rounds at most.
    pub rounds: usize,
    /// It ends when the same subset came out so many times in a row.
    pub steady_rounds: usize,
    /// N: meta-updates in a round.
    pub meta_updates: usize,
    /// Inner updates per adaptation when a round judges.
    pub iterations: usize,
    /// β: what a weight is multiplied with or divided by, besides exp(Δ).
    pub beta: f64,
    /// ε: kept is what ends above it; the mean weight is 1.
    pub epsilon: f64,
    /// No weight falls below this.
    pub floor: f64,
    /// So many are kept at least.
    pub smallest: usize,
}

/// What a selection learns and judges with.
#[derive(Clone, Copy, Debug)]
pub struct Means<'a> {
    /// Algorithm 3.
    pub selection: &'a SubsetSelection,
    /// The meta-updates of line 3; mutual information is used where the state has a posterior.
    pub learning: Learning<'a>,
    /// Episodes of an evaluation; a round judges each demonstration once.
    pub judging: &'a Judging,
}

/// What a round found and did, in the order of the set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Weighed {
    /// Mean K of θ, over variants.
    pub baseline: Score,
    /// Mean K after imitating each demonstration, `[n]`.
    pub scores: Vec<Score>,
    /// Δ of each, in spreads, `[n]`.
    pub deltas: Vec<f64>,
    /// W after the round.
    pub weights: Weights,
}

/// Why a selection ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum WeighingEnd {
    /// The same subset came out often enough in a row.
    Converged,
    /// There were as many rounds as allowed.
    RoundLimit,
}

/// What comes of a selection: the subset, with the trends of the weights (Fig. 9) and why it ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Weighing {
    /// All rounds in order.
    pub rounds: Vec<Weighed>,
    /// Why there were no more.
    pub end: WeighingEnd,
    /// The kept demonstrations, the heaviest first.
    pub demos: Vec<DemoId>,
}

/// Where a selection stands; from here it goes on to the identical result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WeighingState {
    /// θ, D_meta and W.
    pub meta: MetaState,
    /// Rounds that are finished.
    pub rounds: Vec<Weighed>,
}

/// Name of the stage in events.
pub const STAGE: &str = "subset_selection";

/// Algorithm 3, continued from where `state` stands.
///
/// ```
/// use demosift::basics::observer::Silent;
/// use demosift::basics::seed::Seed;
/// use demosift::data::demonstration::DemoId;
/// use demosift::learning::adapt::Learner;
/// use demosift::run::preset::Preset;
/// use demosift::stages::meta_train::Learning;
/// use demosift::stages::subset_selection::{Means, WeighingState, select_subset};
/// use demosift::world::point_mass::{PointMass, planted_set};
/// use demosift::world::rollout::Playground;
///
/// let set = planted_set(&[180.0, 0.0, 130.0], Seed::new(1))?;
/// let mut config = Preset::Quick.config();
/// config.inner.batch_steps = 600;
/// config.subset_selection.rounds = 3;
///
/// // It starts from a prior, better from a meta-trained one than from this, which knows nothing.
/// let prior = Learner::untrained(&set, &config.policy, &[32, 32], &Seed::new(7));
/// let start = WeighingState::start(&set, prior, None, &Seed::new(7));
/// let means = Means {
///     selection: &config.subset_selection,
///     learning: Learning { training: &config.meta_train, inner: &config.inner, information: None },
///     judging: &config.judge,
/// };
/// let task = PointMass::new();
/// let playground = Playground::new(&task);
/// let weighing = select_subset(&set, &playground, &means, start, &Seed::new(7), &mut Silent)?;
///
/// // The second demonstration leads to the goal, and comes to count more than the others.
/// assert_eq!(weighing.demos[0], DemoId(1));
/// let trend: Vec<f64> = weighing.rounds.iter().map(|round| round.weights.of(DemoId(1))).collect();
/// assert!(trend[0] > 1.0 && trend.is_sorted(), "{trend:?}");
/// # Ok::<(), demosift::Error>(())
/// ```
pub fn select_subset(
    set: &DemonstrationSet,
    playground: &Playground<'_>,
    means: &Means<'_>,
    mut state: WeighingState,
    seed: &Seed,
    observer: &mut dyn Observer,
) -> Result<Weighing> {
    let how = means.selection;
    observer.on(Event::Started { stage: STAGE, done: state.rounds.len(), total: how.rounds })?;
    let end = loop {
        if let Some(end) = end(&state.rounds, how) {
            break end;
        }
        let round = Round { set, playground, means, number: state.rounds.len(), seed };
        state.meta = fine_tune(&round, state.meta, observer)?;
        let table = assess(&round, &state.meta.prior, observer)?;
        let deltas = deltas(&table, set.positions());
        state.meta.weights = adjusted(&state.meta.weights, &deltas, how);
        state.rounds.push(weighed(&table, deltas, &state.meta.weights));
        report(&state, observer)?;
    };
    let demos = state.rounds.last().map_or(set.ids(), |last| kept(&last.weights, how));
    Ok(Weighing { rounds: state.rounds, end, demos })
}

impl WeighingState {
    /// Line 1, from meta-trained parameters; a posterior starts from the beginning, as the prior holds none.
    pub fn start(
        set: &DemonstrationSet,
        prior: MetaPrior,
        information: Option<&MutualInformation>,
        seed: &Seed,
    ) -> Self {
        Self { meta: MetaState::from_prior(set, prior, information, seed), rounds: Vec::new() }
    }
}

/// Whether it is done, and why.
fn end(rounds: &[Weighed], how: &SubsetSelection) -> Option<WeighingEnd> {
    let last = rounds.len().checked_sub(how.steady_rounds).map(|from| &rounds[from..]);
    let chosen = |round: &Weighed| {
        let mut demos = kept(&round.weights, how);
        demos.sort_unstable();
        demos
    };
    let leaves_out = |round: &Weighed| chosen(round).len() < round.weights.iter().count();
    match last {
        Some(last)
            if last.iter().all(leaves_out)
                && last.windows(2).all(|pair| chosen(&pair[0]) == chosen(&pair[1])) =>
        {
            Some(WeighingEnd::Converged)
        }
        _ => (rounds.len() >= how.rounds).then_some(WeighingEnd::RoundLimit),
    }
}

/// What a round works with.
struct Round<'a> {
    set: &'a DemonstrationSet,
    playground: &'a Playground<'a>,
    means: &'a Means<'a>,
    number: usize,
    seed: &'a Seed,
}

/// Line 3: N meta-updates with the weights of the state.
fn fine_tune(round: &Round<'_>, meta: MetaState, observer: &mut dyn Observer) -> Result<MetaState> {
    let Means { selection, learning, .. } = *round.means;
    let training = fine_tuning(round.set, &learning, meta.rounds + selection.meta_updates);
    let learning = Learning { training: &training, ..learning };
    let seed = fine_tuning_seed(round.seed);
    let mut within = Within { observer, round: round.number };
    meta_train::meta_train(round.set, round.playground, &learning, meta, &seed, &mut within)
}

/// Meta-training up to so many updates.
///
/// All demonstrations are in each: of a batch drawn from them only shares would count, and it may hold none that helps.
fn fine_tuning(set: &DemonstrationSet, learning: &Learning<'_>, rounds: usize) -> MetaTraining {
    MetaTraining { rounds, meta_batch: set.len(), ..learning.training.clone() }
}

/// The random numbers of all meta-updates of line 3.
fn fine_tuning_seed(seed: &Seed) -> Seed {
    seed.of("meta_train")
}

/// Lines 4 and 5: S of θ and after imitating each demonstration for a few iterations.
fn assess(round: &Round<'_>, prior: &MetaPrior, observer: &mut dyn Observer) -> Result<ScoreTable> {
    let Means { selection, learning, judging } = *round.means;
    let few = assessing(selection, judging);
    let seed = round.seed.of("judge").at(round.number);
    let mut within = Within { observer, round: round.number };
    let trial = Trial {
        set: round.set,
        demos: &round.set.ids(),
        playground: round.playground,
        start: Start::Prior(prior),
        imitating: Imitating::Updates(learning.inner),
        judging: &few,
        cut: round.set.len(),
        part: "",
        seed: &seed,
    };
    Ok(judge::judge(&trial, &Threads, &mut JudgingState::default(), &mut within)?.scores)
}

/// Judging as a round does it: each demonstration once, by few iterations, of which the mean takes the same share of the last
/// as in judging, so that the hardly trained first ones do not count.
///
/// Its Δ is in spreads of single episodes, so these are what scores.
fn assessing(selection: &SubsetSelection, judging: &Judging) -> Judging {
    let iterations = selection.iterations;
    let averaged =
        (judging.averaged * iterations).div_ceil(judging.iterations.max(1)).clamp(1, iterations.max(1));
    let scored_on = ScoredOn::Evaluations;
    Judging { iterations, averaged, scored_on, repeats: 1, most_repeats: 1, ..judging.clone() }
}

/// What a selection by weights takes at most, where episodes last to the horizon.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Effort {
    /// Rounds.
    pub(crate) rounds: usize,
    /// Meta-updates of all rounds.
    pub(crate) meta_updates: usize,
    /// Demonstrations in each of them.
    pub(crate) meta_batch: usize,
    /// Environment steps that the meta-updates play.
    pub(crate) learning_steps: u64,
    /// How a round judges.
    pub(crate) judging: Judging,
    /// What that takes, in one round.
    pub(crate) assessing: judge::Effort,
}

impl Effort {
    /// Of [`select_subset`] with the same arguments.
    pub(crate) fn of(
        set: &DemonstrationSet,
        playground: &Playground<'_>,
        means: &Means<'_>,
        seed: &Seed,
    ) -> Self {
        let Means { selection, learning, judging } = *means;
        let meta_updates = selection.rounds * selection.meta_updates;
        let training = fine_tuning(set, &learning, meta_updates);
        let judging = assessing(selection, judging);
        let assessing =
            judge::Effort::of(set.len(), playground.specification(), &judging, Some(learning.inner), false);
        let learning = Learning { training: &training, ..learning };
        let seed = fine_tuning_seed(seed);
        let steps = meta_train::steps_by_round(set, playground, &learning, &seed);
        let (rounds, meta_batch) = (selection.rounds, training.meta_batch);
        let learning_steps = steps.take(meta_updates).sum();
        Self { rounds, meta_updates, meta_batch, learning_steps, judging, assessing }
    }

    /// Environment steps in all.
    pub(crate) fn steps(&self) -> u64 {
        self.learning_steps + self.assessing.steps() * self.rounds as u64
    }
}

/// Line 6: Δ_i = (S_{v_i}|e_j by the spread of the scores under e_j), the mean over all e_j, by position in the file.
///
/// The spread is the standard deviation of all episodes under e_j, before and after imitating each v_i: what evaluations
/// cannot tell from noise weighs little, and no Δ is larger than √(2 + 2n), as two of the n + 1 means that differ by
/// Δ spreads make this much spread by themselves.
fn deltas(table: &ScoreTable, positions: usize) -> Vec<f64> {
    let (mut sums, mut variants) = (vec![0.0; positions], 0.0);
    for under in table.suitabilities.chunk_by(|a, b| a.variant == b.variant) {
        let spread = spread(under);
        variants += 1.0;
        for suitability in under.iter().filter(|_| spread > 0.0) {
            sums[suitability.demo.0] += suitability.gain() / spread;
        }
    }
    sums.iter().map(|sum| sum / variants).collect()
}

/// The standard deviation of all episodes under a variant, θ's own among them once.
fn spread(under: &[Suitability]) -> f64 {
    let before = under.first().into_iter().flat_map(|first| first.before.iter().flatten());
    let after = under.iter().flat_map(|suitability| suitability.after.iter().flatten());
    let scores: Vec<Score> = before.chain(after).copied().collect();
    statistics::mean_and_deviation(scores.iter().copied()).1
}

/// Lines 7 to 11: w_i ← w_i·β·exp(Δ_i) where Δ_i > 0, else w_i·β⁻¹·exp(Δ_i); then by their mean, above the floor.
fn adjusted(weights: &Weights, deltas: &[f64], how: &SubsetSelection) -> Weights {
    let adjust = |(demo, weight): (DemoId, f64)| {
        let delta = deltas[demo.0];
        let beta = if delta > 0.0 { how.beta } else { how.beta.recip() };
        weight * beta * delta.exp()
    };
    let adjusted: Vec<f64> = weights.iter().map(adjust).collect();
    let mean = statistics::mean(&adjusted);
    let adjusted: Vec<f64> = adjusted.iter().map(|weight| (weight / mean).max(how.floor)).collect();
    weights.with(&adjusted)
}

/// Line 15: {v_i | w_i > ε}, the heaviest first and ties by id; never fewer than the smallest subset.
fn kept(weights: &Weights, how: &SubsetSelection) -> Vec<DemoId> {
    let mut demos: Vec<(DemoId, f64)> = weights.iter().collect();
    demos.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let above = demos.iter().filter(|(_, weight)| *weight > how.epsilon).count();
    demos.into_iter().take(above.max(how.smallest)).map(|(demo, _)| demo).collect()
}

fn weighed(table: &ScoreTable, deltas: Vec<f64>, weights: &Weights) -> Weighed {
    let mean = |value: &dyn Fn(&Suitability) -> Score, demo: usize| {
        let values: Vec<Score> = table.of_demo(DemoId(demo)).map(value).collect();
        // Of a position of the file that is not of the set there is none, and what is not a number cannot be written.
        if values.is_empty() { 0.0 } else { statistics::mean(&values) }
    };
    Weighed {
        baseline: mean(
            &Suitability::mean_before,
            table.suitabilities.first().map_or(0, |first| first.demo.0),
        ),
        scores: (0..deltas.len()).map(|demo| mean(&Suitability::mean_after, demo)).collect(),
        deltas,
        weights: weights.clone(),
    }
}

fn report(state: &WeighingState, observer: &mut dyn Observer) -> Result<()> {
    let (done, Some(last)) = (state.rounds.len(), state.rounds.last()) else { return Ok(()) };
    for (demo, weight) in last.weights.iter() {
        observer.on(Event::Measured {
            stage: STAGE,
            part: &format!("demonstration {demo}"),
            iteration: done,
            numbers: &[
                ("weight", weight),
                ("delta", last.deltas[demo.0]),
                ("score", last.scores[demo.0]),
                ("baseline", last.baseline),
            ],
        })?;
    }
    observer.on(Event::Advanced { stage: STAGE, done })?;
    observer.on(Event::Checkpoint { stage: STAGE, part: "", state })
}

/// Meta-training and judging inside a round: what they measure goes on under the round's name, their beginnings and
/// checkpoints do not, as those of the selection stand for them.
struct Within<'a> {
    observer: &'a mut dyn Observer,
    round: usize,
}

impl Observer for Within<'_> {
    fn on(&mut self, event: Event<'_>) -> Result<()> {
        let Event::Measured { stage, part, iteration, numbers } = event else { return Ok(()) };
        let part = format!("weights round {} {part}", self.round + 1);
        self.observer.on(Event::Measured { stage, part: part.trim_end(), iteration, numbers })
    }
}

#[cfg(test)]
mod tests;

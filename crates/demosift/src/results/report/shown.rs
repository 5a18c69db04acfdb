//! Episodes of the agent to be looked at, before and after imitating each demonstration.
//!
//! They are not new ones: each is an evaluation episode of judging, played again from its seed.

use crate::basics::error::{Error, Result};
use crate::basics::seed::Seed;
use crate::data::demonstration::DemoId;
use crate::data::trajectory::{StateLog, Trajectory};
use crate::stages::judge::{self, Judged, Judging, Replayed, ScoreTable, Suitability};
use crate::stages::select::Ranking;
use crate::world::environment::{EnvVariant, Rollout};
use crate::world::heuristic::Score;
use crate::world::policy::Policy;
use crate::world::rollout::Playground;

/// Whose episode it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// The agent before it imitated anything.
    Before,
    /// The agent after it imitated this demonstration.
    After(DemoId),
}

/// One evaluation episode of the agent.
#[derive(Debug)]
pub struct Shown {
    /// Whose.
    pub moment: Moment,
    /// e_j.
    pub variant: EnvVariant,
    /// Its own heuristic.
    pub score: Score,
    /// Whether it reached the task's goal, where the task says.
    pub succeeded: Option<bool>,
    /// What was played.
    pub played: Trajectory,
    /// The simulator's states, one per step, where it has any.
    pub states: Option<StateLog>,
    /// All its random numbers.
    pub seed: Seed,
}

/// Of so many demonstrations all are looked at.
pub const MOST_WORTH_A_LOOK: usize = 40;
/// Of more these are: so many of the best, so many of the worst, and for the rest of [`MOST_WORTH_A_LOOK`] those nearest to the cut.
const BEST: usize = 8;
const WORST: usize = 4;

/// Which demonstrations of a ranking are worth looking at, by rank: all of a small set, and of a large one the best, the worst
/// and those near the cut after the first `kept`.
pub fn worth_a_look(ranking: &Ranking, kept: usize) -> Vec<DemoId> {
    let count = ranking.entries.len();
    let is_at_an_end = |place: usize| place < BEST || place + WORST >= count;
    // Twice the distance of a place from the border between the last that is kept and the first that is not.
    let from_cut = |place: usize| (2 * place + 1).abs_diff(2 * kept);
    let mut places: Vec<usize> = (0..count).collect();
    places.sort_by_key(|&place| (!is_at_an_end(place), from_cut(place), place));
    places.truncate(MOST_WORTH_A_LOOK);
    places.sort_unstable();
    places.into_iter().map(|place| ranking.entries[place].demo).collect()
}

/// For each variant the agent before, then the agent after each of these demonstrations, on the most typical of the evaluation
/// seeds; nothing of demonstrations whose policies were not kept, in a large set.
///
/// `start` is the policy that the first repeats started from, and `seed` is that of judging.
///
/// # Errors
/// `is_bad_input` if an episode does not score what it scored when it was judged: the task or the policies have changed.
pub fn agent_episodes(
    playground: &Playground<'_>,
    start: &Policy,
    judged: &Judged,
    judging: &Judging,
    seed: &Seed,
    demos: &[DemoId],
) -> Result<Vec<Shown>> {
    let Judged { scores, adapted } = judged;
    let mut shown = Vec::new();
    for variant in playground.specification().variant_ids() {
        let evaluation = typical_evaluation(scores, variant);
        let look = Look { playground, judging, variant, evaluation, seed };
        let both = adapted.iter().filter_map(|adapted| {
            let is_of = |of: &&Suitability| of.demo == adapted.demo && of.variant == adapted.variant;
            Some((scores.suitabilities.iter().find(is_of)?, adapted))
        });
        for (of, adapted) in both.filter(|(of, _)| of.variant == variant && demos.contains(&of.demo)) {
            if shown.last().is_none_or(|last: &Shown| last.variant != variant) {
                shown.push(look.at(Moment::Before, start, of.evaluated_before()[evaluation])?);
            }
            let scored = of.evaluated_after()[evaluation];
            shown.push(look.at(Moment::After(of.demo), &adapted.policy, scored)?);
        }
    }
    Ok(shown)
}

/// Which of the M evaluation seeds shows the mean scores best under a variant: the one where the first repeats' episodes are,
/// in all, the least away from the mean scores; the first of those alike.
pub fn typical_evaluation(scores: &ScoreTable, variant: EnvVariant) -> usize {
    let under: Vec<_> = scores.of_variant(variant).collect();
    let evaluations = under.first().map_or(0, |of| of.evaluated_before().len());
    let before = |of: &Suitability, at: usize| (of.evaluated_before()[at] - of.mean_before()).abs();
    let after = |of: &Suitability, at: usize| (of.evaluated_after()[at] - of.mean_after()).abs();
    let away = |evaluation: usize| -> f64 {
        under.first().map_or(0.0, |of| before(of, evaluation))
            + under.iter().map(|of| after(of, evaluation)).sum::<f64>()
    };
    (0..evaluations).min_by(|a, b| away(*a).total_cmp(&away(*b))).unwrap_or(0)
}

/// Where all episodes of a variant are looked at.
struct Look<'a> {
    playground: &'a Playground<'a>,
    judging: &'a Judging,
    variant: EnvVariant,
    evaluation: usize,
    seed: &'a Seed,
}

impl Look<'_> {
    fn at(&self, moment: Moment, policy: &Policy, scored: Score) -> Result<Shown> {
        let Self { playground, judging, variant, evaluation, seed } = *self;
        let Replayed { rollout, seed } =
            judge::replay(playground, policy, judging, variant, evaluation, seed)?;
        let Rollout { trajectory: played, states } = rollout;
        let score = playground.score(&played);
        if score != scored {
            return Err(Error::bad_input(format!(
                "an evaluation episode scores {score} now and scored {scored} when it was judged: the task has changed \
                 since, or the policies of the run folder"
            )));
        }
        let succeeded = playground.task().succeeded(played.measurements());
        Ok(Shown { moment, variant, score, succeeded, played, states, seed })
    }
}

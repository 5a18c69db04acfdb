//! One unit of judging (Algorithm 2, lines 3 to 11): a function of its arguments alone, wherever and whenever it is called.

use serde::{Deserialize, Serialize};

use super::{Imitating, Judging, Trial, evaluation_seeds, seed_under};
use crate::basics::error::Result;
use crate::basics::seed::Seed;
use crate::data::demonstration::DemoId;
use crate::data::trajectory::Trajectory;
use crate::learning::adapt::{self, Course, InnerUpdate, Learner, UpdateReport};
use crate::learning::gail;
use crate::math::statistics::{mean, mean_or_zero};
use crate::world::adapted_behaviors;
use crate::world::environment::EnvVariant;
use crate::world::heuristic::Score;
use crate::world::policy::Policy;
use crate::world::rollout::{self, Playground};
use crate::world::trainer::Trainer;

/// One piece of judging that depends on no other: a demonstration imitated once under a variant, or, with no demonstration,
/// what the agent is worth before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Unit {
    /// e_j.
    pub variant: EnvVariant,
    /// Which repeat.
    pub repeat: usize,
    /// v_i, if one is imitated.
    pub demo: Option<DemoId>,
}

/// The result of a unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// K, one per evaluation seed or batch, `[M]`.
    pub(super) scores: Vec<Score>,
    /// K of the evaluation episodes, where batches are what scores; of the first repeat only.
    pub(super) evaluated: Option<Vec<Score>>,
    /// From what was demonstrated (Table 1).
    pub(super) distance: f64,
    pub(super) curve: Vec<UpdateReport>,
    /// θ_ij, of the first repeat only.
    pub(super) policy: Option<Policy>,
    /// Environment steps that it took.
    pub(super) played: u64,
}

impl Outcome {
    /// Mean K over the evaluation seeds or batches.
    pub fn mean_score(&self) -> Score {
        mean_or_zero(&self.scores)
    }

    /// Environment steps that it took.
    pub fn played(&self) -> u64 {
        self.played
    }
}

/// Lines 3 to 11 once; nothing is imitated where the unit is about the agent before.
///
/// It asks nothing but the trial and the unit, so that any machine can do it at any time, and twice.
///
/// # Errors
/// Those of adapting or of the trainer, and of playing, with the unit before them.
pub fn judge_unit(trial: &Trial<'_>, unit: &Unit) -> Result<Outcome> {
    let whole = judged_whole(trial, unit)?;
    Ok(if is_kept_whole(trial.demos.len()) {
        whole
    } else {
        Outcome { curve: Vec::new(), policy: None, ..whole }
    })
}

/// Of so many demonstrations that are judged the curve of every repeat and the policy of the first are kept; of more neither, or a
/// run would hold little else.
const KEPT_WHOLE: usize = 200;

/// Whether the units of so many demonstrations keep their curves and policies; of more they are made again for those that are
/// looked at.
pub fn is_kept_whole(judged: usize) -> bool {
    judged <= KEPT_WHOLE
}

/// A unit with its curve, and with its policy if it is of the first repeat.
pub(super) fn judged_whole(trial: &Trial<'_>, unit: &Unit) -> Result<Outcome> {
    let learner = || trial.start.learner(trial.set, unit.repeat, trial.seed);
    let seed = seed_under(trial.seed, trial.playground, unit.variant);
    let outcome = match (unit.demo, trial.imitating) {
        (Some(demo), Imitating::Updates(inner)) => {
            imitated(trial, Imitator { learner: &learner(), inner }, demo, unit, &seed)
        }
        (Some(demo), Imitating::Trainer(trainer)) => trained(trial, trainer, demo, unit, &seed),
        (None, _) => before(trial, &learner(), unit, &seed),
    };
    outcome.map_err(|error| error.during(&unit.in_words()))
}

/// What the agent is worth that imitates nothing: in evaluation episodes, or in batches of the same random numbers as those that
/// score the adaptations of this repeat.
fn before(trial: &Trial<'_>, learner: &Learner, unit: &Unit, seed: &Seed) -> Result<Outcome> {
    let evaluated = evaluate(trial, &learner.policy, unit.variant, seed)?;
    let mut played = steps_of(&evaluated);
    let mut batches = Vec::new();
    if let Imitating::Updates(inner) = trial.imitating {
        let adapting = seed.of("adapt").at(unit.repeat);
        for iteration in trial.judging.scoring_batches(inner) {
            let seed = adapt::seed_of_batch(&adapting, iteration);
            let batch = inner.play(trial.playground, &learner.policy, unit.variant, seed)?;
            batches.push(mean(&score(trial.playground, &batch)));
            played += steps_of(&batch);
        }
    }
    let Scored { scores, evaluated } = scored(trial, unit, batches, &evaluated);
    Ok(Outcome { scores, evaluated, distance: 0.0, curve: Vec::new(), policy: None, played })
}

/// What counts, and what can be looked at.
struct Scored {
    scores: Vec<Score>,
    evaluated: Option<Vec<Score>>,
}

/// By the batches, where there are any.
fn scored(trial: &Trial<'_>, unit: &Unit, batches: Vec<Score>, evaluated: &[Trajectory]) -> Scored {
    let evaluated = score(trial.playground, evaluated);
    if batches.is_empty() {
        return Scored { scores: evaluated, evaluated: None };
    }
    Scored { scores: batches, evaluated: (unit.repeat == 0).then_some(evaluated) }
}

/// An agent of ours that imitates.
#[derive(Clone, Copy)]
struct Imitator<'a> {
    /// θ with D.
    learner: &'a Learner,
    /// How it updates.
    inner: &'a InnerUpdate,
}

/// Lines 3 to 11 for one demonstration.
fn imitated(
    trial: &Trial<'_>,
    Imitator { learner, inner }: Imitator<'_>,
    demo: DemoId,
    unit: &Unit,
    seed: &Seed,
) -> Result<Outcome> {
    let Judging { iterations, averaged, .. } = *trial.judging;
    let course = Course { inner, iterations, averaged };
    let pairs = gail::demonstrated_pairs(trial.set.get(demo), learner.policy.filter());
    let adapting = seed.of("adapt").at(unit.repeat);
    let adapted = adapt::adapt(learner, &[&pairs], trial.playground, unit.variant, &course, &adapting)?;
    let policy = adapted.learner.policy;
    let evaluated = evaluate(trial, &policy, unit.variant, seed)?;
    let distance = adapted_behaviors::distance(trial.set.get(demo), &evaluated)?;
    let last = &adapted.curve[trial.judging.scoring_batches(inner)];
    let batches = last.iter().filter_map(|report| report.score).collect();
    let played = adapted.played + steps_of(&evaluated);
    let Scored { scores, evaluated } = scored(trial, unit, batches, &evaluated);
    let policy = (unit.repeat == 0).then_some(policy);
    Ok(Outcome { scores, evaluated, distance, curve: adapted.curve, policy, played })
}

/// The same by somebody else's trainer, which learns from this one demonstration where and how it likes.
fn trained(
    trial: &Trial<'_>,
    trainer: &dyn Trainer,
    demo: DemoId,
    unit: &Unit,
    seed: &Seed,
) -> Result<Outcome> {
    let mut apprentice = trainer.train(trial.set, &[demo], &seed.of("train").at(unit.repeat))?;
    let seeds = seeds_of_evaluation(trial, seed);
    let played = rollout::play_led(trial.playground, apprentice.as_mut(), unit.variant, &seeds)?;
    let distance = adapted_behaviors::distance(trial.set.get(demo), &played)?;
    let scores = score(trial.playground, &played);
    let played = steps_of(&played);
    Ok(Outcome { scores, evaluated: None, distance, curve: Vec::new(), policy: None, played })
}

fn steps_of(played: &[Trajectory]) -> u64 {
    played.iter().map(|played| played.steps() as u64).sum()
}

/// Line 11: a policy on the M evaluation seeds, which are the same for everybody.
fn evaluate(trial: &Trial<'_>, policy: &Policy, variant: EnvVariant, seed: &Seed) -> Result<Vec<Trajectory>> {
    let seeds = seeds_of_evaluation(trial, seed);
    rollout::play(trial.playground, policy, trial.judging.acting, variant, seeds)
}

/// Those of the M episodes.
fn seeds_of_evaluation(trial: &Trial<'_>, seed: &Seed) -> Vec<Seed> {
    evaluation_seeds(seed, trial.judging.episodes(trial.playground.specification().horizon))
}

/// K.
fn score(playground: &Playground<'_>, played: &[Trajectory]) -> Vec<Score> {
    played.iter().map(|played| playground.score(played)).collect()
}

impl Unit {
    fn in_words(self) -> String {
        match self.demo {
            Some(demo) => format!("judging demonstration {demo}"),
            None => "evaluating the agent before it imitates".to_owned(),
        }
    }
}

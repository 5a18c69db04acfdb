//! Making one cell: the same functions as a run of the command, with a ledger that forgets.

use super::{Cost, Curve, JudgedDemonstration, JudgingResult, Outcome, TrainingResult};
use crate::basics::error::{Error, Result};
use crate::basics::ledger::InMemory;
use crate::basics::observer::Silent;
use crate::basics::seed::Seed;
use crate::data::demonstration::{DemoId, DemonstrationSet};
use crate::learning::adapt::Rule;
use crate::math::statistics;
use crate::results::panel::{Judge, Judges};
use crate::run::experiment::{self, Config, Run};
use crate::stages::imitate::{self, CurvePoint, ImitationState, Lesson};
use crate::stages::judge::{Effort, Suitability};
use crate::stages::referee::imitation_by;
use crate::world::environment::Task;
use crate::world::heuristic::Score;
use crate::world::rollout::Playground;

/// What a cell is made with, besides its seed.
#[derive(Clone, Copy)]
pub struct Means<'a> {
    /// V.
    pub set: &'a DemonstrationSet,
    /// A task of one variant.
    pub task: &'a dyn Task,
    /// How; its own seed does not count.
    pub config: &'a Config,
}

/// Judges a set once, by the judge that the configuration asks, or by the one of both that decides; `clock` says how many
/// seconds have passed since some moment.
///
/// # Errors
/// `is_diverged` if learning does, `is_simulation` if the simulator fails, `is_bad_config` if the budget pays for nothing.
pub fn judging(means: &Means<'_>, seed: u64, clock: &mut dyn FnMut() -> f64) -> Result<JudgingResult> {
    let playground = Playground::new(means.task);
    let config = Config { seed, ..means.config.clone() };
    let mut run = Run {
        set: means.set,
        playground: &playground,
        config: &config,
        ledger: &mut InMemory::default(),
        observer: &mut Silent,
    };
    let mut passed = Passed::from_now(&playground, clock);
    if config.judges.each().contains(&Judge::Paper) {
        experiment::prior(&mut run)?;
    }
    let once = passed.since_last();
    let judge = match config.judges {
        Judges::Cloning => Judge::Cloning,
        Judges::Paper => Judge::Paper,
        Judges::Both => experiment::panel(&mut run)?.decides,
    };
    let table = experiment::scores(&mut run, judge)?;
    let judging = passed.since_last();
    let demonstrations = table.suitabilities.iter().map(judged).collect::<Result<_>>()?;
    let adapted_behaviors_distance = table.adapted_behaviors_distance();
    Ok(JudgingResult { demonstrations, adapted_behaviors_distance, once, judging })
}

fn judged(suitability: &Suitability) -> Result<JudgedDemonstration> {
    Ok(JudgedDemonstration {
        score: finite(suitability.gain())?,
        after: finite(suitability.mean_after())?,
        repeats: suitability.after.iter().map(|scores| statistics::mean(scores)).collect(),
    })
}

/// Trains a policy on some demonstrations once, by the rule of `imitator` and otherwise as the configuration says.
///
/// Whatever is imitated, the same seed means the same first policy and the same episodes, as in [`experiment::learning_curve`].
///
/// # Errors
/// `is_diverged` if learning does, `is_simulation` if the simulator fails.
pub fn training(
    means: &Means<'_>,
    demos: &[DemoId],
    imitator: Rule,
    seed: u64,
    clock: &mut dyn FnMut() -> f64,
) -> Result<TrainingResult> {
    let playground = Playground::new(means.task);
    let imitation = imitation_by(imitator, &means.config.imitate);
    let seed = Seed::new(seed).of("imitate");
    let mut passed = Passed::from_now(&playground, clock);
    let policy = &means.config.policy;
    let start = ImitationState::start(means.set, demos, policy, &imitation, &seed.of("start"));
    let lesson =
        Lesson { set: means.set, playground: &playground, imitation: &imitation, part: "", seed: &seed };
    let curve = imitate::imitate(&lesson, start, &mut Silent)?;
    Ok(TrainingResult {
        end: outcome(&curve.end)?,
        chosen: outcome(&curve.outcome)?,
        cost: passed.since_last(),
        curve: Curve::of(&curve.points),
    })
}

/// Environment steps that judging may take at most, where episodes last to the horizon.
pub fn planned_judging(means: &Means<'_>) -> u64 {
    let run = Run {
        set: means.set,
        playground: &Playground::new(means.task),
        config: means.config,
        ledger: &mut InMemory::default(),
        observer: &mut Silent,
    };
    let of = |judge: &Judge| match judge {
        Judge::Paper => experiment::budget(&run).quota,
        Judge::Cloning => {
            let judging = &means.config.cloning_judge.judging;
            let inner = &experiment::cloning_update(means.config);
            Effort::of(means.set.len(), means.task.specification(), judging, inner, true).steps()
        }
    };
    means.config.judges.each().iter().map(of).sum()
}

/// Environment steps that a training takes, where episodes last to the horizon.
pub fn planned_training(means: &Means<'_>, imitator: Rule) -> u64 {
    imitate::Effort::of(means.task.specification(), &imitation_by(imitator, &means.config.imitate)).steps()
}

fn outcome(point: &CurvePoint) -> Result<Outcome> {
    Ok(Outcome {
        score: finite(point.score)?,
        success: point.success,
        true_return: point.true_return,
        standard_error: point.standard_error,
    })
}

fn finite(score: Score) -> Result<Score> {
    match score.is_finite() {
        true => Ok(score),
        false => Err(Error::diverged(format!("the heuristic is {score}"))),
    }
}

/// What has been played and how long it took.
struct Passed<'a> {
    playground: &'a Playground<'a>,
    clock: &'a mut dyn FnMut() -> f64,
    last: Cost,
}

impl<'a> Passed<'a> {
    fn from_now(playground: &'a Playground<'a>, clock: &'a mut dyn FnMut() -> f64) -> Self {
        let last = Cost { environment_steps: playground.steps_taken(), seconds: clock() };
        Self { playground, clock, last }
    }

    fn since_last(&mut self) -> Cost {
        let now = Cost { environment_steps: self.playground.steps_taken(), seconds: (self.clock)() };
        let before = std::mem::replace(&mut self.last, now);
        Cost {
            environment_steps: now.environment_steps - before.environment_steps,
            seconds: now.seconds - before.seconds,
        }
    }
}

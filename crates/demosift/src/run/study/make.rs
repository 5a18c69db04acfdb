//! Making one cell: the same functions as a run of the command, with a ledger that forgets.

use super::{
    Adaptation, Cost, Curve, JudgedDemonstration, JudgingResult, Outcome, PriorLearned, TrainingResult,
    WeighingResult,
};
use crate::basics::error::{Error, Result};
use crate::basics::ledger::{InMemory, Ledger};
use crate::basics::observer::{Event, Observer, Silent};
use crate::basics::seed::Seed;
use crate::data::demonstration::{DemoId, DemonstrationSet};
use crate::learning::adapt::{Rule, UpdateReport};
use crate::math::statistics;
use crate::results::panel::Judge;
use crate::run::experiment::{self, Config, Run};
use crate::run::forecast::{self, Goal};
use crate::stages::imitate::{self, CurvePoint, ImitationState, Lesson};
use crate::stages::judge::{Effort, ScoreTable, Suitability};
use crate::stages::meta_train;
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
    /// Where the prior is learned, if that is not this set.
    pub prior: Option<PriorOf<'a>>,
}

/// Another set on which a prior is learned.
#[derive(Clone, Copy)]
pub struct PriorOf<'a> {
    /// V of the prior, whose task is the same.
    pub set: &'a DemonstrationSet,
    /// How; its own seed does not count.
    pub config: &'a Config,
}

/// Judges a set once, by the one judge that the configuration asks; `clock` says how many
/// seconds have passed since some moment.
///
/// # Errors
/// `is_diverged` if learning does, `is_simulation` if the simulator fails, `is_bad_config` if the budget pays for nothing.
pub fn judging(means: &Means<'_>, seed: u64, clock: &mut dyn FnMut() -> f64) -> Result<JudgingResult> {
    let playground = Playground::new(means.task);
    let config = Config { seed, ..means.config.clone() };
    let mut ledger = InMemory::default();
    let mut passed = Passed::from_now(&playground, clock);
    let mut learned = MetaUpdates::default();
    if config.judges.each().contains(&Judge::Paper) {
        learn_prior(means, &playground, &config, &mut ledger, &mut learned)?;
    }
    let once = passed.since_last();
    let mut run = Run {
        set: means.set,
        playground: &playground,
        config: &config,
        ledger: &mut ledger,
        observer: &mut Silent,
    };
    let &[judge] = config.judges.each() else {
        return Err(Error::bad_config("a study asks one judge a method; a rule combines those of several"));
    };
    let table = experiment::scores(&mut run, judge)?;
    let judging = passed.since_last();
    let vote = Some(experiment::opinion(&mut run, judge)?.vote);
    let demonstrations = table.suitabilities.iter().map(judged).collect::<Result<_>>()?;
    let adapted_behaviors_distance = table.adapted_behaviors_distance();
    let adaptation = adaptation(&table);
    let prior = learned.told();
    Ok(JudgingResult { demonstrations, adapted_behaviors_distance, once, judging, vote, adaptation, prior })
}

/// Puts the prior into the ledger: that of the set itself, or of the one that the means name.
fn learn_prior(
    means: &Means<'_>,
    playground: &Playground<'_>,
    config: &Config,
    ledger: &mut dyn Ledger,
    observer: &mut dyn Observer,
) -> Result<()> {
    let Some(PriorOf { set, config: of }) = means.prior else {
        experiment::prior(&mut Run { set: means.set, playground, config, ledger, observer })?;
        return Ok(());
    };
    let (mut own, of) = (InMemory::default(), Config { seed: config.seed, ..of.clone() });
    experiment::prior(&mut Run { set, playground, config: &of, ledger: &mut own, observer })?;
    experiment::hand_on_prior(&own, ledger)
}

/// What meta-training says of each of its updates.
#[derive(Default)]
struct MetaUpdates {
    count: usize,
    explained: Vec<f64>,
}

impl Observer for MetaUpdates {
    fn on(&mut self, event: Event<'_>) -> Result<()> {
        if let Event::Measured { stage: meta_train::STAGE, numbers, .. } = event {
            self.count += 1;
            let explained = numbers.iter().filter(|(name, _)| *name == meta_train::ENCODING_EXPLAINED);
            self.explained.extend(explained.map(|(_, value)| value));
        }
        Ok(())
    }
}

impl MetaUpdates {
    fn told(&self) -> Option<PriorLearned> {
        let last_half = &self.explained[self.explained.len() / 2..];
        let explained = Some(statistics::mean_or_zero(last_half))
            .filter(|explained| !last_half.is_empty() && explained.is_finite());
        (self.count > 0).then_some(PriorLearned { meta_updates: self.count, explained })
    }
}

/// The mean over the repeats of what was played before each inner update; `None` where nothing was.
fn adaptation(table: &ScoreTable) -> Option<Adaptation> {
    let of_repeat = |reports: &Vec<UpdateReport>| -> Option<Vec<Score>> {
        reports.iter().map(|report| report.score.filter(|score| score.is_finite())).collect()
    };
    let of_demo = |of: &Suitability| -> Option<Vec<Score>> {
        let repeats: Vec<Vec<Score>> = of.curves.iter().map(of_repeat).collect::<Option<_>>()?;
        let points = repeats.iter().map(Vec::len).min().filter(|points| *points > 0)?;
        let at = |point: usize| statistics::mean_of(repeats.iter().map(|scores| scores[point]));
        Some((0..points).map(at).collect())
    };
    let score: Vec<Vec<Score>> = table.suitabilities.iter().map(of_demo).collect::<Option<_>>()?;
    let points = score.iter().map(Vec::len).min()?;
    Some(Adaptation { updates: (0..points).collect(), score })
}

/// Selects a subset by weights once (Algorithm 3), from the prior that judging with this seed starts from.
///
/// # Errors
/// `is_diverged` if learning does, `is_simulation` if the simulator fails, `is_bad_config` if the method has no weights.
pub fn weighing(means: &Means<'_>, seed: u64, clock: &mut dyn FnMut() -> f64) -> Result<WeighingResult> {
    let playground = Playground::new(means.task);
    let config = Config { seed, ..means.config.clone() };
    let mut ledger = InMemory::default();
    let mut passed = Passed::from_now(&playground, clock);
    learn_prior(means, &playground, &config, &mut ledger, &mut Silent)?;
    let once = passed.since_last();
    let mut run = Run {
        set: means.set,
        playground: &playground,
        config: &config,
        ledger: &mut ledger,
        observer: &mut Silent,
    };
    let prior = experiment::prior(&mut run)?;
    let weighing = experiment::weighing(&mut run, &prior)?;
    let weights =
        weighing.rounds.iter().map(|round| round.weights.iter().map(|(_, weight)| weight).collect());
    let mut demos = weighing.demos.clone();
    demos.sort_unstable();
    Ok(WeighingResult {
        weights: weights.collect(),
        end: weighing.end,
        demos,
        once,
        weighing: passed.since_last(),
    })
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
    let task = means.task.specification();
    let quota = |set, config| {
        let (playground, ledger, observer) =
            (&Playground::new(means.task), &mut InMemory::default(), &mut Silent);
        experiment::budget(&Run { set, playground, config, ledger, observer }).quota
    };
    let judged = |set: &DemonstrationSet, config: &Config| {
        Effort::of(set.len(), task, &config.judge, Some(&config.inner), false).steps()
    };
    let of = |judge: &Judge| match (judge, means.prior) {
        // Which a study does not ask.
        (Judge::Trainer, _) => 0,
        (Judge::Paper, None) => quota(means.set, means.config),
        (Judge::Paper, Some(PriorOf { set, config })) => {
            quota(set, config).saturating_sub(judged(set, config)) + judged(means.set, means.config)
        }
        (Judge::Cloning, _) => {
            let judging = &means.config.cloning_judge.judging;
            let inner = &experiment::cloning_update(means.config);
            Effort::of(means.set.len(), task, judging, Some(inner), true).steps()
        }
    };
    means.config.judges.each().iter().map(of).sum()
}

/// Environment steps that weighing may take at most, its prior among them, where episodes last to the horizon.
///
/// # Errors
/// `is_bad_config` if the method has no weights.
pub fn planned_weighing(means: &Means<'_>) -> Result<u64> {
    let playground = &Playground::new(means.task);
    let steps = |set, config, goal| -> Result<u64> {
        let (ledger, observer) = (&mut InMemory::default(), &mut Silent);
        let planned = forecast::planned(&Run { set, playground, config, ledger, observer }, goal)?;
        Ok(planned.iter().map(|stage| stage.environment_steps).sum())
    };
    let whole = steps(means.set, means.config, Goal::Weighing)?;
    let Some(PriorOf { set, config }) = means.prior else { return Ok(whole) };
    let own = steps(means.set, means.config, Goal::Prior)?;
    Ok(whole - own + steps(set, config, Goal::Prior)?)
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

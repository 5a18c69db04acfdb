//! What a run will cost, before it begins: environment steps and updates by counting, minutes by trying.
//!
//! Counting is exact where episodes last to the horizon.
//! For the minutes, a little of each kind of work that the run holds is done on the user's own task with the run's own sizes,
//! and thrown away; how long that takes, a clock says that is passed in, since the library has none.
//! Untrained policies are timed, and trained ones may touch the ground more or less often, so that the minutes are a rough
//! guide.

mod counting;

use rayon::prelude::*;
use serde::Serialize;

use crate::basics::error::Result;
use crate::basics::ledger::Ledger;
use crate::basics::observer::Silent;
use crate::basics::seed::Seed;
use crate::learning::adapt::{self, Course, InnerUpdate, Learner};
use crate::math::rows::Rows;
use crate::results::panel::Judge;
use crate::run::experiment::{self, Run};
use crate::stages::demonstrator::{self, DemonstratorState, DemonstratorTraining};
use crate::stages::judge;
use crate::stages::meta_train::{self, MetaState, MetaTraining};
use crate::stages::referee::imitation_by;
use crate::world::environment::EnvVariant;
use crate::world::policy::Policy;
use crate::world::rollout::{self, Acting, Playground};

use counting::Piece;
pub use counting::{Goal, Planned, Recording, planned, planned_recording};

/// What a run will cost.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Forecast {
    /// What is still to be done, in the order of the flow; empty if all is done.
    pub stages: Vec<Foreseen>,
    /// Environment steps in all.
    pub environment_steps: u64,
    /// Minutes in all.
    pub minutes: f64,
}

impl Forecast {
    /// This and another after it; stages of one name become one.
    pub fn and(mut self, other: Self) -> Self {
        for stage in other.stages {
            match self.stages.iter_mut().find(|known| known.planned.stage == stage.planned.stage) {
                Some(known) => known.add(&stage),
                None => self.stages.push(stage),
            }
        }
        self.environment_steps += other.environment_steps;
        self.minutes += other.minutes;
        self
    }

    /// Whether a judge has still to judge.
    pub fn has_to_judge(&self, judge: Judge) -> bool {
        let stage = experiment::stage_name(judge::STAGE, judge.name());
        self.stages.iter().any(|foreseen| foreseen.planned.stage == stage)
    }

    /// That of a run which is finished.
    pub fn nothing() -> Self {
        Self { stages: Vec::new(), environment_steps: 0, minutes: 0.0 }
    }
}

/// A stage with its time.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Foreseen {
    /// What is planned.
    #[serde(flatten)]
    pub planned: Planned,
    /// Minutes that it will take.
    pub minutes: f64,
}

impl Foreseen {
    fn add(&mut self, other: &Self) {
        self.minutes += other.minutes;
        self.planned.environment_steps += other.planned.environment_steps;
        self.planned.updates += other.planned.updates;
        self.planned.at_most |= other.planned.at_most;
        self.planned.by_trainer += other.planned.by_trainer;
    }
}

/// Seconds since some moment.
pub type Clock<'a> = &'a mut dyn FnMut() -> f64;

/// What a run has still to do until a goal is reached, and how long that will take; nothing is kept.
///
/// # Errors
/// What the run itself would meet at its beginning: a result or checkpoint that cannot be read, a simulator that fails.
pub fn forecast(run: &Run<'_>, goal: Goal<'_>, clock: Clock<'_>) -> Result<Forecast> {
    let probe = Probe { run };
    timed(planned(run, goal)?, &mut |piece| probe.seconds_per_unit(piece, clock))
}

/// Times each kind of work once.
fn timed(stages: Vec<Planned>, seconds_per_unit: &mut dyn FnMut(&Piece) -> Result<f64>) -> Result<Forecast> {
    let mut known: Vec<(Piece, f64)> = Vec::new();
    let mut foreseen = Vec::with_capacity(stages.len());
    for planned in stages {
        let mut seconds = 0.0;
        for (piece, units) in planned.pieces.iter().filter(|(_, units)| *units > 0.0) {
            let found = known.iter().find(|(timed, _)| timed == piece).map(|(_, seconds)| *seconds);
            let each = match found {
                Some(each) => each,
                None => seconds_per_unit(piece)?,
            };
            if found.is_none() {
                known.push((piece.clone(), each));
            }
            seconds += units * each;
        }
        foreseen.push(Foreseen { planned, minutes: seconds / SECONDS_PER_MINUTE });
    }
    Ok(Forecast {
        environment_steps: foreseen.iter().map(|stage| stage.planned.environment_steps).sum(),
        minutes: foreseen.iter().map(|stage| stage.minutes).sum(),
        stages: foreseen,
    })
}

const SECONDS_PER_MINUTE: f64 = 60.0;

/// A kind of work is tried for at least so long, or so often.
const ENOUGH_SECS: f64 = 1.0;
const ENOUGH_TRIALS: usize = 10;

/// Seconds per unit of `work`, which returns how many units it did.
///
/// The first trial also makes what later ones find ready, and counts only where it is long by itself.
fn seconds_per_unit(clock: Clock<'_>, mut work: impl FnMut() -> Result<f64>) -> Result<f64> {
    let mut trial = || {
        let begin = clock();
        let units = work()?;
        Ok::<_, crate::Error>((clock() - begin, units))
    };
    let (first_secs, units) = trial()?;
    if first_secs >= ENOUGH_SECS {
        return Ok(first_secs / units);
    }
    let (mut secs, mut units) = (0.0, 0.0);
    for _ in 0..ENOUGH_TRIALS {
        let (more_secs, more) = trial()?;
        (secs, units) = (secs + more_secs, units + more);
        if secs >= ENOUGH_SECS {
            break;
        }
    }
    Ok(secs / units)
}

/// Does a little of the work of a run, to be timed.
struct Probe<'a, 'r> {
    run: &'a Run<'r>,
}

impl Probe<'_, '_> {
    fn seconds_per_unit(&self, piece: &Piece, clock: Clock<'_>) -> Result<f64> {
        let (config, seed) = (self.run.config, Seed::new(self.run.config.seed).of("forecast"));
        match *piece {
            Piece::Round { meta_batch } => self.round(meta_batch, &seed, clock),
            Piece::Inner { judge: Judge::Cloning } => {
                self.updates_at_once(&experiment::cloning_update(config), &seed, clock)
            }
            Piece::Inner { judge: Judge::Paper } => self.updates_at_once(&config.inner, &seed, clock),
            Piece::Inner { judge: Judge::Trainer } => unreachable!("a trainer makes no updates of ours"),
            Piece::PreTraining { demonstrations } => {
                self.update(&config.inner, 1, demonstrations, &seed, clock)
            }
            Piece::Imitation { rule, at_once, demonstrations } => {
                let update = imitation_by(rule, &config.imitate).update;
                self.update(&update, at_once, demonstrations, &seed, clock)
            }
            Piece::Evaluation { episodes } => {
                playing_seconds(self.run.playground, &self.untrained(&seed).policy, episodes, &seed, clock)
            }
            Piece::Demonstrator => unreachable!("a job trains no demonstrator"),
        }
    }

    fn untrained(&self, seed: &Seed) -> Learner {
        let hidden = &self.run.config.meta_train.discriminator_hidden;
        Learner::untrained(self.run.set, &self.run.config.policy, hidden, seed)
    }

    fn round(&self, meta_batch: usize, seed: &Seed, clock: Clock<'_>) -> Result<f64> {
        let Run { set, playground, config, .. } = self.run;
        let information = experiment::information(config);
        let learner = self.untrained(seed);
        let mut state = Some(MetaState::from_prior(set, learner, information, seed));
        seconds_per_unit(clock, || {
            let from = state.take().expect("each trial leaves one");
            let training = MetaTraining { rounds: from.rounds + 1, meta_batch, ..config.meta_train.clone() };
            let learning = experiment::learning_by(config, &training);
            state = Some(meta_train::meta_train(set, playground, &learning, from, seed, &mut Silent)?);
            Ok(1.0)
        })
    }

    /// Updates toward one demonstration each, spread over the threads as judging does.
    fn updates_at_once(&self, inner: &InnerUpdate, seed: &Seed, clock: Clock<'_>) -> Result<f64> {
        let at_once = UPDATES_PER_THREAD * rayon::current_num_threads();
        Ok(self.update(inner, at_once, 1, seed, clock)? / at_once as f64)
    }

    /// So many updates at once, each toward so many demonstrations.
    fn update(
        &self,
        inner: &InnerUpdate,
        at_once: usize,
        demonstrations: usize,
        seed: &Seed,
        clock: Clock<'_>,
    ) -> Result<f64> {
        let (learner, demonstrated) = (self.untrained(seed), self.demonstrated(seed, demonstrations));
        let playground = self.run.playground;
        seconds_per_unit(clock, || {
            let adapt = |number| adapted(playground, &learner, &demonstrated, inner, &seed.at(number));
            (0..at_once).into_par_iter().try_for_each(adapt)?;
            Ok(1.0)
        })
    }

    fn demonstrated(&self, seed: &Seed, demonstrations: usize) -> Vec<Rows> {
        let mut pairs = self.untrained(seed).demonstrated_pairs(self.run.set);
        let first = self.run.set.ids().into_iter().take(demonstrations);
        first.map(|demo| std::mem::take(&mut pairs[demo.0])).collect()
    }
}

/// One update.
fn adapted(
    playground: &Playground<'_>,
    learner: &Learner,
    demonstrated: &[Rows],
    inner: &InnerUpdate,
    seed: &Seed,
) -> Result<()> {
    let course = Course { inner, iterations: 1, averaged: 1 };
    let demonstrated: Vec<&Rows> = demonstrated.iter().collect();
    adapt::adapt(learner, &demonstrated, playground, EnvVariant(0), &course, seed).map(drop)
}

/// Enough for the threads to share them out evenly.
const UPDATES_PER_THREAD: usize = 4;

/// Who demonstrates in a recording.
#[derive(Clone, Copy, Debug)]
pub enum By<'a> {
    /// A demonstrator that is to be trained.
    Training(&'a DemonstratorTraining),
    /// One that is trained already.
    Trained(&'a Policy),
}

/// What a recording has still to do, and how long that will take; nothing is kept.
pub fn forecast_recording(
    playground: &Playground<'_>,
    recording: &Recording<'_>,
    ledger: &dyn Ledger,
    clock: Clock<'_>,
) -> Result<Forecast> {
    let seed = Seed::new(0).of("forecast");
    timed(planned_recording(playground, recording, ledger)?, &mut |piece| match (piece, recording.by) {
        (Piece::Demonstrator, By::Training(training)) => training_seconds(playground, training, &seed, clock),
        (_, By::Training(training)) => {
            let short = DemonstratorState::start(playground, training, &seed)?;
            playing_seconds(playground, short.policy(), recording.assessed, &seed, clock)
        }
        (_, By::Trained(policy)) => playing_seconds(playground, policy, recording.assessed, &seed, clock),
    })
}

/// Seconds per environment step of a demonstrator that learns.
fn training_seconds(
    playground: &Playground<'_>,
    training: &DemonstratorTraining,
    seed: &Seed,
    clock: Clock<'_>,
) -> Result<f64> {
    let short = DemonstratorTraining { updates: 2, enough_success: f64::INFINITY, ..training.clone() };
    seconds_per_unit(clock, || {
        let before = playground.steps_taken();
        let state = DemonstratorState::start(playground, &short, seed)?;
        demonstrator::train(playground, &short, state, seed, &mut Silent)?;
        Ok((playground.steps_taken() - before) as f64)
    })
}

/// No more episodes than these are tried at once; what is asked of a step is the same with more.
const TRIED_EPISODES: usize = 10;

/// Seconds per environment step of a policy that is evaluated.
fn playing_seconds(
    playground: &Playground<'_>,
    policy: &Policy,
    episodes: usize,
    seed: &Seed,
    clock: Clock<'_>,
) -> Result<f64> {
    seconds_per_unit(clock, || {
        let seeds = seed.of("evaluate").many(episodes.min(TRIED_EPISODES));
        let played = rollout::play(playground, policy, Acting::Sampled, EnvVariant(0), seeds)?;
        Ok(played.iter().map(|played| played.steps() as f64).sum())
    })
}

//! Playing: policy × task × seeds → rollouts, by as many workers as can be busy, in a fixed order.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, OnceLock};

use rayon::prelude::*;

use crate::basics::error::{Error, Result};
use crate::basics::seed::Seed;
use crate::data::trajectory::Trajectory;
use crate::math::statistics;
use crate::world::environment::{EnvVariant, Episode, Led, Rollout, Specification, Task, Worker};
use crate::world::heuristic::Score;
pub use crate::world::policy::Acting;
use crate::world::policy::Policy;
use crate::world::trainer::{Apprentice, Trainer};

/// A task with the workers that play it; a worker remembers nothing between episodes.
pub struct Playground<'t> {
    task: &'t dyn Task,
    idle: Mutex<Vec<Box<dyn Worker>>>,
    width: OnceLock<usize>,
    /// Where workers play that are waited for; the threads that learn, if there is none.
    waiting: Option<rayon::ThreadPool>,
    /// Who trains policies of its own to be played here.
    trainer: Option<&'t dyn Trainer>,
    steps: AtomicU64,
    again: Mutex<PlayedAgain>,
}

/// Episodes that were played again from another start, since the simulation had run away.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PlayedAgain {
    /// How often.
    pub times: u64,
    /// What was wrong with the one that was found first.
    pub why: String,
}

/// How often an episode is begun before its simulation counts as one that cannot be played: what happens once in a hundred
/// episodes never happens so often in a row.
const ATTEMPTS: usize = 5;

impl<'t> Playground<'t> {
    /// A playground for a task; workers are made when they are needed, and play on the threads that learn.
    pub fn new(task: &'t dyn Task) -> Self {
        Self {
            task,
            idle: Mutex::default(),
            width: OnceLock::new(),
            waiting: None,
            trainer: None,
            steps: AtomicU64::new(0),
            again: Mutex::default(),
        }
    }

    /// A playground whose workers play on `count` threads of their own.
    ///
    /// It is for workers that are waited for, such as simulators in other processes: these can be more than there are
    /// processors, while as many threads learn as before.
    /// What is played is the same.
    ///
    /// # Errors
    /// `is_bad_config` if `count` is 0, or more threads than the system has to give.
    pub fn with_workers(task: &'t dyn Task, count: usize) -> Result<Self> {
        if count == 0 {
            return Err(Error::bad_config("0 workers: there must be at least 1"));
        }
        let waiting = rayon::ThreadPoolBuilder::new().num_threads(count).build();
        let waiting = waiting.map_err(|error| Error::bad_config(format!("{count} workers: {error}")))?;
        Ok(Self { waiting: Some(waiting), ..Self::new(task) })
    }

    /// The same with somebody else's trainer, whose policies judging or the referee plays here.
    #[must_use]
    pub fn with_trainer(self, trainer: &'t dyn Trainer) -> Self {
        Self { trainer: Some(trainer), ..self }
    }

    /// Somebody else's trainer, where there is one.
    pub fn trainer(&self) -> Option<&'t dyn Trainer> {
        self.trainer
    }

    /// The task that is played.
    pub fn task(&self) -> &'t dyn Task {
        self.task
    }

    /// The task's sizes and names.
    pub fn specification(&self) -> &'t Specification {
        self.task.specification()
    }

    /// K of one episode (§4.3).
    pub fn score(&self, trajectory: &Trajectory) -> Score {
        self.task.heuristic().score(trajectory.measurements())
    }

    /// Share of the episodes that reached the task's goal; `None` where the task does not say.
    pub fn success_rate(&self, trajectories: &[Trajectory]) -> Option<f64> {
        let outcomes: Option<Vec<bool>> =
            trajectories.iter().map(|played| self.task.succeeded(played.measurements())).collect();
        outcomes.map(|outcomes| {
            outcomes.iter().filter(|succeeded| **succeeded).count() as f64 / outcomes.len().max(1) as f64
        })
    }

    /// Mean true return of the episodes; `None` where the task does not say. For reports only.
    pub fn mean_true_return(&self, trajectories: &[Trajectory]) -> Option<f64> {
        let returns: Option<Vec<f64>> =
            trajectories.iter().map(|played| self.task.true_return(played.measurements())).collect();
        returns.map(|returns| statistics::mean_or_zero(&returns))
    }

    /// Environment steps taken here so far.
    pub fn steps_taken(&self) -> u64 {
        self.steps.load(Ordering::Relaxed)
    }

    /// What had to be played again so far.
    pub fn played_again(&self) -> PlayedAgain {
        self.again.lock().expect("no thread panics while it holds the lock").clone()
    }

    /// How many episodes a worker is asked for at once.
    fn width(&self) -> Result<usize> {
        if let Some(width) = self.width.get() {
            return Ok(*width);
        }
        let worker = self.borrow()?;
        let width = *self.width.get_or_init(|| worker.width().max(1));
        self.give_back(worker);
        Ok(width)
    }

    /// Episodes of one worker. One whose simulation runs away is no outcome of the policy, and with its seed it would run away
    /// again, so it is begun from another start that follows from this seed.
    fn play(&self, episodes: &[Episode<'_>]) -> Result<Vec<Rollout>> {
        match self.play_together(episodes) {
            Err(error) if error.is_diverged() => {
                let each: Result<Vec<_>> = episodes.iter().map(|episode| self.play_anew(episode)).collect();
                Ok(each?.into_iter().flatten().collect())
            }
            outcome => outcome,
        }
    }

    /// An episode by itself, begun as often as it takes; the error is that of the last attempt.
    fn play_anew(&self, episode: &Episode<'_>) -> Result<Vec<Rollout>> {
        let outcome = anew(episode.seed, |seed| self.play_together(&[Episode { seed, ..*episode }]));
        outcome.map(|begun| self.noted(begun))
    }

    /// What was played in the end; the attempts before it are counted.
    fn noted(&self, Begun { played, failures }: Begun) -> Vec<Rollout> {
        if let Some(first) = failures.first() {
            let mut again = self.again.lock().expect("no thread panics while it holds the lock");
            if again.times == 0 {
                again.why = first.message().to_owned();
            }
            again.times += failures.len() as u64;
        }
        played
    }

    /// Episodes of one worker. It comes back here only if all went well: after an error or a panic it is dropped.
    fn play_together(&self, episodes: &[Episode<'_>]) -> Result<Vec<Rollout>> {
        let mut worker = self.borrow()?;
        let rollouts = worker.play(episodes).map_err(|error| in_task(error, self.specification()))?;
        self.finished(worker, rollouts, episodes.len())
    }

    /// The same for episodes in which somebody else's policy acts.
    fn play_led(&self, by: &mut dyn Apprentice, episodes: &[Led<'_>]) -> Result<Vec<Rollout>> {
        let mut rollouts = Vec::with_capacity(episodes.len());
        for episode in episodes {
            let outcome = anew(episode.seed, |seed| {
                by.begin()?;
                let mut worker = self.borrow()?;
                let rollout = worker.play_led(Led { seed, ..*episode }, by);
                let rollout = rollout.map_err(|error| in_task(error, self.specification()))?;
                self.finished(worker, vec![rollout], 1)
            });
            rollouts.extend(self.noted(outcome?));
        }
        Ok(rollouts)
    }

    /// What a worker has played, if it is what was asked for; the worker comes back.
    fn finished(
        &self,
        worker: Box<dyn Worker>,
        rollouts: Vec<Rollout>,
        wanted: usize,
    ) -> Result<Vec<Rollout>> {
        check(&rollouts, wanted, self.specification())?;
        self.give_back(worker);
        self.check_scores(&rollouts).map_err(|error| in_task(error, self.specification()))?;
        let steps = rollouts.iter().map(|rollout| rollout.trajectory.steps() as u64).sum();
        self.steps.fetch_add(steps, Ordering::Relaxed);
        Ok(rollouts)
    }

    /// A heuristic that is not a number is divergence, of the simulation or in the task file.
    fn check_scores(&self, rollouts: &[Rollout]) -> Result<()> {
        let scores = rollouts.iter().map(|rollout| self.score(&rollout.trajectory));
        match scores.into_iter().find(|score| !score.is_finite()) {
            Some(score) => Err(Error::diverged(format!("the heuristic of an episode is {score}"))),
            None => Ok(()),
        }
    }

    fn borrow(&self) -> Result<Box<dyn Worker>> {
        let idle = self.idle.lock().expect("no thread panics while it holds the lock").pop();
        idle.map_or_else(|| self.task.worker(), Ok)
    }

    fn give_back(&self, worker: Box<dyn Worker>) {
        self.idle.lock().expect("no thread panics while it holds the lock").push(worker);
    }
}

/// An episode that was begun until it did not run away.
struct Begun {
    /// It alone.
    played: Vec<Rollout>,
    /// Why the attempts before it failed.
    failures: Vec<Error>,
}

/// Begins an episode until it does not run away; other seeds follow from the first, so that it is the same on any thread.
fn anew(seed: &Seed, mut attempt: impl FnMut(&Seed) -> Result<Vec<Rollout>>) -> Result<Begun> {
    let mut failures = Vec::new();
    loop {
        let outcome = match failures.len() {
            0 => attempt(seed),
            failed => attempt(&seed.of("again").at(failed)),
        };
        match outcome {
            Err(error) if error.is_diverged() && failures.len() + 1 < ATTEMPTS => failures.push(error),
            outcome => return Ok(Begun { played: outcome?, failures }),
        }
    }
}

/// An error of a simulation that ran away, with the task and what finds its cause.
fn in_task(error: Error, task: &Specification) -> Error {
    if !error.is_diverged() {
        return error;
    }
    error.during(&format!("playing the task '{}'", task.name)).with_hint(
        "`demosift task check TASK` tries the task with random actions, and says what in its model is wrong",
    )
}

/// What comes from a worker may come from another program, which is not believed.
fn check(rollouts: &[Rollout], wanted: usize, specification: &Specification) -> Result<()> {
    if rollouts.len() != wanted {
        let found = rollouts.len();
        return Err(Error::simulation(format!(
            "a worker was asked for {wanted} episodes and played {found}"
        )));
    }
    let Specification { name, observation_size, action_size, measurements, horizon, .. } = specification;
    for Rollout { trajectory, .. } in rollouts {
        for (what, found, wanted) in [
            ("observations", trajectory.observations().width(), *observation_size),
            ("actions", trajectory.actions().width(), *action_size),
            ("measurements", trajectory.measurements().width(), measurements.len()),
        ] {
            if found != wanted {
                return Err(Error::simulation(format!(
                    "a worker played an episode with {found} {what} a step, and the task '{name}' has {wanted}"
                )));
            }
        }
        if trajectory.steps() > *horizon {
            return Err(Error::simulation(format!(
                "a worker played an episode of {} steps, and the horizon of the task '{name}' is {horizon}",
                trajectory.steps()
            )));
        }
    }
    Ok(())
}

/// One episode a seed, in the order of the seeds, whatever the number of threads.
pub fn play(
    playground: &Playground<'_>,
    policy: &Policy,
    acting: Acting,
    variant: EnvVariant,
    seeds: Vec<Seed>,
) -> Result<Vec<Trajectory>> {
    let episode = |seed| Episode { policy, acting, variant, seed, keep_states: false };
    let episodes: Vec<Episode<'_>> = seeds.iter().map(episode).collect();
    let rollouts = play_episodes(playground, &episodes)?;
    Ok(rollouts.into_iter().map(|rollout| rollout.trajectory).collect())
}

/// One episode a seed in which somebody else's policy acts, one after the other.
///
/// # Errors
/// Those of the policy and of the task.
pub fn play_led(
    playground: &Playground<'_>,
    by: &mut dyn Apprentice,
    variant: EnvVariant,
    seeds: &[Seed],
) -> Result<Vec<Trajectory>> {
    let episodes: Vec<Led<'_>> = seeds.iter().map(|seed| Led { variant, seed }).collect();
    let rollouts = playground.play_led(by, &episodes)?;
    Ok(rollouts.into_iter().map(|rollout| rollout.trajectory).collect())
}

/// One rollout an episode, in their order, whatever the number of threads.
///
/// A worker gets as many episodes at once as its width says, counted from the first: which episodes are played together does
/// not depend on the number of threads either.
pub fn play_episodes(playground: &Playground<'_>, episodes: &[Episode<'_>]) -> Result<Vec<Rollout>> {
    if episodes.is_empty() {
        return Ok(Vec::new());
    }
    let width = playground.width()?;
    let play = || episodes.par_chunks(width).map(|chunk| playground.play(chunk)).collect();
    let chunks: Result<Vec<Vec<Rollout>>> = match &playground.waiting {
        Some(threads) => threads.install(play),
        None => play(),
    };
    Ok(chunks?.into_iter().flatten().collect())
}

#[cfg(test)]
mod tests;

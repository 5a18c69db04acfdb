//! Playing: policy × environment × seeds → trajectories, in parallel, in a fixed order.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::basics::error::{Error, Result};
use crate::basics::seed::Seed;
use crate::data::trajectory::{Parts, StateLog, Trajectory};
use crate::math::rows::Rows;
use crate::math::statistics;
use crate::world::environment::{EnvVariant, Environment, Specification, Task};
use crate::world::heuristic::Score;
use crate::world::policy::{Player, Policy};

/// How a policy acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Acting {
    /// Draws from the Gaussian.
    Sampled,
    /// Takes the mean.
    Mean,
}

/// A task with the instances that workers use; an instance remembers nothing between episodes.
pub struct Playground<'t> {
    task: &'t dyn Task,
    idle: Mutex<Vec<Box<dyn Environment>>>,
    steps: AtomicU64,
}

impl<'t> Playground<'t> {
    /// A playground for a task; instances are made when they are needed.
    pub fn new(task: &'t dyn Task) -> Self {
        Self { task, idle: Mutex::new(Vec::new()), steps: AtomicU64::new(0) }
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

    fn borrow(&self) -> Result<Box<dyn Environment>> {
        let idle = self.idle.lock().expect("no worker panics while it holds the lock").pop();
        idle.map_or_else(|| self.task.environment(), Ok)
    }

    fn give_back(&self, environment: Box<dyn Environment>) {
        self.idle.lock().expect("no worker panics while it holds the lock").push(environment);
    }
}

/// One episode a seed, in the order of the seeds, whatever the number of threads.
pub fn play(
    playground: &Playground<'_>,
    policy: &Policy,
    acting: Acting,
    variant: EnvVariant,
    seeds: Vec<Seed>,
) -> Result<Vec<Trajectory>> {
    seeds.into_par_iter().map(|seed| play_episode(playground, policy, acting, variant, seed)).collect()
}

fn play_episode(
    playground: &Playground<'_>,
    policy: &Policy,
    acting: Acting,
    variant: EnvVariant,
    seed: Seed,
) -> Result<Trajectory> {
    let mut environment = playground.borrow()?;
    let played = play_in(environment.as_mut(), playground.specification(), policy, acting, variant, seed);
    playground.give_back(environment);
    let scored = |trajectory: Trajectory| match playground.score(&trajectory) {
        score if score.is_finite() => Ok(trajectory),
        score => Err(Error::diverged(format!("the heuristic of an episode is {score}"))),
    };
    let trajectory = played.and_then(scored).map_err(|error| in_task(error, playground.specification()))?;
    playground.steps.fetch_add(trajectory.steps() as u64, Ordering::Relaxed);
    Ok(trajectory)
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

/// The states from which an episode's actions were taken, found by playing them again from the episode's seed.
///
/// `None` where the environment has no simulator.
pub fn state_log(
    playground: &Playground<'_>,
    trajectory: &Trajectory,
    variant: EnvVariant,
    seed: &Seed,
) -> Result<Option<StateLog>> {
    let mut environment = playground.borrow()?;
    let mut observation = vec![0.0; playground.specification().observation_size];
    let mut measurements = vec![0.0; playground.specification().measurements.len()];
    let mut log = Some(StateLog::default());
    environment.reset(variant, seed.of("reset"), &mut observation, &mut measurements);
    for action in trajectory.actions().iter() {
        log = log.zip(environment.simulator_state()).map(|(mut log, state)| {
            log.qpos.extend_from_slice(state.qpos);
            log.qvel.extend_from_slice(state.qvel);
            log
        });
        environment.step(action, &mut observation, &mut measurements);
    }
    playground.give_back(environment);
    Ok(log)
}

/// One episode in an environment of one's own; the reset draws from the seed's part `reset`, the actions from `act`.
pub fn play_in(
    environment: &mut dyn Environment,
    specification: &Specification,
    policy: &Policy,
    acting: Acting,
    variant: EnvVariant,
    seed: Seed,
) -> Result<Trajectory> {
    let horizon = specification.horizon;
    let mut observation = vec![0.0; specification.observation_size];
    let mut measurements = vec![0.0; specification.measurements.len()];
    let mut action = vec![0.0; specification.action_size];
    let mut parts = Parts {
        observations: Rows::with_capacity(observation.len(), horizon + 1),
        actions: Rows::with_capacity(action.len(), horizon),
        measurements: Rows::with_capacity(measurements.len(), horizon + 1),
        task_rewards: Vec::with_capacity(horizon),
        terminated: false,
    };
    let mut player = Player::new(policy);
    let mut rng = seed.of("act").into_rng();
    environment.reset(variant, seed.of("reset"), &mut observation, &mut measurements);
    parts.observations.push(&observation);
    parts.measurements.push(&measurements);
    while parts.actions.len() < horizon && !parts.terminated {
        match acting {
            Acting::Sampled => player.sample(&observation, &mut rng, &mut action),
            Acting::Mean => player.mean(&observation, &mut action),
        }
        let outcome = environment.step(&action, &mut observation, &mut measurements);
        parts.actions.push(&action);
        parts.observations.push(&observation);
        parts.measurements.push(&measurements);
        parts.task_rewards.push(outcome.task_reward);
        parts.terminated = outcome.terminated;
    }
    Trajectory::new(parts)
}

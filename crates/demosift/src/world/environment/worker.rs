//! Whole episodes: what is asked of a worker, what comes of it, and the worker that steps an [`Environment`].
//!
//! A step cannot fail and an episode can: a simulator in another process dies, or its environment raises an exception, and
//! one answer an episode is also what such a process can afford to send.

use super::{EnvVariant, Environment, Specification};
use crate::basics::error::{Error, Result};
use crate::basics::seed::Seed;
use crate::data::trajectory::{Ended, Parts, StateLog, Trajectory};
use crate::math::rows::Rows;
use crate::world::policy::{Acting, Player, Policy};
use crate::world::trainer::Apprentice;

/// One episode that is to be played; what comes of it depends on this alone.
#[derive(Clone, Copy, Debug)]
pub struct Episode<'a> {
    /// Who acts.
    pub policy: &'a Policy,
    /// How it acts.
    pub acting: Acting,
    /// e_j.
    pub variant: EnvVariant,
    /// All random numbers: the reset draws from the seed's part `reset`, the actions from `act`.
    pub seed: &'a Seed,
    /// Whether the simulator's states are wanted, for replays.
    pub keep_states: bool,
}

/// An episode in which somebody else's policy acts.
#[derive(Clone, Copy, Debug)]
pub struct Led<'a> {
    /// e_j.
    pub variant: EnvVariant,
    /// Its part `reset` is that of the reset, as in an [`Episode`].
    pub seed: &'a Seed,
}

/// The result of an episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Rollout {
    /// τ.
    pub trajectory: Trajectory,
    /// The states from which its actions were taken, if they were asked for and there is a simulator.
    pub states: Option<StateLog>,
}

/// Plays whole episodes.
///
/// It remembers nothing between episodes, and all workers of a task play alike: who plays an episode, and with which others,
/// leaves no trace in it.
/// After an error or a panic it is thrown away, and another one is made for the next episode.
///
/// ```
/// use demosift::basics::seed::Seed;
/// use demosift::data::observation_filter::ObservationFilter;
/// use demosift::world::environment::{EnvVariant, Episode, Task};
/// use demosift::world::point_mass::PointMass;
/// use demosift::world::policy::{Acting, Policy, PolicyShape};
///
/// let shape = PolicyShape { hidden: vec![8], initial_std: 0.5 };
/// let policy = Policy::untrained(&shape, ObservationFilter::identity(4), 2, Seed::new(1));
/// let episode = Episode {
///     policy: &policy,
///     acting: Acting::Sampled,
///     variant: EnvVariant(0),
///     seed: &Seed::new(2),
///     keep_states: false,
/// };
/// let mut worker = PointMass::new().worker()?;
/// let rollouts = worker.play(&[episode, episode])?;
/// assert_eq!(rollouts[0].trajectory.steps(), 30);
/// assert_eq!(rollouts[0], rollouts[1], "the same episode again");
/// # Ok::<(), demosift::Error>(())
/// ```
pub trait Worker: Send {
    /// How many episodes it plays at once, the same for all workers of a task; more are never asked of it together.
    fn width(&self) -> usize {
        1
    }

    /// Plays episodes, from one to [`width`](Worker::width); one rollout each, in their order.
    ///
    /// # Errors
    /// `is_simulation` if the simulator failed, `is_diverged` if a number is not finite.
    fn play(&mut self, episodes: &[Episode<'_>]) -> Result<Vec<Rollout>>;

    /// Plays an episode in which somebody else's policy acts, which has begun it.
    ///
    /// # Errors
    /// As [`play`](Worker::play), and those of the policy; `is_bad_config` if the simulator plays policies of demosift only.
    fn play_led(&mut self, _episode: Led<'_>, _by: &mut dyn Apprentice) -> Result<Rollout> {
        Err(Error::bad_config(
            "the simulator of this task plays policies of demosift only, and none of a trainer",
        ))
    }
}

/// A worker that steps an environment: the way of all simulators that run in this process.
pub struct Stepped<E> {
    environment: E,
    specification: Specification,
}

impl<E: Environment> Stepped<E> {
    /// A worker for an environment of a task with this specification.
    pub fn new(environment: E, specification: &Specification) -> Self {
        Self { environment, specification: specification.clone() }
    }

    fn episode(&mut self, episode: &Episode<'_>) -> Result<Rollout> {
        let mut player = Player::new(episode.policy);
        let mut rng = episode.seed.of("act").into_rng();
        let led = Led { variant: episode.variant, seed: episode.seed };
        self.steps(led, episode.keep_states, |observation, action| {
            match episode.acting {
                Acting::Sampled => player.sample(observation, &mut rng, action),
                Acting::Mean => player.mean(observation, action),
            }
            Ok(())
        })
    }

    /// Plays an episode in which `act` fills the action on an observation.
    fn steps(
        &mut self,
        Led { variant, seed }: Led<'_>,
        keep_states: bool,
        mut act: impl FnMut(&[f32], &mut [f32]) -> Result<()>,
    ) -> Result<Rollout> {
        let Self { environment, specification } = self;
        let horizon = specification.horizon;
        let mut observation = vec![0.0; specification.observation_size];
        let mut measurements = vec![0.0; specification.measurements.len()];
        let mut action = vec![0.0; specification.action_size];
        let mut parts = Parts {
            observations: Rows::with_capacity(observation.len(), horizon + 1),
            actions: Rows::with_capacity(action.len(), horizon),
            measurements: Rows::with_capacity(measurements.len(), horizon + 1),
            task_rewards: Vec::with_capacity(horizon),
            ended: Ended::Horizon,
        };
        let mut states = keep_states.then(StateLog::default);
        environment.reset(variant, seed.of("reset"), &mut observation, &mut measurements);
        parts.observations.push(&observation);
        parts.measurements.push(&measurements);
        while parts.actions.len() < horizon && parts.ended == Ended::Horizon {
            act(&observation, &mut action)?;
            states = states.and_then(|log| with_state(log, environment));
            let outcome = environment.step(&action, &mut observation, &mut measurements);
            parts.actions.push(&action);
            parts.observations.push(&observation);
            parts.measurements.push(&measurements);
            parts.task_rewards.push(outcome.task_reward);
            if outcome.terminated {
                parts.ended = Ended::Terminated;
            }
        }
        let trajectory = Trajectory::new(parts).map_err(|error| match environment.trouble() {
            Some(words) if error.is_diverged() => Error::diverged(format!("{error}: {words}")),
            _ => error,
        })?;
        Ok(Rollout { trajectory, states })
    }
}

/// The log with the present state; none where there is no simulator.
fn with_state(mut log: StateLog, environment: &impl Environment) -> Option<StateLog> {
    let state = environment.simulator_state()?;
    log.qpos.extend_from_slice(state.qpos);
    log.qvel.extend_from_slice(state.qvel);
    Some(log)
}

impl<E: Environment> Worker for Stepped<E> {
    fn play(&mut self, episodes: &[Episode<'_>]) -> Result<Vec<Rollout>> {
        episodes.iter().map(|episode| self.episode(episode)).collect()
    }

    fn play_led(&mut self, episode: Led<'_>, by: &mut dyn Apprentice) -> Result<Rollout> {
        self.steps(episode, false, |observation, action| by.act(observation, action))
    }
}

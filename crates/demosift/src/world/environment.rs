//! The world in which an agent acts: tasks, their variants, and who plays episodes of them.

mod one_variant;
mod worker;

pub use one_variant::OneVariant;
pub use worker::{Episode, Led, Rollout, Stepped, Worker};

use crate::basics::counting::counted;
use crate::basics::error::{Error, Result};
use crate::basics::seed::Seed;
use crate::math::rows::Rows;
use crate::world::heuristic::Heuristic;

/// e_j: which goal of a multi-goal task (§3); a task with one goal has variant 0 only.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct EnvVariant(pub usize);

/// The sizes and names of a task, fixed for its life.
#[derive(Clone, Debug, PartialEq)]
pub struct Specification {
    /// The task's name, such as `free_throw`.
    pub name: String,
    /// Numbers in an observation.
    pub observation_size: usize,
    /// What an observation consists of, in order: the name of each part, and how many numbers it has.
    pub observation_parts: Vec<(String, usize)>,
    /// Numbers in an action; each means the whole range of an actuator over [−1, 1].
    pub action_size: usize,
    /// What −1 and 1 of each action mean to its actuator, `[act]`, in the actuator's own unit.
    pub control_ranges: Vec<[f64; 2]>,
    /// Names of the measurements, in the order of their columns.
    pub measurements: Vec<String>,
    /// Names of the variants; at least one.
    pub variants: Vec<String>,
    /// Control steps in an episode.
    pub horizon: usize,
    /// Simulated seconds of a control step.
    pub control_step_secs: f64,
    /// Whether the simulator itself says so; otherwise it is a guess, on which no set is refused.
    pub is_control_step_told: bool,
}

impl Specification {
    /// Control steps in a simulated second, to the nearest whole number and at least one.
    pub fn steps_per_sec(&self) -> u32 {
        (1.0 / self.control_step_secs).round().max(1.0) as u32
    }

    /// Whether a set with so many numbers in an observation and an action was recorded in such a task.
    ///
    /// # Errors
    /// `is_bad_input` if one of them differs.
    pub fn check_sizes(&self, observed: usize, acted: usize) -> Result<()> {
        let sizes = [("observation", observed, self.observation_size), ("action", acted, self.action_size)];
        for (what, found, wanted) in sizes {
            if found != wanted {
                return Err(Error::bad_input(format!(
                    "the demonstrations have {} in an {what}, but the task '{}' has {wanted}",
                    counted(found, "number"),
                    self.name
                ))
                .with_hint(if found > wanted {
                    format!(
                        "check that the set was recorded in this task; if the task has the first {wanted} of these, \
                         --{what}-columns takes them, such as {what}s[0:{wanted}]; `demosift inspect` names the columns"
                    )
                } else {
                    "check that the set was recorded in this task; a choice that is stored as one whole number (Discrete) must \
                     be written as the zeros and ones that the environment makes of it"
                        .to_owned()
                }));
            }
        }
        Ok(())
    }

    /// All variants, in order.
    pub fn variant_ids(&self) -> Vec<EnvVariant> {
        (0..self.variants.len()).map(EnvVariant).collect()
    }

    /// The variant called `name`; the error lists the names there are.
    pub fn variant(&self, name: &str) -> Result<EnvVariant> {
        self.variants.iter().position(|known| known == name).map(EnvVariant).ok_or_else(|| {
            Error::bad_input(format!(
                "no variant is called '{name}'; the task '{}' has: {}",
                self.name,
                self.variants.join(", ")
            ))
        })
    }

    /// The column of the measurement `name`; the error lists the names there are.
    pub fn measurement(&self, name: &str) -> Result<usize> {
        self.measurements.iter().position(|known| known == name).ok_or_else(|| {
            Error::bad_input(format!(
                "no measurement is called '{name}'; the task '{}' has: {}",
                self.name,
                self.measurements.join(", ")
            ))
        })
    }
}

/// A task: makes the workers that play it, and knows what a good outcome is.
///
/// A task in MuJoCo needs no Rust (see the crate `demosift-mujoco`); any other simulator stands behind this trait.
/// One that can be stepped from here is an [`Environment`] in a [`Stepped`] worker; one that lives elsewhere, or whose steps
/// can fail, is a [`Worker`] of its own.
/// Here a cart on a rail should come to rest at 1 m:
///
/// ```
/// use demosift::basics::seed::Seed;
/// use demosift::math::rows::Rows;
/// use demosift::world::environment::{
///     EnvVariant, Environment, Specification, StepOutcome, Stepped, Task, Worker,
/// };
/// use demosift::world::heuristic::{Heuristic, Score};
///
/// const CONTROL_STEP_SECS: f32 = 0.1;
///
/// struct Rail {
///     specification: Specification,
/// }
///
/// struct Cart {
///     position: f32,
///     velocity: f32,
/// }
///
/// /// − mean distance to the goal over the episode, in m.
/// struct NearTheGoal;
///
/// impl Heuristic for NearTheGoal {
///     fn score(&self, measurements: &Rows) -> Score {
///         let distances = measurements.iter().map(|row| f64::from((row[0] - 1.0).abs()));
///         -distances.sum::<f64>() / measurements.len() as f64
///     }
/// }
///
/// impl Task for Rail {
///     fn specification(&self) -> &Specification {
///         &self.specification
///     }
///     fn worker(&self) -> demosift::Result<Box<dyn Worker>> {
///         Ok(Box::new(Stepped::new(Cart { position: 0.0, velocity: 0.0 }, &self.specification)))
///     }
///     fn heuristic(&self) -> &dyn Heuristic {
///         &NearTheGoal
///     }
///     fn succeeded(&self, measurements: &Rows) -> Option<bool> {
///         measurements.iter().last().map(|row| (row[0] - 1.0).abs() < 0.1)
///     }
/// }
///
/// impl Environment for Cart {
///     fn reset(&mut self, _: EnvVariant, _: Seed, observation: &mut [f32], measurements: &mut [f32]) {
///         *self = Self { position: 0.0, velocity: 0.0 };
///         observation.copy_from_slice(&[self.position, self.velocity]);
///         measurements[0] = self.position;
///     }
///     fn step(&mut self, action: &[f32], observation: &mut [f32], measurements: &mut [f32]) -> StepOutcome {
///         self.velocity += (2.0 * action[0].clamp(-1.0, 1.0) - self.velocity) * CONTROL_STEP_SECS;
///         self.position += self.velocity * CONTROL_STEP_SECS;
///         observation.copy_from_slice(&[self.position, self.velocity]);
///         measurements[0] = self.position;
///         StepOutcome { task_reward: -(self.position - 1.0).abs(), terminated: false }
///     }
/// }
///
/// let rail = Rail {
///     specification: Specification {
///         name: "rail".to_owned(),
///         observation_size: 2,
///         observation_parts: vec![("position".to_owned(), 1), ("velocity".to_owned(), 1)],
///         action_size: 1,
///         control_ranges: vec![[-2.0, 2.0]], // m/s²
///         measurements: vec!["x".to_owned()],
///         variants: vec!["default".to_owned()],
///         horizon: 50,
///         control_step_secs: f64::from(CONTROL_STEP_SECS),
///         is_control_step_told: true,
///     },
/// };
///
/// // It plays: an untrained policy dawdles about the start.
/// use demosift::data::observation_filter::Moments;
/// use demosift::world::policy::{Policy, PolicyShape};
/// use demosift::world::rollout::{Acting, Playground, play};
///
/// let shape = PolicyShape { hidden: vec![16], initial_std: 0.5 };
/// let filter = {
///     let mut moments = Moments::default();
///     moments.add(&Rows::from_flat(vec![0.0, 0.0, 1.0, 1.0], 2)?); // observations that were seen
///     moments.filter()
/// };
/// let policy = Policy::untrained(&shape, filter, 1, Seed::new(1));
/// let playground = Playground::new(&rail);
/// let episodes = play(&playground, &policy, Acting::Mean, EnvVariant(0), Seed::new(2).many(3))?;
/// assert_eq!(episodes[0].steps(), 50);
/// assert!(playground.score(&episodes[0]) < 0.0);
/// assert_eq!(playground.success_rate(&episodes), Some(0.0));
/// # Ok::<(), demosift::Error>(())
/// ```
pub trait Task: Send + Sync {
    /// Sizes and names.
    fn specification(&self) -> &Specification;

    /// A new worker, which plays beside the others.
    ///
    /// # Errors
    /// `is_simulation` if the simulator cannot be set up.
    fn worker(&self) -> Result<Box<dyn Worker>>;

    /// K (§4.3).
    fn heuristic(&self) -> &dyn Heuristic;

    /// Whether an episode with these measurements, `[T+1, measurements]`, reached the task's goal;
    /// `None` where the task does not say. For training demonstrators and for reporting, never for judging.
    fn succeeded(&self, measurements: &Rows) -> Option<bool>;

    /// What others would report of an episode with these measurements, `[T+1, measurements]`: the sum of its true reward over
    /// the steps that were played; `None` where the task does not say. For reports only, never for judging.
    fn true_return(&self, _measurements: &Rows) -> Option<f64> {
        None
    }

    /// Whether an episode may end before its horizon; [`StepOutcome::terminated`] then says when.
    fn may_end_early(&self) -> bool {
        false
    }
}

/// A running instance of a task that is stepped from here, and whose steps cannot fail: what a [`Stepped`] worker plays in.
///
/// After [`reset`](Environment::reset) it behaves as a new instance would: what it did before leaves no trace.
pub trait Environment: Send {
    /// Starts an episode: fills the first observation `[obs]` and the first measurements `[measurements]`.
    fn reset(&mut self, variant: EnvVariant, seed: Seed, observation: &mut [f32], measurements: &mut [f32]);

    /// Takes one control step with an action `[act]`, which is clipped to [−1, 1] here.
    fn step(&mut self, action: &[f32], observation: &mut [f32], measurements: &mut [f32]) -> StepOutcome;

    /// Why the numbers of this episode are not finite, in the simulator's words, where it knows.
    fn trouble(&self) -> Option<String> {
        None
    }

    /// The state as a simulator keeps it, for replays; `None` where there is no simulator.
    fn simulator_state(&self) -> Option<SimulatorState<'_>> {
        None
    }
}

/// Generalized positions and velocities, in the simulator's own order and units.
#[derive(Clone, Copy, Debug)]
pub struct SimulatorState<'a> {
    /// `[nq]`.
    pub qpos: &'a [f64],
    /// `[nv]`.
    pub qvel: &'a [f64],
}

/// What a control step led to, apart from the observation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepOutcome {
    /// R_task with its shaping: for training demonstrators, never part of R_IL.
    pub task_reward: f32,
    /// Whether the new state is terminal, so that this step is the last one. Tasks of fixed horizon never say so (see the
    /// trap page on horizons).
    pub terminated: bool,
}

//! Recorded states played again: what the task would have measured in a demonstration.
//!
//! A state is set and everything that follows from it is computed (`mj_forward`); nothing is simulated.
//! So the measurements of a row are those of its moment, contacts included, and no drift adds up over the episode.
//! Only the row after the last action, which no recording holds, is simulated: by that action, from the last state.
//! The solver does not know where it stood before that step, so that one row may differ in its last digits.

use demosift::data::trajectory::StateLog;
use demosift::math::rows::Rows;
use demosift::world::environment::{Environment as _, Task as _};
use demosift::{Error, Result};

use crate::environment::MujocoEnvironment;
use crate::mujoco_task::MujocoTask;

/// A recorded episode in an environment that can be put at each of its steps.
pub struct Replay<'a> {
    environment: MujocoEnvironment,
    states: &'a StateLog,
    steps: usize,
}

impl<'a> Replay<'a> {
    /// Prepares an episode of `steps` states, `[steps, nq]` and `[steps, nv]`.
    ///
    /// # Errors
    /// `is_bad_input` if the states are not of the task's model.
    pub fn new(task: &MujocoTask, states: &'a StateLog, steps: usize) -> Result<Self> {
        let environment = task.mujoco_environment()?;
        let wanted = [environment.qpos().len(), environment.qvel().len()];
        for (name, values, width) in [("qpos", &states.qpos, wanted[0]), ("qvel", &states.qvel, wanted[1])] {
            if values.len() != steps * width {
                return Err(Error::bad_input(format!(
                    "{} numbers of {name} in {steps} steps do not fit the model of '{}', whose states have {width} each",
                    values.len(),
                    task.specification().name
                )));
            }
        }
        Ok(Self { environment, states, steps })
    }

    /// Number of states, T.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// The environment in the state of a step.
    ///
    /// # Errors
    /// `is_bad_input` if a number of the state is not finite.
    ///
    /// # Panics
    /// If there is no such step: a bug of the caller.
    pub fn at(&mut self, step: usize) -> Result<&mut MujocoEnvironment> {
        let Self { environment, states, .. } = self;
        let State { qpos, qvel } = State::of(states, step, environment);
        environment.set_state(qpos, qvel).map_err(|error| error.during(&format!("step {step}")))?;
        Ok(environment)
    }

    /// The environment in the state of a step, to which the action led from the state before.
    fn go_on_to(&mut self, step: usize, action: &[f32]) -> Result<&mut MujocoEnvironment> {
        let Self { environment, states, .. } = self;
        let State { qpos, qvel } = State::of(states, step, environment);
        environment.go_on_to(qpos, qvel, action).map_err(|error| error.during(&format!("step {step}")))?;
        Ok(environment)
    }
}

/// The state of one step.
struct State<'a> {
    qpos: &'a [f64],
    qvel: &'a [f64],
}

impl<'a> State<'a> {
    fn of(states: &'a StateLog, step: usize, environment: &MujocoEnvironment) -> Self {
        let (nq, nv) = (environment.qpos().len(), environment.qvel().len());
        Self {
            qpos: &states.qpos[step * nq..(step + 1) * nq],
            qvel: &states.qvel[step * nv..(step + 1) * nv],
        }
    }
}

/// What the task measures in a recorded episode, `[T+1, measurements]`, for its heuristic and its success.
///
/// `actions` are those of the episode, `[T, act]`; only the last one is used.
///
/// # Errors
/// `is_bad_input` if states or actions are not of this task, or a number in them is not finite.
pub fn measurements(task: &MujocoTask, states: &StateLog, actions: &Rows) -> Result<Rows> {
    let specification = task.specification();
    if actions.is_empty() || actions.width() != specification.action_size {
        return Err(Error::bad_input(format!(
            "{} actions of {} numbers; '{}' takes at least one, of {} numbers",
            actions.len(),
            actions.width(),
            specification.name,
            specification.action_size
        )));
    }
    let mut replay = Replay::new(task, states, actions.len())?;
    let mut observation = vec![0.0; specification.observation_size];
    let mut now = vec![0.0; specification.measurements.len()];
    let mut rows = Rows::with_capacity(now.len(), actions.len() + 1);
    for step in 0..replay.steps() {
        let environment = match step.checked_sub(1) {
            None => replay.at(step)?,
            Some(before) => replay.go_on_to(step, actions.row(before))?,
        };
        environment.observe(&mut observation, &mut now);
        rows.push(&now);
    }
    replay.environment.step(actions.row(actions.len() - 1), &mut observation, &mut now);
    rows.push(&now);
    match rows.first_not_finite() {
        None => Ok(rows),
        Some((step, column)) => Err(Error::bad_input(format!(
            "MuJoCo cannot simulate the state at step {step}: '{}' is {}",
            specification.measurements[column],
            rows.row(step)[column]
        ))),
    }
}

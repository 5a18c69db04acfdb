//! What an agent did in one episode: frozen, and checked when it is built.

use crate::basics::error::{Error, Result};
use crate::math::rows::Rows;

/// τ: one episode of an agent (§3).
///
/// With T actions there are T+1 observations and T+1 rows of measurements, the first of each taken after the reset.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    observations: Rows,
    actions: Rows,
    measurements: Rows,
    task_rewards: Vec<f32>,
    ended: Ended,
}

/// How an episode ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// It lasted to the horizon of its task.
    Horizon,
    /// Its last state was terminal.
    Terminated,
    /// The simulator stopped it before the horizon, in a state that was not terminal (`truncated` in Gymnasium).
    Truncated,
}

/// The parts of a [`Trajectory`] as they are collected, before the check.
#[derive(Clone, Debug)]
pub struct Parts {
    /// `[T+1, obs]`.
    pub observations: Rows,
    /// `[T, act]`, as the policy drew them, before the environment clips them to [−1, 1].
    pub actions: Rows,
    /// `[T+1, measurements]`: what the environment wrote down for the heuristic and for success.
    pub measurements: Rows,
    /// `[T]`: R_task, with shaping; trains demonstrators and never enters R_IL.
    pub task_rewards: Vec<f32>,
    /// How it ended; an episode that is terminal at its horizon is terminated.
    pub ended: Ended,
}

impl Trajectory {
    /// Freezes the parts of an episode after checking lengths and finiteness.
    pub fn new(parts: Parts) -> Result<Self> {
        let Parts { observations, actions, measurements, task_rewards, ended } = parts;
        let steps = actions.len();
        if steps == 0 {
            return Err(Error::bad_input("a trajectory needs at least one action, got none"));
        }
        for (what, found, wanted) in [
            ("observations", observations.len(), steps + 1),
            ("rows of measurements", measurements.len(), steps + 1),
            ("task rewards", task_rewards.len(), steps),
        ] {
            if found != wanted {
                return Err(Error::bad_input(format!(
                    "a trajectory of {steps} actions needs {wanted} {what}, got {found}"
                )));
            }
        }
        for (what, rows) in
            [("observation", &observations), ("action", &actions), ("measurement", &measurements)]
        {
            if let Some((step, column)) = rows.first_not_finite() {
                return Err(Error::diverged(format!(
                    "{what} {column} at step {step} is not a finite number"
                )));
            }
        }
        if let Some(step) = task_rewards.iter().position(|reward| !reward.is_finite()) {
            return Err(Error::diverged(format!("the task reward at step {step} is not a finite number")));
        }
        Ok(Self { observations, actions, measurements, task_rewards, ended })
    }

    /// Number of actions, T.
    pub fn steps(&self) -> usize {
        self.actions.len()
    }

    /// Observations, `[T+1, obs]`.
    pub fn observations(&self) -> &Rows {
        &self.observations
    }

    /// Actions, `[T, act]`.
    pub fn actions(&self) -> &Rows {
        &self.actions
    }

    /// Measurements, `[T+1, measurements]`.
    pub fn measurements(&self) -> &Rows {
        &self.measurements
    }

    /// R_task of each step, `[T]`.
    pub fn task_rewards(&self) -> &[f32] {
        &self.task_rewards
    }

    /// How it ended. Nothing learns from it; writers of demonstrations do say it.
    pub fn ended(&self) -> Ended {
        self.ended
    }

    /// Whether the last state was terminal.
    pub fn terminated(&self) -> bool {
        self.ended == Ended::Terminated
    }
}

/// The simulator's states of an episode, one row for each of its T actions: for replays, never for judging.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StateLog {
    /// Generalized positions, `[T, nq]` flat.
    pub qpos: Vec<f64>,
    /// Generalized velocities, `[T, nv]` flat.
    pub qvel: Vec<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts() -> Parts {
        let rows = |len: usize, width| Rows::from_flat(vec![0.5; len * width], width).expect("whole rows");
        Parts {
            observations: rows(4, 2),
            actions: rows(3, 1),
            measurements: rows(4, 3),
            task_rewards: vec![0.0; 3],
            ended: Ended::Horizon,
        }
    }

    #[test]
    fn three_actions_need_four_observations() {
        assert_eq!(Trajectory::new(parts()).expect("whole").steps(), 3);
        let short = Parts { observations: parts().observations.head(3), ..parts() };
        let error = Trajectory::new(short).expect_err("one lacks");
        assert_eq!(error.to_string(), "a trajectory of 3 actions needs 4 observations, got 3");
        let none = Parts { actions: Rows::with_capacity(1, 0), ..parts() };
        assert!(Trajectory::new(none).expect_err("no action").is_bad_input());
    }

    #[test]
    fn what_is_no_number_is_divergence_wherever_it_stands() {
        let broken = |change: fn(&mut Parts)| {
            let mut parts = parts();
            change(&mut parts);
            let error = Trajectory::new(parts).expect_err("not a number");
            assert!(error.is_diverged());
            error.to_string()
        };
        let observation = broken(|parts| parts.observations.flat_mut()[5] = f32::NAN);
        assert_eq!(observation, "observation 1 at step 2 is not a finite number");
        broken(|parts| parts.actions.flat_mut()[0] = f32::INFINITY);
        broken(|parts| parts.measurements.flat_mut()[11] = f32::NAN);
        let reward = broken(|parts| parts.task_rewards[1] = f32::NAN);
        assert_eq!(reward, "the task reward at step 1 is not a finite number");
    }
}

//! R_task: what demonstrators are trained on. It never enters R_IL, and never judges.

use demosift::world::fold::{Bound, Fold, FoldOf};
use demosift::{Error, Result};

use crate::task::columns::{self, column};
use crate::task::task_file;

/// What a task written in Rust adds to the task reward of a step.
pub trait RewardShaping: Send + Sync {
    /// The reward of one control step.
    fn reward(&self, step: &Transition<'_>) -> f64;
}

/// What one control step did.
#[derive(Clone, Copy, Debug)]
pub struct Transition<'a> {
    /// Measurements before the step, `[measurements]`, in the columns of the task's specification.
    pub before: &'a [f64],
    /// Measurements after the step, `[measurements]`.
    pub after: &'a [f64],
    /// The action, `[act]`, before it was clipped to [−1, 1].
    pub action: &'a [f32],
    /// The observation after the step, `[obs]`.
    pub observation: &'a [f32],
    /// Control steps taken in this episode, this one included.
    pub steps: usize,
    /// Control steps in an episode.
    pub horizon: usize,
}

/// The terms of `reward` in task.toml.
#[derive(Debug)]
pub(crate) enum Term {
    /// weight · measurement after the step.
    Value {
        column: usize,
        weight: f64,
    },
    /// weight · (after − before) / seconds of the control step.
    Rate {
        column: usize,
        weight: f64,
        control_step_secs: f64,
    },
    /// −weight · ‖a‖².
    ControlCost {
        weight: f64,
    },
    Constant(f64),
}

impl Term {
    /// Looks up the measurement of a term.
    ///
    /// # Errors
    /// If the measurement is unknown, or the term is not one of the four forms.
    pub(crate) fn resolve(
        file: &task_file::RewardTerm,
        measurements: &[String],
        control_step_secs: f64,
    ) -> Result<Self> {
        match (&file.measurement, &file.rate_of, file.control_cost, file.constant, file.weight) {
            (Some(name), None, None, None, weight) => {
                Ok(Self::Value { column: column(name, measurements)?, weight: weight.unwrap_or(1.0) })
            }
            (None, Some(name), None, None, weight) => {
                let column = column(name, measurements)?;
                Ok(Self::Rate { column, weight: weight.unwrap_or(1.0), control_step_secs })
            }
            (None, None, Some(weight), None, None) => Ok(Self::ControlCost { weight }),
            (None, None, None, Some(value), None) => Ok(Self::Constant(value)),
            _ => Err(Error::bad_config(
                "a term is one of: { measurement, weight }, { rate_of, weight }, { control_cost }, { constant }",
            )),
        }
    }

    /// The term as a formula, such as `-1 · reach`.
    pub(crate) fn words(&self, measurements: &[String]) -> String {
        match self {
            Self::Value { column, weight } => format!("{weight} · {}", measurements[*column]),
            Self::Rate { column, weight, .. } => format!("{weight} · rate of {}", measurements[*column]),
            Self::ControlCost { weight } => format!("-{weight} · |action|²"),
            Self::Constant(value) => value.to_string(),
        }
    }

    /// The term's share in the reward of a step.
    pub(crate) fn of(&self, step: &Transition<'_>) -> f64 {
        match *self {
            Self::Value { column, weight } => weight * step.after[column],
            Self::Rate { column, weight, control_step_secs } => {
                weight * ((step.after[column] - step.before[column]) / control_step_secs)
            }
            Self::ControlCost { weight } => {
                -weight * step.action.iter().map(|a| f64::from(*a) * f64::from(*a)).sum::<f64>()
            }
            Self::Constant(value) => value,
        }
    }
}

/// When an episode is a success, and what that pays.
#[derive(Debug)]
pub(crate) struct Success {
    pub(crate) fold: Fold,
    pub(crate) bound: Bound,
    pub(crate) reward: f64,
}

impl Success {
    /// Looks up the measurements of `[success]`.
    ///
    /// # Errors
    /// As [`Fold::resolve`], or if there is not exactly one of `above` and `below`.
    pub(crate) fn resolve(file: &task_file::Success, measurements: &[String]) -> Result<Self> {
        let bound = match (file.above, file.below) {
            (Some(bound), None) => Bound::Above(bound),
            (None, Some(bound)) => Bound::Below(bound),
            _ => return Err(Error::bad_config("needs exactly one of: above, below")),
        };
        let fold = FoldOf {
            fold: file.fold,
            of: file.of.clone(),
            negate: false,
            when: file.when.clone(),
            as_long_as: file.as_long_as.clone(),
            otherwise: file.otherwise,
            unit: String::new(),
        };
        Ok(Self { fold: Fold::resolve(&fold, &columns::named(measurements))?, bound, reward: file.reward })
    }
}

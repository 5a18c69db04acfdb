//! What a study is made of: sets, what is known of them, and trainings on subsets of them.

use serde::{Deserialize, Serialize};

use super::choice::Choice;
use crate::learning::adapt::Rule;

/// Consecutive seeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Seeds {
    /// The first.
    pub first: u64,
    /// How many.
    pub count: usize,
}

impl Seeds {
    /// Each of them.
    pub fn each(self) -> impl Iterator<Item = u64> + Clone {
        (0..self.count as u64).map(move |index| self.first + index)
    }
}

/// A set with what is known of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Set {
    /// Its name in the study.
    pub name: String,
    /// The task in which it is judged.
    pub task: String,
    /// The one variant of the task, where it has several.
    pub variant: Option<String>,
    /// Of the heuristic.
    pub unit: String,
    /// Which episodes of its file it consists of; all, if it does not say. Its own ids count from 0.
    pub episodes: Option<Vec<usize>>,
    /// How many demonstrations it has.
    pub demonstrations: usize,
    /// With which seeds it is judged.
    pub seeds: Seeds,
    /// With which seeds the oracle learns; none, if there is no oracle.
    pub oracle_seeds: Seeds,
    /// Whether regret is asked for.
    pub regret: bool,
    /// What is known to be true of each demonstration, beside the oracle.
    pub known: Vec<Known>,
    /// The set on which each method learns its prior, where that is another.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<String>,
    /// The task in whose body each demonstration was made, where that is to be shown; nothing judges by it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bodies: Vec<String>,
    /// Whether each demonstration reached the goal where it was recorded, where that is known and bodies are; shown beside these.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub succeeded: Vec<bool>,
    /// The variant under which each demonstration was recorded, where that is to be shown; nothing judges by it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub recorded_under: Vec<String>,
    /// The task whose body the agent has, where that is not the name of `task`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
}

impl Set {
    /// Whether each demonstration was made by another body than the agent's; nothing, where it is not known.
    pub fn by_others(&self) -> Vec<bool> {
        let own = self.body.as_ref().unwrap_or(&self.task);
        self.bodies.iter().map(|body| body != own).collect()
    }
}

/// What is known of the demonstrations of a set, such as their returns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Known {
    /// What it is: `return` or `stage`.
    pub kind: String,
    /// One per demonstration, higher is better.
    pub values: Vec<f64>,
}

/// Trainings on subsets, for their own sake.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Pool {
    /// Of which set.
    pub set: String,
    /// On which of its subsets.
    pub subsets: Vec<Choice>,
    /// Who learns.
    pub imitator: Rule,
    /// How often, with the same seeds for each subset.
    pub trainings: Seeds,
}

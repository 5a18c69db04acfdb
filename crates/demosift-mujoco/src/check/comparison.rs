//! A set beside a task: what was seen of each demonstration.

use demosift::world::heuristic::Score;
use serde::Serialize;

use super::Drift;

/// Where the simulator's states of demonstrations are known from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum StatesFrom {
    /// The set holds them.
    Recording,
    /// The task observes every velocity, and every position but where on the floor something stands, such as how far a runner has come.
    Observations,
    /// They are not known, so nothing is played again.
    Nowhere,
}

/// A set in a task.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Recorded {
    /// Where the states are known from.
    pub states: StatesFrom,
    /// One entry for each demonstration, in file order.
    pub demonstrations: Vec<Compared>,
}

/// A demonstration in a task.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Compared {
    /// T.
    pub steps: usize,
    /// Numbers of its actions outside [−1, 1], which are clipped.
    pub outside: usize,
    /// The largest number of its actions, without sign.
    pub largest_action: f64,
    /// The share of a step's change that its actions miss, each taken in its own recorded state: 0 is the same physics, 1 as
    /// good as no prediction. Root mean square, in which a few hard contacts may outweigh all else; `None` without states.
    pub missed: Option<f64>,
    /// The same share of a typical step, the median of those in which something moves; `None` without states.
    pub typically_missed: Option<f64>,
    /// How far its actions, played again from its first state, go from what was recorded; `None` without states.
    pub drift: Option<Drift>,
    /// The task's heuristic of what was recorded; `None` without states.
    pub score: Option<Score>,
    /// Whether it was a success; `None` without states, or if the task does not say.
    pub succeeded: Option<bool>,
}

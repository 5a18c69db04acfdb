//! Somebody else's way to learn from demonstrations: what it makes is played here, and judged by the same heuristic.

use serde::{Deserialize, Serialize};

use crate::basics::error::Result;
use crate::basics::seed::Seed;
use crate::data::demonstration::{DemoId, DemonstrationSet};

/// Which trainer it is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TrainerIdentity {
    /// Its name for people, such as `my_train.py:train`.
    pub name: String,
    /// Hash of the file that it is in, where that is known: with another file it is another trainer.
    // Written where it is not known too: a checkpoint names no fields, and would be read as another.
    #[serde(default)]
    pub sha256: Option<String>,
}

/// Learns from demonstrations in a way of its own.
pub trait Trainer: Send + Sync {
    /// Which one it is.
    fn identity(&self) -> &TrainerIdentity;

    /// Learns from these demonstrations of a set, from nothing; `seed` is that of all its random numbers.
    ///
    /// # Errors
    /// `is_bad_input` if what it returns is no policy, `is_simulation` if it fails or takes too long.
    fn train(&self, set: &DemonstrationSet, demos: &[DemoId], seed: &Seed) -> Result<Box<dyn Apprentice>>;
}

/// A policy that somebody else has trained. It plays one episode after the other.
pub trait Apprentice: Send {
    /// A new episode begins.
    ///
    /// # Errors
    /// Those of the policy.
    fn begin(&mut self) -> Result<()>;

    /// Fills the action `[act]` on an observation `[obs]`, where −1 and 1 are the ends of what is possible.
    ///
    /// # Errors
    /// `is_bad_input` if it is not an action, `is_simulation` if the policy fails or takes too long.
    fn act(&mut self, observation: &[f32], action: &mut [f32]) -> Result<()>;

    /// The policy as an ONNX file, where it is one.
    fn onnx(&self) -> Option<&[u8]> {
        None
    }
}

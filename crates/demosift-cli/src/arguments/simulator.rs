//! What says which environment of Python is played in, and how.

use std::path::PathBuf;

use clap::Args;

/// A simulator of the user's own, in place of a task.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Your own simulator, in Python")]
pub(crate) struct SimulatorArguments {
    /// An environment of Gymnasium instead of --task: gymnasium:HalfCheetah-v5, my_env.py:make, package.module:make, or
    /// from-set for the one that a set of Minari or robomimic names; see docs/simulators.md
    #[arg(long, value_name = "ENV", conflicts_with = "task")]
    pub(crate) env: Option<String>,
    /// The Python interpreter in which the environment or the trainer works, such as .venv/bin/python [default: python3]
    #[arg(long, value_name = "PATH")]
    pub(crate) python: Option<PathBuf>,
    /// Processes that play at once, each with an environment; more than there are processors make sense where the
    /// environment waits. The results do not depend on it [default: as many as --threads]
    #[arg(long, value_name = "N")]
    pub(crate) workers: Option<usize>,
    /// Steps of an episode [default: as the environment says, or as the longest demonstration of a robomimic set]
    #[arg(long, value_name = "N")]
    pub(crate) horizon: Option<usize>,
    /// What a good episode is, higher being better: sum, mean, last, max, min, any, last_minus_first or count of the reward or
    /// of a number in info, such as "any is_success", "max height" or "negated min gap"; or a function of a whole episode,
    /// my_env.py:score, called as score(observations, actions, rewards) [default: sum reward]
    #[arg(long, value_name = "WORDS")]
    pub(crate) heuristic: Option<String>,
    /// More numbers for the heuristic: my_env.py:measure, a function measure(env, obs, reward, info) that returns a dict of
    /// numbers after each step
    #[arg(long, value_name = "FILE.py:FUNCTION")]
    pub(crate) measure: Option<String>,
    /// How long a start, a reset, a step or an action may take before it counts as hanging [default: 60]
    #[arg(long, value_name = "SECONDS")]
    pub(crate) time_limit: Option<u64>,
    /// Run code that the set names, if its environment is not registered here (for --env from-set)
    #[arg(long)]
    pub(crate) trust_set: bool,
}

impl SimulatorArguments {
    /// Whether they name files in the place of those of an earlier run.
    pub(crate) fn names_files(&self) -> bool {
        [&self.env, &self.heuristic, &self.measure].iter().any(|named| named.is_some())
    }
}

//! What says by whose trainer final policies are trained besides ours.

use clap::Args;

/// A trainer of the user's own, for the referee and as a judge.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Your own trainer, in Python")]
pub(crate) struct TrainerArguments {
    /// The referee also asks your own trainer what to train on: my_train.py:train, or package.module:train, a function
    /// train(demonstrations, seed) that returns a policy; with --judge trainer it judges too; it works in the interpreter of
    /// --python, see docs/simulators.md
    #[arg(long, value_name = "FILE.py:FUNCTION")]
    pub(crate) trainer: Option<String>,
    /// How long one training by it may take before it counts as hanging [default: 21600, six hours]
    #[arg(long, value_name = "SECONDS")]
    pub(crate) trainer_timeout: Option<u64>,
}

//! What commands take whose work has parts.

use clap::Args;
use demosift::basics::part::Part;

use super::JobArguments;

/// Which part of a run's work is done, on one of several machines that share its folder.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct PartArgument {
    /// Do every N-th piece of the work only, from the I-th on: machines that share the run folder take one part each, and the
    /// same command with --resume and without --part collects what they made (docs/cluster.md)
    #[arg(long, value_name = "I/N")]
    pub(crate) part: Option<Part>,
}

/// What `demosift referee` takes.
#[derive(Debug, Args)]
pub(crate) struct RefereeArguments {
    #[command(flatten)]
    pub(crate) job: JobArguments,
    #[command(flatten)]
    pub(crate) part: PartArgument,
}

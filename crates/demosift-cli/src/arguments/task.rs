//! What `demosift task` and `demosift tasks` take.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::{SetArguments, SimulatorArguments, examples};

/// What is done with a task alone.
#[derive(Debug, Subcommand)]
pub(crate) enum TaskCommand {
    /// Say what a task is made of, try it with random actions and with demonstrations, and tell what is wrong
    Check(TaskCheckArguments),
    /// Write a first task.toml for a model, which observes what a set holds as far as that can be told
    New(TaskNewArguments),
}

#[derive(Debug, Args)]
#[command(after_help = examples::TASK_NEW)]
pub(crate) struct TaskNewArguments {
    /// The model: an MJCF file
    #[arg(value_name = "MODEL.xml")]
    pub(crate) model: PathBuf,
    /// Demonstrations that the task is for
    #[arg(long, value_name = "SET")]
    pub(crate) data: Option<PathBuf>,
    /// The folder of the task [default: that of the model]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) storage: SetArguments,
}

#[derive(Debug, Args)]
#[command(after_help = examples::TASK_CHECK)]
pub(crate) struct TaskCheckArguments {
    /// The task: the path of a folder with a task.toml, or a name (see `demosift tasks`)
    #[arg(value_name = "PATH|NAME", required_unless_present = "env")]
    pub(crate) task: Option<String>,
    /// Demonstrations to compare with it
    #[arg(long, value_name = "SET")]
    pub(crate) data: Option<PathBuf>,
    /// The root of the random actions
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Print the results as JSON
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) simulator: SimulatorArguments,
    #[command(flatten)]
    pub(crate) storage: SetArguments,
}

#[derive(Debug, Args)]
pub(crate) struct TasksArguments {
    /// Print the list as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

//! The command line as it is typed; [`crate::job`] resolves it.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use demosift::preset::Preset;
use demosift::select::Keep;

/// Which demonstrations should your agent learn from? Finds out by imitating each one.
#[derive(Debug, Parser)]
#[command(name = "demosift", version, arg_required_else_help = true)]
pub(crate) struct Demosift {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// The whole job: rank the demonstrations, keep the best, and show that this was worth it
    Sift(JobArguments),
    /// Train a demonstrator and record its episodes at stages from hopeless to successful
    Record(RecordArguments),
    /// Learn a policy that can imitate any demonstration of the set within a few updates
    MetaTrain(JobArguments),
    /// Imitate each demonstration and score what comes out
    Judge(JobArguments),
    /// Rank the demonstrations and keep the best
    Select(JobArguments),
    /// Imitate from scratch: the kept demonstrations beside all of them, or those that you name
    Imitate(ImitateArguments),
    /// Imitate each demonstration alone from scratch with the full budget: what a ranking is compared with
    Oracle(OracleArguments),
    /// List the tasks that come with demosift
    Tasks(TasksArguments),
}

/// What every stage of the job needs.
#[derive(Debug, Args)]
pub(crate) struct JobArguments {
    /// The demonstrations: an .hdf5 file in D4RL layout, or a folder that holds demonstrations.hdf5
    #[arg(value_name = "SET")]
    pub(crate) demonstrations: Option<PathBuf>,
    /// Keep the K most suitable demonstrations; auto keeps those that surely make the agent better and are not surely
    /// less than half as good as the best [default: quarter, that is a quarter of the set]
    #[arg(long, value_name = "K|auto")]
    pub(crate) keep: Option<Keep>,
    #[command(flatten)]
    pub(crate) run: RunArguments,
}

/// What every run needs, whatever it is about.
#[derive(Debug, Args)]
pub(crate) struct RunArguments {
    /// The task: a name (see `demosift tasks`), or the path of a folder with a task.toml
    #[arg(long, value_name = "NAME|PATH")]
    pub(crate) task: Option<String>,
    /// The root of all random numbers [default: 0]
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// How much to spend [default: standard]
    #[arg(long, value_enum)]
    pub(crate) preset: Option<PresetName>,
    /// A TOML file of values that differ from the preset's
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// One value that differs, such as judge.iterations=3; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// The run folder [default: runs/<task>]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Go on with a run folder that exists
    #[arg(long)]
    pub(crate) resume: bool,
    /// Threads to play on; the results do not depend on it [default: all processors]
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Print the results as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct ImitateArguments {
    /// Imitate these demonstrations instead, such as 0,3,7
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    pub(crate) demonstration_ids: Vec<usize>,
    #[command(flatten)]
    pub(crate) job: JobArguments,
}

#[derive(Debug, Args)]
pub(crate) struct OracleArguments {
    /// How often each demonstration is imitated, each time with another seed
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub(crate) repeats: usize,
    #[command(flatten)]
    pub(crate) job: JobArguments,
}

#[derive(Debug, Args)]
pub(crate) struct RecordArguments {
    /// How many demonstrations to record, each at a stage of its own [default: 8]
    #[arg(long, value_name = "N")]
    pub(crate) count: Option<usize>,
    #[command(flatten)]
    pub(crate) run: RunArguments,
}

#[derive(Debug, Args)]
pub(crate) struct TasksArguments {
    /// Print the list as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// [`demosift::preset::Preset`] as it is typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PresetName {
    /// Minutes; proves that it runs, and ranks roughly
    Quick,
    /// Half an hour a set on two cores
    Standard,
    /// The paper's values
    Paper,
}

impl From<PresetName> for Preset {
    fn from(name: PresetName) -> Self {
        match name {
            PresetName::Quick => Self::Quick,
            PresetName::Standard => Self::Standard,
            PresetName::Paper => Self::Paper,
        }
    }
}

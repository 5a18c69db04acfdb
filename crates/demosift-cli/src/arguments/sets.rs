//! What the subcommands take that read, write and pass on sets.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::SetArguments;

#[derive(Debug, Args)]
pub(crate) struct InspectArguments {
    /// The demonstrations
    #[arg(value_name = "SET")]
    pub(crate) demonstrations: PathBuf,
    /// Whether they fit this task: a name (see `demosift tasks`), or the path of a folder with a task.toml
    #[arg(long, value_name = "NAME|PATH")]
    pub(crate) task: Option<String>,
    /// Write a page that shows each episode among the others, the oddest first, into this file
    #[arg(long, value_name = "FILE")]
    pub(crate) html: Option<PathBuf>,
    /// Print the results as JSON
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) source: SetArguments,
}

#[derive(Debug, Args)]
pub(crate) struct ConvertArguments {
    /// The demonstrations
    #[arg(value_name = "SET")]
    pub(crate) demonstrations: PathBuf,
    /// A new folder
    #[arg(value_name = "OUT")]
    pub(crate) out: PathBuf,
    /// The format to write
    #[arg(long, value_enum)]
    pub(crate) to: Target,
    /// The task that was shown, by whose name LeRobot knows it; it also says the rate of the steps where neither the source nor
    /// its set.toml does
    #[arg(long, value_name = "NAME|PATH")]
    pub(crate) task: Option<String>,
    /// Steps in a second, which LeRobot wants to know [default: as the source says, else its set.toml, else the task]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) fps: Option<u32>,
    /// Print what was written as JSON
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) source: SetArguments,
}

/// A format that is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Target {
    /// A LeRobot v3.0 folder
    Lerobot,
    /// A Minari folder in HDF5
    Minari,
}

#[derive(Debug, Args)]
pub(crate) struct ExportArguments {
    /// The run folder
    #[arg(value_name = "RUN")]
    pub(crate) run: PathBuf,
    /// What to make of the kept demonstrations, or of the policies
    #[arg(long = "as", value_enum, value_name = "FORM")]
    pub(crate) form: Form,
    /// Where the demonstrations are now, if they have moved since
    #[arg(long, value_name = "SET")]
    pub(crate) data: Option<PathBuf>,
    /// A new file or folder [default for words: standard output]
    #[arg(long, value_name = "PATH")]
    pub(crate) out: Option<PathBuf>,
    /// Name of the robomimic filter key [default: demosift]
    #[arg(long, value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// Steps in a second, which LeRobot wants to know [default: as the source says, else its set.toml, else the task of the
    /// run]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) fps: Option<u32>,
    /// Export these demonstrations instead, such as 0,3,7
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    pub(crate) demonstration_ids: Vec<usize>,
    /// Allow robomimic-filter-key to add the key to the file of the demonstrations
    #[arg(long)]
    pub(crate) edit_my_file: bool,
}

/// What the kept demonstrations are passed on as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Form {
    /// The list that LeRobot takes as --dataset.episodes
    LerobotEpisodes,
    /// A LeRobot v3.0 folder of the kept demonstrations
    Lerobot,
    /// A Minari folder of the kept demonstrations; from one in HDF5, with all that it holds of them
    Minari,
    /// A filter key in the robomimic file itself
    RobomimicFilterKey,
    /// Every demonstration with its score, interval, weight and whether it was kept, and where all this came from
    Json,
    /// The same as a table
    Csv,
    /// A folder with each policy that the run trained, observation filter and action scaling inside; runs write these
    /// beside the safetensors by themselves
    Onnx,
}

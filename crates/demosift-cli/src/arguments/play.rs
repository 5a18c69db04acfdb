//! What `demosift play` takes.

use std::path::PathBuf;

use clap::Args;

use super::{SimulatorArguments, SourceArguments};

#[derive(Debug, Args)]
#[group(id = "source", required = true, multiple = false, args = ["policy", "data"])]
pub(crate) struct PlayArguments {
    /// The task: a name (see `demosift tasks`), or the path of a folder with a task.toml [default: that of the policy's run]
    #[arg(long, value_name = "NAME|PATH")]
    pub(crate) task: Option<String>,
    /// Play this policy: a policy_*.safetensors of a run folder
    #[arg(long, value_name = "FILE")]
    pub(crate) policy: Option<PathBuf>,
    /// Replay demonstrations of this set from their recorded states: one that `demosift record` or `demosift convert` made;
    /// with --env play their recorded actions again, from the seeds of a set of Minari or the states of one of robomimic
    #[arg(long, value_name = "SET")]
    pub(crate) data: Option<PathBuf>,
    /// Which demonstrations, such as 1,0,4, in this order [default: all]
    #[arg(long, value_name = "ID", value_delimiter = ',', num_args = 1.., conflicts_with = "policy")]
    pub(crate) demonstration: Vec<usize>,
    /// How many episodes the policy plays
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with = "data")]
    pub(crate) episodes: usize,
    /// Which variant of the task the policy plays [default: that of its run, if this was about one; else the first]
    #[arg(long, value_name = "NAME", conflicts_with = "data")]
    pub(crate) variant: Option<String>,
    /// The root of the random numbers of the policy's episodes
    #[arg(long, value_name = "N", default_value_t = 0, conflicts_with = "data")]
    pub(crate) seed: u64,
    /// Draw actions as in training, instead of taking the policy's mean
    #[arg(long, conflicts_with = "data")]
    pub(crate) sampled: bool,
    /// Print the results as JSON
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) simulator: SimulatorArguments,
    #[command(flatten)]
    pub(crate) pictures: PictureArguments,
    #[command(flatten)]
    pub(crate) storage: SourceArguments,
}

/// Which pictures are made, and how.
#[derive(Debug, Args)]
#[command(next_help_heading = "Pictures")]
pub(crate) struct PictureArguments {
    /// Write a PNG of every step
    #[arg(long)]
    pub(crate) frames: bool,
    /// Write a contact sheet, sheet.png: a row an episode
    #[arg(long)]
    pub(crate) sheet: bool,
    /// Write a clip, clip.gif: one episode after the other
    #[arg(long)]
    pub(crate) clip: bool,
    /// How many moments of an episode a contact sheet shows
    #[arg(long, value_name = "N", default_value_t = 6)]
    pub(crate) moments: usize,
    /// The camera of the model to look from [default: the one that the task names as its best]
    #[arg(long, value_name = "NAME")]
    pub(crate) camera: Option<String>,
    /// Pixels of a picture
    #[arg(long, value_name = "WxH", default_value = "320x240", value_parser = size)]
    pub(crate) size: (usize, usize),
    /// A new folder for the pictures [default: beside the run folder that the policy lies in, <run>_pictures; else
    /// runs/<task>_pictures]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

fn size(typed: &str) -> Result<(usize, usize), String> {
    let sides =
        typed.split_once('x').and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    sides.ok_or_else(|| "wanted width and height in pixels, such as 320x240".to_owned())
}

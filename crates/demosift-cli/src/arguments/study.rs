//! What `demosift study` takes.

use std::path::PathBuf;

use clap::Args;
use demosift::basics::part::Part;

#[derive(Debug, Args)]
pub(crate) struct StudyArguments {
    /// A study file (docs/studies.md), or a file of results that an earlier study made, whose tables are then shown
    #[arg(value_name = "STUDY.toml|RESULTS.json")]
    pub(crate) study: PathBuf,
    /// The folder of the public sets that do not come with demosift; a set that is not there is left out
    #[arg(long, value_name = "DIR")]
    pub(crate) data: Option<PathBuf>,
    /// Where finished cells are kept; what is there already is not made again [default: runs/<study>]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) cells: CellArguments,
    /// Only these sets, methods or both, such as free_throw_8/cloning,oracle or /paper; oracle, regret, pools and curves name
    /// trainings, and weights the selections by weights
    #[arg(long, value_name = "SETS/METHODS")]
    pub(crate) only: Option<OnlyThese>,
    /// Say how many cells there are and what they cost; make nothing
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// Make nothing; show the tables of what is finished
    #[arg(long, conflicts_with = "dry_run")]
    pub(crate) table: bool,
    /// Print the tables as Markdown
    #[arg(long, conflicts_with = "json")]
    pub(crate) markdown: bool,
    /// Print the results as JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Copy the file of results here
    #[arg(long, value_name = "FILE", conflicts_with = "dry_run")]
    pub(crate) write: Option<PathBuf>,
}

/// Which cells are made, and which are taken over.
#[derive(Debug, Args)]
pub(crate) struct CellArguments {
    /// Take over the finished cells of this file of results, as far as they are of the same version, sets and values; may be
    /// given several times
    #[arg(long, value_name = "RESULTS.json")]
    pub(crate) from: Vec<PathBuf>,
    /// Cells that are made at the same time, each on a thread of its own [default: all processors]
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Make every N-th cell only, from the I-th on; machines that share the folder take one part each
    #[arg(long, value_name = "I/N")]
    pub(crate) part: Option<Part>,
}

impl CellArguments {
    /// Whether they ask for cells that are made or taken over.
    pub(crate) fn are_made(&self) -> bool {
        !self.from.is_empty() || self.part.is_some()
    }
}

/// Names of sets and methods, as they are typed; which names there are, the study says.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct OnlyThese {
    pub(crate) sets: Option<String>,
    pub(crate) methods: Option<String>,
}

impl std::str::FromStr for OnlyThese {
    type Err = String;

    fn from_str(typed: &str) -> Result<Self, String> {
        let list = |list: &str| (!list.trim().is_empty()).then(|| list.to_owned());
        let (sets, methods) = typed.split_once('/').unwrap_or((typed, ""));
        Ok(Self { sets: list(sets), methods: list(methods) })
    }
}

//! What `demosift reproduce` takes.

use std::path::PathBuf;

use clap::Args;

use super::PresetName;
use super::study::{CellArguments, OnlyThese};

#[derive(Debug, Args)]
pub(crate) struct ReproduceArguments {
    /// An experiment of the paper: fig3, fig4 (with fig10), fig5, fig6, fig7, fig8, fig9, table1, variants, or all of them; or a study file
    /// of your own that draws figures (docs/studies.md); or results that an earlier one made, to be drawn again: a file, or a
    /// folder of such files
    #[arg(value_name = "NAME|STUDY.toml|RESULTS.json|DIR")]
    pub(crate) experiment: String,
    /// How much to spend: quick proves that it runs, with two seeds and small budgets, in minutes; standard has ten seeds, and
    /// most experiments take hours of a processor; paper has the paper's values, and takes much longer; --dry-run counts what
    /// is to be made [possible values: quick, standard, paper] [default: standard, or what the study file says]
    // The texts of the values are about a run of one set.
    #[arg(long, value_enum, hide_possible_values = true)]
    pub(crate) preset: Option<PresetName>,
    /// Seeds, each of one judging and one training a method and set [default: as the preset says]
    #[arg(long, value_name = "N")]
    pub(crate) seeds: Option<usize>,
    /// The folder of the demonstration sets of the paper's tasks; for a study file of your own, that of the public sets
    /// [default: data, as in a checkout of demosift]
    #[arg(long, value_name = "DIR")]
    pub(crate) data: Option<PathBuf>,
    /// Where finished cells are kept, for all experiments together, since they share many; what is there already is not made
    /// again [default: runs/reproduce/<preset>]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) cells: CellArguments,
    /// Only these sets, methods or both, such as handstand_15/MAML,curves; weights and curves name the selections by weights,
    /// and the trainings on what is kept
    #[arg(long, value_name = "SETS/METHODS")]
    pub(crate) only: Option<OnlyThese>,
    /// Say how many cells there are and what they cost; make nothing
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// Make no cells; draw and show what is finished
    #[arg(long, conflicts_with = "dry_run")]
    pub(crate) table: bool,
    /// Write the page, with its figures, numbers and results beside it, to this file, or to files in this folder
    /// [default: <out>/<name>.md, and none by a --part]
    #[arg(long, value_name = "FILE.md|DIR", conflicts_with = "dry_run")]
    pub(crate) page: Option<PathBuf>,
    /// Write a page here that says of each claim of these experiments whether it holds
    #[arg(long, value_name = "FILE.md", conflicts_with = "dry_run")]
    pub(crate) summary: Option<PathBuf>,
    /// The commit that made the results, for the page
    #[arg(long, value_name = "COMMIT")]
    pub(crate) commit: Option<String>,
    /// The machine that made the results, for the page
    #[arg(long, value_name = "WORDS")]
    pub(crate) machine: Option<String>,
    /// Print the results as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

impl PresetName {
    /// As a study file writes it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Quick => "quick",
            Self::Standard => "standard",
            Self::Paper => "paper",
        }
    }
}

//! `demosift select`: ScoreTable → Ranking, Uncertainty, Subset.

use demosift::Result;
use demosift::artifact::Artifact;
use demosift::experiment::{self, Run, Selection};
use demosift::forecast::Goal;
use demosift::select::Keep;
use demosift::subset_selection::Weighing;
use serde_json::json;

use super::{dry_run, kept_in};
use crate::arguments::JobArguments;
use crate::job::{Job, Prior};
use crate::tables::judgment::{self, Judgment};
use crate::tables::{costs, weights};
use crate::terminal;

pub(crate) fn run(arguments: &JobArguments) -> Result<()> {
    let mut job = Job::open(arguments, Prior::Needed)?;
    if arguments.run.dry_run {
        return dry_run::of_job(&mut job, Goal::Selection, &arguments.run);
    }
    let Selection { ranking, uncertainty, subset } = job.run(selection)?;
    let (weighing, costs) = (weighing(&mut job)?, job.costs()?);
    if arguments.run.json {
        terminal::show_json(&json!({
            "ranking": ranking.entries,
            "uncertainty": uncertainty,
            "caveat": uncertainty.caveat(),
            "kept": subset.demos,
            "weighing": weighing,
            "costs": costs::as_json(&costs),
            "unit": job.unit(),
            "variant": job.variant(),
            "run_folder": job.folder().path(),
        }));
        return Ok(());
    }
    let judgment =
        Judgment { set: job.set(), ranking: &ranking, uncertainty: &uncertainty, unit: job.unit() };
    terminal::show(&judgment::ranking(&judgment, Some((&subset, job.keep()))));
    terminal::show(&weighing.map_or(String::new(), |weighing| format!("\n{}", weights::trends(&weighing))));
    terminal::show(&costs::played(&costs));
    terminal::show(&kept_in(job.folder(), job.variant()));
    Ok(())
}

/// All arrows up to the selection.
pub(super) fn selection(run: &mut Run<'_>) -> Result<Selection> {
    let panel = experiment::panel(run)?;
    experiment::selection(run, &panel)
}

/// How the demonstrations were weighed, where the subset came of that.
pub(super) fn weighing(job: &mut Job) -> Result<Option<Weighing>> {
    match job.keep() {
        Keep::Weights => job.run(|run| Weighing::recall(run.ledger, "")),
        _ => Ok(None),
    }
}

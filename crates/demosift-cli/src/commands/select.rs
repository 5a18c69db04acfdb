//! `demosift select`: ScoreTable → Ranking, Uncertainty, Subset.

use demosift::Result;
use demosift::experiment::{self, Run, Selection};
use serde_json::json;

use super::kept_in;
use crate::arguments::JobArguments;
use crate::job::Job;
use crate::tables::judgment::{self, Judgment};
use crate::terminal;

pub(crate) fn run(arguments: &JobArguments) -> Result<()> {
    let mut job = Job::open(arguments)?;
    let Selection { ranking, uncertainty, subset } = job.run(selection)?;
    if arguments.run.json {
        terminal::show_json(&json!({
            "ranking": ranking.entries,
            "uncertainty": uncertainty,
            "caveat": uncertainty.caveat(),
            "kept": subset.demos,
            "unit": job.unit(),
            "run_folder": job.folder().path(),
        }));
        return Ok(());
    }
    let judgment =
        Judgment { set: job.set(), ranking: &ranking, uncertainty: &uncertainty, unit: job.unit() };
    terminal::show(&judgment::ranking(&judgment, Some((&subset, job.keep()))));
    terminal::show(&kept_in(job.folder()));
    Ok(())
}

/// All arrows up to the selection.
pub(super) fn selection(run: &mut Run<'_>) -> Result<Selection> {
    let prior = experiment::prior(run)?;
    let scores = experiment::scores(run, &prior)?;
    experiment::selection(run, &scores)
}
